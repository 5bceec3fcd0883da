//! One step of a body: sum its loads, then move it.

use std::slice;

use crate::cpu::fast::broad_phase::wall_search::WallSearch;
use crate::cpu::fast::instructions::prefetch;
use crate::cpu::fast::instructions::prefetch::{PARTS, part, part_range};
use crate::cpu::fast::instructions::set::{LaneOps, SimdTask, run_outlined};
use crate::cpu::fast::narrow_phase::bonds::{self, ForcesWithMoments};
use crate::cpu::fast::narrow_phase::wall_contacts::WallScratch;
use crate::cpu::fast::storage::body::{Body, sqrt_equivalent_mass};
use crate::cpu::fast::storage::context::StepContext;
use crate::cpu::fast::storage::loads::LoadSums;
use crate::cpu::fast::storage::pairs::{BodyPairList, as_range};
use crate::cpu::fast::storage::particles::ParticleBlock;
use crate::cpu::stages::Stage;

/// Number of bond sets prefetched ahead of the current one.
const PREFETCH_SETS: usize = 4;

/// Scratch memory of one thread for the motion of a body.
#[derive(Debug, Default)]
pub(crate) struct MotionScratch {
    pub(crate) sums: LoadSums,
    pub(crate) wall_scratch: WallScratch,
    /// Sub-particles of the body, transposed.
    blocks: Vec<ParticleBlock>,
}

/// Statistics of the step of a body.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct BodyStats {
    pub(crate) max_overlap: f32,
    /// Whether a body has left its margin, so that the body pairs must be updated.
    pub(crate) left_margin: bool,
    /// Whether a bond has broken.
    pub(crate) has_broken: bool,
    /// First sub-particle of the run that is too fast, not finite or lost.
    pub(crate) runaway: Option<u32>,
    /// Surfaces that sub-particles have passed through.
    pub(crate) passed_through: u32,
}

impl BodyStats {
    pub(crate) fn merge(self, other: Self) -> Self {
        Self {
            max_overlap: self.max_overlap.max(other.max_overlap),
            left_margin: self.left_margin || other.left_margin,
            has_broken: self.has_broken || other.has_broken,
            runaway: self.runaway.into_iter().chain(other.runaway).min(),
            passed_through: self.passed_through + other.passed_through,
        }
    }
}

impl Body {
    /// One step of this body, after the contact phase of all bodies. `pairs` are those of which it is the
    /// first body.
    #[inline(always)]
    pub(crate) fn step<S: LaneOps>(
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
        let passed_through = self.add_walls(simd, context, scratch);
        timer.lap(Stage::Walls);
        let Self { points, motion, .. } = self;
        let MotionScratch { sums, blocks, .. } = scratch;
        let extremes =
            points.advance(simd, context.integrator, context.frame, self.mass, motion, blocks, sums);
        self.bounds.update(&self.points);
        self.max_speed = extremes.max_speed;
        self.travelled += f64::from(extremes.max_speed) * f64::from(context.laws.dt);
        timer.lap(Stage::Motion);
        let strayed = self.motion.since(&self.pairing_motion);
        BodyStats {
            max_overlap,
            left_margin: strayed > context.margin || strayed.is_nan(),
            has_broken: !self.broken.is_empty(),
            runaway: extremes.runaway.map(|k| self.range.start as u32 + k),
            passed_through,
        }
    }

    /// Adds the loads of bonds, two sets at a time, and calls `prefetch_next` with the number of a part in
    /// between. Returns the maximum overlap of pairs with a broken bond, in metres.
    #[inline(always)]
    fn add_bonds<S: LaneOps>(
        &mut self,
        simd: S,
        context: &StepContext<'_>,
        prefetch_next: impl Fn(usize),
        MotionScratch { sums, blocks, .. }: &mut MotionScratch,
    ) -> f32 {
        let StepContext { laws, frame, .. } = context;
        let Self { bonds: sets, moments, broken, mass, .. } = self;
        let sqrt_m_star = sqrt_equivalent_mass(*mass, *mass);
        broken.clear();
        let mut max_overlap = 0.0f32;
        for k in 0..sets.len() / 2 {
            prefetch::to_l1(sets.get(2 * k + PREFETCH_SETS..2 * k + PREFETCH_SETS + 2).unwrap_or(&[]));
            if k < PARTS {
                prefetch_next(k);
            }
            let [one, two] = &mut sets[2 * k..2 * k + 2] else { break };
            let overlap = if let Some([a, b]) = moments.get_mut(2 * k..2 * k + 2) {
                let (sets, moments) = ([one, two], [a, b]);
                run_outlined(
                    simd,
                    ForcesWithMoments { sets, moments, laws, sqrt_m_star, frame, blocks, sums, broken },
                )
            } else {
                bonds::forces([one, two], None, simd, laws, sqrt_m_star, frame, blocks, sums, broken)
            };
            max_overlap = max_overlap.max(overlap);
        }
        max_overlap
    }

    /// Adds the loads of pairs. `pairs` are those of which it is the first body.
    #[inline(always)]
    fn add_pairs<S: LaneOps>(
        &self,
        simd: S,
        context: &StepContext<'_>,
        pairs: &BodyPairList,
        MotionScratch { sums, .. }: &mut MotionScratch,
    ) {
        sums.add_to_firsts(simd, &pairs.loads);
        for &[m, first] in &self.pairs_as_second {
            let loads = &context.loads[m as usize];
            if !loads.is_empty() {
                sums.add_to_seconds(simd, &context.pairs[first as usize].loads, as_range(loads));
            }
        }
    }

    /// Adds the loads of facets. Returns how many surfaces were passed through.
    #[inline(always)]
    fn add_walls<S: LaneOps>(
        &mut self,
        simd: S,
        context: &StepContext<'_>,
        scratch: &mut MotionScratch,
    ) -> u32 {
        let Self { walls, motion, points, bounds: at, max_speed, .. } = self;
        let step_m = *max_speed * context.laws.dt + context.walls.step_travel_m();
        if walls.is_due(motion, context) {
            run_outlined(simd, WallSearch { walls, motion, context, points, at, step_m });
        }
        let travelled = self.travelled + context.walls.total_travel_m();
        self.walls.forces(
            simd,
            travelled,
            step_m,
            context,
            &self.points,
            self.mass,
            &mut scratch.sums,
            &mut scratch.wall_scratch,
        )
    }
}

/// The next body of the task.
pub(crate) struct NextBody<'a> {
    pub(crate) body: &'a Body,
    pub(crate) pairs: &'a BodyPairList,
}

impl NextBody<'_> {
    /// Prefetches the `k`th of [`PARTS`] parts of the data of its step.
    #[inline(always)]
    fn prefetch_part(&self, context: &StepContext<'_>, k: usize) {
        self.body.points.prefetch_part(k);
        self.body.bounds.prefetch_part(k);
        let BodyPairList { loads, self_loads, .. } = self.pairs;
        loads.prefetch(part_range(loads.slots.len(), k, PARTS));
        self_loads.prefetch(part_range(self_loads.count(), k, PARTS));
        // Loads left by other bodies: first their ranges, then the loads.
        const HALF: usize = PARTS / 2;
        for &[m, first] in part(&self.body.pairs_as_second, k % HALF, HALF) {
            let loads = &context.loads[m as usize];
            if k < HALF {
                prefetch::to_l2(slice::from_ref(loads));
            } else {
                context.pairs[first as usize].loads.prefetch(as_range(loads));
            }
        }
    }
}

/// The motion phase of a body.
pub(crate) struct MoveBody<'a> {
    pub(crate) body: &'a mut Body,
    pub(crate) pairs: &'a BodyPairList,
    pub(crate) next: Option<NextBody<'a>>,
    pub(crate) context: &'a StepContext<'a>,
    pub(crate) scratch: &'a mut MotionScratch,
}

impl SimdTask for MoveBody<'_> {
    type Output = BodyStats;

    #[inline(always)]
    fn run<S: LaneOps>(self, simd: S) -> BodyStats {
        self.body.step(simd, self.context, self.pairs, self.next, self.scratch)
    }
}
