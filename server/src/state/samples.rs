//! What running jobs have sampled so far: in memory alone, bounded, and gone with the server. The result says it all again.

use roost_api::Series;
use roost_api::lease::SeriesPart;

/// Samples of one job; what would be more is left out.
const MAX_OF_JOB: usize = 200_000;

/// Series of one job.
const MAX_SERIES: usize = 64;

/// Samples of one event.
const MAX_OF_EVENT: usize = 5_000;

/// Samples of all jobs together: 16 bytes each.
pub(crate) const MAX_OF_ALL: usize = 2_000_000;

/// A series so far.
#[derive(Debug)]
struct Curve {
    series: Series,
    /// Another number whenever samples that were there already have become others.
    epoch: u64,
    /// Whether samples were left out at its end: what follows them is left out as well.
    is_cut: bool,
}

/// What an attempt has sampled so far.
#[derive(Debug, Default)]
pub(crate) struct Samples {
    attempt: u32,
    curves: Vec<Curve>,
    /// When it changed last, by the count of changes.
    pub(crate) changes: u64,
}

/// How far somebody has followed a series.
#[derive(Debug)]
pub(crate) struct Followed {
    name: String,
    epoch: u64,
    samples: usize,
}

impl Samples {
    /// Of an attempt that has said nothing yet.
    pub(crate) fn new(attempt: u32) -> Self {
        Self { attempt, ..Self::default() }
    }

    /// The attempt.
    pub(crate) fn attempt(&self) -> u32 {
        self.attempt
    }

    /// All samples there are.
    pub(crate) fn count(&self) -> usize {
        self.curves.iter().map(|curve| curve.series.t_s.len()).sum()
    }

    /// Takes a part in, if there is room for `room` samples more; false when what comes before it is missing and was not left
    /// out for want of room.
    pub(crate) fn take(&mut self, part: SeriesPart, room: usize, now: u64) -> bool {
        let SeriesPart { name, unit, from, t_s, values } = part;
        let from = from as usize;
        let known = self.curves.iter().position(|curve| curve.series.name == name);
        if known.is_none() && self.curves.len() >= MAX_SERIES {
            return true;
        }
        let there = known.map_or(0, |at| self.curves[at].series.t_s.len());
        if from > there {
            return known.is_some_and(|at| self.curves[at].is_cut);
        }
        // What the part takes the place of goes first.
        let (freed, count) = (there - from, self.count());
        let is_cut = t_s.len() > (room + freed).min(MAX_OF_JOB.saturating_sub(count - freed));
        let at = known.unwrap_or_else(|| {
            let series = Series { name, unit, t_s: Vec::new(), values: Vec::new() };
            self.curves.push(Curve { series, epoch: now, is_cut });
            self.curves.len() - 1
        });
        let curve = &mut self.curves[at];
        curve.is_cut = is_cut;
        if freed > 0 {
            curve.epoch = now;
            curve.series.t_s.truncate(from);
            curve.series.values.truncate(from);
        }
        if !is_cut {
            curve.series.t_s.extend(t_s);
            curve.series.values.extend(values);
        }
        if freed > 0 || !is_cut {
            self.changes = now;
        }
        true
    }

    /// Every series so far.
    pub(crate) fn series(&self) -> Vec<Series> {
        let some = self.curves.iter().filter(|curve| !(curve.is_cut && curve.series.t_s.is_empty()));
        some.map(|curve| curve.series.clone()).collect()
    }

    /// What is new to somebody, or some of it.
    pub(crate) fn news(&self, followed: &mut Vec<Followed>) -> Vec<SeriesPart> {
        let mut parts = Vec::new();
        let mut room = MAX_OF_EVENT;
        for Curve { series, epoch, .. } in &self.curves {
            let at = followed.iter().position(|followed| followed.name == series.name).unwrap_or_else(|| {
                followed.push(Followed { name: series.name.clone(), epoch: *epoch, samples: 0 });
                followed.len() - 1
            });
            let followed = &mut followed[at];
            if followed.epoch != *epoch {
                (followed.epoch, followed.samples) = (*epoch, 0);
            }
            let from = followed.samples.min(series.t_s.len());
            let to = series.t_s.len().min(from + room);
            if from == to {
                continue;
            }
            room -= to - from;
            followed.samples = to;
            parts.push(SeriesPart {
                name: series.name.clone(),
                unit: series.unit.clone(),
                from: from as u64,
                t_s: series.t_s[from..to].to_vec(),
                values: series.values[from..to].to_vec(),
            });
        }
        parts
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn part(from: u64, values: &[f64]) -> SeriesPart {
        let t_s = (0..values.len()).map(|k| (from + k as u64) as f64).collect();
        SeriesPart { name: "mass".to_owned(), unit: "kg".to_owned(), from, t_s, values: values.to_vec() }
    }

    #[test]
    fn parts_make_the_whole_and_a_gap_is_refused() {
        let mut samples = Samples::new(1);
        assert!(samples.take(part(0, &[0.0, 1.0]), 100, 1));
        assert!(!samples.take(part(3, &[9.0]), 100, 2), "the third is missing");
        assert!(samples.take(part(2, &[2.0, 3.0]), 100, 3));
        assert_eq!(samples.series()[0].values, [0.0, 1.0, 2.0, 3.0]);
        assert!(samples.take(part(4, &[4.0, 5.0]), 1, 4), "no room is no reason to send it again");
        assert_eq!((samples.count(), samples.changes), (4, 3));
    }

    #[test]
    fn what_follows_samples_that_found_no_room_is_not_asked_for_again_and_again() {
        let mut samples = Samples::new(1);
        assert!(samples.take(part(0, &[0.0, 1.0]), 2, 1));
        assert!(samples.take(part(2, &[2.0, 3.0]), 1, 2), "left out");
        assert!(samples.take(part(4, &[4.0]), 100, 3), "the worker goes on as if they were here");
        assert_eq!(samples.series()[0].values, [0.0, 1.0]);
        // All from the start on, and there is room: whole again.
        assert!(samples.take(part(0, &[5.0, 6.0, 7.0]), 1, 4), "two go, three come");
        assert_eq!(samples.series()[0].values, [5.0, 6.0, 7.0]);
        assert!(!samples.take(part(9, &[9.0]), 100, 5), "a gap is one again");
        // Rewritten without room: what was there is right no longer.
        assert!(samples.take(part(1, &[8.0, 8.0, 8.0, 8.0]), 1, 6));
        assert_eq!(samples.series()[0].values, [5.0]);
        // A series of which not even the start found room.
        let other = |from| SeriesPart { name: "other".to_owned(), ..part(from, &[1.0]) };
        assert!(samples.take(other(0), 0, 7) && samples.take(other(1), 100, 8));
        assert_eq!(samples.series().len(), 1, "none is shown that has nothing");
    }

    #[test]
    fn a_follower_hears_what_is_new_and_all_of_what_was_rewritten() {
        let (mut samples, mut followed) = (Samples::new(1), Vec::new());
        samples.take(part(0, &[0.0, 1.0]), 100, 1);
        assert_eq!(samples.news(&mut followed), [part(0, &[0.0, 1.0])]);
        assert_eq!(samples.news(&mut followed), []);
        samples.take(part(2, &[2.0]), 100, 2);
        assert_eq!(samples.news(&mut followed), [part(2, &[2.0])]);
        samples.take(part(1, &[7.0]), 100, 3);
        assert_eq!(samples.news(&mut followed), [part(0, &[0.0, 7.0])]);
        let many: Vec<f64> = (0..MAX_OF_EVENT + 2).map(|k| k as f64).collect();
        samples.take(part(0, &many), many.len(), 4);
        let lengths: Vec<usize> = (0..3)
            .map(|_| samples.news(&mut followed))
            .map(|parts| parts.iter().map(|part| part.t_s.len()).sum())
            .collect();
        assert_eq!(lengths, [MAX_OF_EVENT, 2, 0], "bounded, and nothing is left out");
    }
}
