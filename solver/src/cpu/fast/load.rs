//! LoadArray on their way from pairs to sub-particles, and what pairs pair_offsets like before.

use std::ops::Range;

use pulp::cast;

use super::instructions::{LaneOps, SimdTask, run_outlined};
use super::kernel::{ContactHistories, PairKinematics, PairLoads};
use super::memory::{Ints, Lanes, Lanes3, Quads, WIDTH, octets, transposed_lane};
use super::pairs::{LoadList, PairList};
use super::points::BodyParticles;
use super::prefetch;
use crate::cpu::load::Load;
use crate::engine::frame::Frame;

/// Pairs that go through the kernel together: two chunks, of whatever body_pairs, in order.
pub(super) const BATCH_SIZE: usize = 2 * WIDTH;

/// Those pairs, one after the other.
#[derive(Debug)]
pub(super) struct PairBatch {
    /// Their numbers in the list.
    pub(super) pairs: Vec<u32>,
    /// x_j − x_i, in units of length, as bits.
    offsets: [[f32; 4]; BATCH_SIZE],
    /// v_j − v_i and ω_i + ω_j.
    velocity: [[f32; 8]; BATCH_SIZE],
    memory: [[f32; 4]; BATCH_SIZE],
    /// √m* in kg^½.
    sqrt_m_star: [f32; BATCH_SIZE],
}

/// The same in lanes.
#[derive(Debug)]
pub(super) struct BatchLanes {
    pub(super) counts: [usize; 2],
    pub(super) kinematics: [PairKinematics; 2],
    pub(super) sqrt_m_star: [Lanes; 2],
    pub(super) memory: [ContactHistories; 2],
}

/// What acts on many sub-particles or pairs, one after the other: a force, 0, a torque, 0.
#[derive(Debug, Default)]
pub(super) struct LoadArray(Vec<[f32; 8]>);

/// LoadArray of a block of sub-particles.
#[derive(Clone, Copy, Debug)]
pub(super) struct LoadBlock {
    pub(super) force: Lanes3,
    pub(super) torque: Lanes3,
}

/// LoadSums of the loads of a body's sub-particles.
#[derive(Debug, Default)]
pub(super) struct LoadSums {
    /// What comes one at a time, by [`super::points::slot_of`].
    single: LoadArray,
    /// What comes in blocks.
    pub(super) blocks: Vec<LoadBlock>,
}

impl Default for PairBatch {
    fn default() -> Self {
        let quads = [[0.0; 4]; BATCH_SIZE];
        Self {
            pairs: Vec::with_capacity(BATCH_SIZE),
            offsets: quads,
            velocity: [[0.0; 8]; BATCH_SIZE],
            memory: quads,
            sqrt_m_star: [0.0; BATCH_SIZE],
        }
    }
}

impl PairBatch {
    /// All of them in lanes. Where there is no pair stands what was there before.
    #[inline(always)]
    pub(super) fn lanes<S: LaneOps>(&self, simd: S, frame: &Frame, step: u32) -> BatchLanes {
        let count = self.pairs.len();
        BatchLanes {
            counts: [count.min(WIDTH), count.saturating_sub(WIDTH)],
            kinematics: [self.kinematics(simd, 0, frame), self.kinematics(simd, 1, frame)],
            sqrt_m_star: [self.sqrt_m_star(0), self.sqrt_m_star(1)],
            memory: [self.contacts(simd, 0, step), self.contacts(simd, 1, step)],
        }
    }

    #[inline(always)]
    fn kinematics<S: LaneOps>(&self, simd: S, half: usize, frame: &Frame) -> PairKinematics {
        let mut offset = three(simd, &Quads::of(&self.offsets, half));
        for axis in &mut offset {
            for k in 0..WIDTH {
                axis.0[k] = axis.0[k].to_bits() as i32 as f32 * frame.unit_m;
            }
        }
        let [velocity, spin] = simd.split_octets(octets(&self.velocity, half));
        PairKinematics { offset, velocity: three(simd, &velocity), spin: three(simd, &spin) }
    }

    #[inline(always)]
    fn sqrt_m_star(&self, half: usize) -> Lanes {
        Lanes(std::array::from_fn(|lane| self.sqrt_m_star[half * WIDTH + transposed_lane(lane)]))
    }

    #[inline(always)]
    fn contacts<S: LaneOps>(&self, simd: S, half: usize, step: u32) -> ContactHistories {
        let [mut xi @ .., last] = simd.to_lanes(&Quads::of(&self.memory, half));
        let mut let_go = Lanes::ZERO;
        for k in 0..WIDTH {
            let_go.0[k] = if last.0[k].to_bits() == step - 1 { 0.0 } else { 1.0 };
        }
        let in_contact = simd.le_bits(&let_go, 0.0);
        // What has let go has forgotten, also where nobody has looked since.
        let remembers = simd.splat_masked(f32::from_bits(u32::MAX), in_contact);
        for axis in &mut xi {
            for k in 0..WIDTH {
                axis.0[k] = f32::from_bits(axis.0[k].to_bits() & remembers.0[k].to_bits());
            }
        }
        ContactHistories { in_contact, xi }
    }
}

impl ContactHistories {
    /// What to remember of them: ξ, and the step where the contact holds.
    #[inline(always)]
    pub(super) fn memory<S: LaneOps>(&self, simd: S, step: u32) -> Quads {
        let [x, y, z] = &self.xi;
        simd.to_quads([x, y, z, &simd.splat_masked(f32::from_bits(step), self.in_contact)])
    }
}

/// The first three numbers, in lanes.
#[inline(always)]
pub(super) fn three<S: LaneOps>(simd: S, quads: &Quads) -> Lanes3 {
    let [x, y, z, _] = simd.to_lanes(quads);
    [x, y, z]
}

/// Bits of whole numbers, in lanes.
#[inline(always)]
pub(super) fn ints<S: LaneOps>(simd: S, quads: &Quads) -> [Ints; 4] {
    let [x, y, z, r] = simd.to_lanes(quads);
    [Ints(cast(x.0)), Ints(cast(y.0)), Ints(cast(z.0)), Ints(cast(r.0))]
}

impl LoadArray {
    pub(super) fn clear(&mut self) {
        self.0.clear();
    }

    pub(super) fn count(&self) -> usize {
        self.0.len()
    }

    /// On so many: what is known of the first of them, and nothing yet on others.
    pub(super) fn begin(&mut self, count: usize, known: &Self) {
        self.0.clear();
        self.0.extend_from_slice(&known.0);
        self.0.resize(count, [0.0; 8]);
    }

    /// Fetches some from memory.
    #[inline(always)]
    pub(super) fn prefetch(&self, range: Range<usize>) {
        prefetch::to_l2(&self.0[range]);
    }

    /// Takes in [`WIDTH`] more, from lanes.
    #[inline(always)]
    pub(super) fn push<S: LaneOps>(&mut self, simd: S, loads: &PairLoads) {
        let ([x, y, z], [p, q, r]) = (&loads.force, &loads.torque);
        let force = simd.to_quads([x, y, z, &Lanes::ZERO]);
        let torque = simd.to_quads([p, q, r, &Lanes::ZERO]);
        self.0.extend_from_slice(&simd.join_octets([&force, &torque]));
    }
}

/// Puts as many of `close` into a batch, which are pairs of two bodies, as there is room for; tells how many.
pub(super) struct FillBatch<'a> {
    pub(super) batch: &'a mut PairBatch,
    pub(super) close: &'a [u32],
    pub(super) list: &'a PairList,
    /// Distances of all that are listed.
    pub(super) offsets: &'a [[i32; 4]],
    pub(super) sides: [&'a BodyParticles; 2],
    /// √m* in kg^½.
    pub(super) sqrt_m_star: f32,
}

impl SimdTask for FillBatch<'_> {
    type Output = usize;

    #[inline(always)]
    fn run<S: LaneOps>(self, simd: S) -> usize {
        let Self { batch, close, list, offsets, sides: [first, second], sqrt_m_star } = self;
        let from = batch.pairs.len();
        let close = &close[..close.len().min(BATCH_SIZE - from)];
        batch.pairs.extend_from_slice(close);
        batch.sqrt_m_star[from..from + close.len()].fill(sqrt_m_star);
        let distances = batch.offsets[from..].iter_mut();
        let distances = distances.zip(&mut batch.memory[from..]);
        let distances = distances.zip(&mut batch.velocity[from..]);
        let (slots, memories) = (&list.slots[..offsets.len()], &list.memory[..offsets.len()]);
        for (&pair, ((between, memory), velocity)) in close.iter().zip(distances) {
            let pair = pair as usize;
            *between = offsets[pair].map(|d| f32::from_bits(d as u32));
            *memory = memories[pair];
            let [i, j] = slots[pair];
            let (mine, theirs) = (&first.velocities[i as usize], &second.velocities[j as usize]);
            *velocity = simd.subtract_add8(theirs, mine);
        }
        close.len()
    }
}

/// Adds what pairs of a body with itself do to both of their two.
pub(super) struct AddToBoth<'a> {
    pub(super) sums: &'a mut LoadArray,
    pub(super) loads: &'a LoadList,
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
    pub(super) fn begin(&mut self, blocks: usize, known: &LoadArray) {
        self.single.begin(blocks * WIDTH, known);
        self.blocks.clear();
        self.blocks.resize(blocks, LoadBlock { force: [Lanes::ZERO; 3], torque: [Lanes::ZERO; 3] });
    }

    /// Adds what acts on the firsts of all pairs.
    #[inline(always)]
    pub(super) fn add_to_firsts<S: LaneOps>(&mut self, simd: S, loads: &LoadList) {
        let pairs = 0..loads.slots.len();
        run_outlined(simd, AddToSide::<0> { sums: &mut self.single, loads, pairs });
    }

    /// Adds what acts on the seconds of some pairs.
    #[inline(always)]
    pub(super) fn add_to_seconds<S: LaneOps>(&mut self, simd: S, loads: &LoadList, pairs: Range<usize>) {
        run_outlined(simd, AddToSide::<1> { sums: &mut self.single, loads, pairs });
    }

    /// Adds what acts on the sub-particle at a slot.
    #[inline(always)]
    pub(super) fn add(&mut self, slot: u32, load: &Load) {
        let [x, y, z] = load.force.to_array();
        let [p, q, r] = load.torque.to_array();
        for (sum, load) in self.single.0[slot as usize].iter_mut().zip([x, y, z, 0.0, p, q, r, 0.0]) {
            *sum += load;
        }
    }

    /// All that acts on a block.
    #[inline(always)]
    pub(super) fn of_block<S: LaneOps>(&self, simd: S, b: usize) -> LoadBlock {
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
