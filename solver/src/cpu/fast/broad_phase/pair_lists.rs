//! Renewal of the neighbour lists of a body.

use std::ops::Range;

use super::body_pair::BodyPair;
use super::distances::DistanceScratch;
use super::pair_search::{PairSearch, SearchParams};
use crate::cpu::fast::instructions::prefetch;
use crate::cpu::fast::instructions::set::LaneOps;
use crate::cpu::fast::storage::body::Body;
use crate::cpu::fast::storage::laws::PairLaws;
use crate::cpu::fast::storage::pairs::{BodyPairList, PairList};
use crate::engine::frame::Frame;

/// The contacts of a body with itself and with bodies of higher index.
pub(crate) struct BodyContacts<'a> {
    /// All body pairs of which the body is the first.
    pub(crate) body_pairs: &'a mut [BodyPair],
    /// For each body pair, the range of its close pairs' loads among those of the body.
    pub(crate) loads: &'a mut [Range<u32>],
    pub(crate) bodies: &'a [Body],
    pub(crate) pairs: &'a mut BodyPairList,
    pub(crate) laws: &'a PairLaws,
    pub(crate) frame: &'a Frame,
    /// Number of the step, from 2, so that an empty history holds in no step.
    pub(crate) step: u32,
}

/// Scratch memory of one thread for the renewal of lists.
#[derive(Debug, Default)]
pub(crate) struct SearchScratch {
    pair_search: PairSearch,
    /// List under construction.
    spare: PairList,
    /// Whether each body pair must renew its pairs.
    due: Vec<bool>,
    pub(crate) distances: DistanceScratch,
}

impl BodyContacts<'_> {
    /// Renews the pairs of all body pairs that are due. Contact histories persist.
    #[inline(always)]
    pub(crate) fn search<S: LaneOps>(&mut self, simd: S, search: &SearchParams, scratch: &mut SearchScratch) {
        let mut due = std::mem::take(&mut scratch.due);
        due.clear();
        due.extend(self.body_pairs.iter().map(|body_pair| body_pair.is_due(self.bodies)));
        if std::mem::take(&mut self.pairs.is_stale) || due.contains(&true) {
            self.rebuild_list(simd, search, scratch, &due);
        }
        scratch.due = due;
    }

    /// Rebuilds the list.
    #[inline(always)]
    fn rebuild_list<S: LaneOps>(
        &mut self,
        simd: S,
        search: &SearchParams,
        SearchScratch { pair_search, spare, distances, .. }: &mut SearchScratch,
        due: &[bool],
    ) {
        let list = &mut self.pairs.list;
        spare.clear();
        // Pairs of consecutive body pairs that are not due. They are copied together.
        let mut stay = 0..0;
        for m in 0..self.body_pairs.len() {
            // Prefetch the data of the next search. The current one takes longer than the fetch.
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
            // About half of the searches start empty and find nothing, which leaves the list unchanged.
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
}
