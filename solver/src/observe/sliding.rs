//! Onset of sliding of a body on a plate while the plate is tilted (paper Fig. 8).
//!
//! Consider a Coulomb block on a plate tilted at the rate ω. Past the angle of friction θ_c its speed is v =
//! g ω τ² / (2 cos θ_c), where τ is the time since. Any speed threshold is therefore passed late: 1 cm/s by
//! 0.6° at 3 °/s. But √v is linear in time. The onset thus precedes the passage of [`SLOW_M_S`] by as much as
//! that precedes the passage of [`FAST_M_S`], which is four times as fast. A body that falls back below
//! [`SLOW_M_S`] has not begun to slide for good.

use serde::{Deserialize, Serialize};

/// Lower speed threshold, in m/s. Slower bodies do not slide.
pub const SLOW_M_S: f64 = 0.01;
/// Upper speed threshold, in m/s.
pub const FAST_M_S: f64 = 4.0 * SLOW_M_S;
/// Duration of sliding after which it counts as final on a plate that keeps tilting, in seconds.
const CONFIRM_AFTER_S: f64 = 0.25;

/// Detects the onset of sliding from the speed down the slope.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub struct SlidingDetector {
    /// Time and speed of the last sample.
    last: Option<(f64, f64)>,
    /// Times at which the two thresholds were last passed upwards, in seconds.
    slow_s: Option<f64>,
    fast_s: Option<f64>,
}

impl SlidingDetector {
    /// Records a sample: the speed down the slope, relative to the plate, in m/s.
    pub fn record(&mut self, now_s: f64, speed_m_s: f64) {
        // Linear between samples.
        let passed_s = |speed: f64| match self.last {
            Some((t, v)) if v < speed => t + (now_s - t) * (speed - v) / (speed_m_s - v),
            _ => now_s,
        };
        if speed_m_s < SLOW_M_S {
            (self.slow_s, self.fast_s) = (None, None);
        } else if self.slow_s.is_none() {
            self.slow_s = Some(passed_s(SLOW_M_S));
        }
        if speed_m_s >= FAST_M_S && self.fast_s.is_none() {
            self.fast_s = Some(passed_s(FAST_M_S));
        }
        self.last = Some((now_s, speed_m_s));
    }

    /// Time of the onset in seconds, not before 0; `None` unless the body slides.
    pub fn onset_s(&self) -> Option<f64> {
        Some((2.0 * self.slow_s? - self.fast_s?).max(0.0))
    }

    /// Whether the body has been sliding for long enough.
    pub fn is_confirmed(&self) -> bool {
        let since = |(now_s, _): (f64, f64)| Some(now_s - self.fast_s?);
        self.last.and_then(since).is_some_and(|since| since >= CONFIRM_AFTER_S)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const G: f64 = 9.81;

    /// Tilt in degrees at the detected onset for a block with these coefficients of static and sliding
    /// friction. The plate tilts at a rate in degrees per second. The motion is integrated step by step and
    /// sampled every 20 ms.
    fn found_deg(rate_deg_s: f64, holds: f64, slides: f64) -> Option<f64> {
        let (dt, mut v, mut sliding) = (1e-4, 0.0f64, SlidingDetector::default());
        for k in 0..(89.0 / rate_deg_s / dt) as u64 {
            let t = k as f64 * dt;
            let (sin, cos) = (rate_deg_s * t).to_radians().sin_cos();
            if k % 200 == 0 {
                sliding.record(t, v);
            }
            if sliding.is_confirmed() {
                break;
            }
            let moves = v > 0.0 || sin > holds * cos;
            v = if moves { (v + G * (sin - slides * cos) * dt).max(0.0) } else { 0.0 };
        }
        sliding.onset_s().map(|t| t * rate_deg_s)
    }

    #[test]
    fn a_coulomb_block_slides_at_its_angle_of_friction() {
        for mu in [0.1, 0.3, 0.5, 1.0] {
            let angle = f64::atan(mu).to_degrees();
            for (rate, within) in [(0.5, 0.01), (3.0, 0.01), (6.0, 0.02), (30.0, 0.1)] {
                let found = found_deg(rate, mu, mu).expect("slides");
                assert!((found - angle).abs() < within, "{found} of {angle} at {rate} °/s");
            }
        }
    }

    #[test]
    fn block_with_higher_static_friction_slides_at_its_static_friction_angle() {
        // Static friction above sliding friction: the block gains speed within a few samples.
        let found = found_deg(3.0, 0.5, 0.4).expect("slides");
        assert!((found - 0.5f64.atan().to_degrees()).abs() < 0.1, "{found}");
    }

    #[test]
    fn stop_after_a_short_slip_resets_the_onset_of_sliding() {
        let mut sliding = SlidingDetector::default();
        for (t, v) in [(0.0, 0.0), (1.0, 0.05), (1.2, 0.06), (1.4, 0.0), (1.6, 0.009)] {
            sliding.record(t, v);
        }
        assert_eq!(sliding.onset_s(), None);
        assert!(!sliding.is_confirmed());
        // Then for good: 1 cm/s at 2.0, 4 cm/s at 2.2.
        for (t, v) in [(2.0, 0.01), (2.2, 0.04), (2.4, 0.09)] {
            sliding.record(t, v);
        }
        assert!((sliding.onset_s().unwrap() - 1.8).abs() < 1e-12);
        assert!(!sliding.is_confirmed());
        sliding.record(2.46, 0.1);
        assert!(sliding.is_confirmed());
    }

    #[test]
    fn creep_at_constant_speed_is_not_sliding() {
        let mut sliding = SlidingDetector::default();
        (0..100).for_each(|k| sliding.record(0.1 * f64::from(k), 0.03));
        assert_eq!(sliding.onset_s(), None);
    }

    #[test]
    fn block_that_slides_from_the_start_has_an_onset_of_0() {
        let mut sliding = SlidingDetector::default();
        let _ = [(0.0, 0.02), (0.1, 0.06), (0.5, 0.4)].map(|(t, v)| sliding.record(t, v));
        assert_eq!(sliding.onset_s(), Some(0.0));
        assert!(sliding.is_confirmed());
    }
}
