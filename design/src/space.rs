//! Points that fill the unit cube: a scrambled Sobol' sequence and regular grids.

use std::collections::BTreeSet;

use crate::evidence::Point;
use crate::factor::Factor;

/// Number of points of the longest sequence.
pub(crate) const SEQUENCE_LENGTH: usize = 1 << 16;

/// A point of the Sobol' sequence (directions of Joe and Kuo) in Owen's scrambling by hashes (Burley 2020); `index` is below
/// [`SEQUENCE_LENGTH`].
pub(crate) fn sobol(index: usize, factors: usize, seed: u64) -> Vec<f64> {
    // The crate takes 32 bits: both halves of the seed count.
    let seed = (seed ^ (seed >> 32)) as u32;
    (0..factors).map(|factor| f64::from(sobol_burley::sample(index as u32, factor as u32, seed))).collect()
}

/// Different points of the sequence with the values of some factors, as far as some indices lead. Whole numbers and levels repeat themselves.
pub(crate) fn distinct(
    factors: &[Factor],
    indices: std::ops::Range<usize>,
    seed: u64,
) -> impl Iterator<Item = Point> {
    let mut seen = BTreeSet::new();
    let points = indices.map(move |index| Point::new(&sobol(index, factors.len(), seed)).rounded(factors));
    points.filter(move |point| seen.insert(point.clone()))
}

/// Coordinates with those of whole numbers and levels moved to their places.
pub(crate) fn snapped(factors: &[Factor], mut coordinates: Vec<f64>) -> Vec<f64> {
    for (factor, coordinate) in factors.iter().zip(&mut coordinates).filter(|(factor, _)| factor.is_whole) {
        *coordinate = factor.coordinate(factor.value(*coordinate)).unwrap_or(*coordinate);
    }
    coordinates
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
