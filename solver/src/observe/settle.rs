//! Settling time of a body: until its kinetic energy stays below a share of its energy at impact.

use serde::{Deserialize, Serialize};

/// Share of the kinetic energy at which a body has settled: the paper's "99 % of its initial kinetic energy"
/// lost (section 3.3).
pub const SETTLED_SHARE: f64 = 0.01;

/// Times the settling of a body from its first contact on.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SettlingTimer {
    contact_s: f64,
    threshold_j: f64,
    /// Last sample at or above the threshold.
    above: Option<(f64, f64)>,
    settled_s: Option<f64>,
}

impl SettlingTimer {
    /// A body that first touches at `contact_s` seconds, with `energy_j` joule of kinetic energy.
    pub fn new(contact_s: f64, energy_j: f64) -> Self {
        Self { contact_s, threshold_j: SETTLED_SHARE * energy_j, above: None, settled_s: None }
    }

    /// Records a sample: kinetic energy at an increasing time. Samples before the contact are ignored.
    pub fn record(&mut self, now_s: f64, energy_j: f64) {
        if now_s < self.contact_s {
            return;
        }
        if energy_j >= self.threshold_j {
            self.above = Some((now_s, energy_j));
            self.settled_s = None;
        } else if self.settled_s.is_none() {
            // Linear between samples.
            let crossed_s =
                self.above.map_or(now_s, |(t, e)| t + (now_s - t) * (e - self.threshold_j) / (e - energy_j));
            self.settled_s = Some(crossed_s - self.contact_s);
        }
    }

    /// Seconds from the first contact until the energy fell below the threshold, where it has stayed since;
    /// `None` before.
    pub fn time_s(&self) -> Option<f64> {
        self.settled_s
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exponential_decay_settles_after_ln_100_time_constants() {
        // E = 3 J exp(−t/τ) from 0.05 s on.
        let tau = 0.04;
        let mut settling = SettlingTimer::new(0.05, 3.0);
        for k in 0..400 {
            let t = 0.001 * f64::from(k);
            settling.record(t, 3.0 * (-(t - 0.05f64).max(0.0) / tau).exp());
        }
        let expected = tau * 100f64.ln();
        assert!((settling.time_s().unwrap() - expected).abs() < 1e-5, "{settling:?}");
    }

    #[test]
    fn settle_time_restarts_if_the_energy_rises_again() {
        let mut settling = SettlingTimer::new(0.0, 1.0);
        for (t, energy) in [(0.0, 1.0), (0.1, 0.001), (0.2, 0.5)] {
            settling.record(t, energy);
        }
        assert_eq!(settling.time_s(), None);
        settling.record(0.3, 0.005);
        let expected = 0.2 + 0.1 * 0.49 / 0.495;
        assert!((settling.time_s().unwrap() - expected).abs() < 1e-12, "{settling:?}");
        settling.record(0.4, 0.0);
        assert!((settling.time_s().unwrap() - expected).abs() < 1e-12, "the first time counts");
    }

    #[test]
    fn body_at_rest_before_contact_has_no_settle_time() {
        let mut settling = SettlingTimer::new(0.15, 1.0);
        settling.record(0.1, 0.0);
        assert_eq!(settling.time_s(), None);
        let mut nothing = SettlingTimer::new(0.0, 0.0);
        nothing.record(0.0, 0.0);
        assert_eq!(nothing.time_s(), None, "nothing to lose is never lost");
    }
}
