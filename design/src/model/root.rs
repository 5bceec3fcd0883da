//! The probability that the latent function is beyond a level, from counts.
//!
//! | symbol | meaning |
//! |---|---|
//! | m, s | mean and deviation of the latent function at a point x, by Laplace's approximation |
//! | ℓ | the level |
//! | f̂_i, c_i | latent function at point i of the data, its covariance with x |
//! | δ_i | c_i (ℓ − m) / s², by which f̂_i differs if the latent function at x is ℓ |
//! | R | Σ ln p(s_i \| f̂_i + δ_i), less its Taylor series up to the second order |
//! | r | sign(m − ℓ) √((m − ℓ)²/s² − 2R) |
//!
//! A normal posterior has Φ((m − ℓ)/s) above the level. Where no run had response 1, this is far too much below a level: a dozen runs
//! almost exclude it, but the likelihood has little curvature at the mode. Φ(r) is close to the probability. r is the signed root
//! of the likelihood ratio (Barndorff-Nielsen and Cox 1994). δ is the conditional mean of Rue, Martino and Chopin 2009, equation 14.

use nalgebra::DMatrix;

use super::binomial::{Counted, softplus};
use super::posterior::{Posterior, Prediction};

/// ln p(s | f) around its value at one point of the data.
struct Term {
    counted: Counted,
    latent: f64,
    softplus: f64,
    slope: f64,
    precision: f64,
}

impl Term {
    /// The part of the change by a step that its Taylor series leaves out.
    fn rest(&self, step: f64) -> f64 {
        let change =
            self.counted.count * step - self.counted.n * (softplus(self.latent + step) - self.softplus);
        change - step * (self.slope - 0.5 * self.precision * step)
    }
}

/// r at the points (columns) of a prediction.
pub(super) fn signed_roots(
    posterior: &Posterior,
    counts: &[Counted],
    points: &DMatrix<f64>,
    prediction: &Prediction,
    level: f64,
) -> Vec<f64> {
    let data = posterior.predict(&posterior.points);
    let term = |(index, counted): (usize, &Counted)| Term {
        counted: *counted,
        latent: data.means[index],
        softplus: softplus(data.means[index]),
        slope: posterior.weights[index],
        precision: posterior.root[index].powi(2),
    };
    let terms: Vec<Term> = counts.iter().enumerate().map(term).collect();
    let covariances = posterior.covariances_with(&data, points, prediction);
    let root = |point: usize| {
        let (gap, variance) = (level - prediction.means[point], prediction.variances[point]);
        let steps = covariances.column(point) * (gap / variance);
        let rest: f64 = terms.iter().zip(steps.iter()).map(|(term, step)| term.rest(*step)).sum();
        -gap.signum() * (gap * gap / variance - 2.0 * rest).max(0.0).sqrt()
    };
    (0..points.ncols()).map(root).collect()
}
