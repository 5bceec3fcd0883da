//! Statistics of a few seeds: what is known of a quantity, differences and ratios of means (Welch). Means, intervals and lines
//! are the server's.
//!
//! | symbol | meaning |
//! |---|---|
//! | n, x̄, s | number of values, their mean, their standard deviation (n − 1) |
//! | t(ν) | two-sided 95 % quantile of Student's distribution with ν degrees of freedom |
//! | Welch | x̄ − ȳ ± t(ν) √(s_x²/n_x + s_y²/n_y), ν after Welch and Satterthwaite |

use roost_server::stats::quantile;
pub(super) use roost_server::stats::{Sample, line, rank_correlation};

/// What came of the same quantity under every seed that was planned.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Seeds {
    /// Of the runs that were sound and reached it, in the order of seeds.
    pub(super) values: Vec<f64>,
    /// How many runs there were to be.
    pub(super) planned: usize,
}

impl Seeds {
    pub(super) fn sample(&self) -> Option<Sample> {
        Sample::of(&self.values)
    }

    pub(super) fn mean(&self) -> Option<f64> {
        self.sample().map(|sample| sample.mean)
    }

    /// Mean and interval, unless a seed has none.
    pub(super) fn of_all(&self) -> Option<Sample> {
        self.sample().filter(|sample| sample.n == self.planned)
    }

    /// Each value multiplied.
    pub(super) fn times(mut self, factor: f64) -> Self {
        self.values.iter_mut().for_each(|value| *value *= factor);
        self
    }

    /// The lowest and the highest.
    pub(super) fn range(&self) -> Option<(f64, f64)> {
        let all = || self.values.iter().copied();
        Some((all().reduce(f64::min)?, all().reduce(f64::max)?))
    }
}

/// Square of the standard error of the mean; none of a single value.
fn error2(sample: &Sample) -> Option<f64> {
    sample.deviation.map(|deviation| deviation.powi(2) / sample.n as f64)
}

/// A difference or a ratio of two means, and half the width of its 95 % interval.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Difference {
    pub(super) mean: f64,
    pub(super) half_width: f64,
}

impl Difference {
    /// Whether the first is larger than the second beyond doubt, the interval lying above zero.
    pub(super) fn is_rise(&self) -> bool {
        self.mean > self.half_width
    }

    /// Whether the first is smaller beyond doubt.
    pub(super) fn is_fall(&self) -> bool {
        self.mean < -self.half_width
    }

    /// Whether a number lies in the interval.
    pub(super) fn holds(&self, value: f64) -> bool {
        (self.mean - value).abs() <= self.half_width
    }
}

/// Welch's interval of `a` − `b`; none unless both are of several values.
pub(super) fn welch(a: &Sample, b: &Sample) -> Option<Difference> {
    let (ea, eb) = (error2(a)?, error2(b)?);
    let spread = ea + eb;
    let degrees = spread.powi(2) / (ea.powi(2) / (a.n - 1) as f64 + eb.powi(2) / (b.n - 1) as f64);
    // Without any spread there is nothing to divide by, and no doubt.
    let half_width = if spread > 0.0 { quantile(degrees) * spread.sqrt() } else { 0.0 };
    Some(Difference { mean: a.mean - b.mean, half_width })
}

/// `a` over `b` with its 95 % interval, from the relative errors of both (to first order), the degrees of freedom after Welch and
/// Satterthwaite; none unless both are of several values above zero.
pub(super) fn ratio(a: &Sample, b: &Sample) -> Option<Difference> {
    let relative = |sample: &Sample| Some(error2(sample)? / sample.mean.powi(2));
    let (ea, eb) = (relative(a)?, relative(b)?);
    let as_if = |sample: &Sample, error2: f64| Sample {
        mean: 0.0,
        deviation: Some((error2 * sample.n as f64).sqrt()),
        n: sample.n,
    };
    let mean = (a.mean > 0.0 && b.mean > 0.0).then(|| a.mean / b.mean)?;
    Some(Difference { mean, half_width: mean * welch(&as_if(a, ea), &as_if(b, eb))?.half_width })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn near(value: f64, expected: f64) {
        assert!((value - expected).abs() < 1e-6 * expected.abs(), "{value}, not {expected}");
    }

    #[test]
    fn welch_agrees_with_a_worked_example() {
        // Deviations 5 and 10 of 10 and 20 values: errors² 2.5 and 5, ν = 56.25 / (6.25/9 + 25/19) = 27.98.
        let a = Sample { n: 10, mean: 20.0, deviation: Some(5.0) };
        let b = Sample { n: 20, mean: 15.0, deviation: Some(10.0) };
        let difference = welch(&a, &b).unwrap();
        assert_eq!(difference.mean, 5.0);
        assert!((difference.half_width - 2.048 * 7.5f64.sqrt()).abs() < 5e-3, "{}", difference.half_width);
        let alone = Sample { n: 1, mean: 1.0, deviation: None };
        assert_eq!(welch(&a, &alone), None);
        let still = Sample { n: 5, mean: 1.0, deviation: Some(0.0) };
        assert_eq!(welch(&still, &still), Some(Difference { mean: 0.0, half_width: 0.0 }));
    }

    #[test]
    fn a_ratio_carries_the_relative_errors_of_both() {
        // Errors 5 % and 5 % of 5 values each: ν = 8, t = 2.306, √2 · 5 %.
        let of = |mean: f64| Sample { n: 5, mean, deviation: Some(0.05 * mean * 5f64.sqrt()) };
        let ratio = ratio(&of(6.0), &of(8.0)).unwrap();
        near(ratio.mean, 0.75);
        assert!((ratio.half_width - 0.75 * 2.306 * 0.05 * 2f64.sqrt()).abs() < 1e-4, "{ratio:?}");
        assert!(ratio.holds(0.80) && !ratio.holds(0.90));
        assert_eq!(super::ratio(&of(6.0), &of(0.0)), None);
    }

    #[test]
    fn a_difference_rises_or_falls_only_beyond_its_interval() {
        let of = |mean| Difference { mean, half_width: 1.0 };
        assert_eq!([1.5, 0.5, -0.5, -1.5].map(|mean| of(mean).is_rise()), [true, false, false, false]);
        assert_eq!([1.5, 0.5, -0.5, -1.5].map(|mean| of(mean).is_fall()), [false, false, false, true]);
    }

    #[test]
    fn seeds_know_what_is_missing() {
        let seeds = Seeds { values: vec![2.0, 4.0], planned: 3 };
        assert_eq!((seeds.mean(), seeds.of_all(), seeds.range()), (Some(3.0), None, Some((2.0, 4.0))));
        assert_eq!(Seeds { planned: 2, ..seeds.clone() }.of_all(), seeds.sample());
        assert_eq!(seeds.times(2.0).values, [4.0, 8.0]);
    }
}
