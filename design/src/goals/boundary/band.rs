//! The band that holds the whole boundary with 95 % confidence.
//!
//! | symbol | meaning |
//! |---|---|
//! | m | posterior mean of the latent function at a point of the map |
//! | ℓ | its level at the boundary |
//! | s | standard deviation with which Φ(−\|m − ℓ\|/s) is the posterior probability of the other side |
//! | z | the band is where \|m − ℓ\| ≤ z s; elsewhere the side of the boundary is known |
//!
//! The boundary is inside the band when every point outside is on the side of its mean. For a draw f from the joint posterior,
//! the smallest z with this property is the maximum of |m − ℓ|/s over the points where f and m are on different sides. The z of
//! the answer is the 95 % quantile over draws, hence a statement about the whole boundary, not about each point. Draws are normal,
//! and shifted such that each point is as often beyond the level as its posterior says (the quantile correction of Bolin and
//! Lindgren 2015).

use std::f64::consts::FRAC_1_SQRT_2;

use nalgebra::{DMatrix, DVector};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use serde::{Deserialize, Serialize};
use statrs::distribution::{ContinuousCDF, Normal};
use statrs::function::erf::erfc;

use crate::factor::Factor;
use crate::model::kernel::columns;
use crate::model::{Model, Posterior, Prediction};
use crate::space::{mixed_seed, snapped, sobol};

/// Number of draws from the posterior.
const DRAWS: usize = 400;
/// Maximum number of points of a draw; more are thinned evenly, since neighbours hardly differ.
const MAX_POINTS: usize = 200;
/// Points with |m − ℓ| beyond this many s are on the wrong side in almost no draw.
const FAR: f64 = 4.0;
/// Number of points that fill the range, and the stream of their seed.
const FILLING: usize = 1024;
const FILLING_STREAM: u64 = 1;
/// Distance from the level, in deviations, below which the posterior counts as normal.
const NEAR: f64 = 0.1;
/// Least probability of a side.
const LEAST: f64 = 1e-15;
/// Confidence of the band.
const CONFIDENCE: f64 = 0.95;

/// The side of the boundary on which a point is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Side {
    /// Below the level.
    Below,
    /// Above the level.
    Above,
    /// In the band: not known with 95 % confidence.
    Band,
}

/// The latent function at points of a map.
#[derive(Debug)]
pub(super) struct Band {
    pub(super) means: Vec<f64>,
    pub(super) deviations: Vec<f64>,
    /// Standard deviations of the latent function itself, for the end of an interval that lies away from the level.
    spreads: Vec<f64>,
    pub(super) level: f64,
    /// z.
    pub(super) multiplier: f64,
}

impl Band {
    pub(super) fn of(model: &Model, points: &[Vec<f64>], level: f64, seed: u64) -> Self {
        let map = columns(points[0].len(), points);
        let latents = mixture(model, &map, level);
        let each = |of: fn(&Latent) -> f64| latents.iter().map(of).collect();
        let (means, deviations) = (each(|it| it.mean), each(|it| it.deviation));
        let mut band =
            Self { means, deviations, spreads: each(|it| it.spread), level, multiplier: f64::INFINITY };
        band.multiplier = band.quantile(model, &map, seed);
        band
    }

    /// (m − ℓ) / s.
    pub(super) fn distance(&self, point: usize) -> f64 {
        (self.means[point] - self.level) / self.deviations[point]
    }

    /// Both ends of the interval of the latent function, at the confidence of the band.
    pub(super) fn interval(&self, point: usize) -> (f64, f64) {
        let (mean, towards, away) = (self.means[point], self.deviations[point], self.spreads[point]);
        let (below, above) = if mean < self.level { (away, towards) } else { (towards, away) };
        (mean - self.multiplier * below, mean + self.multiplier * above)
    }

    pub(super) fn side(&self, point: usize) -> Side {
        let distance = self.distance(point);
        match distance.abs() <= self.multiplier {
            true => Side::Band,
            false if distance > 0.0 => Side::Above,
            false => Side::Below,
        }
    }

    fn quantile(&self, model: &Model, map: &DMatrix<f64>, seed: u64) -> f64 {
        let pointwise = Normal::standard().inverse_cdf(0.5 + 0.5 * CONFIDENCE);
        let near: Vec<usize> =
            (0..self.means.len()).filter(|point| self.distance(*point).abs() < FAR).collect();
        let step = near.len().div_ceil(MAX_POINTS).max(1);
        let chosen: Vec<usize> = near.into_iter().step_by(step).collect();
        if chosen.is_empty() {
            return pointwise;
        }
        let points = map.select_columns(&chosen);
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let posteriors = model.posteriors().count();
        let mut needed: Vec<f64> = Vec::new();
        for posterior in model.posteriors() {
            let prediction = posterior.predict(&points);
            let mut covariances = posterior.covariances(&points, &prediction);
            for index in 0..chosen.len() {
                // Neighbours are almost the same: keep the matrix positive definite.
                covariances[(index, index)] +=
                    1e-6 * covariances[(index, index)] + 1e-9 * posterior.prior_variance();
            }
            let Some(factor) = covariances.cholesky() else { return FAR };
            let numbers =
                DMatrix::from_fn(chosen.len(), DRAWS.div_ceil(posteriors), |_, _| normal(&mut random));
            let mut draws = factor.l() * numbers;
            let distances = model.distances(posterior, &points, &prediction, self.level);
            let gaps = distances.iter().zip(prediction.variances.iter());
            let gaps = DVector::from_iterator(chosen.len(), gaps.map(|(u, variance)| u * variance.sqrt()));
            for mut draw in draws.column_iter_mut() {
                draw += &gaps;
            }
            needed.extend(draws.column_iter().map(|draw| self.needed(&chosen, draw.as_slice())));
        }
        needed.sort_by(f64::total_cmp);
        needed[(CONFIDENCE * needed.len() as f64).ceil() as usize - 1].max(pointwise)
    }

    /// The smallest z whose band holds the boundary of a draw, which has differences from the level at some points.
    fn needed(&self, points: &[usize], draw: &[f64]) -> f64 {
        let wrong =
            points.iter().zip(draw).filter(|(point, gap)| (self.means[**point] - self.level) * **gap < 0.0);
        wrong.map(|(point, _)| self.distance(*point).abs()).fold(0.0, f64::max)
    }
}

/// The expected share of the range on the wrong side of the estimated boundary.
///
/// It is a mean over points that fill the range evenly. The map would not do: most points of a grid in four factors are on its faces,
/// where runs inform least. Nor would the points of the first design, where they inform most: the sequence is another.
pub(super) fn misclassified(model: &Model, factors: &[Factor], level: f64, seed: u64) -> f64 {
    let seed = mixed_seed(seed, FILLING_STREAM);
    let point = |index| snapped(factors, sobol(index, factors.len(), seed));
    let points: Vec<Vec<f64>> = (0..FILLING).map(point).collect();
    let map = columns(factors.len(), &points);
    let latents = mixture(model, &map, level);
    latents.iter().map(|it| tail((it.mean - level).abs() / it.deviation)).sum::<f64>() / FILLING as f64
}

/// Φ(−u).
fn tail(u: f64) -> f64 {
    0.5 * erfc(u * FRAC_1_SQRT_2)
}

/// The latent function at a point, over all posteriors of a model.
struct Latent {
    /// m.
    mean: f64,
    /// s: Φ(−|m − ℓ|/s) is the probability of the other side.
    deviation: f64,
    /// Its standard deviation.
    spread: f64,
}

/// The latent function at points. The mixture of a mean counts as normal, which makes the band slightly wider.
fn mixture(model: &Model, points: &DMatrix<f64>, level: f64) -> Vec<Latent> {
    let predicted = |posterior: &Posterior| {
        let prediction = posterior.predict(points);
        let distances = model.distances(posterior, points, &prediction, level);
        (prediction, distances)
    };
    let predictions: Vec<(Prediction, Vec<f64>)> = model.posteriors().map(predicted).collect();
    let mean_of = |value: &dyn Fn(&Prediction, &[f64]) -> f64| {
        let values = predictions.iter().map(|(prediction, distances)| value(prediction, distances));
        values.sum::<f64>() / predictions.len() as f64
    };
    let latents = (0..points.ncols()).map(|point| {
        let mean = mean_of(&|prediction, _| prediction.means[point]);
        let square = |found: &Prediction| found.variances[point] + (found.means[point] - mean).powi(2);
        let spread = mean_of(&|prediction, _| square(prediction)).sqrt();
        let gap = mean - level;
        let wrong = mean_of(&|_, distances| tail(gap.signum() * distances[point]));
        let distance = -Normal::standard().inverse_cdf(wrong.max(LEAST));
        let is_normal = model.is_normal() || gap.abs() < NEAR * spread || distance < NEAR;
        Latent { mean, deviation: if is_normal { spread } else { gap.abs() / distance }, spread }
    });
    latents.collect()
}

/// A normal number of mean 0 and variance 1 (Box and Muller 1958).
fn normal(random: &mut ChaCha8Rng) -> f64 {
    let mut uniform = || (random.next_u64() >> 11) as f64 / (1_u64 << 53) as f64;
    let radius = (-2.0 * (1.0 - uniform()).ln()).sqrt();
    radius * (std::f64::consts::TAU * uniform()).cos()
}
