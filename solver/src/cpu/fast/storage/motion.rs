//! The motion of a body, which bounds the motion of each of its sub-particles.

use glam::{DVec3, Vec3};

/// Share of a margin that may be used up: the rest covers rounding.
pub(crate) const SAFETY_FACTOR: f64 = 0.99;

/// How a body has moved since the run began. Since any moment, each of its sub-particles has moved by as much as `shift`,
/// to within what `path` has grown: a bound that follows the body.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct BodyMotion {
    /// Mean velocity before the step, in m/s; any would do, but none bounds better.
    pub(crate) velocity: Vec3,
    /// Its integral, in metres.
    pub(crate) shift: DVec3,
    /// Integral of the greatest speed against it, in metres.
    pub(crate) path: f64,
}

impl BodyMotion {
    /// How far any of the body's sub-particles has moved since then at most, in metres.
    #[inline(always)]
    pub(crate) fn since(&self, then: &Self) -> f64 {
        self.shift.distance(then.shift) + (self.path - then.path)
    }

    /// After a step of `dt` seconds in which none was faster against the mean than √`max_relative2` m/s; `mean` is the new one.
    #[inline(always)]
    pub(crate) fn advance(&mut self, max_relative2: f32, mean: Vec3, dt: f64) {
        self.shift += self.velocity.as_dvec3() * dt;
        self.path += f64::from(max_relative2.sqrt()) * dt;
        self.velocity = mean;
    }
}
