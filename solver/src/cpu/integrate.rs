//! The `integrate` stage: loads become motion. Detects runaway sub-particles.

use glam::{IVec3, Vec3};
use rayon::prelude::*;

use super::displacement::{DisplacementTracker, length2};
use super::load::Load;
use super::{CHUNK, Params};
use crate::engine::frame::{DOMAIN_LIMIT, Frame};
use crate::engine::state::{Particle, State};
use crate::physics::integrate;

/// Statistics of the stage.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MotionStats {
    /// Square of the maximum displacement since the neighbour lists were built, in m².
    max_displacement2: f32,
    /// First runaway sub-particle: too fast, not finite, or lost.
    runaway: Option<u32>,
}

impl MotionStats {
    fn merge(self, other: Self) -> Self {
        Self {
            max_displacement2: self.max_displacement2.max(other.max_displacement2),
            runaway: self.runaway.into_iter().chain(other.runaway).min(),
        }
    }

    /// Description of the fault, if there is one.
    pub(crate) fn fault(&self, params: &Params, state: &State) -> Option<String> {
        self.runaway.map(|i| fault(i as usize, params.speed_limit, state))
    }
}

/// Description of the fault of a sub-particle that is too fast (`speed_limit` in m/s), not finite, or lost.
pub(crate) fn fault(i: usize, speed_limit: f32, state: &State) -> String {
    let speed = state.particles[i].velocity.length();
    let what = if !(speed.is_finite() && state.particles[i].spin.is_finite()) {
        "has no finite velocity or spin".to_owned()
    } else if speed <= speed_limit {
        "has left the domain".to_owned()
    } else {
        format!("moves at {speed:.3} m/s, past the speed limit of {speed_limit} m/s")
    };
    format!("sub-particle {} of fillet {} {what}", state.serials[i], state.bodies[i])
}

/// Constants of the integration of a run.
#[derive(Clone, Copy, Debug)]
pub(super) struct Integrator {
    pub(super) dt: f32,
    pub(super) gravity: Vec3,
    pub(super) inverse_unit: f32,
    /// m/I of a solid sphere, in 1/m².
    pub(super) spin_factor: f32,
    pub(super) limit2: f32,
}

impl Integrator {
    pub(super) fn new(params: &Params, frame: &Frame) -> Self {
        Self {
            dt: params.dt,
            gravity: params.gravity,
            inverse_unit: 1.0 / frame.unit_m,
            spin_factor: 2.5 / (params.radius * params.radius),
            limit2: params.speed_limit * params.speed_limit,
        }
    }

    /// Moves a sub-particle of `mass` in kg by one step. Returns whether its motion is sound.
    #[inline(always)]
    pub(super) fn step(
        &self,
        p: &mut Particle,
        remainder: &mut Vec3,
        load: &Load,
        mass: f32,
        frame: &Frame,
    ) -> bool {
        let inverse_mass = 1.0 / mass;
        p.velocity = integrate::velocity(p.velocity, load.force, inverse_mass, self.gravity, self.dt);
        p.spin = integrate::spin(p.spin, load.torque, inverse_mass * self.spin_factor, self.dt);
        let x = integrate::position(p.position, remainder, p.velocity, self.dt, self.inverse_unit);
        p.position = frame.wrap(x);
        let speed2 = p.velocity.dot(p.velocity);
        let inside = p.position.cmpge(IVec3::splat(-DOMAIN_LIMIT)).all()
            && p.position.cmple(IVec3::splat(DOMAIN_LIMIT)).all();
        // The negated comparison would accept NaN.
        speed2 <= self.limit2 && p.spin.is_finite() && inside
    }
}

/// Moves every sub-particle by one step.
pub(crate) fn advance(
    params: &Params,
    state: &mut State,
    loads: &[Load],
    displacement: &mut DisplacementTracker,
) -> MotionStats {
    let integrator = Integrator::new(params, &state.frame);
    let (frame, masses, held, reference) =
        (state.frame, &state.masses, &state.held, displacement.reference());
    let moved = state
        .particles
        .par_chunks_mut(CHUNK)
        .zip(state.remainders.par_chunks_mut(CHUNK))
        .enumerate()
        .map(|(c, (particles, remainders))| {
            let mut moved = MotionStats::default();
            for (k, (p, remainder)) in particles.iter_mut().zip(remainders).enumerate() {
                let i = c * CHUNK + k;
                if held[i] {
                    continue;
                }
                if !integrator.step(p, remainder, &loads[i], masses[i], &frame) {
                    moved.runaway = moved.runaway.or(Some(i as u32));
                }
                moved.max_displacement2 =
                    moved.max_displacement2.max(length2(frame.between(reference[i], p.position)));
            }
            moved
        })
        .reduce(MotionStats::default, MotionStats::merge);
    displacement.record(moved.max_displacement2);
    moved
}
