//! Noise of a response that varies over the factors, smoothed from the variances of replicates.
//!
//! | symbol | meaning |
//! |---|---|
//! | s_i², ν_i | variance of the replicates at point i, its degrees of freedom a_i − 1 |
//! | z_i | ln s_i² − ψ(ν_i/2) + ln(ν_i/2), an unbiased value of the log variance |
//! | var z_i | ψ′(ν_i/2) |
//!
//! A Gaussian process on z_i with these known variances smooths them: two replicates say little and borrow from their
//! neighbours, fifty speak for themselves. After Ankenman, Nelson and Staum 2010, and Binois, Gramacy and Ludkovski 2018.

use nalgebra::DMatrix;
use statrs::function::gamma::digamma;

use super::gaussian::{self, Replicated};
use super::posterior::Posterior;
use super::prior::{Prior, climb};

/// Fewer points with replicates say nothing of how noise varies.
const MIN_POINTS: usize = 5;
/// Variances below this share of the mean one count as this share: a response may be the same in two runs by chance.
const LEAST_SHARE: f64 = 1e-4;

/// Relative noise variance as a function of the point; 1 where nothing is known.
#[derive(Clone, Debug)]
pub(super) struct Noise {
    /// Posterior of the log variance, and its centre.
    smooth: Option<Box<(Posterior, f64)>>,
}

impl Noise {
    /// The noise at points with replicates.
    pub(super) fn of(points: &DMatrix<f64>, levels: &[usize], values: &[Replicated]) -> Self {
        let replicated: Vec<usize> = (0..values.len()).filter(|index| values[*index].n > 1.5).collect();
        let (squares, freedom) = replicated.iter().fold((0.0, 0.0), |(squares, freedom), index| {
            (squares + values[*index].squares, freedom + values[*index].n - 1.0)
        });
        let pooled = squares / freedom;
        if replicated.len() < MIN_POINTS || pooled <= 0.0 {
            return Self { smooth: None };
        }
        let mut logs = Vec::new();
        let mut variances = Vec::new();
        for index in &replicated {
            let half = 0.5 * (values[*index].n - 1.0);
            let share = (values[*index].squares / (2.0 * half) / pooled).max(LEAST_SHARE);
            logs.push(share.ln() - digamma(half) + half.ln());
            variances.push(trigamma(half));
        }
        let total: f64 = variances.iter().map(|variance| 1.0 / variance).sum();
        let centre = logs.iter().zip(&variances).map(|(log, variance)| log / variance).sum::<f64>() / total;
        let values: Vec<Replicated> =
            logs.iter().map(|log| Replicated { n: 1.0, mean: log - centre, squares: 0.0 }).collect();
        let points = points.select_columns(&replicated);
        let prior = Prior { variance: (0.1, 1.5), constant: 0.25, length: (0.7, 0.7) };
        let found = climb(&prior, levels, &[], 25, |kernel, _| {
            let fit = gaussian::fit(&points, &values, kernel, &variances)?;
            let mut gradient = fit.gradient;
            gradient.pop();
            Some((fit.log_likelihood, gradient))
        });
        let posterior =
            found.and_then(|((kernel, _), _)| gaussian::fit(&points, &values, &kernel, &variances));
        Self { smooth: posterior.map(|fit| Box::new((fit.posterior, centre))) }
    }

    /// Relative noise variances at points.
    pub(super) fn at(&self, points: &DMatrix<f64>) -> Vec<f64> {
        match &self.smooth {
            None => vec![1.0; points.ncols()],
            Some(smooth) => {
                let (posterior, centre) = smooth.as_ref();
                posterior.predict(points).means.iter().map(|log| (log + centre).exp()).collect()
            }
        }
    }
}

/// ψ′ by its recurrence and asymptotic series (Abramowitz and Stegun 1964, 6.4.6 and 6.4.12).
fn trigamma(mut x: f64) -> f64 {
    let mut sum = 0.0;
    while x < 10.0 {
        sum += 1.0 / (x * x);
        x += 1.0;
    }
    let square = 1.0 / (x * x);
    sum + 1.0 / x + square / 2.0 + square / x * (1.0 / 6.0 - square * (1.0 / 30.0 - square / 42.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn trigamma_matches_known_values() {
        let square = std::f64::consts::PI.powi(2);
        for (x, expected) in [(1.0, square / 6.0), (0.5, square / 2.0), (2.0, square / 6.0 - 1.0)] {
            assert!((trigamma(x) - expected).abs() < 1e-8, "{x}");
        }
    }
}
