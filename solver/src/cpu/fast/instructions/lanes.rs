//! Arithmetic on lanes: numbers, vectors and masks over two registers of the instruction set.
//!
//! All operations round alike on every instruction set: `+ - * /`, roots, fused multiply-add, integer operations,
//! comparisons and selections. Results therefore carry the same bits on all sets. A set without a fused multiply-add
//! emulates it, at a cost. Kernels are generic over `pulp::Simd`.

use std::ops::{Add, AddAssign, BitAnd, BitOr, Div, Mul, Neg, Sub};

use glam::Vec3;
use pulp::Simd;

use super::arrays::{Lanes, Lanes3};
use super::set::LaneOps;

/// Numbers in the lanes of two registers. One register is a long chain of dependent operations; the second
/// one fills the latency.
#[derive(Clone, Copy)]
pub(crate) struct F<S: Simd>(S, [S::f32s; 2]);

/// Booleans in the lanes of two registers.
#[derive(Clone, Copy)]
pub(crate) struct Mask<S: Simd>(S, [S::m32s; 2]);

/// Vectors in the lanes of two registers.
#[derive(Clone, Copy)]
pub(crate) struct F3<S: Simd> {
    x: F<S>,
    y: F<S>,
    z: F<S>,
}

impl<S: Simd> F<S> {
    #[inline(always)]
    pub(crate) fn splat(simd: S, value: f32) -> Self {
        Self(simd, [simd.splat_f32s(value); 2])
    }

    /// One number for each of the two registers.
    #[inline(always)]
    pub(crate) fn splat_each(simd: S, values: [f32; 2]) -> Self {
        Self(simd, values.map(|value| simd.splat_f32s(value)))
    }

    /// The `part`th register of the lanes of two chunks.
    #[inline(always)]
    pub(crate) fn load(simd: S, [a, b]: [&Lanes; 2], part: usize) -> Self {
        Self(simd, [S::as_simd_f32s(&a.0).0[part], S::as_simd_f32s(&b.0).0[part]])
    }

    #[inline(always)]
    pub(crate) fn store(self, [a, b]: [&mut Lanes; 2], part: usize) {
        S::as_mut_simd_f32s(&mut a.0).0[part] = self.1[0];
        S::as_mut_simd_f32s(&mut b.0).0[part] = self.1[1];
    }

    #[inline(always)]
    fn map(self, of: impl Fn(S::f32s) -> S::f32s) -> Self {
        let [a, b] = self.1;
        Self(self.0, [of(a), of(b)])
    }

    #[inline(always)]
    fn zip(self, other: Self, of: impl Fn(S::f32s, S::f32s) -> S::f32s) -> Self {
        let ([a, b], [c, d]) = (self.1, other.1);
        Self(self.0, [of(a, c), of(b, d)])
    }

    #[inline(always)]
    fn compare(self, other: Self, of: impl Fn(S::f32s, S::f32s) -> S::m32s) -> Mask<S> {
        let ([a, b], [c, d]) = (self.1, other.1);
        Mask(self.0, [of(a, c), of(b, d)])
    }

    /// self · factor + term, rounded once.
    #[inline(always)]
    pub(crate) fn mul_add(self, factor: Self, term: Self) -> Self {
        let Self(simd, [a, b]) = self;
        let ([c, d], [e, f]) = (factor.1, term.1);
        Self(simd, [simd.mul_add_f32s(a, c, e), simd.mul_add_f32s(b, d, f)])
    }

    /// term − self · factor, rounded once.
    #[inline(always)]
    pub(crate) fn neg_mul_add(self, factor: Self, term: Self) -> Self {
        (-self).mul_add(factor, term)
    }

    /// Approximate 1/√x of a positive x, to 2e-4.
    #[inline(always)]
    pub(crate) fn approx_rsqrt(self) -> Self {
        let simd = self.0;
        let guess = self.map(|x| {
            let halved = simd.wrapping_dyn_shr_u32s(simd.transmute_u32s_f32s(x), simd.splat_u32s(1));
            simd.transmute_f32s_u32s(simd.sub_u32s(simd.splat_u32s(0x5f37_59df), halved))
        });
        // One third-order step from an error of 3 %, after the first guess from half the exponent.
        let h = (self * guess).neg_mul_add(guess, Self::splat(simd, 1.0));
        let step = Self::splat(simd, 0.375).mul_add(h, Self::splat(simd, 0.5));
        (guess * h).mul_add(step, guess)
    }

    /// Approximate 1/x of a positive x, to 2.5e-3.
    #[inline(always)]
    pub(crate) fn approx_recip(self) -> Self {
        let simd = self.0;
        let y = self.map(|x| {
            let guess = simd.sub_u32s(simd.splat_u32s(0x7ef3_11c7), simd.transmute_u32s_f32s(x));
            simd.transmute_f32s_u32s(guess)
        });
        let h = self.neg_mul_add(y, Self::splat(simd, 1.0));
        y.mul_add(h.mul_add(h, h), y)
    }

    /// √x, correctly rounded.
    #[inline(always)]
    pub(crate) fn sqrt(self) -> Self {
        self.map(|x| self.0.sqrt_f32s(x))
    }

    #[inline(always)]
    pub(crate) fn max(self, other: Self) -> Self {
        self.zip(other, |a, b| self.0.max_f32s(a, b))
    }

    #[inline(always)]
    pub(crate) fn min(self, other: Self) -> Self {
        self.zip(other, |a, b| self.0.min_f32s(a, b))
    }

    /// Absolute value.
    #[inline(always)]
    pub(crate) fn abs(self) -> Self {
        self.map(|x| self.0.abs_f32s(x))
    }

    /// Lanes with `self` ≤ `other`.
    #[inline(always)]
    pub(crate) fn le(self, other: Self) -> Mask<S> {
        self.compare(other, |a, b| self.0.less_than_or_equal_f32s(a, b))
    }

    /// Lanes with `self` < `other`.
    #[inline(always)]
    pub(crate) fn lt(self, other: Self) -> Mask<S> {
        self.compare(other, |a, b| self.0.less_than_f32s(a, b))
    }

    /// Maximum over the lanes.
    #[inline(always)]
    pub(crate) fn max_lane(self) -> f32 {
        let [a, b] = self.1;
        self.0.reduce_max_f32s(self.0.max_f32s(a, b))
    }
}

impl<S: LaneOps> Mask<S> {
    /// The `part`th register of masks of two chunks, from bits.
    #[inline(always)]
    pub(crate) fn from_bits(simd: S, [a, b]: [u16; 2], part: usize) -> Self {
        Self(simd, [simd.mask_from_bits(a, part), simd.mask_from_bits(b, part)])
    }

    /// Writes the bits of this register.
    #[inline(always)]
    pub(crate) fn store(self, [a, b]: [&mut u16; 2], part: usize) {
        let (first, all) = (part * S::F32_LANES, ((1u32 << S::F32_LANES) - 1) as u16);
        *a = *a & !(all << first) | self.0.mask_to_bits(self.1[0]) << first;
        *b = *b & !(all << first) | self.0.mask_to_bits(self.1[1]) << first;
    }
}

impl<S: Simd> Mask<S> {
    /// `yes` where the mask is set, else `no`.
    #[inline(always)]
    pub(crate) fn select(self, yes: F<S>, no: F<S>) -> F<S> {
        let Self(simd, [a, b]) = self;
        F(simd, [simd.select_f32s(a, yes.1[0], no.1[0]), simd.select_f32s(b, yes.1[1], no.1[1])])
    }

    /// `yes` where the mask is set, else `no`.
    #[inline(always)]
    pub(crate) fn select3(self, yes: F3<S>, no: F3<S>) -> F3<S> {
        F3 { x: self.select(yes.x, no.x), y: self.select(yes.y, no.y), z: self.select(yes.z, no.z) }
    }

    /// Lanes set here and not in the other mask.
    #[inline(always)]
    pub(crate) fn and_not(self, other: Self) -> Self {
        let Self(simd, [a, b]) = self;
        Self(simd, [simd.and_m32s(a, simd.not_m32s(other.1[0])), simd.and_m32s(b, simd.not_m32s(other.1[1]))])
    }

    /// Whether any lane is set.
    #[inline(always)]
    pub(crate) fn any(self) -> bool {
        let [a, b] = self.1;
        self.0.first_true_m32s(self.0.or_m32s(a, b)) < S::F32_LANES
    }
}

impl<S: Simd> F3<S> {
    #[inline(always)]
    pub(crate) fn zero(simd: S) -> Self {
        let zero = F::splat(simd, 0.0);
        Self { x: zero, y: zero, z: zero }
    }

    /// One vector in all lanes.
    #[inline(always)]
    pub(crate) fn splat(simd: S, v: Vec3) -> Self {
        Self { x: F::splat(simd, v.x), y: F::splat(simd, v.y), z: F::splat(simd, v.z) }
    }

    #[inline(always)]
    pub(crate) fn parts(self) -> [F<S>; 3] {
        [self.x, self.y, self.z]
    }

    #[inline(always)]
    pub(crate) fn load(simd: S, [a, b]: [&Lanes3; 2], part: usize) -> Self {
        let axis = |k: usize| F::load(simd, [&a[k], &b[k]], part);
        Self { x: axis(0), y: axis(1), z: axis(2) }
    }

    #[inline(always)]
    pub(crate) fn store(self, [a, b]: [&mut Lanes3; 2], part: usize) {
        self.x.store([&mut a[0], &mut b[0]], part);
        self.y.store([&mut a[1], &mut b[1]], part);
        self.z.store([&mut a[2], &mut b[2]], part);
    }

    /// self · factor + term.
    #[inline(always)]
    pub(crate) fn mul_add(self, factor: F<S>, term: Self) -> Self {
        Self {
            x: self.x.mul_add(factor, term.x),
            y: self.y.mul_add(factor, term.y),
            z: self.z.mul_add(factor, term.z),
        }
    }

    /// term − self · factor.
    #[inline(always)]
    pub(crate) fn neg_mul_add(self, factor: F<S>, term: Self) -> Self {
        self.mul_add(-factor, term)
    }

    /// Square of the length without fused operations, as scalar code computes it.
    #[inline(always)]
    pub(crate) fn length2_unfused(self) -> F<S> {
        self.dot_unfused(self)
    }

    /// Dot product without fused operations, as scalar code computes it.
    #[inline(always)]
    pub(crate) fn dot_unfused(self, other: Self) -> F<S> {
        self.x * other.x + self.y * other.y + self.z * other.z
    }

    /// Cross product without fused operations, as scalar code computes it.
    #[inline(always)]
    pub(crate) fn cross_unfused(self, other: Self) -> Self {
        Self {
            x: self.y * other.z - other.y * self.z,
            y: self.z * other.x - other.z * self.x,
            z: self.x * other.y - other.x * self.y,
        }
    }

    #[inline(always)]
    pub(crate) fn dot(self, other: Self) -> F<S> {
        self.z.mul_add(other.z, self.y.mul_add(other.y, self.x * other.x))
    }

    /// self × other + term.
    #[inline(always)]
    pub(crate) fn cross_add(self, other: Self, term: Self) -> Self {
        Self {
            x: other.y.neg_mul_add(self.z, self.y.mul_add(other.z, term.x)),
            y: other.z.neg_mul_add(self.x, self.z.mul_add(other.x, term.y)),
            z: other.x.neg_mul_add(self.y, self.x.mul_add(other.y, term.z)),
        }
    }

    #[inline(always)]
    pub(crate) fn cross(self, other: Self) -> Self {
        Self {
            x: other.y.neg_mul_add(self.z, self.y * other.z),
            y: other.z.neg_mul_add(self.x, self.z * other.x),
            z: other.x.neg_mul_add(self.y, self.x * other.y),
        }
    }
}

macro_rules! operator {
    ($trait:ident $method:ident $simd:ident) => {
        impl<S: Simd> $trait for F<S> {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                self.zip(other, |a, b| self.0.$simd(a, b))
            }
        }
    };
}
operator!(Add add add_f32s);
operator!(Sub sub sub_f32s);
operator!(Mul mul mul_f32s);
operator!(Div div div_f32s);

impl<S: Simd> Neg for F<S> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        self.map(|a| self.0.neg_f32s(a))
    }
}

impl<S: Simd> BitAnd for Mask<S> {
    type Output = Self;
    #[inline(always)]
    fn bitand(self, other: Self) -> Self {
        let ([a, b], [c, d]) = (self.1, other.1);
        Self(self.0, [self.0.and_m32s(a, c), self.0.and_m32s(b, d)])
    }
}

impl<S: Simd> BitOr for Mask<S> {
    type Output = Self;
    #[inline(always)]
    fn bitor(self, other: Self) -> Self {
        let ([a, b], [c, d]) = (self.1, other.1);
        Self(self.0, [self.0.or_m32s(a, c), self.0.or_m32s(b, d)])
    }
}

impl<S: Simd> Add for F3<S> {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self { x: self.x + other.x, y: self.y + other.y, z: self.z + other.z }
    }
}

impl<S: Simd> AddAssign for F3<S> {
    #[inline(always)]
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl<S: Simd> Sub for F3<S> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self { x: self.x - other.x, y: self.y - other.y, z: self.z - other.z }
    }
}

impl<S: Simd> Mul<F<S>> for F3<S> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, by: F<S>) -> Self {
        Self { x: self.x * by, y: self.y * by, z: self.z * by }
    }
}

impl<S: Simd> Neg for F3<S> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self { x: -self.x, y: -self.y, z: -self.z }
    }
}

#[cfg(test)]
mod tests {
    use pulp::Scalar;

    use super::*;

    #[test]
    fn approx_rsqrt_and_approx_recip_are_within_their_error_bounds() {
        let scalar = Scalar::new();
        for k in 0..20_000 {
            let x = 10f32.powf(-25.0 + 50.0 * k as f32 / 20_000.0);
            let number = F::splat(scalar, x);
            let exact = f64::from(x);
            let off = |of: F<Scalar>, value: f64| (f64::from(of.1[0]) / value - 1.0).abs();
            assert!(off(number.approx_rsqrt(), exact.sqrt().recip()) < 2e-4, "about 1/√{x:e}");
            assert!(off(number.approx_recip(), exact.recip()) < 2.5e-3, "about 1/{x:e}");
        }
    }
}
