//! The `forces` stage: every sub-particle gathers the loads of its bonds, contacts and walls.

use glam::Vec3;
use rayon::prelude::*;

use super::load::Load;
use super::neighbour_list::{ChunkNeighbours, NeighbourLists};
use super::{CHUNK, Params};
use crate::engine::frame::Frame;
use crate::engine::state::{Particle, State};
use crate::engine::wall_pair::WallPair;
use crate::physics::contact::ContactHistory;
use crate::physics::moment::MomentHistory;
use crate::physics::{bond, contact, damping, moment};
use crate::walls::Walls;
use crate::walls::contact::{Seer, for_each_contact};

/// Statistics of the stage.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ForceStats {
    /// Maximum overlap of sub-particles without a bond, in metres.
    pub max_overlap: f32,
    /// Bonds that broke in this step.
    pub bonds_broken: u32,
    /// Surfaces that sub-particles passed through in this step.
    pub passed_through: u32,
}

impl ForceStats {
    fn merge(self, other: Self) -> Self {
        Self {
            max_overlap: self.max_overlap.max(other.max_overlap),
            bonds_broken: self.bonds_broken + other.bonds_broken,
            passed_through: self.passed_through + other.passed_through,
        }
    }
}

/// Computes the load of every sub-particle.
pub(crate) fn gather(
    params: &Params,
    state: &State,
    walls: &Walls,
    neighbour_lists: &mut NeighbourLists,
    loads: &mut Vec<Load>,
    broken: &mut [u32],
) -> ForceStats {
    loads.resize(state.particles.len(), Load::default());
    let shares = loads.par_chunks_mut(CHUNK).zip(broken.par_chunks_mut(CHUNK));
    let chunks = neighbour_lists.chunks.par_iter_mut().zip(shares).enumerate();
    chunks
        .map(|(c, (chunk, (loads, broken)))| {
            let mut stats = ForceStats::default();
            for (k, (load, broken)) in loads.iter_mut().zip(broken).enumerate() {
                *load = Load::default();
                let i = c * CHUNK + k;
                let pairs = add_pair_forces(params, state, i, chunk, k, load);
                *broken += pairs.bonds_broken;
                stats = stats.merge(pairs);
                let (me, near) = (&state.particles[i], chunk.walls_mut(k));
                stats.passed_through +=
                    add_wall_forces(params, &state.frame, walls, me, state.masses[i], near, load);
            }
            stats
        })
        .reduce(ForceStats::default, ForceStats::merge)
}

fn add_pair_forces(
    params: &Params,
    state: &State,
    i: usize,
    chunk: &mut ChunkNeighbours,
    k: usize,
    load: &mut Load,
) -> ForceStats {
    let Params { laws, radius, dt, .. } = params;
    let (me, mass) = (&state.particles[i], state.masses[i]);
    let contacts =
        laws.pair_contacts(*radius).map(|(law, distance)| (law, distance, distance + law.adhesion_range()));
    let mut stats = ForceStats::default();
    let (pairs, moments) = chunk.pairs_mut(k);
    let mut moments = moments.iter_mut();
    for pair in pairs {
        let history = moments.next();
        let j = pair.other as usize;
        let other = &state.particles[j];
        let d = state.frame.between(me.position, other.position);
        let length2 = d.dot(d);
        let bonded = pair.bond_class != 0;
        let (law, contact_distance, hold) = &contacts[usize::from(state.bodies[i] != state.bodies[j])];
        if !bonded && length2 > hold * hold {
            pair.contact = ContactHistory::default();
            continue;
        }
        let length = length2.sqrt();
        // Coincident centres have no direction, and so no force.
        let n = if length > 0.0 { d / length } else { Vec3::ZERO };
        let arm = n * (length / 2.0);
        // Velocity of j relative to i at the contact point.
        let u = other.velocity - me.velocity;
        let v = u - (me.spin + other.spin).cross(arm);
        let spin = (me.spin + other.spin) * 0.5;
        if bonded {
            let rest = 2.0 * radius * (pair.bond_class as f32).sqrt();
            let m_star = mass * state.masses[j] / (mass + state.masses[j]);
            let mut law = laws.bond;
            let moment = laws.moment.as_ref().zip(history).map(|(moments, history)| {
                let moment = moment::moment(moments, history, n, other.spin - me.spin, spin, m_star, *dt);
                law = moments.weaken(&law, history);
                (moment, history)
            });
            match bond::force(&law, &mut pair.bond, n, rest, length, u, v, spin, *dt) {
                Some(force) => {
                    load.add(force.total, arm, force.shear);
                    if let Some((moment, _)) = moment {
                        load.torque += moment;
                    }
                }
                None => {
                    pair.bond_class = 0;
                    pair.bond = Vec3::ZERO;
                    if let Some((_, history)) = moment {
                        *history = MomentHistory::default();
                    }
                    // Both sides detect the break; the lower one counts it.
                    stats.bonds_broken += u32::from(i < j);
                }
            }
        }
        if !bonded || laws.contact_between_bonded {
            let cap = if bonded { damping::BONDED_CAP } else { damping::BODY_CAP };
            let m_star = mass * state.masses[j] / (mass + state.masses[j]);
            let delta = contact_distance - length;
            if let Some(force) = contact::force(law, &mut pair.contact, n, delta, -v, spin, m_star, cap, *dt)
            {
                load.add(force.normal + force.tangential, arm, force.tangential);
                if !bonded {
                    stats.max_overlap = stats.max_overlap.max(delta);
                }
            }
        }
    }
    stats
}

/// Adds the loads of the facets near a sub-particle. Returns how many surfaces it has passed through.
fn add_wall_forces(
    params: &Params,
    frame: &Frame,
    walls: &Walls,
    me: &Particle,
    mass: f32,
    near: &mut [WallPair],
    load: &mut Load,
) -> u32 {
    let Params { radius, dt, .. } = *params;
    let seer = Seer { radius, position: me.position, velocity: me.velocity, dt };
    let stats = for_each_contact(&seer, frame, walls, near, &mut Vec::new(), |_, wall, point| {
        let distance = point.signed_distance();
        let n = point.to_wall / distance;
        let v = me.velocity + me.spin.cross(point.to_wall) - point.velocity;
        let (law, delta) = (walls.law(wall.facet), radius - distance);
        if let Some(force) =
            contact::force(law, &mut wall.contact, n, delta, v, point.spin, mass, damping::SURFACE_CAP, dt)
        {
            wall.force = force.normal + force.tangential;
            load.add(wall.force, point.to_wall, force.tangential);
        }
    });
    stats.passed
}
