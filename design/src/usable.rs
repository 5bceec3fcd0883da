//! Responses that a measure can use, and those it cannot.
//!
//! | response | use |
//! |---|---|
//! | missing or not finite | none |
//! | of a probability, neither 0 nor 1 | none |
//! | of a mean, an outlier | in estimates at its point, but in no model |
//!
//! An outlier is farther from the median than [`OUTLIER`] times the median distance of those values that differ from it. So far away
//! are the numbers of a broken run, not the tails of a distribution: one of them would hide all others in a model.

use std::ops::RangeInclusive;

use serde::{Deserialize, Serialize};

use crate::evidence::{Outcome, PointRuns};
use crate::measure::Measure;

/// Distance of an outlier from the median, in median distances.
const OUTLIER: f64 = 1e6;

/// Numbers of responses of finished runs that a measure could not use.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct UnusableResponses {
    /// The measure.
    pub of: Measure,
    /// Runs with a result, but without a finite response.
    pub missing: usize,
    /// Responses of a probability that are neither 0 nor 1.
    pub not_binary: usize,
    /// Responses of a mean that are left out of models: more than 10⁶ median distances away from the median.
    pub outliers: usize,
}

impl UnusableResponses {
    /// The responses of some points that a measure cannot use; none when it can use all.
    pub(crate) fn of(measure: &Measure, points: &[PointRuns]) -> Option<Self> {
        let mut found = Self { of: measure.clone(), missing: 0, not_binary: 0, outliers: 0 };
        let outcomes = points.iter().flat_map(|point| point.runs.values());
        for outcome in outcomes {
            let Outcome::Responses(responses) = outcome else { continue };
            match responses.get(measure.response()) {
                Some(value) if measure.accepts(*value) => {}
                Some(value) if value.is_finite() => found.not_binary += 1,
                _ => found.missing += 1,
            }
        }
        if matches!(measure, Measure::Mean(_)) {
            let values: Vec<f64> = points.iter().flat_map(|point| point.values(measure)).collect();
            let credible = credible(&values);
            found.outliers = values.iter().filter(|value| !credible.contains(value)).count();
        }
        (found.missing + found.not_binary + found.outliers > 0).then_some(found)
    }
}

/// The range of values that are no outliers.
pub(crate) fn credible(values: &[f64]) -> RangeInclusive<f64> {
    let all = f64::NEG_INFINITY..=f64::INFINITY;
    let Some(middle) = median(values.to_vec()) else { return all };
    let distances = values.iter().map(|value| (value - middle).abs()).filter(|distance| *distance > 0.0);
    let Some(distance) = median(distances.collect()) else { return all };
    middle - OUTLIER * distance..=middle + OUTLIER * distance
}

/// The lower median of some values; none without values.
fn median(mut values: Vec<f64>) -> Option<f64> {
    let middle = values.len().checked_sub(1)? / 2;
    Some(*values.select_nth_unstable_by(middle, f64::total_cmp).1)
}
