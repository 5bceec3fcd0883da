//! Twin of `physics/hertz.rs`, which states the equation: Hertz contact, in lanes.

use pulp::Simd;

use crate::cpu::fast::instructions::lanes::{F, Mask};

/// Force in newton, contact radius a in metres and √a, for the lanes in `holds`; 0 elsewhere.
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
