//! Twin of `physics/bond.rs`, which states the equations: the bond force, in lanes.

use super::friction;
use super::pair::PairLanes;
use crate::cpu::fast::instructions::lanes::{F, F3, Mask};
use crate::cpu::fast::instructions::set::LaneOps;
use crate::cpu::fast::storage::laws::PairLaws;
use crate::cpu::fast::storage::pair_lanes::BondHistoryMut;
use crate::physics::bond::{BondModel, STRETCH_CLAMP};

/// The tangential velocity at the bond half a step ago, in m/s; `u_t` in m/s.
#[inline(always)]
fn mid_step<S: LaneOps>(simd: S, pairs: &PairLanes<S>, u_t: F3<S>, dt: f32) -> F3<S> {
    let splat = |value| F::splat(simd, value);
    let PairLanes { n, inverse_length, v_n, v_t, twist, .. } = *pairs;
    // Stretch of half a step, over the length.
    let strain = v_n * splat(0.5 * dt) * inverse_length;
    let along = (u_t + (u_t - v_t)).mul_add(strain, v_t);
    (n * (twist * splat(0.5))).cross_add(u_t + v_t, along)
}

/// Pull along n, the force across it, and the bonds that hold. `u` is the velocity of j relative to i in m/s. A bond that breaks
/// is no longer intact. `rim` is what moments use up of the normal and the shear strength.
#[inline(always)]
pub(crate) fn force<S: LaneOps>(
    simd: S,
    laws: &PairLaws,
    pairs: &PairLanes<S>,
    u: F3<S>,
    [one, two]: [&mut BondHistoryMut<'_>; 2],
    rim: Option<[F<S>; 2]>,
    part: usize,
) -> (F<S>, F3<S>, Mask<S>) {
    let law = &laws.bond;
    let splat = |value| F::splat(simd, value);
    let PairLanes { n, length, v_n, v_t, .. } = *pairs;
    let stored = F3::load(simd, [one.stored, two.stored], part);
    let (pull, shear, stored) = if law.model == BondModel::AsPublished {
        let rate = n.mul_add(splat(law.k_n) * v_n, v_t * splat(law.k_t));
        let stored = rate.mul_add(splat(laws.dt), stored);
        let pull = stored.dot(n);
        (pull, n.neg_mul_add(pull, stored), stored)
    } else {
        let shear_rate = mid_step(simd, pairs, n.neg_mul_add(v_n, u), laws.dt);
        let shear =
            shear_rate.mul_add(splat(law.k_t * laws.dt), friction::rotated_history(simd, pairs, stored));
        let e = length - F::splat_each(simd, [one.rest, two.rest]);
        let pull = splat(law.k_n) * e;
        let pull = if law.model == BondModel::FiniteExtension {
            let span = [one.rest, two.rest].map(|rest| 1.0 / (law.break_length - rest));
            let share = (e * F::splat_each(simd, span)).min(splat(STRETCH_CLAMP));
            let share = share.max(splat(0.0));
            pull / (splat(1.0) - share * share)
        } else {
            pull
        };
        (pull, shear, shear)
    };
    let mut yields = splat(law.break_length).lt(length);
    if law.can_yield() {
        let (mut normal, mut across) = (splat(law.normal_strength), splat(law.shear_strength));
        if let Some([rim_n, rim_t]) = rim {
            (normal, across) = (normal - rim_n, across - rim_t);
        }
        yields = yields | normal.lt(pull) | (across * across.abs()).lt(shear.dot(shear));
    }
    let bonded = Mask::from_bits(simd, [*one.intact, *two.intact], part);
    let acts = bonded.and_not(yields);
    acts.store([one.intact, two.intact], part);
    let none = F3::zero(simd);
    acts.select3(stored, none).store([one.stored, two.stored], part);
    (acts.select(pull, splat(0.0)), acts.select3(shear, none), acts)
}
