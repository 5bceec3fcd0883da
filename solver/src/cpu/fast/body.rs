//! A body: its sub-particles, the bonds between them, the facets near it; and how it has moved.

use std::ops::Range;
use std::slice;

use super::bonds::{self, BondSet};
use super::bounds::BodyBounds;
use super::instructions::{LaneOps, SimdTask, run_outlined};
use super::laws::{LaneContactLaw, PairLaws};
use super::load::LoadSums;
use super::pairs::{BodyPairList, as_range, sort_key};
use super::points::{BodyMotion, BodyParticles, ParticleBlock, slot_of};
use super::prefetch::{self, PARTS, part, span};
use super::walls::{WallList, WallScratch, WallSearch};
use crate::cpu::integrate::Integrator;
use crate::cpu::stages::{Stage, StageTimers};
use crate::engine::frame::Frame;
use crate::walls::Walls;

/// Sets of bonds that are on their way from memory while others are worked on.
const PREFETCH_SETS: usize = 4;

/// √m* of two sub-particles of masses in kg, in kg^½.
pub(super) fn sqrt_equivalent_mass(mass: f32, other: f32) -> f32 {
    (mass * other / (mass + other)).sqrt()
}

#[derive(Debug)]
pub(super) struct Body {
    range: Range<usize>,
    pub(super) points: BodyParticles,
    /// Mass of each of its sub-particles, in kilograms.
    pub(super) mass: f32,
    pub(super) bonds: Vec<BondSet>,
    /// Pairs that were bonded at the start, by slots, sorted: as_range whose bond broke still stand among the bonds.
    bonded_pairs: Vec<[u32; 2]>,
    pub(super) walls: WallList,
    pub(super) motion: BodyMotion,
    /// Integral of the greatest speed, in metres.
    travelled: f64,
    /// Its box and as_range of its blocks, since its last move.
    pub(super) bounds: BodyBounds,
    /// Lower sub-particles of bonds that broke in the last step.
    pub(super) broken: Vec<u32>,
    /// The body_pairs of which it is the second body, each with the first, in their order.
    pub(super) second_in: Vec<[u32; 2]>,
    /// Where it was when it was last looked up which bodies meet.
    pub(super) pairing_motion: BodyMotion,
}

/// What is the same for all bodies in a step.
#[derive(Debug)]
pub(super) struct StepContext<'a> {
    pub(super) laws: &'a PairLaws,
    pub(super) integrator: &'a Integrator,
    pub(super) frame: &'a Frame,
    pub(super) walls: &'a Walls,
    /// What the pairs of body_pairs do, by the number of the first body.
    pub(super) pairs: &'a [BodyPairList],
    /// Of each meeting, where its loads stand among as_range of its first body.
    pub(super) loads: &'a [Range<u32>],
    /// How far a body may move before it must be looked up anew which bodies meet, in metres.
    pub(super) margin: f64,
    pub(super) stages: &'a StageTimers,
    /// Laws of surfaces, by their numbers.
    pub(super) wall_laws: &'a [LaneContactLaw],
    pub(super) radius: f32,
    /// Distance of a centre from a facet self_loads which a contact can hold, in metres.
    pub(super) wall_reach: f32,
    /// What wall lists cover beyond, in metres.
    pub(super) wall_skin: f32,
}

/// PairScratch to work in.
#[derive(Debug, Default)]
pub(super) struct MotionScratch {
    pub(super) sums: LoadSums,
    pub(super) wall_scratch: WallScratch,
    /// The body's sub-particles.
    blocks: Vec<ParticleBlock>,
}

/// What a body has stats in a step.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct BodyStats {
    pub(super) max_overlap: f32,
    /// Whether one has moved so far that others may meet.
    pub(super) left_margin: bool,
    /// Whether a bond has broken.
    pub(super) has_broken: bool,
    /// The first sub-particle that is too fast, not a number or lost, counted in the run.
    pub(super) runaway: Option<u32>,
}

impl BodyStats {
    pub(super) fn merge(self, other: Self) -> Self {
        Self {
            max_overlap: self.max_overlap.max(other.max_overlap),
            left_margin: self.left_margin || other.left_margin,
            has_broken: self.has_broken || other.has_broken,
            runaway: self.runaway.into_iter().chain(other.runaway).min(),
        }
    }
}

/// Pairs of sub-particles by their slots, the lower first, sorted.
fn slot_pairs(pairs: impl Iterator<Item = [u32; 2]>) -> Vec<[u32; 2]> {
    let sorted = |[i, j]: [u32; 2]| [i.min(j), i.max(j)];
    let mut placed: Vec<_> = pairs.map(|pair| sorted(pair.map(slot_of))).collect();
    placed.sort_unstable();
    placed
}

impl Body {
    pub(super) fn new(
        range: Range<usize>,
        points: BodyParticles,
        mass: f32,
        bonds: Vec<BondSet>,
        bonded_pairs: impl Iterator<Item = [u32; 2]>,
    ) -> Self {
        let bonded_pairs = slot_pairs(bonded_pairs);
        Self {
            range,
            bounds: BodyBounds::of(&points),
            points,
            mass,
            bonds,
            bonded_pairs,
            walls: WallList::default(),
            motion: BodyMotion::default(),
            travelled: 0.0,
            broken: Vec::new(),
            second_in: Vec::new(),
            pairing_motion: BodyMotion::default(),
        }
    }

    /// Its sub-particles in the state.
    pub(super) fn range(&self) -> Range<usize> {
        self.range.clone()
    }

    /// Takes pairs out that were bonded at the start: both sorted, by slots.
    pub(super) fn exclude_bonded(&self, pairs: &mut Vec<[u32; 2]>) {
        let bonded_pairs = &self.bonded_pairs;
        let (mut kept, mut next) = (0, 0);
        for k in 0..pairs.len() {
            let pair = pairs[k];
            // Nearly all are found, so that hardly any is passed over.
            while next < bonded_pairs.len() && sort_key(bonded_pairs[next]) < sort_key(pair) {
                next += 1;
            }
            let is_joined = next < bonded_pairs.len() && bonded_pairs[next] == pair;
            next += usize::from(is_joined);
            pairs[kept] = pair;
            kept += usize::from(!is_joined);
        }
        pairs.truncate(kept);
    }

    /// One step of this body, once all body_pairs have worked out their loads; `pairs` are as_range of which it is the first.
    #[inline(always)]
    pub(super) fn step<S: LaneOps>(
        &mut self,
        simd: S,
        context: &StepContext<'_>,
        pairs: &BodyPairList,
        next: Option<NextBody<'_>>,
        scratch: &mut MotionScratch,
    ) -> BodyStats {
        let mut timer = context.stages.timer();
        prefetch::to_l1(&self.bonds[..PREFETCH_SETS.min(self.bonds.len())]);
        scratch.sums.begin(self.points.blocks(), &pairs.self_loads);
        self.points.load_blocks(simd, &mut scratch.blocks);
        timer.lap(Stage::Motion);
        let prefetch_next = |k: usize| next.iter().for_each(|next| next.prefetch_part(context, k));
        let max_overlap = self.add_bonds(simd, context, prefetch_next, scratch);
        timer.lap(Stage::Bonds);
        (self.bonds.len() / 2..PARTS).for_each(prefetch_next);
        self.add_pairs(simd, context, pairs, scratch);
        timer.lap(Stage::Sums);
        self.add_walls(simd, context, scratch);
        timer.lap(Stage::Walls);
        let Self { points, motion, .. } = self;
        let MotionScratch { sums, blocks, .. } = scratch;
        let moved = points.advance(simd, context.integrator, context.frame, self.mass, motion, blocks, sums);
        self.bounds.update(&self.points);
        self.travelled += f64::from(moved.fastest) * f64::from(context.laws.dt);
        timer.lap(Stage::Motion);
        let strayed = self.motion.since(&self.pairing_motion);
        BodyStats {
            max_overlap,
            left_margin: strayed > context.margin || strayed.is_nan(),
            has_broken: !self.broken.is_empty(),
            runaway: moved.runaway.map(|k| self.range.start as u32 + k),
        }
    }

    /// Adds what bonds do, two sets at a time, and meanwhile calls `prefetch_next` with the number of a part. Returns the greatest overlap where
    /// a bond has broken, in metres.
    #[inline(always)]
    fn add_bonds<S: LaneOps>(
        &mut self,
        simd: S,
        context: &StepContext<'_>,
        prefetch_next: impl Fn(usize),
        MotionScratch { sums, blocks, .. }: &mut MotionScratch,
    ) -> f32 {
        let StepContext { laws, frame, .. } = context;
        let Self { bonds: sets, broken, mass, .. } = self;
        let sqrt_m_star = sqrt_equivalent_mass(*mass, *mass);
        broken.clear();
        let mut max_overlap = 0.0f32;
        for k in 0..sets.len() / 2 {
            prefetch::to_l1(sets.get(2 * k + PREFETCH_SETS..2 * k + PREFETCH_SETS + 2).unwrap_or(&[]));
            if k < PARTS {
                prefetch_next(k);
            }
            let [one, two] = &mut sets[2 * k..2 * k + 2] else { break };
            let overlap = bonds::forces([one, two], simd, laws, sqrt_m_star, frame, blocks, sums, broken);
            max_overlap = max_overlap.max(overlap);
        }
        max_overlap
    }

    /// Adds what pairs do: `pairs` are as_range of which it is the first body.
    #[inline(always)]
    fn add_pairs<S: LaneOps>(
        &self,
        simd: S,
        context: &StepContext<'_>,
        pairs: &BodyPairList,
        MotionScratch { sums, .. }: &mut MotionScratch,
    ) {
        sums.add_to_firsts(simd, &pairs.loads);
        for &[m, first] in &self.second_in {
            let loads = &context.loads[m as usize];
            if !loads.is_empty() {
                sums.add_to_seconds(simd, &context.pairs[first as usize].loads, as_range(loads));
            }
        }
    }

    #[inline(always)]
    fn add_walls<S: LaneOps>(&mut self, simd: S, context: &StepContext<'_>, scratch: &mut MotionScratch) {
        let Self { walls, motion, points, bounds: at, .. } = self;
        if walls.is_due(motion, context) {
            run_outlined(simd, WallSearch { walls, motion, context, points, at });
        }
        let travelled = self.travelled + context.walls.total_travel_m();
        self.walls.forces(simd, travelled, context, &self.points, self.mass, scratch);
    }

    /// Renumbers after sub-particles were taken out.
    pub(super) fn renumber(&mut self, range: Range<usize>, points: BodyParticles, locals: &[u32]) {
        self.range = range;
        self.points = points;
        self.bounds.update(&self.points);
        let map = |k: u32| locals[k as usize];
        let bonded_pairs = self.bonded_pairs.iter().map(|pair| pair.map(|slot| map(slot_of(slot))));
        self.bonded_pairs = slot_pairs(bonded_pairs.filter(|pair| !pair.contains(&u32::MAX)));
        self.bonds = BondSet::renumbered(&self.bonds, map);
        self.walls.renumber(locals);
    }

    /// Moves on in the state, as it is.
    pub(super) fn set_range(&mut self, range: Range<usize>) {
        self.range = range;
    }
}

/// The body that comes after.
pub(super) struct NextBody<'a> {
    pub(super) body: &'a Body,
    pub(super) pairs: &'a BodyPairList,
}

impl NextBody<'_> {
    /// Fetches the `k`th of [`PARTS`] parts from memory of what its step will want.
    #[inline(always)]
    fn prefetch_part(&self, context: &StepContext<'_>, k: usize) {
        self.body.points.prefetch_part(k);
        self.body.bounds.prefetch_part(k);
        let BodyPairList { loads, self_loads, .. } = self.pairs;
        loads.prefetch(span(loads.slots.len(), k, PARTS));
        self_loads.prefetch(span(self_loads.count(), k, PARTS));
        // What others have left for it: first where that stands.
        const HALF: usize = PARTS / 2;
        for &[m, first] in part(&self.body.second_in, k % HALF, HALF) {
            let loads = &context.loads[m as usize];
            if k < HALF {
                prefetch::to_l2(slice::from_ref(loads));
            } else {
                context.pairs[first as usize].loads.prefetch(as_range(loads));
            }
        }
    }
}

/// A body's part of the second phase.
pub(super) struct MoveBody<'a> {
    pub(super) body: &'a mut Body,
    pub(super) pairs: &'a BodyPairList,
    pub(super) next: Option<NextBody<'a>>,
    pub(super) context: &'a StepContext<'a>,
    pub(super) scratch: &'a mut MotionScratch,
}

impl SimdTask for MoveBody<'_> {
    type Output = BodyStats;

    #[inline(always)]
    fn run<S: LaneOps>(self, simd: S) -> BodyStats {
        self.body.step(simd, self.context, self.pairs, self.next, self.scratch)
    }
}
