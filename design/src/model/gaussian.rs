//! Gaussian process regression on unique points with replicates.
//!
//! | symbol | meaning |
//! |---|---|
//! | a_i, ȳ_i, q_i | number, mean and sum of squared deviations of the values at point i |
//! | r_i | variance of one value at point i |
//! | ln p(y) | −½ ȳᵀ(K + D)⁻¹ȳ − ½ ln\|K + D\| − n/2 ln 2π − ½ Σ ((a_i − 1) ln 2πr_i + ln a_i + q_i/r_i), D_ii = r_i/a_i |
//!
//! The likelihood is that of all values, by the identity of Binois, Gramacy and Ludkovski 2018 (equation 6): its cost is that
//! of the unique points. Algorithm 2.1 of Rasmussen and Williams 2006 with B = I + S K S.

use nalgebra::{DMatrix, DVector};

use super::kernel::{Kernel, on_both_sides};
use super::posterior::{Posterior, factor, ln_determinant};

/// The values at one point, summarised.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Replicated {
    /// Number of values, at least one.
    pub n: f64,
    /// Their mean.
    pub mean: f64,
    /// Sum of their squared deviations from the mean.
    pub squares: f64,
}

impl Replicated {
    /// Summary of some values; none without values.
    pub fn of(values: &[f64]) -> Option<Self> {
        let sample = roost_stats::Sample::of(values)?;
        let squares = values.iter().map(|value| (value - sample.mean).powi(2)).sum();
        Some(Self { n: values.len() as f64, mean: sample.mean, squares })
    }
}

/// A fit for given hyperparameters.
#[derive(Clone, Debug)]
pub struct GaussianFit {
    /// Log marginal likelihood of all values.
    pub log_likelihood: f64,
    /// Its derivatives by ln ℓ_1, …, ln σ², and by the logarithm of a common factor of all r_i.
    pub gradient: Vec<f64>,
    /// The posterior.
    pub posterior: Posterior,
}

/// The fit with a kernel and noise variances r_i; none when numbers overflow.
pub fn fit(
    points: &DMatrix<f64>,
    values: &[Replicated],
    kernel: &Kernel,
    noise: &[f64],
) -> Option<GaussianFit> {
    let n = values.len();
    let covariances = kernel.symmetric(points);
    let precision = |index: usize, _| values[index].n / noise[index];
    let precisions = DVector::from_fn(n, precision);
    let root = precisions.map(f64::sqrt);
    let cholesky = factor(&covariances, &root)?;
    let means = DVector::from_fn(n, |index, _| values[index].mean);
    let weights = cholesky.solve(&means.component_mul(&root)).component_mul(&root);
    let ln_2_pi = std::f64::consts::TAU.ln();
    let mut log_likelihood = -0.5
        * (means.dot(&weights) + ln_determinant(&cholesky) - precisions.map(f64::ln).sum()
            + n as f64 * ln_2_pi);
    let mut by_noise = 0.0;
    for (value, noise) in values.iter().zip(noise) {
        log_likelihood -=
            0.5 * ((value.n - 1.0) * (ln_2_pi + noise.ln()) + value.n.ln() + value.squares / noise);
        by_noise += 0.5 * (value.squares / noise - (value.n - 1.0));
    }
    let mut inverse = cholesky.inverse();
    on_both_sides(&mut inverse, &root);
    for index in 0..n {
        by_noise += 0.5 * (weights[index] * weights[index] - inverse[(index, index)]) / precisions[index];
    }
    let mut change = inverse;
    change.ger(0.5, &weights, &weights, -0.5);
    let mut gradient = kernel.gradient(points, &change);
    gradient.push(by_noise);
    let posterior =
        Posterior { kernel: kernel.clone(), points: points.clone(), weights, root, factor: cholesky };
    log_likelihood.is_finite().then_some(GaussianFit { log_likelihood, gradient, posterior })
}
