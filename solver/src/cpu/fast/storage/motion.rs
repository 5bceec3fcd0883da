//! The motion of a body, which bounds the motion of each of its sub-particles.

use glam::{DVec3, Vec3};

/// Share of a margin that may be used up. The rest covers rounding.
pub(crate) const SAFETY_FACTOR: f64 = 0.99;

/// Motion of a body since the run began. Since any moment, each of its sub-particles has moved by `shift`, to
/// within the growth of `path`. This bound moves along with the body.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct BodyMotion {
    /// Reference velocity, in m/s: the mean before the step. Any velocity is valid; the mean gives the
    /// tightest bound.
    pub(crate) velocity: Vec3,
    /// Integral of the reference velocity, in metres.
    pub(crate) shift: DVec3,
    /// Integral of the maximum speed relative to the reference velocity, in metres.
    pub(crate) path: f64,
}

impl BodyMotion {
    /// Upper bound of the distance that any sub-particle has moved since `then`, in metres.
    #[inline(always)]
    pub(crate) fn since(&self, then: &Self) -> f64 {
        self.shift.distance(then.shift) + (self.path - then.path)
    }

    /// Advances by a step of `dt` seconds with maximum speed √`max_relative2` m/s relative to the reference
    /// velocity. `mean` is the next reference velocity.
    #[inline(always)]
    pub(crate) fn advance(&mut self, max_relative2: f32, mean: Vec3, dt: f64) {
        self.shift += self.velocity.as_dvec3() * dt;
        self.path += f64::from(max_relative2.sqrt()) * dt;
        self.velocity = mean;
    }
}
