//! Statistics of a few runs: means with their 95 % intervals (Student), straight lines, rank correlations. Pure.
//!
//! | symbol | meaning |
//! |---|---|
//! | n, x̄, s | number of values, their mean, their standard deviation (n − 1) |
//! | t(ν) | two-sided 95 % quantile of Student's distribution with ν degrees of freedom |
//! | interval | x̄ ± t(n − 1) s / √n |
//! | ρ | Pearson's correlation of ranks, equals sharing the mean of theirs (Spearman) |
//! | p | share of Student's distribution, n − 2 degrees of freedom, beyond ρ √((n − 2) / (1 − ρ²)) on both sides |

use statrs::distribution::{ContinuousCDF, StudentsT};

/// Values of the same quantity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// How many there are, at least one.
    pub n: usize,
    /// Their mean.
    pub mean: f64,
    /// Standard deviation; none of a single value.
    pub deviation: Option<f64>,
}

impl Sample {
    /// None of no values.
    pub fn of(values: &[f64]) -> Option<Self> {
        let n = values.len();
        let mean = (n > 0).then(|| values.iter().sum::<f64>() / n as f64)?;
        let squares = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>();
        let deviation = (n > 1).then(|| (squares / (n - 1) as f64).sqrt());
        Some(Self { n, mean, deviation })
    }

    /// Half the width of the 95 % interval of the mean; none of a single value.
    pub fn half_width(&self) -> Option<f64> {
        let n = self.n as f64;
        self.deviation.map(|deviation| quantile(n - 1.0) * deviation / n.sqrt())
    }
}

/// The two-sided 95 % quantile of Student's distribution with so many degrees of freedom, more than 0.
pub fn quantile(degrees: f64) -> f64 {
    student(degrees).inverse_cdf(0.975)
}

fn student(degrees: f64) -> StudentsT {
    StudentsT::new(0.0, 1.0, degrees).expect("more than no degree of freedom")
}

/// A straight line by least squares.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Line {
    /// Change of y with x.
    pub slope: f64,
    /// y at x = 0.
    pub intercept: f64,
    /// Share of the variance that the line explains.
    pub r2: f64,
}

/// Share of a quantity below which a difference is what rounding has left.
pub const ROUNDING: f64 = 1e-12;

/// The line through points; none unless both coordinates vary.
pub fn line(points: &[(f64, f64)]) -> Option<Line> {
    let n = points.len() as f64;
    let mean_x = points.iter().map(|point| point.0).sum::<f64>() / n;
    let mean_y = points.iter().map(|point| point.1).sum::<f64>() / n;
    let sum = |of: &dyn Fn(f64, f64) -> f64| {
        points.iter().map(|point| of(point.0 - mean_x, point.1 - mean_y)).sum::<f64>()
    };
    let (xx, xy, yy) = (sum(&|x, _| x * x), sum(&|x, y| x * y), sum(&|_, y| y * y));
    // Less is what rounding has left of no slope at all.
    let xy = if xy * xy > ROUNDING * ROUNDING * xx * yy { xy } else { 0.0 };
    // Equals, and means of equals, are a little apart by rounding.
    let varies = |of: &dyn Fn(&(f64, f64)) -> f64| {
        let (low, high) =
            points.iter().map(of).fold((f64::MAX, f64::MIN), |(low, high), x| (low.min(x), high.max(x)));
        high - low > ROUNDING * low.abs().max(high.abs())
    };
    let vary = varies(&|point| point.0) && varies(&|point| point.1);
    let slope = (vary && xx > 0.0 && yy > 0.0).then(|| xy / xx)?;
    Some(Line { slope, intercept: mean_y - slope * mean_x, r2: xy * xy / (xx * yy) })
}

/// How well the order of the second coordinates follows that of the first, −1 to 1 (Spearman): the correlation of ranks. None
/// unless both coordinates vary.
pub fn rank_correlation(points: &[(f64, f64)]) -> Option<f64> {
    // Ranks of what rounding has left would vary.
    line(points)?;
    let xs = ranks(points.iter().map(|point| point.0).collect());
    let ys = ranks(points.iter().map(|point| point.1).collect());
    let line = line(&xs.into_iter().zip(ys).collect::<Vec<_>>())?;
    Some(line.r2.min(1.0).sqrt() * line.slope.signum())
}

/// The rank of each value; equals share the mean of theirs.
fn ranks(values: Vec<f64>) -> Vec<f64> {
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by(|one, other| values[*one].total_cmp(&values[*other]));
    let mut ranks = vec![0.0; values.len()];
    for equals in order.chunk_by(|one, other| values[*one] == values[*other]) {
        let first = order.partition_point(|other| values[*other] < values[equals[0]]);
        for index in equals {
            ranks[*index] = first as f64 + (equals.len() - 1) as f64 / 2.0;
        }
    }
    ranks
}

/// How likely a rank correlation of n points is to be as far from zero by chance; none of fewer than three points.
pub fn chance(correlation: f64, n: usize) -> Option<f64> {
    let degrees = n.checked_sub(2).filter(|degrees| *degrees > 0)? as f64;
    let t = correlation.abs() * (degrees / (1.0 - correlation * correlation)).sqrt();
    Some(if t.is_finite() { 2.0 * student(degrees).sf(t) } else { 0.0 })
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
    fn what_rounding_leaves_is_no_slope() {
        let points = [(0.1, 0.7), (0.2, 0.9), (0.3, 0.9), (0.4, 0.7)];
        assert_eq!(line(&points).unwrap().slope, 0.0);
        // Means of two and of three equals.
        let points = [(0.045, 0.1), (0.06, (0.1 + 0.1 + 0.1) / 3.0)];
        assert!(points[0].1 != points[1].1);
        assert!(line(&points).is_none() && rank_correlation(&points).is_none());
    }

    #[test]
    fn a_line_and_how_well_it_fits() {
        // y = 1, 3, 2: slope ½, mean 2, and a quarter of the variance.
        let fit = line(&[(0.0, 1.0), (1.0, 3.0), (2.0, 2.0)]).unwrap();
        assert_eq!((fit.slope, fit.intercept, fit.r2), (0.5, 1.5, 0.25));
        assert_eq!(line(&[(0.0, 1.0), (1.0, 1.0)]), None);
        assert_eq!(line(&[(0.0, 0.1), (1.0, 0.1), (2.0, 0.1)]), None, "their mean is not 0.1");
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
