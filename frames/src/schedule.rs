//! Which samples become frames.

use std::cell::Cell;

use roost_solver::scenario::Scenario;

/// Every so many samples a frame, counted from the first sample of the run, and anew from belt start: t = 0 is
/// always one, so that frames of the process stand at whole multiples of the interval.
#[derive(Debug)]
pub struct Schedule {
    sample_s: f64,
    every: u32,
    last_frame_s: Cell<Option<f64>>,
    last_asked_s: Cell<Option<f64>>,
}

impl Schedule {
    /// The schedule nearest to an interval in seconds that whole samples of a scenario allow.
    pub fn new(scenario: &Scenario, timestep_s: f64, interval_s: f64) -> Self {
        // Samples are at least a time step apart.
        let sample_s = scenario.numerics.output_interval_s.max(timestep_s);
        let every = (interval_s / sample_s).round().clamp(1.0, f64::from(u32::MAX)) as u32;
        Self { sample_s, every, last_frame_s: Cell::new(None), last_asked_s: Cell::new(None) }
    }

    /// Samples from one frame to the next.
    pub fn every(&self) -> u32 {
        self.every
    }

    /// Simulated time between samples, in seconds.
    pub fn sample_s(&self) -> f64 {
        self.sample_s
    }

    /// Simulated time between frames, in seconds.
    pub fn interval_s(&self) -> f64 {
        f64::from(self.every) * self.sample_s
    }

    /// Whether the sample at this simulated time, in seconds, is to be a frame. Asked once for every sample, and once
    /// more when the belt starts at it: the second answer counts.
    pub fn is_due(&self, simulated_s: f64) -> bool {
        let starts = self.last_asked_s.replace(Some(simulated_s)) == Some(simulated_s);
        // Samples stand up to half a time step beside their times; half a sample tells them apart.
        let wait_s = self.interval_s() - self.sample_s / 2.0;
        let due = starts || self.last_frame_s.get().is_none_or(|last| simulated_s - last >= wait_s);
        if due {
            self.last_frame_s.set(Some(simulated_s));
        }
        due
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn schedule(interval_s: f64) -> Schedule {
        let text = r#"{"experiment": "hopper", "numerics": {"output_interval_s": 0.02}}"#;
        Schedule::new(&roost_solver::scenario::parse(text).expect("a sound scenario"), 1e-4, interval_s)
    }

    #[test]
    fn intervals_are_rounded_to_whole_samples() {
        for (asked_s, every) in [(0.02, 1), (0.001, 1), (0.049, 2), (0.05, 3), (0.1, 5), (1e300, u32::MAX)] {
            assert_eq!(schedule(asked_s).every(), every, "{asked_s}");
        }
        assert!((schedule(0.05).interval_s() - 0.06).abs() < 1e-12);
    }

    #[test]
    fn frames_are_counted_anew_from_belt_start() {
        let schedule = schedule(0.06);
        // Samples at the steps nearest to multiples of 0.02 s, a step of 0.3 ms: never quite there.
        let at = |k: u32, from: f64| from + (0.02 * f64::from(k) / 3e-4).round() * 3e-4;
        let filling: Vec<u32> = (0..=7).filter(|&k| schedule.is_due(at(k, 0.0))).collect();
        assert_eq!(filling, [0, 3, 6]);
        let start = at(7, 0.0);
        assert!(schedule.is_due(start), "asked once more at the same time: the belt starts");
        let belt: Vec<u32> = (1..=9).filter(|&k| schedule.is_due(at(k, start))).collect();
        assert_eq!(belt, [3, 6, 9]);
    }

    #[test]
    fn the_frame_after_belt_start_is_an_interval_later_where_the_start_was_due_anyway() {
        let schedule = schedule(0.06);
        assert!((0..=3).map(|k| schedule.is_due(0.02 * f64::from(k))).eq([true, false, false, true]));
        assert!(schedule.is_due(0.02 * 3.0), "asked once more: the belt starts");
        assert!((4..=6).map(|k| schedule.is_due(0.02 * f64::from(k))).eq([false, false, true]));
    }
}
