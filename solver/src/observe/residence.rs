//! Residence times: how long each body stays in the hopper, from its entry until its centre of mass passes the gate plane.

use serde::{Deserialize, Serialize};

/// Entry and passage of every body.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct ResidenceTimes {
    /// The record of each body, by its number.
    seen: Vec<Option<Seen>>,
    /// Time of the last record, in seconds.
    now_s: f64,
}

/// The records of one body.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
struct Seen {
    entry_s: f64,
    /// Time and place of the last record before it passed.
    last_s: f64,
    last_m: f64,
    passed_s: Option<f64>,
}

/// The distribution of residence times.
#[derive(Clone, Debug, PartialEq)]
pub struct Residence {
    /// Residence times of the bodies that have passed, ascending, in seconds.
    pub times_s: Vec<f64>,
    /// Times so far of the bodies in the hopper that have not passed, ascending, in seconds: their residence times are longer.
    pub so_far_s: Vec<f64>,
}

impl ResidenceTimes {
    /// Records the place of a body's centre of mass along the belt, in metres past the gate, at a time in seconds. The first
    /// record of a body is its entry. The passage is interpolated linearly between two records.
    pub fn record(&mut self, body: usize, now_s: f64, x_m: f64) {
        if self.seen.len() <= body {
            self.seen.resize(body + 1, None);
        }
        let seen = self.seen[body].get_or_insert(Seen {
            entry_s: now_s,
            last_s: now_s,
            last_m: 0.0,
            passed_s: None,
        });
        self.now_s = now_s;
        if seen.passed_s.is_some() {
            return;
        }
        if x_m > 0.0 {
            let share = if seen.last_m < 0.0 { -seen.last_m / (x_m - seen.last_m) } else { 0.0 };
            seen.passed_s = Some(seen.last_s + share * (now_s - seen.last_s));
        }
        (seen.last_s, seen.last_m) = (now_s, x_m);
    }

    /// The distribution so far. A body that was not recorded at the last time and has not passed left by accident: it counts
    /// nowhere.
    pub fn residence(&self) -> Residence {
        let seen = || self.seen.iter().flatten();
        let sorted = |mut times_s: Vec<f64>| {
            times_s.sort_unstable_by(f64::total_cmp);
            times_s
        };
        let inside = seen().filter(|one| one.passed_s.is_none() && one.last_s == self.now_s);
        Residence {
            times_s: sorted(seen().filter_map(|one| Some(one.passed_s? - one.entry_s)).collect()),
            so_far_s: sorted(inside.map(|one| self.now_s - one.entry_s).collect()),
        }
    }
}

impl Residence {
    /// Mean over the bodies that have passed, in seconds; none without any.
    pub fn mean_s(&self) -> Option<f64> {
        let count = self.times_s.len() as f64;
        (count > 0.0).then(|| self.times_s.iter().sum::<f64>() / count)
    }

    /// The time after which a share of all bodies had passed, in seconds; none if [`Self::shares`] ends below it.
    pub fn percentile_s(&self, share: f64) -> Option<f64> {
        // A rounding error must not take the next body.
        let rank = self.shares().iter().position(|&passed| passed >= share - 1e-12)?;
        Some(self.times_s[rank])
    }

    /// Share of all bodies that had passed, at each residence time, by the estimator of Kaplan and Meier (1958). A body that
    /// has not passed counts until its time so far, and then as those that stayed longer.
    ///
    /// Between two such times, the share grows by equal parts of its rest, one per body left: the product of Kaplan and Meier in
    /// the form that is k / n exactly when all bodies entered together.
    pub fn shares(&self) -> Vec<f64> {
        let mut so_far = self.so_far_s.iter().peekable();
        let mut left = self.times_s.len() + self.so_far_s.len();
        let (mut share, mut passed) = (0.0, 0);
        let mut before = 0.0;
        let one = |&time_s: &f64| {
            // A body with the same time so far was still there at the passage.
            let mut gone = 0;
            while so_far.next_if(|so_far_s| **so_far_s < time_s).is_some() {
                gone += 1;
            }
            if gone > 0 {
                (before, left, passed) = (share, left - passed - gone, 0);
            }
            passed += 1;
            share = before + (1.0 - before) * passed as f64 / left as f64;
            share
        };
        self.times_s.iter().map(one).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A row of 100 bodies, 3 mm apart, that moves as one at 0.25 m/s: body k passes after (k + 1/2) 12 ms.
    fn plug(until_s: f64) -> ResidenceTimes {
        let mut times = ResidenceTimes::default();
        for step in 0..=(until_s / 0.02).round() as u32 {
            let now_s = 0.02 * f64::from(step);
            for body in 0..100 {
                times.record(body, now_s, 0.25 * now_s - 0.003 * (body as f64 + 0.5));
            }
        }
        times
    }

    #[test]
    fn residence_times_of_plug_flow_are_distance_over_speed() {
        let residence = plug(1.3).residence();
        assert_eq!(residence.so_far_s, [0.0; 0]);
        for (k, time_s) in residence.times_s.iter().enumerate() {
            assert!((time_s - 0.012 * (k as f64 + 0.5)).abs() < 1e-12, "{k}: {time_s}");
        }
        let near = |found: Option<f64>, expected: f64| assert!((found.unwrap() - expected).abs() < 1e-12);
        near(residence.mean_s(), 0.6);
        // The 5th, 50th and 95th of a hundred.
        near(residence.percentile_s(0.05), 0.012 * 4.5);
        near(residence.percentile_s(0.5), 0.012 * 49.5);
        near(residence.percentile_s(0.95), 0.012 * 94.5);
        assert_eq!((residence.shares()[0], residence.shares()[99]), (0.01, 1.0));
    }

    #[test]
    fn bodies_that_never_leave_count_in_percentiles_and_not_in_the_mean() {
        // At 0.72 s sixty have passed.
        let residence = plug(0.72).residence();
        assert_eq!(residence.times_s.len(), 60);
        assert!(
            residence.so_far_s.len() == 40 && residence.so_far_s.iter().all(|s| (s - 0.72).abs() < 1e-12)
        );
        assert!((residence.mean_s().unwrap() - 0.36).abs() < 1e-12);
        assert!((residence.percentile_s(0.5).unwrap() - 0.012 * 49.5).abs() < 1e-12);
        assert_eq!(residence.percentile_s(0.95), None);
        assert_eq!(residence.shares().last(), Some(&0.6));
    }

    #[test]
    fn time_counts_from_the_entry_and_a_passage_counts_once() {
        let mut times = ResidenceTimes::default();
        for (now_s, x_m) in [(2.0, -0.3), (3.0, -0.1), (4.0, 0.1), (5.0, -0.2), (6.0, 0.2)] {
            times.record(3, now_s, x_m);
        }
        times.record(1, 5.0, -0.4);
        times.record(0, 6.0, 0.4);
        assert_eq!(times.residence(), Residence { times_s: vec![0.0, 1.5], so_far_s: vec![] });
        let none = ResidenceTimes::default().residence();
        assert_eq!((none.mean_s(), none.percentile_s(0.5), none.shares()), (None, None, vec![]));
    }

    #[test]
    fn residence_shares_match_kaplan_meier_with_bodies_still_inside() {
        // Freireich's remission times under 6-MP in weeks (1963), of which Kaplan–Meier gives S(6) = 18/21, S(7) = S(6) · 16/17,
        // S(10) · 14/15, S(13) · 11/12, S(16) · 10/11, S(22) · 6/7, S(23) · 5/6 = 0.448.
        let residence = Residence {
            times_s: vec![6.0, 6.0, 6.0, 7.0, 10.0, 13.0, 16.0, 22.0, 23.0],
            so_far_s: vec![6.0, 9.0, 10.0, 11.0, 17.0, 19.0, 20.0, 25.0, 32.0, 32.0, 34.0, 35.0],
        };
        let left = [0.857_143, 0.806_723, 0.752_941, 0.690_196, 0.627_451, 0.537_815, 0.448_179];
        for (share, left) in residence.shares()[2..].iter().zip(left) {
            assert!((1.0 - share - left).abs() < 1e-6, "{share} and {left}");
        }
        assert_eq!(residence.percentile_s(0.05), Some(6.0));
        assert_eq!(residence.percentile_s(0.5), Some(23.0));
        assert_eq!(residence.percentile_s(0.95), None);
    }

    #[test]
    fn percentile_of_a_steady_feed_with_equal_times_is_that_time() {
        // A body enters each 0.1 s and stays 1 s. At the end ten are inside, at most 0.9 s.
        let mut times = ResidenceTimes::default();
        for step in 0..=30 {
            let now_s = 0.1 * f64::from(step);
            for body in (0..=step as usize).rev().take(12) {
                times.record(body, now_s, now_s - 0.1 * body as f64 - 0.999_999);
            }
        }
        let residence = times.residence();
        assert_eq!((residence.times_s.len(), residence.so_far_s.len()), (21, 10));
        let percentile = residence.percentile_s(0.95).expect("all that could pass did");
        assert!((percentile - 1.0).abs() < 1e-5, "{percentile}");
    }
}
