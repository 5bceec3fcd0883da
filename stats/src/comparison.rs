//! Differences and ratios of two means, with Welch's 95 % interval.

use crate::sample::{Sample, t_quantile_95};

/// A difference or a ratio of two means, and half the width of its 95 % interval.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Difference {
    /// The difference or the ratio.
    pub mean: f64,
    /// Half the width of its 95 % interval.
    pub half_width: f64,
}

impl Difference {
    /// Whether the whole interval lies above zero.
    pub fn is_rise(&self) -> bool {
        self.mean > self.half_width
    }

    /// Whether the whole interval lies below zero.
    pub fn is_fall(&self) -> bool {
        self.mean < -self.half_width
    }

    /// Whether the interval contains a value.
    pub fn contains(&self, value: f64) -> bool {
        (self.mean - value).abs() <= self.half_width
    }
}

/// Square of the standard error of the mean; none for a single value.
fn squared_error(sample: &Sample) -> Option<f64> {
    sample.deviation.map(|deviation| deviation.powi(2) / sample.n as f64)
}

/// Welch's interval of `a` − `b`; none unless both have several values.
pub fn welch(a: &Sample, b: &Sample) -> Option<Difference> {
    let term = |weight: f64, sample: &Sample| ErrorTerm {
        weight,
        squared_error: squared_error(sample),
        degrees_of_freedom: sample.n as f64 - 1.0,
    };
    let half_width = unpaired_half_width([term(1.0, a), term(-1.0, b)])?;
    Some(Difference { mean: a.mean - b.mean, half_width })
}

/// A mean in a weighted sum.
pub(crate) struct ErrorTerm {
    /// Its weight.
    pub(crate) weight: f64,
    /// Square of its standard error; none for a single value.
    pub(crate) squared_error: Option<f64>,
    /// Degrees of freedom of this error.
    pub(crate) degrees_of_freedom: f64,
}

/// Half the width of Welch's interval of a weighted sum of means; none if a mean with a weight is that of a single value.
pub(crate) fn unpaired_half_width(terms: impl IntoIterator<Item = ErrorTerm>) -> Option<f64> {
    let (mut sum, mut squares) = (0.0, 0.0);
    for term in terms.into_iter().filter(|term| term.weight != 0.0) {
        let error = term.weight * term.weight * term.squared_error?;
        sum += error;
        squares += error.powi(2) / term.degrees_of_freedom;
    }
    // Without any variance the degrees of freedom are 0/0, and the interval is a point.
    Some(if sum > 0.0 { t_quantile_95(sum.powi(2) / squares) * sum.sqrt() } else { 0.0 })
}

/// `a` / `b` with its 95 % interval from the relative errors of both, to first order; the degrees of freedom are Welch's.
/// None unless both have several values and a mean above zero.
pub fn ratio(a: &Sample, b: &Sample) -> Option<Difference> {
    let relative_error = |sample: &Sample| Some(squared_error(sample)? / sample.mean.powi(2));
    let (error_a, error_b) = (relative_error(a)?, relative_error(b)?);
    let with_error = |sample: &Sample, squared_error: f64| Sample {
        mean: 0.0,
        deviation: Some((squared_error * sample.n as f64).sqrt()),
        n: sample.n,
    };
    let mean = (a.mean > 0.0 && b.mean > 0.0).then(|| a.mean / b.mean)?;
    let relative = welch(&with_error(a, error_a), &with_error(b, error_b))?;
    Some(Difference { mean, half_width: mean * relative.half_width })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn welch_agrees_with_a_worked_example() {
        // Deviations 5 and 10 of 10 and 20 values: errors² 2.5 and 5, ν = 56.25 / (6.25/9 + 25/19) = 27.98.
        let a = Sample { n: 10, mean: 20.0, deviation: Some(5.0) };
        let b = Sample { n: 20, mean: 15.0, deviation: Some(10.0) };
        let difference = welch(&a, &b).unwrap();
        assert_eq!(difference.mean, 5.0);
        assert!((difference.half_width - 2.048 * 7.5f64.sqrt()).abs() < 5e-3, "{}", difference.half_width);
        let single = Sample { n: 1, mean: 1.0, deviation: None };
        assert_eq!(welch(&a, &single), None);
        let constant = Sample { n: 5, mean: 1.0, deviation: Some(0.0) };
        assert_eq!(welch(&constant, &constant), Some(Difference { mean: 0.0, half_width: 0.0 }));
    }

    #[test]
    fn ratio_has_the_relative_errors_of_both_means() {
        // Errors 5 % and 5 % of 5 values each: ν = 8, t = 2.306, √2 · 5 %.
        let sample = |mean: f64| Sample { n: 5, mean, deviation: Some(0.05 * mean * 5f64.sqrt()) };
        let result = ratio(&sample(6.0), &sample(8.0)).unwrap();
        assert!((result.mean - 0.75).abs() < 1e-9);
        assert!((result.half_width - 0.75 * 2.306 * 0.05 * 2f64.sqrt()).abs() < 1e-4, "{result:?}");
        assert!(result.contains(0.80) && !result.contains(0.90));
        assert_eq!(ratio(&sample(6.0), &sample(0.0)), None);
    }

    #[test]
    fn difference_rises_or_falls_only_beyond_its_interval() {
        let difference = |mean| Difference { mean, half_width: 1.0 };
        let means = [1.5, 0.5, -0.5, -1.5];
        assert_eq!(means.map(|mean| difference(mean).is_rise()), [true, false, false, false]);
        assert_eq!(means.map(|mean| difference(mean).is_fall()), [false, false, false, true]);
    }
}
