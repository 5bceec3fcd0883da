//! Loads on their way from pairs to sub-particles, and what pairs look like before.

use super::instructions::Wide;
use super::kernel::{Contacts, Felt, Seen};
use super::memory::{Lanes, Lanes3, Quads, WIDTH};
use super::points::Points;
use crate::cpu::forces::Load;
use crate::engine::frame::Frame;

/// Chunks of pairs that go through the kernels together: each is one long chain of dependent operations, and the
/// processor works on the next while it waits for the one before.
pub(super) const BATCH: usize = 8;

/// Pairs on their way into the kernels, and loads on their way out.
#[derive(Debug)]
pub(super) struct Batch {
    pub(super) looks: [Look; BATCH],
    pub(super) felt: [Felt; 2],
}

impl Default for Batch {
    fn default() -> Self {
        Self { looks: [Look::NOTHING; BATCH], felt: [Felt::NOTHING; 2] }
    }
}

/// [`WIDTH`] pairs, one after the other: x_j − x_i in metres, v_j − v_i, ω_i + ω_j.
#[derive(Clone, Copy, Debug)]
pub(super) struct Look {
    apart: Quads,
    velocity: Quads,
    spin: Quads,
}

/// What acts on the firsts of [`WIDTH`] pairs: force and torque, one after the other.
#[derive(Clone, Debug)]
pub(super) struct PairLoads {
    force: Quads,
    torque: Quads,
}

/// Loads of a block of sub-particles.
#[derive(Clone, Copy, Debug)]
pub(super) struct LoadBlock {
    pub(super) force: Lanes3,
    pub(super) torque: Lanes3,
}

/// Sums of the loads of a body's sub-particles.
#[derive(Debug, Default)]
pub(super) struct Sums {
    /// What comes one at a time, in quads; at the places of [`super::points::place_of`].
    single: Vec<PairLoads>,
    /// What comes in blocks.
    pub(super) blocks: Vec<LoadBlock>,
}

impl Look {
    pub(super) const NOTHING: Self = Self { apart: Quads::ZERO, velocity: Quads::ZERO, spin: Quads::ZERO };

    /// Looks at pairs, from the first towards the second. Places without a pair keep what they had.
    #[inline(always)]
    pub(super) fn at(&mut self, [first, second]: [&Points; 2], pairs: &[[u32; 2]], frame: &Frame) {
        for (k, &[i, j]) in pairs.iter().enumerate().take(WIDTH) {
            let (a, p) = (&first.looks[i as usize / WIDTH], i as usize % WIDTH);
            let (b, q) = (&second.looks[j as usize / WIDTH], j as usize % WIDTH);
            let (x, y) = (&a.position[p], &b.position[q]);
            let mut apart: [i32; 4] = std::array::from_fn(|c| y[c].wrapping_sub(x[c]));
            if frame.period_y != 0 {
                apart[1] = frame.nearest_image(apart[1]);
            }
            self.apart.0[k] = apart.map(|d| d as f32 * frame.unit_m);
            self.velocity.0[k] = std::array::from_fn(|c| b.velocity.0[q][c] - a.velocity.0[p][c]);
            self.spin.0[k] = std::array::from_fn(|c| a.spin.0[p][c] + b.spin.0[q][c]);
        }
    }

    /// The same in lanes.
    #[inline(always)]
    pub(super) fn seen<S: Wide>(&self, simd: S) -> Seen {
        let three = |quads: &Quads| {
            let [x, y, z, _] = simd.to_lanes(quads);
            [x, y, z]
        };
        Seen { apart: three(&self.apart), velocity: three(&self.velocity), spin: three(&self.spin) }
    }
}

impl PairLoads {
    pub(super) const ZERO: Self = Self { force: Quads::ZERO, torque: Quads::ZERO };

    /// From lanes.
    #[inline(always)]
    pub(super) fn set<S: Wide>(&mut self, simd: S, felt: &Felt) {
        let [x, y, z] = &felt.force;
        self.force = simd.to_quads([x, y, z, &Lanes::ZERO]);
        let [x, y, z] = &felt.torque;
        self.torque = simd.to_quads([x, y, z, &Lanes::ZERO]);
    }
}

impl Sums {
    /// Nothing yet, for so many blocks.
    pub(super) fn clear(&mut self, blocks: usize) {
        self.single.clear();
        self.single.resize(blocks, PairLoads::ZERO);
        self.blocks.clear();
        self.blocks.resize(blocks, LoadBlock { force: [Lanes::ZERO; 3], torque: [Lanes::ZERO; 3] });
    }

    /// Adds what pairs do to their firsts, side 0, or to their seconds, side 1: the opposite force, the same torque.
    #[inline(always)]
    pub(super) fn add_side(&mut self, side: usize, pairs: &[[u32; 2]], loads: &PairLoads) {
        let sign = if side == 0 { 1.0 } else { -1.0 };
        for (k, pair) in pairs.iter().enumerate() {
            let place = pair[side] as usize;
            let (sum, at) = (&mut self.single[place / WIDTH], place % WIDTH);
            for c in 0..4 {
                sum.force.0[at][c] += sign * loads.force.0[k][c];
            }
            for c in 0..4 {
                sum.torque.0[at][c] += loads.torque.0[k][c];
            }
        }
    }

    /// Adds what acts on the sub-particle at a place.
    #[inline(always)]
    pub(super) fn add(&mut self, place: u32, load: &Load) {
        let (sum, at) = (&mut self.single[place as usize / WIDTH], place as usize % WIDTH);
        for (c, (force, torque)) in load.force.to_array().into_iter().zip(load.torque.to_array()).enumerate()
        {
            sum.force.0[at][c] += force;
            sum.torque.0[at][c] += torque;
        }
    }

    /// All that acts on a block.
    #[inline(always)]
    pub(super) fn of_block<S: Wide>(&self, simd: S, b: usize) -> LoadBlock {
        let (single, mut all) = (&self.single[b], self.blocks[b]);
        let (force, torque) = (simd.to_lanes(&single.force), simd.to_lanes(&single.torque));
        for axis in 0..3 {
            for k in 0..WIDTH {
                all.force[axis].0[k] += force[axis].0[k];
                all.torque[axis].0[k] += torque[axis].0[k];
            }
        }
        all
    }
}

impl Contacts {
    /// Takes over what another contact remembers.
    pub(super) fn take(&mut self, lane: usize, other: &Self, from: usize) {
        self.limit.0[lane] = other.limit.0[from];
        for (mine, theirs) in self.slide.iter_mut().zip(&other.slide) {
            mine.0[lane] = theirs.0[from];
        }
    }
}
