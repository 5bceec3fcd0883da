//! The CPU backend, fast path: what the plain path does, many pairs at a time.
//!
//! A step has two phases. In the first every body works out its contacts with itself and with as_range after it ([`body_pair`]), each pair
//! once. In the second every [`body`] adds its bonds, what all its body_pairs have left for it and its walls, and moves. Within
//! a phase nothing depends on the order in which bodies are worked on: each writes only what is its own,
//! and sums go by the order of ids. So the bits are the same whatever the number of threads, the batch, the chunks of
//! steps, or the moment when pairs were looked up; and since [`lanes`] fuses multiplications with additions on every
//! instruction set, whatever that costs there, on all of them. They differ from the plain path's, which the tests hold
//! them to self_loads a tolerance.
//!
//! Sub-particles stand in blocks of 16 ([`points`]). Bonds join a block with at most two others, so that neighbours are moved into
//! their lanes self_loads registers ([`bonds`]); pairs of different bodies are looked at one after the other, as_range that touch are
//! put together and transposed ([`load`]). LoadArray of such pairs come out the same way, and are added to sums that stand as sub-particles
//! are looked at; blocks transpose them back when they move. From memory and to it goes as little as can be: sub-particles are kept as
//! pairs pair_offsets at them and become blocks while they move, and what a body will read is asked for while the one before is worked on
//! ([`fetch`]). What touches one flat facet and nothing else is put together likewise ([`alone`]); where facets meet, each is looked at by itself ([`walls`]).

mod body;
mod body_groups;
mod body_pair;
mod bonds;
mod bounds;
mod facets;
mod instructions;
mod jkr;
mod kernel;
mod lanes;
mod laws;
mod load;
mod memory;
mod pairs;
mod points;
mod prefetch;
mod removal;
mod search;
mod share;
mod single;
#[cfg(test)]
mod tests;
mod walls;
#[cfg(target_arch = "x86_64")]
mod x86;

use std::ops::Range;
use std::sync::Arc;

use glam::DVec3;
use rayon::prelude::*;

use super::Params;
use super::integrate::{Integrator, MotionStats};
use super::stages::{Stage, StageTimers};
use crate::engine::AdvanceReport;
use crate::engine::scene::Scene;
use crate::engine::state::State;
use crate::walls::Walls;
use body::{Body, BodyStats, MotionScratch, MoveBody, NextBody, StepContext};
use body_groups::{BodyGroup, body_groups};
use body_pair::{BodyContacts, BodyPair, ContactPhase, PairScratch, SAFETY_FACTOR};
use bonds::BondSet;
use bounds::Aabb;
pub use instructions::InstructionSet;
use laws::{LaneContactLaw, PairLaws};
use pairs::BodyPairList;
use points::BodyParticles;
use search::{SearchParams, overlapping_bodies};
use share::{PerThread, bodies_per_task, morton_order, permuted};

/// Distance beyond reach that lists cover, as a share of R: between two bodies, and between a body and itself.
const SKIN_RATIOS: [f32; 2] = [0.4, 0.25];

/// The same of candidates for as_range lists. Within a body it stays short of the lattice's face diagonal, 2√2 R.
const OUTER_SKIN_RATIOS: [f32; 2] = [2.0, 0.8];

/// The same for facets.
const WALL_SKIN_RATIO: f32 = 0.7;

/// Distance of bodies that makes them meet, beyond reach, as a share of R.
const MARGIN_RATIO: f32 = 6.0;

/// A run on the fast path.
#[derive(Debug)]
pub struct FastRun {
    params: Params,
    laws: PairLaws,
    search: SearchParams,
    wall_skin: f32,
    integrator: Integrator,
    instructions: InstructionSet,
    state: State,
    /// Whether positions and velocities of the state are as_range of the bodies.
    state_is_current: bool,
    walls: Walls,
    bodies: Vec<Body>,
    /// Sorted by their bodies.
    body_pairs: Vec<BodyPair>,
    /// How many body_pairs each body is the first of.
    pair_counts: Vec<usize>,
    /// Of each body_pair, where the loads of its pairs that are close stand among as_range of its first body.
    loads: Vec<Range<u32>>,
    /// Those of each body with itself and as_range after it.
    pairs: Vec<BodyPairList>,
    /// Whether others may meet since the body_pairs were drawn up.
    body_pairs_stale: bool,
    step: u64,
    start_step: Option<u64>,
    pub(super) fault: Option<String>,
    /// Laws of surfaces, by their numbers.
    wall_laws: Vec<LaneContactLaw>,
    stages: Arc<StageTimers>,
    /// The bodies as they are worked on: neighbours soon after each other, so that they are still in the cache.
    order: Vec<u32>,
    scratch_per_thread: PerThread<(PairScratch, MotionScratch)>,
}

impl FastRun {
    pub(super) fn new(scene: &Scene, params: Params, instructions: InstructionSet) -> Self {
        let state = State::new(scene);
        let laws = PairLaws {
            contact: LaneContactLaw::new(params.laws.tissue),
            bond: params.laws.bond,
            contact_between_bonded: params.laws.contact_between_bonded,
            touch: 2.0 * params.radius,
            dt: params.dt,
        };
        let mut bodies = Vec::new();
        for BodyGroup { range, kind } in body_groups(scene) {
            let bonds = BondSet::all(&kind.meta.bonds, &laws);
            let bonded_pairs = kind.meta.bonds.iter().map(|bond| [bond.i, bond.j]);
            let points = BodyParticles::of(&state, range.clone());
            bodies.push(Body::new(range, points, kind.subparticle_mass_kg as f32, bonds, bonded_pairs));
        }
        let walls = Walls::new(scene, &state.frame);
        let search = SearchParams {
            reach: 2.0 * params.radius + params.laws.adhesion_range(),
            skins: SKIN_RATIOS.map(|ratio| ratio * params.radius),
            outer_skins: OUTER_SKIN_RATIOS.map(|ratio| ratio * params.radius),
        };
        Self {
            wall_laws: (0..walls.surface_count())
                .map(|k| LaneContactLaw::new(*walls.law_of_surface(k)))
                .collect(),
            walls,
            integrator: Integrator::new(&params, &state.frame),
            laws,
            search,
            wall_skin: WALL_SKIN_RATIO * params.radius,
            instructions,
            bodies,
            body_pairs: Vec::new(),
            pair_counts: Vec::new(),
            loads: Vec::new(),
            pairs: Vec::new(),
            body_pairs_stale: true,
            step: 0,
            start_step: None,
            fault: None,
            stages: Arc::default(),
            order: Vec::new(),
            scratch_per_thread: PerThread::default(),
            params,
            state_is_current: true,
            state,
        }
    }

    pub(super) fn stages(&self) -> &StageTimers {
        &self.stages
    }

    /// The state, brought up to date.
    pub(super) fn state(&mut self) -> &State {
        if !self.state_is_current {
            let (mut particles, mut remainders) =
                (&mut self.state.particles[..], &mut self.state.remainders[..]);
            for body in &self.bodies {
                let count = body.range().len();
                let particles = particles.split_off_mut(..count).expect("as many as bodies have");
                let remainders = remainders.split_off_mut(..count).expect("as many as bodies have");
                body.points.write_to(particles, remainders);
            }
            self.state_is_current = true;
        }
        &self.state
    }

    pub(super) fn advance(&mut self, steps: u64) -> AdvanceReport {
        let mut done = AdvanceReport::default();
        self.scratch_per_thread.resize_to_pool();
        for _ in 0..steps {
            if self.fault.is_some() {
                break;
            }
            self.one_step(&mut done);
        }
        done.fault.clone_from(&self.fault);
        done
    }

    pub(super) fn start(&mut self) {
        self.start_step = Some(self.step);
        self.walls.remove_until_start();
    }

    /// One time step: the stages of [`crate::engine::Backend`].
    fn one_step(&mut self, done: &mut AdvanceReport) {
        let belt_time = self.start_step.map(|start| (self.step - start) as f64 * self.params.dt_exact);
        self.walls.pose(belt_time, &self.state.frame);
        let stages = Arc::clone(&self.stages);
        let mut timer = stages.timer();
        if std::mem::take(&mut self.body_pairs_stale) {
            self.update_body_pairs();
        }
        timer.lap(Stage::Neighbours);
        let max_overlap = self.meet();
        let stats = self.move_bodies();
        self.state_is_current = false;
        self.body_pairs_stale = stats.left_margin;
        // Bodies that other threads have worked on are far away: not without need.
        if stats.has_broken {
            for body in &self.bodies {
                let first = body.range().start;
                body.broken.iter().for_each(|&k| self.state.broken[first + k as usize] += 1);
                self.state.bonds_broken += body.broken.len() as u64;
            }
        }
        self.step += 1;
        done.steps += 1;
        done.particle_steps += self.state.particles.len() as u64;
        done.max_overlap_m = done.max_overlap_m.max(max_overlap).max(stats.max_overlap);
        if stats.runaway.is_some() {
            self.state();
            self.fault = MotionStats::runaway(stats.runaway).fault(&self.params, &self.state);
        }
    }

    /// Finds the bodies that are near each other. Meetings that stay keep their pairs.
    fn update_body_pairs(&mut self) {
        let reach = self.search.reach + MARGIN_RATIO * self.params.radius;
        let aabbs: Vec<Aabb> = self.bodies.iter().map(|body| body.bounds.whole).collect();
        self.order = morton_order(&aabbs);
        let pairs = overlapping_bodies(&aabbs, reach, &self.state.frame);
        let mut old = std::mem::take(&mut self.body_pairs).into_iter().peekable();
        for pair in pairs {
            while old.next_if(|body_pair| body_pair.bodies < pair).is_some() {}
            let known = old.next_if(|body_pair| body_pair.bodies == pair);
            self.body_pairs.push(known.unwrap_or_else(|| BodyPair::new(pair)));
        }
        self.pairs.resize_with(self.bodies.len(), BodyPairList::default);
        self.pairs.iter_mut().for_each(|pairs| pairs.is_stale = true);
        for body in &mut self.bodies {
            body.second_in.clear();
            body.pairing_motion = body.motion;
        }
        for (m, BodyPair { bodies: [first, second], .. }) in (0u32..).zip(&self.body_pairs) {
            self.bodies[*second as usize].second_in.push([m, *first]);
        }
        let groups = self.body_pairs.chunk_by(|a, b| a.bodies[0] == b.bodies[0]);
        self.pair_counts = groups.map(<[BodyPair]>::len).collect();
        self.loads.clear();
        self.loads.resize(self.body_pairs.len(), 0..0);
    }

    /// The first phase. Every body second_in itself at least, so body_pairs come in as many groups as there are bodies.
    fn meet(&mut self) -> f32 {
        let step = (self.step + 2) as u32;
        let Self { laws, search, state, bodies, body_pairs, loads, pairs, instructions, .. } = self;
        let Self { stages, scratch_per_thread, order, pair_counts, .. } = self;
        let (mut body_pairs, mut loads) = (&mut body_pairs[..], &mut loads[..]);
        let groups = pair_counts.iter().map(|&count| {
            let body_pairs = body_pairs.split_off_mut(..count).expect("as many as there are");
            (body_pairs, loads.split_off_mut(..count).expect("as many as body_pairs"))
        });
        let work = groups.zip(pairs).map(|((body_pairs, loads), pairs)| BodyContacts {
            body_pairs,
            loads,
            bodies,
            pairs,
            laws,
            frame: &state.frame,
            step,
        });
        let mut work = permuted(order, work);
        let some = bodies_per_task(work.len());
        let work = work.par_chunks_mut(some).with_max_len(1).map(|some| {
            let (room, _) = &mut *scratch_per_thread.current();
            let meet = |contacts| instructions.run(ContactPhase { contacts, search, room, stages });
            some.iter_mut().map(meet).fold(0.0, f32::max)
        });
        work.reduce(|| 0.0, f32::max)
    }

    /// The second phase.
    fn move_bodies(&mut self) -> BodyStats {
        let Self {
            laws,
            integrator,
            state,
            bodies,
            loads,
            pairs,
            walls,
            wall_skin,
            params,
            instructions,
            scratch_per_thread,
            order,
            ..
        } = self;
        let (stages, wall_laws) = (&*self.stages, &self.wall_laws[..]);
        let context = StepContext {
            laws,
            integrator,
            frame: &state.frame,
            walls,
            loads,
            pairs,
            margin: SAFETY_FACTOR * 0.5 * f64::from(MARGIN_RATIO * params.radius),
            stages,
            wall_laws,
            radius: params.radius,
            wall_reach: params.radius + params.laws.adhesion_range(),
            wall_skin: *wall_skin,
        };
        let mut work = permuted(order, bodies.iter_mut().zip(&*pairs));
        let some = bodies_per_task(work.len());
        let work = work.par_chunks_mut(some).with_max_len(1).map(|some| {
            let (_, scratch) = &mut *scratch_per_thread.current();
            let mut stats = BodyStats::default();
            for k in 0..some.len() {
                let (done, next) = some.split_at_mut(k + 1);
                let (body, pairs) = &mut done[k];
                let next = next.first().map(|(body, pairs)| NextBody { body, pairs });
                stats =
                    stats.merge(instructions.run(MoveBody { body, pairs, next, context: &context, scratch }));
            }
            stats
        });
        work.reduce(BodyStats::default, BodyStats::merge)
    }

    pub(super) fn surface_forces(&self) -> Vec<DVec3> {
        let mut forces = vec![DVec3::ZERO; self.walls.surface_count()];
        for wall in self.bodies.iter().flat_map(|body| &body.walls.pairs) {
            forces[self.walls.surface_of(wall.facet)] -= wall.force.as_dvec3();
        }
        forces
    }

    pub(super) fn bonds(&self) -> Vec<[u32; 2]> {
        let of = |body: &Body| {
            let serials = &self.state.serials[body.range()];
            let pairs = body.bonds.iter().flat_map(BondSet::intact);
            pairs.map(|pair| pair.map(|k| serials[k as usize])).collect::<Vec<_>>()
        };
        let mut bonds: Vec<[u32; 2]> = self.bodies.iter().flat_map(of).collect();
        bonds.sort_unstable();
        bonds
    }
}
