//! The load on each surface: force and torque, from the contacts of the last step.

use glam::DVec3;

use super::Walls;
use crate::engine::SurfaceLoad;
use crate::engine::frame::Frame;
use crate::engine::state::Particle;
use glam::Vec3;

impl Walls {
    /// Loads on all surfaces, summed in the order of `contacts`: sub-particle after the step, facet, and force on the
    /// sub-particle in newton. `dt` is the time step in seconds.
    pub(crate) fn loads(
        &self,
        frame: &Frame,
        dt: f32,
        contacts: impl Iterator<Item = (Particle, u32, Vec3)>,
    ) -> Vec<SurfaceLoad> {
        let mut loads = vec![SurfaceLoad::default(); self.surface_count()];
        for (particle, facet, force) in contacts {
            let load = &mut loads[self.surface_of(facet)];
            let force = force.as_dvec3();
            load.force -= force;
            if force != DVec3::ZERO {
                // The force acted before the step moved the sub-particle.
                let moved = (particle.velocity * (dt / frame.unit_m)).round().as_ivec3();
                let position = particle.position.wrapping_sub(moved);
                let point = self.nearest_point(facet, position, frame);
                let at = frame.decode(position) + point.to_wall.as_dvec3();
                load.torque -= at.cross(force);
            }
        }
        loads
    }
}
