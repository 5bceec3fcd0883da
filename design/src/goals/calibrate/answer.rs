//! The finding of the goal: intervals of the parameters, the best set, and simulated against measured numbers.

use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};
use statrs::distribution::{ContinuousCDF, StudentsT};

use super::density::Density;
use super::emulator::constant;
use super::identifiability::{self, Narrowing, PairOfParameters};
use super::sampler::Samples;
use super::{Calibrate, Setup, Target};
use crate::evidence::{Outcome, PointRuns};
use crate::intervals::CONFIDENCE;
use crate::model::binomial::probability;

/// Maximum number of samples in the answer.
const LISTED: usize = 500;
/// Places of each range by which the deviation of its prior is computed.
const PRIOR_PLACES: usize = 4000;

/// The finding of the goal.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CalibrateAnswer {
    /// The parameters, in the order of the question; empty before the first results.
    pub parameters: Vec<ParameterEstimate>,
    /// Samples of the posterior: values of the parameters, in their units.
    pub samples: Vec<Vec<f64>>,
    /// Correlations of the samples, along the scales of the factors.
    pub correlations: Vec<Vec<f64>>,
    /// The share of discrepancy, where the question allows one.
    pub discrepancy: Option<Interval>,
    /// Simulated against measured numbers, in the order of the question.
    pub targets: Vec<TargetAgreement>,
    /// Largest share of the emulators in the variance with which a measured number is compared, of all numbers that have an emulator.
    pub emulator_share: Option<f64>,
    /// Pairs of parameters of which the tests tell a combination, but not each.
    pub pairs: Vec<PairOfParameters>,
    /// Responses of the tests that were not measured, and would narrow a parameter or pair; known when the study has ended.
    pub further: Vec<Narrowing>,
    /// Largest R̂ of the samples: above 1.05 the intervals are rough.
    pub r_hat: Option<f64>,
    /// Effective number of independent samples.
    pub effective_samples: Option<f64>,
}

/// Mean and 95 % interval of samples of the posterior.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Interval {
    /// Mean.
    pub mean: f64,
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

/// A parameter.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ParameterEstimate {
    /// Its name.
    pub parameter: String,
    /// Mean and 95 % interval of the samples, in the unit of the field.
    pub estimate: Interval,
    /// Its value in the most probable set of the samples.
    pub best: f64,
    /// Standard deviation along the scale of the factor, relative to that of the prior: 1 when the tests say nothing.
    pub remaining: f64,
}

/// A measured number and its simulation with the posterior.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TargetAgreement {
    /// The measured number.
    pub target: Target,
    /// Number of runs with this number.
    pub runs: usize,
    /// Number of ended runs without it: failed ones, and those that did not reach it.
    pub without: usize,
    /// Simulated mean and its 95 % interval over the posterior; none before enough runs have the number.
    pub simulated: Option<Interval>,
    /// Distance of the measured mean from the simulated one, in standard deviations of their difference; of shares, that of the log odds.
    pub distance: Option<f64>,
}

impl TargetAgreement {
    /// Whether simulation and measurement contradict each other: the distance is above the two-sided 99 % quantile of Student's t with n − 1
    /// degrees of freedom; of shares, and of deviations that come from elsewhere, of the normal distribution.
    pub fn is_contradicted(&self) -> bool {
        let freedom = if self.target.is_share() { 0 } else { self.target.n.saturating_sub(1) };
        let limit =
            StudentsT::new(0.0, 1.0, freedom as f64).map_or(2.576, |students| students.inverse_cdf(0.995));
        self.distance.is_some_and(|distance| distance.abs() > limit)
    }
}

/// Mean and the interval between quantiles of some values.
fn estimated(mut values: Vec<f64>) -> Interval {
    values.sort_by(f64::total_cmp);
    let quantile = |share: f64| values[((values.len() - 1) as f64 * share).round() as usize];
    let tail = 0.5 * (1.0 - CONFIDENCE);
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    Interval { mean, low: quantile(tail), high: quantile(1.0 - tail) }
}

/// Runs of a test with and without a measured number.
fn counts(target: &Target, runs: &[PointRuns]) -> (usize, usize) {
    let with = runs.iter().map(|point| point.values(&target.of).len()).sum();
    let is_ended = |outcome: &&Outcome| matches!(outcome, Outcome::Responses(_) | Outcome::Failed);
    let ended: usize = runs.iter().map(|point| point.runs.values().filter(is_ended).count()).sum();
    (with, ended - with)
}

impl CalibrateAnswer {
    /// The answer before there are enough results.
    pub(super) fn unknown(goal: &Calibrate) -> Self {
        let targets = goal.targets.iter().map(|target| TargetAgreement {
            target: target.clone(),
            runs: 0,
            without: 0,
            simulated: None,
            distance: None,
        });
        Self {
            parameters: Vec::new(),
            samples: Vec::new(),
            correlations: Vec::new(),
            discrepancy: None,
            targets: targets.collect(),
            emulator_share: None,
            pairs: Vec::new(),
            further: Vec::new(),
            r_hat: None,
            effective_samples: None,
        }
    }

    pub(super) fn of(
        goal: &Calibrate,
        setup: &Setup<'_>,
        density: &Density<'_>,
        samples: &Samples,
        by_test: &[Vec<PointRuns>],
        is_last: bool,
    ) -> Self {
        let factors = density.parameters;
        let posterior =
            identifiability::Posterior::of(factors.len(), &samples.states, &prior_deviations(density));
        let parameters = factors.iter().enumerate().map(|(index, factor)| ParameterEstimate {
            parameter: factor.name.clone(),
            estimate: estimated(samples.states.iter().map(|state| factor.place(state[index])).collect()),
            best: factor.value(samples.best[index]),
            remaining: posterior.remaining(index),
        });
        let step = samples.states.len().div_ceil(LISTED).max(1);
        let listed: Vec<&Vec<f64>> = samples.states.iter().step_by(step).collect();
        let values = |state: &&Vec<f64>| -> Vec<f64> {
            factors.iter().zip(state.iter()).map(|(factor, coordinate)| factor.value(*coordinate)).collect()
        };
        let (targets, shares): (Vec<TargetAgreement>, Vec<Option<f64>>) =
            agreements(goal, setup, density, &listed, by_test).into_iter().unzip();
        let emulator_share = shares.into_iter().flatten().reduce(f64::max);
        let shares = samples.states.iter().map(|state| density.share(state));
        Self {
            parameters: parameters.collect(),
            samples: listed.iter().map(values).collect(),
            correlations: posterior.correlations(),
            discrepancy: goal.discrepancy.map(|_| estimated(shares.collect())),
            targets,
            emulator_share,
            pairs: posterior.pairs(factors),
            // It fits a model to every response.
            further: if is_last {
                identifiability::further(goal, setup, density, &posterior, &listed, by_test)
            } else {
                Vec::new()
            },
            r_hat: Some(samples.r_hat),
            effective_samples: Some(samples.effective),
        }
    }
}

/// Standard deviations of the priors, along the scales of the factors.
fn prior_deviations(density: &Density<'_>) -> Vec<f64> {
    let deviation = |index: usize| {
        let places = (0..PRIOR_PLACES).map(|place| (place as f64 + 0.5) / PRIOR_PLACES as f64);
        let logs: Vec<(f64, f64)> = places.map(|place| (place, density.ln_prior_of(index, place))).collect();
        let largest = logs.iter().map(|(_, ln)| *ln).fold(f64::NEG_INFINITY, f64::max);
        let weights: Vec<(f64, f64)> =
            logs.into_iter().map(|(place, ln)| (place, (ln - largest).exp())).collect();
        let total: f64 = weights.iter().map(|(_, weight)| weight).sum();
        let mean = weights.iter().map(|(place, weight)| place * weight).sum::<f64>() / total;
        let squares = weights.iter().map(|(place, weight)| weight * (place - mean).powi(2)).sum::<f64>();
        // A prior that is narrower than the places are apart.
        (squares / total).sqrt().max(0.5 / PRIOR_PLACES as f64)
    };
    (0..density.parameters.len()).map(deviation).collect()
}

/// Simulated against measured numbers, each with the share of its emulator in the variance of the comparison.
fn agreements(
    goal: &Calibrate,
    setup: &Setup<'_>,
    density: &Density<'_>,
    listed: &[&Vec<f64>],
    by_test: &[Vec<PointRuns>],
) -> Vec<(TargetAgreement, Option<f64>)> {
    let factors = density.parameters.len();
    let points = DMatrix::from_fn(factors, listed.len(), |row, column| listed[column][row]);
    let share = listed.iter().map(|state| density.share(state)).sum::<f64>() / listed.len() as f64;
    let agreement = |(index, target): (usize, &Target)| {
        let of_test: &[PointRuns] = setup.test(&target.test).map_or(&[], |test| &by_test[test]);
        let (runs, without) = counts(target, of_test);
        let target = target.clone();
        if let Some(value) = constant(&target.of, of_test) {
            let simulated = Some(Interval { mean: value, low: value, high: value });
            let distance = (!target.is_share()).then(|| (target.mean - value) / target.error());
            return (TargetAgreement { target, runs, without, simulated, distance }, Some(0.0));
        }
        let known = density.targets.iter().position(|(known, _)| *known == index);
        let Some(known) = known else {
            return (TargetAgreement { target, runs, without, simulated: None, distance: None }, None);
        };
        let emulated = density.emulators[known].at(&points);
        let unknown = emulated.variances.iter().sum::<f64>() / listed.len() as f64;
        let mean = emulated.means.iter().sum::<f64>() / listed.len() as f64;
        let spread =
            emulated.means.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / listed.len() as f64;
        if target.is_share() {
            // On the scale of the log odds.
            let (odds, compared) = target.log_odds();
            let simulated = estimated(emulated.means.iter().map(|odds| probability(*odds)).collect());
            let distance = Some((odds - mean) / (compared + unknown + spread).sqrt());
            let share = unknown / (unknown + compared);
            let simulated = Some(simulated);
            return (TargetAgreement { target, runs, without, simulated, distance }, Some(share));
        }
        let simulated = estimated(emulated.means.clone());
        let compared = density.targets[known].1.error().powi(2) + (share * target.mean).powi(2);
        let distance = (target.mean - simulated.mean) / (compared + unknown + spread).sqrt();
        let emulator_share = unknown / (unknown + compared);
        let (simulated, distance) = (Some(simulated), Some(distance));
        (TargetAgreement { target, runs, without, simulated, distance }, Some(emulator_share))
    };
    goal.targets.iter().enumerate().map(agreement).collect()
}
