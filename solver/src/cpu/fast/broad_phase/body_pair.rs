//! Body pairs: two bodies near each other, the pairs of their sub-particles, and the Verlet skin of these lists.
//!
//! A list is renewed when the two bodies may have moved against each other by its skin. Fillets that fall together keep
//! theirs. Lists are filtered from candidates, which a search over all sub-particles finds and which last several times
//! as long. The inner skin can therefore be thin and the lists short.

use std::ops::Range;

use glam::DVec3;

use super::distances::{DistanceScratch, pair_offsets, select_close};
use super::pair_search::{PairSearch, SearchParams};
use crate::cpu::fast::instructions::arrays::grown;
use crate::cpu::fast::instructions::set::LaneOps;
use crate::cpu::fast::storage::body::Body;
use crate::cpu::fast::storage::motion::{BodyMotion, SAFETY_FACTOR};
use crate::cpu::fast::storage::pairs::{PairList, as_range};
use crate::cpu::fast::storage::particles::slot_of;
use crate::engine::frame::Frame;

/// Two bodies, or a body with itself.
#[derive(Debug)]
#[repr(align(64))]
pub(crate) struct BodyPair {
    /// Indices of the bodies, in order.
    pub(crate) bodies: [u32; 2],
    /// Range of its pairs in the list of the first body, sorted.
    pub(crate) pairs: Range<u32>,
    /// Remaining validity of the pairs.
    pub(crate) skin_budget: SkinBudget,
    pub(crate) candidates: Box<Candidates>,
}

// A run has about a dozen body pairs per body, and each is queried in every step: one cache line each.
const _: () = assert!(size_of::<BodyPair>() == 64);

/// Candidates for the neighbour list, and their validity.
#[derive(Debug)]
pub(crate) struct Candidates {
    pub(crate) pairs: Vec<[u32; 2]>,
    pub(crate) skin_budget: SkinBudget,
}

/// Verlet skin of a list between two moving bodies: the relative motion that it still tolerates.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SkinBudget {
    /// Relative position at the last search, in metres.
    separation: DVec3,
    path: f64,
    /// Tolerated relative motion since then, in metres.
    allowed: f64,
}

impl SkinBudget {
    /// An exhausted budget.
    const NONE: Self = Self { separation: DVec3::ZERO, path: 0.0, allowed: f64::NEG_INFINITY };

    /// A budget of `margin` metres from the current motions on.
    fn new([a, b]: [&BodyMotion; 2], margin: f32) -> Self {
        Self {
            separation: b.shift - a.shift,
            path: a.path + b.path,
            allowed: SAFETY_FACTOR * f64::from(margin),
        }
    }

    fn is_exhausted(&self, [a, b]: [&BodyMotion; 2]) -> bool {
        let left = self.allowed - (a.path + b.path - self.path);
        // The negated comparison also catches NaN.
        !(left >= 0.0 && (b.shift - a.shift).distance_squared(self.separation) <= left * left)
    }
}

impl SearchParams {
    /// The cutoff of a pair of bodies, or of a body with itself.
    pub(crate) fn cutoff(&self, first: &Body, is_self: bool) -> f32 {
        self.cutoffs[usize::from(is_self && !first.is_group)]
    }
}

impl BodyPair {
    pub(crate) fn new(bodies: [u32; 2]) -> Self {
        let candidates = Box::new(Candidates { pairs: Vec::new(), skin_budget: SkinBudget::NONE });
        Self { bodies, pairs: 0..0, skin_budget: SkinBudget::NONE, candidates }
    }

    /// Range of its pairs in the list of the first body.
    pub(crate) fn pairs(&self) -> Range<usize> {
        as_range(&self.pairs)
    }

    /// Whether its pairs must be renewed.
    pub(crate) fn is_due(&self, bodies: &[Body]) -> bool {
        self.skin_budget.is_exhausted(self.bodies.map(|body| &bodies[body as usize].motion))
    }

    /// Finds the close pairs, as indices of candidates.
    #[inline(always)]
    pub(crate) fn search<'a, S: LaneOps>(
        &mut self,
        simd: S,
        search: &SearchParams,
        frame: &Frame,
        [a, b]: [&Body; 2],
        pair_search: &mut PairSearch,
        DistanceScratch { offsets, close }: &'a mut DistanceScratch,
    ) -> &'a [u32] {
        let is_self = self.bodies[0] == self.bodies[1];
        let (cutoff, skin) = (search.cutoff(a, is_self), search.skins[usize::from(is_self)]);
        let motions = [&a.motion, &b.motion];
        let Self { skin_budget, candidates, .. } = self;
        if candidates.skin_budget.is_exhausted(motions) {
            let gap = pair_search.search(simd, search, frame, [a, b], is_self);
            let outer_skin = search.outer_skins[usize::from(is_self)];
            // Bodies without candidates may approach by the gap between them. Candidates must cover a list
            // built at the last moment.
            let margin = match &pair_search.found[..] {
                [] => outer_skin.max(gap - cutoff),
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
        pair_offsets(&candidates.pairs, [&a.points, &b.points], frame, offsets);
        select_close(simd, offsets, (cutoff + skin) / frame.unit_m, close)
    }

    /// Renumbers its pairs after a removal and schedules a new search. Its pairs move to the end of the list.
    pub(crate) fn renumber(&mut self, locals: [&[u32]; 2], list: &mut PairList) {
        let is_self = self.bodies[0] == self.bodies[1];
        let mut renumbered: Vec<_> = list
            .all(self.pairs())
            .filter_map(|([i, j], [x, y, z, held])| {
                let pair = [locals[0][slot_of(i) as usize], locals[1][slot_of(j) as usize]];
                let [i, j] = (!pair.contains(&u32::MAX)).then(|| pair.map(slot_of))?;
                // Within a body the lower slot comes first.
                Some(if is_self && i > j { ([j, i], [-x, -y, -z, held]) } else { ([i, j], [x, y, z, held]) })
            })
            .collect();
        // Removals refill blocks, which changes the order of slots.
        renumbered.sort_unstable_by_key(|(pair, _)| *pair);
        let first = list.len();
        renumbered.into_iter().for_each(|(pair, histories)| list.push(pair, histories));
        *self = Self { pairs: first as u32..list.len() as u32, ..Self::new(self.bodies) };
    }
}
