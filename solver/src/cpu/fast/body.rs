//! A body: its sub-particles, the bonds between them, the facets near it; and how it has moved.

use std::ops::Range;
use std::slice;

use super::bonds::{self, BondSet};
use super::fetch::{self, PARTS, part, span};
use super::instructions::{Job, Wide, by_itself};
use super::laws::{LaneContact, PairLaws};
use super::load::Sums;
use super::pairs::{BodyPairs, number, those};
use super::points::{Block, Motion, Points, place_of};
use super::walls::{LookUp, Met, NearWalls};
use super::whereabouts::Whereabouts;
use crate::cpu::integrate::Mover;
use crate::cpu::stages::{Stage, Stages};
use crate::cpu::walls::Walls;
use crate::engine::frame::Frame;

/// Sets of bonds that are on their way from memory while others are worked on.
const AHEAD: usize = 4;

/// √m* of two sub-particles of masses in kg, in kg^½.
pub(super) fn root_of_equivalent(mass: f32, other: f32) -> f32 {
    (mass * other / (mass + other)).sqrt()
}

#[derive(Debug)]
pub(super) struct Body {
    range: Range<usize>,
    pub(super) points: Points,
    /// Mass of each of its sub-particles, in kilograms.
    pub(super) mass: f32,
    pub(super) bonds: Vec<BondSet>,
    /// Pairs that were bonded at the start, by places, sorted: those whose bond broke still stand among the bonds.
    joined: Vec<[u32; 2]>,
    pub(super) walls: NearWalls,
    pub(super) motion: Motion,
    /// Integral of the greatest speed, in metres.
    travelled: f64,
    /// Its box and those of its blocks, since its last move.
    pub(super) whereabouts: Whereabouts,
    /// Lower sub-particles of bonds that broke in the last step.
    pub(super) broken: Vec<u32>,
    /// The meetings of which it is the second body, each with the first, in their order.
    pub(super) meets: Vec<[u32; 2]>,
    /// Where it was when it was last looked up which bodies meet.
    pub(super) drawn_up: Motion,
}

/// What is the same for all bodies in a step.
#[derive(Debug)]
pub(super) struct Surroundings<'a> {
    pub(super) laws: &'a PairLaws,
    pub(super) mover: &'a Mover,
    pub(super) frame: &'a Frame,
    pub(super) walls: &'a Walls,
    /// What the pairs of meetings do, by the number of the first body.
    pub(super) pairs: &'a [BodyPairs],
    /// Of each meeting, where its loads stand among those of its first body.
    pub(super) loads: &'a [Range<u32>],
    /// How far a body may move before it must be looked up anew which bodies meet, in metres.
    pub(super) margin: f64,
    pub(super) stages: &'a Stages,
    /// Laws of surfaces, by their numbers.
    pub(super) wall_laws: &'a [LaneContact],
    pub(super) radius: f32,
    /// Distance of a centre from a facet within which a contact can hold, in metres.
    pub(super) wall_reach: f32,
    /// What wall lists cover beyond, in metres.
    pub(super) wall_skin: f32,
}

/// Room to work in.
#[derive(Debug, Default)]
pub(super) struct Desk {
    pub(super) sums: Sums,
    pub(super) met: Met,
    /// The body's sub-particles.
    blocks: Vec<Block>,
}

/// What a body has noticed in a step.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Noticed {
    pub(super) max_overlap: f32,
    /// Whether one has moved so far that others may meet.
    pub(super) has_strayed: bool,
    /// Whether a bond has broken.
    pub(super) has_broken: bool,
    /// The first sub-particle that is too fast, not a number or lost, counted in the run.
    pub(super) runaway: Option<u32>,
}

impl Noticed {
    pub(super) fn and(self, other: Self) -> Self {
        Self {
            max_overlap: self.max_overlap.max(other.max_overlap),
            has_strayed: self.has_strayed || other.has_strayed,
            has_broken: self.has_broken || other.has_broken,
            runaway: self.runaway.into_iter().chain(other.runaway).min(),
        }
    }
}

/// Pairs of sub-particles by their places, the lower first, sorted.
fn placed(pairs: impl Iterator<Item = [u32; 2]>) -> Vec<[u32; 2]> {
    let sorted = |[i, j]: [u32; 2]| [i.min(j), i.max(j)];
    let mut placed: Vec<_> = pairs.map(|pair| sorted(pair.map(place_of))).collect();
    placed.sort_unstable();
    placed
}

impl Body {
    pub(super) fn new(
        range: Range<usize>,
        points: Points,
        mass: f32,
        bonds: Vec<BondSet>,
        joined: impl Iterator<Item = [u32; 2]>,
    ) -> Self {
        let joined = placed(joined);
        Self {
            range,
            whereabouts: Whereabouts::of(&points),
            points,
            mass,
            bonds,
            joined,
            walls: NearWalls::default(),
            motion: Motion::default(),
            travelled: 0.0,
            broken: Vec::new(),
            meets: Vec::new(),
            drawn_up: Motion::default(),
        }
    }

    /// Its sub-particles in the state.
    pub(super) fn range(&self) -> Range<usize> {
        self.range.clone()
    }

    /// Takes pairs out that were bonded at the start: both sorted, by places.
    pub(super) fn leave_out_joined(&self, pairs: &mut Vec<[u32; 2]>) {
        let joined = &self.joined;
        let (mut kept, mut next) = (0, 0);
        for k in 0..pairs.len() {
            let pair = pairs[k];
            // Nearly all are found, so that hardly any is passed over.
            while next < joined.len() && number(joined[next]) < number(pair) {
                next += 1;
            }
            let is_joined = next < joined.len() && joined[next] == pair;
            next += usize::from(is_joined);
            pairs[kept] = pair;
            kept += usize::from(!is_joined);
        }
        pairs.truncate(kept);
    }

    /// One step of this body, once all meetings have worked out their loads; `pairs` are those of which it is the first.
    #[inline(always)]
    pub(super) fn step<S: Wide>(
        &mut self,
        simd: S,
        around: &Surroundings<'_>,
        pairs: &BodyPairs,
        next: Option<Next<'_>>,
        desk: &mut Desk,
    ) -> Noticed {
        let mut watch = around.stages.watch();
        fetch::soon(&self.bonds[..AHEAD.min(self.bonds.len())]);
        desk.sums.begin(self.points.blocks(), &pairs.within);
        self.points.set_out(simd, &mut desk.blocks);
        watch.lap(Stage::Motion);
        let fetch_next = |k: usize| next.iter().for_each(|next| next.fetch_part(around, k));
        let max_overlap = self.add_bonds(simd, around, fetch_next, desk);
        watch.lap(Stage::Bonds);
        (self.bonds.len() / 2..PARTS).for_each(fetch_next);
        self.add_pairs(simd, around, pairs, desk);
        watch.lap(Stage::Sums);
        self.add_walls(simd, around, desk);
        watch.lap(Stage::Walls);
        let Self { points, motion, .. } = self;
        let Desk { sums, blocks, .. } = desk;
        let moved = points.advance(simd, around.mover, around.frame, self.mass, motion, blocks, sums);
        self.whereabouts.update(&self.points);
        self.travelled += f64::from(moved.fastest) * f64::from(around.laws.dt);
        watch.lap(Stage::Motion);
        let strayed = self.motion.since(&self.drawn_up);
        Noticed {
            max_overlap,
            has_strayed: strayed > around.margin || strayed.is_nan(),
            has_broken: !self.broken.is_empty(),
            runaway: moved.runaway.map(|k| self.range.start as u32 + k),
        }
    }

    /// Adds what bonds do, two sets at a time, and meanwhile calls `fetch_next` with the number of a part. Returns the greatest overlap where
    /// a bond has broken, in metres.
    #[inline(always)]
    fn add_bonds<S: Wide>(
        &mut self,
        simd: S,
        around: &Surroundings<'_>,
        fetch_next: impl Fn(usize),
        Desk { sums, blocks, .. }: &mut Desk,
    ) -> f32 {
        let Surroundings { laws, frame, .. } = around;
        let Self { bonds: sets, broken, mass, .. } = self;
        let root_mass = root_of_equivalent(*mass, *mass);
        broken.clear();
        let mut deepest = 0.0f32;
        for k in 0..sets.len() / 2 {
            fetch::soon(sets.get(2 * k + AHEAD..2 * k + AHEAD + 2).unwrap_or(&[]));
            if k < PARTS {
                fetch_next(k);
            }
            let [one, two] = &mut sets[2 * k..2 * k + 2] else { break };
            let overlap = bonds::forces([one, two], simd, laws, root_mass, frame, blocks, sums, broken);
            deepest = deepest.max(overlap);
        }
        deepest
    }

    /// Adds what pairs do: `pairs` are those of which it is the first body.
    #[inline(always)]
    fn add_pairs<S: Wide>(
        &self,
        simd: S,
        around: &Surroundings<'_>,
        pairs: &BodyPairs,
        Desk { sums, .. }: &mut Desk,
    ) {
        sums.add_to_firsts(simd, &pairs.loads);
        for &[m, first] in &self.meets {
            let loads = &around.loads[m as usize];
            if !loads.is_empty() {
                sums.add_to_seconds(simd, &around.pairs[first as usize].loads, those(loads));
            }
        }
    }

    #[inline(always)]
    fn add_walls<S: Wide>(&mut self, simd: S, around: &Surroundings<'_>, desk: &mut Desk) {
        let Self { walls, motion, points, whereabouts: at, .. } = self;
        if walls.is_due(motion, around) {
            by_itself(simd, LookUp { walls, motion, around, points, at });
        }
        let travelled = self.travelled + around.walls.moved_in_all_m();
        self.walls.forces(simd, travelled, around, &self.points, self.mass, desk);
    }

    /// Renumbers after sub-particles were taken out.
    pub(super) fn renumber(&mut self, range: Range<usize>, points: Points, locals: &[u32]) {
        self.range = range;
        self.points = points;
        self.whereabouts.update(&self.points);
        let map = |k: u32| locals[k as usize];
        let joined = self.joined.iter().map(|pair| pair.map(|place| map(place_of(place))));
        self.joined = placed(joined.filter(|pair| !pair.contains(&u32::MAX)));
        self.bonds = BondSet::renumbered(&self.bonds, map);
        self.walls.renumber(locals);
    }

    /// Moves on in the state, as it is.
    pub(super) fn place(&mut self, range: Range<usize>) {
        self.range = range;
    }
}

/// The body that comes after.
pub(super) struct Next<'a> {
    pub(super) body: &'a Body,
    pub(super) pairs: &'a BodyPairs,
}

impl Next<'_> {
    /// Fetches the `k`th of [`PARTS`] parts from memory of what its step will want.
    #[inline(always)]
    fn fetch_part(&self, around: &Surroundings<'_>, k: usize) {
        self.body.points.fetch_part(k);
        self.body.whereabouts.fetch_part(k);
        let BodyPairs { loads, within, .. } = self.pairs;
        loads.fetch(span(loads.places.len(), k, PARTS));
        within.fetch(span(within.count(), k, PARTS));
        // What others have left for it: first where that stands.
        const HALF: usize = PARTS / 2;
        for &[m, first] in part(&self.body.meets, k % HALF, HALF) {
            let loads = &around.loads[m as usize];
            if k < HALF {
                fetch::later(slice::from_ref(loads));
            } else {
                around.pairs[first as usize].loads.fetch(those(loads));
            }
        }
    }
}

/// A body's part of the second phase.
pub(super) struct Move<'a> {
    pub(super) body: &'a mut Body,
    pub(super) pairs: &'a BodyPairs,
    pub(super) next: Option<Next<'a>>,
    pub(super) around: &'a Surroundings<'a>,
    pub(super) desk: &'a mut Desk,
}

impl Job for Move<'_> {
    type Output = Noticed;

    #[inline(always)]
    fn run<S: Wide>(self, simd: S) -> Noticed {
        self.body.step(simd, self.around, self.pairs, self.next, self.desk)
    }
}
