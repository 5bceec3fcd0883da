//! The contact phase of a body: renew its neighbour lists, then evaluate the contacts of its close pairs.

use super::batch::{BATCH_SIZE, FillBatch, PairBatch};
use super::kernels;
use crate::cpu::fast::broad_phase::distances::{pair_offsets, select_close};
use crate::cpu::fast::broad_phase::pair_lists::{BodyContacts, SearchScratch};
use crate::cpu::fast::broad_phase::pair_search::SearchParams;
use crate::cpu::fast::instructions::arrays::grown;
use crate::cpu::fast::instructions::set::{LaneOps, SimdTask, run_outlined};
use crate::cpu::fast::storage::body::sqrt_equivalent_mass;
use crate::cpu::fast::storage::loads::{AddToBoth, LoadArray, LoadList};
use crate::cpu::fast::storage::pair_lanes::PairLoads;
use crate::cpu::fast::storage::pairs::BodyPairList;
use crate::cpu::stages::{Stage, StageTimers};

/// Relative margin of the selection of close pairs. The kernel rounds differently and decides within it.
const ROUNDING: f32 = 1e-5;

/// Scratch memory of one thread for the contacts of a body.
#[derive(Debug, Default)]
pub(crate) struct PairScratch {
    pub(crate) search: SearchScratch,
    /// One batch fills while the other is evaluated. A wide load soon after narrow stores to the same memory
    /// would stall.
    batches: [PairBatch; 2],
    /// Loads of pairs that are summed at once.
    loads: LoadList,
}

impl BodyContacts<'_> {
    /// Evaluates the loads of all close pairs. Returns the maximum overlap, in metres.
    #[inline(always)]
    pub(crate) fn forces<S: LaneOps>(&mut self, simd: S, scratch: &mut PairScratch) -> f32 {
        let PairScratch { batches, loads: summed, search: SearchScratch { distances, .. } } = scratch;
        let [mut batch, mut full] = batches.each_mut();
        let BodyPairList { list, loads, self_loads, .. } = &mut *self.pairs;
        let mine = &self.bodies[self.body_pairs[0].bodies[0] as usize];
        loads.clear();
        self_loads.clear();
        let offsets = grown(&mut distances.offsets, list.len());
        // Most body pairs have no pairs.
        for body_pair in self.body_pairs.iter().filter(|it| !it.pairs.is_empty()) {
            let ([_, other], pairs) = (body_pair.bodies, body_pair.pairs());
            let sides = [&mine.points, &self.bodies[other as usize].points];
            pair_offsets(&list.slots[pairs.clone()], sides, self.frame, &mut offsets[pairs]);
        }
        // Within a body, where the distance of contact may be less, the kernel decides.
        let reach = self.laws.body_contact.hold_distance();
        let mut close =
            select_close(simd, offsets, reach * (1.0 + ROUNDING) / self.frame.unit_m, &mut distances.close);
        let (mut max_overlap, mut done) = (0.0f32, 0);
        for m in 0..self.body_pairs.len() {
            let body_pair = &self.body_pairs[m];
            if body_pair.pairs.is_empty() {
                // Write only changes: cache lines are shared with other threads.
                if self.loads[m] != (0..0) {
                    self.loads[m] = 0..0;
                }
                continue;
            }
            let count = close.partition_point(|&pair| pair < body_pair.pairs.end);
            // Single spheres in a group have several contacts each, so their loads are summed at once. A
            // fillet has hardly any with itself. The decision must not depend on the current number of
            // contacts, which depends on unrelated spheres.
            let is_self = body_pair.bodies[0] == body_pair.bodies[1];
            let is_summed = is_self && mine.bonds.is_empty();
            let is_within = is_self && !mine.is_group;
            if is_summed {
                self.pairs.self_loads.begin(mine.points.positions.len(), &LoadArray::default());
            }
            let kept = if is_summed { 0 } else { count as u32 };
            self.loads[m] = done..done + kept;
            done += kept;
            let theirs = &self.bodies[body_pair.bodies[1] as usize];
            let (sides, sqrt_m_star) =
                ([&mine.points, &theirs.points], sqrt_equivalent_mass(mine.mass, theirs.mass));
            let mut these;
            (these, close) = close.split_at(count);
            while !these.is_empty() {
                let list = &self.pairs.list;
                // Outlined: inlined together with the kernels the compiler would run out of registers.
                let taken =
                    run_outlined(simd, FillBatch { batch, close: these, list, offsets, sides, sqrt_m_star });
                these = &these[taken..];
                if batch.pairs.len() == BATCH_SIZE {
                    let summed = is_summed.then_some(&mut *summed);
                    let evaluate = EvaluateBatch { contacts: self, batch: full, summed, is_within };
                    max_overlap = max_overlap.max(run_outlined(simd, evaluate));
                    std::mem::swap(&mut batch, &mut full);
                }
            }
            // A batch has one law.
            let ends_batch = is_within && self.laws.differ();
            if is_summed || ends_batch {
                for batch in [&mut *full, &mut *batch] {
                    let summed = is_summed.then_some(&mut *summed);
                    let evaluate = EvaluateBatch { contacts: self, batch, summed, is_within };
                    max_overlap = max_overlap.max(run_outlined(simd, evaluate));
                }
            }
            if ends_batch {
                self.pairs.loads.drop_padding();
            }
            if is_summed {
                run_outlined(simd, AddToBoth { sums: &mut self.pairs.self_loads, loads: summed });
                summed.clear();
            }
        }
        for batch in [full, batch] {
            let evaluate = EvaluateBatch { contacts: self, batch, summed: None, is_within: false };
            max_overlap = max_overlap.max(run_outlined(simd, evaluate));
        }
        max_overlap
    }
}

/// The contact phase of a body.
pub(crate) struct ContactPhase<'a, 'b> {
    pub(crate) contacts: &'a mut BodyContacts<'b>,
    pub(crate) search: &'a SearchParams,
    pub(crate) scratch: &'a mut PairScratch,
    pub(crate) stages: &'a StageTimers,
}

impl SimdTask for ContactPhase<'_, '_> {
    type Output = f32;

    #[inline(always)]
    fn run<S: LaneOps>(self, simd: S) -> f32 {
        let mut timer = self.stages.timer();
        self.contacts.search(simd, self.search, &mut self.scratch.search);
        timer.lap(Stage::Search);
        let max_overlap = self.contacts.forces(simd, self.scratch);
        timer.lap(Stage::Contacts);
        max_overlap
    }
}

/// Evaluates a batch and appends its loads in order. Returns the maximum overlap, in metres.
struct EvaluateBatch<'a, 'b> {
    contacts: &'a mut BodyContacts<'b>,
    batch: &'a mut PairBatch,
    /// Buffer for loads within a group, if these are summed at once.
    summed: Option<&'a mut LoadList>,
    /// Whether the pairs are of one body of the scene.
    is_within: bool,
}

impl SimdTask for EvaluateBatch<'_, '_> {
    type Output = f32;

    #[inline(always)]
    fn run<S: LaneOps>(self, simd: S) -> f32 {
        let Self { contacts: BodyContacts { pairs, laws, frame, step, .. }, batch, summed, is_within } = self;
        let BodyPairList { list, loads, self_loads, .. } = &mut **pairs;
        if batch.pairs.is_empty() {
            return 0.0;
        }
        let mut pair_loads = [PairLoads::ZERO; 2];
        let mut lanes = batch.lanes(simd, frame, *step);
        let law = if is_within { &laws.contact } else { &laws.body_contact };
        let max_overlap = kernels::contacts(simd, law, laws.dt, &mut lanes, &mut pair_loads);
        let LoadList { loads, slots } = match summed {
            None => loads,
            Some(summed) => {
                // Loads of the previous batch, which are in memory by now.
                run_outlined(simd, AddToBoth { sums: self_loads, loads: summed });
                summed.clear();
                summed
            }
        };
        loads.push(simd, &pair_loads[0]);
        loads.push(simd, &pair_loads[1]);
        let histories =
            [lanes.histories[0].to_stored(simd, *step).0, lanes.histories[1].to_stored(simd, *step).0];
        list.store_histories(&batch.pairs, histories.as_flattened(), slots);
        batch.pairs.clear();
        max_overlap
    }
}
