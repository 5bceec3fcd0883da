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
    /// Number of levels of each factor, 0 for a range; empty for ranges alone.
    #[serde(default)]
    levels: Vec<usize>,
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
    levels: Vec<Case>,
}

fn cases() -> Cases {
    serde_json::from_str(include_str!("../../../tests/data/models.json")).expect("the cases")
}

impl Case {
    fn kernel(&self) -> Kernel {
        let ranges = vec![0; self.lengths.len()];
        let levels = if self.levels.is_empty() { ranges } else { self.levels.clone() };
        Kernel { lengths: self.lengths.clone(), levels, variance: self.variance, constant: self.constant }
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
fn means_over_levels_agree_with_scikit_learn() {
    for case in cases().levels {
        assert!(case.levels.iter().any(|levels| *levels > 0));
        let fit = gaussian::fit(&case.points(), &case.replicated(), &case.kernel(), &case.noise).unwrap();
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
    for case in cases().gaussian.into_iter().chain(cases().levels) {
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

#[test]
fn fantasy_updates_variances_like_a_run_whose_result_is_the_mean() {
    let case = &cases().gaussian[1];
    let fit = |points: &DMatrix<f64>, values: &[Replicated], noise: &[f64]| {
        gaussian::fit(points, values, &case.kernel(), noise).unwrap().posterior
    };
    let candidates = columns(2, &case.at);
    let before = fit(&case.points(), &case.replicated(), &case.noise);
    let prediction = before.predict(&candidates);
    let mut fantasies = fantasy::Fantasies {
        covariances: before.covariances(&candidates, &prediction),
        noise: vec![0.07; 5],
    };
    let (mut points, mut values, mut noise) = (case.points.clone(), case.replicated(), case.noise.clone());
    for candidate in [2, 2, 4] {
        fantasies.observe(candidate);
        points.push(case.at[candidate].clone());
        values.push(Replicated { n: 1.0, mean: prediction.means[candidate], squares: 0.0 });
        noise.push(0.07);
    }
    let after = fit(&columns(2, &points), &values, &noise).predict(&candidates);
    for index in 0..5 {
        assert!((after.means[index] - prediction.means[index]).abs() < 1e-9, "the mean stays");
        assert!((after.variances[index] - fantasies.deviation(index).powi(2)).abs() < 1e-9);
    }
}

#[test]
fn signed_root_has_the_tail_of_the_exact_posterior() {
    let kernel = kernel::Kernel { lengths: vec![0.7], levels: vec![0], variance: 10.0, constant: 9.0 };
    let point = columns(1, &[[0.2]]);
    let level = (0.2_f64 / 0.8).ln();
    let tail = |u: f64| 0.5 * statrs::function::erf::erfc(u.abs() / std::f64::consts::SQRT_2);
    for (count, n) in [(0.0, 20.0), (0.0, 60.0), (12.0, 12.0), (1.0, 20.0), (9.0, 24.0)] {
        let counts = [Counted { count, n }];
        let fit = binomial::fit(&point, &counts, &kernel, None).unwrap().posterior;
        // At the point of the data, and at some distance from it.
        for x in [0.2, 0.45] {
            let at = columns(1, &[[x]]);
            let prediction = fit.predict(&at);
            let root = root::signed_roots(&fit, &counts, &at, &prediction, level)[0];
            // The exact posterior at the point of the data, and given its value, that at x.
            let (variance, covariance) = (kernel.diagonal(), kernel.matrix(&point, &at)[(0, 0)]);
            let rest = (variance - covariance * covariance / variance).max(1e-9).sqrt();
            let (mut sum, mut wrong) = (0.0, 0.0);
            for step in -40_000..40_000 {
                let f = f64::from(step) * 1e-3;
                let weight = (count * f - n * binomial::softplus(f) - 0.5 * f * f / variance).exp();
                sum += weight;
                let u = (covariance / variance * f - level) / rest;
                wrong += weight * if (u > 0.0) == (root > 0.0) { tail(u) } else { 1.0 - tail(u) };
            }
            let exact = wrong / sum;
            let normal = tail((prediction.means[0] - level) / prediction.variances[0].sqrt());
            let error = |tail: f64| (tail - exact).abs();
            let found = tail(root);
            let place = format!("{count} of {n} at {x}: exact {exact}, root {found}, normal {normal}");
            assert!(error(found) <= error(normal) + 1e-3, "{place}");
            assert!(exact < 1e-6 || (exact / 6.0..=4.0 * exact).contains(&found), "{place}");
            // Where all runs agree, Laplace's approximation is far off.
            let do_agree = count == 0.0 || count == n;
            assert!(!do_agree || error(found) <= 0.5 * error(normal), "{place}");
            assert!(count != 0.0 || x > 0.2 || normal > 10.0 * exact, "{place}");
        }
    }
}

fn range() -> Factor {
    Factor::range("x".into(), 0.0, 1.0)
}

/// Runs of a response with standard deviation 0.1 at one end of the range and 1 at the other.
fn uneven(replicates: u32) -> Vec<PointRuns> {
    let mut random = crate::tests::truth::Random(4);
    let mut runs = Vec::new();
    for index in 0..60 {
        let point = crate::Point::new(&[f64::from(index) / 59.0]);
        let x = point.coordinates()[0];
        for replicate in 0..replicates {
            let value = 5.0 + 2.0 * x + 0.1 * 10.0_f64.powf(x) * random.normal();
            runs.push(crate::tests::truth::run(
                &crate::Proposal { point: point.clone(), replicate },
                "y",
                value,
            ));
        }
    }
    crate::Evidence::new(runs).points().to_vec()
}

#[test]
fn noise_is_smoothed_over_the_range() {
    let measure = Measure::Mean("y".into());
    let ends = columns(1, &[[0.05], [0.95]]);
    let deviations = |replicates: u32| {
        let model = Model::fit(&[range()], &measure, &uneven(replicates)).unwrap();
        let Likelihood::Gaussian { spread, .. } = &model.likelihood else { panic!("a mean") };
        let noise = model.noise(&ends, &model.posterior.predict(&ends));
        [noise[0].sqrt() * spread, noise[1].sqrt() * spread]
    };
    // Two replicates at each of 60 points.
    let [low, high] = deviations(2);
    assert!((0.07..0.18).contains(&low) && (0.6..1.3).contains(&high), "{low} and {high}, not 0.11 and 0.89");
    let [low, high] = deviations(1);
    assert!((low - high).abs() < 1e-9 && (0.3..0.7).contains(&low), "without replicates one noise: {low}");
}

#[test]
fn model_fits_a_line_and_converts_latent_values() {
    let model = Model::fit(&[range()], &Measure::Mean("y".into()), &uneven(4)).unwrap();
    let at = columns(1, &[[0.3]]);
    let prediction = model.posterior.predict(&at);
    let value = model.value(prediction.means[0]);
    assert!((value - 5.6).abs() < 0.1, "{value}");
    assert!((model.value(model.latent(5.6)) - 5.6).abs() < 1e-12);
    assert!(model.alternatives.len() == 6, "two for each of three hyperparameters");
    assert!(Model::fit(&[range()], &Measure::Mean("other".into()), &uneven(4)).is_none());
}
