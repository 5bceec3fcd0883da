//! The load on a sub-particle.

use glam::Vec3;

/// Load on a sub-particle in one step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Load {
    /// Force without gravity, in newton.
    pub force: Vec3,
    /// Torque, in N m.
    pub torque: Vec3,
}

impl Load {
    /// Adds a force at the end of `arm`. Only its part `across` has a moment.
    pub(super) fn add(&mut self, force: Vec3, arm: Vec3, across: Vec3) {
        self.force += force;
        self.torque += arm.cross(across);
    }
}
