//! Twin of `physics/moment.rs`, which states the equations: moments of bonds, in lanes.

use super::friction;
use super::pair::PairLanes;
use crate::cpu::fast::instructions::lanes::{F, F3, Mask};
use crate::cpu::fast::instructions::set::LaneOps;
use crate::cpu::fast::storage::pair_lanes::MomentLanes;
use crate::physics::damping::{self, MOMENT_CAP};
use crate::physics::moment::MomentLaw;

/// Moments of a register of bonds.
pub(crate) struct BondMoment<S: LaneOps> {
    bending: F3<S>,
    twist: F<S>,
    /// Moment on i, dashpots included.
    moment: F3<S>,
}

impl<S: LaneOps> BondMoment<S> {
    /// Moments after this step. They are not stored yet.
    #[inline(always)]
    pub(crate) fn new(
        simd: S,
        law: &MomentLaw,
        m_star: f32,
        dt: f32,
        pairs: &PairLanes<S>,
        [one, two]: &[MomentLanes<'_>; 2],
        part: usize,
    ) -> Self {
        let splat = |value| F::splat(simd, value);
        let turn = F3::load(simd, [&one.turn, &two.turn], part);
        let rate = turn.dot(pairs.n);
        let across = pairs.n.neg_mul_add(rate, turn);
        let bending = F3::load(simd, [&one.history.bending, &two.history.bending], part);
        let turned = friction::rotated_history(simd, pairs, bending);
        let twist = F::load(simd, [&one.history.twist, &two.history.twist], part);
        let bending = across.mul_add(splat(law.k_b * dt), turned);
        let twist = rate.mul_add(splat(law.k_w * dt), twist);
        let inertia = law.inertia * m_star;
        let eta_b = splat(damping::constant(law.damping, law.k_b, inertia, MOMENT_CAP, dt));
        let eta_w = splat(damping::constant(law.damping, law.k_w, inertia, MOMENT_CAP, dt));
        let along = rate.mul_add(eta_w, twist);
        Self { bending, twist, moment: pairs.n.mul_add(along, across.mul_add(eta_b, bending)) }
    }

    /// The parts of the normal and the shear strength that the moments use up, in newton.
    #[inline(always)]
    pub(crate) fn rim(&self, simd: S, law: &MomentLaw) -> [F<S>; 2] {
        let bending = self.bending.dot(self.bending).sqrt();
        [bending * F::splat(simd, 2.0 * law.rim), self.twist.abs() * F::splat(simd, law.rim)]
    }

    /// Stores history and moment of the bonds that act; the others have none.
    #[inline(always)]
    pub(crate) fn store(self, simd: S, acts: Mask<S>, [one, two]: &mut [MomentLanes<'_>; 2], part: usize) {
        let Self { bending, twist, moment } = self;
        let none = F3::zero(simd);
        acts.select3(moment, none).store([&mut one.moment, &mut two.moment], part);
        acts.select3(bending, none).store([&mut one.history.bending, &mut two.history.bending], part);
        let twist = acts.select(twist, F::splat(simd, 0.0));
        twist.store([&mut one.history.twist, &mut two.history.twist], part);
    }
}
