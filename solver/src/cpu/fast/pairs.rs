//! The pairs of a body's sub-particles that may touch: with each other, and with as_range of the bodies after it; and what they do.

use std::ops::Range;

use super::instructions::LaneOps;
use super::load::LoadArray;
use super::memory::{LaneIndices, Lanes, Quads, WIDTH, grown, transposed_bits};
use super::points::BodyParticles;
use super::prefetch;
use crate::engine::frame::Frame;

/// Pairs, meeting by meeting, and what they remember.
#[derive(Debug, Default)]
pub(super) struct PairList {
    /// LaneIndices of sub-particles in their bodies (see [`super::points::slot_of`]).
    pub(super) slots: Vec<[u32; 2]>,
    /// ξ in metres, and the bits of the step in which the contact last held: if it was another than the last, it has let go.
    pub(super) memory: Vec<[f32; 4]>,
}

/// The pairs of a body with itself and as_range after it.
#[derive(Debug, Default)]
pub(super) struct BodyPairList {
    pub(super) list: PairList,
    /// Whether body_pairs have come or gone since the list was written.
    pub(super) is_stale: bool,
    /// What as_range that are close do in this step, but for as_range self_loads the body where these are summed up.
    pub(super) loads: LoadList,
    /// What pairs self_loads the body do to each of its sub-particles, where it is single spheres that go together; else empty.
    pub(super) self_loads: LoadArray,
}

/// What acts on the firsts of pairs; on their seconds act the opposite force and the same torque.
#[derive(Debug, Default)]
pub(super) struct LoadList {
    pub(super) loads: LoadArray,
    /// Of the firsts and of the seconds.
    pub(super) slots: Vec<[u32; 2]>,
}

impl LoadList {
    pub(super) fn clear(&mut self) {
        self.loads.clear();
        self.slots.clear();
    }

    /// Fetches some from memory.
    #[inline(always)]
    pub(super) fn prefetch(&self, pairs: Range<usize>) {
        prefetch::to_l2(&self.slots[pairs.clone()]);
        self.loads.prefetch(pairs);
    }
}

/// In the order of this number pairs are sorted.
#[inline(always)]
pub(super) fn sort_key([i, j]: [u32; 2]) -> u64 {
    u64::from(i) << u32::BITS | u64::from(j)
}

/// What stands there, as slices have it.
pub(super) fn as_range(range: &Range<u32>) -> Range<usize> {
    range.start as usize..range.end as usize
}

/// Distances of pairs of two bodies, from the first to the second, in units of length.
#[inline(never)]
pub(super) fn pair_offsets(
    slots: &[[u32; 2]],
    [first, second]: [&BodyParticles; 2],
    frame: &Frame,
    offsets: &mut [[i32; 4]],
) {
    let (first, second) = (&first.positions[..], &second.positions[..]);
    for (offsets, &[i, j]) in offsets.iter_mut().zip(slots) {
        let (x, y) = (&first[i as usize], &second[j as usize]);
        *offsets = std::array::from_fn(|axis| y[axis].wrapping_sub(x[axis]));
    }
    if frame.period_y != 0 {
        offsets.iter_mut().for_each(|offsets| offsets[1] = frame.nearest_image(offsets[1]));
    }
}

impl PairList {
    pub(super) fn len(&self) -> usize {
        self.slots.len()
    }

    pub(super) fn clear(&mut self) {
        self.slots.clear();
        self.memory.clear();
    }

    pub(super) fn push(&mut self, slots: [u32; 2], memory: [f32; 4]) {
        self.slots.push(slots);
        self.memory.push(memory);
    }

    /// Takes over some of another list.
    pub(super) fn extend(&mut self, other: &Self, range: Range<usize>) {
        self.slots.extend_from_slice(&other.slots[range.clone()]);
        self.memory.extend_from_slice(&other.memory[range]);
    }

    /// Takes in as_range candidates that are close, sorted; what they remember if they stand in a part of another list.
    #[inline(never)]
    pub(super) fn merge_close(
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
    pub(super) fn all(&self, range: Range<usize>) -> impl Iterator<Item = ([u32; 2], [f32; 4])> {
        self.slots[range.clone()].iter().copied().zip(self.memory[range].iter().copied())
    }

    /// Takes back what pairs remember; adds their slots to others.
    #[inline(never)]
    pub(super) fn store_histories(&mut self, pairs: &[u32], memory: &[[f32; 4]], to: &mut Vec<[u32; 2]>) {
        let (slots, memories) = (&self.slots[..], &mut self.memory[..self.slots.len()]);
        to.extend(pairs.iter().map(|&pair| slots[pair as usize]));
        for (&pair, memory) in pairs.iter().zip(memory) {
            memories[pair as usize] = *memory;
        }
    }
}

/// Finds as_range that are no further offsets than `near` units of length, into `room`. `offsets` are their distances.
#[inline(always)]
pub(super) fn select_close<'a, S: LaneOps>(
    simd: S,
    offsets: &[[i32; 4]],
    near: f32,
    room: &'a mut Vec<u32>,
) -> &'a [u32] {
    // Whole registers are written.
    let close = grown(room, offsets.len() + WIDTH);
    let mut count = 0;
    let mut quads = Quads::ZERO;
    for (first, offsets) in (0u32..).step_by(WIDTH).zip(offsets.chunks(WIDTH)) {
        for (quad, offsets) in quads.0.iter_mut().zip(offsets) {
            *quad = offsets.map(|d| f32::from_bits(d as u32));
        }
        let [x, y, z, _] = simd.to_lanes(&quads);
        let mut distance2 = Lanes::ZERO;
        for axis in [x, y, z] {
            for k in 0..WIDTH {
                let d = axis.0[k].to_bits() as i32 as f32;
                distance2.0[k] += d * d;
            }
        }
        let there = (1u32 << offsets.len()) - 1;
        let bits = transposed_bits(simd.le_bits(&distance2, near * near)) & there as u16;
        let mut these = simd.compress(&LaneIndices::IDENTITY, bits);
        for k in 0..WIDTH {
            these.0[k] += first;
        }
        close[count..count + WIDTH].copy_from_slice(&these.0);
        count += bits.count_ones() as usize;
    }
    &close[..count]
}
