//! The posterior density of the parameters, by measurements and emulators.
//!
//! | symbol | meaning |
//! |---|---|
//! | θ, τ | coordinates of the parameters from 0 to 1; discrepancy as a share |
//! | m_j, s_j, n_j | measured mean, standard deviation and number of replicates |
//! | μ_j(θ), v_j(θ) | the emulator's mean and variance |
//! | λ | precision of the measured variance, a mixture of equally probable values that stands for Student's t |
//! | a_j² = s_j²/(n_j λ) + v_j + (τ m_j)² | variance of m_j − μ_j |
//! | C | correlations of the errors of a curve's points; 1 for a single number |
//!
//! A group of targets has the density Σ_λ N(m − μ; 0, diag(a) C diag(a)) / number of λ. A share of yes has the binomial probability of its
//! replicates, averaged over the emulator's normal log odds. Where runs of a test fail or lack a measured number, the density is multiplied by
//! the probability that they do not: such parameters contradict the test.

use nalgebra::{DMatrix, DVector};
use statrs::distribution::{ContinuousCDF, Normal};

use super::emulator::{Emulated, Emulator, completeness, constant};
use super::prior::{self, ParameterPrior};
use super::target::{Group, Target, groups};
use super::{Calibrate, Setup};
use crate::evidence::PointRuns;
use crate::factor::Factor;
use crate::measure::Measure;
use crate::model::Model;
use crate::model::binomial::probability;

/// Number of equally probable values that stand for the normal log odds of an emulator.
const NODES: usize = 24;
/// Least error of a measured mean, as a share of the spread of simulated values: a mean of 0 has no other.
const LEAST_SPREAD: f64 = 1e-3;

/// The posterior density.
#[derive(Debug)]
pub(super) struct Density<'a> {
    pub(super) parameters: &'a [Factor],
    priors: Vec<Option<&'a ParameterPrior>>,
    discrepancy: Option<f64>,
    /// Measured numbers that have an emulator, with their index in the goal.
    pub(super) targets: Vec<(usize, Target)>,
    /// An emulator per target.
    pub(super) emulators: Vec<Emulator>,
    groups: Vec<Group>,
    /// Models of the probability that a run ends with all numbers, one for each test with other runs.
    complete: Vec<Model>,
}

impl<'a> Density<'a> {
    /// The density by the runs of each test; none before a target has an emulator.
    pub(super) fn of(goal: &'a Calibrate, setup: &Setup<'a>, by_test: &[Vec<PointRuns>]) -> Option<Self> {
        let parameters = setup.parameters();
        let mut targets = Vec::new();
        let mut emulators = Vec::new();
        for (index, target) in goal.targets.iter().enumerate() {
            let runs = &by_test[setup.test(&target.test)?];
            // A number that no parameter changes tells nothing of them.
            if constant(&target.of, runs).is_some() {
                continue;
            }
            if let Some(emulator) = Emulator::fit(parameters, &target.of, runs) {
                targets.push((index, with_least_error(target, runs)));
                emulators.push(emulator);
            }
        }
        if targets.is_empty() {
            return None;
        }
        let measures = |test: usize| -> Vec<&Measure> {
            let of_test = goal.targets.iter().filter(|target| setup.test(&target.test) == Some(test));
            of_test.map(|target| &target.of).collect()
        };
        let complete = by_test.iter().enumerate();
        let complete = complete.filter_map(|(test, runs)| completeness(parameters, &measures(test), runs));
        let prior = |factor: &Factor| goal.priors.iter().find(|prior| prior.parameter == factor.name);
        let groups = groups(&targets.iter().map(|(_, target)| target.clone()).collect::<Vec<_>>());
        Some(Self {
            parameters,
            priors: parameters.iter().map(prior).collect(),
            discrepancy: goal.discrepancy,
            complete: complete.collect(),
            groups,
            targets,
            emulators,
        })
    }

    /// Number of sampled numbers: the parameters, and the discrepancy in units of its scale.
    pub(super) fn size(&self) -> usize {
        self.parameters.len() + usize::from(self.discrepancy.is_some())
    }

    /// The share of discrepancy in a state.
    pub(super) fn share(&self, state: &[f64]) -> f64 {
        self.discrepancy.map_or(0.0, |scale| scale * state[self.parameters.len()])
    }

    /// Log density of the prior of a parameter at a coordinate, up to a constant.
    pub(super) fn ln_prior_of(&self, parameter: usize, coordinate: f64) -> f64 {
        prior::ln_density(&self.parameters[parameter], self.priors[parameter], coordinate)
    }

    /// Log density of the priors at a state, up to a constant; of none outside the ranges.
    pub(super) fn ln_prior(&self, state: &[f64]) -> f64 {
        let (parameters, discrepancy) = state.split_at(self.parameters.len());
        let is_inside = parameters.iter().all(|coordinate| (0.0..=1.0).contains(coordinate));
        if !is_inside || discrepancy.iter().any(|units| *units < 0.0) {
            return f64::NEG_INFINITY;
        }
        let each = parameters.iter().enumerate();
        let parameters: f64 = each.map(|(index, coordinate)| self.ln_prior_of(index, *coordinate)).sum();
        parameters - 0.5 * discrepancy.iter().map(|units| units * units).sum::<f64>()
    }

    /// Log densities at states (columns), up to a constant.
    pub(super) fn ln(&self, states: &DMatrix<f64>) -> Vec<f64> {
        let points = states.rows(0, self.parameters.len()).into_owned();
        let emulated: Vec<Emulated> = self.emulators.iter().map(|emulator| emulator.at(&points)).collect();
        let complete: Vec<_> = self.complete.iter().map(|model| model.posterior.predict(&points)).collect();
        let ln = |column: usize| {
            let state: Vec<f64> = states.column(column).iter().copied().collect();
            let prior = self.ln_prior(&state);
            if prior == f64::NEG_INFINITY {
                return prior;
            }
            let share = self.share(&state);
            let groups = self.groups.iter().map(|group| self.ln_group(group, &emulated, column, share));
            let complete = complete.iter().map(|found| probability(found.means[column]).ln());
            let ln = prior + groups.sum::<f64>() + complete.sum::<f64>();
            if ln.is_nan() { f64::NEG_INFINITY } else { ln }
        };
        (0..states.ncols()).map(ln).collect()
    }

    fn ln_group(&self, group: &Group, emulated: &[Emulated], column: usize, share: f64) -> f64 {
        if let [index] = group.targets[..]
            && self.targets[index].1.is_share()
        {
            let (mean, variance) = (emulated[index].means[column], emulated[index].variances[column]);
            return ln_binomial(&self.targets[index].1, mean, variance.sqrt());
        }
        let residuals = group.targets.iter().map(|index| {
            let (target, emulated) = (&self.targets[*index].1, &emulated[*index]);
            let other = emulated.variances[column] + (share * target.mean).powi(2);
            (target.mean - emulated.means[column], target.error().powi(2), other)
        });
        let residuals: Vec<(f64, f64, f64)> = residuals.collect();
        let terms = group.precisions.iter().map(|precision| {
            let mut whitened = DVector::zeros(residuals.len());
            let mut ln_volume = 0.0;
            for (place, (residual, square, other)) in residuals.iter().enumerate() {
                let deviation = (square / precision + other).sqrt();
                whitened[place] = residual / deviation;
                ln_volume += deviation.ln();
            }
            group.correlation.l_dirty().solve_lower_triangular_unchecked_mut(&mut whitened);
            -0.5 * whitened.norm_squared() - ln_volume
        });
        let terms: Vec<f64> = terms.collect();
        let largest = terms.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        largest + (terms.iter().map(|term| (term - largest).exp()).sum::<f64>() / terms.len() as f64).ln()
    }
}

/// A target whose error is not below a share of the spread of simulated values.
fn with_least_error(target: &Target, runs: &[PointRuns]) -> Target {
    let values: Vec<f64> = runs.iter().flat_map(|point| point.values(&target.of)).collect();
    let spread = roost_stats::Sample::of(&values).and_then(|sample| sample.deviation).unwrap_or(0.0);
    let least = LEAST_SPREAD * spread * (target.n as f64).sqrt();
    Target { deviation: target.deviation.max(least), ..target.clone() }
}

/// Log probability of the number of yes among the replicates, up to a constant, with normal log odds.
fn ln_binomial(target: &Target, mean: f64, deviation: f64) -> f64 {
    let n = target.n as f64;
    let yes = (target.mean * n).round();
    let terms: Vec<f64> = (0..NODES)
        .map(|node| {
            let normal = Normal::standard().inverse_cdf((node as f64 + 0.5) / NODES as f64);
            // ln p and ln (1 − p) of log odds x are −ln(1 + exp(−x)) and −ln(1 + exp(x)).
            let odds = mean + deviation * normal;
            -yes * softplus(-odds) - (n - yes) * softplus(odds)
        })
        .collect();
    let largest = terms.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    largest + (terms.iter().map(|term| (term - largest).exp()).sum::<f64>() / NODES as f64).ln()
}

/// ln(1 + exp x).
fn softplus(x: f64) -> f64 {
    x.max(0.0) + (-x.abs()).exp().ln_1p()
}
