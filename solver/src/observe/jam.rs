//! A jam: nothing passes the gate for some time, although the hopper is not empty.
//!
//! | symbol | meaning | unit |
//! |---|---|---|
//! | τ | time without a passage that makes a jam: `numerics.jam_after_s`, or a shorter `numerics.stop.when_jammed_s` | s |
//! | m_f | mass in the hopper at t = 0 | kg |
//!
//! A hopper jams when nothing passes for τ while at least 0.05 m_f is inside. The first such stoppage decides: an arch that collapses
//! later was a jam. Hence a run that ends early as jammed and the same run without an early end have the same answer.

/// Share of the filled mass that must be inside.
const INSIDE_SHARE: f64 = 0.05;

/// Samples of a discharge.
#[derive(Clone, Copy, Debug)]
pub struct Passages<'a> {
    /// Belt times of the samples, increasing, in seconds.
    pub t_s: &'a [f64],
    /// Mass that has passed the gate at those times, in kilograms.
    pub mass_kg: &'a [f64],
    /// Mass in the hopper at those times, in kilograms.
    pub inside_kg: &'a [f64],
    /// m_f, in kilograms.
    pub filled_kg: f64,
}

/// Whether a hopper jammed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Jam {
    /// It jammed. The last passage before, or t = 0, is at this belt time in seconds.
    At(f64),
    /// It did not jam.
    Never,
    /// The samples are too short to tell, or nothing was filled.
    Unknown,
}

/// Whether nothing has passed for `jam_after_s` seconds.
pub fn has_stopped(last_passage_s: f64, now_s: f64, jam_after_s: f64) -> bool {
    now_s - last_passage_s >= jam_after_s
}

impl Passages<'_> {
    /// Whether and when the hopper jammed, with τ = `jam_after_s`. A stoppage that the last sample cuts short is no jam.
    ///
    /// # Panics
    /// When the numbers of masses and times differ.
    pub fn jam(&self, jam_after_s: f64) -> Jam {
        assert!(
            self.t_s.len() == self.mass_kg.len() && self.t_s.len() == self.inside_kg.len(),
            "as many masses as times"
        );
        let is_filled = |inside_kg: f64| inside_kg >= INSIDE_SHARE * self.filled_kg;
        let (mut last_passage_s, mut passed_kg) = (0.0, 0.0);
        for ((&t_s, &mass_kg), &inside_kg) in self.t_s.iter().zip(self.mass_kg).zip(self.inside_kg) {
            if mass_kg > passed_kg {
                (last_passage_s, passed_kg) = (t_s, mass_kg);
            }
            if self.filled_kg > 0.0 && is_filled(inside_kg) && has_stopped(last_passage_s, t_s, jam_after_s) {
                return Jam::At(last_passage_s);
            }
        }
        let end = self.t_s.last().zip(self.inside_kg.last()).filter(|_| self.filled_kg > 0.0);
        match end {
            Some((t_s, inside_kg)) if *t_s >= jam_after_s || !is_filled(*inside_kg) => Jam::Never,
            _ => Jam::Unknown,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Filled mass of every test, in kilograms.
    const FILLED: f64 = 40.0;

    /// Samples of a discharge every 20 ms up to `end`, with τ = 1 s. No test stands for exactly 1 s, where rounding errors decide.
    fn jam_of(end: f64, passed: impl Fn(f64) -> f64) -> Jam {
        let t_s: Vec<f64> = (0..=(end / 0.02).round() as usize).map(|k| k as f64 * 0.02).collect();
        let mass_kg: Vec<f64> = t_s.iter().map(|t| passed(*t).min(FILLED)).collect();
        let inside_kg: Vec<f64> = mass_kg.iter().map(|mass| FILLED - mass).collect();
        Passages { t_s: &t_s, mass_kg: &mass_kg, inside_kg: &inside_kg, filled_kg: FILLED }.jam(1.0)
    }

    /// Belt time without stoppages: a stoppage of `length` begins at `from`.
    fn flowing(t: f64, from: f64, length: f64) -> f64 {
        if t < from { t } else { (t - length).max(from) }
    }

    #[track_caller]
    fn jammed_at(jam: Jam, expected_s: f64) {
        let Jam::At(time_s) = jam else { panic!("{jam:?}") };
        assert!((time_s - expected_s).abs() < 1e-9, "{time_s} is not {expected_s}");
    }

    #[test]
    fn flow_that_stops_is_a_jam_from_its_last_passage_on() {
        jammed_at(jam_of(6.0, |t| 8.0 * t.min(2.0)), 2.0);
        // Nothing ever passes.
        jammed_at(jam_of(6.0, |_| 0.0), 0.0);
        // However slowly: each sample has a passage.
        assert_eq!(jam_of(6.0, |t| 1e-3 * t), Jam::Never);
    }

    #[test]
    fn pause_shorter_than_the_limit_is_no_jam() {
        assert_eq!(jam_of(6.0, |t| 8.0 * flowing(t, 2.0, 0.99)), Jam::Never);
        jammed_at(jam_of(6.0, |t| 8.0 * flowing(t, 2.0, 1.03)), 2.0);
        // Two pauses do not add up.
        assert_eq!(jam_of(6.0, |t| 8.0 * flowing(flowing(t, 3.0, 0.9), 2.0, 0.9)), Jam::Never);
    }

    #[test]
    fn arch_that_collapses_later_was_a_jam() {
        // The hopper empties after a stoppage of 2 s at 1 s; a second stoppage does not count.
        jammed_at(jam_of(12.0, |t| 8.0 * flowing(t, 1.0, 2.0)), 1.0);
        jammed_at(jam_of(12.0, |t| 8.0 * flowing(flowing(t, 4.0, 2.0), 1.0, 2.0)), 1.0);
    }

    #[test]
    fn hopper_with_less_than_5_percent_inside_is_never_jammed() {
        assert_eq!(jam_of(12.0, |t| 8.0 * t), Jam::Never);
        assert_eq!(jam_of(12.0, |t| (8.0 * t).min(0.951 * FILLED)), Jam::Never);
        jammed_at(jam_of(12.0, |t| (8.0 * t).min(0.949 * FILLED)), 4.76);
    }

    #[test]
    fn run_shorter_than_the_limit_is_unknown_unless_it_emptied() {
        assert_eq!(jam_of(0.98, |_| 0.0), Jam::Unknown);
        assert_eq!(jam_of(0.98, |t| 8.0 * t), Jam::Unknown);
        assert_eq!(jam_of(0.98, |t| 50.0 * t), Jam::Never);
        // A stoppage that the end cuts short.
        assert_eq!(jam_of(2.9, |t| 8.0 * t.min(2.0)), Jam::Never);
    }

    #[test]
    fn jam_is_unknown_without_samples_or_filling() {
        let none = Passages { t_s: &[], mass_kg: &[], inside_kg: &[], filled_kg: FILLED };
        assert_eq!(none.jam(1.0), Jam::Unknown);
        let t_s = [0.0, 2.0];
        let unfilled = Passages { t_s: &t_s, mass_kg: &[0.0, 0.0], inside_kg: &[0.0, 0.0], filled_kg: 0.0 };
        assert_eq!(unfilled.jam(1.0), Jam::Unknown);
    }

    #[test]
    fn fed_hopper_jams_by_the_mass_inside() {
        // All of the filling is out, and the feed has brought as much again.
        let (t_s, mass_kg) = ([0.0, 1.0, 2.0, 3.5], [0.0, 20.0, 40.0, 40.0]);
        let fed = |inside_kg: &[f64; 4]| {
            Passages { t_s: &t_s, mass_kg: &mass_kg, inside_kg, filled_kg: FILLED }.jam(1.2)
        };
        jammed_at(fed(&[40.0, 40.0, 40.0, 55.0]), 2.0);
        assert_eq!(fed(&[40.0, 20.0, 1.0, 1.5]), Jam::Never);
    }
}
