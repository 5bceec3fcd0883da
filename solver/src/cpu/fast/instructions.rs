//! The instruction sets that a kernel can run with on this machine, and what each does best.

use pulp::{Scalar, Simd};

use super::memory::{Ints, Lanes, Quads, WIDTH, quad_of};

/// An instruction set that this machine has.
#[derive(Clone, Copy, Debug)]
pub struct Instructions {
    set: Set,
    name: &'static str,
}

#[derive(Clone, Copy, Debug)]
enum Set {
    #[cfg(target_arch = "x86_64")]
    Avx512(pulp::x86::V4),
    #[cfg(target_arch = "x86_64")]
    Avx2(pulp::x86::V3),
    #[cfg(target_arch = "aarch64")]
    Neon(pulp::aarch64::Neon),
    Scalar,
}

/// Work that is written once for all instruction sets.
pub(super) trait Job {
    type Output;

    /// Must be inlined, and all that it calls.
    fn run<S: Wide>(self, simd: S) -> Self::Output;
}

/// A whole number in each lane; as places in a window of two blocks, those under [`WIDTH`] are in the first.
#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
pub(super) struct Places(pub(super) [u32; WIDTH]);

impl Places {
    /// Each lane its own number.
    pub(super) const EACH: Self = {
        let mut each = [0; WIDTH];
        let mut k = 0;
        while k < WIDTH {
            each[k] = k as u32;
            k += 1;
        }
        Self(each)
    };
}

/// [`WIDTH`] numbers below 16, four bits each: those of even lanes in the lower half, those of odd lanes in the upper.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct PackedPlaces(u64);

impl PackedPlaces {
    fn shift(lane: usize) -> usize {
        32 * (lane % 2) + 4 * (lane / 2)
    }

    /// The number of a lane, in the four lowest bits.
    pub(super) fn of(self, lane: usize) -> u32 {
        (self.0 >> Self::shift(lane)) as u32 & 15
    }

    /// Puts a number where there was 0.
    pub(super) fn put(&mut self, lane: usize, number: u32) {
        self.0 |= u64::from(number) << Self::shift(lane);
    }
}

#[inline(always)]
fn stands_at<T: Copy>(window: [&[T; WIDTH]; 2], place: u32) -> T {
    let place = place as usize;
    window[usize::from(place >= WIDTH)][place % WIDTH]
}

/// An instruction set with the moves between lanes that kernels need.
pub(super) trait Wide: Simd {
    /// What stands at these places of a window.
    #[inline(always)]
    fn pick(self, window: [&Lanes; 2], at: &Places) -> Lanes {
        Lanes(std::array::from_fn(|k| stands_at(window.map(|of| &of.0), at.0[k])))
    }

    /// What stands at these places of a window.
    #[inline(always)]
    fn pick_ints(self, window: [&Ints; 2], at: &Places) -> Ints {
        Ints(std::array::from_fn(|k| stands_at(window.map(|of| &of.0), at.0[k])))
    }

    /// The lanes of at most `limit`, as bits.
    #[inline(always)]
    fn at_most(self, values: &Lanes, limit: f32) -> u16 {
        values.0.iter().enumerate().fold(0, |bits, (k, value)| bits | u16::from(*value <= limit) << k)
    }

    /// The nearest whole numbers. Numbers that none is near to give anything.
    #[inline(always)]
    fn whole(self, numbers: &Lanes) -> Ints {
        Ints(numbers.0.map(|x| x.round_ties_even() as i32))
    }

    /// The values whose lanes stand in the four lowest bits of `from`, and 0 where `takes` has no bit.
    #[inline(always)]
    fn spread(self, values: &Lanes, from: &Places, takes: u16) -> Lanes {
        Lanes(std::array::from_fn(|k| {
            if takes >> k & 1 == 1 { values.0[from.0[k] as usize % WIDTH] } else { 0.0 }
        }))
    }

    /// The `part`th registerful of lanes of which bits say whether they are true.
    #[inline(always)]
    fn mask(self, bits: u16, part: usize) -> Self::m32s {
        let lanes = self.only(1.0, bits);
        self.less_than_f32s(self.splat_f32s(0.0), Self::as_simd_f32s(&lanes.0).0[part])
    }

    /// The lanes that are true, as the lowest bits.
    #[inline(always)]
    fn bits(self, mask: Self::m32s) -> u16 {
        let mut lanes = Lanes([1.0; WIDTH]);
        Self::as_mut_simd_f32s(&mut lanes.0).0[0] =
            self.select_f32s(mask, self.splat_f32s(0.0), self.splat_f32s(1.0));
        self.at_most(&lanes, 0.5)
    }

    /// The same numbers in lanes.
    #[inline(always)]
    fn widened(self, places: &[u8; WIDTH]) -> Places {
        Places(std::array::from_fn(|k| places[k].into()))
    }

    /// The same numbers in the four lowest bits of lanes, whose others may be anything.
    #[inline(always)]
    fn unpacked(self, places: PackedPlaces) -> Places {
        Places(std::array::from_fn(|k| places.of(k)))
    }

    /// A value where `takes` has a bit, else 0.
    #[inline(always)]
    fn only(self, value: f32, takes: u16) -> Lanes {
        let takes = |k: usize| 0u32.wrapping_sub(u32::from(takes >> k & 1));
        Lanes(std::array::from_fn(|k| f32::from_bits(value.to_bits() & takes(k))))
    }

    /// The values that `takes` has a bit for, in front; what follows may be anything.
    #[inline(always)]
    fn to_front(self, values: &Places, takes: u16) -> Places {
        let (mut front, mut count) = ([0; WIDTH], 0);
        for k in 0..WIDTH {
            front[count % WIDTH] = values.0[k];
            count += usize::from(takes >> k & 1);
        }
        Places(front)
    }

    /// Asks memory for what will be wanted soon, so that nothing waits for it then.
    #[inline(always)]
    fn fetch<T>(self, _: &[T]) {}

    /// The same of what will be wanted later: it comes no nearer than the second level of the cache.
    #[inline(always)]
    fn fetch_far<T>(self, _: &[T]) {}

    /// From four numbers each one after the other to lanes (see [`super::memory::quad_of`]).
    #[inline(always)]
    fn to_lanes(self, quads: &Quads) -> [Lanes; 4] {
        std::array::from_fn(|c| Lanes(std::array::from_fn(|lane| quads.0[quad_of(lane)][c])))
    }

    /// From lanes to four numbers each one after the other.
    #[inline(always)]
    fn to_quads(self, lanes: [&Lanes; 4]) -> Quads {
        Quads(std::array::from_fn(|place| std::array::from_fn(|c| lanes[c].0[quad_of(place)])))
    }
}

impl Wide for Scalar {}

#[cfg(target_arch = "aarch64")]
impl Wide for pulp::aarch64::Neon {}

#[cfg(target_arch = "x86_64")]
mod x86 {
    use std::arch::x86_64::{__m256, __m256d, __m256i, __m512, __m512d, _MM_HINT_T0, _MM_HINT_T1};

    use pulp::core_arch::x86::Sse;
    use pulp::x86::{V3, V4};
    use pulp::{Simd, cast};

    use super::{Ints, Lanes, PackedPlaces, Places, Quads, WIDTH, Wide};

    /// Rows of four registers become columns, within every quarter (or half) of a register.
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

    /// How far each lane's number is from the lowest bits in [`PackedPlaces`].
    const SHIFTS: [u32; WIDTH] = [0, 0, 4, 4, 8, 8, 12, 12, 16, 16, 20, 20, 24, 24, 28, 28];

    /// Bytes that come from memory together.
    const LINE: usize = 64;

    #[inline(always)]
    fn fetch_lines<const HINT: i32, T>(sse: Sse, wanted: &[T]) {
        // From where its first line begins: short pieces would else lose their last.
        let into_line = wanted.as_ptr().addr() % LINE;
        let first = wanted.as_ptr().cast::<i8>().wrapping_sub(into_line);
        let end = if wanted.is_empty() { 0 } else { into_line + size_of_val(wanted) };
        for line in (0..end).step_by(LINE) {
            sse._mm_prefetch::<HINT>(first.wrapping_add(line));
        }
    }

    impl Wide for V4 {
        #[inline(always)]
        fn pick(self, [low, high]: [&Lanes; 2], at: &Places) -> Lanes {
            let picked = self.avx512f._mm512_permutex2var_ps(cast(low.0), cast(at.0), cast(high.0));
            Lanes(cast(picked))
        }

        #[inline(always)]
        fn pick_ints(self, [low, high]: [&Ints; 2], at: &Places) -> Ints {
            let picked = self.avx512f._mm512_permutex2var_epi32(cast(low.0), cast(at.0), cast(high.0));
            Ints(cast(picked))
        }

        #[inline(always)]
        fn at_most(self, values: &Lanes, limit: f32) -> u16 {
            self.less_than_or_equal_f32s(cast(values.0), self.splat_f32s(limit)).0
        }

        #[inline(always)]
        fn whole(self, numbers: &Lanes) -> Ints {
            Ints(cast(self.avx512f._mm512_cvtps_epi32(cast(numbers.0))))
        }

        #[inline(always)]
        fn spread(self, values: &Lanes, from: &Places, takes: u16) -> Lanes {
            Lanes(cast(self.avx512f._mm512_maskz_permutexvar_ps(takes, cast(from.0), cast(values.0))))
        }

        #[inline(always)]
        fn mask(self, bits: u16, _: usize) -> Self::m32s {
            pulp::b16(bits)
        }

        #[inline(always)]
        fn bits(self, mask: Self::m32s) -> u16 {
            mask.0
        }

        #[inline(always)]
        fn widened(self, places: &[u8; WIDTH]) -> Places {
            Places(cast(self.avx512f._mm512_cvtepu8_epi32(cast(*places))))
        }

        #[inline(always)]
        fn unpacked(self, places: PackedPlaces) -> Places {
            let all = self.avx512f._mm512_set1_epi64(places.0 as i64);
            Places(cast(self.avx512f._mm512_srlv_epi32(all, cast(SHIFTS))))
        }

        #[inline(always)]
        fn only(self, value: f32, takes: u16) -> Lanes {
            Lanes(cast(self.avx512f._mm512_maskz_mov_ps(takes, cast(self.splat_f32s(value)))))
        }

        #[inline(always)]
        fn to_front(self, values: &Places, takes: u16) -> Places {
            Places(cast(self.avx512f._mm512_maskz_compress_epi32(takes, cast(values.0))))
        }

        #[inline(always)]
        fn fetch<T>(self, wanted: &[T]) {
            fetch_lines::<_MM_HINT_T0, T>(self.sse, wanted);
        }

        #[inline(always)]
        fn fetch_far<T>(self, wanted: &[T]) {
            fetch_lines::<_MM_HINT_T1, T>(self.sse, wanted);
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
    }

    /// The numbers of four registers, one after the other, at these places.
    #[inline(always)]
    fn picked(simd: V3, [a, b, c, d]: [[f32; 8]; 4], at: [u32; 8]) -> [f32; 8] {
        let high = simd.avx._mm256_castsi256_ps(simd.avx2._mm256_slli_epi32::<27>(cast(at)));
        let (low, other) = (picked_from_two(simd, [a, b], at), picked_from_two(simd, [c, d], at));
        cast(simd.avx._mm256_blendv_ps(cast(low), cast(other), high))
    }

    /// The same of two registers.
    #[inline(always)]
    fn picked_from_two(simd: V3, [low, high]: [[f32; 8]; 2], at: [u32; 8]) -> [f32; 8] {
        let at: __m256i = cast(at);
        // Of a place the three lowest bits say where in a register, the next in which: as signs they choose.
        let upper = simd.avx._mm256_castsi256_ps(simd.avx2._mm256_slli_epi32::<28>(at));
        let low = simd.avx2._mm256_permutevar8x32_ps(cast(low), at);
        let high = simd.avx2._mm256_permutevar8x32_ps(cast(high), at);
        cast(simd.avx._mm256_blendv_ps(low, high, upper))
    }

    impl Wide for V3 {
        #[inline(always)]
        fn pick(self, [low, high]: [&Lanes; 2], at: &Places) -> Lanes {
            let ([a, b], [c, d]): ([[f32; 8]; 2], [[f32; 8]; 2]) = (cast(low.0), cast(high.0));
            let [one, two]: [[u32; 8]; 2] = cast(at.0);
            Lanes(cast([picked(self, [a, b, c, d], one), picked(self, [a, b, c, d], two)]))
        }

        #[inline(always)]
        fn pick_ints(self, [low, high]: [&Ints; 2], at: &Places) -> Ints {
            Ints(cast(self.pick([&Lanes(cast(low.0)), &Lanes(cast(high.0))], at).0))
        }

        #[inline(always)]
        fn at_most(self, values: &Lanes, limit: f32) -> u16 {
            let [low, high]: [[f32; 8]; 2] = cast(values.0);
            let limit = self.splat_f32s(limit);
            let low = self.less_than_or_equal_f32s(cast(low), limit);
            let high = self.less_than_or_equal_f32s(cast(high), limit);
            let low = self.avx._mm256_movemask_ps(cast(low)) as u16;
            low | (self.avx._mm256_movemask_ps(cast(high)) as u16) << 8
        }

        #[inline(always)]
        fn whole(self, numbers: &Lanes) -> Ints {
            let [low, high]: [[f32; 8]; 2] = cast(numbers.0);
            let low: [i32; 8] = cast(self.avx._mm256_cvtps_epi32(cast(low)));
            let high: [i32; 8] = cast(self.avx._mm256_cvtps_epi32(cast(high)));
            Ints(cast([low, high]))
        }

        #[inline(always)]
        fn mask(self, bits: u16, part: usize) -> Self::m32s {
            let each: [u32; 8] = [1, 2, 4, 8, 16, 32, 64, 128];
            let bits = self.avx2._mm256_and_si256(cast([u32::from(bits) >> (8 * part); 8]), cast(each));
            cast(self.avx2._mm256_cmpeq_epi32(bits, cast(each)))
        }

        #[inline(always)]
        fn bits(self, mask: Self::m32s) -> u16 {
            self.avx._mm256_movemask_ps(cast(mask)) as u16
        }

        #[inline(always)]
        fn widened(self, places: &[u8; WIDTH]) -> Places {
            let [low, high]: [u64; 2] = cast(*places);
            let low: [u32; 8] = cast(self.avx2._mm256_cvtepu8_epi32(cast([low, 0])));
            let high: [u32; 8] = cast(self.avx2._mm256_cvtepu8_epi32(cast([high, 0])));
            Places(cast([low, high]))
        }

        #[inline(always)]
        fn unpacked(self, places: PackedPlaces) -> Places {
            let shifts: [__m256i; 2] = cast(SHIFTS);
            let low: [u32; 8] = cast(self.avx2._mm256_srlv_epi32(cast([places.0; 4]), shifts[0]));
            let high: [u32; 8] = cast(self.avx2._mm256_srlv_epi32(cast([places.0; 4]), shifts[1]));
            Places(cast([low, high]))
        }

        #[inline(always)]
        fn spread(self, values: &Lanes, from: &Places, takes: u16) -> Lanes {
            let halves: [[f32; 8]; 2] = cast(values.0);
            let [one, two]: [[u32; 8]; 2] = cast(from.0);
            let spread: [f32; WIDTH] =
                cast([picked_from_two(self, halves, one), picked_from_two(self, halves, two)]);
            let takes: Lanes =
                Lanes(std::array::from_fn(|k| f32::from_bits(0u32.wrapping_sub(u32::from(takes >> k & 1)))));
            Lanes(std::array::from_fn(|k| f32::from_bits(spread[k].to_bits() & takes.0[k].to_bits())))
        }

        #[inline(always)]
        fn fetch<T>(self, wanted: &[T]) {
            fetch_lines::<_MM_HINT_T0, T>(self.sse, wanted);
        }

        #[inline(always)]
        fn fetch_far<T>(self, wanted: &[T]) {
            fetch_lines::<_MM_HINT_T1, T>(self.sse, wanted);
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
    }

    /// Not with closures: what is in them is not built for the instruction set.
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
}

impl Instructions {
    /// All that this machine has, the widest first. The last, without vectors, runs anywhere.
    pub fn available() -> Vec<Self> {
        let mut all = Vec::new();
        #[cfg(target_arch = "x86_64")]
        {
            use pulp::x86::{V3, V4};
            all.extend(V4::try_new().map(|simd| Self { set: Set::Avx512(simd), name: "AVX-512" }));
            all.extend(V3::try_new().map(|simd| Self { set: Set::Avx2(simd), name: "AVX2" }));
        }
        #[cfg(target_arch = "aarch64")]
        all.extend(pulp::aarch64::Neon::try_new().map(|simd| Self { set: Set::Neon(simd), name: "Neon" }));
        all.push(Self { set: Set::Scalar, name: "scalar" });
        all
    }

    /// The widest that this machine has.
    pub fn widest() -> Self {
        Self::available()[0]
    }

    /// Its name, such as `AVX-512`.
    pub fn name(&self) -> &'static str {
        self.name
    }

    /// Does a job with these instructions.
    #[inline(always)]
    pub(super) fn run<J: Job>(&self, job: J) -> J::Output {
        match self.set {
            #[cfg(target_arch = "x86_64")]
            Set::Avx512(simd) => simd.vectorize(Inlined { simd, job }),
            #[cfg(target_arch = "x86_64")]
            Set::Avx2(simd) => simd.vectorize(Inlined { simd, job }),
            #[cfg(target_arch = "aarch64")]
            Set::Neon(simd) => simd.vectorize(Inlined { simd, job }),
            Set::Scalar => job.run(Scalar),
        }
    }
}

/// Does a job in a function of its own, within another: so it has all registers to itself.
#[inline(always)]
pub(super) fn by_itself<S: Wide, J: Job>(simd: S, job: J) -> J::Output {
    simd.vectorize(Inlined { simd, job })
}

/// A job on its way into a function that may use an instruction set: closures would not be inlined for sure.
struct Inlined<S, J> {
    simd: S,
    job: J,
}

impl<S: Wide, J: Job> pulp::NullaryFnOnce for Inlined<S, J> {
    type Output = J::Output;

    #[inline(always)]
    fn call(self) -> J::Output {
        self.job.run(self.simd)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What comes of some bits, and of places both ways.
    struct Moves {
        bits: u16,
        bytes: [u8; WIDTH],
        packed: PackedPlaces,
        values: Lanes,
    }

    impl Job for Moves {
        /// The bits again, all others, the bytes and the places, the values that stand there, and a value where there are bits.
        type Output = ([u16; 2], [[u32; WIDTH]; 2], [[f32; WIDTH]; 2]);

        #[inline(always)]
        fn run<S: Wide>(self, simd: S) -> Self::Output {
            let Self { bits, bytes, packed, values } = self;
            let mut found = [0; 2];
            for part in 0..WIDTH / S::F32_LANES {
                let mask = simd.mask(bits, part);
                found[0] |= simd.bits(mask) << (part * S::F32_LANES);
                found[1] |= simd.bits(simd.not_m32s(mask)) << (part * S::F32_LANES);
            }
            let at = simd.unpacked(packed);
            let places = [simd.widened(&bytes).0, at.0.map(|place| place % 16)];
            (found, places, [simd.spread(&values, &at, bits).0, simd.only(0.75, bits).0])
        }
    }

    #[test]
    fn all_move_bits_and_places_alike() {
        let mut random = fastrand::Rng::with_seed(1);
        for _ in 0..2000 {
            let bits = random.u16(..);
            let bytes: [u8; WIDTH] = std::array::from_fn(|_| random.u8(..32));
            let places: [u32; WIDTH] = std::array::from_fn(|_| random.u32(..16));
            let values: [f32; WIDTH] = std::array::from_fn(|_| random.f32() + 1.0);
            let mut packed = PackedPlaces::default();
            (0..WIDTH).for_each(|lane| packed.put(lane, places[lane]));
            let or_0 = |lane: usize, value: f32| if bits >> lane & 1 == 1 { value } else { 0.0 };
            let expected = (
                [bits, !bits],
                [bytes.map(u32::from), places],
                [
                    std::array::from_fn(|lane| or_0(lane, values[places[lane] as usize])),
                    std::array::from_fn(|lane| or_0(lane, 0.75)),
                ],
            );
            for set in Instructions::available() {
                let found = set.run(Moves { bits, bytes, packed, values: Lanes(values) });
                assert_eq!(found, expected, "{}", set.name());
            }
        }
    }
}
