//! Batches of close pairs, gathered one after the other and transposed into lanes.

use crate::cpu::fast::instructions::arrays::{Lanes, Quads, WIDTH, octets, transposed_lane};
use crate::cpu::fast::instructions::set::{LaneOps, SimdTask};
use crate::cpu::fast::instructions::transpose::three;
use crate::cpu::fast::storage::pair_lanes::{ContactHistories, PairKinematics};
use crate::cpu::fast::storage::pairs::PairList;
use crate::cpu::fast::storage::particles::BodyParticles;
use crate::engine::frame::Frame;

/// Number of pairs per kernel call: two chunks, of any body pairs, in order.
pub(crate) const BATCH_SIZE: usize = 2 * WIDTH;

/// A batch of pairs, element after element.
#[derive(Debug)]
pub(crate) struct PairBatch {
    /// Indices in the list.
    pub(crate) pairs: Vec<u32>,
    /// x_j − x_i, in units of length, as bits.
    pub(crate) offsets: [[f32; 4]; BATCH_SIZE],
    /// v_j − v_i and ω_i + ω_j.
    pub(crate) velocity: [[f32; 8]; BATCH_SIZE],
    pub(crate) histories: [[f32; 4]; BATCH_SIZE],
    /// √m* in kg^½.
    pub(crate) sqrt_m_star: [f32; BATCH_SIZE],
}

/// A batch in lanes.
#[derive(Debug)]
pub(crate) struct BatchLanes {
    pub(crate) counts: [usize; 2],
    pub(crate) kinematics: [PairKinematics; 2],
    pub(crate) sqrt_m_star: [Lanes; 2],
    pub(crate) histories: [ContactHistories; 2],
}

impl Default for PairBatch {
    fn default() -> Self {
        let quads = [[0.0; 4]; BATCH_SIZE];
        Self {
            pairs: Vec::with_capacity(BATCH_SIZE),
            offsets: quads,
            velocity: [[0.0; 8]; BATCH_SIZE],
            histories: quads,
            sqrt_m_star: [0.0; BATCH_SIZE],
        }
    }
}

impl PairBatch {
    /// Transposes the batch. Lanes without a pair hold old values.
    #[inline(always)]
    pub(crate) fn lanes<S: LaneOps>(&self, simd: S, frame: &Frame, step: u32) -> BatchLanes {
        let count = self.pairs.len();
        BatchLanes {
            counts: [count.min(WIDTH), count.saturating_sub(WIDTH)],
            kinematics: [self.kinematics(simd, 0, frame), self.kinematics(simd, 1, frame)],
            sqrt_m_star: [self.sqrt_m_star(0), self.sqrt_m_star(1)],
            histories: [self.contacts(simd, 0, step), self.contacts(simd, 1, step)],
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
        let [mut xi @ .., last] = simd.to_lanes(&Quads::of(&self.histories, half));
        let mut let_go = Lanes::ZERO;
        for k in 0..WIDTH {
            let_go.0[k] = if last.0[k].to_bits() == step - 1 { 0.0 } else { 1.0 };
        }
        let in_contact = simd.le_bits(&let_go, 0.0);
        // A contact that has opened has no history, even if it was not evaluated since.
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
    /// Histories to store: ξ, and the number of the step for contacts that hold.
    #[inline(always)]
    pub(crate) fn to_stored<S: LaneOps>(&self, simd: S, step: u32) -> Quads {
        let [x, y, z] = &self.xi;
        simd.to_quads([x, y, z, &simd.splat_masked(f32::from_bits(step), self.in_contact)])
    }
}

/// Appends pairs of two bodies from `close` to a batch, up to its capacity. Returns their number.
pub(crate) struct FillBatch<'a> {
    pub(crate) batch: &'a mut PairBatch,
    pub(crate) close: &'a [u32],
    pub(crate) list: &'a PairList,
    /// Offsets of all listed pairs.
    pub(crate) offsets: &'a [[i32; 4]],
    pub(crate) sides: [&'a BodyParticles; 2],
    /// √m* in kg^½.
    pub(crate) sqrt_m_star: f32,
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
        let distances = distances.zip(&mut batch.histories[from..]);
        let distances = distances.zip(&mut batch.velocity[from..]);
        let (slots, stored) = (&list.slots[..offsets.len()], &list.histories[..offsets.len()]);
        for (&pair, ((between, histories), velocity)) in close.iter().zip(distances) {
            let pair = pair as usize;
            *between = offsets[pair].map(|d| f32::from_bits(d as u32));
            *histories = stored[pair];
            let [i, j] = slots[pair];
            let (mine, theirs) = (&first.velocities[i as usize], &second.velocities[j as usize]);
            *velocity = simd.subtract_add8(theirs, mine);
        }
        close.len()
    }
}
