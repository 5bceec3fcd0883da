//! Loads on their way from pairs to sub-particles, and what pairs look like before.

use glam::Vec3;

use super::kernel::{Contacts, Felt, Seen};
use crate::cpu::forces::Load;
use crate::engine::frame::Frame;
use crate::engine::state::Particle;

/// Chunks of pairs that go through the kernels together: each is one long chain of dependent operations, and the
/// processor works on the next while it waits for the one before.
pub(super) const BATCH: usize = 8;

/// What is seen and felt of a batch.
#[derive(Debug)]
pub(super) struct Batch {
    pub(super) seen: [Seen; BATCH],
    pub(super) felt: [Felt; BATCH],
}

impl Default for Batch {
    fn default() -> Self {
        Self { seen: [Seen::NOTHING; BATCH], felt: [Felt::NOTHING; BATCH] }
    }
}

/// Force and torque on one sub-particle, in a form that is added in one instruction.
#[derive(Clone, Copy, Debug)]
#[repr(align(32))]
pub(super) struct Record([f32; 8]);

impl Record {
    pub(super) const ZERO: Self = Self([0.0; 8]);

    #[inline(always)]
    pub(super) fn new(load: &Load) -> Self {
        let ([fx, fy, fz], [tx, ty, tz]) = (load.force.to_array(), load.torque.to_array());
        Self([fx, fy, fz, tx, ty, tz, 0.0, 0.0])
    }

    /// Adds what acts on the first of a pair.
    #[inline(always)]
    pub(super) fn add(&mut self, other: &Self) {
        for (sum, part) in self.0.iter_mut().zip(other.0) {
            *sum += part;
        }
    }

    /// Adds what then acts on the second: the opposite force, the same torque.
    #[inline(always)]
    pub(super) fn add_opposite(&mut self, other: &Self) {
        const SIGN: [f32; 8] = [-1.0, -1.0, -1.0, 1.0, 1.0, 1.0, 1.0, 1.0];
        for ((sum, part), sign) in self.0.iter_mut().zip(other.0).zip(SIGN) {
            *sum += sign * part;
        }
    }

    #[inline(always)]
    pub(super) fn load(&self) -> Load {
        let [fx, fy, fz, tx, ty, tz, ..] = self.0;
        Load { force: Vec3::new(fx, fy, fz), torque: Vec3::new(tx, ty, tz) }
    }
}

impl Felt {
    /// What acts on the first of the pair in a lane.
    #[inline(always)]
    pub(super) fn record(&self, lane: usize) -> Record {
        let ([fx, fy, fz], [tx, ty, tz]) = (&self.force, &self.torque);
        Record([fx.0[lane], fy.0[lane], fz.0[lane], tx.0[lane], ty.0[lane], tz.0[lane], 0.0, 0.0])
    }
}

impl Seen {
    /// Looks at up to [`super::lanes::WIDTH`] pairs, from the first towards the second. Lanes without a pair keep what
    /// they had.
    #[inline(always)]
    pub(super) fn look(&mut self, [first, second]: [&[Particle]; 2], pairs: &[[u32; 2]], frame: &Frame) {
        for (lane, &[i, j]) in pairs.iter().enumerate() {
            let (p, q) = (&first[i as usize], &second[j as usize]);
            let apart = frame.between(p.position, q.position);
            let (velocity, spin) = (q.velocity - p.velocity, p.spin + q.spin);
            for (lanes, value) in
                [(&mut self.apart, apart), (&mut self.velocity, velocity), (&mut self.spin, spin)]
            {
                lanes[0].0[lane] = value.x;
                lanes[1].0[lane] = value.y;
                lanes[2].0[lane] = value.z;
            }
        }
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
