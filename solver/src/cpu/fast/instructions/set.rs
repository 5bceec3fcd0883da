//! The instruction sets that kernels run with, and the lane operations that every set provides.
//!
//! A kernel is a [`SimdTask`]. It is written once, over [`LaneOps`], and compiled for each set.

use pulp::{Scalar, Simd};

use super::arrays::{Ints, LaneIndices, Lanes, Octets, PackedIndices, Quads, WIDTH, transposed_lane};

/// An instruction set of this machine.
#[derive(Clone, Copy, Debug)]
pub struct InstructionSet {
    level: Level,
    name: &'static str,
}

#[derive(Clone, Copy, Debug)]
enum Level {
    #[cfg(target_arch = "x86_64")]
    Avx512(pulp::x86::V4),
    #[cfg(target_arch = "x86_64")]
    Avx2(pulp::x86::V3),
    #[cfg(target_arch = "aarch64")]
    Neon(pulp::aarch64::Neon),
    Scalar,
}

/// Work written once for all instruction sets.
pub(crate) trait SimdTask {
    type Output;

    /// Must be inlined, with all functions that it calls.
    fn run<S: LaneOps>(self, simd: S) -> Self::Output;
}

#[inline(always)]
fn window_at<T: Copy>(window: [&[T; WIDTH]; 2], place: u32) -> T {
    let place = place as usize;
    window[usize::from(place >= WIDTH)][place % WIDTH]
}

/// An instruction set with the moves between lanes that kernels need.
pub(crate) trait LaneOps: Simd {
    /// Elements of a window of two blocks, by index.
    #[inline(always)]
    fn permute(self, window: [&Lanes; 2], at: &LaneIndices) -> Lanes {
        Lanes(std::array::from_fn(|k| window_at(window.map(|of| &of.0), at.0[k])))
    }

    /// Elements of a window of two blocks, by index.
    #[inline(always)]
    fn permute_ints(self, window: [&Ints; 2], at: &LaneIndices) -> Ints {
        Ints(std::array::from_fn(|k| window_at(window.map(|of| &of.0), at.0[k])))
    }

    /// Bits of the lanes of at most `limit`.
    #[inline(always)]
    fn le_bits(self, values: &Lanes, limit: f32) -> u16 {
        values.0.iter().enumerate().fold(0, |bits, (k, value)| bits | u16::from(*value <= limit) << k)
    }

    /// Nearest integers. Results outside the range of `i32` are arbitrary.
    #[inline(always)]
    fn round_to_int(self, numbers: &Lanes) -> Ints {
        Ints(numbers.0.map(|x| x.round_ties_even() as i32))
    }

    /// Permuted values; 0 where `takes` has no bit. Only the four lowest bits of an index count.
    #[inline(always)]
    fn masked_permute(self, values: &Lanes, from: &LaneIndices, takes: u16) -> Lanes {
        Lanes(std::array::from_fn(|k| {
            if takes >> k & 1 == 1 { values.0[from.0[k] as usize % WIDTH] } else { 0.0 }
        }))
    }

    /// The `part`th register of a mask, from bits.
    #[inline(always)]
    fn mask_from_bits(self, bits: u16, part: usize) -> Self::m32s {
        let lanes = self.splat_masked(1.0, bits);
        self.less_than_f32s(self.splat_f32s(0.0), Self::as_simd_f32s(&lanes.0).0[part])
    }

    /// The lanes of a mask, as the lowest bits.
    #[inline(always)]
    fn mask_to_bits(self, mask: Self::m32s) -> u16 {
        let mut lanes = Lanes([1.0; WIDTH]);
        Self::as_mut_simd_f32s(&mut lanes.0).0[0] =
            self.select_f32s(mask, self.splat_f32s(0.0), self.splat_f32s(1.0));
        self.le_bits(&lanes, 0.5)
    }

    /// The same indices, one per lane.
    #[inline(always)]
    fn widen(self, places: &[u8; WIDTH]) -> LaneIndices {
        LaneIndices(std::array::from_fn(|k| places[k].into()))
    }

    /// The same indices in the four lowest bits of lanes. The other bits are arbitrary.
    #[inline(always)]
    fn unpack(self, places: PackedIndices) -> LaneIndices {
        LaneIndices(std::array::from_fn(|k| places.of(k)))
    }

    /// `value` where `takes` has a bit, else 0.
    #[inline(always)]
    fn splat_masked(self, value: f32, takes: u16) -> Lanes {
        let takes = |k: usize| 0u32.wrapping_sub(u32::from(takes >> k & 1));
        Lanes(std::array::from_fn(|k| f32::from_bits(value.to_bits() & takes(k))))
    }

    /// The values with a bit in `takes`, moved to the front. The rest is arbitrary.
    #[inline(always)]
    fn compress(self, values: &LaneIndices, takes: u16) -> LaneIndices {
        let (mut front, mut count) = ([0; WIDTH], 0);
        for k in 0..WIDTH {
            front[count % WIDTH] = values.0[k];
            count += usize::from(takes >> k & 1);
        }
        LaneIndices(front)
    }

    /// Transposes quads to lanes (see [`super::arrays::transposed_lane`]).
    #[inline(always)]
    fn to_lanes(self, quads: &Quads) -> [Lanes; 4] {
        std::array::from_fn(|c| Lanes(std::array::from_fn(|lane| quads.0[transposed_lane(lane)][c])))
    }

    /// Transposes lanes to quads.
    #[inline(always)]
    fn to_quads(self, lanes: [&Lanes; 4]) -> Quads {
        Quads(std::array::from_fn(|place| std::array::from_fn(|c| lanes[c].0[transposed_lane(place)])))
    }

    /// Sums of eight pairs of numbers.
    #[inline(always)]
    fn add8(self, a: &[f32; 8], b: &[f32; 8]) -> [f32; 8] {
        std::array::from_fn(|c| a[c] + b[c])
    }

    /// Differences of the first four pairs, sums of the last four.
    #[inline(always)]
    fn subtract_add8(self, a: &[f32; 8], b: &[f32; 8]) -> [f32; 8] {
        std::array::from_fn(|c| if c < 4 { a[c] - b[c] } else { a[c] + b[c] })
    }

    /// The first and the last four numbers of each octet.
    #[inline(always)]
    fn split_octets(self, octets: &Octets) -> [Quads; 2] {
        std::array::from_fn(|half| Quads(octets.map(|octet| std::array::from_fn(|c| octet[4 * half + c]))))
    }

    /// Octets from their first and last four numbers.
    #[inline(always)]
    fn join_octets(self, [first, last]: [&Quads; 2]) -> Octets {
        std::array::from_fn(|k| std::array::from_fn(|c| if c < 4 { first.0[k][c] } else { last.0[k][c - 4] }))
    }
}

impl LaneOps for Scalar {}

#[cfg(target_arch = "aarch64")]
impl LaneOps for pulp::aarch64::Neon {}

impl InstructionSet {
    /// The instruction sets of this machine, widest first. The last one is scalar and runs anywhere.
    pub fn available() -> Vec<Self> {
        let mut all = Vec::new();
        #[cfg(target_arch = "x86_64")]
        {
            use pulp::x86::{V3, V4};
            all.extend(V4::try_new().map(|simd| Self { level: Level::Avx512(simd), name: "AVX-512" }));
            all.extend(V3::try_new().map(|simd| Self { level: Level::Avx2(simd), name: "AVX2" }));
        }
        #[cfg(target_arch = "aarch64")]
        all.extend(
            pulp::aarch64::Neon::try_new().map(|simd| Self { level: Level::Neon(simd), name: "Neon" }),
        );
        all.push(Self { level: Level::Scalar, name: "scalar" });
        all
    }

    /// The widest instruction set of this machine.
    pub fn widest() -> Self {
        Self::available()[0]
    }

    /// Its name, such as `AVX-512`.
    pub fn name(&self) -> &'static str {
        self.name
    }

    /// Runs a task with these instructions.
    #[inline(always)]
    pub(crate) fn run<J: SimdTask>(&self, job: J) -> J::Output {
        match self.level {
            #[cfg(target_arch = "x86_64")]
            Level::Avx512(simd) => simd.vectorize(Inlined { simd, job }),
            #[cfg(target_arch = "x86_64")]
            Level::Avx2(simd) => simd.vectorize(Inlined { simd, job }),
            #[cfg(target_arch = "aarch64")]
            Level::Neon(simd) => simd.vectorize(Inlined { simd, job }),
            Level::Scalar => job.run(Scalar),
        }
    }
}

/// Runs a task in a function of its own within another task, with all registers to itself.
#[inline(always)]
pub(crate) fn run_outlined<S: LaneOps, J: SimdTask>(simd: S, job: J) -> J::Output {
    simd.vectorize(Inlined { simd, job })
}

/// A task on its way into a function with target features. A closure might not be inlined.
struct Inlined<S, J> {
    simd: S,
    job: J,
}

impl<S: LaneOps, J: SimdTask> pulp::NullaryFnOnce for Inlined<S, J> {
    type Output = J::Output;

    #[inline(always)]
    fn call(self) -> J::Output {
        self.job.run(self.simd)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Inputs for moves of bits and indices.
    struct Moves {
        bits: u16,
        bytes: [u8; WIDTH],
        packed: PackedIndices,
        values: Lanes,
    }

    impl SimdTask for Moves {
        /// Bits and inverted bits, widened and unpacked indices, masked permutation and masked splat.
        type Output = ([u16; 2], [[u32; WIDTH]; 2], [[f32; WIDTH]; 2]);

        #[inline(always)]
        fn run<S: LaneOps>(self, simd: S) -> Self::Output {
            let Self { bits, bytes, packed, values } = self;
            let mut found = [0; 2];
            for part in 0..WIDTH / S::F32_LANES {
                let mask = simd.mask_from_bits(bits, part);
                found[0] |= simd.mask_to_bits(mask) << (part * S::F32_LANES);
                found[1] |= simd.mask_to_bits(simd.not_m32s(mask)) << (part * S::F32_LANES);
            }
            let at = simd.unpack(packed);
            let places = [simd.widen(&bytes).0, at.0.map(|place| place % 16)];
            (found, places, [simd.masked_permute(&values, &at, bits).0, simd.splat_masked(0.75, bits).0])
        }
    }

    /// Octets split, joined and added.
    struct Octet(Octets);

    impl SimdTask for Octet {
        type Output = ([[[f32; 4]; WIDTH]; 2], Octets, [[f32; 8]; 2]);

        #[inline(always)]
        fn run<S: LaneOps>(self, simd: S) -> Self::Output {
            let [first, last] = simd.split_octets(&self.0);
            let [a, b, ..] = &self.0;
            let added = [simd.add8(a, b), simd.subtract_add8(a, b)];
            ([first.0, last.0], simd.join_octets([&first, &last]), added)
        }
    }

    #[test]
    fn instruction_sets_agree_on_splitting_and_adding_octets() {
        let mut random = fastrand::Rng::with_seed(1);
        let octets: Octets = std::array::from_fn(|_| std::array::from_fn(|_| random.f32() - 0.5));
        let [a, b, ..] = octets;
        let half = |from: usize| octets.map(|octet| std::array::from_fn(|c| octet[from + c]));
        let signs = [-1.0, -1.0, -1.0, -1.0, 1.0, 1.0, 1.0, 1.0];
        let added = [[1.0; 8], signs].map(|signs| std::array::from_fn(|c| a[c] + signs[c] * b[c]));
        for set in InstructionSet::available() {
            assert_eq!(set.run(Octet(octets)), ([half(0), half(4)], octets, added), "{}", set.name());
        }
    }

    #[test]
    fn instruction_sets_agree_on_masks_and_permutations() {
        let mut random = fastrand::Rng::with_seed(1);
        for _ in 0..2000 {
            let bits = random.u16(..);
            let bytes: [u8; WIDTH] = std::array::from_fn(|_| random.u8(..32));
            let places: [u32; WIDTH] = std::array::from_fn(|_| random.u32(..16));
            let values: [f32; WIDTH] = std::array::from_fn(|_| random.f32() + 1.0);
            let mut packed = PackedIndices::default();
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
            for set in InstructionSet::available() {
                let found = set.run(Moves { bits, bytes, packed, values: Lanes(values) });
                assert_eq!(found, expected, "{}", set.name());
            }
        }
    }
}
