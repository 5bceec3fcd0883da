//! The neighbour lists of a body: its pairs with itself and with bodies of higher index.

use std::ops::Range;

use super::loads::{LoadArray, LoadList};

/// Pairs with their contact histories, ordered by body pair.
#[derive(Debug, Default)]
pub(crate) struct PairList {
    /// Slots of the sub-particles in their bodies (see [`super::particles::slot_of`]).
    pub(crate) slots: Vec<[u32; 2]>,
    /// ξ in metres, and the number of the step in which the contact last held, as bits. A contact that did
    /// not hold in the last step has no history.
    pub(crate) histories: Vec<[f32; 4]>,
}

/// The pairs of a body with itself and with bodies of higher index.
#[derive(Debug, Default)]
pub(crate) struct BodyPairList {
    pub(crate) list: PairList,
    /// Whether body pairs were added or removed since the list was built.
    pub(crate) is_stale: bool,
    /// Loads of close pairs in this step, except those summed into `self_loads`.
    pub(crate) loads: LoadList,
    /// Loads within a group of single spheres, summed per sub-particle; else empty.
    pub(crate) self_loads: LoadArray,
}

/// Sort key of a pair.
#[inline(always)]
pub(crate) fn sort_key([i, j]: [u32; 2]) -> u64 {
    u64::from(i) << u32::BITS | u64::from(j)
}

/// The range as `usize`.
pub(crate) fn as_range(range: &Range<u32>) -> Range<usize> {
    range.start as usize..range.end as usize
}

impl PairList {
    pub(crate) fn len(&self) -> usize {
        self.slots.len()
    }

    pub(crate) fn clear(&mut self) {
        self.slots.clear();
        self.histories.clear();
    }

    pub(crate) fn push(&mut self, slots: [u32; 2], histories: [f32; 4]) {
        self.slots.push(slots);
        self.histories.push(histories);
    }

    /// Appends a part of another list.
    pub(crate) fn extend(&mut self, other: &Self, range: Range<usize>) {
        self.slots.extend_from_slice(&other.slots[range.clone()]);
        self.histories.extend_from_slice(&other.histories[range]);
    }

    /// Appends the close candidates, in order, with their histories from a part of another list.
    #[inline(never)]
    pub(crate) fn merge_close(
        &mut self,
        candidates: &[[u32; 2]],
        close: &[u32],
        other: &Self,
        range: Range<usize>,
    ) {
        let (slots, histories) = (&other.slots[range.clone()], &other.histories[range]);
        let first = self.len();
        self.slots.extend(close.iter().map(|&candidate| candidates[candidate as usize]));
        let mut k = 0;
        self.histories.extend(self.slots[first..].iter().map(|&pair| {
            while k < slots.len() && sort_key(slots[k]) < sort_key(pair) {
                k += 1;
            }
            let is_known = k < slots.len() && slots[k] == pair;
            let before = if is_known { histories[k] } else { [0.0; 4] };
            k += usize::from(is_known);
            before
        }));
    }

    /// Some pairs, with their histories.
    pub(crate) fn all(&self, range: Range<usize>) -> impl Iterator<Item = ([u32; 2], [f32; 4])> {
        self.slots[range.clone()].iter().copied().zip(self.histories[range].iter().copied())
    }

    /// Stores the histories of some pairs, and appends their slots to `to`.
    #[inline(never)]
    pub(crate) fn store_histories(&mut self, pairs: &[u32], histories: &[[f32; 4]], to: &mut Vec<[u32; 2]>) {
        let (slots, stored) = (&self.slots[..], &mut self.histories[..self.slots.len()]);
        to.extend(pairs.iter().map(|&pair| slots[pair as usize]));
        for (&pair, histories) in pairs.iter().zip(histories) {
            stored[pair as usize] = *histories;
        }
    }
}
