//! Points that the search compares: over the whole range, and in clouds of shrinking size around good ones.

use crate::space::{mixed_seed, sobol};

/// Half widths of the clouds, in widths of the range.
const CLOUDS: [f64; 4] = [0.2, 0.06, 0.02, 0.005];

/// Points over the whole range.
pub(super) fn spread(count: usize, factors: usize, seed: u64) -> Vec<Vec<f64>> {
    (0..count).map(|index| sobol(index, factors, mixed_seed(seed, 2))).collect()
}

/// `count` points around each centre for each size of cloud. Every other point moves one coordinate only, which finds optima at
/// the edges of the range and in many dimensions.
pub(super) fn clouds(centres: &[Vec<f64>], count: usize, seed: u64) -> Vec<Vec<f64>> {
    let mut points = Vec::new();
    for (position, centre) in centres.iter().enumerate() {
        for (size, half_width) in CLOUDS.iter().enumerate() {
            let seed = mixed_seed(seed, (3 + position * CLOUDS.len() + size) as u64);
            for index in 0..count {
                let moves = sobol(index, centre.len(), seed);
                let only = (index % 2 == 1).then_some(index / 2 % centre.len());
                let moved = centre.iter().zip(moves).enumerate().map(|(factor, (at, number))| {
                    let is_still = only.is_some_and(|only| only != factor);
                    if is_still { *at } else { (at + half_width * (2.0 * number - 1.0)).clamp(0.0, 1.0) }
                });
                points.push(moved.collect());
            }
        }
    }
    points
}
