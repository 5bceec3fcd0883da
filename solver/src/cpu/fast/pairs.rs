//! The pairs of a body's sub-particles that may touch: with each other, and with those of the bodies after it; and what they do.

use std::ops::Range;

use super::fetch;
use super::instructions::Wide;
use super::load::Loads;
use super::memory::{Lanes, Places, Quads, WIDTH, places_of, space};
use super::points::Points;
use crate::engine::frame::Frame;

/// Pairs, meeting by meeting, and what they remember.
#[derive(Debug, Default)]
pub(super) struct PairList {
    /// Places of sub-particles in their bodies (see [`super::points::place_of`]).
    pub(super) places: Vec<[u32; 2]>,
    /// ξ in metres, and the bits of the step in which the contact last held: if it was another than the last, it has let go.
    pub(super) memory: Vec<[f32; 4]>,
}

/// The pairs of a body with itself and those after it.
#[derive(Debug, Default)]
pub(super) struct BodyPairs {
    pub(super) list: PairList,
    /// Whether meetings have come or gone since the list was written.
    pub(super) is_stale: bool,
    /// What those that are close do in this step, but for those within the body where these are summed up.
    pub(super) loads: PairLoads,
    /// What pairs within the body do to each of its sub-particles, where it is single spheres that go together; else empty.
    pub(super) within: Loads,
}

/// What acts on the firsts of pairs; on their seconds act the opposite force and the same torque.
#[derive(Debug, Default)]
pub(super) struct PairLoads {
    pub(super) loads: Loads,
    /// Of the firsts and of the seconds.
    pub(super) places: Vec<[u32; 2]>,
}

impl PairLoads {
    pub(super) fn clear(&mut self) {
        self.loads.clear();
        self.places.clear();
    }

    /// Fetches some from memory.
    #[inline(always)]
    pub(super) fn fetch(&self, pairs: Range<usize>) {
        fetch::later(&self.places[pairs.clone()]);
        self.loads.fetch(pairs);
    }
}

/// In the order of this number pairs are sorted.
#[inline(always)]
pub(super) fn number([i, j]: [u32; 2]) -> u64 {
    u64::from(i) << u32::BITS | u64::from(j)
}

/// What stands there, as slices have it.
pub(super) fn those(range: &Range<u32>) -> Range<usize> {
    range.start as usize..range.end as usize
}

/// Distances of pairs of two bodies, from the first to the second, in units of length.
#[inline(never)]
pub(super) fn look(
    places: &[[u32; 2]],
    [first, second]: [&Points; 2],
    frame: &Frame,
    apart: &mut [[i32; 4]],
) {
    let (first, second) = (&first.positions[..], &second.positions[..]);
    for (apart, &[i, j]) in apart.iter_mut().zip(places) {
        let (x, y) = (&first[i as usize], &second[j as usize]);
        *apart = std::array::from_fn(|axis| y[axis].wrapping_sub(x[axis]));
    }
    if frame.period_y != 0 {
        apart.iter_mut().for_each(|apart| apart[1] = frame.nearest_image(apart[1]));
    }
}

impl PairList {
    pub(super) fn len(&self) -> usize {
        self.places.len()
    }

    pub(super) fn clear(&mut self) {
        self.places.clear();
        self.memory.clear();
    }

    pub(super) fn push(&mut self, places: [u32; 2], memory: [f32; 4]) {
        self.places.push(places);
        self.memory.push(memory);
    }

    /// Takes over some of another list.
    pub(super) fn extend(&mut self, other: &Self, range: Range<usize>) {
        self.places.extend_from_slice(&other.places[range.clone()]);
        self.memory.extend_from_slice(&other.memory[range]);
    }

    /// Takes in those candidates that are close, sorted; what they remember if they stand in a part of another list.
    #[inline(never)]
    pub(super) fn take_over(
        &mut self,
        candidates: &[[u32; 2]],
        close: &[u32],
        other: &Self,
        range: Range<usize>,
    ) {
        let (places, memory) = (&other.places[range.clone()], &other.memory[range]);
        let first = self.len();
        self.places.extend(close.iter().map(|&candidate| candidates[candidate as usize]));
        let mut k = 0;
        self.memory.extend(self.places[first..].iter().map(|&pair| {
            while k < places.len() && number(places[k]) < number(pair) {
                k += 1;
            }
            let is_known = k < places.len() && places[k] == pair;
            let before = if is_known { memory[k] } else { [0.0; 4] };
            k += usize::from(is_known);
            before
        }));
    }

    /// Some pairs, with what they remember.
    pub(super) fn all(&self, range: Range<usize>) -> impl Iterator<Item = ([u32; 2], [f32; 4])> {
        self.places[range.clone()].iter().copied().zip(self.memory[range].iter().copied())
    }

    /// Takes back what pairs remember; adds their places to others.
    #[inline(never)]
    pub(super) fn hand_back(&mut self, pairs: &[u32], memory: &[[f32; 4]], to: &mut Vec<[u32; 2]>) {
        let (places, memories) = (&self.places[..], &mut self.memory[..self.places.len()]);
        to.extend(pairs.iter().map(|&pair| places[pair as usize]));
        for (&pair, memory) in pairs.iter().zip(memory) {
            memories[pair as usize] = *memory;
        }
    }
}

/// Finds those that are no further apart than `near` units of length, into `room`. `apart` are their distances.
#[inline(always)]
pub(super) fn close<'a, S: Wide>(
    simd: S,
    apart: &[[i32; 4]],
    near: f32,
    room: &'a mut Vec<u32>,
) -> &'a [u32] {
    // Whole registers are written.
    let close = space(room, apart.len() + WIDTH);
    let mut count = 0;
    let mut quads = Quads::ZERO;
    for (first, apart) in (0u32..).step_by(WIDTH).zip(apart.chunks(WIDTH)) {
        for (quad, apart) in quads.0.iter_mut().zip(apart) {
            *quad = apart.map(|d| f32::from_bits(d as u32));
        }
        let [x, y, z, _] = simd.to_lanes(&quads);
        let mut distance2 = Lanes::ZERO;
        for axis in [x, y, z] {
            for k in 0..WIDTH {
                let d = axis.0[k].to_bits() as i32 as f32;
                distance2.0[k] += d * d;
            }
        }
        let there = (1u32 << apart.len()) - 1;
        let bits = places_of(simd.at_most(&distance2, near * near)) & there as u16;
        let mut these = simd.to_front(&Places::EACH, bits);
        for k in 0..WIDTH {
            these.0[k] += first;
        }
        close[count..count + WIDTH].copy_from_slice(&these.0);
        count += bits.count_ones() as usize;
    }
    &close[..count]
}
