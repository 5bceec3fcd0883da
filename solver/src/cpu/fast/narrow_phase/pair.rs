//! Normal, distance and relative velocity of a register of pairs.

use pulp::Simd;

use crate::cpu::fast::instructions::lanes::{F, F3};
use crate::cpu::fast::storage::pair_lanes::PairKinematics;
use crate::physics::bond::NO_LENGTH_M;

/// A register of pairs.
pub(crate) struct PairLanes<S: Simd> {
    pub(crate) n: F3<S>,
    pub(crate) length: F<S>,
    /// 1/length. For length 0 the value is arbitrary.
    pub(crate) inverse_length: F<S>,
    pub(crate) arm: F3<S>,
    /// Velocity of j relative to i at the contact point: along n, and across it.
    pub(crate) v_n: F<S>,
    pub(crate) v_t: F3<S>,
    /// Rotation of the pair about n in this step, in radians.
    pub(crate) twist: F<S>,
}

impl<S: Simd> PairLanes<S> {
    #[inline(always)]
    pub(crate) fn new(simd: S, dt: f32, [a, b]: &[PairKinematics; 2], part: usize) -> Self {
        let d = F3::load(simd, [&a.offset, &b.offset], part);
        // Lattice neighbours start at a distance of 2R. The last digit decides whether they touch and should
        // match the plain path, so the square and its root are rounded as there.
        let length = d.length2_unfused().sqrt();
        let arm = d * F::splat(simd, 0.5);
        let spin = F3::load(simd, [&a.spin, &b.spin], part);
        let v = arm.cross_add(spin, F3::load(simd, [&a.velocity, &b.velocity], part));
        Self::from_contact(simd, d, length, arm, v, spin, 0.5 * dt)
    }

    /// Sub-particles at surfaces. `offset` leads to the nearest point, `velocity` is that of the surface
    /// there relative to the sub-particle, `spin` twice the spin of the surface.
    #[inline(always)]
    pub(crate) fn at_surfaces(simd: S, dt: f32, [a, b]: &[PairKinematics; 2], part: usize) -> Self {
        let arm = F3::load(simd, [&a.offset, &b.offset], part);
        let length = arm.length2_unfused().sqrt();
        let spin = F3::load(simd, [&a.spin, &b.spin], part);
        let v = F3::load(simd, [&a.velocity, &b.velocity], part);
        Self::from_contact(simd, arm, length, arm, v, spin, 0.5 * dt)
    }

    /// `d` leads from i to j, or to the surface, and has this length.
    #[inline(always)]
    fn from_contact(
        simd: S,
        d: F3<S>,
        length: F<S>,
        arm: F3<S>,
        v: F3<S>,
        spin: F3<S>,
        half_dt: f32,
    ) -> Self {
        let inverse_length = F::splat(simd, 1.0) / length.max(F::splat(simd, NO_LENGTH_M));
        // Coincident centres: d is zero, and so is n.
        let n = d * inverse_length;
        let v_n = v.dot(n);
        let twist = spin.dot(n) * F::splat(simd, half_dt);
        Self { n, length, inverse_length, arm, v_n, v_t: n.neg_mul_add(v_n, v), twist }
    }
}
