//! The pair kernels: contacts between bodies, contacts with surfaces, and bonds, over all registers of two chunks.
//!
//! The tests hold every term to its plain twin within a few units in the last place.

use super::batch::BatchLanes;
use super::contact::ContactParams;
use super::moment::BondMoment;
use super::pair::PairLanes;
use super::{bond, contact};
use crate::cpu::fast::instructions::arrays::{Lanes, WIDTH};
use crate::cpu::fast::instructions::lanes::{F, F3, Mask};
use crate::cpu::fast::instructions::set::LaneOps;
use crate::cpu::fast::storage::laws::{LaneContactLaw, PairContactLaw, PairLaws};
use crate::cpu::fast::storage::pair_lanes::{
    BondHistoryMut, ContactHistories, MomentLanes, PairKinematics, PairLoads,
};
use crate::physics::damping::{BODY_CAP, BONDED_CAP, SURFACE_CAP};
use crate::physics::moment::MomentLaw;

/// Contacts of pairs without a bond, in two chunks of `counts` pairs, with √m* in kg^½. Returns the maximum
/// overlap, in metres.
#[inline(always)]
pub(crate) fn contacts<S: LaneOps>(
    simd: S,
    law: &PairContactLaw,
    dt: f32,
    BatchLanes { counts, kinematics, sqrt_m_star: [mass_a, mass_b], histories: [one, two] }: &mut BatchLanes,
    [a, b]: &mut [PairLoads; 2],
) -> f32 {
    let mut max_overlap = F::splat(simd, 0.0);
    let (mut one, mut two) = (one.as_mut(), two.as_mut());
    let counts = F::splat_each(simd, counts.map(|count| count as f32));
    for part in 0..WIDTH / S::F32_LANES {
        let exists = F::load(simd, [&Lanes::TRANSPOSED; 2], part).lt(counts);
        let pairs = PairLanes::new(simd, dt, kinematics, part);
        let sqrt_m_star = F::load(simd, [mass_a, mass_b], part);
        let params = ContactParams::new(simd, &law.law, law.distance, BODY_CAP, dt, sqrt_m_star);
        let (push, across, delta) = contact::force(simd, &params, &pairs, exists, [&mut one, &mut two], part);
        max_overlap = max_overlap.max(delta);
        pairs.n.neg_mul_add(push, across).store([&mut a.force, &mut b.force], part);
        pairs.arm.cross(across).store([&mut a.torque, &mut b.torque], part);
    }
    max_overlap.max_lane()
}

/// Contacts of sub-particles of mass `sqrt_m_star`² in kg with surfaces of one law; kinematics as in
/// [`PairLanes::at_surfaces`].
#[inline(always)]
#[expect(clippy::too_many_arguments, reason = "the data of a body and its scratch memory")]
pub(crate) fn surfaces<S: LaneOps>(
    simd: S,
    law: &LaneContactLaw,
    laws: &PairLaws,
    sqrt_m_star: f32,
    counts: [usize; 2],
    kinematics: &[PairKinematics; 2],
    [one, two]: &mut [ContactHistories; 2],
    [a, b]: &mut [PairLoads; 2],
) {
    let sqrt_m_star = F::splat(simd, sqrt_m_star);
    let params =
        ContactParams::new(simd, law, 0.5 * laws.contact.distance, SURFACE_CAP, laws.dt, sqrt_m_star);
    let counts = F::splat_each(simd, counts.map(|count| count as f32));
    let (mut one, mut two) = (one.as_mut(), two.as_mut());
    for part in 0..WIDTH / S::F32_LANES {
        let exists = F::load(simd, [&Lanes::TRANSPOSED; 2], part).lt(counts);
        let pairs = PairLanes::at_surfaces(simd, laws.dt, kinematics, part);
        let (push, across, _) = contact::force(simd, &params, &pairs, exists, [&mut one, &mut two], part);
        pairs.n.neg_mul_add(push, across).store([&mut a.force, &mut b.force], part);
        pairs.arm.cross(across).store([&mut a.torque, &mut b.torque], part);
    }
}

/// Bonds of two chunks, with their moments if they carry any, and contacts of the same pairs. Returns the maximum overlap of
/// pairs with a broken bond, in metres.
#[inline(always)]
pub(crate) fn bonds<S: LaneOps>(
    simd: S,
    laws: &PairLaws,
    sqrt_m_star: f32,
    kinematics: &[PairKinematics; 2],
    [one, two]: &mut [BondHistoryMut<'_>; 2],
    mut moments: Option<(&MomentLaw, &mut [MomentLanes<'_>; 2])>,
    [a, b]: &mut [PairLoads; 2],
) -> f32 {
    let zero = F::splat(simd, 0.0);
    let m_star = sqrt_m_star * sqrt_m_star;
    let sqrt_m_star = F::splat(simd, sqrt_m_star);
    let bonded_params =
        ContactParams::new(simd, &laws.contact.law, laws.contact.distance, BONDED_CAP, laws.dt, sqrt_m_star);
    let broken_params =
        ContactParams::new(simd, &laws.contact.law, laws.contact.distance, BODY_CAP, laws.dt, sqrt_m_star);
    let mut max_overlap = zero;
    let free = [one.exists & !*one.intact, two.exists & !*two.intact];
    let touch = if laws.contact_between_bonded { [one.exists, two.exists] } else { free };
    let any_touches = touch[0] | touch[1] != 0;
    let any_free = free[0] | free[1] != 0;
    for part in 0..WIDTH / S::F32_LANES {
        let pairs = PairLanes::new(simd, laws.dt, kinematics, part);
        let u = F3::load(simd, [&kinematics[0].velocity, &kinematics[1].velocity], part);
        // A closure might not be inlined.
        let (mut moment, mut rim) = (None, None);
        if let Some((law, lanes)) = &moments {
            let turned = BondMoment::new(simd, law, m_star, laws.dt, &pairs, lanes, part);
            if laws.bond.can_yield() {
                rim = Some(turned.rim(simd, law));
            }
            moment = Some(turned);
        }
        let (mut pull, mut across, acts) = bond::force(simd, laws, &pairs, u, [one, two], rim, part);
        if let (Some(moment), Some((_, lanes))) = (moment, &mut moments) {
            moment.store(simd, acts, lanes, part);
        }
        if any_touches {
            let touches = Mask::from_bits(simd, touch, part);
            let mut params = bonded_params;
            if any_free {
                let free = Mask::from_bits(simd, free, part);
                params.max_eta_n = free.select(broken_params.max_eta_n, bonded_params.max_eta_n);
                params.max_eta_t = free.select(broken_params.max_eta_t, bonded_params.max_eta_t);
            }
            let contacts = [&mut one.contacts, &mut two.contacts];
            let (push, tangential, delta) = contact::force(simd, &params, &pairs, touches, contacts, part);
            pull = pull - push;
            across += tangential;
            max_overlap = max_overlap.max(Mask::from_bits(simd, free, part).select(delta, zero));
        }
        pairs.n.mul_add(pull, across).store([&mut a.force, &mut b.force], part);
        pairs.arm.cross(across).store([&mut a.torque, &mut b.torque], part);
    }
    max_overlap.max_lane()
}
