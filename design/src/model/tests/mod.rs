//! Tests of models: against scikit-learn, NumPy and hetgpy, derivatives, and the time of a fit.

use nalgebra::DMatrix;
use serde::Deserialize;

use super::binomial::{self, Counted};
use super::gaussian::{self, Replicated};
use super::kernel::{Kernel, columns};
use super::*;

#[derive(Deserialize)]
struct Case {
    lengths: Vec<f64>,
    variance: f64,
    constant: f64,
    points: Vec<Vec<f64>>,
    #[serde(default)]
    noise: Vec<f64>,
    #[serde(default)]
    values: Vec<Vec<f64>>,
    #[serde(default)]
    runs: Vec<f64>,
    #[serde(default)]
    hits: Vec<f64>,
    log_likelihood: Option<f64>,
    at: Vec<Vec<f64>>,
    means: Vec<f64>,
    variances: Vec<f64>,
}

#[derive(Deserialize)]
struct Cases {
    gaussian: Vec<Case>,
    binomial: Vec<Case>,
    hetgpy: Vec<Case>,
}

fn cases() -> Cases {
    serde_json::from_str(include_str!("../../../tests/data/models.json")).expect("the cases")
}

impl Case {
    fn kernel(&self) -> Kernel {
        Kernel { lengths: self.lengths.clone(), variance: self.variance, constant: self.constant }
    }

    fn points(&self) -> DMatrix<f64> {
        columns(self.lengths.len(), &self.points)
    }

    fn replicated(&self) -> Vec<Replicated> {
        self.values.iter().map(|values| Replicated::of(values).unwrap()).collect()
    }

    fn counted(&self) -> Vec<Counted> {
        self.hits.iter().zip(&self.runs).map(|(count, n)| Counted { count: *count, n: *n }).collect()
    }

    fn check(&self, log_likelihood: f64, posterior: &Posterior, tolerance: f64) {
        if let Some(expected) = self.log_likelihood {
            assert!((log_likelihood - expected).abs() < tolerance, "{log_likelihood}, not {expected}");
        }
        let prediction = posterior.predict(&columns(self.lengths.len(), &self.at));
        for (index, (mean, variance)) in self.means.iter().zip(&self.variances).enumerate() {
            let (found, spread) = (prediction.means[index], prediction.variances[index]);
            assert!((found - mean).abs() < tolerance, "mean {found}, not {mean}");
            assert!((spread - variance).abs() < tolerance, "variance {spread}, not {variance}");
        }
    }
}

#[test]
fn means_agree_with_scikit_learn_on_all_values() {
    for case in cases().gaussian {
        let fit = gaussian::fit(&case.points(), &case.replicated(), &case.kernel(), &case.noise).unwrap();
        case.check(fit.log_likelihood, &fit.posterior, 1e-8);
    }
}

#[test]
fn counts_agree_with_the_equations_in_numpy() {
    for case in cases().binomial {
        let fit = binomial::fit(&case.points(), &case.counted(), &case.kernel(), None).unwrap();
        case.check(fit.log_likelihood, &fit.posterior, 1e-8);
    }
}

#[test]
fn means_agree_with_hetgpy() {
    for case in cases().hetgpy {
        let fit = gaussian::fit(&case.points(), &case.replicated(), &case.kernel(), &case.noise).unwrap();
        case.check(fit.log_likelihood, &fit.posterior, 1e-6);
    }
}

/// Compares a gradient by logarithms of hyperparameters with differences.
fn check_gradient(case: &Case, gradient: &[f64], log_likelihood: impl Fn(&Kernel, f64) -> f64) {
    let step: f64 = 1e-4;
    for (index, slope) in gradient.iter().enumerate() {
        let value = |sign: f64| {
            let (mut kernel, mut noise) = (case.kernel(), 1.0);
            let factor = (sign * step).exp();
            match index.cmp(&case.lengths.len()) {
                std::cmp::Ordering::Less => kernel.lengths[index] *= factor,
                std::cmp::Ordering::Equal => kernel.variance *= factor,
                std::cmp::Ordering::Greater => noise *= factor,
            }
            log_likelihood(&kernel, noise)
        };
        let difference = (value(1.0) - value(-1.0)) / (2.0 * step);
        assert!(
            (difference - slope).abs() < 1e-5 * (1.0 + slope.abs()),
            "{index}: {slope}, not {difference}"
        );
    }
}

#[test]
fn gradients_agree_with_differences() {
    for case in cases().gaussian {
        let fit = |kernel: &Kernel, factor: f64| {
            let noise: Vec<f64> = case.noise.iter().map(|noise| noise * factor).collect();
            gaussian::fit(&case.points(), &case.replicated(), kernel, &noise).unwrap()
        };
        let gradient = fit(&case.kernel(), 1.0).gradient;
        assert_eq!(gradient.len(), case.lengths.len() + 2);
        check_gradient(&case, &gradient, |kernel, factor| fit(kernel, factor).log_likelihood);
    }
    for case in cases().binomial {
        let fit = |kernel: &Kernel| binomial::fit(&case.points(), &case.counted(), kernel, None).unwrap();
        check_gradient(&case, &fit(&case.kernel()).gradient, |kernel, _| fit(kernel).log_likelihood);
    }
}

#[test]
fn newton_from_a_bad_start_finds_the_same_mode() {
    let case = &cases().binomial[3];
    let fit = binomial::fit(&case.points(), &case.counted(), &case.kernel(), None).unwrap();
    let start =
        nalgebra::DVector::from_fn(case.runs.len(), |index, _| if index % 2 == 0 { 30.0 } else { -30.0 });
    let other = binomial::fit(&case.points(), &case.counted(), &case.kernel(), Some(&start)).unwrap();
    assert!((fit.log_likelihood - other.log_likelihood).abs() < 1e-8);
}
