//! The CPU backend, fast path: the model of the plain path, many pairs at a time.
//!
//! A step has two phases over all bodies.
//!
//! 1. *Contacts*: each body renews its neighbour lists where their skin may be used up (`broad_phase`). It
//!    then evaluates the contacts with itself and with bodies of higher index, each pair once
//!    (`narrow_phase`).
//! 2. *Motion*: each body sums the loads of its pairs, bonds and facets, then moves (`integration`).
//!
//! ```text
//! instructions ◄── storage ◄── broad_phase ◄── narrow_phase ◄── integration ◄── FastRun
//! ```
//!
//! An arrow points at the imported module. No folder imports another one to its right.
//!
//! Bits depend neither on the number of threads nor on the batch, the chunks of steps or the moment of a
//! list's renewal. A body writes only its own data, and sums follow the order of ids. Bits do not depend on
//! the instruction set either, since all sets fuse the same multiply-adds. They differ from the bits of the
//! plain path; tests hold the two together within a tolerance.
//!
//! Memory traffic is kept small. Sub-particles are stored as pairs read them, and become blocks of 16 only
//! while they move. A body prefetches the data of the next one while it is worked on.

mod broad_phase;
mod instructions;
mod integration;
mod narrow_phase;
mod population;
mod saved;
mod schedule;
mod storage;
#[cfg(test)]
mod tests;

use std::ops::Range;
use std::sync::Arc;

use rayon::prelude::*;

use super::Params;
use super::integrate::{Integrator, fault};
use super::stages::{Stage, StageTimers};
use crate::engine::scene::Scene;
use crate::engine::state::State;
use crate::engine::{AdvanceReport, SurfaceLoad};
use crate::physics::InternalLaws;
use crate::walls::Walls;
use broad_phase::body_pair::BodyPair;
use broad_phase::pair_lists::BodyContacts;
use broad_phase::pair_search::{SearchParams, overlapping_bodies};
pub use instructions::set::InstructionSet;
use integration::step::{BodyStats, MotionScratch, MoveBody, NextBody};
use narrow_phase::pair_contacts::{ContactPhase, PairScratch};
use schedule::{PerThread, bodies_per_task, morton_order, permuted};
use storage::body::Body;
use storage::bond_set::BondSet;
use storage::bounds::FixedAabb;
use storage::context::StepContext;
use storage::laws::{LaneContactLaw, PairContactLaw, PairLaws};
use storage::motion::SAFETY_FACTOR;
use storage::pairs::BodyPairList;

/// Verlet skins of the neighbour lists, as shares of R: between two bodies, and within a body.
const SKIN_RATIOS: [f32; 2] = [0.4, 0.25];

/// The same for the candidates of these lists. Within a body the cutoff must stay below the lattice's face
/// diagonal, 2√2 R.
const OUTER_SKIN_RATIOS: [f32; 2] = [2.0, 0.8];

/// Verlet skin of the wall lists, as a share of R.
const WALL_SKIN_RATIO: f32 = 0.7;

/// Margin of the broad phase over bodies beyond the cutoff, as a share of R.
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
    /// Whether positions and velocities of `state` are those of the bodies.
    state_is_current: bool,
    walls: Walls,
    bodies: Vec<Body>,
    /// Body pairs, sorted by their bodies.
    body_pairs: Vec<BodyPair>,
    /// Number of body pairs of which each body is the first.
    pair_counts: Vec<usize>,
    /// For each body pair, the range of its close pairs' loads among those of its first body.
    loads: Vec<Range<u32>>,
    /// Neighbour lists of each body: its pairs with itself and with bodies of higher index.
    pairs: Vec<BodyPairList>,
    /// Whether a body has left its margin since the body pairs were found.
    body_pairs_stale: bool,
    step: u64,
    start_step: Option<u64>,
    pub(super) fault: Option<String>,
    /// Contact laws of the surfaces, by number.
    wall_laws: Vec<LaneContactLaw>,
    stages: Arc<StageTimers>,
    /// Order in which bodies are worked on: neighbours in succession share the cache.
    order: Vec<u32>,
    scratch_per_thread: PerThread<(PairScratch, MotionScratch)>,
}

impl FastRun {
    pub(super) fn new(scene: &Scene, params: Params, instructions: InstructionSet) -> Self {
        let mut run = Self::without_bodies(scene, params, instructions, State::new(scene));
        run.take_in(scene, scene.present(), 0);
        run
    }

    /// A run whose bodies are not yet taken in.
    fn without_bodies(scene: &Scene, params: Params, instructions: InstructionSet, state: State) -> Self {
        let InternalLaws { contacts, bond, moment, contact_between_bonded } =
            params.laws.internal(params.radius);
        let [contact, body_contact] =
            contacts.map(|(law, distance)| PairContactLaw { law: LaneContactLaw::new(law), distance });
        let laws = PairLaws { contact, body_contact, bond, moment, contact_between_bonded, dt: params.dt };
        let walls = Walls::new(scene, &state.frame);
        let search = SearchParams {
            cutoffs: [body_contact, contact].map(|contact| contact.hold_distance()),
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
            bodies: Vec::new(),
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
        let changed = self.walls.start();
        let walls = self.bodies.iter_mut().flat_map(|body| &mut body.walls.pairs);
        walls.for_each(|wall| wall.surface_changed(&changed));
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
        let max_overlap = self.compute_contacts();
        let stats = self.move_bodies();
        self.state_is_current = false;
        self.body_pairs_stale = stats.left_margin;
        // Data of bodies lies in the caches of other threads: read it only when needed.
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
        done.passed_through += u64::from(stats.passed_through);
        if stats.runaway.is_some() {
            self.state();
            self.fault = stats.runaway.map(|i| fault(i as usize, self.params.speed_limit, &self.state));
        }
    }

    /// Finds the pairs of bodies near each other. Pairs that persist keep their lists.
    fn update_body_pairs(&mut self) {
        let reach = self.search.cutoffs[0] + MARGIN_RATIO * self.params.radius;
        let aabbs: Vec<FixedAabb> = self.bodies.iter().map(|body| body.bounds.whole).collect();
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
            body.pairs_as_second.clear();
            body.pairing_motion = body.motion;
        }
        for (m, BodyPair { bodies: [first, second], .. }) in (0u32..).zip(&self.body_pairs) {
            self.bodies[*second as usize].pairs_as_second.push([m, *first]);
        }
        let groups = self.body_pairs.chunk_by(|a, b| a.bodies[0] == b.bodies[0]);
        self.pair_counts = groups.map(<[BodyPair]>::len).collect();
        self.loads.clear();
        self.loads.resize(self.body_pairs.len(), 0..0);
    }

    /// Phase 1, contacts. Every body forms a pair with itself, so there are as many groups of pairs as
    /// bodies.
    fn compute_contacts(&mut self) -> f32 {
        let step = (self.step + 2) as u32;
        let Self { laws, search, state, bodies, body_pairs, loads, pairs, instructions, .. } = self;
        let Self { stages, scratch_per_thread, order, pair_counts, .. } = self;
        let (mut body_pairs, mut loads) = (&mut body_pairs[..], &mut loads[..]);
        let groups = pair_counts.iter().map(|&count| {
            let body_pairs = body_pairs.split_off_mut(..count).expect("as many as there are");
            (body_pairs, loads.split_off_mut(..count).expect("as many as body pairs"))
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
            let (scratch, _) = &mut *scratch_per_thread.current();
            let evaluate = |contacts| instructions.run(ContactPhase { contacts, search, scratch, stages });
            some.iter_mut().map(evaluate).fold(0.0, f32::max)
        });
        work.reduce(|| 0.0, f32::max)
    }

    /// Phase 2, motion.
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
            wall_cutoff: params.radius + params.laws.adhesion_range(),
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

    pub(super) fn surface_loads(&self) -> Vec<SurfaceLoad> {
        let of_body = |body: &'_ Body| {
            let mut from = 0;
            let rows = body.walls.rows.iter().flat_map(move |row| {
                let near = std::mem::replace(&mut from, row.end as usize)..row.end as usize;
                near.map(move |k| (row.of, k))
            });
            let contact = |(of, k): (u32, usize)| {
                let pair = &body.walls.pairs[k];
                (body.points.particle(of as usize), pair.facet, pair.force)
            };
            rows.map(contact).collect::<Vec<_>>()
        };
        self.walls.loads(&self.state.frame, self.params.dt, self.bodies.iter().flat_map(of_body))
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
