//! Contrasts of design points: weighted sums of their means with weights that add up to 0, and 95 % intervals that use common seeds.
//!
//! A difference of two points has the weights 1 and −1. The effect of a factor along a line, and the mean at a level minus the mean of all
//! points, are contrasts too. Points whose replicates share their seeds share random influences, which a contrast within one seed removes.
//!
//! | symbol | meaning |
//! |---|---|
//! | y_ps, c_p | value at point p with seed s, weight of the point |
//! | P, S | number of points and of seeds |
//! | by seed | e_s = Σ_p c_p y_ps for each seed; the interval is that of the mean of the e_s |
//! | additive model | y_ps = m_p + b_s + ε_ps: Σ_p c_p ȳ_p ± t(ν) σ √(Σ c_p² / S) with the residual variance σ², ν = (P − 1)(S − 1) |
//! | by sample | as by seed, where seeds in a row share parameters that were drawn from what is known of them ([`Nested`]) |
//! | unpaired | Σ_p c_p ȳ_p ± t(ν) √(Σ c_p² s_p² / n_p), ν after Welch and Satterthwaite |
//!
//! By seed is exact for normal values, whatever their variances and correlations, but t is large for few seeds. Below 5 seeds the additive
//! model pools the residuals of all points; it assumes one variance. Two points give the same interval by both.
//!
//! Shares of few replicates are often 0 or 1, which would look certain. Each point therefore gets 4/k more trials, half of them with the
//! event (Price and Bonett 2004), with k = (Σ|c_p|)² / Σ c_p², the number of points whose weights are large. For two points these are two
//! trials (Agresti and Caffo 2000). Within a seed they are independent between points (Agresti and Min 2005).

use std::collections::BTreeMap;

use crate::comparison::{ErrorTerm, unpaired_half_width};
use crate::line::ROUNDING;
use crate::nested::Nested;
use crate::sample::{Sample, t_quantile_95};
use crate::share::Interval;

/// Seeds from which on the interval comes from one contrast per seed.
const SEEDS_OF_OWN_VARIANCE: usize = 5;

/// Meaning of the values of a table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Values {
    /// Numbers.
    Numbers,
    /// 1 where an event happened, else 0.
    Events,
}

/// How an interval uses common seeds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pairing {
    /// One contrast per seed.
    BySeed,
    /// The additive model of points and seeds.
    AdditiveModel,
    /// Not at all.
    Unpaired,
}

/// A contrast with its 95 % interval.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Contrast {
    /// Its value.
    pub value: f64,
    /// Its interval; none when single values show no variance.
    pub interval: Option<Interval>,
    /// Width of this interval over that of the unpaired one; none when it is unpaired, or when nothing varies.
    pub width_ratio: Option<f64>,
}

/// Values of one quantity at design points, by seed.
#[derive(Clone, Debug, Default)]
pub struct PointTable {
    /// The values of all points, one after the other.
    values: Vec<f64>,
    /// End of each point in `values`.
    ends: Vec<usize>,
    /// The seeds of the first point.
    seeds: Vec<u64>,
    /// Whether a later point has other seeds.
    is_incomplete: bool,
    /// Seeds in a row that share drawn parameters; 0 without such.
    runs_per_sample: u64,
}

impl PointTable {
    /// Memory that a point takes in addition to its values, in bytes.
    pub const BYTES_PER_POINT: usize = size_of::<usize>();

    /// Adds a point with at least one value.
    ///
    /// # Panics
    /// When the numbers of seeds and values differ, or are 0.
    pub fn push(&mut self, seeds: &[u64], values: &[f64]) {
        assert!(
            seeds.len() == values.len() && !seeds.is_empty(),
            "as many values as seeds, and at least one"
        );
        if self.ends.is_empty() {
            self.seeds = seeds.to_vec();
        }
        self.is_incomplete |= self.seeds != seeds;
        self.values.extend(values);
        self.ends.push(self.values.len());
    }

    /// The same table, of which so many seeds in a row share parameters that were drawn; seeds are then numbers of replicates from 0 on. The
    /// intervals are those with the true parameters, whatever they are.
    pub fn with_samples(self, runs_per_sample: u32) -> Self {
        Self { runs_per_sample: u64::from(runs_per_sample), ..self }
    }

    /// The same table with other values.
    pub fn map(&self, value: impl Fn(f64) -> f64) -> Self {
        let values = self.values.iter().map(|old| value(*old)).collect();
        Self { values, ..self.clone() }
    }

    /// The values of each point.
    pub fn points(&self) -> impl ExactSizeIterator<Item = &[f64]> {
        (0..self.ends.len()).map(|point| {
            let start = if point == 0 { 0 } else { self.ends[point - 1] };
            &self.values[start..self.ends[point]]
        })
    }

    /// The mean of each point.
    pub fn means(&self) -> Vec<f64> {
        self.points().map(|values| values.iter().sum::<f64>() / values.len() as f64).collect()
    }

    /// Number of seeds, if all points have the same.
    pub fn common_seeds(&self) -> Option<usize> {
        (!self.is_incomplete && !self.ends.is_empty()).then_some(self.seeds.len())
    }

    /// Whether a point has several values. Otherwise no contrast has an interval.
    pub fn has_replicates(&self) -> bool {
        self.values.len() > self.ends.len()
    }

    /// How intervals use common seeds: at least two points need the same seeds, and at least two of them.
    pub fn pairing(&self, kind: Values) -> Pairing {
        match self.common_seeds() {
            Some(_) if self.runs_per_sample > 0 => Pairing::BySeed,
            Some(seeds) if seeds >= 2 && self.ends.len() >= 2 => {
                let is_exact = seeds >= SEEDS_OF_OWN_VARIANCE || self.ends.len() == 2;
                if is_exact || kind == Values::Events { Pairing::BySeed } else { Pairing::AdditiveModel }
            }
            _ => Pairing::Unpaired,
        }
    }

    /// The contrast with these weights, one per point, which add up to 0.
    ///
    /// # Panics
    /// When there are not as many weights as points.
    pub fn contrast(&self, weights: &[f64], kind: Values) -> Contrast {
        let interval = self.interval(weights, kind);
        let means = self.means();
        let terms = || weights.iter().zip(&means).map(|(weight, mean)| weight * mean);
        let width = |interval: Interval| interval.high - interval.low;
        let rounding = ROUNDING * terms().map(f64::abs).sum::<f64>();
        let is_paired = self.pairing(kind) != Pairing::Unpaired && self.runs_per_sample == 0;
        let width_ratio = interval.filter(|_| is_paired).and_then(|paired| {
            let unpaired = self.interval_by(Pairing::Unpaired, weights, kind).map(width)?;
            (unpaired > rounding).then(|| width(paired) / unpaired)
        });
        Contrast { value: terms().sum(), interval, width_ratio }
    }

    /// The interval of the contrast alone.
    ///
    /// # Panics
    /// When there are not as many weights as points.
    pub fn interval(&self, weights: &[f64], kind: Values) -> Option<Interval> {
        assert_eq!(weights.len(), self.ends.len(), "as many weights as points");
        self.interval_by(self.pairing(kind), weights, kind)
    }

    fn interval_by(&self, pairing: Pairing, weights: &[f64], kind: Values) -> Option<Interval> {
        let interval = match pairing {
            Pairing::BySeed if self.runs_per_sample > 0 => self.by_sample(weights)?,
            // Different samples at the points would pass for a difference of the points.
            _ if self.runs_per_sample > 0 => return None,
            Pairing::BySeed => self.by_seed(weights, kind)?,
            Pairing::AdditiveModel => self.additive_model(weights)?,
            Pairing::Unpaired => self.unpaired(weights, kind)?,
        };
        // No shares have a contrast beyond the sum of its positive or of its negative weights.
        let bound = |sign: f64| weights.iter().map(|weight| (sign * weight).max(0.0)).sum::<f64>() * sign;
        Some(match kind {
            Values::Numbers => interval,
            Values::Events => {
                Interval { low: interval.low.max(bound(-1.0)), high: interval.high.min(bound(1.0)) }
            }
        })
    }

    fn unpaired(&self, weights: &[f64], kind: Values) -> Option<Interval> {
        let more = match kind {
            Values::Numbers => 0.0,
            Values::Events => additional_trials(weights),
        };
        let mut value = 0.0;
        let terms = weights.iter().zip(self.points()).map(|(weight, values)| {
            let trials = values.len() as f64 + more;
            let mean = (values.iter().sum::<f64>() + more / 2.0) / trials;
            value += weight * mean;
            // Half of the further trials have the value 1, half 0.
            let of = |shift: f64| (shift - mean).powi(2);
            let squares =
                values.iter().map(|value| of(*value)).sum::<f64>() + more / 2.0 * (of(0.0) + of(1.0));
            let degrees_of_freedom = trials - 1.0;
            let squared_error = (trials > 1.0).then(|| squares / degrees_of_freedom / trials);
            ErrorTerm { weight: *weight, squared_error, degrees_of_freedom }
        });
        let half_width = unpaired_half_width(terms)?;
        around(value, half_width)
    }

    /// The contrast within each seed.
    fn contrasts(&self, weights: &[f64]) -> Vec<f64> {
        let mut contrasts = vec![0.0; self.seeds.len()];
        for (weight, values) in weights.iter().zip(self.points()) {
            contrasts.iter_mut().zip(values).for_each(|(contrast, value)| *contrast += weight * value);
        }
        contrasts
    }

    /// None where no seed differs from another: equal events would look certain.
    fn by_sample(&self, weights: &[f64]) -> Option<Interval> {
        let mut groups: BTreeMap<u64, Vec<f64>> = BTreeMap::new();
        for (seed, contrast) in self.seeds.iter().zip(self.contrasts(weights)) {
            groups.entry(seed / self.runs_per_sample).or_default().push(contrast);
        }
        let (low, high) = Nested::of(&groups.into_values().collect::<Vec<_>>())?.interval;
        (low < high).then_some(Interval { low, high })
    }

    fn by_seed(&self, weights: &[f64], kind: Values) -> Option<Interval> {
        let contrasts = self.contrasts(weights);
        let seeds = contrasts.len() as f64;
        let sample = Sample::of(&contrasts)?;
        let squares = sample.deviation?.powi(2) * (seeds - 1.0);
        let more = match kind {
            Values::Numbers => return around(sample.mean, sample.half_width()?),
            Values::Events => additional_trials(weights),
        };
        // In further seeds every point has the event in one half of the cases, independently of the others: these contrasts have the
        // mean 0 and the mean square Σ c_p² / 4.
        let n = seeds + more;
        let mean = sample.mean * seeds / n;
        let squares = squares
            + seeds * more / n * sample.mean.powi(2)
            + more / 4.0 * weights.iter().map(|weight| weight * weight).sum::<f64>();
        around(mean, t_quantile_95(n - 1.0) * (squares / (n - 1.0) / n).sqrt())
    }

    fn additive_model(&self, weights: &[f64]) -> Option<Interval> {
        let (points, seeds) = (self.ends.len() as f64, self.seeds.len() as f64);
        let mut by_seed = vec![0.0; self.seeds.len()];
        let (mut value, mut squares) = (0.0, 0.0);
        for (weight, values) in weights.iter().zip(self.points()) {
            let mean = values.iter().sum::<f64>() / seeds;
            value += weight * mean;
            for (sum, deviation) in by_seed.iter_mut().zip(values.iter().map(|value| value - mean)) {
                *sum += deviation;
                squares += deviation * deviation;
            }
        }
        let residual = squares - by_seed.iter().map(|sum| sum * sum).sum::<f64>() / points;
        // The residual of a perfect correlation is rounding error.
        let residual = if residual > ROUNDING * squares { residual } else { 0.0 };
        let degrees_of_freedom = (points - 1.0) * (seeds - 1.0);
        let weight = weights.iter().map(|weight| weight * weight).sum::<f64>();
        let error = (residual / degrees_of_freedom * weight / seeds).sqrt();
        around(value, t_quantile_95(degrees_of_freedom) * error)
    }
}

fn around(centre: f64, half_width: f64) -> Option<Interval> {
    Some(Interval { low: centre - half_width, high: centre + half_width })
}

/// 4/k, the number of further trials at each point, of which half have the event. k = (Σ|c|)² / Σ c² is the number of points where all
/// weights have the same size. A point that is compared with the mean of many others has most of the weight, so its k is near 4.
fn additional_trials(weights: &[f64]) -> f64 {
    let sum = weights.iter().map(|weight| weight.abs()).sum::<f64>();
    if sum > 0.0 {
        4.0 * weights.iter().map(|weight| weight * weight).sum::<f64>() / sum.powi(2)
    } else {
        0.0
    }
}

#[cfg(test)]
#[path = "tests/contrast.rs"]
mod tests;
