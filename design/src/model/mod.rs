//! Models of a measure over the factors: a Gaussian process on the unique points of the evidence.
//!
//! The latent function of a probability is its log odds; that of a mean is the mean itself, shifted and scaled to the spread of
//! the data. [`Model`] hides the difference: it predicts latent values, and converts them.

pub mod binomial;
pub(crate) mod fantasy;
pub mod gaussian;
pub mod kernel;
mod noise;
mod posterior;
mod prior;
mod root;
mod search;
mod subset;
#[cfg(test)]
mod tests;

use nalgebra::{DMatrix, DVector};

use crate::evidence::{Point, PointRuns};
use crate::factor::Factor;
use crate::measure::Measure;
use crate::usable::credible;
use binomial::Counted;
use gaussian::Replicated;
use kernel::columns;
use noise::Noise;
pub use posterior::{Posterior, Prediction};
use prior::{Hyperparameters, Prior, climb};

/// Evaluations of the likelihood per start of the search for hyperparameters.
const EVALUATIONS: usize = 25;

/// Maximum number of unique points of a model: its cost grows with their cube.
pub const MAX_POINTS: usize = 200;
/// Prior of the noise of means, in squares of the spread: median, and standard deviation of the logarithm.
const NOISE: (f64, f64) = (0.1, 2.0);
/// The same for a simulation whose replicates are equal.
const EXACT: (f64, f64) = (1e-6, 2.0);
/// Magnitudes of responses whose squares are ordinary numbers.
const ORDINARY: std::ops::Range<f64> = 1e-100..1e100;

/// The likelihood of a model.
#[derive(Clone, Debug)]
enum Likelihood {
    Binomial {
        /// The counts at the points of the data.
        counts: Vec<Counted>,
    },
    Gaussian {
        /// Mean and standard deviation of the means of points, in the unit of the response.
        centre: f64,
        spread: f64,
        noise: Noise,
        /// Variance of a value where the relative noise is 1, in squares of the spread.
        variance: f64,
    },
}

/// A posterior, its alternatives and the likelihood.
type Fitted = (Posterior, Vec<Posterior>, Likelihood);

/// The values of a measure by point, in canonical order.
#[derive(Debug, Default)]
struct Data {
    points: Vec<Point>,
    coordinates: Vec<Vec<f64>>,
    values: Vec<Vec<f64>>,
}

impl Data {
    /// The values at points that have any; outliers of a mean are left out.
    fn of<'a>(measure: &Measure, evidence: impl IntoIterator<Item = &'a PointRuns>) -> Self {
        let mut rows: Vec<(&PointRuns, Vec<f64>)> =
            evidence.into_iter().map(|point| (point, point.values(measure))).collect();
        if matches!(measure, Measure::Mean(_)) {
            let credible = credible(&rows.iter().flat_map(|(_, values)| values).copied().collect::<Vec<_>>());
            rows.iter_mut().for_each(|(_, values)| values.retain(|value| credible.contains(value)));
        }
        let mut data = Self::default();
        for (point, values) in rows.into_iter().filter(|(_, values)| !values.is_empty()) {
            data.points.push(point.point.clone());
            data.coordinates.push(point.point.coordinates());
            data.values.push(values);
        }
        data
    }
}

/// A fitted model of one measure.
#[derive(Clone, Debug)]
pub struct Model {
    /// The posterior of the latent function at the points of the data.
    pub posterior: Posterior,
    /// Posteriors with other probable hyperparameters; each counts as much as the first.
    pub alternatives: Vec<Posterior>,
    likelihood: Likelihood,
    /// The points of the data, in canonical order.
    points: Vec<Point>,
}

impl Model {
    /// Fits a model to the values of a measure; none without values, or when numbers overflow. Points without values and outliers
    /// are left out. Of more than [`MAX_POINTS`] points those that fill the range evenly count.
    pub fn fit<'a>(
        factors: &[Factor],
        measure: &Measure,
        evidence: impl IntoIterator<Item = &'a PointRuns>,
    ) -> Option<Self> {
        let data = Data::of(measure, evidence);
        let chosen = subset::spread(&data.coordinates, MAX_POINTS);
        Self::of_data(factors, measure, &data, &subset::fill(chosen, &[], MAX_POINTS))
    }

    /// As [`Model::fit`], for means that may depend on nothing but the factors: where replicates are equal, so is the noise presumed to be
    /// almost none.
    pub(crate) fn fit_simulation(
        factors: &[Factor],
        measure: &Measure,
        evidence: &[PointRuns],
    ) -> Option<Self> {
        let data = Data::of(measure, evidence);
        let replicated = || data.values.iter().filter(|values| values.len() > 1);
        let is_exact = |values: &Vec<f64>| values.iter().all(|value| *value == values[0]);
        let noise = if replicated().count() > 0 && replicated().all(is_exact) { EXACT } else { NOISE };
        let chosen = subset::fill(subset::spread(&data.coordinates, MAX_POINTS), &[], MAX_POINTS);
        Self::of_data_with(factors, measure, &data, &chosen, noise)
    }

    /// As [`Model::fit`], but of more than [`MAX_POINTS`] points half fill the range, and half are those nearest to the boundary at
    /// a level, in standard deviations of a model of the first half.
    pub fn fit_near<'a>(
        factors: &[Factor],
        measure: &Measure,
        evidence: impl IntoIterator<Item = &'a PointRuns>,
        level: f64,
    ) -> Option<Self> {
        let data = Data::of(measure, evidence);
        if data.points.len() <= MAX_POINTS {
            return Self::of_data(factors, measure, &data, &(0..data.points.len()).collect::<Vec<_>>());
        }
        let pilot = subset::spread(&data.coordinates, MAX_POINTS / 2);
        let model =
            Self::of_data(factors, measure, &data, &subset::fill(pilot.clone(), &[], MAX_POINTS / 2))?;
        let prediction = model.posterior.predict(&columns(data.coordinates[0].len(), &data.coordinates));
        let level = model.latent(level);
        let latents = prediction.means.iter().zip(prediction.variances.iter());
        let distances: Vec<f64> =
            latents.map(|(mean, variance)| (mean - level).abs() / variance.sqrt()).collect();
        Self::of_data(factors, measure, &data, &subset::fill(pilot, &distances, MAX_POINTS))
    }

    /// Whether the model rests on a point.
    pub(crate) fn has(&self, point: &Point) -> bool {
        self.points.binary_search(point).is_ok()
    }

    /// The model of the data at some positions, in rising order.
    fn of_data(factors: &[Factor], measure: &Measure, data: &Data, chosen: &[usize]) -> Option<Self> {
        Self::of_data_with(factors, measure, data, chosen, NOISE)
    }

    /// The same with a prior of the noise of means.
    fn of_data_with(
        factors: &[Factor],
        measure: &Measure,
        data: &Data,
        chosen: &[usize],
        noise: (f64, f64),
    ) -> Option<Self> {
        data.points.first()?;
        let coordinates: Vec<&Vec<f64>> = chosen.iter().map(|index| &data.coordinates[*index]).collect();
        let values: Vec<&[f64]> = chosen.iter().map(|index| data.values[*index].as_slice()).collect();
        let points = columns(factors.len(), &coordinates);
        let levels: Vec<usize> = factors.iter().map(|factor| factor.levels.len()).collect();
        let (posterior, alternatives, likelihood) = match measure {
            Measure::Probability(_) => Self::of_counts(&points, &levels, &values),
            Measure::Mean(_) => Self::of_means(&points, &levels, &values, noise),
        }?;
        let points = chosen.iter().map(|index| data.points[*index].clone()).collect();
        Some(Self { posterior, alternatives, likelihood, points })
    }

    fn of_counts(points: &DMatrix<f64>, levels: &[usize], values: &[&[f64]]) -> Option<Fitted> {
        let counted = |values: &&[f64]| Counted { count: values.iter().sum(), n: values.len() as f64 };
        let counts: Vec<Counted> = values.iter().map(counted).collect();
        let prior = Prior { variance: (10.0, 1.0), constant: 9.0, length: (0.7, 0.7) };
        let mut start: Option<DVector<f64>> = None;
        let ((kernel, _), around) = climb(&prior, levels, &[], EVALUATIONS, |kernel, _| {
            let fit = binomial::fit(points, &counts, kernel, start.as_ref())?;
            start = Some(fit.posterior.weights);
            Some((fit.log_likelihood, fit.gradient))
        })?;
        let posterior = |kernel| Some(binomial::fit(points, &counts, kernel, start.as_ref())?.posterior);
        let alternatives = around.iter().filter_map(|(kernel, _)| posterior(kernel)).collect();
        Some((posterior(&kernel)?, alternatives, Likelihood::Binomial { counts }))
    }

    fn of_means(
        points: &DMatrix<f64>,
        levels: &[usize],
        values: &[&[f64]],
        noise_prior: (f64, f64),
    ) -> Option<Fitted> {
        let largest = values.iter().copied().flatten().map(|value| value.abs()).fold(0.0, f64::max);
        let unit = if largest == 0.0 || ORDINARY.contains(&largest) { 1.0 } else { largest };
        let in_units =
            |values: &&[f64]| Replicated::of(&values.iter().map(|value| value / unit).collect::<Vec<_>>());
        let summaries = values.iter().map(in_units).collect::<Option<Vec<_>>>()?;
        let means: Vec<f64> = summaries.iter().map(|summary| summary.mean).collect();
        let sample = roost_stats::Sample::of(&means)?;
        // Equal values have no spread: any scale will do.
        let spread =
            sample.deviation.filter(|deviation| *deviation > 0.0).unwrap_or(sample.mean.abs().max(1.0));
        let scaled = |summary: &Replicated| Replicated {
            n: summary.n,
            mean: (summary.mean - sample.mean) / spread,
            squares: summary.squares / (spread * spread),
        };
        let summaries: Vec<Replicated> = summaries.iter().map(scaled).collect();
        let noise = Noise::of(points, levels, &summaries);
        let relative = noise.at(points);
        let times = |variance: f64| -> Vec<f64> {
            relative.iter().map(|relative| (relative * variance).max(1e-10)).collect()
        };
        let prior = Prior { variance: (1.0, 1.0), constant: 1.0, length: (0.7, 0.7) };
        let (top, around) = climb(&prior, levels, &[noise_prior], EVALUATIONS, |kernel, further| {
            let fit = gaussian::fit(points, &summaries, kernel, &times(further[0]))?;
            Some((fit.log_likelihood, fit.gradient))
        })?;
        let posterior = |(kernel, further): &Hyperparameters| {
            Some(gaussian::fit(points, &summaries, kernel, &times(further[0]))?.posterior)
        };
        let alternatives = around.iter().filter_map(posterior).collect();
        let posterior = posterior(&top)?;
        let (centre, spread) = (sample.mean * unit, spread * unit);
        let likelihood = Likelihood::Gaussian { centre, spread, noise, variance: top.1[0] };
        Some((posterior, alternatives, likelihood))
    }

    /// The posterior and its alternatives, all of the same weight.
    pub fn posteriors(&self) -> impl Iterator<Item = &Posterior> {
        std::iter::once(&self.posterior).chain(&self.alternatives)
    }

    /// The latent value of a probability or mean.
    pub fn latent(&self, value: f64) -> f64 {
        match &self.likelihood {
            Likelihood::Binomial { .. } => (value / (1.0 - value)).ln(),
            Likelihood::Gaussian { centre, spread, .. } => (value - centre) / spread,
        }
    }

    /// The probability or mean of a latent value.
    pub fn value(&self, latent: f64) -> f64 {
        match &self.likelihood {
            Likelihood::Binomial { .. } => binomial::probability(latent),
            Likelihood::Gaussian { centre, spread, .. } => centre + spread * latent,
        }
    }

    /// Whether the latent function is normal for given hyperparameters; for a probability it only is so by Laplace's approximation.
    pub(crate) fn is_normal(&self) -> bool {
        matches!(self.likelihood, Likelihood::Gaussian { .. })
    }

    /// u at the points of a prediction by one of the posteriors: Φ(u) is the probability that the latent function is above a level. Of a
    /// mean it is (m − ℓ)/s, of a probability the signed root (`root`).
    pub(crate) fn distances(
        &self,
        posterior: &Posterior,
        points: &DMatrix<f64>,
        prediction: &Prediction,
        level: f64,
    ) -> Vec<f64> {
        match &self.likelihood {
            Likelihood::Gaussian { .. } => {
                let latents = prediction.means.iter().zip(prediction.variances.iter());
                latents.map(|(mean, variance)| (mean - level) / variance.sqrt()).collect()
            }
            Likelihood::Binomial { counts } => {
                root::signed_roots(posterior, counts, points, prediction, level)
            }
        }
    }

    /// Variance of the latent function as one further run at each point would see it: noise of the response for a mean, the
    /// inverse of the expected Fisher information for a probability. Points are those of the prediction.
    pub fn noise(&self, points: &DMatrix<f64>, prediction: &Prediction) -> Vec<f64> {
        match &self.likelihood {
            Likelihood::Gaussian { noise, variance, .. } => {
                noise.at(points).iter().map(|relative| (relative * variance).max(1e-10)).collect()
            }
            Likelihood::Binomial { .. } => {
                let latents = prediction.means.iter().zip(prediction.variances.iter());
                latents.map(|(mean, variance)| 1.0 / information(*mean, variance.sqrt())).collect()
            }
        }
    }
}

/// Expectation of π(1 − π) over a normal latent value, by the five-point rule of Gauss and Hermite.
fn information(mean: f64, deviation: f64) -> f64 {
    const NODES: [(f64, f64); 5] = [
        (-2.856_970_013_872_806, 0.011_257_411_327_720_69),
        (-1.355_626_179_974_266, 0.222_075_922_005_612_65),
        (0.0, 0.533_333_333_333_333_3),
        (1.355_626_179_974_266, 0.222_075_922_005_612_65),
        (2.856_970_013_872_806, 0.011_257_411_327_720_69),
    ];
    let terms = NODES.iter().map(|(node, weight)| {
        let p = binomial::probability(mean + deviation * node);
        weight * p * (1.0 - p)
    });
    terms.sum::<f64>().max(1e-6)
}
