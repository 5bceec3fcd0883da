//! The ratio of measured wall time to the estimate of the check, from finished runs.
//!
//! | symbol | meaning |
//! |---|---|
//! | k, rᵢ | number of finished runs, their ratios |
//! | s | spread of ln r: the range from the 10 % to the 90 % quantile over 2.563, which is σ of a normal distribution |
//! | t | a value of Student's distribution with 2k/3 degrees of freedom |
//!
//! A ratio in a simulated future is a random rᵢ, times exp(t √((exp s² − 1)/k)): all runs share this factor, since the level itself is
//! known from k runs only. The root is the relative error of the mean of lognormal values. Quantiles keep one broken run from deciding the spread. With fewer than [`FEW`] runs the spread is at least that of the
//! bare estimate.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::Rng;

/// Number of runs from which on their own spread counts.
pub(super) const FEW: usize = 5;
/// Spread of ln r where nothing is known: the estimate is within a factor of 2.5 in 80 % of the cases.
const PRIOR_SPREAD: f64 = 0.7;
/// Ratio where nothing is known. The check's estimate is for two cores, and a run has one while others wait.
const PRIOR_RATIO: f64 = 2.0;
/// Range between the 10 % and the 90 % quantile of a normal distribution, in σ.
const DECILES: f64 = 2.563;

/// Ratios of measured time to estimated time.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Speed {
    /// Sorted.
    ratios: Vec<f64>,
    spread: f64,
    /// Whether they are measured.
    is_learned: bool,
}

impl Speed {
    /// From pairs of measured and estimated seconds. Without any, a wide guess.
    pub(crate) fn learned(runs: impl IntoIterator<Item = (f64, f64)>) -> Self {
        let ratios = runs.into_iter().map(|(took_s, estimated_s)| took_s / estimated_s);
        let mut ratios: Vec<f64> = ratios.filter(|ratio| ratio.is_finite() && *ratio > 0.0).collect();
        ratios.sort_by(f64::total_cmp);
        let is_learned = !ratios.is_empty();
        if !is_learned {
            ratios.push(PRIOR_RATIO);
        }
        let range = (quantile(&ratios, 0.9) / quantile(&ratios, 0.1)).ln();
        // The quantiles of few values lie too close together: by a factor of 0.70 with 5 values, 0.90 with 20.
        let measured = range / DECILES * (1.0 + 2.1 / ratios.len() as f64);
        let spread = if ratios.len() < FEW { measured.max(PRIOR_SPREAD) } else { measured };
        Self { ratios, spread, is_learned }
    }

    /// Number of finished runs.
    pub(crate) fn runs(&self) -> usize {
        if self.is_learned { self.ratios.len() } else { 0 }
    }

    /// The median ratio.
    pub(crate) fn median(&self) -> f64 {
        quantile(&self.ratios, 0.5)
    }

    /// The range of the ratio of one run: it holds the true one in 80 % of the cases.
    pub(crate) fn range(&self) -> (f64, f64) {
        if self.runs() < FEW {
            let factor = (0.5 * DECILES * self.spread).exp();
            return (self.median() / factor, self.median() * factor);
        }
        (quantile(&self.ratios, 0.1), quantile(&self.ratios, 0.9))
    }

    /// The common factor of one future.
    pub(super) fn level(&self, random: &mut Random) -> f64 {
        let known = self.runs().max(1);
        // Of the mean of lognormal values. The spread comes from quantiles, which need more values than a standard deviation.
        let deviation = ((self.spread.powi(2).exp() - 1.0) / known as f64).sqrt();
        let freedom = (2 * known / 3).max(FEW - 1);
        (random.student(freedom) * deviation).exp()
    }

    /// A ratio, without the common factor.
    pub(super) fn draw(&self, random: &mut Random) -> f64 {
        let ratio = self.ratios[random.below(self.ratios.len())];
        // Few values leave gaps, which a part of the spread fills.
        if self.runs() < FEW { ratio * (0.5 * self.spread * random.normal()).exp() } else { ratio }
    }

    /// Mean and standard deviation of the ratios, without the common factor.
    pub(super) fn moments(&self) -> (f64, f64) {
        let n = self.ratios.len() as f64;
        let mean = self.ratios.iter().sum::<f64>() / n;
        let variance = self.ratios.iter().map(|ratio| (ratio - mean).powi(2)).sum::<f64>() / n;
        (mean, variance.sqrt())
    }
}

/// A quantile of sorted values, which are not empty.
pub(super) fn quantile(sorted: &[f64], share: f64) -> f64 {
    let place = share * (sorted.len() - 1) as f64;
    let (below, rest) = (place.floor() as usize, place.fract());
    let above = (below + 1).min(sorted.len() - 1);
    sorted[below] + rest * (sorted[above] - sorted[below])
}

/// Random numbers of one forecast: the same facts give the same forecast.
pub(super) struct Random(pub(super) ChaCha8Rng);

impl Random {
    /// From 0 to 1, without 0.
    pub(super) fn unit(&mut self) -> f64 {
        ((self.0.next_u64() >> 11) as f64 + 0.5) / (1_u64 << 53) as f64
    }

    pub(super) fn below(&mut self, count: usize) -> usize {
        ((self.unit() * count as f64) as usize).min(count - 1)
    }

    /// A standard normal value (Box and Muller 1958).
    pub(super) fn normal(&mut self) -> f64 {
        let radius = (-2.0 * self.unit().ln()).sqrt();
        radius * (std::f64::consts::TAU * self.unit()).cos()
    }

    /// A value of Student's distribution.
    pub(super) fn student(&mut self, freedom: usize) -> f64 {
        let normal = self.normal();
        if freedom > 30 {
            return normal;
        }
        let square: f64 = (0..freedom).map(|_| self.normal().powi(2)).sum();
        normal / (square / freedom as f64).sqrt()
    }
}
