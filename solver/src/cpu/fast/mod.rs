//! The CPU backend, fast path: what the plain path does, many pairs at a time.
//!
//! A step has two phases. In the first every body works out its contacts with itself and with those after it ([`meeting`]), each pair
//! once. In the second every [`body`] adds its bonds, what all its meetings have left for it and its walls, and moves. Within
//! a phase nothing depends on the order in which bodies are worked on: each writes only what is its own,
//! and sums go by the order of ids. So the bits are the same whatever the number of threads, the batch, the chunks of
//! steps, or the moment when pairs were looked up; and since [`lanes`] fuses multiplications with additions on every
//! instruction set, whatever that costs there, on all of them. They differ from the plain path's, which the tests hold
//! them to within a tolerance.
//!
//! Sub-particles stand in blocks of 16 ([`points`]). Bonds join a block with at most two others, so that neighbours are moved into
//! their lanes within registers ([`bonds`]); pairs of different bodies are looked at one after the other, those that touch are
//! put together and transposed ([`load`]). Loads of such pairs come out the same way, and are added to sums that stand as sub-particles
//! are looked at; blocks transpose them back when they move. From memory and to it goes as little as can be: sub-particles are kept as
//! pairs look at them and become blocks while they move, and what a body will read is asked for while the one before is worked on
//! ([`fetch`]). What touches one flat facet and nothing else is put together likewise ([`alone`]); where facets meet, each is looked at by itself ([`walls`]).

mod alone;
mod body;
mod bonds;
mod clumps;
mod facets;
mod fetch;
mod instructions;
mod jkr;
mod kernel;
mod lanes;
mod laws;
mod load;
mod meeting;
mod memory;
mod pairs;
mod points;
mod removal;
mod search;
mod share;
#[cfg(test)]
mod tests;
mod walls;
mod whereabouts;
#[cfg(target_arch = "x86_64")]
mod x86;

use std::ops::Range;
use std::sync::Arc;

use glam::DVec3;
use rayon::prelude::*;

use super::Params;
use super::integrate::{Moved, Mover};
use super::stages::{Stage, Stages};
use super::walls::Walls;
use crate::engine::AdvanceReport;
use crate::engine::scene::Scene;
use crate::engine::state::State;
use body::{Body, Desk, Move, Next, Noticed, Surroundings};
use bonds::BondSet;
use clumps::{Clump, clumps};
pub use instructions::Instructions;
use laws::{LaneContact, PairLaws};
use meeting::{Contacts, Meet, Meeting, Room, SAFE};
use pairs::BodyPairs;
use points::Points;
use search::{Search, near_each_other};
use share::{PerThread, along_curve, at_once, in_order};
use whereabouts::Extent;

/// Distance beyond reach that lists cover, as a share of R: between two bodies, and between a body and itself.
const SKIN_RATIOS: [f32; 2] = [0.4, 0.25];

/// The same of candidates for those lists. Within a body it stays short of the lattice's face diagonal, 2√2 R.
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
    search: Search,
    wall_skin: f32,
    mover: Mover,
    instructions: Instructions,
    state: State,
    /// Whether positions and velocities of the state are those of the bodies.
    told: bool,
    walls: Walls,
    bodies: Vec<Body>,
    /// Sorted by their bodies.
    meetings: Vec<Meeting>,
    /// How many meetings each body is the first of.
    meeting_counts: Vec<usize>,
    /// Of each meeting, where the loads of its pairs that are close stand among those of its first body.
    loads: Vec<Range<u32>>,
    /// Those of each body with itself and those after it.
    pairs: Vec<BodyPairs>,
    /// Whether others may meet since the meetings were drawn up.
    have_strayed: bool,
    step: u64,
    start_step: Option<u64>,
    pub(super) fault: Option<String>,
    /// Laws of surfaces, by their numbers.
    wall_laws: Vec<LaneContact>,
    stages: Arc<Stages>,
    /// The bodies as they are worked on: neighbours soon after each other, so that they are still in the cache.
    order: Vec<u32>,
    workplaces: PerThread<(Room, Desk)>,
}

impl FastRun {
    pub(super) fn new(scene: &Scene, params: Params, instructions: Instructions) -> Self {
        let state = State::new(scene);
        let laws = PairLaws {
            contact: LaneContact::new(params.laws.tissue),
            bond: params.laws.bond,
            contact_between_bonded: params.laws.contact_between_bonded,
            touch: 2.0 * params.radius,
            dt: params.dt,
        };
        let mut bodies = Vec::new();
        for Clump { range, kind } in clumps(scene) {
            let bonds = BondSet::all(&kind.meta.bonds, &laws);
            let joined = kind.meta.bonds.iter().map(|bond| [bond.i, bond.j]);
            let points = Points::of(&state, range.clone());
            bodies.push(Body::new(range, points, kind.subparticle_mass_kg as f32, bonds, joined));
        }
        let walls = Walls::new(scene, &state.frame);
        let search = Search {
            reach: 2.0 * params.radius + params.laws.adhesion_range(),
            skins: SKIN_RATIOS.map(|ratio| ratio * params.radius),
            outer_skins: OUTER_SKIN_RATIOS.map(|ratio| ratio * params.radius),
        };
        Self {
            wall_laws: (0..walls.surface_count())
                .map(|k| LaneContact::new(*walls.law_of_surface(k)))
                .collect(),
            walls,
            mover: Mover::new(&params, &state.frame),
            laws,
            search,
            wall_skin: WALL_SKIN_RATIO * params.radius,
            instructions,
            bodies,
            meetings: Vec::new(),
            meeting_counts: Vec::new(),
            loads: Vec::new(),
            pairs: Vec::new(),
            have_strayed: true,
            step: 0,
            start_step: None,
            fault: None,
            stages: Arc::default(),
            order: Vec::new(),
            workplaces: PerThread::default(),
            params,
            told: true,
            state,
        }
    }

    pub(super) fn stages(&self) -> &Stages {
        &self.stages
    }

    /// The state, brought up to date.
    pub(super) fn state(&mut self) -> &State {
        if !self.told {
            let (mut particles, mut remainders) =
                (&mut self.state.particles[..], &mut self.state.remainders[..]);
            for body in &self.bodies {
                let count = body.range().len();
                let particles = particles.split_off_mut(..count).expect("as many as bodies have");
                let remainders = remainders.split_off_mut(..count).expect("as many as bodies have");
                body.points.tell(particles, remainders);
            }
            self.told = true;
        }
        &self.state
    }

    pub(super) fn advance(&mut self, steps: u64) -> AdvanceReport {
        let mut done = AdvanceReport::default();
        self.workplaces.for_all_threads();
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
        self.walls.drop_what_goes_at_start();
    }

    /// One time step: the stages of [`crate::engine::Backend`].
    fn one_step(&mut self, done: &mut AdvanceReport) {
        let belt_time = self.start_step.map(|start| (self.step - start) as f64 * self.params.dt_exact);
        self.walls.pose(belt_time, &self.state.frame);
        let stages = Arc::clone(&self.stages);
        let mut watch = stages.watch();
        if std::mem::take(&mut self.have_strayed) {
            self.draw_up_meetings();
        }
        watch.lap(Stage::Neighbours);
        let max_overlap = self.meet();
        let noticed = self.move_bodies();
        self.told = false;
        self.have_strayed = noticed.has_strayed;
        // Bodies that other threads have worked on are far away: not without need.
        if noticed.has_broken {
            for body in &self.bodies {
                let first = body.range().start;
                body.broken.iter().for_each(|&k| self.state.broken[first + k as usize] += 1);
                self.state.bonds_broken += body.broken.len() as u64;
            }
        }
        self.step += 1;
        done.steps += 1;
        done.particle_steps += self.state.particles.len() as u64;
        done.max_overlap_m = done.max_overlap_m.max(max_overlap).max(noticed.max_overlap);
        if noticed.runaway.is_some() {
            self.state();
            self.fault = Moved::runaway(noticed.runaway).fault(&self.params, &self.state);
        }
    }

    /// Finds the bodies that are near each other. Meetings that stay keep their pairs.
    fn draw_up_meetings(&mut self) {
        let reach = self.search.reach + MARGIN_RATIO * self.params.radius;
        let extents: Vec<Extent> = self.bodies.iter().map(|body| body.whereabouts.whole).collect();
        self.order = along_curve(&extents);
        let pairs = near_each_other(&extents, reach, &self.state.frame);
        let mut old = std::mem::take(&mut self.meetings).into_iter().peekable();
        for pair in pairs {
            while old.next_if(|meeting| meeting.bodies < pair).is_some() {}
            let known = old.next_if(|meeting| meeting.bodies == pair);
            self.meetings.push(known.unwrap_or_else(|| Meeting::new(pair)));
        }
        self.pairs.resize_with(self.bodies.len(), BodyPairs::default);
        self.pairs.iter_mut().for_each(|pairs| pairs.is_stale = true);
        for body in &mut self.bodies {
            body.meets.clear();
            body.drawn_up = body.motion;
        }
        for (m, Meeting { bodies: [first, second], .. }) in (0u32..).zip(&self.meetings) {
            self.bodies[*second as usize].meets.push([m, *first]);
        }
        let groups = self.meetings.chunk_by(|a, b| a.bodies[0] == b.bodies[0]);
        self.meeting_counts = groups.map(<[Meeting]>::len).collect();
        self.loads.clear();
        self.loads.resize(self.meetings.len(), 0..0);
    }

    /// The first phase. Every body meets itself at least, so meetings come in as many groups as there are bodies.
    fn meet(&mut self) -> f32 {
        let step = (self.step + 2) as u32;
        let Self { laws, search, state, bodies, meetings, loads, pairs, instructions, .. } = self;
        let Self { stages, workplaces, order, meeting_counts, .. } = self;
        let (mut meetings, mut loads) = (&mut meetings[..], &mut loads[..]);
        let groups = meeting_counts.iter().map(|&count| {
            let meetings = meetings.split_off_mut(..count).expect("as many as there are");
            (meetings, loads.split_off_mut(..count).expect("as many as meetings"))
        });
        let work = groups.zip(pairs).map(|((meetings, loads), pairs)| Contacts {
            meetings,
            loads,
            bodies,
            pairs,
            laws,
            frame: &state.frame,
            step,
        });
        let mut work = in_order(order, work);
        let some = at_once(work.len());
        let work = work.par_chunks_mut(some).with_max_len(1).map(|some| {
            let (room, _) = &mut *workplaces.of_this_thread();
            let meet = |contacts| instructions.run(Meet { contacts, search, room, stages });
            some.iter_mut().map(meet).fold(0.0, f32::max)
        });
        work.reduce(|| 0.0, f32::max)
    }

    /// The second phase.
    fn move_bodies(&mut self) -> Noticed {
        let Self {
            laws,
            mover,
            state,
            bodies,
            loads,
            pairs,
            walls,
            wall_skin,
            params,
            instructions,
            workplaces,
            order,
            ..
        } = self;
        let (stages, wall_laws) = (&*self.stages, &self.wall_laws[..]);
        let around = Surroundings {
            laws,
            mover,
            frame: &state.frame,
            walls,
            loads,
            pairs,
            margin: SAFE * 0.5 * f64::from(MARGIN_RATIO * params.radius),
            stages,
            wall_laws,
            radius: params.radius,
            wall_reach: params.radius + params.laws.adhesion_range(),
            wall_skin: *wall_skin,
        };
        let mut work = in_order(order, bodies.iter_mut().zip(&*pairs));
        let some = at_once(work.len());
        let work = work.par_chunks_mut(some).with_max_len(1).map(|some| {
            let (_, desk) = &mut *workplaces.of_this_thread();
            let mut noticed = Noticed::default();
            for k in 0..some.len() {
                let (done, next) = some.split_at_mut(k + 1);
                let (body, pairs) = &mut done[k];
                let next = next.first().map(|(body, pairs)| Next { body, pairs });
                noticed = noticed.and(instructions.run(Move { body, pairs, next, around: &around, desk }));
            }
            noticed
        });
        work.reduce(Noticed::default, Noticed::and)
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
