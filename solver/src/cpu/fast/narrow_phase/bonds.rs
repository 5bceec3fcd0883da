//! Forces of the bonds of a body, and the contacts between bonded sub-particles.

use super::kernels;
use crate::cpu::fast::instructions::arrays::{Lanes, Lanes3, WIDTH};
use crate::cpu::fast::instructions::set::{LaneOps, SimdTask};
use crate::cpu::fast::storage::bond_set::{BondMoments, BondSet};
use crate::cpu::fast::storage::laws::PairLaws;
use crate::cpu::fast::storage::loads::LoadSums;
use crate::cpu::fast::storage::pair_lanes::{
    BondHistoryMut, ContactHistoryMut, MomentLanes, PairKinematics, PairLoads,
};
use crate::cpu::fast::storage::particles::ParticleBlock;
use crate::engine::frame::Frame;

impl BondSet {
    fn history_mut(&mut self) -> BondHistoryMut<'_> {
        let Self { rest, exists, intact, stored, in_contact, xi, .. } = self;
        BondHistoryMut {
            rest: *rest,
            exists: *exists,
            intact,
            stored,
            contacts: ContactHistoryMut { in_contact, xi },
        }
    }

    /// Kinematics of the pairs.
    #[inline(always)]
    fn kinematics<S: LaneOps>(&self, simd: S, frame: &Frame, blocks: &[ParticleBlock]) -> PairKinematics {
        let (me, at) = (&blocks[self.block as usize], &simd.widen(&self.at));
        let others = self.window.map(|block| &blocks[block as usize]);
        let mut kinematics = PairKinematics::ZERO;
        for axis in 0..3 {
            let mut position = simd.permute_ints(others.map(|block| &block.position[axis]), at);
            let velocity = simd.permute(others.map(|block| &block.velocity[axis]), at);
            let spin = simd.permute(others.map(|block| &block.spin[axis]), at);
            for k in 0..WIDTH {
                position.0[k] = position.0[k].wrapping_sub(me.position[axis].0[k]);
            }
            if axis == 1 && frame.period_y != 0 {
                position.0.iter_mut().for_each(|y| *y = frame.nearest_image(*y));
            }
            for k in 0..WIDTH {
                kinematics.offset[axis].0[k] = position.0[k] as f32 * frame.unit_m;
                kinematics.velocity[axis].0[k] = velocity.0[k] - me.velocity[axis].0[k];
                kinematics.spin[axis].0[k] = spin.0[k] + me.spin[axis].0[k];
            }
        }
        kinematics
    }

    /// ω_j − ω_i of the pairs, in rad/s.
    #[inline(always)]
    fn turn<S: LaneOps>(&self, simd: S, blocks: &[ParticleBlock]) -> Lanes3 {
        let (me, at) = (&blocks[self.block as usize], &simd.widen(&self.at));
        let others = self.window.map(|block| &blocks[block as usize]);
        let mut turn = [Lanes::ZERO; 3];
        for axis in 0..3 {
            let spin = simd.permute(others.map(|block| &block.spin[axis]), at);
            for k in 0..WIDTH {
                turn[axis].0[k] = spin.0[k] - me.spin[axis].0[k];
            }
        }
        turn
    }

    /// Adds moments on one side, and their opposites on the other.
    #[inline(always)]
    fn add_moments<S: LaneOps>(&self, simd: S, moments: &Lanes3, sums: &mut LoadSums) {
        let mine = &mut sums.blocks[self.block as usize];
        for axis in 0..3 {
            for k in 0..WIDTH {
                mine.torque[axis].0[k] += moments[axis].0[k];
            }
        }
        for half in 0..2 {
            if self.bonded[half] == 0 {
                continue;
            }
            let theirs = &mut sums.blocks[self.window[half] as usize];
            let back = simd.unpack(self.back[half]);
            for axis in 0..3 {
                let moment = simd.masked_permute(&moments[axis], &back, self.bonded[half]);
                for k in 0..WIDTH {
                    theirs.torque[axis].0[k] -= moment.0[k];
                }
            }
        }
    }

    /// Adds the loads of both sides.
    #[inline(always)]
    fn add<S: LaneOps>(&self, simd: S, loads: &PairLoads, sums: &mut LoadSums) {
        let mine = &mut sums.blocks[self.block as usize];
        for axis in 0..3 {
            for k in 0..WIDTH {
                mine.force[axis].0[k] += loads.force[axis].0[k];
                mine.torque[axis].0[k] += loads.torque[axis].0[k];
            }
        }
        for half in 0..2 {
            if self.bonded[half] == 0 {
                continue;
            }
            let theirs = &mut sums.blocks[self.window[half] as usize];
            let back = simd.unpack(self.back[half]);
            for axis in 0..3 {
                let force = simd.masked_permute(&loads.force[axis], &back, self.bonded[half]);
                let torque = simd.masked_permute(&loads.torque[axis], &back, self.bonded[half]);
                for k in 0..WIDTH {
                    theirs.force[axis].0[k] -= force.0[k];
                    theirs.torque[axis].0[k] += torque.0[k];
                }
            }
        }
    }

    /// Appends the lower sub-particles of these lanes to `broken`.
    #[cold]
    fn record_broken(&self, lanes: u16, broken: &mut Vec<u32>) {
        let these = (0..WIDTH as u32).filter(|lane| lanes >> lane & 1 == 1);
        broken.extend(these.map(|lane| self.block * WIDTH as u32 + lane));
    }
}

/// Adds the loads of the bonds of two sets, with their moments if they carry any, and of the contacts of their pairs.
///
/// Returns the maximum overlap of pairs with a broken bond, in metres. The lower sub-particles of bonds that
/// break now go into `broken`.
#[inline(always)]
#[expect(clippy::too_many_arguments, reason = "the data of a body and its scratch memory")]
pub(crate) fn forces<S: LaneOps>(
    [one, two]: [&mut BondSet; 2],
    moments: Option<[&mut BondMoments; 2]>,
    simd: S,
    laws: &PairLaws,
    sqrt_m_star: f32,
    frame: &Frame,
    blocks: &[ParticleBlock],
    sums: &mut LoadSums,
    broken: &mut Vec<u32>,
) -> f32 {
    let kinematics = [one.kinematics(simd, frame, blocks), two.kinematics(simd, frame, blocks)];
    let mut pair_loads = [PairLoads::ZERO; 2];
    let before = [one.intact, two.intact];
    // A closure might not be inlined.
    let mut moments = match moments {
        Some([a, b]) => {
            let turns = [one.turn(simd, blocks), two.turn(simd, blocks)];
            Some([MomentLanes::new(turns[0], a), MomentLanes::new(turns[1], b)])
        }
        None => None,
    };
    let max_overlap = kernels::bonds(
        simd,
        laws,
        sqrt_m_star,
        &kinematics,
        &mut [one.history_mut(), two.history_mut()],
        laws.moment.as_ref().zip(moments.as_mut()),
        &mut pair_loads,
    );
    one.add(simd, &pair_loads[0], sums);
    two.add(simd, &pair_loads[1], sums);
    if let Some([a, b]) = &moments {
        one.add_moments(simd, &a.moment, sums);
        two.add_moments(simd, &b.moment, sums);
    }
    for (set, before) in [one, two].into_iter().zip(before) {
        let lanes = before & !set.intact;
        if lanes != 0 {
            set.record_broken(lanes, broken);
        }
    }
    max_overlap
}

/// [`forces`] of bonds with moments, in a function of its own: bonds without keep all registers.
pub(crate) struct ForcesWithMoments<'a> {
    pub(crate) sets: [&'a mut BondSet; 2],
    pub(crate) moments: [&'a mut BondMoments; 2],
    pub(crate) laws: &'a PairLaws,
    pub(crate) sqrt_m_star: f32,
    pub(crate) frame: &'a Frame,
    pub(crate) blocks: &'a [ParticleBlock],
    pub(crate) sums: &'a mut LoadSums,
    pub(crate) broken: &'a mut Vec<u32>,
}

impl SimdTask for ForcesWithMoments<'_> {
    type Output = f32;

    #[inline(always)]
    fn run<S: LaneOps>(self, simd: S) -> f32 {
        let Self { sets, moments, laws, sqrt_m_star, frame, blocks, sums, broken } = self;
        forces(sets, Some(moments), simd, laws, sqrt_m_star, frame, blocks, sums, broken)
    }
}
