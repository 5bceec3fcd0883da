//! The neighbour lists of a body: its pairs with itself and with bodies of higher index.

use std::ops::Range;

use super::loads::{LoadArray, LoadList};

/// Pairs, meeting by meeting, and what they remember.
#[derive(Debug, Default)]
pub(crate) struct PairList {
    /// LaneIndices of sub-particles in their bodies (see [`super::points::slot_of`]).
    pub(crate) slots: Vec<[u32; 2]>,
    /// ξ in metres, and the bits of the step in which the contact last held: if it was another than the last, it has let go.
    pub(crate) memory: Vec<[f32; 4]>,
}

/// The pairs of a body with itself and as_range after it.
#[derive(Debug, Default)]
pub(crate) struct BodyPairList {
    pub(crate) list: PairList,
    /// Whether body_pairs have come or gone since the list was written.
    pub(crate) is_stale: bool,
    /// What as_range that are close do in this step, but for as_range self_loads the body where these are summed up.
    pub(crate) loads: LoadList,
    /// What pairs self_loads the body do to each of its sub-particles, where it is single spheres that go together; else empty.
    pub(crate) self_loads: LoadArray,
}

/// In the order of this number pairs are sorted.
#[inline(always)]
pub(crate) fn sort_key([i, j]: [u32; 2]) -> u64 {
    u64::from(i) << u32::BITS | u64::from(j)
}

/// What stands there, as slices have it.
pub(crate) fn as_range(range: &Range<u32>) -> Range<usize> {
    range.start as usize..range.end as usize
}

impl PairList {
    pub(crate) fn len(&self) -> usize {
        self.slots.len()
    }

    pub(crate) fn clear(&mut self) {
        self.slots.clear();
        self.memory.clear();
    }

    pub(crate) fn push(&mut self, slots: [u32; 2], memory: [f32; 4]) {
        self.slots.push(slots);
        self.memory.push(memory);
    }

    /// Takes over some of another list.
    pub(crate) fn extend(&mut self, other: &Self, range: Range<usize>) {
        self.slots.extend_from_slice(&other.slots[range.clone()]);
        self.memory.extend_from_slice(&other.memory[range]);
    }

    /// Takes in as_range candidates that are close, sorted; what they remember if they stand in a part of another list.
    #[inline(never)]
    pub(crate) fn merge_close(
        &mut self,
        candidates: &[[u32; 2]],
        close: &[u32],
        other: &Self,
        range: Range<usize>,
    ) {
        let (slots, memory) = (&other.slots[range.clone()], &other.memory[range]);
        let first = self.len();
        self.slots.extend(close.iter().map(|&candidate| candidates[candidate as usize]));
        let mut k = 0;
        self.memory.extend(self.slots[first..].iter().map(|&pair| {
            while k < slots.len() && sort_key(slots[k]) < sort_key(pair) {
                k += 1;
            }
            let is_known = k < slots.len() && slots[k] == pair;
            let before = if is_known { memory[k] } else { [0.0; 4] };
            k += usize::from(is_known);
            before
        }));
    }

    /// Some pairs, with what they remember.
    pub(crate) fn all(&self, range: Range<usize>) -> impl Iterator<Item = ([u32; 2], [f32; 4])> {
        self.slots[range.clone()].iter().copied().zip(self.memory[range].iter().copied())
    }

    /// Takes back what pairs remember; adds their slots to others.
    #[inline(never)]
    pub(crate) fn store_histories(&mut self, pairs: &[u32], memory: &[[f32; 4]], to: &mut Vec<[u32; 2]>) {
        let (slots, memories) = (&self.slots[..], &mut self.memory[..self.slots.len()]);
        to.extend(pairs.iter().map(|&pair| slots[pair as usize]));
        for (&pair, memory) in pairs.iter().zip(memory) {
            memories[pair as usize] = *memory;
        }
    }
}
