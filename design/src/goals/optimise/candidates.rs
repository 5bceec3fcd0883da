//! Points that the search compares: over the whole range, and in clouds of shrinking size around good ones.

use crate::factor::Factor;
use crate::space::{mixed_seed, snapped, sobol};

/// Half widths of the clouds, in widths of the range.
const CLOUDS: [f64; 4] = [0.2, 0.06, 0.02, 0.005];
/// Least half width of a cloud along whole numbers, in distances between them: both neighbours are in it.
const LEAST_STEPS: f64 = 1.5;

/// Points over the whole range.
pub(super) fn spread(count: usize, factors: usize, seed: u64) -> Vec<Vec<f64>> {
    (0..count).map(|index| sobol(index, factors, mixed_seed(seed, 2))).collect()
}

/// `count` points around each centre for each size of cloud. Every other point moves one coordinate only, which finds optima at
/// the edges of the range and in many dimensions. Each centre also comes with every other level of every factor that has such, and with
/// the next whole numbers.
pub(super) fn clouds(factors: &[Factor], centres: &[Vec<f64>], count: usize, seed: u64) -> Vec<Vec<f64>> {
    let mut points = Vec::new();
    for (position, centre) in centres.iter().enumerate() {
        points.extend(neighbours(factors, centre));
        for (size, half_width) in CLOUDS.iter().enumerate() {
            let seed = mixed_seed(seed, (3 + position * CLOUDS.len() + size) as u64);
            for index in 0..count {
                let moves = sobol(index, centre.len(), seed);
                let only = (index % 2 == 1).then_some(index / 2 % centre.len());
                let moved = factors.iter().zip(centre).zip(moves).enumerate();
                let moved = moved.map(|(place, ((factor, at), number))| {
                    let is_still = only.is_some_and(|only| only != place);
                    if is_still { *at } else { around(factor, *at, *half_width, number) }
                });
                points.push(moved.collect());
            }
        }
    }
    points
}

/// A coordinate near another, by a number from 0 to 1. Half of the numbers leave a level as it is, the others choose any.
fn around(factor: &Factor, at: f64, half_width: f64, number: f64) -> f64 {
    if factor.is_categorical() {
        return if number < 0.5 { at } else { 2.0 * number - 1.0 };
    }
    let least = factor.count().map_or(0.0, |count| LEAST_STEPS / count as f64);
    (at + half_width.max(least) * (2.0 * number - 1.0)).clamp(0.0, 1.0)
}

/// Points that differ from one in a level, or in a whole number by 1.
fn neighbours(factors: &[Factor], centre: &[f64]) -> Vec<Vec<f64>> {
    let mut points = Vec::new();
    let centre = snapped(factors, centre.to_vec());
    for (place, factor) in factors.iter().enumerate().filter(|(_, factor)| factor.is_whole) {
        let value = factor.value(centre[place]);
        let others: Vec<f64> = match factor.is_categorical() {
            true => (0..factor.levels.len()).map(|level| level as f64).collect(),
            false => vec![value - 1.0, value + 1.0],
        };
        for coordinate in others.into_iter().filter_map(|other| factor.coordinate(other)) {
            let mut point = centre.clone();
            point[place] = coordinate;
            points.push(point);
        }
    }
    points
}
