//! The band that holds the whole boundary with 95 % confidence.
//!
//! | symbol | meaning |
//! |---|---|
//! | m, s | posterior mean and standard deviation of the latent function at a point of the map |
//! | ℓ | its level at the boundary |
//! | z | the band is where \|m − ℓ\| ≤ z s; elsewhere the side of the boundary is known |
//!
//! The boundary is inside the band when every point outside is on the side of its mean. For a draw f from the joint posterior,
//! the smallest z with this property is the maximum of |m − ℓ|/s over the points where f and m are on different sides. The z of
//! the answer is the 95 % quantile over draws, hence a statement about the whole boundary, not about each point
//! (after Bolin and Lindgren 2015).

use nalgebra::DMatrix;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use serde::{Deserialize, Serialize};
use statrs::distribution::{ContinuousCDF, Normal};
use statrs::function::erf::erfc;

use crate::factor::Factor;
use crate::model::kernel::columns;
use crate::model::{Model, Prediction};
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
    pub(super) level: f64,
    /// z.
    pub(super) multiplier: f64,
}

impl Band {
    pub(super) fn of(model: &Model, points: &[Vec<f64>], level: f64, seed: u64) -> Self {
        let map = columns(points[0].len(), points);
        let (means, variances) = mixture(&predictions(model, &map));
        let deviations = variances.iter().map(|variance| variance.sqrt()).collect();
        let mut band = Self { means, deviations, level, multiplier: f64::INFINITY };
        band.multiplier = band.quantile(model, &map, seed);
        band
    }

    /// (m − ℓ) / s.
    pub(super) fn distance(&self, point: usize) -> f64 {
        (self.means[point] - self.level) / self.deviations[point]
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
            for mut draw in draws.column_iter_mut() {
                draw += &prediction.means;
            }
            needed.extend(draws.column_iter().map(|draw| self.needed(&chosen, draw.as_slice())));
        }
        needed.sort_by(f64::total_cmp);
        needed[(CONFIDENCE * needed.len() as f64).ceil() as usize - 1].max(pointwise)
    }

    /// The smallest z whose band holds the boundary of a draw at some points.
    fn needed(&self, points: &[usize], draw: &[f64]) -> f64 {
        let wrong = points
            .iter()
            .zip(draw)
            .filter(|(point, value)| (self.means[**point] - self.level) * (**value - self.level) < 0.0);
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
    let (means, variances) = mixture(&predictions(model, &map));
    let latents = means.iter().zip(&variances);
    let wrong = latents.map(|(mean, variance)| 0.5 * erfc((mean - level).abs() / (2.0 * variance).sqrt()));
    wrong.sum::<f64>() / FILLING as f64
}

/// Predictions of all posteriors of a model.
fn predictions(model: &Model, points: &DMatrix<f64>) -> Vec<Prediction> {
    model.posteriors().map(|posterior| posterior.predict(points)).collect()
}

/// Means and variances of a mixture of predictions with the same weight.
fn mixture(predictions: &[Prediction]) -> (Vec<f64>, Vec<f64>) {
    let share = 1.0 / predictions.len() as f64;
    let points = predictions[0].means.len();
    let sum = |value: &dyn Fn(&Prediction) -> f64| predictions.iter().map(value).sum::<f64>() * share;
    let mean = |point: usize| sum(&|prediction| prediction.means[point]);
    let means: Vec<f64> = (0..points).map(mean).collect();
    let variance = |point: usize| {
        sum(&|prediction| prediction.variances[point] + (prediction.means[point] - means[point]).powi(2))
    };
    let variances = (0..points).map(variance).collect();
    (means, variances)
}

/// A normal number of mean 0 and variance 1 (Box and Muller 1958).
fn normal(random: &mut ChaCha8Rng) -> f64 {
    let mut uniform = || (random.next_u64() >> 11) as f64 / (1_u64 << 53) as f64;
    let radius = (-2.0 * (1.0 - uniform()).ln()).sqrt();
    radius * (std::f64::consts::TAU * uniform()).cos()
}
