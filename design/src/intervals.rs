//! Intervals of probabilities and means at a point.
//!
//! | symbol | meaning |
//! |---|---|
//! | n, s | number of runs, number of them with response 1 |
//! | B | the beta function |
//! | a, b | parameters of the mixture over p, both ½ |
//! | d, t | standard deviation of n values, √n (mean − μ) / d for a mean μ |
//! | c², k | precision of the mixture over μ/σ, here 1; k = c² / (n + c²) |
//! | α | 1 − confidence |
//!
//! A study looks at a point after every run, and stops when it likes the interval. An interval for a fixed n would then miss
//! the truth too often. The confidence sequence keeps every p with B(a + s, b + n − s) / (B(a, b) pˢ (1 − p)ⁿ⁻ˢ) < 1/α.
//! The ratio is a martingale under the true p (Robbins 1970), so that with probability 1 − α no interval of the whole
//! sequence misses it (Ville's inequality).
//!
//! For means the confidence sequence keeps every μ with √k ((1 + t²/(n − 1)) / (1 + k t²/(n − 1)))^(n/2) < 1/α, the Bayes factor of
//! a t test (Rouder et al. 2009). It is such a martingale for normal values of unknown σ (Lai 1976; Wang and Ramdas 2024). Equal values say
//! nothing of σ: they have no interval.
//!
//! A few small values of a skewed response have a small mean and a small deviation at once, and a study that stops by width prefers them. An
//! end at the distance t is therefore moved out to −h(−t, γ), where that is farther (Hall 1992, Journal of the Royal Statistical
//! Society B 54, 221); h(y, γ) = 3/a·((1 + a(y − a/6))^⅓ − 1) with a = γ/√n is y without skewness. The skewness γ is taken half of its
//! standard error, √(6/n), to the worse side. docs/accuracy.md has the coverage.

use roost_stats::Sample;
use serde::{Deserialize, Serialize};
use statrs::function::beta::ln_beta;

use crate::measure::Measure;

/// Minimum number of values for the interval of a mean.
pub const MIN_MEAN_RUNS: usize = 5;
/// Confidence of intervals.
pub const CONFIDENCE: f64 = 0.95;
/// Both parameters of the mixture: the interval is then narrow for small and large probabilities too.
const MIXTURE: f64 = 0.5;
/// Precision of the normal mixture over μ/σ: the interval is the narrowest, for its number of values, between 20 and 200 values.
const PRECISION: f64 = 1.0;
/// Standard errors of the skewness by which it is taken to the worse side.
const DOUBT: f64 = 0.5;
/// Number of halvings of an interval that holds an end: to the last bit of a number from 0 to 1.
const HALVINGS: usize = 60;

/// An estimate with its 95 % interval, in the unit of the response.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Estimated {
    /// Number of values.
    pub n: usize,
    /// Share or mean of the values.
    pub value: f64,
    /// Lower end of the interval; none with too few values, or equal values of a mean.
    pub low: Option<f64>,
    /// Upper end of the interval; none with too few values, or equal values of a mean.
    pub high: Option<f64>,
}

impl Estimated {
    /// The estimate of a measure from values of its response that it accepts; none without values.
    pub fn of(measure: &Measure, values: &[f64]) -> Option<Self> {
        let sample = Sample::of(values)?;
        let ends = match measure {
            Measure::Probability(_) => {
                let count = values.iter().sum::<f64>();
                Some(confidence_sequence(count, values.len() as f64, CONFIDENCE))
            }
            // The mean of equal values is rounded: their deviation may seem to be positive.
            Measure::Mean(_) if are_equal(values) => None,
            Measure::Mean(_) => mean_distances(&sample, skewness(values, sample.mean))
                .map(|(below, above)| (sample.mean - below, sample.mean + above)),
        };
        Some(Self {
            n: sample.n,
            value: sample.mean,
            low: ends.map(|ends| ends.0),
            high: ends.map(|ends| ends.1),
        })
    }

    /// Width of the interval; none with too few values.
    pub fn width(&self) -> Option<f64> {
        Some(self.high? - self.low?)
    }
}

/// Whether all values are the same.
pub(crate) fn are_equal(values: &[f64]) -> bool {
    values.windows(2).all(|pair| pair[0] == pair[1])
}

/// Half the width of the interval of a mean, as one of a sequence that is looked at after every run. None with fewer than
/// [`MIN_MEAN_RUNS`] values, or with equal values.
pub fn mean_half_width(sample: &Sample) -> Option<f64> {
    let deviation = sample.deviation.filter(|deviation| sample.n >= MIN_MEAN_RUNS && *deviation > 0.0)?;
    let n = sample.n as f64;
    let share = PRECISION / (n + PRECISION);
    let alpha = 1.0 - CONFIDENCE;
    // The condition, solved for t²/(n − 1).
    let ratio = (share.sqrt() * alpha).powf(-2.0 / n);
    let square = (ratio - 1.0) / (1.0 - share * ratio);
    Some(deviation * (square * (n - 1.0) / n).sqrt())
}

/// Distances of the lower and upper end of the interval of a mean from it, for values with a skewness. None where there is no interval.
fn mean_distances(sample: &Sample, skewness: f64) -> Option<(f64, f64)> {
    let half = mean_half_width(sample)?;
    let root = (sample.n as f64).sqrt();
    let unit = sample.deviation? / root;
    let doubt = DOUBT * 6.0_f64.sqrt() / root;
    let distance =
        |skewness: f64| half.max(-unit * without_skewness(-half / unit, (skewness + doubt) / root));
    Some((distance(-skewness), distance(skewness)))
}

/// Skewness of values, corrected for their number; 0 of fewer than three values, or of equal ones.
pub(crate) fn skewness(values: &[f64], mean: f64) -> f64 {
    let n = values.len() as f64;
    if values.len() < 3 || are_equal(values) {
        return 0.0;
    }
    let moment = |power| values.iter().map(|value| (value - mean).powi(power)).sum::<f64>() / n;
    moment(3) / moment(2).powf(1.5) * (n * (n - 1.0)).sqrt() / (n - 2.0)
}

/// h(y, γ), with a in place of γ.
pub(crate) fn without_skewness(y: f64, a: f64) -> f64 {
    if a.abs() < 1e-6 { y } else { 3.0 / a * ((1.0 + a * (y - a / 6.0)).cbrt() - 1.0) }
}

/// The interval of a probability after `n` runs, `count` of them with response 1, as one of a sequence that is looked at after
/// every run. Counts need not be whole, for forecasts.
pub fn confidence_sequence(count: f64, n: f64, confidence: f64) -> (f64, f64) {
    let share = if n > 0.0 { count / n } else { 0.5 };
    let least =
        ln_beta(MIXTURE + count, MIXTURE + n - count) - ln_beta(MIXTURE, MIXTURE) + (1.0 - confidence).ln();
    let is_kept = |p: f64| times_ln(count, p) + times_ln(n - count, 1.0 - p) > least;
    let end = |mut kept: f64, mut limit: f64| {
        if is_kept(limit) {
            return limit;
        }
        for _ in 0..HALVINGS {
            let middle = 0.5 * (kept + limit);
            *(if is_kept(middle) { &mut kept } else { &mut limit }) = middle;
        }
        limit
    };
    (end(share, 0.0), end(share, 1.0))
}

/// n ln p, which is 0 for n = 0 even at p = 0.
fn times_ln(n: f64, p: f64) -> f64 {
    if n == 0.0 { 0.0 } else { n * p.ln() }
}

/// The number of values after which the interval should be as narrow as `width`, if later values are like those so far.
pub fn values_needed(measure: &Measure, values: &[f64], width: f64, most: usize) -> usize {
    let Some(sample) = Sample::of(values) else { return MIN_MEAN_RUNS };
    let is_mean = matches!(measure, Measure::Mean(_));
    if is_mean && are_equal(values) {
        // Nothing is known of the spread.
        return (2 * sample.n).max(MIN_MEAN_RUNS).min(most).max(sample.n);
    }
    let skewness = skewness(values, sample.mean);
    let is_narrow = |n: usize| match measure {
        Measure::Probability(_) => {
            let count = values.iter().sum::<f64>();
            // Half a run more on both sides: a share of 0 or 1 is no certainty.
            let share = (count + 0.5) / (sample.n as f64 + 1.0);
            let later = count + share * (n - sample.n) as f64;
            let (low, high) = confidence_sequence(later, n as f64, CONFIDENCE);
            high - low <= width
        }
        Measure::Mean(_) => mean_distances(&Sample { n, ..sample }, skewness)
            .is_some_and(|(below, above)| below + above <= width),
    };
    let (mut below, mut enough) = (sample.n, sample.n);
    let mut step = 1;
    while !is_narrow(enough) {
        if enough >= most {
            return most.max(sample.n);
        }
        below = enough;
        enough = (sample.n + step).min(most);
        step *= 2;
    }
    while enough > below + 1 {
        let middle = below.midpoint(enough);
        *(if is_narrow(middle) { &mut enough } else { &mut below }) = middle;
    }
    enough
}

#[cfg(test)]
#[path = "tests/intervals.rs"]
mod tests;
