//! Rest: almost no sub-particle has moved for a while.
//!
//! The criterion counts sub-particles at fixed sample times, independent of the order of summation, so that
//! all backends agree. The maximum speed alone does not work: where fillets were driven into each other
//! single sub-particles keep trembling, since a stretched bond has no damping.

use serde::{Deserialize, Serialize};

/// Duration of slow motion that counts as rest, in seconds.
pub const REST_DURATION_S: f64 = 0.1;
/// One sub-particle in this many may still move at rest.
const MAX_MOVING_ONE_IN: usize = 1000;

/// Detects rest from samples.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct RestDetector {
    since_s: Option<f64>,
    now_s: f64,
}

impl RestDetector {
    /// Records a sample: `moving` of `count` sub-particles are faster than the speed of rest.
    pub fn record(&mut self, now_s: f64, moving: usize, count: usize) {
        let slow = moving <= count / MAX_MOVING_ONE_IN;
        self.since_s = slow.then(|| self.since_s.unwrap_or(now_s));
        self.now_s = now_s;
    }

    /// Start of the slow motion, if it has lasted for `for_s` seconds by now.
    pub fn since_s(&self, for_s: f64) -> Option<f64> {
        // A rounding error of the time step must not cost a sample.
        self.since_s.filter(|since| self.now_s - since >= for_s * (1.0 - 1e-6))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rest_needs_slow_motion_for_the_whole_duration() {
        let mut rest = RestDetector::default();
        for (now, moving, since) in [
            (0.0, 0, None),
            (0.05, 0, None),
            (0.1, 0, Some(0.0)),
            (0.15, 3, None),
            (0.2, 2, None),
            (0.25, 2, None),
            (0.3, 0, Some(0.2)),
            (0.35, 0, Some(0.2)),
        ] {
            rest.record(now, moving, 2999);
            assert_eq!(rest.since_s(0.1), since, "at {now} s");
        }
        assert_eq!(rest.since_s(0.16), None);
    }
}
