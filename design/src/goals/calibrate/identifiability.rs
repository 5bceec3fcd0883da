//! Identifiability: parameters that the tests leave open, pairs that they cannot tell apart, and further responses that would help.
//!
//! All is read from the samples, along the scales of the factors and in standard deviations of the priors. A further response is one of
//! the runs that exist, but was not measured. With a measurement of an error of 5 % it would narrow a direction of the parameters to the
//! share √(1 − ρ² V/(V + ε² + v)): ρ is its correlation with the direction, V its variance over the samples, v that of its emulator.

use std::collections::BTreeSet;

use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};

use super::density::Density;
use super::emulator::Emulator;
use super::{Calibrate, Setup, TEST};
use crate::evidence::{Outcome, PointRuns};
use crate::factor::Factor;
use crate::measure::Measure;

/// Correlation from which on a pair may be told together only.
const CORRELATED: f64 = 0.8;
/// Remaining share of the prior's deviation from which on a parameter or direction counts as open.
const OPEN: f64 = 0.5;
/// A combination is told when its deviation is below this share of that across it.
const TOLD: f64 = 1.0 / 3.0;
/// Error of a measurement that is thought of, as a share of the response.
const ERROR: f64 = 0.05;
/// A response is named when it leaves less than this share of a deviation.
const USEFUL: f64 = 0.8;
/// Maximum number of responses that are named for each direction.
const NAMED: usize = 3;

/// Two parameters of which the tests tell a combination, but not each.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PairOfParameters {
    /// Their names.
    pub parameters: [String; 2],
    /// Their correlation: with a positive one, both can be larger together.
    pub correlation: f64,
    /// Standard deviation along the open direction, relative to the priors.
    pub remaining: f64,
}

/// A response that was not measured, and would narrow a parameter or pair.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Narrowing {
    /// The parameter, or both of a pair.
    pub parameters: Vec<String>,
    /// The test.
    pub test: Option<String>,
    /// The response.
    pub response: String,
    /// The share of the standard deviation that would be left with a measurement of an error of 5 %.
    pub leaves: f64,
}

/// Moments of the samples, in standard deviations of the priors.
#[derive(Debug)]
pub(super) struct Posterior {
    deviations: Vec<f64>,
    covariances: DMatrix<f64>,
}

/// A direction of the parameters that the tests leave open.
struct Open {
    parameters: Vec<usize>,
    direction: DVector<f64>,
}

impl Posterior {
    pub(super) fn of(parameters: usize, states: &[Vec<f64>], deviations: &[f64]) -> Self {
        let scaled = DMatrix::from_fn(parameters, states.len(), |row, column| {
            states[column][row] / deviations[row].max(f64::MIN_POSITIVE)
        });
        let centre = scaled.column_mean();
        let mut centred = scaled;
        for mut column in centred.column_iter_mut() {
            column -= &centre;
        }
        let covariances = &centred * centred.transpose() / states.len() as f64;
        Self { deviations: deviations.to_vec(), covariances }
    }

    /// Standard deviation of a parameter relative to its prior.
    pub(super) fn remaining(&self, index: usize) -> f64 {
        self.covariances[(index, index)].sqrt()
    }

    pub(super) fn correlations(&self) -> Vec<Vec<f64>> {
        let parameters = self.covariances.nrows();
        let row = |row: usize| (0..parameters).map(|column| self.correlation(row, column)).collect();
        (0..parameters).map(row).collect()
    }

    fn correlation(&self, one: usize, other: usize) -> f64 {
        if one == other {
            return 1.0;
        }
        let scale = self.remaining(one) * self.remaining(other);
        (self.covariances[(one, other)] / scale.max(f64::MIN_POSITIVE)).clamp(-1.0, 1.0)
    }

    /// The open direction of two parameters, with its standard deviation, if the tests tell one combination much better than another.
    fn open_direction(&self, one: usize, other: usize) -> Option<([f64; 2], f64)> {
        if self.correlation(one, other).abs() < CORRELATED {
            return None;
        }
        let of = |row: usize, column: usize| self.covariances[([one, other][row], [one, other][column])];
        let decomposed = nalgebra::Matrix2::from_fn(of).symmetric_eigen();
        let wide = usize::from(decomposed.eigenvalues[1] > decomposed.eigenvalues[0]);
        let [wide_deviation, narrow] =
            [wide, 1 - wide].map(|index| decomposed.eigenvalues[index].max(0.0).sqrt());
        let direction = decomposed.eigenvectors.column(wide);
        let is_open = wide_deviation >= OPEN && narrow <= TOLD * wide_deviation;
        is_open.then(|| ([direction[0], direction[1]], wide_deviation))
    }

    pub(super) fn pairs(&self, factors: &[Factor]) -> Vec<PairOfParameters> {
        let mut pairs = Vec::new();
        for other in 1..factors.len() {
            for one in 0..other {
                if let Some((_, remaining)) = self.open_direction(one, other) {
                    pairs.push(PairOfParameters {
                        parameters: [factors[one].name.clone(), factors[other].name.clone()],
                        correlation: self.correlation(one, other),
                        remaining,
                    });
                }
            }
        }
        pairs
    }

    /// All open directions: of pairs, then of single parameters that are in no pair.
    fn open(&self) -> Vec<Open> {
        let size = self.covariances.nrows();
        let mut open = Vec::new();
        let mut paired = BTreeSet::new();
        for other in 1..size {
            for one in 0..other {
                if let Some(([first, second], _)) = self.open_direction(one, other) {
                    let mut direction = DVector::zeros(size);
                    (direction[one], direction[other]) = (first, second);
                    paired.extend([one, other]);
                    open.push(Open { parameters: vec![one, other], direction });
                }
            }
        }
        for index in (0..size).filter(|index| !paired.contains(index) && self.remaining(*index) >= OPEN) {
            let mut direction = DVector::zeros(size);
            direction[index] = 1.0;
            open.push(Open { parameters: vec![index], direction });
        }
        open
    }
}

/// Responses of the runs that were not measured, and would narrow what is open.
pub(super) fn further(
    goal: &Calibrate,
    setup: &Setup<'_>,
    density: &Density<'_>,
    posterior: &Posterior,
    listed: &[&Vec<f64>],
    by_test: &[Vec<PointRuns>],
) -> Vec<Narrowing> {
    let open = posterior.open();
    if open.is_empty() {
        return Vec::new();
    }
    let factors = density.parameters;
    let points = DMatrix::from_fn(factors.len(), listed.len(), |row, column| listed[column][row]);
    let mut found: Vec<Vec<Narrowing>> = open.iter().map(|_| Vec::new()).collect();
    for (test, runs) in by_test.iter().enumerate() {
        let name = setup.factors.last().filter(|factor| factor.name == TEST);
        let name = name.and_then(|factor| factor.levels[test].as_str().map(str::to_owned));
        for response in unmeasured(goal, setup, test, runs) {
            let Some(emulator) = Emulator::fit(factors, &Measure::Mean(response.clone()), runs) else {
                continue;
            };
            let emulated = emulator.at(&points);
            let count = listed.len() as f64;
            let mean = emulated.means.iter().sum::<f64>() / count;
            let variance = emulated.means.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / count;
            let unknown = emulated.variances.iter().sum::<f64>() / count;
            let told = variance / (variance + (ERROR * mean).powi(2) + unknown).max(f64::MIN_POSITIVE);
            for (open, found) in open.iter().zip(&mut found) {
                let along = |state: &[f64]| {
                    let each = open.direction.iter().zip(state).zip(&posterior.deviations);
                    each.map(|((share, coordinate), deviation)| share * coordinate / deviation).sum::<f64>()
                };
                let along: Vec<f64> = listed.iter().map(|state| along(state)).collect();
                let leaves = (1.0 - correlation(&along, &emulated.means).powi(2) * told).max(0.0).sqrt();
                if leaves < USEFUL {
                    let names = open.parameters.iter().map(|index| factors[*index].name.clone());
                    let (test, response) = (name.clone(), response.clone());
                    found.push(Narrowing { parameters: names.collect(), test, response, leaves });
                }
            }
        }
    }
    let most_useful = |mut found: Vec<Narrowing>| {
        found.sort_by(|one, other| one.leaves.total_cmp(&other.leaves));
        found.truncate(NAMED);
        found
    };
    found.into_iter().flat_map(most_useful).collect()
}

/// Names of the numbers of a test's runs that no target uses, and that vary.
fn unmeasured(goal: &Calibrate, setup: &Setup<'_>, test: usize, runs: &[PointRuns]) -> BTreeSet<String> {
    let of_test = goal.targets.iter().filter(|target| setup.test(&target.test) == Some(test));
    let measured: BTreeSet<&str> = of_test.map(|target| target.of.response()).collect();
    let mut first = std::collections::BTreeMap::new();
    let mut varies = BTreeSet::new();
    for outcome in runs.iter().flat_map(|point| point.runs.values()) {
        let Outcome::Responses(responses) = outcome else { continue };
        for (name, value) in responses.iter().filter(|(_, value)| value.is_finite()) {
            if *first.entry(name.as_str()).or_insert(*value) != *value && !measured.contains(name.as_str()) {
                varies.insert(name.clone());
            }
        }
    }
    varies
}

fn correlation(one: &[f64], other: &[f64]) -> f64 {
    let count = one.len() as f64;
    let [first, second] = [one, other].map(|values| values.iter().sum::<f64>() / count);
    let pairs = || one.iter().zip(other).map(|(x, y)| (x - first, y - second));
    let both = pairs().map(|(x, y)| x * y).sum::<f64>();
    let scale = pairs().map(|(x, _)| x * x).sum::<f64>() * pairs().map(|(_, y)| y * y).sum::<f64>();
    if scale > 0.0 { both / scale.sqrt() } else { 0.0 }
}
