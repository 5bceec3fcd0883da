//! Loads on sub-particles, and their sums.
//!
//! The narrow phase appends the loads of close pairs to a [`LoadList`]. The integration phase adds them to the
//! [`LoadSums`] of a body.

use std::ops::Range;

use super::pair_lanes::PairLoads;
use crate::cpu::fast::instructions::arrays::{Lanes, Lanes3, WIDTH, octets};
use crate::cpu::fast::instructions::prefetch;
use crate::cpu::fast::instructions::set::{LaneOps, SimdTask, run_outlined};
use crate::cpu::load::Load;

/// What acts on many sub-particles or pairs, one after the other: a force, 0, a torque, 0.
#[derive(Debug, Default)]
pub(crate) struct LoadArray(Vec<[f32; 8]>);

/// LoadArray of a block of sub-particles.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LoadBlock {
    pub(crate) force: Lanes3,
    pub(crate) torque: Lanes3,
}

/// LoadSums of the loads of a body's sub-particles.
#[derive(Debug, Default)]
pub(crate) struct LoadSums {
    /// What comes one at a time, by [`super::points::slot_of`].
    single: LoadArray,
    /// What comes in blocks.
    pub(crate) blocks: Vec<LoadBlock>,
}

/// What acts on the firsts of pairs; on their seconds act the opposite force and the same torque.
#[derive(Debug, Default)]
pub(crate) struct LoadList {
    pub(crate) loads: LoadArray,
    /// Of the firsts and of the seconds.
    pub(crate) slots: Vec<[u32; 2]>,
}

impl LoadList {
    pub(crate) fn clear(&mut self) {
        self.loads.clear();
        self.slots.clear();
    }

    /// Fetches some from memory.
    #[inline(always)]
    pub(crate) fn prefetch(&self, pairs: Range<usize>) {
        prefetch::to_l2(&self.slots[pairs.clone()]);
        self.loads.prefetch(pairs);
    }
}

impl LoadArray {
    pub(crate) fn clear(&mut self) {
        self.0.clear();
    }

    pub(crate) fn count(&self) -> usize {
        self.0.len()
    }

    /// On so many: what is known of the first of them, and nothing yet on others.
    pub(crate) fn begin(&mut self, count: usize, known: &Self) {
        self.0.clear();
        self.0.extend_from_slice(&known.0);
        self.0.resize(count, [0.0; 8]);
    }

    /// Fetches some from memory.
    #[inline(always)]
    pub(crate) fn prefetch(&self, range: Range<usize>) {
        prefetch::to_l2(&self.0[range]);
    }

    /// Takes in [`WIDTH`] more, from lanes.
    #[inline(always)]
    pub(crate) fn push<S: LaneOps>(&mut self, simd: S, loads: &PairLoads) {
        let ([x, y, z], [p, q, r]) = (&loads.force, &loads.torque);
        let force = simd.to_quads([x, y, z, &Lanes::ZERO]);
        let torque = simd.to_quads([p, q, r, &Lanes::ZERO]);
        self.0.extend_from_slice(&simd.join_octets([&force, &torque]));
    }
}

/// Adds what pairs of a body with itself do to both of their two.
pub(crate) struct AddToBoth<'a> {
    pub(crate) sums: &'a mut LoadArray,
    pub(crate) loads: &'a LoadList,
}

impl SimdTask for AddToBoth<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: LaneOps>(self, simd: S) {
        let Self { sums: LoadArray(sums), loads: LoadList { loads, slots } } = self;
        for (&[i, j], load) in slots.iter().zip(&loads.0) {
            let (i, j) = (i as usize, j as usize);
            sums[i] = simd.add8(&sums[i], load);
            sums[j] = simd.subtract_add8(&sums[j], load);
        }
    }
}

/// Adds what some pairs do to one of their two: to the firsts, or else to the seconds.
struct AddToSide<'a, const SIDE: usize> {
    sums: &'a mut LoadArray,
    loads: &'a LoadList,
    pairs: Range<usize>,
}

impl<const SIDE: usize> SimdTask for AddToSide<'_, SIDE> {
    type Output = ();

    #[inline(always)]
    fn run<S: LaneOps>(self, simd: S) {
        let Self { sums: LoadArray(sums), loads: LoadList { loads, slots }, pairs } = self;
        for (slot, load) in slots[pairs.clone()].iter().zip(&loads.0[pairs]) {
            let sum = &mut sums[slot[SIDE] as usize];
            *sum = if SIDE == 0 { simd.add8(sum, load) } else { simd.subtract_add8(sum, load) };
        }
    }
}

impl LoadSums {
    /// What is known, for so many blocks, and nothing else yet.
    pub(crate) fn begin(&mut self, blocks: usize, known: &LoadArray) {
        self.single.begin(blocks * WIDTH, known);
        self.blocks.clear();
        self.blocks.resize(blocks, LoadBlock { force: [Lanes::ZERO; 3], torque: [Lanes::ZERO; 3] });
    }

    /// Adds what acts on the firsts of all pairs.
    #[inline(always)]
    pub(crate) fn add_to_firsts<S: LaneOps>(&mut self, simd: S, loads: &LoadList) {
        let pairs = 0..loads.slots.len();
        run_outlined(simd, AddToSide::<0> { sums: &mut self.single, loads, pairs });
    }

    /// Adds what acts on the seconds of some pairs.
    #[inline(always)]
    pub(crate) fn add_to_seconds<S: LaneOps>(&mut self, simd: S, loads: &LoadList, pairs: Range<usize>) {
        run_outlined(simd, AddToSide::<1> { sums: &mut self.single, loads, pairs });
    }

    /// Adds what acts on the sub-particle at a slot.
    #[inline(always)]
    pub(crate) fn add(&mut self, slot: u32, load: &Load) {
        let [x, y, z] = load.force.to_array();
        let [p, q, r] = load.torque.to_array();
        for (sum, load) in self.single.0[slot as usize].iter_mut().zip([x, y, z, 0.0, p, q, r, 0.0]) {
            *sum += load;
        }
    }

    /// All that acts on a block.
    #[inline(always)]
    pub(crate) fn of_block<S: LaneOps>(&self, simd: S, b: usize) -> LoadBlock {
        let mut all = self.blocks[b];
        let [forces, torques] = simd.split_octets(octets(&self.single.0, b));
        let (force, torque) = (simd.to_lanes(&forces), simd.to_lanes(&torques));
        for axis in 0..3 {
            for k in 0..WIDTH {
                all.force[axis].0[k] += force[axis].0[k];
                all.torque[axis].0[k] += torque[axis].0[k];
            }
        }
        all
    }
}
