//! Priors of hyperparameters, and the search for the most probable ones.
//!
//! Few runs leave the likelihood flat: length scales would run to infinity, and the band of the answer would be too narrow.
//! Logarithms of hyperparameters therefore have normal priors, wide enough that hundreds of runs overrule them.
//!
//! The most probable values alone would still be too certain. Their posterior is taken as normal around the maximum, with the
//! curvature there, and replaced by points of the same mean and covariance: θ̂ and θ̂ ± √(p + ½) times each column of the covariance's
//! Cholesky factor, p the number of parameters, all of the same weight (Julier and Uhlmann 1997, κ = ½).

use nalgebra::{DMatrix, DVector};

use super::kernel::Kernel;
use super::search::maximise;

/// Step of differences of the gradient.
const STEP: f64 = 0.05;

/// Priors of a kernel: medians, and standard deviations of the logarithms.
#[derive(Clone, Copy, Debug)]
pub(super) struct Prior {
    /// σ².
    pub(super) variance: (f64, f64),
    /// Every ℓ_i.
    pub(super) length: (f64, f64),
    /// c², which is fixed.
    pub(super) constant: f64,
}

/// Hyperparameters: a kernel and further parameters.
pub(super) type Hyperparameters = (Kernel, Vec<f64>);

/// The kernel and further parameters of the highest posterior density, and those around it with the same weight. `levels` are those of the
/// kernel, and `further` priors of more parameters; `likelihood` returns the log likelihood and its gradient by ln ℓ_1, …, ln σ², and the
/// logarithms of further parameters.
pub(super) fn climb(
    prior: &Prior,
    levels: &[usize],
    further: &[(f64, f64)],
    evaluations: usize,
    mut likelihood: impl FnMut(&Kernel, &[f64]) -> Option<(f64, Vec<f64>)>,
) -> Option<(Hyperparameters, Vec<Hyperparameters>)> {
    let factors = levels.len();
    let mut priors = vec![prior.length; factors];
    priors.push(prior.variance);
    priors.extend(further);
    let kernel = |logs: &[f64]| Kernel {
        lengths: logs[..factors].iter().map(|log| log.exp()).collect(),
        levels: levels.to_vec(),
        variance: logs[factors].exp(),
        constant: prior.constant,
    };
    let rest = |logs: &[f64]| -> Vec<f64> { logs[factors + 1..].iter().map(|log| log.exp()).collect() };
    let mut density = |logs: &[f64]| {
        if logs.iter().any(|log| log.abs() > 20.0) {
            return None;
        }
        let (mut value, mut gradient) = likelihood(&kernel(logs), &rest(logs))?;
        for ((log, slope), (median, deviation)) in logs.iter().zip(&mut gradient).zip(&priors) {
            let distance = (log - median.ln()) / deviation;
            value -= 0.5 * distance * distance;
            *slope -= distance / deviation;
        }
        Some((value, gradient))
    };
    let start: Vec<f64> = priors.iter().map(|(median, _)| median.ln()).collect();
    let short: Vec<f64> =
        start.iter().enumerate().map(|(index, log)| if index < factors { log - 1.2 } else { *log }).collect();
    // Two starts: data of a wiggly function have a second top at short lengths.
    let found = [start, short]
        .iter()
        .filter_map(|start| maximise(start, evaluations, &mut density))
        .reduce(|best, other| if other.1 > best.1 { other } else { best });
    let (top, _) = found?;
    let around = around(&top, &priors, &mut density);
    let read = |logs: &[f64]| (kernel(logs), rest(logs));
    Some((read(&top), around.iter().map(|logs| read(logs)).collect()))
}

/// Points around the maximum that have the covariance of the posterior there.
fn around(
    top: &[f64],
    priors: &[(f64, f64)],
    mut density: impl FnMut(&[f64]) -> Option<(f64, Vec<f64>)>,
) -> Vec<Vec<f64>> {
    let size = top.len();
    let top = DVector::from_column_slice(top);
    let mut curvature = DMatrix::zeros(size, size);
    for index in 0..size {
        let mut slopes = |step: f64| {
            let mut at = top.clone();
            at[index] += step;
            density(at.as_slice()).map(|(_, gradient)| DVector::from_vec(gradient))
        };
        let (Some(before), Some(after)) = (slopes(-STEP), slopes(STEP)) else { return Vec::new() };
        curvature.set_column(index, &((before - after) / (2.0 * STEP)));
    }
    // The decomposition would not end.
    if curvature.iter().any(|value: &f64| !value.is_finite()) {
        return Vec::new();
    }
    let mut decomposed = (0.5 * (&curvature + curvature.transpose())).symmetric_eigen();
    // No direction is less certain than the widest prior.
    let least = priors.iter().map(|(_, deviation)| deviation.powi(-2)).fold(f64::INFINITY, f64::min);
    decomposed.eigenvalues.apply(|value| *value = 1.0 / value.max(least));
    let Some(factor) = decomposed.recompose().cholesky() else { return Vec::new() };
    let reach = (size as f64 + 0.5).sqrt();
    let columns = factor.l().column_iter().map(|column| column * reach).collect::<Vec<_>>();
    let points = columns.iter().flat_map(|step| [&top + step, &top - step]);
    points.map(|point| point.as_slice().to_vec()).collect()
}
