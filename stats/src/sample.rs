//! Values of one quantity: their mean and its 95 % interval.

use statrs::distribution::{ContinuousCDF, StudentsT};

/// Mean and standard deviation of values of the same quantity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// Number of values, at least one.
    pub n: usize,
    /// Mean of the values.
    pub mean: f64,
    /// Standard deviation; none for a single value.
    pub deviation: Option<f64>,
}

impl Sample {
    /// The sample of some values; none without values.
    pub fn of(values: &[f64]) -> Option<Self> {
        let n = values.len();
        let mean = (n > 0).then(|| values.iter().sum::<f64>() / n as f64)?;
        let squares = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>();
        let deviation = (n > 1).then(|| (squares / (n - 1) as f64).sqrt());
        Some(Self { n, mean, deviation })
    }

    /// Half the width of the 95 % interval of the mean; none for a single value.
    pub fn half_width(&self) -> Option<f64> {
        let n = self.n as f64;
        self.deviation.map(|deviation| t_quantile_95(n - 1.0) * deviation / n.sqrt())
    }
}

/// The two-sided 95 % quantile of Student's t distribution.
pub(crate) fn t_quantile_95(degrees_of_freedom: f64) -> f64 {
    student_t(degrees_of_freedom).inverse_cdf(0.975)
}

/// Student's t distribution; the degrees of freedom must be above 0.
pub(crate) fn student_t(degrees_of_freedom: f64) -> StudentsT {
    StudentsT::new(0.0, 1.0, degrees_of_freedom).expect("more than 0 degrees of freedom")
}

/// Values of one quantity over the replicates of a simulation, some of which may have none.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ReplicateValues {
    /// The values, in the order of seeds.
    pub values: Vec<f64>,
    /// Number of replicates that were planned.
    pub planned: usize,
}

impl ReplicateValues {
    /// The sample of the values there are.
    pub fn sample(&self) -> Option<Sample> {
        Sample::of(&self.values)
    }

    /// Mean of the values there are.
    pub fn mean(&self) -> Option<f64> {
        self.sample().map(|sample| sample.mean)
    }

    /// The sample, if every replicate has a value.
    pub fn complete_sample(&self) -> Option<Sample> {
        self.sample().filter(|sample| sample.n == self.planned)
    }

    /// The same with each value multiplied by a factor.
    pub fn scaled(mut self, factor: f64) -> Self {
        self.values.iter_mut().for_each(|value| *value *= factor);
        self
    }

    /// Minimum and maximum.
    pub fn range(&self) -> Option<(f64, f64)> {
        let values = || self.values.iter().copied();
        Some((values().reduce(f64::min)?, values().reduce(f64::max)?))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn assert_near(actual: f64, expected: f64) {
        assert!((actual - expected).abs() < 1e-6 * expected.abs(), "{actual}, not {expected}");
    }

    #[test]
    fn t_quantiles_agree_with_tables() {
        // NIST handbook 1.3.6.7.2 to three places; ν = 1 is tan(0.475 π), ν = 2 is 0.95 √(2 / (1 − 0.95²)).
        assert_near(t_quantile_95(1.0), (0.475 * std::f64::consts::PI).tan());
        assert_near(t_quantile_95(2.0), 0.95 * (2.0f64 / (1.0 - 0.95 * 0.95)).sqrt());
        for (degrees_of_freedom, expected) in [(4.0, 2.776), (9.0, 2.262), (30.0, 2.042)] {
            assert!((t_quantile_95(degrees_of_freedom) - expected).abs() < 5e-4, "{degrees_of_freedom}");
        }
    }

    #[test]
    fn mean_deviation_and_interval_of_a_sample() {
        // 2, 4, 4, 4, 5, 5, 7, 9: mean 5, sum of squares 32.
        let sample = Sample::of(&[2.0, 4.0, 4.0, 4.0, 5.0, 5.0, 7.0, 9.0]).unwrap();
        assert_eq!((sample.n, sample.mean), (8, 5.0));
        assert_near(sample.deviation.unwrap(), (32.0f64 / 7.0).sqrt());
        assert!((sample.half_width().unwrap() - 1.7875).abs() < 1e-3, "2.3646 · 2.1381 / √8");
        assert_eq!(Sample::of(&[3.0]).unwrap().half_width(), None);
        assert_eq!(Sample::of(&[]), None);
    }

    #[test]
    fn replicates_without_a_value_leave_the_sample_incomplete() {
        let replicates = ReplicateValues { values: vec![2.0, 4.0], planned: 3 };
        assert_eq!(
            (replicates.mean(), replicates.complete_sample(), replicates.range()),
            (Some(3.0), None, Some((2.0, 4.0)))
        );
        assert_eq!(
            ReplicateValues { planned: 2, ..replicates.clone() }.complete_sample(),
            replicates.sample()
        );
        assert_eq!(replicates.scaled(2.0).values, [4.0, 8.0]);
    }
}
