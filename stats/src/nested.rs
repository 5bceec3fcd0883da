//! Runs in groups: each group has parameters of its own, which are a sample of what is known of them, and runs with different seeds.
//!
//! | symbol | meaning |
//! |---|---|
//! | k, m_i, N | number of groups, of runs of group i, of all runs |
//! | σ² | mean square within groups: chance |
//! | MSB | mean square between groups, k − 1 degrees of freedom |
//! | τ² | (MSB − σ²)/m₀, not below 0: variance of the expected response over the parameters |
//! | m₀ | (N − Σ m_i²/N)/(k − 1) |
//! | interval | x̄ ± t(k − 1) √(τ² + MSB/N) |
//!
//! The interval is that of the expected response with the true parameters, whatever they are: more runs make it narrower down to τ, and only
//! better known parameters beyond. The estimators are those of the analysis of variance (Searle, Casella and McCulloch 1992, section 3.6).

use crate::sample::t_quantile_95;

/// Moments of grouped runs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Nested {
    /// Mean of all runs.
    pub mean: f64,
    /// Standard deviation of the expected response over the parameters, τ.
    pub input_deviation: f64,
    /// Standard deviation of runs with the same parameters, σ; none when no group has two runs: chance then counts as input.
    pub chance_deviation: Option<f64>,
    /// Ends of the 95 % interval.
    pub interval: (f64, f64),
}

impl Nested {
    /// The moments of groups of values; none with fewer than two groups.
    pub fn of(groups: &[Vec<f64>]) -> Option<Self> {
        let groups: Vec<&Vec<f64>> = groups.iter().filter(|group| !group.is_empty()).collect();
        let counts: Vec<f64> = groups.iter().map(|group| group.len() as f64).collect();
        let (k, n) = (groups.len() as f64, counts.iter().sum::<f64>());
        if k < 2.0 {
            return None;
        }
        let means: Vec<f64> =
            groups.iter().map(|group| group.iter().sum::<f64>() / group.len() as f64).collect();
        let mean = groups.iter().flat_map(|group| group.iter()).sum::<f64>() / n;
        let within =
            |(group, mean): (&&Vec<f64>, &f64)| group.iter().map(|value| (value - mean).powi(2)).sum::<f64>();
        let chance = groups.iter().zip(&means).map(within).sum::<f64>() / (n - k).max(1.0);
        let squares = means.iter().zip(&counts).map(|(group, count)| count * (group - mean).powi(2));
        let between = squares.sum::<f64>() / (k - 1.0);
        let size = (n - counts.iter().map(|count| count * count).sum::<f64>() / n) / (k - 1.0);
        let input = ((between - chance) / size).max(0.0);
        let half = t_quantile_95(k - 1.0) * (input + between / n).sqrt();
        Some(Self {
            mean,
            input_deviation: input.sqrt(),
            chance_deviation: (n > k).then(|| chance.sqrt()),
            interval: (mean - half, mean + half),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nested_moments_match_the_analysis_of_variance() {
        // Means 2, 5 and 8; within: 2 + 2 + 2 over 3 degrees of freedom; between: 2 · (9 + 0 + 9) / 2.
        let found = Nested::of(&[vec![1.0, 3.0], vec![4.0, 6.0], vec![7.0, 9.0]]).unwrap();
        assert_eq!(found.mean, 5.0);
        assert!((found.chance_deviation.unwrap().powi(2) - 2.0).abs() < 1e-12);
        assert!((found.input_deviation.powi(2) - 8.0).abs() < 1e-12);
        // t(2) = 4.303; the square root of 8 + 18/6.
        assert!((found.interval.1 - 5.0 - 4.302_652_729_9 * 11.0_f64.sqrt()).abs() < 1e-6, "{found:?}");
        let uneven = Nested::of(&[vec![1.0], vec![], vec![2.0, 4.0, 6.0]]).unwrap();
        assert!((uneven.chance_deviation.unwrap().powi(2) - 4.0).abs() < 1e-12);
        assert!((uneven.input_deviation.powi(2) - (6.75 - 4.0) / 1.5).abs() < 1e-12, "{uneven:?}");
    }

    #[test]
    fn equal_groups_have_no_input_deviation_and_few_runs_no_moments() {
        let found = Nested::of(&[vec![1.0, 3.0], vec![3.0, 1.0]]).unwrap();
        assert_eq!(found.input_deviation, 0.0);
        assert_eq!(Nested::of(&[vec![1.0, 2.0]]), None);
        let single = Nested::of(&[vec![1.0], vec![3.0]]).unwrap();
        assert_eq!((single.chance_deviation, single.input_deviation), (None, 2.0_f64.sqrt()));
        assert_eq!(Nested::of(&[]), None);
    }
}
