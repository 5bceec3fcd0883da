//! Gaussian process classification of counts with Laplace's approximation.
//!
//! | symbol | meaning |
//! |---|---|
//! | s_i, n_i | number of runs with response 1, and of all runs, at point i |
//! | f, π | latent function, probability 1 / (1 + exp(−f)) |
//! | ln p(s \| f) | Σ s_i f_i − n_i ln(1 + exp f_i) + ln (n_i over s_i) |
//! | W | n π (1 − π), the negative second derivative |
//! | ln q(s) | −½ aᵀf̂ + ln p(s \| f̂) − ½ ln\|B\|, a = K⁻¹f̂ = s − n π̂ |
//!
//! Rasmussen and Williams 2006: mode by algorithm 3.1, predictions by 3.2, derivatives by 5.1. The binomial coefficient is
//! left out, since it does not depend on f.

use nalgebra::{DMatrix, DVector};

use super::kernel::{Kernel, on_both_sides};
use super::posterior::{Posterior, factor, ln_determinant};

/// Maximum number of Newton steps; a log-concave likelihood needs about ten.
const MAX_STEPS: usize = 60;
/// Change of the objective at which Newton's method ends.
const TOLERANCE: f64 = 1e-10;

/// The counts at one point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Counted {
    /// Number of runs with response 1.
    pub count: f64,
    /// Number of runs, at least one.
    pub n: f64,
}

/// A fit for given hyperparameters.
#[derive(Clone, Debug)]
pub struct BinomialFit {
    /// Approximate log marginal likelihood.
    pub log_likelihood: f64,
    /// Its derivatives by ln ℓ_1, …, ln σ².
    pub gradient: Vec<f64>,
    /// The posterior.
    pub posterior: Posterior,
}

/// The probability of a value of the latent function.
pub fn probability(latent: f64) -> f64 {
    1.0 / (1.0 + (-latent).exp())
}

/// ln(1 + exp f) without overflow.
pub(super) fn softplus(latent: f64) -> f64 {
    latent.max(0.0) + (-latent.abs()).exp().ln_1p()
}

/// ln p(s | f).
fn log_likelihood(counts: &[Counted], latent: &DVector<f64>) -> f64 {
    let terms =
        counts.iter().zip(latent.iter()).map(|(counted, f)| counted.count * f - counted.n * softplus(*f));
    terms.sum()
}

/// The fit with a kernel; none when numbers overflow. `start` are weights of a similar fit, from which Newton's method starts.
pub fn fit(
    points: &DMatrix<f64>,
    counts: &[Counted],
    kernel: &Kernel,
    start: Option<&DVector<f64>>,
) -> Option<BinomialFit> {
    let n = counts.len();
    let covariances = kernel.symmetric(points);
    let objective = |weights: &DVector<f64>, latent: &DVector<f64>| {
        log_likelihood(counts, latent) - 0.5 * weights.dot(latent)
    };
    let slopes = |latent: &DVector<f64>| {
        DVector::from_fn(n, |index, _| counts[index].count - counts[index].n * probability(latent[index]))
    };
    let precisions = |latent: &DVector<f64>| {
        DVector::from_fn(n, |index, _| {
            let p = probability(latent[index]);
            counts[index].n * p * (1.0 - p)
        })
    };
    let mut weights = start.cloned().unwrap_or_else(|| DVector::zeros(n));
    let mut latent = &covariances * &weights;
    let mut reached = objective(&weights, &latent);
    for _ in 0..MAX_STEPS {
        let precision = precisions(&latent);
        let root = precision.map(f64::sqrt);
        let cholesky = factor(&covariances, &root)?;
        let target = precision.component_mul(&latent) + slopes(&latent);
        let inner = (&covariances * &target).component_mul(&root);
        let step = &target - cholesky.solve(&inner).component_mul(&root) - &weights;
        let mut share = 1.0;
        let (next, next_latent, next_reached) = loop {
            let next = &weights + &step * share;
            let next_latent = &covariances * &next;
            let next_reached = objective(&next, &next_latent);
            // A full step from far away may overshoot.
            if next_reached >= reached - TOLERANCE || share < 1e-3 {
                break (next, next_latent, next_reached);
            }
            share *= 0.5;
        };
        let change = (next_reached - reached).abs();
        (weights, latent, reached) = (next, next_latent, next_reached);
        if change < TOLERANCE {
            break;
        }
    }
    let precision = precisions(&latent);
    let root = precision.map(f64::sqrt);
    let cholesky = factor(&covariances, &root)?;
    let log_likelihood = reached - 0.5 * ln_determinant(&cholesky);
    let weights = slopes(&latent);
    let mut reduction = cholesky.inverse();
    on_both_sides(&mut reduction, &root);
    let product = &covariances * &reduction;
    // s₂ of algorithm 5.1: the change of the determinant with the mode.
    let by_mode = DVector::from_fn(n, |index, _| {
        let variance = covariances[(index, index)] - product.row(index).tr_dot(&covariances.column(index));
        let p = probability(latent[index]);
        -0.5 * variance * counts[index].n * p * (1.0 - p) * (1.0 - 2.0 * p)
    });
    let through_mode = &by_mode - product.tr_mul(&by_mode);
    // Both terms of the derivative are Σ Q_ij ∂K_ij/∂θ with this symmetric Q.
    let mut change = reduction;
    change.ger(0.5, &weights, &weights, -0.5);
    change.ger(0.5, &through_mode, &weights, 1.0);
    change.ger(0.5, &weights, &through_mode, 1.0);
    let gradient = kernel.gradient(points, &change);
    let posterior =
        Posterior { kernel: kernel.clone(), points: points.clone(), weights, root, factor: cholesky };
    log_likelihood.is_finite().then_some(BinomialFit { log_likelihood, gradient, posterior })
}
