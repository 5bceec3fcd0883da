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
mod search;
#[cfg(test)]
mod tests;

use nalgebra::{DMatrix, DVector};

use crate::evidence::PointRuns;
use crate::question::Measure;
use binomial::Counted;
use gaussian::Replicated;
use kernel::columns;
use noise::Noise;
pub use posterior::{Posterior, Prediction};
use prior::{Hyperparameters, Prior, climb};

/// Evaluations of the likelihood per start of the search for hyperparameters.
const EVALUATIONS: usize = 25;

/// The likelihood of a model.
#[derive(Clone, Debug)]
enum Likelihood {
    Binomial,
    Gaussian {
        /// Mean and standard deviation of the means of points, in the unit of the response.
        centre: f64,
        spread: f64,
        noise: Noise,
        /// Variance of a value where the relative noise is 1, in squares of the spread.
        variance: f64,
    },
}

/// A fitted model of one measure.
#[derive(Clone, Debug)]
pub struct Model {
    /// The posterior of the latent function at the points of the data.
    pub posterior: Posterior,
    /// Posteriors with other probable hyperparameters; each counts as much as the first.
    pub alternatives: Vec<Posterior>,
    likelihood: Likelihood,
}

impl Model {
    /// Fits a model to the values of a measure; none without values, or when numbers overflow. Points without values are left out.
    pub fn fit<'a>(measure: &Measure, evidence: impl IntoIterator<Item = &'a PointRuns>) -> Option<Self> {
        let mut coordinates = Vec::new();
        let mut values = Vec::new();
        for point in evidence {
            let found = point.values(measure);
            if !found.is_empty() {
                coordinates.push(point.point.coordinates());
                values.push(found);
            }
        }
        let factors = coordinates.first()?.len();
        let points = columns(factors, &coordinates);
        match measure {
            Measure::Probability(_) => Self::of_counts(&points, &values),
            Measure::Mean(_) => Self::of_means(&points, &values),
        }
    }

    fn of_counts(points: &DMatrix<f64>, values: &[Vec<f64>]) -> Option<Self> {
        let counted = |values: &Vec<f64>| Counted {
            count: values.iter().filter(|value| **value != 0.0).count() as f64,
            n: values.len() as f64,
        };
        let counts: Vec<Counted> = values.iter().map(counted).collect();
        let prior = Prior { variance: (10.0, 1.0), constant: 9.0, length: (0.7, 0.7) };
        let mut start: Option<DVector<f64>> = None;
        let ((kernel, _), around) = climb(&prior, points.nrows(), &[], EVALUATIONS, |kernel, _| {
            let fit = binomial::fit(points, &counts, kernel, start.as_ref())?;
            start = Some(fit.posterior.weights);
            Some((fit.log_likelihood, fit.gradient))
        })?;
        let posterior = |kernel| Some(binomial::fit(points, &counts, kernel, start.as_ref())?.posterior);
        let alternatives = around.iter().filter_map(|(kernel, _)| posterior(kernel)).collect();
        Some(Self { posterior: posterior(&kernel)?, alternatives, likelihood: Likelihood::Binomial })
    }

    fn of_means(points: &DMatrix<f64>, values: &[Vec<f64>]) -> Option<Self> {
        let summaries = values.iter().map(|values| Replicated::of(values)).collect::<Option<Vec<_>>>()?;
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
        let noise = Noise::of(points, &summaries);
        let relative = noise.at(points);
        let times = |variance: f64| -> Vec<f64> {
            relative.iter().map(|relative| (relative * variance).max(1e-10)).collect()
        };
        let prior = Prior { variance: (1.0, 1.0), constant: 1.0, length: (0.7, 0.7) };
        let (top, around) = climb(&prior, points.nrows(), &[(0.1, 2.0)], EVALUATIONS, |kernel, further| {
            let fit = gaussian::fit(points, &summaries, kernel, &times(further[0]))?;
            Some((fit.log_likelihood, fit.gradient))
        })?;
        let posterior = |(kernel, further): &Hyperparameters| {
            Some(gaussian::fit(points, &summaries, kernel, &times(further[0]))?.posterior)
        };
        let alternatives = around.iter().filter_map(posterior).collect();
        let posterior = posterior(&top)?;
        let likelihood = Likelihood::Gaussian { centre: sample.mean, spread, noise, variance: top.1[0] };
        Some(Self { posterior, alternatives, likelihood })
    }

    /// The posterior and its alternatives, all of the same weight.
    pub fn posteriors(&self) -> impl Iterator<Item = &Posterior> {
        std::iter::once(&self.posterior).chain(&self.alternatives)
    }

    /// The latent value of a probability or mean.
    pub fn latent(&self, value: f64) -> f64 {
        match &self.likelihood {
            Likelihood::Binomial => (value / (1.0 - value)).ln(),
            Likelihood::Gaussian { centre, spread, .. } => (value - centre) / spread,
        }
    }

    /// The probability or mean of a latent value.
    pub fn value(&self, latent: f64) -> f64 {
        match &self.likelihood {
            Likelihood::Binomial => binomial::probability(latent),
            Likelihood::Gaussian { centre, spread, .. } => centre + spread * latent,
        }
    }

    /// Variance of the latent function as one further run at each point would see it: noise of the response for a mean, the
    /// inverse of the expected Fisher information for a probability. Points are those of the prediction.
    pub fn noise(&self, points: &DMatrix<f64>, prediction: &Prediction) -> Vec<f64> {
        match &self.likelihood {
            Likelihood::Gaussian { noise, variance, .. } => {
                noise.at(points).iter().map(|relative| (relative * variance).max(1e-10)).collect()
            }
            Likelihood::Binomial => {
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
