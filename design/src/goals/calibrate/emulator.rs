//! Emulators: a model of each measured number over the parameters, instead of a simulation for every set that the posterior considers.
//!
//! A positive number that varies over a factor of [`RATIO`] or more is modelled by its logarithm, as moduli and stresses are. Of a share
//! of yes, means and variances are those of the log odds.

use std::collections::BTreeMap;

use nalgebra::DMatrix;

use crate::evidence::{Outcome, PointRuns};
use crate::factor::Factor;
use crate::measure::Measure;
use crate::model::Model;

/// Ratio of the largest to the smallest value from which on logarithms are modelled.
const RATIO: f64 = 3.0;
/// Fewest values of a model.
const MIN_VALUES: usize = 3;
/// Name of the response of a model.
const VALUE: &str = "value";

/// A model of a number over the parameters.
#[derive(Clone, Debug)]
pub(super) struct Emulator {
    model: Model,
    is_log: bool,
    is_share: bool,
}

/// Prediction of an emulator at some sets of parameters.
#[derive(Clone, Debug)]
pub(super) struct Emulated {
    /// Expected means of runs; of a share of yes, its log odds.
    pub(super) means: Vec<f64>,
    /// Variances of these means: what the emulator does not know.
    pub(super) variances: Vec<f64>,
}

impl Emulator {
    /// The emulator of a measure from the runs of a test; none with too few values.
    pub(super) fn fit(parameters: &[Factor], measure: &Measure, runs: &[PointRuns]) -> Option<Self> {
        let values: Vec<f64> = runs.iter().flat_map(|point| point.values(measure)).collect();
        if values.len() < MIN_VALUES {
            return None;
        }
        let is_share = matches!(measure, Measure::Probability(_));
        let (low, high) = values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| {
            (low.min(*value), high.max(*value))
        });
        let is_log = !is_share && low > 0.0 && high >= RATIO * low;
        let transformed = |point: &PointRuns| {
            let values = point.values(measure).into_iter();
            let values = values.map(|value| if is_log { value.ln() } else { value });
            of_values(point, values.collect())
        };
        let runs: Vec<PointRuns> = runs.iter().map(transformed).collect();
        let model = if is_share {
            Model::fit(parameters, &Measure::Probability(VALUE.to_owned()), &runs)
        } else {
            Model::fit_simulation(parameters, &Measure::Mean(VALUE.to_owned()), &runs)
        };
        Some(Self { model: model?, is_log, is_share })
    }

    /// The model, whose latent values [`Emulator::latent_error`] refers to.
    pub(super) fn model(&self) -> &Model {
        &self.model
    }

    /// The prediction at sets of parameters (columns).
    pub(super) fn at(&self, points: &DMatrix<f64>) -> Emulated {
        let prediction = self.model.posterior.predict(points);
        let latents = prediction.means.iter().zip(prediction.variances.iter());
        if self.is_share {
            let (means, variances) = latents.unzip();
            return Emulated { means, variances };
        }
        let scale = self.scale();
        if !self.is_log {
            let (means, variances) =
                latents.map(|(mean, variance)| (self.model.value(*mean), scale * scale * variance)).unzip();
            return Emulated { means, variances };
        }
        // Mean and variance of a log-normal number; the mean over seeds includes the noise.
        let noise = self.model.noise(points, &prediction);
        let (means, variances) = latents
            .zip(noise)
            .map(|((mean, variance), noise)| {
                let variance = scale * scale * variance;
                let mean = (self.model.value(*mean) + 0.5 * (variance + scale * scale * noise)).exp();
                (mean, mean * mean * variance.exp_m1())
            })
            .unzip();
        Emulated { means, variances }
    }

    /// A standard deviation around an emulated mean, in latent values of the model.
    pub(super) fn latent_error(&self, mean: f64, error: f64) -> f64 {
        let relative = if self.is_log { error / mean.abs().max(f64::MIN_POSITIVE) } else { error };
        relative / self.scale()
    }

    /// The value of one latent unit.
    fn scale(&self) -> f64 {
        self.model.value(1.0) - self.model.value(0.0)
    }
}

/// The value of a measure in all runs, if there are enough runs and all have the same. Equal answers of yes or no are chance: none for these.
pub(super) fn constant(measure: &Measure, runs: &[PointRuns]) -> Option<f64> {
    if matches!(measure, Measure::Probability(_)) {
        return None;
    }
    let values: Vec<f64> = runs.iter().flat_map(|point| point.values(measure)).collect();
    let is_constant = values.len() >= MIN_VALUES && values.iter().all(|value| *value == values[0]);
    is_constant.then(|| values[0])
}

/// The runs at a point, each with one value.
pub(super) fn of_values(point: &PointRuns, values: Vec<f64>) -> PointRuns {
    let outcome = |value| Outcome::Responses(BTreeMap::from([(VALUE.to_owned(), value)]));
    PointRuns {
        point: point.point.clone(),
        runs: (0..).zip(values.into_iter().map(outcome)).collect(),
        impossible: None,
    }
}

/// A model of the probability that a run of a test ends with all numbers of its targets; none when every run does.
pub(super) fn completeness(
    parameters: &[Factor],
    measures: &[&Measure],
    runs: &[PointRuns],
) -> Option<Model> {
    let is_complete = |outcome: &Outcome| match outcome {
        Outcome::Responses(responses) => {
            let has = |measure: &&Measure| {
                responses.get(measure.response()).is_some_and(|value| measure.accepts(*value))
            };
            Some(f64::from(u8::from(measures.iter().all(has))))
        }
        Outcome::Failed => Some(0.0),
        Outcome::Pending | Outcome::Cancelled => None,
    };
    let ended = |point: &PointRuns| of_values(point, point.runs.values().filter_map(is_complete).collect());
    let runs: Vec<PointRuns> = runs.iter().map(ended).collect();
    let measure = Measure::Probability(VALUE.to_owned());
    let is_any_incomplete = runs.iter().any(|point| point.values(&measure).contains(&0.0));
    if is_any_incomplete { Model::fit(parameters, &measure, &runs) } else { None }
}
