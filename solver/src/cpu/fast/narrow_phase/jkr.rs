//! Twin of `physics/jkr.rs`, which states the equations: JKR contact, in lanes.

use pulp::Simd;

use crate::cpu::fast::instructions::lanes::{F, Mask};
use crate::physics::jkr::{D_SNAP, JkrScale, X_SNAP};

/// First guess of [`root`]: shift of the square root, and coefficients of the series.
const GUESS_SHIFT: f32 = 1.2;
const GUESS: [f32; 4] = [-0.595_899_9, 0.212_397_02, -0.163_381_2, 0.037_134_24];

/// Force, a and √a; 0 outside `holds`.
#[inline(always)]
pub(crate) fn force<S: Simd>(simd: S, scale: &JkrScale, delta: F<S>, holds: Mask<S>) -> (F<S>, F<S>, F<S>) {
    let splat = |value| F::splat(simd, value);
    let x = holds.select(root(simd, delta * splat(scale.inverse_overlap)), splat(0.0));
    let x2 = x * x;
    let x3 = x2 * x;
    let force = splat(scale.force) * x3 * (splat(4.0 / 3.0) * x3 - splat(2.0));
    (force, splat(scale.area) * x2, splat(scale.area.sqrt()) * x)
}

/// Largest root of x⁴ − x = D, with u² = D − D_c and w² = u + 1.2. The series x = w + a/w + b/w² + c/w³ +
/// d/w⁴ is within 2e-5 for every overlap, and within 2e-4 with approximate roots. One Newton step does the
/// rest.
#[inline(always)]
fn root<S: Simd>(simd: S, d: F<S>) -> F<S> {
    let splat = |value| F::splat(simd, value);
    let u2 = (d - splat(D_SNAP)).max(splat(1e-30));
    let w2 = u2.mul_add(u2.approx_rsqrt(), splat(GUESS_SHIFT));
    let r = w2.approx_rsqrt();
    let w = w2 * r;
    let [a, b, c, e] = GUESS.map(splat);
    let x = r.mul_add(r.mul_add(r.mul_add(r.mul_add(e, c), b), a), w);
    let x3 = x * x * x;
    // The slope vanishes at the snap, where the first guess must suffice.
    let slope = (splat(4.0) * x3 - splat(1.0)).max(splat(0.05));
    (x - x.mul_add(x3, -(x + d)) / slope).max(splat(X_SNAP))
}

#[cfg(test)]
mod tests {
    use pulp::Scalar;

    use super::*;
    use crate::cpu::fast::instructions::arrays::Lanes;

    /// Largest root of x⁴ − x = D, in f64.
    fn exact_root(d: f64) -> f64 {
        let mut x = 1.0 + (d.max(0.0)).powf(0.25);
        for _ in 0..200 {
            x -= (x.powi(4) - x - d) / (4.0 * x.powi(3) - 1.0).max(1e-9);
        }
        x
    }

    #[test]
    fn jkr_root_matches_the_exact_root_for_every_overlap() {
        let mut buffer = Lanes::ZERO;
        for k in 0..40_000 {
            // From just above the snap, densely, to overlaps a million times the snap overlap.
            let d = D_SNAP + 1e-4 * 10f32.powf(10.0 * k as f32 / 40_000.0);
            root(Scalar::new(), F::splat(Scalar::new(), d)).store([&mut buffer, &mut Lanes::ZERO.clone()], 0);
            let off = (f64::from(buffer.0[0]) / exact_root(f64::from(d)) - 1.0).abs();
            // Where the slope vanishes, a rounding error of D has more effect.
            let allowed = if d < D_SNAP + 1e-2 { 2e-5 } else { 5e-7 };
            assert!(off < allowed, "D = {d}: {off:e}");
        }
    }
}
