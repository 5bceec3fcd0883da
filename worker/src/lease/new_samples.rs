//! The samples of an attempt that the server does not have yet.

use roost_api::Series;
use roost_api::lease::SeriesPart;

/// The samples of each series that the server has confirmed, and those of the last heartbeat.
#[derive(Debug, Default)]
pub(super) struct NewSamples {
    known: Vec<Series>,
    sent: Vec<SeriesPart>,
}

impl NewSamples {
    /// The new samples, as many as `limit` allows, which it lowers.
    pub(super) fn since(&mut self, series: &[Series], limit: &mut usize) -> Vec<SeriesPart> {
        self.sent.clear();
        for series in series {
            let known = self.known.iter().find(|known| known.name == series.name);
            let from = known.map_or(0, |known| alike(known, series));
            let to = series.t_s.len().min(from + *limit);
            let is_shorter = known.is_some_and(|known| known.t_s.len() > series.t_s.len());
            if to > from || is_shorter {
                *limit -= to - from;
                self.sent.push(SeriesPart {
                    name: series.name.clone(),
                    unit: series.unit.clone(),
                    from: from as u64,
                    t_s: series.t_s[from..to].to_vec(),
                    values: series.values[from..to].to_vec(),
                });
            }
        }
        self.sent.clone()
    }

    /// The server has confirmed the last heartbeat, or has lost the samples before it.
    pub(super) fn arrived(&mut self, lost: bool) {
        let sent = std::mem::take(&mut self.sent);
        if lost {
            return self.known.clear();
        }
        for SeriesPart { name, unit, from, t_s, values } in sent {
            let at = self.known.iter().position(|known| known.name == name).unwrap_or_else(|| {
                self.known.push(Series { name, unit, t_s: Vec::new(), values: Vec::new() });
                self.known.len() - 1
            });
            let known = &mut self.known[at];
            known.t_s.truncate(from as usize);
            known.values.truncate(from as usize);
            known.t_s.extend(t_s);
            known.values.extend(values);
        }
    }
}

/// The number of equal samples at the start of both. Times shift until the start of the belt is known.
fn alike(known: &Series, series: &Series) -> usize {
    let pairs =
        |series: &Series| series.t_s.iter().copied().zip(series.values.iter().copied()).collect::<Vec<_>>();
    pairs(known).iter().zip(&pairs(series)).take_while(|(one, other)| one == other).count()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn series(values: &[f64]) -> Series {
        let t_s = (0..values.len()).map(|k| k as f64).collect();
        Series { name: "mass".to_owned(), unit: "kg".to_owned(), t_s, values: values.to_vec() }
    }

    /// Start and values of the new samples.
    fn sent(new_samples: &mut NewSamples, values: &[f64], mut limit: usize) -> Option<(u64, Vec<f64>)> {
        let parts = new_samples.since(&[series(values)], &mut limit);
        parts.into_iter().next().map(|part| (part.from, part.values))
    }

    #[test]
    fn samples_beyond_the_limit_go_with_the_next_heartbeat() {
        let mut new_samples = NewSamples::default();
        assert_eq!(sent(&mut new_samples, &[1.0, 2.0, 3.0], 2), Some((0, vec![1.0, 2.0])));
        new_samples.arrived(false);
        assert_eq!(sent(&mut new_samples, &[1.0, 2.0, 3.0], 0), None);
        new_samples.arrived(false);
        assert_eq!(sent(&mut new_samples, &[1.0, 2.0, 3.0, 4.0], 9), Some((2, vec![3.0, 4.0])));
        new_samples.arrived(false);
        assert_eq!(sent(&mut new_samples, &[1.0, 2.0, 3.0, 4.0], 9), None, "no sample twice");
    }

    #[test]
    fn unconfirmed_samples_are_sent_again_and_lost_ones_from_the_start() {
        let mut new_samples = NewSamples::default();
        assert_eq!(sent(&mut new_samples, &[1.0], 9), Some((0, vec![1.0])));
        assert_eq!(sent(&mut new_samples, &[1.0, 2.0], 9), Some((0, vec![1.0, 2.0])), "no answer came");
        new_samples.arrived(false);
        assert_eq!(sent(&mut new_samples, &[1.0, 2.0, 3.0], 9), Some((2, vec![3.0])));
        new_samples.arrived(true);
        assert_eq!(
            sent(&mut new_samples, &[1.0, 2.0, 3.0], 9),
            Some((0, vec![1.0, 2.0, 3.0])),
            "a new server"
        );
    }

    #[test]
    fn changed_samples_are_replaced() {
        let mut new_samples = NewSamples::default();
        sent(&mut new_samples, &[1.0, 2.0, 3.0], 9);
        new_samples.arrived(false);
        assert_eq!(sent(&mut new_samples, &[1.0, 5.0, 3.0], 9), Some((1, vec![5.0, 3.0])));
        new_samples.arrived(false);
        assert_eq!(sent(&mut new_samples, &[1.0], 9), Some((1, vec![])), "fewer than before");
        new_samples.arrived(false);
        assert_eq!(sent(&mut new_samples, &[1.0], 9), None);
    }
}
