//! One-sided bounds of a probability or mean from the runs of a confirmation.
//!
//! | symbol | meaning |
//! |---|---|
//! | n, x̄, s, γ | number, mean, standard deviation and skewness of the values |
//! | q | quantile of Student's t with n − 1 degrees of freedom |
//! | h(y, γ) | 3/a·((1 + a(y − a/6))^⅓ − 1) with a = γ/√n, which is y without skewness |
//!
//! A mean is below x̄ − h(−q, γ)·s/√n and above x̄ − h(q, γ)·s/√n (Hall 1992, Journal of the Royal Statistical Society B 54,
//! 221). A few small values of a skewed response have a small mean and a small deviation at once, so that Student's bounds are
//! too narrow on that side. On the other side they are the wider ones, and stay. Few values show less skewness than there
//! is: γ is taken two of its standard errors, √(6/n) each, to the worse side. docs/accuracy.md has the rates of error.

use roost_stats::Sample;
use serde::{Deserialize, Serialize};
use statrs::distribution::{Binomial, ContinuousCDF, DiscreteCDF, StudentsT};

use crate::intervals::{skewness, without_skewness};
use crate::measure::Measure;

/// One-sided bounds of a measure at a look.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Bounds {
    /// Number of values.
    pub n: usize,
    /// Number of runs without a value. Each bound of a probability takes them as its worse case.
    pub lost: usize,
    /// Share or mean of the values.
    pub value: f64,
    /// The measure is above this bound with at least 95 % confidence.
    pub low: f64,
    /// The measure is below this bound with at least 95 % confidence.
    pub high: f64,
}

impl Bounds {
    /// Bounds from the values of a look's runs, none for a lost run; each is wrong with probability `tail`. None without
    /// values, and for a mean of fewer than three values or of equal ones: nothing is known about the others.
    pub(super) fn of(measure: &Measure, tail: f64, values: &[Option<f64>]) -> Option<Self> {
        let known: Vec<f64> = values.iter().flatten().copied().collect();
        let sample = Sample::of(&known)?;
        let lost = values.len() - known.len();
        let (low, high) = match measure {
            Measure::Probability(_) => {
                let count = known.iter().filter(|value| **value != 0.0).count();
                let bound = |count| upper(count + lost, values.len(), tail);
                (1.0 - bound(known.len() - count), bound(count))
            }
            Measure::Mean(_) => {
                let deviation = sample.deviation.filter(|deviation| *deviation > 0.0 && sample.n > 2)?;
                let (n, skewness) = (sample.n as f64, skewness(&known, sample.mean));
                let below = mean_quantile(sample.n, tail, -skewness);
                let above = mean_quantile(sample.n, tail, skewness);
                let unit = deviation / n.sqrt();
                (sample.mean - below * unit, sample.mean + above * unit)
            }
        };
        Some(Self { n: sample.n, lost, value: sample.mean, low, high })
    }
}

/// The upper bound of a probability: `count` events or fewer of `n` then have the probability `tail`.
fn upper(count: usize, n: usize, tail: f64) -> f64 {
    bisect(|p| at_most(count, n, p) > tail)
}

/// The end of the range from 0 on in which a condition on a probability holds.
pub(super) fn bisect(holds: impl Fn(f64) -> bool) -> f64 {
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..50 {
        let middle = 0.5 * (low + high);
        *(if holds(middle) { &mut low } else { &mut high }) = middle;
    }
    high
}

/// Probability of at most `count` events in `n` runs.
pub(super) fn at_most(count: usize, n: usize, p: f64) -> f64 {
    Binomial::new(p, n as u64).expect("a probability").cdf(count as u64)
}

/// The distance of the upper bound of a mean from the mean of `n` values, in units of s/√n.
pub(super) fn mean_quantile(n: usize, tail: f64, skewness: f64) -> f64 {
    let student = StudentsT::new(0.0, 1.0, n as f64 - 1.0).expect("at least two runs");
    let (quantile, root) = (student.inverse_cdf(1.0 - tail), (n as f64).sqrt());
    let doubt = 2.0 * 6.0_f64.sqrt() / root;
    quantile.max(-without_skewness(-quantile, (skewness + doubt) / root))
}
