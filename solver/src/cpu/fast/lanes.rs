//! Numbers in lanes: the same arithmetic on as many pairs at once as the instruction set has lanes.
//!
//! Only `+ - * / sqrt`, comparisons and selections, no fused multiply-add: every instruction set gives the same bits.
//! `pulp` picks the instructions; a kernel is written once, over [`Simd`].

use std::ops::{Add, AddAssign, BitAnd, BitOr, Div, Mul, Neg, Sub};

use pulp::Simd;

/// Pairs that are worked on together: a multiple of the lanes of every instruction set.
pub(super) const WIDTH: usize = 16;

/// One number of each of [`WIDTH`] pairs, in memory.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(align(64))]
pub(super) struct Lanes(pub(super) [f32; WIDTH]);

impl Lanes {
    /// All zero.
    pub(super) const ZERO: Self = Self([0.0; WIDTH]);

    /// 0, 1, 2, …
    pub(super) const COUNT: Self = {
        let mut count = [0.0; WIDTH];
        let mut k = 0;
        while k < WIDTH {
            count[k] = k as f32;
            k += 1;
        }
        Self(count)
    };
}

/// A vector of each of [`WIDTH`] pairs, in memory.
pub(super) type Lanes3 = [Lanes; 3];

/// Numbers in the lanes of a register.
#[derive(Clone, Copy)]
pub(super) struct F<S: Simd>(S, S::f32s);

/// Truth in the lanes of a register.
#[derive(Clone, Copy)]
pub(super) struct Mask<S: Simd>(S, S::m32s);

/// Vectors in the lanes of three registers.
#[derive(Clone, Copy)]
pub(super) struct F3<S: Simd> {
    x: F<S>,
    y: F<S>,
    z: F<S>,
}

impl<S: Simd> F<S> {
    #[inline(always)]
    pub(super) fn splat(simd: S, value: f32) -> Self {
        Self(simd, simd.splat_f32s(value))
    }

    /// The `part`th registerful of lanes.
    #[inline(always)]
    pub(super) fn load(simd: S, lanes: &Lanes, part: usize) -> Self {
        Self(simd, S::as_simd_f32s(&lanes.0).0[part])
    }

    #[inline(always)]
    pub(super) fn store(self, lanes: &mut Lanes, part: usize) {
        S::as_mut_simd_f32s(&mut lanes.0).0[part] = self.1;
    }

    #[inline(always)]
    pub(super) fn sqrt(self) -> Self {
        Self(self.0, self.0.sqrt_f32s(self.1))
    }

    #[inline(always)]
    pub(super) fn max(self, other: Self) -> Self {
        Self(self.0, self.0.max_f32s(self.1, other.1))
    }

    #[inline(always)]
    pub(super) fn min(self, other: Self) -> Self {
        Self(self.0, self.0.min_f32s(self.1, other.1))
    }

    /// Whether at most as large.
    #[inline(always)]
    pub(super) fn le(self, other: Self) -> Mask<S> {
        Mask(self.0, self.0.less_than_or_equal_f32s(self.1, other.1))
    }

    /// Whether smaller.
    #[inline(always)]
    pub(super) fn lt(self, other: Self) -> Mask<S> {
        Mask(self.0, self.0.less_than_f32s(self.1, other.1))
    }

    /// The least of the lanes.
    #[inline(always)]
    pub(super) fn least(self) -> f32 {
        self.0.reduce_min_f32s(self.1)
    }

    /// The greatest of the lanes.
    #[inline(always)]
    pub(super) fn greatest(self) -> f32 {
        self.0.reduce_max_f32s(self.1)
    }
}

impl<S: Simd> Mask<S> {
    /// One or the other, lane by lane.
    #[inline(always)]
    pub(super) fn select(self, yes: F<S>, no: F<S>) -> F<S> {
        F(self.0, self.0.select_f32s(self.1, yes.1, no.1))
    }

    /// One or the other, lane by lane.
    #[inline(always)]
    pub(super) fn select3(self, yes: F3<S>, no: F3<S>) -> F3<S> {
        F3 { x: self.select(yes.x, no.x), y: self.select(yes.y, no.y), z: self.select(yes.z, no.z) }
    }

    /// Whether any lane is true.
    #[inline(always)]
    pub(super) fn any(self) -> bool {
        self.0.first_true_m32s(self.1) < S::F32_LANES
    }
}

impl<S: Simd> F3<S> {
    #[inline(always)]
    pub(super) fn zero(simd: S) -> Self {
        let zero = F::splat(simd, 0.0);
        Self { x: zero, y: zero, z: zero }
    }

    #[inline(always)]
    pub(super) fn load(simd: S, [x, y, z]: &Lanes3, part: usize) -> Self {
        Self { x: F::load(simd, x, part), y: F::load(simd, y, part), z: F::load(simd, z, part) }
    }

    #[inline(always)]
    pub(super) fn store(self, [x, y, z]: &mut Lanes3, part: usize) {
        self.x.store(x, part);
        self.y.store(y, part);
        self.z.store(z, part);
    }

    #[inline(always)]
    pub(super) fn dot(self, other: Self) -> F<S> {
        self.x * other.x + self.y * other.y + self.z * other.z
    }

    #[inline(always)]
    pub(super) fn cross(self, other: Self) -> Self {
        Self {
            x: self.y * other.z - other.y * self.z,
            y: self.z * other.x - other.z * self.x,
            z: self.x * other.y - other.x * self.y,
        }
    }
}

macro_rules! operator {
    ($trait:ident $method:ident $simd:ident) => {
        impl<S: Simd> $trait for F<S> {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                Self(self.0, self.0.$simd(self.1, other.1))
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
        Self(self.0, self.0.neg_f32s(self.1))
    }
}

impl<S: Simd> BitAnd for Mask<S> {
    type Output = Self;
    #[inline(always)]
    fn bitand(self, other: Self) -> Self {
        Self(self.0, self.0.and_m32s(self.1, other.1))
    }
}

impl<S: Simd> BitOr for Mask<S> {
    type Output = Self;
    #[inline(always)]
    fn bitor(self, other: Self) -> Self {
        Self(self.0, self.0.or_m32s(self.1, other.1))
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
