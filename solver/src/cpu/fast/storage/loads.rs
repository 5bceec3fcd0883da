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

/// Loads of many sub-particles or pairs, element after element: force, 0, torque, 0.
#[derive(Debug, Default)]
pub(crate) struct LoadArray(Vec<[f32; 8]>);

/// Loads of a block of sub-particles.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LoadBlock {
    pub(crate) force: Lanes3,
    pub(crate) torque: Lanes3,
}

/// Sums of the loads of a body's sub-particles.
#[derive(Debug, Default)]
pub(crate) struct LoadSums {
    /// Sum of single loads, by [`super::particles::slot_of`].
    single: LoadArray,
    /// Sum of the loads of whole blocks.
    pub(crate) blocks: Vec<LoadBlock>,
}

/// Loads on the first sub-particles of pairs. The opposite force and the same torque act on the second ones.
#[derive(Debug, Default)]
pub(crate) struct LoadList {
    pub(crate) loads: LoadArray,
    /// Slots of the first and of the second sub-particle.
    pub(crate) slots: Vec<[u32; 2]>,
}

impl LoadList {
    pub(crate) fn clear(&mut self) {
        self.loads.clear();
        self.slots.clear();
    }

    /// Drops the loads of lanes without a pair at the end, so that the next load follows the last pair.
    pub(crate) fn drop_padding(&mut self) {
        self.loads.0.truncate(self.slots.len());
    }

    /// Prefetches the loads of some pairs.
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

    /// Starts with known loads on the first elements, and none on the rest.
    pub(crate) fn begin(&mut self, count: usize, known: &Self) {
        self.0.clear();
        self.0.extend_from_slice(&known.0);
        self.0.resize(count, [0.0; 8]);
    }

    /// Prefetches some loads.
    #[inline(always)]
    pub(crate) fn prefetch(&self, range: Range<usize>) {
        prefetch::to_l2(&self.0[range]);
    }

    /// Appends the loads of [`WIDTH`] pairs.
    #[inline(always)]
    pub(crate) fn push<S: LaneOps>(&mut self, simd: S, loads: &PairLoads) {
        let ([x, y, z], [p, q, r]) = (&loads.force, &loads.torque);
        let force = simd.to_quads([x, y, z, &Lanes::ZERO]);
        let torque = simd.to_quads([p, q, r, &Lanes::ZERO]);
        self.0.extend_from_slice(&simd.join_octets([&force, &torque]));
    }
}

/// Adds loads within a body to both sub-particles of each pair.
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

/// Adds loads of pairs to one of their sub-particles: the first (`SIDE` 0) or the second.
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
    /// Starts with known loads, for a number of blocks.
    pub(crate) fn begin(&mut self, blocks: usize, known: &LoadArray) {
        self.single.begin(blocks * WIDTH, known);
        self.blocks.clear();
        self.blocks.resize(blocks, LoadBlock { force: [Lanes::ZERO; 3], torque: [Lanes::ZERO; 3] });
    }

    /// Adds the loads of all pairs to their first sub-particles.
    #[inline(always)]
    pub(crate) fn add_to_firsts<S: LaneOps>(&mut self, simd: S, loads: &LoadList) {
        let pairs = 0..loads.slots.len();
        run_outlined(simd, AddToSide::<0> { sums: &mut self.single, loads, pairs });
    }

    /// Adds the loads of some pairs to their second sub-particles.
    #[inline(always)]
    pub(crate) fn add_to_seconds<S: LaneOps>(&mut self, simd: S, loads: &LoadList, pairs: Range<usize>) {
        run_outlined(simd, AddToSide::<1> { sums: &mut self.single, loads, pairs });
    }

    /// Adds a load to the sub-particle at a slot.
    #[inline(always)]
    pub(crate) fn add(&mut self, slot: u32, load: &Load) {
        let [x, y, z] = load.force.to_array();
        let [p, q, r] = load.torque.to_array();
        for (sum, load) in self.single.0[slot as usize].iter_mut().zip([x, y, z, 0.0, p, q, r, 0.0]) {
            *sum += load;
        }
    }

    /// Total load of a block.
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
