//! 95 % intervals of Sobol' indices: the union of a bootstrap interval and an interval of Student's t.
//!
//! The bootstrap draws whole rows with replacement and takes quantiles of the indices. The other interval has the standard
//! error of the linearised index (delta method). With few rows each of them misses the truth too often. Their union, each at
//! 98.5 %, holds it in at least 94 % of simulated designs from 64 rows on (`docs/accuracy.md`).

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use statrs::distribution::{ContinuousCDF, StudentsT};

use super::jansen::Terms;

/// Number of bootstrap samples.
const RESAMPLES: usize = 1000;
/// Confidence of each of the two intervals.
const CONFIDENCE: f64 = 0.985;

/// The ends of the interval of each index. There must be at least two rows.
pub(super) fn of(terms: &Terms, indices: &[f64], seed: u64) -> Vec<(f64, f64)> {
    let bootstrap = bootstrap(terms, indices.len(), seed);
    let errors = standard_errors(terms, indices);
    let degrees_of_freedom = terms.rows() as f64 - 1.0;
    let t = StudentsT::new(0.0, 1.0, degrees_of_freedom).expect("at least two rows");
    let quantile = t.inverse_cdf(0.5 + 0.5 * CONFIDENCE);
    let union = |((index, error), (low, high)): ((&f64, f64), (f64, f64))| {
        let half = quantile * error;
        (low.min(index - half), high.max(index + half))
    };
    indices.iter().zip(errors).zip(bootstrap).map(union).collect()
}

/// Quantiles of the indices in bootstrap samples.
fn bootstrap(terms: &Terms, count: usize, seed: u64) -> Vec<(f64, f64)> {
    let mut generator = ChaCha8Rng::seed_from_u64(seed);
    let rows = terms.rows();
    let mut samples = vec![Vec::with_capacity(RESAMPLES); count];
    let mut weights = vec![0.0; rows];
    for _ in 0..RESAMPLES {
        weights.fill(0.0);
        for _ in 0..rows {
            weights[(generator.next_u64() % rows as u64) as usize] += 1.0;
        }
        // A sample without variance or pairs has no indices.
        for (sample, index) in samples.iter_mut().zip(terms.indices(Some(&weights)).into_iter().flatten()) {
            sample.push(index);
        }
    }
    let ends = |mut sample: Vec<f64>| {
        sample.sort_by(f64::total_cmp);
        let at = |share: f64| sample.get((share * (sample.len() as f64 - 1.0)).round() as usize).copied();
        let tail = 0.5 * (1.0 - CONFIDENCE);
        (at(tail).unwrap_or(f64::NEG_INFINITY), at(1.0 - tail).unwrap_or(f64::INFINITY))
    };
    samples.into_iter().map(ends).collect()
}

/// Standard errors of the indices by the delta method: from the mean square of each row's influence.
fn standard_errors(terms: &Terms, indices: &[f64]) -> Vec<f64> {
    let rows = terms.rows() as f64;
    let variance = terms.variance(None);
    let noise = terms.noise_variance(None);
    let level = terms.level.iter().sum::<f64>() / rows;
    let noise_rows = terms.noise.iter().flatten().count() as f64;
    let error = |(position, index): (usize, &f64)| {
        let halves = &terms.halves[position];
        let is_first = position < indices.len() / 2;
        // Of the share s = (half − σ²)/V, which is 1 − S or T.
        let share = if is_first { 1.0 - index } else { *index };
        let pairs = terms.pairs(position) as f64;
        let mean_half = share * variance + noise.unwrap_or(0.0);
        let mean_square = variance + noise.unwrap_or(0.0) + level * level;
        let squares = (0..terms.rows()).map(|row| {
            // Terms that a row lacks have no influence; the others count for more.
            let of_half = halves[row].map_or(0.0, |half| (half - mean_half) * rows / pairs);
            let of_noise = match (terms.noise[row], noise) {
                (Some(term), Some(mean)) => (term - mean) * rows / noise_rows,
                _ => 0.0,
            };
            let of_square = terms.square[row] - mean_square - 2.0 * level * (terms.level[row] - level);
            ((of_half - of_noise - share * (of_square - of_noise)) / variance).powi(2)
        });
        (squares.sum::<f64>() / (rows * (rows - 1.0))).sqrt()
    };
    indices.iter().enumerate().map(error).collect()
}
