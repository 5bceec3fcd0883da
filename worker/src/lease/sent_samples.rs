//! The samples of an attempt that were sent to the server: a count for each series.
//!
//! Each sample is sent once. If the server lacks earlier samples, its reply has the counts to continue from.

use std::collections::BTreeMap;

use roost_api::lease::SeriesPart;
use roost_solver::observe::Recorder;

/// Number of samples sent, by name of the series.
#[derive(Debug, Default)]
pub(super) struct SentSamples(BTreeMap<String, u64>);

impl SentSamples {
    /// The samples that follow, at most `limit`. They count as sent, and `limit` is lowered by their number.
    pub(super) fn next_parts(&mut self, recorder: &Recorder, limit: &mut usize) -> Vec<SeriesPart> {
        let mut parts = Vec::new();
        for recording in recorder.recordings() {
            let count = recording.values().len();
            let sent = self.0.entry(recording.name().to_owned()).or_default();
            let from = usize::try_from(*sent).map_or(count, |sent| sent.min(count));
            let to = count.min(from + *limit);
            if to > from {
                *limit -= to - from;
                *sent = to as u64;
                parts.push(SeriesPart {
                    name: recording.name().to_owned(),
                    unit: recording.unit().to_owned(),
                    from: from as u64,
                    t_s: recording.simulated_s()[from..to].to_vec(),
                    values: recording.values()[from..to].to_vec(),
                });
            }
        }
        parts
    }

    /// Continues these series from the number of samples that the server has.
    pub(super) fn continue_from(&mut self, counts: &BTreeMap<String, u64>) {
        self.0.extend(counts.iter().map(|(name, count)| (name.clone(), *count)));
    }
}

#[cfg(test)]
mod tests {
    use roost_solver::observe::{Clock, SeriesId};

    use super::*;

    /// Records the time itself as two series, `early` from the beginning and `late` from t = 0 on.
    struct Run {
        recorder: Recorder,
        ids: [SeriesId; 2],
    }

    impl Run {
        fn new() -> Self {
            let mut recorder = Recorder::default();
            let ids = [recorder.add("early", "s", Clock::Simulated), recorder.add("late", "s", Clock::Belt)];
            Self { recorder, ids }
        }

        fn sample(&mut self, simulated_s: f64, belt_s: Option<f64>) {
            self.recorder.begin_sample(simulated_s, belt_s);
            self.recorder.record(self.ids[0], simulated_s);
            if belt_s.is_some() {
                self.recorder.record(self.ids[1], simulated_s);
            }
        }
    }

    /// Name, start and times of each part of a heartbeat with at most `limit` samples.
    fn next(sent: &mut SentSamples, run: &Run, mut limit: usize) -> Vec<(String, u64, Vec<f64>)> {
        let parts = sent.next_parts(&run.recorder, &mut limit);
        assert!(parts.iter().all(|part| part.t_s == part.values), "{parts:?}");
        parts.into_iter().map(|part| (part.name, part.from, part.t_s)).collect()
    }

    fn early(from: u64, t_s: &[f64]) -> (String, u64, Vec<f64>) {
        ("early".to_owned(), from, t_s.to_vec())
    }

    fn late(from: u64, t_s: &[f64]) -> (String, u64, Vec<f64>) {
        ("late".to_owned(), from, t_s.to_vec())
    }

    #[test]
    fn each_sample_is_sent_once_even_when_t0_is_known_late() {
        let (mut run, mut sent) = (Run::new(), SentSamples::default());
        run.sample(0.0, None);
        run.sample(0.5, None);
        assert_eq!(next(&mut sent, &run, 99), [early(0, &[0.0, 0.5])]);
        assert_eq!(next(&mut sent, &run, 99), []);
        run.sample(1.0, Some(0.0));
        assert_eq!(run.recorder.t0_s(), Some(1.0));
        assert_eq!(next(&mut sent, &run, 99), [early(2, &[1.0]), late(0, &[1.0])]);
        run.sample(1.5, Some(0.5));
        assert_eq!(next(&mut sent, &run, 99), [early(3, &[1.5]), late(1, &[1.5])]);
        assert_eq!(next(&mut sent, &run, 99), []);
    }

    #[test]
    fn samples_beyond_the_limit_go_with_the_next_heartbeat() {
        let (mut run, mut sent) = (Run::new(), SentSamples::default());
        for k in 0..3 {
            run.sample(f64::from(k), Some(f64::from(k)));
        }
        assert_eq!(next(&mut sent, &run, 2), [early(0, &[0.0, 1.0])]);
        assert_eq!(next(&mut sent, &run, 0), []);
        assert_eq!(next(&mut sent, &run, 2), [early(2, &[2.0]), late(0, &[0.0])]);
        assert_eq!(next(&mut sent, &run, 99), [late(1, &[1.0, 2.0])]);
    }

    #[test]
    fn missing_series_continue_from_the_count_of_the_server() {
        let (mut run, mut sent) = (Run::new(), SentSamples::default());
        for k in 0..3 {
            run.sample(f64::from(k), Some(f64::from(k)));
        }
        next(&mut sent, &run, 99);
        sent.continue_from(&BTreeMap::from([("early".to_owned(), 1)]));
        assert_eq!(next(&mut sent, &run, 99), [early(1, &[1.0, 2.0])]);
        sent.continue_from(&BTreeMap::from([("late".to_owned(), u64::MAX), ("other".to_owned(), 0)]));
        assert_eq!(next(&mut sent, &run, 99), [], "a count beyond the samples");
    }
}
