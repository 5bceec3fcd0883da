//! The selection of samples that become frames.

use std::cell::Cell;

use roost_solver::scenario::Scenario;

/// One frame for every n samples, counted from the first sample and again from the start of the belt. The sample at t = 0 is always a frame,
/// so that later frames lie at whole multiples of the interval.
#[derive(Debug)]
pub struct Schedule {
    sample_s: f64,
    every: u32,
    last_frame_s: Cell<Option<f64>>,
    last_asked_s: Cell<Option<f64>>,
}

impl Schedule {
    /// The schedule nearest to an interval, in seconds, in whole samples of a scenario.
    pub fn new(scenario: &Scenario, timestep_s: f64, interval_s: f64) -> Self {
        // Samples are at least a time step apart.
        let sample_s = scenario.numerics.output_interval_s.max(timestep_s);
        let every = (interval_s / sample_s).round().clamp(1.0, f64::from(u32::MAX)) as u32;
        Self { sample_s, every, last_frame_s: Cell::new(None), last_asked_s: Cell::new(None) }
    }

    /// Samples per frame.
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

    /// Whether the sample at this simulated time, in seconds, becomes a frame. The solver asks once for every sample, and again when the belt
    /// starts at it: the second answer counts.
    pub fn is_due(&self, simulated_s: f64) -> bool {
        let starts = self.last_asked_s.replace(Some(simulated_s)) == Some(simulated_s);
        // A sample lies up to half a time step beside its nominal time; half a sample interval is a safe tolerance.
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
        Schedule::new(&roost_solver::scenario::parse(text).expect("a valid scenario"), 1e-4, interval_s)
    }

    #[test]
    fn intervals_are_rounded_to_whole_samples() {
        for (requested_s, every) in
            [(0.02, 1), (0.001, 1), (0.049, 2), (0.05, 3), (0.1, 5), (1e300, u32::MAX)]
        {
            assert_eq!(schedule(requested_s).every(), every, "{requested_s}");
        }
        assert!((schedule(0.05).interval_s() - 0.06).abs() < 1e-12);
    }

    #[test]
    fn frames_are_counted_again_from_belt_start() {
        let schedule = schedule(0.06);
        // Samples at the steps of 0.3 ms that are nearest to multiples of 0.02 s.
        let at = |k: u32, from: f64| from + (0.02 * f64::from(k) / 3e-4).round() * 3e-4;
        let filling: Vec<u32> = (0..=7).filter(|&k| schedule.is_due(at(k, 0.0))).collect();
        assert_eq!(filling, [0, 3, 6]);
        let start = at(7, 0.0);
        assert!(schedule.is_due(start), "the second question at this time: the belt starts");
        let belt: Vec<u32> = (1..=9).filter(|&k| schedule.is_due(at(k, start))).collect();
        assert_eq!(belt, [3, 6, 9]);
    }

    #[test]
    fn the_next_frame_is_an_interval_after_belt_start_even_if_that_was_due() {
        let schedule = schedule(0.06);
        assert!((0..=3).map(|k| schedule.is_due(0.02 * f64::from(k))).eq([true, false, false, true]));
        assert!(schedule.is_due(0.02 * 3.0), "the second question: the belt starts");
        assert!((4..=6).map(|k| schedule.is_due(0.02 * f64::from(k))).eq([false, false, true]));
    }
}
