//! Twin of `physics/friction.rs`, which states the equation: friction and the rotation of a history, in lanes.

use pulp::Simd;

use super::pair::PairLanes;
use crate::cpu::fast::instructions::lanes::{F, F3};

/// Squared length below which a history has no direction.
const NO_LENGTH2: f32 = 1e-30;

/// Relative change of the squared length up to which a first-order root suffices.
const MUCH_LONGER: f32 = 1e-4;

/// Force on i in newton, with v_t and ξ of j relative to i. A lane that slips cuts ξ to the Coulomb cap.
#[inline(always)]
pub(crate) fn force<S: Simd>(
    simd: S,
    xi: &mut F3<S>,
    v_t: F3<S>,
    k_t: F<S>,
    eta_t: F<S>,
    cap: F<S>,
) -> F3<S> {
    let splat = |value| F::splat(simd, value);
    let dashpot = v_t * eta_t;
    let mut force = xi.neg_mul_add(k_t, dashpot);
    let size2 = force.dot(force);
    let slips = (cap * cap).lt(size2);
    if slips.any() {
        force = force * slips.select(cap / size2.sqrt(), splat(1.0));
        let slipped = (dashpot - force) * (splat(1.0) / k_t.max(splat(1e-30)));
        *xi = slips.select3(slipped, *xi);
    }
    force
}

/// A history rotated by the pairs' spin in this step.
#[inline(always)]
pub(crate) fn rotated_history<S: Simd>(simd: S, pairs: &PairLanes<S>, v: F3<S>) -> F3<S> {
    let n = pairs.n;
    let splat = |value| F::splat(simd, value);
    let twisted = (n * pairs.twist).cross_add(v, v);
    let flat = n.neg_mul_add(twisted.dot(n), twisted);
    let (before, after) = (v.dot(v), flat.dot(flat));
    // First order of √(before / after): a pair rotates very little in a step.
    let longer = (before - after) * after.approx_recip();
    let mut scale = longer.mul_add(splat(0.5), splat(1.0));
    let far = splat(MUCH_LONGER).lt(longer.abs());
    if far.any() {
        let least = splat(f32::MIN_POSITIVE);
        scale = far.select((before / after.max(least)).sqrt(), scale);
    }
    flat * after.le(splat(NO_LENGTH2)).select(splat(1.0), scale)
}
