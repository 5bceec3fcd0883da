//! Priors of hyperparameters, and the search for the most probable ones.
//!
//! Few runs leave the likelihood flat: length scales would run to infinity, and the band of the answer would be too narrow.
//! Logarithms of hyperparameters therefore have normal priors, wide enough that hundreds of runs overrule them.

use super::kernel::Kernel;
use super::search::maximise;

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

/// The kernel and further parameters of the highest posterior density. `further` are priors of more parameters; `likelihood`
/// returns the log likelihood and its gradient by ln ℓ_1, …, ln σ², and the logarithms of further parameters.
pub(super) fn climb(
    prior: &Prior,
    factors: usize,
    further: &[(f64, f64)],
    evaluations: usize,
    mut likelihood: impl FnMut(&Kernel, &[f64]) -> Option<(f64, Vec<f64>)>,
) -> Option<(Kernel, Vec<f64>)> {
    let mut priors = vec![prior.length; factors];
    priors.push(prior.variance);
    priors.extend(further);
    let kernel = |logs: &[f64]| Kernel {
        lengths: logs[..factors].iter().map(|log| log.exp()).collect(),
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
    found.map(|(logs, _)| (kernel(&logs), rest(&logs)))
}
