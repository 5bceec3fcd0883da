//! Samples of a running job, as its heartbeats bring them: append-only, bounded, and in memory only.
//!
//! A restart of the server loses them, and the worker sends them again. The result has all samples.

use roost_api::Series;
use roost_api::lease::SeriesPart;

/// Maximum of samples of one job. Samples beyond it are dropped.
const MAX_OF_JOB: usize = 200_000;

/// Maximum of series of one job. Series beyond it are dropped.
const MAX_SERIES: usize = 64;

/// Maximum of samples of one event.
const MAX_OF_EVENT: usize = 5_000;

/// Maximum of samples of all jobs, at 16 bytes each.
pub(crate) const MAX_OF_ALL: usize = 2_000_000;

/// The samples of an attempt.
#[derive(Debug, Default)]
pub(crate) struct Samples {
    attempt: u32,
    /// Simulated time of t = 0, once known.
    t0_s: Option<f64>,
    /// Each series from its first sample on.
    series: Vec<SeriesPart>,
    /// Whether samples were dropped, and all that follow are dropped as well.
    is_full: bool,
    /// The change count of the board when this last changed.
    pub(crate) changes: u64,
}

/// Samples before a part are missing.
#[derive(Debug, PartialEq)]
pub(crate) struct Gap {
    /// The series.
    pub(crate) name: String,
    /// Number of its samples that are here.
    pub(crate) count: u64,
}

/// The samples of a job that a follower has received.
#[derive(Debug, Default)]
pub(crate) struct Received {
    attempt: u32,
    t0_s: Option<f64>,
    /// Number of samples of each series.
    counts: Vec<usize>,
}

impl Samples {
    /// An attempt without samples.
    pub(crate) fn new(attempt: u32) -> Self {
        Self { attempt, ..Self::default() }
    }

    /// Number of the attempt.
    pub(crate) fn attempt(&self) -> u32 {
        self.attempt
    }

    /// Number of samples of all series.
    pub(crate) fn count(&self) -> usize {
        self.series.iter().map(|series| series.values.len()).sum()
    }

    /// Sets the simulated time of t = 0. The first value stays.
    pub(crate) fn set_t0(&mut self, t0_s: Option<f64>, changes: u64) {
        if self.t0_s.is_none() && t0_s.is_some() {
            self.t0_s = t0_s;
            self.changes = changes;
        }
    }

    /// Appends at most `limit` samples of a part. Samples that are here already are ignored.
    ///
    /// # Errors
    /// If samples before the part are missing, unless they were dropped.
    pub(crate) fn append(&mut self, part: SeriesPart, limit: usize, changes: u64) -> Result<(), Gap> {
        let known = self.series.iter().position(|series| series.name == part.name);
        if self.is_full || (known.is_none() && self.series.len() >= MAX_SERIES) {
            return Ok(());
        }
        let count = known.map_or(0, |at| self.series[at].values.len());
        let overlap = match (count as u64).checked_sub(part.from) {
            Some(overlap) => usize::try_from(overlap).unwrap_or(usize::MAX),
            None => return Err(Gap { name: part.name, count: count as u64 }),
        };
        let new = part.values.len().saturating_sub(overlap);
        let accepted = new.min(limit).min(MAX_OF_JOB.saturating_sub(self.count()));
        self.is_full = accepted < new;
        if accepted == 0 {
            return Ok(());
        }
        let new = overlap..overlap + accepted;
        match known {
            Some(at) => {
                self.series[at].t_s.extend(&part.t_s[new.clone()]);
                self.series[at].values.extend(&part.values[new]);
            }
            None => self.series.push(part.slice(new)),
        }
        self.changes = changes;
        Ok(())
    }

    /// All series over belt time. While t = 0 is unknown, times end at 0.
    pub(crate) fn series(&self) -> Vec<Series> {
        let last = |latest: f64, series: &SeriesPart| series.t_s.last().map_or(latest, |t| t.max(latest));
        let t0_s = self.t0_s.unwrap_or_else(|| self.series.iter().fold(f64::NEG_INFINITY, last));
        let series = |series: &SeriesPart| Series {
            name: series.name.clone(),
            unit: series.unit.clone(),
            t_s: series.t_s.iter().map(|t| t - t0_s).collect(),
            values: series.values.clone(),
        };
        self.series.iter().map(series).collect()
    }

    /// The simulated time of t = 0, and the first samples that a follower has not received; none without
    /// anything new.
    pub(crate) fn next_event(&self, received: &mut Received) -> Option<(Option<f64>, Vec<SeriesPart>)> {
        if received.attempt != self.attempt {
            *received = Received { attempt: self.attempt, ..Received::default() };
        }
        received.counts.resize(self.series.len(), 0);
        let mut limit = MAX_OF_EVENT;
        let mut parts = Vec::new();
        for (series, from) in self.series.iter().zip(&mut received.counts) {
            let to = series.values.len().min(*from + limit);
            if to > *from {
                limit -= to - *from;
                parts.push(series.slice(*from..to));
                *from = to;
            }
        }
        let is_new = !parts.is_empty() || received.t0_s != self.t0_s;
        received.t0_s = self.t0_s;
        is_new.then_some((self.t0_s, parts))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Samples of `mass`, at one a second of simulated time from 10 s on.
    fn part(from: u64, values: &[f64]) -> SeriesPart {
        let t_s = (0..values.len()).map(|k| 10.0 + from as f64 + k as f64).collect();
        SeriesPart { name: "mass".to_owned(), unit: "kg".to_owned(), from, t_s, values: values.to_vec() }
    }

    fn named(name: &str, part: SeriesPart) -> SeriesPart {
        SeriesPart { name: name.to_owned(), ..part }
    }

    fn gap(count: u64) -> Result<(), Gap> {
        Err(Gap { name: "mass".to_owned(), count })
    }

    /// The values of `mass`.
    fn values(samples: &Samples) -> Vec<f64> {
        samples.series()[0].values.clone()
    }

    #[test]
    fn consecutive_parts_of_samples_are_joined_and_a_gap_is_refused() {
        let mut samples = Samples::new(1);
        assert_eq!(samples.append(part(3, &[9.0]), 100, 1), gap(0));
        assert_eq!(samples.append(part(0, &[0.0, 1.0]), 100, 2), Ok(()));
        assert_eq!(samples.append(part(3, &[9.0]), 100, 3), gap(2));
        assert_eq!(samples.append(part(u64::MAX, &[9.0]), 100, 4), gap(2));
        assert_eq!((samples.count(), samples.changes), (2, 2), "a gap changes nothing");
        assert_eq!(samples.append(part(2, &[2.0, 3.0]), 100, 5), Ok(()));
        assert_eq!((values(&samples), samples.changes), (vec![0.0, 1.0, 2.0, 3.0], 5));
    }

    #[test]
    fn repeated_parts_change_nothing() {
        let mut samples = Samples::new(1);
        samples.append(part(0, &[0.0, 1.0, 2.0]), 100, 1).unwrap();
        for repeat in [part(0, &[0.0, 1.0, 2.0]), part(1, &[8.0]), part(3, &[]), part(0, &[])] {
            assert_eq!(samples.append(repeat, 100, 2), Ok(()));
        }
        assert_eq!((values(&samples), samples.changes), (vec![0.0, 1.0, 2.0], 1));
        assert_eq!(samples.append(part(1, &[8.0, 8.0, 3.0]), 100, 3), Ok(()), "the last one is new");
        assert_eq!((values(&samples), samples.changes), (vec![0.0, 1.0, 2.0, 3.0], 3));
        assert_eq!(samples.series()[0].t_s, [-3.0, -2.0, -1.0, 0.0]);
    }

    #[test]
    fn times_end_at_0_until_t0_is_known() {
        let mut samples = Samples::new(1);
        samples.append(part(0, &[0.0, 1.0]), 100, 1).unwrap();
        samples.append(named("rate", part(0, &[5.0])), 100, 2).unwrap();
        let times = |samples: &Samples| samples.series().into_iter().map(|one| one.t_s).collect::<Vec<_>>();
        assert_eq!(times(&samples), [vec![-1.0, 0.0], vec![-1.0]]);
        samples.set_t0(None, 3);
        assert_eq!(samples.changes, 2);
        samples.set_t0(Some(10.5), 4);
        assert_eq!((times(&samples), samples.changes), (vec![vec![-0.5, 0.5], vec![-0.5]], 4));
        samples.set_t0(Some(11.0), 5);
        samples.set_t0(None, 6);
        assert_eq!((times(&samples), samples.changes), (vec![vec![-0.5, 0.5], vec![-0.5]], 4), "it stays");
    }

    #[test]
    fn dropped_samples_and_those_after_them_are_not_requested_again() {
        let mut samples = Samples::new(1);
        assert_eq!(samples.append(part(0, &[0.0, 1.0, 2.0]), 2, 1), Ok(()));
        assert_eq!(samples.append(part(3, &[3.0]), 100, 2), Ok(()));
        assert_eq!(samples.append(named("rate", part(0, &[5.0])), 100, 3), Ok(()));
        assert_eq!((samples.series().len(), values(&samples)), (1, vec![0.0, 1.0]));
        let mut empty = Samples::new(1);
        assert_eq!(empty.append(part(0, &[0.0]), 0, 4), Ok(()));
        assert_eq!((empty.series(), empty.changes), (vec![], 0), "no series without samples");
    }

    #[test]
    fn a_job_has_bounded_samples_and_series() {
        let many = vec![0.0; MAX_OF_JOB - 1];
        let mut samples = Samples::new(1);
        samples.append(part(0, &many), usize::MAX, 1).unwrap();
        samples.append(named("rate", part(0, &[1.0, 2.0, 3.0])), usize::MAX, 2).unwrap();
        samples.append(part(many.len() as u64, &[1.0]), usize::MAX, 3).unwrap();
        assert_eq!((samples.count(), samples.series()[1].values.len()), (MAX_OF_JOB, 1));
        let mut samples = Samples::new(1);
        for k in 0..=MAX_SERIES {
            samples.append(named(&k.to_string(), part(0, &[1.0])), 100, 1).unwrap();
        }
        assert_eq!(samples.append(named("beyond", part(7, &[1.0])), 100, 2), Ok(()), "no gap to fill");
        assert_eq!(samples.series().len(), MAX_SERIES);
        assert_eq!(samples.append(named("0", part(1, &[2.0])), 100, 3), Ok(()));
        assert_eq!(samples.count(), MAX_SERIES + 1, "known series go on");
    }

    #[test]
    fn a_follower_receives_each_sample_once_and_t0_when_it_is_known() {
        let (mut samples, mut received) = (Samples::new(1), Received::default());
        assert_eq!(samples.next_event(&mut received), None);
        samples.append(part(0, &[0.0, 1.0]), 100, 1).unwrap();
        assert_eq!(samples.next_event(&mut received), Some((None, vec![part(0, &[0.0, 1.0])])));
        assert_eq!(samples.next_event(&mut received), None);
        samples.append(part(2, &[2.0]), 100, 2).unwrap();
        assert_eq!(samples.next_event(&mut received), Some((None, vec![part(2, &[2.0])])));
        samples.set_t0(Some(10.5), 3);
        assert_eq!(samples.next_event(&mut received), Some((Some(10.5), vec![])));
        samples.append(named("rate", part(0, &[7.0])), 100, 4).unwrap();
        let rate = named("rate", part(0, &[7.0]));
        assert_eq!(samples.next_event(&mut received), Some((Some(10.5), vec![rate])));
        assert_eq!(samples.next_event(&mut received), None);
    }

    #[test]
    fn events_are_bounded_and_a_new_attempt_starts_again() {
        let (mut samples, mut received) = (Samples::new(1), Received::default());
        let many: Vec<f64> = (0..MAX_OF_EVENT + 2).map(|k| k as f64).collect();
        samples.append(part(0, &many), many.len(), 1).unwrap();
        let mut lengths = || {
            let event = samples.next_event(&mut received);
            event.map(|(_, parts)| parts.iter().map(|part| part.values.len()).sum::<usize>())
        };
        assert_eq!([lengths(), lengths(), lengths()], [Some(MAX_OF_EVENT), Some(2), None]);
        let mut second = Samples::new(2);
        second.append(part(0, &[4.0]), 100, 2).unwrap();
        assert_eq!(second.next_event(&mut received), Some((None, vec![part(0, &[4.0])])));
    }
}
