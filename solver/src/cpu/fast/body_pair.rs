//! SearchSides bodies that are near each other: which of their sub-particles may touch, and the contacts between them.
//!
//! A pair of sub-particles stands here once, with its memory. A body works out its body_pairs with itself and with as_range after
//! it: what acts on its own sub-particles and on the others' stays here until they add it up. Among single spheres that go together it
//! is summed up at once.
//! The pairs are listed afresh when the two bodies may have moved against each other by the skin, whatever the others do: fillets that
//! fall together keep theirs. They are sifted out of candidates, which a search among all sub-particles finds and which last several
//! times as long: so skins can be thin, and lists short.

use std::ops::Range;

use glam::DVec3;

use super::body::{Body, sqrt_equivalent_mass};
use super::instructions::{LaneOps, SimdTask, run_outlined};
use super::kernel::{self, PairLoads};
use super::laws::PairLaws;
use super::load::{AddToBoth, BATCH_SIZE, FillBatch, LoadArray, PairBatch};
use super::memory::grown;
use super::pairs::{self, BodyPairList, LoadList, PairList};
use super::points::{BodyMotion, slot_of};
use super::prefetch;
use super::search::{PairSearch, SearchParams};
use crate::cpu::stages::{Stage, StageTimers};
use crate::engine::frame::Frame;

/// Share of a margin that may be used up: the rest covers rounding.
pub(super) const SAFETY_FACTOR: f64 = 0.99;

/// Pairs that are further offsets than they touch by less than this share are left to the kernel, which rounds otherwise.
const ROUNDING: f32 = 1e-5;

/// SearchSides bodies, or one and itself.
#[derive(Debug)]
#[repr(align(64))]
pub(super) struct BodyPair {
    /// Indices of the bodies, a ≤ b.
    pub(super) bodies: [u32; 2],
    /// Where its pairs stand in the list of the first body, sorted.
    pairs: Range<u32>,
    /// For how long the pairs are good.
    skin_budget: SkinBudget,
    candidates: Box<Candidates>,
}

// There are a dozen times as many as bodies, and all are asked in every step whether they are due: a line of the cache each.
const _: () = assert!(size_of::<BodyPair>() == 64);

/// Pairs that may be listed before the next search for such, and for how long they are good.
#[derive(Debug)]
struct Candidates {
    pairs: Vec<[u32; 2]>,
    skin_budget: SkinBudget,
}

/// How two bodies may move against each other before something must be looked up again.
#[derive(Clone, Copy, Debug)]
struct SkinBudget {
    /// Where they were against each other when it was looked up, in metres.
    separation: DVec3,
    path: f64,
    /// How far they may move from there, in metres.
    allowed: f64,
}

impl SkinBudget {
    /// None.
    const NONE: Self = Self { separation: DVec3::ZERO, path: 0.0, allowed: f64::NEG_INFINITY };

    /// That of bodies that have moved so far, by a margin in metres.
    fn new([a, b]: [&BodyMotion; 2], margin: f32) -> Self {
        Self {
            separation: b.shift - a.shift,
            path: a.path + b.path,
            allowed: SAFETY_FACTOR * f64::from(margin),
        }
    }

    fn is_exhausted(&self, [a, b]: [&BodyMotion; 2]) -> bool {
        let left = self.allowed - (a.path + b.path - self.path);
        // What is not a number is not safe.
        !(left >= 0.0 && (b.shift - a.shift).distance_squared(self.separation) <= left * left)
    }
}

/// PairScratch to work in.
#[derive(Debug, Default)]
pub(super) struct PairScratch {
    pair_search: PairSearch,
    /// One is filled while the other waits: what was written in small connected_components cannot be read at once in large ones.
    batches: [PairBatch; 2],
    /// What pairs do that is summed up at once.
    loads: LoadList,
    /// A list to be written.
    spare: PairList,
    /// Which body_pairs must pair_offsets up their pairs.
    due: Vec<bool>,
    distances: DistanceScratch,
}

/// PairScratch to pair_offsets at pairs: at their distances, from the first to the second, and at which of them are close.
#[derive(Debug, Default)]
struct DistanceScratch {
    offsets: Vec<[i32; 4]>,
    close: Vec<u32>,
}

impl BodyPair {
    pub(super) fn new(bodies: [u32; 2]) -> Self {
        let candidates = Box::new(Candidates { pairs: Vec::new(), skin_budget: SkinBudget::NONE });
        Self { bodies, pairs: 0..0, skin_budget: SkinBudget::NONE, candidates }
    }

    /// Where its pairs stand in the list of the first body.
    fn pairs(&self) -> Range<usize> {
        pairs::as_range(&self.pairs)
    }

    /// Whether its pairs must be looked up.
    pub(super) fn is_due(&self, bodies: &[Body]) -> bool {
        self.skin_budget.is_exhausted(self.bodies.map(|body| &bodies[body as usize].motion))
    }

    /// DistanceScratch up the pairs that may touch: numbers of candidates.
    #[inline(always)]
    fn search<'a, S: LaneOps>(
        &mut self,
        simd: S,
        search: &SearchParams,
        frame: &Frame,
        [a, b]: [&Body; 2],
        pair_search: &mut PairSearch,
        DistanceScratch { offsets, close }: &'a mut DistanceScratch,
    ) -> &'a [u32] {
        let is_self = self.bodies[0] == self.bodies[1];
        let skin = search.skins[usize::from(is_self)];
        let motions = [&a.motion, &b.motion];
        let Self { skin_budget, candidates, .. } = self;
        if candidates.skin_budget.is_exhausted(motions) {
            let gap = pair_search.search(simd, search, frame, [a, b], is_self);
            let outer_skin = search.outer_skins[usize::from(is_self)];
            // Bodies without a pair may come nearer by what is between them; candidates must do for a list made at the last moment.
            let margin = match &pair_search.found[..] {
                [] => outer_skin.max(gap - search.reach),
                _ => outer_skin - skin,
            };
            candidates.skin_budget = SkinBudget::new(motions, margin);
            candidates.pairs.clone_from(&pair_search.found);
        }
        if candidates.pairs.is_empty() {
            *skin_budget = candidates.skin_budget;
            return &[];
        }
        *skin_budget = SkinBudget::new(motions, skin);
        let offsets = grown(offsets, candidates.pairs.len());
        pairs::pair_offsets(&candidates.pairs, [&a.points, &b.points], frame, offsets);
        pairs::select_close(simd, offsets, (search.reach + skin) / frame.unit_m, close)
    }

    /// Goes on where some sub-particles of its bodies were taken out: as_range that stay have other numbers, and are searched anew. Its pairs go to
    /// the end of the list that they are in.
    pub(super) fn renumber(&mut self, locals: [&[u32]; 2], list: &mut PairList) {
        let is_self = self.bodies[0] == self.bodies[1];
        let mut renumbered: Vec<_> = list
            .all(self.pairs())
            .filter_map(|([i, j], [x, y, z, held])| {
                let pair = [locals[0][slot_of(i) as usize], locals[1][slot_of(j) as usize]];
                let [i, j] = (!pair.contains(&u32::MAX)).then(|| pair.map(slot_of))?;
                // Of a body and itself the lower comes first.
                Some(if is_self && i > j { ([j, i], [-x, -y, -z, held]) } else { ([i, j], [x, y, z, held]) })
            })
            .collect();
        // Where others have gone, blocks are filled anew, and slots have another order.
        renumbered.sort_unstable_by_key(|(pair, _)| *pair);
        let first = list.len();
        renumbered.into_iter().for_each(|(pair, memory)| list.push(pair, memory));
        *self = Self { pairs: first as u32..list.len() as u32, ..Self::new(self.bodies) };
    }
}

/// The contacts of a body with itself and as_range after it.
pub(super) struct BodyContacts<'a> {
    /// All body_pairs of which the body is the first.
    pub(super) body_pairs: &'a mut [BodyPair],
    /// Of each where the loads of its pairs that are close stand among all of the body's.
    pub(super) loads: &'a mut [Range<u32>],
    pub(super) bodies: &'a [Body],
    pub(super) pairs: &'a mut BodyPairList,
    pub(super) laws: &'a PairLaws,
    pub(super) frame: &'a Frame,
    /// Number of the step, from 2: so that what remembers nothing held in none.
    pub(super) step: u32,
}

impl BodyContacts<'_> {
    /// DistanceScratch up the pairs of as_range body_pairs that are due. What in_contact pairs remember stays.
    #[inline(always)]
    pub(super) fn search<S: LaneOps>(&mut self, simd: S, search: &SearchParams, room: &mut PairScratch) {
        let mut due = std::mem::take(&mut room.due);
        due.clear();
        due.extend(self.body_pairs.iter().map(|body_pair| body_pair.is_due(self.bodies)));
        if std::mem::take(&mut self.pairs.is_stale) || due.contains(&true) {
            self.list(simd, search, room, &due);
        }
        room.due = due;
    }

    /// Writes the list afresh.
    #[inline(always)]
    fn list<S: LaneOps>(
        &mut self,
        simd: S,
        search: &SearchParams,
        PairScratch { pair_search, spare, distances, .. }: &mut PairScratch,
        due: &[bool],
    ) {
        let list = &mut self.pairs.list;
        spare.clear();
        // Pairs of body_pairs that are not due, one after the other: they go over together.
        let mut stay = 0..0;
        for m in 0..self.body_pairs.len() {
            // What the next will pair_offsets at comes meanwhile, all of it: a search takes longer than that.
            if due[m]
                && let Some(next) = due[m + 1..].iter().position(|&due| due)
            {
                let BodyPair { bodies, candidates, .. } = &self.body_pairs[m + 1 + next];
                prefetch::to_l1(&candidates.pairs);
                prefetch::to_l1(&self.bodies[bodies[1] as usize].points.positions);
            }
            let body_pair = &mut self.body_pairs[m];
            let old = body_pair.pairs();
            let mut found = &[][..];
            if due[m] {
                let sides = body_pair.bodies.map(|body| &self.bodies[body as usize]);
                found = body_pair.search(simd, search, self.frame, sides, pair_search, distances);
            }
            // A search that had nothing and found nothing, as half of them, leaves the list as it is.
            let is_new = due[m] && !(old.is_empty() && found.is_empty());
            if is_new || (!old.is_empty() && old.start != stay.end) {
                spare.extend(list, stay);
                stay = old.start..old.start;
            }
            let first = spare.len() + stay.len();
            let count = if is_new {
                spare.merge_close(&body_pair.candidates.pairs, found, list, old.clone());
                stay = old.end..old.end;
                found.len()
            } else {
                stay.end += old.len();
                old.len()
            };
            body_pair.pairs = first as u32..(first + count) as u32;
        }
        if spare.len() == 0 && stay == (0..list.len()) {
            return;
        }
        spare.extend(list, stay);
        std::mem::swap(list, spare);
    }

    /// Works out the load of every pair that is close. Returns their greatest overlap, in metres.
    #[inline(always)]
    pub(super) fn forces<S: LaneOps>(&mut self, simd: S, room: &mut PairScratch) -> f32 {
        let PairScratch { batches, loads: summed, distances, .. } = room;
        let [mut batch, mut full] = batches.each_mut();
        let BodyPairList { list, loads, self_loads, .. } = &mut *self.pairs;
        let mine = &self.bodies[self.body_pairs[0].bodies[0] as usize];
        loads.clear();
        self_loads.clear();
        let offsets = grown(&mut distances.offsets, list.len());
        // DampingCap body_pairs have no pair.
        for body_pair in self.body_pairs.iter().filter(|it| !it.pairs.is_empty()) {
            let ([_, other], pairs) = (body_pair.bodies, body_pair.pairs());
            let sides = [&mine.points, &self.bodies[other as usize].points];
            pairs::pair_offsets(&list.slots[pairs.clone()], sides, self.frame, &mut offsets[pairs]);
        }
        // What has touched holds a little further.
        let reach = self.laws.touch + self.laws.contact.snap.abs();
        let mut close = pairs::select_close(
            simd,
            offsets,
            reach * (1.0 + ROUNDING) / self.frame.unit_m,
            &mut distances.close,
        );
        let (mut max_overlap, mut done) = (0.0f32, 0);
        for m in 0..self.body_pairs.len() {
            let body_pair = &self.body_pairs[m];
            if body_pair.pairs.is_empty() {
                // Only where it is news: lines of the cache are shared with other threads.
                if self.loads[m] != (0..0) {
                    self.loads[m] = 0..0;
                }
                continue;
            }
            let count = close.partition_point(|&pair| pair < body_pair.pairs.end);
            // Single spheres that go together have several contacts each; a fillet hardly any with itself, which are no work to keep.
            // Not by how many there are now: that goes by spheres that others know nothing of.
            let is_summed = body_pair.bodies[0] == body_pair.bodies[1] && mine.bonds.is_empty();
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
                // The compiler would make one function of this and the kernels, which have no register to spare.
                let taken =
                    run_outlined(simd, FillBatch { batch, close: these, list, offsets, sides, sqrt_m_star });
                these = &these[taken..];
                if batch.pairs.len() == BATCH_SIZE {
                    let summed = is_summed.then_some(&mut *summed);
                    max_overlap = max_overlap
                        .max(run_outlined(simd, EvaluateBatch { contacts: self, batch: full, summed }));
                    std::mem::swap(&mut batch, &mut full);
                }
            }
            if is_summed {
                for batch in [&mut *full, &mut *batch] {
                    let summed = Some(&mut *summed);
                    max_overlap =
                        max_overlap.max(run_outlined(simd, EvaluateBatch { contacts: self, batch, summed }));
                }
                run_outlined(simd, AddToBoth { sums: &mut self.pairs.self_loads, loads: summed });
                summed.clear();
            }
        }
        for batch in [full, batch] {
            max_overlap =
                max_overlap.max(run_outlined(simd, EvaluateBatch { contacts: self, batch, summed: None }));
        }
        max_overlap
    }
}

/// A body's part of the first phase.
pub(super) struct ContactPhase<'a, 'b> {
    pub(super) contacts: &'a mut BodyContacts<'b>,
    pub(super) search: &'a SearchParams,
    pub(super) room: &'a mut PairScratch,
    pub(super) stages: &'a StageTimers,
}

impl SimdTask for ContactPhase<'_, '_> {
    type Output = f32;

    #[inline(always)]
    fn run<S: LaneOps>(self, simd: S) -> f32 {
        let mut timer = self.stages.timer();
        self.contacts.search(simd, self.search, self.room);
        timer.lap(Stage::Search);
        let max_overlap = self.contacts.forces(simd, self.room);
        timer.lap(Stage::Contacts);
        max_overlap
    }
}

/// Works out the loads of a batch, and hands them out in its order. Returns the greatest overlap, in metres.
struct EvaluateBatch<'a, 'b> {
    contacts: &'a mut BodyContacts<'b>,
    batch: &'a mut PairBatch,
    /// PairScratch for what pairs self_loads a body do, if that is summed up at once.
    summed: Option<&'a mut LoadList>,
}

impl SimdTask for EvaluateBatch<'_, '_> {
    type Output = f32;

    #[inline(always)]
    fn run<S: LaneOps>(self, simd: S) -> f32 {
        let Self { contacts: BodyContacts { pairs, laws, frame, step, .. }, batch, summed } = self;
        let BodyPairList { list, loads, self_loads, .. } = &mut **pairs;
        if batch.pairs.is_empty() {
            return 0.0;
        }
        let mut pair_loads = [PairLoads::ZERO; 2];
        let mut lanes = batch.lanes(simd, frame, *step);
        let max_overlap = kernel::contacts(simd, laws, &mut lanes, &mut pair_loads);
        let LoadList { loads, slots } = match summed {
            None => loads,
            Some(summed) => {
                // What the batch before does, which is there by now.
                run_outlined(simd, AddToBoth { sums: self_loads, loads: summed });
                summed.clear();
                summed
            }
        };
        loads.push(simd, &pair_loads[0]);
        loads.push(simd, &pair_loads[1]);
        let memory = [lanes.memory[0].memory(simd, *step).0, lanes.memory[1].memory(simd, *step).0];
        list.store_histories(&batch.pairs, memory.as_flattened(), slots);
        batch.pairs.clear();
        max_overlap
    }
}
