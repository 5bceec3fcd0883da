//! Twin of `physics/hertz.rs`, which states the equation: Hertz contact, in lanes.

use pulp::Simd;

use crate::cpu::fast::instructions::lanes::{F, Mask};

/// Force in newton, radius a of the contact area in metres and √a, at the overlaps `delta` of the lanes in `holds`.
#[inline(always)]
pub(crate) fn force<S: Simd>(
    simd: S,
    e_star: f32,
    r_star: f32,
    delta: F<S>,
    holds: Mask<S>,
) -> (F<S>, F<S>, F<S>) {
    let splat = |value| F::splat(simd, value);
    let zero = splat(0.0);
    let delta = holds.select(delta.max(zero), zero);
    let a = (splat(r_star) * delta).sqrt();
    (splat(4.0 / 3.0 * e_star) * a * delta, a, a.sqrt())
}
