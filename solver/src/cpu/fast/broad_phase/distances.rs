//! Distances of listed pairs, and the selection of close pairs.

use crate::cpu::fast::instructions::arrays::{LaneIndices, Lanes, Quads, WIDTH, grown, transposed_bits};
use crate::cpu::fast::instructions::set::LaneOps;
use crate::cpu::fast::storage::particles::BodyParticles;
use crate::engine::frame::Frame;

/// Offsets of pairs of two bodies, from the first to the second sub-particle, in units of length.
#[inline(never)]
pub(crate) fn pair_offsets(
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

/// Pairs with an offset of at most `near` units of length, collected in `room`.
#[inline(always)]
pub(crate) fn select_close<'a, S: LaneOps>(
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

/// Scratch memory for offsets and close pairs.
#[derive(Debug, Default)]
pub(crate) struct DistanceScratch {
    pub(crate) offsets: Vec<[i32; 4]>,
    pub(crate) close: Vec<u32>,
}
