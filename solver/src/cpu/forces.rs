//! The `forces` stage: every sub-particle gathers what its bonds, contacts and walls do to it.

use std::iter::successors;

use glam::{IVec3, Vec3};
use rayon::prelude::*;

use super::lists::{ChunkLists, Lists, WallPair};
use super::walls::{Touch, Walls};
use super::{CHUNK, Params};
use crate::engine::frame::Frame;
use crate::engine::state::{Particle, State};
use crate::physics::contact::ContactHistory;
use crate::physics::{bond, contact, damping};

/// What acts on a sub-particle in one step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Load {
    /// Force without gravity, in newton.
    pub force: Vec3,
    /// Torque, in N m.
    pub torque: Vec3,
}

impl Load {
    /// Adds a force at the end of `arm`, of which only `across` has a moment.
    fn add(&mut self, force: Vec3, arm: Vec3, across: Vec3) {
        self.force += force;
        self.torque += arm.cross(across);
    }
}

/// What the stage has noticed.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Felt {
    /// Greatest overlap of sub-particles that no bond joins, in metres.
    pub max_overlap: f32,
    /// Bonds that broke in this step.
    pub bonds_broken: u32,
}

impl Felt {
    fn and(self, other: Self) -> Self {
        Self {
            max_overlap: self.max_overlap.max(other.max_overlap),
            bonds_broken: self.bonds_broken + other.bonds_broken,
        }
    }
}

/// Works out the load of every sub-particle.
pub(crate) fn gather(
    params: &Params,
    state: &State,
    walls: &Walls,
    lists: &mut Lists,
    loads: &mut Vec<Load>,
    broken: &mut [u32],
) -> Felt {
    loads.resize(state.particles.len(), Load::default());
    let shares = loads.par_chunks_mut(CHUNK).zip(broken.par_chunks_mut(CHUNK));
    let chunks = lists.chunks.par_iter_mut().zip(shares).enumerate();
    chunks
        .map(|(c, (chunk, (loads, broken)))| {
            let mut felt = Felt::default();
            for (k, (load, broken)) in loads.iter_mut().zip(broken).enumerate() {
                *load = Load::default();
                let i = c * CHUNK + k;
                let pairs = from_pairs(params, state, i, chunk, k, load);
                *broken += pairs.bonds_broken;
                felt = felt.and(pairs);
                let (me, near) = (&state.particles[i], chunk.walls_mut(k));
                from_walls(params.radius, params.dt, &state.frame, walls, me, state.masses[i], near, load);
            }
            felt
        })
        .reduce(Felt::default, Felt::and)
}

fn from_pairs(
    params: &Params,
    state: &State,
    i: usize,
    chunk: &mut ChunkLists,
    k: usize,
    load: &mut Load,
) -> Felt {
    let Params { laws, radius, dt, .. } = params;
    let (me, mass) = (&state.particles[i], state.masses[i]);
    let (touch, hold) = (2.0 * radius, 2.0 * radius + laws.tissue.adhesion_range());
    let mut felt = Felt::default();
    for pair in chunk.pairs_mut(k) {
        let j = pair.other as usize;
        let other = &state.particles[j];
        let d = state.frame.between(me.position, other.position);
        let length2 = d.dot(d);
        let bonded = pair.bond_class != 0;
        if !bonded && length2 > hold * hold {
            pair.contact = ContactHistory::default();
            continue;
        }
        let length = length2.sqrt();
        // Two centres on one spot have no direction; a force along none is no force.
        let n = if length > 0.0 { d / length } else { Vec3::ZERO };
        let arm = n * (length / 2.0);
        // Velocity of j against i where they meet.
        let v = other.velocity - me.velocity - (me.spin + other.spin).cross(arm);
        let spin = (me.spin + other.spin) * 0.5;
        if bonded {
            let rest = touch * (pair.bond_class as f32).sqrt();
            match bond::force(&laws.bond, &mut pair.bond, n, rest, length, v, spin, *dt) {
                Some(force) => load.add(force.total, arm, force.shear),
                None => {
                    pair.bond_class = 0;
                    pair.bond = Vec3::ZERO;
                    // Both sides see it; the lower one counts it.
                    felt.bonds_broken += u32::from(i < j);
                }
            }
        }
        if !bonded || laws.contact_between_bonded {
            let cap = if bonded { damping::BONDED_CAP } else { damping::BODY_CAP };
            let m_star = mass * state.masses[j] / (mass + state.masses[j]);
            let delta = touch - length;
            if let Some(force) =
                contact::force(&laws.tissue, &mut pair.contact, n, delta, -v, spin, m_star, cap, *dt)
            {
                load.add(force.normal + force.tangential, arm, force.tangential);
                if !bonded {
                    felt.max_overlap = felt.max_overlap.max(delta);
                }
            }
        }
    }
    felt
}

/// Adds what the facets near a sub-particle do to it.
#[expect(clippy::too_many_arguments, reason = "what the path has at hand")]
fn from_walls(
    radius: f32,
    dt: f32,
    frame: &Frame,
    walls: &Walls,
    me: &Particle,
    mass: f32,
    near: &mut [WallPair],
    load: &mut Load,
) {
    feel_walls(radius, frame, walls, me.position, near, &mut Vec::new(), |_, wall, touch| {
        let n = touch.to_wall / touch.distance;
        let v = me.velocity + me.spin.cross(touch.to_wall) - touch.velocity;
        let (law, delta) = (walls.law(wall.facet), radius - touch.distance);
        if let Some(force) =
            contact::force(law, &mut wall.contact, n, delta, v, touch.spin, mass, damping::SURFACE_CAP, dt)
        {
            wall.force = force.normal + force.tangential;
            load.add(wall.force, touch.to_wall, force.tangential);
        }
    });
}

/// Shows the facets near a sub-particle that it may feel, by their numbers among those near, with how it touches each; what the others
/// remember is forgotten. Returns the distance of the nearest, in metres.
pub(super) fn feel_walls(
    radius: f32,
    frame: &Frame,
    walls: &Walls,
    position: IVec3,
    near: &mut [WallPair],
    touches: &mut Vec<(u32, Touch)>,
    mut felt: impl FnMut(usize, &mut WallPair, &Touch),
) -> f32 {
    touches.clear();
    touches.extend(near.iter().map(|wall| (wall.facet, walls.touch(wall.facet, position, frame))));
    if touches.len() > 1 {
        hand_over(radius, walls, touches, near);
    }
    let mut nearest = f32::INFINITY;
    for (k, (wall, (facet, touch))) in near.iter_mut().zip(&*touches).enumerate() {
        nearest = nearest.min(touch.distance);
        wall.force = Vec3::ZERO;
        let is_far = radius - touch.distance < -walls.law(*facet).adhesion_range();
        // A centre right on the plate has no side; it gets one in the next step.
        if is_far || touch.distance <= 0.0 || gives_way(walls, touches, k).is_some() {
            wall.contact = ContactHistory::default();
        } else {
            felt(k, wall, touch);
        }
    }
    nearest
}

/// Where a facet that the sphere held on to now gives way to another, hands what their contact remembers on to the one
/// that takes over: to the sphere it is one contact that moves along a surface, however that is cut. A facet that was
/// felt beside it keeps its own memory. What has left the reach has nothing to hand on, whether or not lists still hold
/// it.
fn hand_over(radius: f32, walls: &Walls, touches: &[(u32, Touch)], near: &mut [WallPair]) {
    for k in 0..near.len() {
        let (facet, touch) = touches[k];
        if !near[k].contact.in_contact || radius - touch.distance < -walls.law(facet).adhesion_range() {
            continue;
        }
        // One that is felt: those that come before are ordered. Should rounding ever say otherwise, the memory is lost.
        let chain = successors(Some(k), |&at| gives_way(walls, touches, at));
        let heir = chain.take(touches.len()).last().unwrap_or(k);
        if heir != k {
            let handed = std::mem::take(&mut near[k].contact);
            if !near[heir].contact.in_contact {
                near[heir].contact = handed;
            }
        }
    }
}

/// Which of the touches of a sub-particle the `k`th gives way to.
fn gives_way(walls: &Walls, touches: &[(u32, Touch)], k: usize) -> Option<usize> {
    let (facet, touch) = &touches[k];
    let others = touches.iter().copied().filter(|(other, _)| other != facet);
    let before = walls.gives_way_to(*facet, touch, others)?;
    touches.iter().position(|&(other, _)| other == before)
}
