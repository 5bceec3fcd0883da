//! Measured numbers, and curves as groups of them.
//!
//! The points of a curve come from the same specimens: a stiff one is above the mean along the whole curve. Their errors are correlated,
//! by exp(−|x − x′|/L) with the length L of the curve. Twenty points thus say a little more than one, and not twenty times as much.

use nalgebra::linalg::Cholesky;
use nalgebra::{DMatrix, Dyn};
use serde::{Deserialize, Serialize};
use statrs::distribution::{ChiSquared, ContinuousCDF};

use crate::measure::Measure;

/// Number of equally probable precisions that stand for Student's t.
const PRECISIONS: usize = 16;
/// Least standard deviation of a measured mean, as a share of its magnitude: readings are not exact.
const LEAST_SHARE: f64 = 1e-3;

/// A measured number.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Target {
    /// The test.
    pub test: String,
    /// The number of a run that it is compared with.
    pub of: Measure,
    /// The curve that it is a point of; none for a number of its own.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub curve: Option<CurvePlace>,
    /// Mean of the replicates, in the unit of the response.
    pub mean: f64,
    /// Standard deviation of the replicates, in the unit of the response.
    pub deviation: f64,
    /// Number of replicates.
    pub n: u64,
}

/// A place of a measured curve.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CurvePlace {
    /// A name that the points of the curve have in common.
    pub name: String,
    /// Place along the curve.
    pub at: f64,
}

impl Target {
    /// Standard deviation of the measured mean, in the unit of the response.
    pub(super) fn error(&self) -> f64 {
        let least = LEAST_SHARE * self.mean.abs();
        (self.deviation / (self.n as f64).sqrt()).max(least).max(f64::MIN_POSITIVE.sqrt())
    }

    /// Log odds of a measured share, and their variance; half a replicate more of yes and of no keeps both finite.
    pub(super) fn log_odds(&self) -> (f64, f64) {
        let n = self.n as f64 + 1.0;
        let p = (self.mean * self.n as f64 + 0.5) / n;
        ((p / (1.0 - p)).ln(), 1.0 / (n * p * (1.0 - p)))
    }

    /// Whether it is a share of yes.
    pub(super) fn is_share(&self) -> bool {
        matches!(self.of, Measure::Probability(_))
    }
}

/// Targets whose errors belong together: the points of a curve, or a single number.
#[derive(Clone, Debug)]
pub(super) struct Group {
    /// Indices of its targets.
    pub(super) targets: Vec<usize>,
    /// Factor of the correlation of their errors.
    pub(super) correlation: Cholesky<f64, Dyn>,
    /// Equally probable precisions of the measured variance, relative to it: χ²/ν with ν = n − 1. A single 1 for n = 1, whose deviation comes
    /// from elsewhere and counts as known.
    pub(super) precisions: Vec<f64>,
}

/// The groups of some targets.
pub(super) fn groups(targets: &[Target]) -> Vec<Group> {
    let mut members: Vec<Vec<usize>> = Vec::new();
    for (index, target) in targets.iter().enumerate() {
        let belongs = |other: &Target| {
            let name = |target: &Target| target.curve.as_ref().map(|place| place.name.clone());
            other.test == target.test && name(target).is_some() && name(other) == name(target)
        };
        match members.iter_mut().find(|group| belongs(&targets[group[0]])) {
            Some(group) => group.push(index),
            None => members.push(vec![index]),
        }
    }
    members.into_iter().filter_map(|members| group(targets, members)).collect()
}

fn group(targets: &[Target], members: Vec<usize>) -> Option<Group> {
    let place = |index: &usize| targets[*index].curve.as_ref().map_or(0.0, |place| place.at);
    let places: Vec<f64> = members.iter().map(place).collect();
    let (low, high) =
        places.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(*x), high.max(*x)));
    let length = if high > low { high - low } else { 1.0 };
    let correlation = DMatrix::from_fn(members.len(), members.len(), |row, column| {
        (-(places[row] - places[column]).abs() / length).exp()
    });
    let least = members.iter().map(|index| targets[*index].n).min()?;
    Some(Group { correlation: Cholesky::new(correlation)?, precisions: precisions(least), targets: members })
}

/// Equally probable precisions of a variance that was measured with n replicates.
fn precisions(n: u64) -> Vec<f64> {
    let freedom = n.saturating_sub(1) as f64;
    let Ok(squares) = ChiSquared::new(freedom) else { return vec![1.0] };
    let middle = |index: usize| (index as f64 + 0.5) / PRECISIONS as f64;
    (0..PRECISIONS).map(|index| squares.inverse_cdf(middle(index)) / freedom).collect()
}

#[cfg(test)]
mod tests {
    use statrs::distribution::{Continuous, Normal, StudentsT};

    use super::*;

    /// The mean of normal densities with these precisions is the density of Student's t.
    #[test]
    fn normal_mixture_of_precisions_approximates_students_t() {
        for n in [3_u64, 5, 10, 40] {
            let exact = StudentsT::new(0.0, 1.0, n as f64 - 1.0).unwrap();
            let precisions = precisions(n);
            for t in [0.0, 0.5, 1.0, 2.0, 3.0] {
                let density = |precision: &f64| Normal::new(0.0, precision.powf(-0.5)).unwrap().pdf(t);
                let mean = precisions.iter().map(density).sum::<f64>() / precisions.len() as f64;
                let error = (mean.ln() - exact.ln_pdf(t)).abs();
                assert!(error < 0.1, "n = {n}, t = {t}: {error}");
            }
        }
        assert_eq!(precisions(1), [1.0]);
    }
}
