//! Shares of trials, with Wilson's 95 % interval.

use statrs::distribution::{ContinuousCDF, Normal};

/// A 95 % interval.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interval {
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

/// Wilson's 95 % interval of a share, from `count` of `n` trials; none without trials.
/// For few trials it is wide, even around 0 and 1. On average over all shares it covers at least 95 %. Close to 0 and 1 the coverage of
/// single shares falls to 83 %, where an exact one-sided bound such as 1 − 0.05^(1/n) is better.
pub fn share_interval(count: u64, n: u64) -> Option<Interval> {
    let z = Normal::standard().inverse_cdf(0.975);
    let share = (n > 0).then(|| count as f64 / n as f64)?;
    let z2_n = z * z / n as f64;
    let centre = (share + z2_n / 2.0) / (1.0 + z2_n);
    let half_width = (share * (1.0 - share) * z2_n + z2_n * z2_n / 4.0).sqrt() / (1.0 + z2_n);
    // Rounding errors would move the ends at 0 and 1.
    let low = if count == 0 { 0.0 } else { centre - half_width };
    let high = if count == n { 1.0 } else { centre + half_width };
    Some(Interval { low, high })
}

#[cfg(test)]
mod tests {
    use statrs::distribution::{Binomial, Discrete};

    use super::*;

    #[test]
    fn share_intervals_match_scipy() {
        // scipy.stats.binomtest(count, n).proportion_ci(method="wilson"), SciPy 1.17.1. The tests of the Python package read them as well.
        let rows = include_str!("shares.csv").lines().skip(1);
        assert_eq!(rows.clone().count(), 5);
        for row in rows {
            let [count, n, low, high] =
                row.split(',').map(|cell| cell.parse::<f64>().unwrap()).collect::<Vec<_>>()[..]
            else {
                panic!("{row} has four numbers");
            };
            let interval = share_interval(count as u64, n as u64).unwrap();
            assert!(
                (interval.low - low).abs() < 1e-9 && (interval.high - high).abs() < 1e-9,
                "{row}: {interval:?}"
            );
        }
        assert_eq!(share_interval(0, 0), None);
    }

    /// Share of the cases in which the interval of `n` trials contains the true share: the sum over the binomial distribution.
    fn coverage(share: f64, n: u64) -> f64 {
        let trials = Binomial::new(share, n).unwrap();
        let contains = |count: &u64| {
            let interval = share_interval(*count, n).unwrap();
            (interval.low..=interval.high).contains(&share)
        };
        (0..=n).filter(contains).map(|count| trials.pmf(count)).sum()
    }

    #[test]
    fn share_intervals_cover_95_percent_on_average() {
        let shares: Vec<f64> = (0..500).map(|k| (f64::from(k) + 0.5) / 500.0).collect();
        for n in [4, 10, 20, 59, 200] {
            let coverages: Vec<f64> = shares.iter().map(|share| coverage(*share, n)).collect();
            let mean = coverages.iter().sum::<f64>() / coverages.len() as f64;
            let minimum = coverages.iter().copied().reduce(f64::min).unwrap();
            assert!(mean >= 0.95 && minimum > 0.82, "{n} trials: mean {mean}, minimum {minimum}");
        }
    }
}
