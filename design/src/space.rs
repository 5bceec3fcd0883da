//! Points that fill the unit cube: a scrambled Sobol' sequence and regular grids.

/// Number of points of the longest sequence.
pub(crate) const SEQUENCE_LENGTH: usize = 1 << 16;

/// A point of the Sobol' sequence (directions of Joe and Kuo) in Owen's scrambling by hashes (Burley 2020); `index` is below
/// [`SEQUENCE_LENGTH`].
pub(crate) fn sobol(index: usize, factors: usize, seed: u64) -> Vec<f64> {
    // The crate takes 32 bits: both halves of the seed count.
    let seed = (seed ^ (seed >> 32)) as u32;
    (0..factors).map(|factor| f64::from(sobol_burley::sample(index as u32, factor as u32, seed))).collect()
}

/// Points of a grid with `steps` values from 0 to 1 per factor, the last factor varying fastest.
pub(crate) fn grid(steps: usize, factors: usize) -> Vec<Vec<f64>> {
    let point = |index: usize| {
        let digit = |factor: usize| index / steps.pow((factors - 1 - factor) as u32) % steps;
        (0..factors).map(|factor| digit(factor) as f64 / (steps - 1) as f64).collect()
    };
    (0..steps.pow(factors as u32)).map(point).collect()
}

/// A seed for one of several sequences: all bits of seed and stream count (Stafford's mix 13).
pub(crate) fn mixed_seed(seed: u64, stream: u64) -> u64 {
    let mut word = seed.wrapping_add((stream + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15));
    word = (word ^ (word >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    word = (word ^ (word >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    word ^ (word >> 31)
}
