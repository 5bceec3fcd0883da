//! The `integrate` stage: loads become motion, and what went wrong or far is noticed.

use glam::IVec3;
use rayon::prelude::*;

use super::bounds::{Drift, length2};
use super::forces::Load;
use super::{CHUNK, Params};
use crate::engine::state::State;
use crate::physics::integrate;

/// Positions beyond this are twice the domain away from its middle, in units: what goes there is lost, and a little
/// further differences of positions would wrap.
const EDGE: i32 = 1 << 30;

/// What the stage has noticed.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Moved {
    /// Square of the greatest displacement since the lists were built, in m².
    greatest2: f32,
    /// The first sub-particle that is too fast or not a number any more.
    runaway: Option<u32>,
}

impl Moved {
    fn and(self, other: Self) -> Self {
        Self {
            greatest2: self.greatest2.max(other.greatest2),
            runaway: self.runaway.into_iter().chain(other.runaway).min(),
        }
    }

    /// What is wrong, in words, if something is.
    pub(crate) fn fault(&self, params: &Params, state: &State) -> Option<String> {
        let i = self.runaway? as usize;
        let speed = state.particles[i].velocity.length();
        let what = if !(speed.is_finite() && state.particles[i].spin.is_finite()) {
            "has no finite velocity or spin".to_owned()
        } else if speed <= params.speed_limit {
            "has left the domain".to_owned()
        } else {
            format!("moves at {speed:.3} m/s, past the speed limit of {} m/s", params.speed_limit)
        };
        Some(format!("sub-particle {} of fillet {} {what}", state.serials[i], state.bodies[i]))
    }
}

/// Moves every sub-particle by one step.
pub(crate) fn advance(params: &Params, state: &mut State, loads: &[Load], drift: &mut Drift) -> Moved {
    let dt = params.dt;
    let inverse_unit = 1.0 / state.frame.unit_m;
    let spin_factor = 2.5 / (params.radius * params.radius);
    let limit2 = params.speed_limit * params.speed_limit;
    let (frame, masses, held, reference) = (state.frame, &state.masses, &state.held, drift.reference());
    let moved = state
        .particles
        .par_chunks_mut(CHUNK)
        .zip(state.remainders.par_chunks_mut(CHUNK))
        .enumerate()
        .map(|(c, (particles, remainders))| {
            let mut moved = Moved::default();
            for (k, (p, remainder)) in particles.iter_mut().zip(remainders).enumerate() {
                let i = c * CHUNK + k;
                let inverse_mass = 1.0 / masses[i];
                if held[i] {
                    continue;
                }
                p.velocity =
                    integrate::velocity(p.velocity, loads[i].force, inverse_mass, params.gravity, dt);
                p.spin = integrate::spin(p.spin, loads[i].torque, inverse_mass * spin_factor, dt);
                p.position =
                    frame.wrap(integrate::position(p.position, remainder, p.velocity, dt, inverse_unit));
                moved.greatest2 = moved.greatest2.max(length2(frame.between(reference[i], p.position)));
                let speed2 = p.velocity.dot(p.velocity);
                let inside =
                    p.position.cmpge(IVec3::splat(-EDGE)).all() && p.position.cmple(IVec3::splat(EDGE)).all();
                // Not `speed2 > limit2`: what is not a number is no speed either.
                if !(speed2 <= limit2 && p.spin.is_finite() && inside) {
                    moved.runaway = moved.runaway.or(Some(i as u32));
                }
            }
            moved
        })
        .reduce(Moved::default, Moved::and);
    drift.record(moved.greatest2);
    moved
}
