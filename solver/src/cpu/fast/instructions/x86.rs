//! Lane operations for AVX-512 and AVX2, where an intrinsic beats the portable loop.

use std::arch::x86_64::{__m256, __m256d, __m256i, __m512, __m512d};

use pulp::x86::{V3, V4};
use pulp::{Simd, cast};

use super::arrays::{Ints, LaneIndices, Lanes, Octets, PackedIndices, Quads, WIDTH};
use super::set::LaneOps;

/// Transposes four registers within every 128-bit quarter (or half).
macro_rules! transpose {
    ($simd:expr, $rows:expr, $type:ty, $half:ty, $lo:ident, $hi:ident, $lo2:ident, $hi2:ident) => {{
        let [a, b, c, d]: [$type; 4] = $rows;
        let simd = $simd;
        let (ab, cd): ($half, $half) = (cast(simd.$lo(a, b)), cast(simd.$lo(c, d)));
        let (ab2, cd2): ($half, $half) = (cast(simd.$hi(a, b)), cast(simd.$hi(c, d)));
        let columns: [$type; 4] = [
            cast(simd.$lo2(ab, cd)),
            cast(simd.$hi2(ab, cd)),
            cast(simd.$lo2(ab2, cd2)),
            cast(simd.$hi2(ab2, cd2)),
        ];
        columns
    }};
}

#[inline(always)]
fn transposed_in_512(simd: V4, rows: [[f32; WIDTH]; 4]) -> [[f32; WIDTH]; 4] {
    let rows = rows.map(|row| -> __m512 { cast(row) });
    transpose!(
        simd.avx512f,
        rows,
        __m512,
        __m512d,
        _mm512_unpacklo_ps,
        _mm512_unpackhi_ps,
        _mm512_unpacklo_pd,
        _mm512_unpackhi_pd
    )
    .map(cast)
}

/// Shift of each lane's index in [`PackedIndices`].
const SHIFTS: [u32; WIDTH] = [0, 0, 4, 4, 8, 8, 12, 12, 16, 16, 20, 20, 24, 24, 28, 28];

/// Sign bits of the first four numbers of eight.
const FIRST_FOUR_SIGNS: [u32; 8] = [1 << 31, 1 << 31, 1 << 31, 1 << 31, 0, 0, 0, 0];

/// 128-bit quarters of two registers in turn: the first two of each, and the last two.
const LOWER_HALVES: [u32; WIDTH] = [0, 1, 2, 3, 16, 17, 18, 19, 4, 5, 6, 7, 20, 21, 22, 23];
const UPPER_HALVES: [u32; WIDTH] = [8, 9, 10, 11, 24, 25, 26, 27, 12, 13, 14, 15, 28, 29, 30, 31];

impl LaneOps for V4 {
    #[inline(always)]
    fn permute(self, [low, high]: [&Lanes; 2], at: &LaneIndices) -> Lanes {
        let picked = self.avx512f._mm512_permutex2var_ps(cast(low.0), cast(at.0), cast(high.0));
        Lanes(cast(picked))
    }

    #[inline(always)]
    fn permute_ints(self, [low, high]: [&Ints; 2], at: &LaneIndices) -> Ints {
        let picked = self.avx512f._mm512_permutex2var_epi32(cast(low.0), cast(at.0), cast(high.0));
        Ints(cast(picked))
    }

    #[inline(always)]
    fn le_bits(self, values: &Lanes, limit: f32) -> u16 {
        self.less_than_or_equal_f32s(cast(values.0), self.splat_f32s(limit)).0
    }

    #[inline(always)]
    fn round_to_int(self, numbers: &Lanes) -> Ints {
        Ints(cast(self.avx512f._mm512_cvtps_epi32(cast(numbers.0))))
    }

    #[inline(always)]
    fn masked_permute(self, values: &Lanes, from: &LaneIndices, takes: u16) -> Lanes {
        Lanes(cast(self.avx512f._mm512_maskz_permutexvar_ps(takes, cast(from.0), cast(values.0))))
    }

    #[inline(always)]
    fn mask_from_bits(self, bits: u16, _: usize) -> Self::m32s {
        pulp::b16(bits)
    }

    #[inline(always)]
    fn mask_to_bits(self, mask: Self::m32s) -> u16 {
        mask.0
    }

    #[inline(always)]
    fn widen(self, places: &[u8; WIDTH]) -> LaneIndices {
        LaneIndices(cast(self.avx512f._mm512_cvtepu8_epi32(cast(*places))))
    }

    #[inline(always)]
    fn unpack(self, places: PackedIndices) -> LaneIndices {
        let all = self.avx512f._mm512_set1_epi64(places.0 as i64);
        LaneIndices(cast(self.avx512f._mm512_srlv_epi32(all, cast(SHIFTS))))
    }

    #[inline(always)]
    fn splat_masked(self, value: f32, takes: u16) -> Lanes {
        Lanes(cast(self.avx512f._mm512_maskz_mov_ps(takes, cast(self.splat_f32s(value)))))
    }

    #[inline(always)]
    fn compress(self, values: &LaneIndices, takes: u16) -> LaneIndices {
        LaneIndices(cast(self.avx512f._mm512_maskz_compress_epi32(takes, cast(values.0))))
    }

    #[inline(always)]
    fn to_lanes(self, quads: &Quads) -> [Lanes; 4] {
        let rows: [[f32; WIDTH]; 4] = cast(quads.0);
        transposed_in_512(self, rows).map(Lanes)
    }

    #[inline(always)]
    fn to_quads(self, lanes: [&Lanes; 4]) -> Quads {
        Quads(cast(transposed_in_512(self, lanes.map(|lanes| lanes.0))))
    }

    #[inline(always)]
    fn add8(self, a: &[f32; 8], b: &[f32; 8]) -> [f32; 8] {
        V3::add8(*self, a, b)
    }

    #[inline(always)]
    fn subtract_add8(self, a: &[f32; 8], b: &[f32; 8]) -> [f32; 8] {
        V3::subtract_add8(*self, a, b)
    }

    #[inline(always)]
    fn split_octets(self, octets: &Octets) -> [Quads; 2] {
        let rows: [[f32; WIDTH]; 8] = cast(*octets);
        let [mut first, mut last] = [[[0.0f32; WIDTH]; 4]; 2];
        for k in 0..4 {
            let (one, two) = (cast(rows[2 * k]), cast(rows[2 * k + 1]));
            first[k] = cast(self.avx512f._mm512_shuffle_f32x4::<0b10_00_10_00>(one, two));
            last[k] = cast(self.avx512f._mm512_shuffle_f32x4::<0b11_01_11_01>(one, two));
        }
        [Quads(cast(first)), Quads(cast(last))]
    }

    #[inline(always)]
    fn join_octets(self, [first, last]: [&Quads; 2]) -> Octets {
        let (first, last): ([[f32; WIDTH]; 4], [[f32; WIDTH]; 4]) = (cast(first.0), cast(last.0));
        let mut rows = [[0.0f32; WIDTH]; 8];
        for k in 0..4 {
            let (one, two) = (cast(first[k]), cast(last[k]));
            rows[2 * k] = cast(self.avx512f._mm512_permutex2var_ps(one, cast(LOWER_HALVES), two));
            rows[2 * k + 1] = cast(self.avx512f._mm512_permutex2var_ps(one, cast(UPPER_HALVES), two));
        }
        cast(rows)
    }
}

/// Numbers of four registers, by index.
#[inline(always)]
fn picked(simd: V3, [a, b, c, d]: [[f32; 8]; 4], at: [u32; 8]) -> [f32; 8] {
    let high = simd.avx._mm256_castsi256_ps(simd.avx2._mm256_slli_epi32::<27>(cast(at)));
    let (low, other) = (picked_from_two(simd, [a, b], at), picked_from_two(simd, [c, d], at));
    cast(simd.avx._mm256_blendv_ps(cast(low), cast(other), high))
}

/// Numbers of two registers, by index.
#[inline(always)]
fn picked_from_two(simd: V3, [low, high]: [[f32; 8]; 2], at: [u32; 8]) -> [f32; 8] {
    let at: __m256i = cast(at);
    // Three index bits select within a register, the next bit selects the register. Shifted to the sign, it
    // drives the blend.
    let upper = simd.avx._mm256_castsi256_ps(simd.avx2._mm256_slli_epi32::<28>(at));
    let low = simd.avx2._mm256_permutevar8x32_ps(cast(low), at);
    let high = simd.avx2._mm256_permutevar8x32_ps(cast(high), at);
    cast(simd.avx._mm256_blendv_ps(low, high, upper))
}

impl LaneOps for V3 {
    #[inline(always)]
    fn permute(self, [low, high]: [&Lanes; 2], at: &LaneIndices) -> Lanes {
        let ([a, b], [c, d]): ([[f32; 8]; 2], [[f32; 8]; 2]) = (cast(low.0), cast(high.0));
        let [one, two]: [[u32; 8]; 2] = cast(at.0);
        Lanes(cast([picked(self, [a, b, c, d], one), picked(self, [a, b, c, d], two)]))
    }

    #[inline(always)]
    fn permute_ints(self, [low, high]: [&Ints; 2], at: &LaneIndices) -> Ints {
        Ints(cast(self.permute([&Lanes(cast(low.0)), &Lanes(cast(high.0))], at).0))
    }

    #[inline(always)]
    fn le_bits(self, values: &Lanes, limit: f32) -> u16 {
        let [low, high]: [[f32; 8]; 2] = cast(values.0);
        let limit = self.splat_f32s(limit);
        let low = self.less_than_or_equal_f32s(cast(low), limit);
        let high = self.less_than_or_equal_f32s(cast(high), limit);
        let low = self.avx._mm256_movemask_ps(cast(low)) as u16;
        low | (self.avx._mm256_movemask_ps(cast(high)) as u16) << 8
    }

    #[inline(always)]
    fn round_to_int(self, numbers: &Lanes) -> Ints {
        let [low, high]: [[f32; 8]; 2] = cast(numbers.0);
        let low: [i32; 8] = cast(self.avx._mm256_cvtps_epi32(cast(low)));
        let high: [i32; 8] = cast(self.avx._mm256_cvtps_epi32(cast(high)));
        Ints(cast([low, high]))
    }

    #[inline(always)]
    fn mask_from_bits(self, bits: u16, part: usize) -> Self::m32s {
        let each: [u32; 8] = [1, 2, 4, 8, 16, 32, 64, 128];
        let bits = self.avx2._mm256_and_si256(cast([u32::from(bits) >> (8 * part); 8]), cast(each));
        cast(self.avx2._mm256_cmpeq_epi32(bits, cast(each)))
    }

    #[inline(always)]
    fn mask_to_bits(self, mask: Self::m32s) -> u16 {
        self.avx._mm256_movemask_ps(cast(mask)) as u16
    }

    #[inline(always)]
    fn widen(self, places: &[u8; WIDTH]) -> LaneIndices {
        let [low, high]: [u64; 2] = cast(*places);
        let low: [u32; 8] = cast(self.avx2._mm256_cvtepu8_epi32(cast([low, 0])));
        let high: [u32; 8] = cast(self.avx2._mm256_cvtepu8_epi32(cast([high, 0])));
        LaneIndices(cast([low, high]))
    }

    #[inline(always)]
    fn unpack(self, places: PackedIndices) -> LaneIndices {
        let shifts: [__m256i; 2] = cast(SHIFTS);
        let low: [u32; 8] = cast(self.avx2._mm256_srlv_epi32(cast([places.0; 4]), shifts[0]));
        let high: [u32; 8] = cast(self.avx2._mm256_srlv_epi32(cast([places.0; 4]), shifts[1]));
        LaneIndices(cast([low, high]))
    }

    #[inline(always)]
    fn masked_permute(self, values: &Lanes, from: &LaneIndices, takes: u16) -> Lanes {
        let halves: [[f32; 8]; 2] = cast(values.0);
        let [one, two]: [[u32; 8]; 2] = cast(from.0);
        let spread: [f32; WIDTH] =
            cast([picked_from_two(self, halves, one), picked_from_two(self, halves, two)]);
        let takes: Lanes =
            Lanes(std::array::from_fn(|k| f32::from_bits(0u32.wrapping_sub(u32::from(takes >> k & 1)))));
        Lanes(std::array::from_fn(|k| f32::from_bits(spread[k].to_bits() & takes.0[k].to_bits())))
    }

    #[inline(always)]
    fn to_lanes(self, quads: &Quads) -> [Lanes; 4] {
        let rows: [[f32; WIDTH]; 4] = cast(quads.0);
        transposed_in_256(self, rows).map(Lanes)
    }

    #[inline(always)]
    fn to_quads(self, lanes: [&Lanes; 4]) -> Quads {
        let [a, b, c, d] = lanes;
        Quads(cast(transposed_in_256(self, [a.0, b.0, c.0, d.0])))
    }

    #[inline(always)]
    fn add8(self, a: &[f32; 8], b: &[f32; 8]) -> [f32; 8] {
        cast(self.avx._mm256_add_ps(cast(*a), cast(*b)))
    }

    #[inline(always)]
    fn subtract_add8(self, a: &[f32; 8], b: &[f32; 8]) -> [f32; 8] {
        let b = self.avx._mm256_xor_ps(cast(*b), cast(FIRST_FOUR_SIGNS));
        cast(self.avx._mm256_add_ps(cast(*a), b))
    }

    #[inline(always)]
    fn split_octets(self, octets: &Octets) -> [Quads; 2] {
        let [mut first, mut last] = [[[0.0f32; 8]; 8]; 2];
        for k in 0..8 {
            let (one, two) = (cast(octets[2 * k]), cast(octets[2 * k + 1]));
            first[k] = cast(self.avx._mm256_permute2f128_ps::<0x20>(one, two));
            last[k] = cast(self.avx._mm256_permute2f128_ps::<0x31>(one, two));
        }
        [Quads(cast(first)), Quads(cast(last))]
    }

    #[inline(always)]
    fn join_octets(self, [first, last]: [&Quads; 2]) -> Octets {
        let (first, last): ([[f32; 8]; 8], [[f32; 8]; 8]) = (cast(first.0), cast(last.0));
        let mut octets = [[0.0; 8]; WIDTH];
        for k in 0..8 {
            let (one, two) = (cast(first[k]), cast(last[k]));
            octets[2 * k] = cast(self.avx._mm256_permute2f128_ps::<0x20>(one, two));
            octets[2 * k + 1] = cast(self.avx._mm256_permute2f128_ps::<0x31>(one, two));
        }
        octets
    }
}

/// Without closures: their bodies would not get the target features.
#[inline(always)]
fn transposed_in_256(simd: V3, [a, b, c, d]: [[f32; WIDTH]; 4]) -> [[f32; WIDTH]; 4] {
    let [[a, e], [b, f], [c, g], [d, h]]: [[[f32; 8]; 2]; 4] = [cast(a), cast(b), cast(c), cast(d)];
    let [a, b, c, d] = half_transposed(simd, [a, b, c, d]);
    let [e, f, g, h] = half_transposed(simd, [e, f, g, h]);
    [cast([a, e]), cast([b, f]), cast([c, g]), cast([d, h])]
}

#[inline(always)]
fn half_transposed(simd: V3, [a, b, c, d]: [[f32; 8]; 4]) -> [[f32; 8]; 4] {
    let rows = [cast(a), cast(b), cast(c), cast(d)];
    let [a, b, c, d] = transpose!(
        simd.avx,
        rows,
        __m256,
        __m256d,
        _mm256_unpacklo_ps,
        _mm256_unpackhi_ps,
        _mm256_unpacklo_pd,
        _mm256_unpackhi_pd
    );
    [cast(a), cast(b), cast(c), cast(d)]
}
