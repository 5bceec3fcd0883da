//! Twin of `physics/contact.rs`, which states the equations: the contact force, in lanes.
//!
//! Branches become selections.

use pulp::Simd;

use super::pair::PairLanes;
use super::{friction, hertz, jkr};
use crate::cpu::fast::instructions::lanes::{F, F3, Mask};
use crate::cpu::fast::instructions::set::LaneOps;
use crate::cpu::fast::storage::laws::LaneContactLaw;
use crate::cpu::fast::storage::pair_lanes::ContactHistoryMut;
use crate::physics::damping::DampingCap;

/// Parameters of the contacts in a register.
#[derive(Clone, Copy)]
pub(crate) struct ContactParams<'a, S: Simd> {
    pub(crate) law: &'a LaneContactLaw,
    /// Distance at first contact, in metres.
    pub(crate) contact_distance: f32,
    pub(crate) dt: f32,
    /// √m*, in kg^½.
    pub(crate) sqrt_m_star: F<S>,
    /// Caps of the dashpots along n and across it, in kg/s.
    pub(crate) max_eta_n: F<S>,
    pub(crate) max_eta_t: F<S>,
}

impl<'a, S: Simd> ContactParams<'a, S> {
    #[inline(always)]
    pub(crate) fn new(
        simd: S,
        law: &'a LaneContactLaw,
        contact_distance: f32,
        cap: DampingCap,
        dt: f32,
        sqrt_m_star: F<S>,
    ) -> Self {
        let m_star = sqrt_m_star * sqrt_m_star;
        let max_eta_n = m_star * F::splat(simd, cap.normal / dt);
        let max_eta_t = m_star * F::splat(simd, cap.tangential / dt);
        Self { law, contact_distance, dt, sqrt_m_star, max_eta_n, max_eta_t }
    }
}

/// Push on i against n, force across n, and overlap (0 without contact).
#[inline(always)]
pub(crate) fn force<S: LaneOps>(
    simd: S,
    params: &ContactParams<'_, S>,
    pairs: &PairLanes<S>,
    touches: Mask<S>,
    [one, two]: [&mut ContactHistoryMut<'_>; 2],
    part: usize,
) -> (F<S>, F3<S>, F<S>) {
    let LaneContactLaw { law, damping_n, damping_t, snap_overlap } = params.law;
    let splat = |value| F::splat(simd, value);
    let (zero, none) = (splat(0.0), F3::zero(simd));
    // Velocities are those of j relative to i, and so of opposite sign to the plain path.
    let PairLanes { v_n, v_t, .. } = *pairs;
    let delta = splat(params.contact_distance) - pairs.length;
    // A contact forms at zero overlap and holds down to the snap overlap.
    let limit =
        Mask::from_bits(simd, [*one.in_contact, *two.in_contact], part).select(splat(*snap_overlap), zero);
    let holds = touches & limit.le(delta);
    holds.store([one.in_contact, two.in_contact], part);
    if !holds.any() {
        none.store([one.xi, two.xi], part);
        return (zero, none, zero);
    }
    let (elastic, a, root_a) = match &law.jkr {
        Some(scale) => jkr::force(simd, scale, delta, holds),
        None => hertz::force(simd, law.e_star, law.r_star, delta, holds),
    };
    let damp = params.sqrt_m_star * root_a;
    let eta_n = (splat(*damping_n) * damp).min(params.max_eta_n);
    let eta_t = (splat(*damping_t) * damp).min(params.max_eta_t);
    let total = eta_n.neg_mul_add(v_n, elastic);
    let k_t = splat(8.0 * law.g_star) * a;
    let old = F3::load(simd, [one.xi, two.xi], part);
    let old = friction::rotated_history(simd, pairs, old);
    let mut xi = v_t.neg_mul_add(splat(params.dt), old);
    let cap = splat(law.mu) * total.max(zero);
    let force = friction::force(simd, &mut xi, v_t, k_t, eta_t, cap);
    // A contact without area holds no tangential displacement.
    zero.lt(a).select3(xi, none).store([one.xi, two.xi], part);
    (total, force, holds.select(delta, zero))
}
