//! Fixed-point positions: integer multiples of a power-of-two unit about an origin.
//!
//! Positions as `f32` metres lose slow motion: at x = 0.4 m a step of 1 mm/s · 57 µs is less than half the
//! spacing of numbers. Integer units are exact everywhere, and so are the differences that enter the forces.
//! The domain spans at most 2³⁰ units: no difference within twice the domain wraps.

use glam::{DVec3, IVec3, Vec3};
use serde::{Deserialize, Serialize};

/// Limit of coordinates, in units: twice the domain from its middle. A sub-particle beyond it is lost. Not
/// much further, differences of positions would wrap.
pub(crate) const DOMAIN_LIMIT: i32 = 1 << 30;

/// A fixed-point coordinate frame.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Frame {
    /// Where position zero is, in metres.
    pub origin: DVec3,
    /// Length of a unit, in metres; a power of two.
    pub unit_m: f32,
    /// Period in y, in units; 0 without periodicity.
    pub period_y: i32,
}

impl Frame {
    /// A frame for the box between two corners, periodic over its whole y extent or not at all.
    pub fn new(low: DVec3, high: DVec3, periodic_y: bool) -> Self {
        let extent = (high - low).max_element();
        let unit = 2f64.powi(extent.log2().ceil() as i32 - 30);
        let period_y = if periodic_y { ((high.y - low.y) / unit).round() as i32 } else { 0 };
        Self { origin: (low + high) / 2.0, unit_m: unit as f32, period_y }
    }

    /// The nearest fixed-point position.
    pub fn encode(&self, x: DVec3) -> IVec3 {
        ((x - self.origin) / f64::from(self.unit_m)).round().as_ivec3()
    }

    /// The position in metres.
    pub fn decode(&self, x: IVec3) -> DVec3 {
        x.as_dvec3() * f64::from(self.unit_m) + self.origin
    }

    /// The vector from `a` to `b` in metres, by the nearest periodic image.
    pub fn between(&self, a: IVec3, b: IVec3) -> Vec3 {
        let mut d = b.wrapping_sub(a);
        if self.period_y != 0 {
            d.y = self.nearest_image(d.y);
        }
        d.as_vec3() * self.unit_m
    }

    /// The position, wrapped into the period.
    pub fn wrap(&self, mut x: IVec3) -> IVec3 {
        if self.period_y != 0 {
            x.y = self.nearest_image(x.y);
        }
        x
    }

    /// The difference to the nearest periodic image, in units.
    pub fn nearest_image(&self, y: i32) -> i32 {
        let half = self.period_y / 2;
        if y > half {
            y - self.period_y
        } else if y < -half {
            y + self.period_y
        } else {
            y
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn differences_are_exact_far_from_the_origin_and_across_the_period() {
        let frame = Frame::new(DVec3::ZERO, DVec3::new(2.0, 0.5, 1.0), true);
        let a = frame.encode(DVec3::new(1.9, 0.01, 0.5));
        let b = a + IVec3::new(3, -1, 0);
        assert_eq!(frame.between(a, b), Vec3::new(3.0, -1.0, 0.0) * frame.unit_m);
        let c = frame.encode(DVec3::new(1.9, 0.49, 0.5));
        assert!((frame.between(a, c).y + 0.02).abs() < 1e-6, "the short way round");
        let out = frame.encode(DVec3::new(0.0, 0.51, 0.0));
        assert!((frame.decode(frame.wrap(out)).y - 0.01).abs() < 1e-8);
    }

    #[test]
    fn encoding_error_is_at_most_half_a_unit() {
        let frame = Frame::new(DVec3::new(-1.0, -1.0, -1.0), DVec3::ONE, false);
        let x = DVec3::new(0.123_456_789, -0.9, 0.5);
        assert!((frame.decode(frame.encode(x)) - x).abs().max_element() <= f64::from(frame.unit_m) / 2.0);
    }
}
