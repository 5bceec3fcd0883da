//! Straight lines by least squares, and rank correlations.

use statrs::distribution::ContinuousCDF;

use crate::sample::student_t;

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

/// A relative difference below this is rounding error.
pub const ROUNDING: f64 = 1e-12;

/// The line through points; none unless both coordinates vary.
pub fn line(points: &[(f64, f64)]) -> Option<Line> {
    let n = points.len() as f64;
    let mean_x = points.iter().map(|point| point.0).sum::<f64>() / n;
    let mean_y = points.iter().map(|point| point.1).sum::<f64>() / n;
    let sum = |term: &dyn Fn(f64, f64) -> f64| {
        points.iter().map(|point| term(point.0 - mean_x, point.1 - mean_y)).sum::<f64>()
    };
    let (xx, xy, yy) = (sum(&|x, _| x * x), sum(&|x, y| x * y), sum(&|_, y| y * y));
    // A smaller covariance is the rounding error of a slope of zero.
    let xy = if xy * xy > ROUNDING * ROUNDING * xx * yy { xy } else { 0.0 };
    // Equal values, and means of equal values, differ by rounding errors.
    let varies = |coordinate: &dyn Fn(&(f64, f64)) -> f64| {
        let (low, high) = points
            .iter()
            .map(coordinate)
            .fold((f64::MAX, f64::MIN), |(low, high), x| (low.min(x), high.max(x)));
        high - low > ROUNDING * low.abs().max(high.abs())
    };
    let both_vary = varies(&|point| point.0) && varies(&|point| point.1);
    let slope = (both_vary && xx > 0.0 && yy > 0.0).then(|| xy / xx)?;
    Some(Line { slope, intercept: mean_y - slope * mean_x, r2: xy * xy / (xx * yy) })
}

/// Spearman's rank correlation of the two coordinates, −1 to 1; none unless both vary.
pub fn rank_correlation(points: &[(f64, f64)]) -> Option<f64> {
    // Ranks would turn rounding errors into variation.
    line(points)?;
    let xs = ranks(points.iter().map(|point| point.0).collect());
    let ys = ranks(points.iter().map(|point| point.1).collect());
    let line = line(&xs.into_iter().zip(ys).collect::<Vec<_>>())?;
    Some(line.r2.min(1.0).sqrt() * line.slope.signum())
}

/// The rank of each value; equal values share the mean of their ranks.
fn ranks(values: Vec<f64>) -> Vec<f64> {
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by(|one, other| values[*one].total_cmp(&values[*other]));
    let mut ranks = vec![0.0; values.len()];
    for ties in order.chunk_by(|one, other| values[*one] == values[*other]) {
        let first = order.partition_point(|other| values[*other] < values[ties[0]]);
        for index in ties {
            ranks[*index] = first as f64 + (ties.len() - 1) as f64 / 2.0;
        }
    }
    ranks
}

/// Two-sided p-value of a rank correlation of n points; none for fewer than three points.
pub fn rank_correlation_p_value(correlation: f64, n: usize) -> Option<f64> {
    let degrees_of_freedom = n.checked_sub(2).filter(|degrees| *degrees > 0)? as f64;
    let t = correlation.abs() * (degrees_of_freedom / (1.0 - correlation * correlation)).sqrt();
    Some(if t.is_finite() { 2.0 * student_t(degrees_of_freedom).sf(t) } else { 0.0 })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn assert_near(actual: f64, expected: f64) {
        assert!((actual - expected).abs() < 1e-6 * expected.abs(), "{actual}, not {expected}");
    }

    #[test]
    fn rounding_errors_are_no_slope() {
        let points = [(0.1, 0.7), (0.2, 0.9), (0.3, 0.9), (0.4, 0.7)];
        assert_eq!(line(&points).unwrap().slope, 0.0);
        // Means of two and of three equal values.
        let points = [(0.045, 0.1), (0.06, (0.1 + 0.1 + 0.1) / 3.0)];
        assert!(points[0].1 != points[1].1);
        assert!(line(&points).is_none() && rank_correlation(&points).is_none());
    }

    #[test]
    fn regression_line_of_three_points_matches_hand_calculated_values() {
        // y = 1, 3, 2: slope ½, mean 2, and a quarter of the variance.
        let fit = line(&[(0.0, 1.0), (1.0, 3.0), (2.0, 2.0)]).unwrap();
        assert_eq!((fit.slope, fit.intercept, fit.r2), (0.5, 1.5, 0.25));
        assert_eq!(line(&[(0.0, 1.0), (1.0, 1.0)]), None);
        assert_eq!(line(&[(0.0, 0.1), (1.0, 0.1), (2.0, 0.1)]), None, "their mean is not 0.1");
    }

    #[test]
    fn rank_correlation_depends_on_the_order_only() {
        let correlation =
            |ys: &[f64]| rank_correlation(&(0..).map(f64::from).zip(ys.iter().copied()).collect::<Vec<_>>());
        assert_near(correlation(&[1.0, 10.0, 100.0, 101.0]).unwrap(), 1.0);
        assert_near(correlation(&[4.0, 3.0, 2.0, -50.0]).unwrap(), -1.0);
        // One pair of neighbours among six changes places: 1 − 6 · 2 / (6 · 35).
        assert_near(correlation(&[0.1, 0.2, 0.3, 0.4, 0.6, 0.5]).unwrap(), 1.0 - 12.0 / 210.0);
        assert_eq!(correlation(&[1.0, 1.0, 1.0]), None);
    }

    #[test]
    fn p_values_of_rank_correlations_match_the_closed_form() {
        // ρ = 0.6 of 6 points: t = 1.5 with ν = 4, p = 1 − t (6 + t²) / (4 + t²)^1.5.
        let expected = 1.0 - 1.5 * (6.0 + 2.25) / 6.25f64.powf(1.5);
        assert_near(rank_correlation_p_value(0.6, 6).unwrap(), expected);
        assert_near(rank_correlation_p_value(-0.6, 6).unwrap(), expected);
        assert_eq!(rank_correlation_p_value(1.0, 6), Some(0.0));
        assert_eq!(rank_correlation_p_value(0.6, 2), None);
    }
}
