//! Statistics of a few seeds: means with their 95 % intervals (Student), differences of means (Welch), straight lines.
//!
//! | symbol | meaning |
//! |---|---|
//! | n, x̄, s | number of values, their mean, their standard deviation (n − 1) |
//! | t(ν) | two-sided 95 % quantile of Student's distribution with ν degrees of freedom |
//! | interval | x̄ ± t(n − 1) s / √n |
//! | Welch | x̄ − ȳ ± t(ν) √(s_x²/n_x + s_y²/n_y), ν after Welch and Satterthwaite |

use statrs::distribution::{ContinuousCDF, StudentsT};

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

/// Values of the same quantity under different seeds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Sample {
    /// How many there are, at least one.
    pub(super) n: usize,
    pub(super) mean: f64,
    /// Standard deviation; none of a single value.
    pub(super) deviation: Option<f64>,
}

impl Sample {
    /// None of no values.
    pub(super) fn of(values: &[f64]) -> Option<Self> {
        let n = values.len();
        let mean = (n > 0).then(|| values.iter().sum::<f64>() / n as f64)?;
        let squares = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>();
        let deviation = (n > 1).then(|| (squares / (n - 1) as f64).sqrt());
        Some(Self { n, mean, deviation })
    }

    /// Half the width of the 95 % interval of the mean; none of a single value.
    pub(super) fn half_width(&self) -> Option<f64> {
        let n = self.n as f64;
        self.deviation.map(|deviation| quantile(n - 1.0) * deviation / n.sqrt())
    }

    /// Square of the standard error of the mean.
    fn error2(&self) -> Option<f64> {
        self.deviation.map(|deviation| deviation.powi(2) / self.n as f64)
    }
}

/// The two-sided 95 % quantile of Student's distribution.
fn quantile(degrees: f64) -> f64 {
    let distribution = StudentsT::new(0.0, 1.0, degrees).expect("at least two values");
    distribution.inverse_cdf(0.975)
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
    let (ea, eb) = (a.error2()?, b.error2()?);
    let spread = ea + eb;
    let degrees = spread.powi(2) / (ea.powi(2) / (a.n - 1) as f64 + eb.powi(2) / (b.n - 1) as f64);
    // Without any spread there is nothing to divide by, and no doubt.
    let half_width = if spread > 0.0 { quantile(degrees) * spread.sqrt() } else { 0.0 };
    Some(Difference { mean: a.mean - b.mean, half_width })
}

/// `a` over `b` with its 95 % interval, from the relative errors of both (to first order), the degrees of freedom after Welch and
/// Satterthwaite; none unless both are of several values above zero.
pub(super) fn ratio(a: &Sample, b: &Sample) -> Option<Difference> {
    let relative = |sample: &Sample| Some(sample.error2()? / sample.mean.powi(2));
    let (ea, eb) = (relative(a)?, relative(b)?);
    let as_if = |sample: &Sample, error2: f64| Sample {
        mean: 0.0,
        deviation: Some((error2 * sample.n as f64).sqrt()),
        n: sample.n,
    };
    let mean = (a.mean > 0.0 && b.mean > 0.0).then(|| a.mean / b.mean)?;
    Some(Difference { mean, half_width: mean * welch(&as_if(a, ea), &as_if(b, eb))?.half_width })
}

/// A straight line by least squares.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Line {
    pub(super) slope: f64,
    pub(super) intercept: f64,
    /// Share of the variance that the line explains.
    pub(super) r2: f64,
}

/// The line through points; none unless both coordinates vary.
pub(super) fn line(points: &[(f64, f64)]) -> Option<Line> {
    let n = points.len() as f64;
    let mean_x = points.iter().map(|point| point.0).sum::<f64>() / n;
    let mean_y = points.iter().map(|point| point.1).sum::<f64>() / n;
    let sum = |of: &dyn Fn(f64, f64) -> f64| {
        points.iter().map(|point| of(point.0 - mean_x, point.1 - mean_y)).sum::<f64>()
    };
    let (xx, xy, yy) = (sum(&|x, _| x * x), sum(&|x, y| x * y), sum(&|_, y| y * y));
    let slope = (xx > 0.0 && yy > 0.0).then(|| xy / xx)?;
    Some(Line { slope, intercept: mean_y - slope * mean_x, r2: xy * xy / (xx * yy) })
}

/// How well the order of the second coordinates follows that of the first, −1 to 1 (Spearman): the correlation of ranks.
pub(super) fn rank_correlation(points: &[(f64, f64)]) -> Option<f64> {
    // Equals share the mean of their ranks.
    let rank = |of: &dyn Fn(&(f64, f64)) -> f64, value: f64| {
        let below = points.iter().filter(|point| of(point) < value).count();
        let same = points.iter().filter(|point| of(point) == value).count();
        below as f64 + same as f64 / 2.0
    };
    let ranks = points.iter().map(|(x, y)| (rank(&|point| point.0, *x), rank(&|point| point.1, *y)));
    let line = line(&ranks.collect::<Vec<_>>())?;
    Some(line.r2.sqrt() * line.slope.signum())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn near(value: f64, expected: f64) {
        assert!((value - expected).abs() < 1e-6 * expected.abs(), "{value}, not {expected}");
    }

    #[test]
    fn quantiles_are_those_of_the_tables() {
        // NIST handbook 1.3.6.7.2 to three places; ν = 1 is tan(0.475 π), ν = 2 is 0.95 √(2 / (1 − 0.95²)).
        near(quantile(1.0), (0.475 * std::f64::consts::PI).tan());
        near(quantile(2.0), 0.95 * (2.0f64 / (1.0 - 0.95 * 0.95)).sqrt());
        for (degrees, table) in [(4.0, 2.776), (9.0, 2.262), (30.0, 2.042)] {
            assert!((quantile(degrees) - table).abs() < 5e-4, "{degrees}");
        }
    }

    #[test]
    fn mean_deviation_and_interval() {
        // 2, 4, 4, 4, 5, 5, 7, 9: mean 5, squares 32.
        let sample = Sample::of(&[2.0, 4.0, 4.0, 4.0, 5.0, 5.0, 7.0, 9.0]).unwrap();
        assert_eq!((sample.n, sample.mean), (8, 5.0));
        near(sample.deviation.unwrap(), (32.0f64 / 7.0).sqrt());
        assert!((sample.half_width().unwrap() - 1.7875).abs() < 1e-3, "2.3646 · 2.1381 / √8");
        assert_eq!(Sample::of(&[3.0]).unwrap().half_width(), None);
        assert_eq!(Sample::of(&[]), None);
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

    #[test]
    fn a_line_and_how_well_it_fits() {
        // y = 1, 3, 2: slope ½, mean 2, and a quarter of the variance.
        let fit = line(&[(0.0, 1.0), (1.0, 3.0), (2.0, 2.0)]).unwrap();
        assert_eq!((fit.slope, fit.intercept, fit.r2), (0.5, 1.5, 0.25));
        assert_eq!(line(&[(0.0, 1.0), (1.0, 1.0)]), None);
    }

    #[test]
    fn ranks_see_order_and_nothing_else() {
        let of =
            |ys: &[f64]| rank_correlation(&(0..).map(f64::from).zip(ys.iter().copied()).collect::<Vec<_>>());
        near(of(&[1.0, 10.0, 100.0, 101.0]).unwrap(), 1.0);
        near(of(&[4.0, 3.0, 2.0, -50.0]).unwrap(), -1.0);
        // One pair of neighbours among six changes places: 1 − 6 · 2 / (6 · 35).
        near(of(&[0.1, 0.2, 0.3, 0.4, 0.6, 0.5]).unwrap(), 1.0 - 12.0 / 210.0);
        assert_eq!(of(&[1.0, 1.0, 1.0]), None);
    }
}
