//! What of an attempt's samples the server has not heard yet.

use roost_api::Series;
use roost_api::lease::SeriesPart;

/// What the server has of each series, and what is on its way there.
#[derive(Debug, Default)]
pub(super) struct News {
    known: Vec<Series>,
    sent: Vec<SeriesPart>,
}

impl News {
    /// What is new, as much of it as there is room for.
    pub(super) fn since(&mut self, series: &[Series], room: &mut usize) -> Vec<SeriesPart> {
        self.sent.clear();
        for series in series {
            let known = self.known.iter().find(|known| known.name == series.name);
            let from = known.map_or(0, |known| alike(known, series));
            let to = series.t_s.len().min(from + *room);
            let is_shorter = known.is_some_and(|known| known.t_s.len() > series.t_s.len());
            if to > from || is_shorter {
                *room -= to - from;
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

    /// The server has what was sent, or has lost what came before it.
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

/// How many samples at the start of both are the same. Times move while it is not known yet when the belt will start.
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

    /// Where the news begin, and what they are.
    fn told(news: &mut News, values: &[f64], mut room: usize) -> Option<(u64, Vec<f64>)> {
        let parts = news.since(&[series(values)], &mut room);
        parts.into_iter().next().map(|part| (part.from, part.values))
    }

    #[test]
    fn what_one_beat_cannot_carry_comes_with_the_next() {
        let mut news = News::default();
        assert_eq!(told(&mut news, &[1.0, 2.0, 3.0], 2), Some((0, vec![1.0, 2.0])));
        news.arrived(false);
        assert_eq!(told(&mut news, &[1.0, 2.0, 3.0], 0), None);
        news.arrived(false);
        assert_eq!(told(&mut news, &[1.0, 2.0, 3.0, 4.0], 9), Some((2, vec![3.0, 4.0])));
        news.arrived(false);
        assert_eq!(told(&mut news, &[1.0, 2.0, 3.0, 4.0], 9), None, "nothing twice");
    }

    #[test]
    fn what_did_not_arrive_is_sent_again_and_what_was_lost_from_the_start() {
        let mut news = News::default();
        assert_eq!(told(&mut news, &[1.0], 9), Some((0, vec![1.0])));
        assert_eq!(told(&mut news, &[1.0, 2.0], 9), Some((0, vec![1.0, 2.0])), "no answer came");
        news.arrived(false);
        assert_eq!(told(&mut news, &[1.0, 2.0, 3.0], 9), Some((2, vec![3.0])));
        news.arrived(true);
        assert_eq!(told(&mut news, &[1.0, 2.0, 3.0], 9), Some((0, vec![1.0, 2.0, 3.0])), "a new server");
    }

    #[test]
    fn samples_that_have_changed_are_replaced() {
        let mut news = News::default();
        told(&mut news, &[1.0, 2.0, 3.0], 9);
        news.arrived(false);
        assert_eq!(told(&mut news, &[1.0, 5.0, 3.0], 9), Some((1, vec![5.0, 3.0])));
        news.arrived(false);
        assert_eq!(told(&mut news, &[1.0], 9), Some((1, vec![])), "fewer than before");
        news.arrived(false);
        assert_eq!(told(&mut news, &[1.0], 9), None);
    }
}
