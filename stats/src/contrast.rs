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
        // What is left of a perfect correlation is rounding error.
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
mod tests {
    use super::*;

    #[test]
    fn contrasts_of_drawn_parameters_keep_what_is_not_known() {
        // The difference is 1 with the first sample, 5 with the second and 9 with the third, with ±1 of chance.
        let mut table = PointTable::default();
        let seeds: Vec<u64> = (0..6).collect();
        table.push(&seeds, &[0.0; 6]);
        table.push(&seeds, &[0.0, 2.0, 4.0, 6.0, 8.0, 10.0]);
        let table = table.with_samples(2);
        let interval = table.interval(&[-1.0, 1.0], Values::Numbers).unwrap();
        // MSB = 32, σ² = 2, τ² = 15; t(2) √(15 + 32/6).
        let half = 4.302_652_729_9 * (15.0 + 32.0 / 6.0_f64).sqrt();
        assert!((interval.high - 5.0 - half).abs() < 1e-6, "{interval:?}");
        assert_eq!(table.contrast(&[-1.0, 1.0], Values::Numbers).width_ratio, None);
        let mut other = PointTable::default();
        other.push(&[0, 1], &[0.0, 1.0]);
        other.push(&[2, 3], &[0.0, 1.0]);
        assert_eq!(other.with_samples(2).interval(&[-1.0, 1.0], Values::Numbers), None);
    }
    use crate::welch;

    fn table(points: &[&[f64]]) -> PointTable {
        let mut table = PointTable::default();
        for values in points {
            let seeds: Vec<u64> = (1..=values.len() as u64).collect();
            table.push(&seeds, values);
        }
        table
    }

    fn assert_near(interval: Option<Interval>, low: f64, high: f64) {
        let found = interval.unwrap();
        assert!(
            (found.low - low).abs() < 1e-9 && (found.high - high).abs() < 1e-9,
            "{found:?}, not {low} to {high}"
        );
    }

    #[test]
    fn two_points_have_the_interval_of_the_differences_by_seed() {
        let (a, b) = ([3.0, 5.5, 4.0, 9.0], [2.0, 3.5, 3.5, 7.0]);
        let differences: Vec<f64> = a.iter().zip(b).map(|(a, b)| a - b).collect();
        let paired = Sample::of(&differences).unwrap();
        let half = paired.half_width().unwrap();
        let (seeds, values) = (table(&[&a, &b]), Values::Numbers);
        let found = seeds.contrast(&[1.0, -1.0], values);
        assert_near(found.interval, paired.mean - half, paired.mean + half);
        assert_eq!((seeds.pairing(values), found.value), (Pairing::BySeed, paired.mean));
        // The additive model has the same residuals.
        assert_near(seeds.additive_model(&[1.0, -1.0]), paired.mean - half, paired.mean + half);
        let unpaired = welch(&Sample::of(&a).unwrap(), &Sample::of(&b).unwrap()).unwrap();
        assert_near(
            seeds.unpaired(&[1.0, -1.0], values),
            paired.mean - unpaired.half_width,
            paired.mean + unpaired.half_width,
        );
        assert!((found.width_ratio.unwrap() - half / unpaired.half_width).abs() < 1e-12, "{found:?}");
    }

    #[test]
    fn additive_model_agrees_with_a_worked_example() {
        // Means 2, 4, 9; seeds add −1, 0, 1; residuals ±0.5 in two points: Σ ε² = 1 with ν = 4.
        let rows: [&[f64]; 3] = [&[1.5, 2.0, 2.5], &[2.5, 4.0, 5.5], &[8.0, 9.0, 10.0]];
        let found = table(&rows).contrast(&[-1.0, 0.0, 1.0], Values::Numbers);
        let half = t_quantile_95(4.0) * (1.0f64 / 4.0 * 2.0 / 3.0).sqrt();
        assert_near(found.interval, 7.0 - half, 7.0 + half);
        assert_eq!(table(&rows).pairing(Values::Numbers), Pairing::AdditiveModel);
    }

    #[test]
    fn other_seeds_or_a_single_one_leave_points_unpaired() {
        let mut other = PointTable::default();
        other.push(&[1, 2, 3], &[1.0, 2.0, 4.0]);
        other.push(&[1, 2, 4], &[1.5, 2.5, 4.5]);
        assert_eq!((other.pairing(Values::Numbers), other.common_seeds()), (Pairing::Unpaired, None));
        let found = other.contrast(&[1.0, -1.0], Values::Numbers);
        let expected =
            welch(&Sample::of(&[1.0, 2.0, 4.0]).unwrap(), &Sample::of(&[1.5, 2.5, 4.5]).unwrap()).unwrap();
        assert_near(found.interval, -0.5 - expected.half_width, -0.5 + expected.half_width);
        assert_eq!(found.width_ratio, None);
        let single = table(&[&[1.0], &[2.0]]);
        assert_eq!(single.pairing(Values::Numbers), Pairing::Unpaired);
        assert_eq!(
            single.contrast(&[-1.0, 1.0], Values::Numbers),
            Contrast { value: 1.0, interval: None, width_ratio: None }
        );
        // A point without a weight may have a single value.
        let three = table(&[&[1.0, 2.0, 4.0], &[1.5, 2.5, 4.5], &[7.0]]);
        assert_near(
            three.contrast(&[1.0, -1.0, 0.0], Values::Numbers).interval,
            -0.5 - expected.half_width,
            -0.5 + expected.half_width,
        );
    }

    #[test]
    fn perfect_correlation_leaves_a_point_and_constants_no_ratio() {
        let a = [0.1, 0.7, 0.4];
        let shifted = |by: f64| a.map(|value| value + by);
        let found = table(&[&a, &shifted(0.3), &shifted(1.1)]).contrast(&[-1.0, 0.0, 1.0], Values::Numbers);
        assert_near(found.interval, 1.1, 1.1);
        assert_eq!(found.width_ratio, Some(0.0));
        let constant = table(&[&[0.1; 6], &[0.7; 6]]).contrast(&[-1.0, 1.0], Values::Numbers);
        assert_near(constant.interval, 0.6, 0.6);
        assert_eq!(constant.width_ratio, None);
    }

    #[test]
    fn events_have_two_more_replicates() {
        // Of 10 seeds, 4 have the event at the first point alone and 1 at the second alone: Agresti and Min add ½ to each of the four cells.
        let first = [1.0, 1.0, 1.0, 1.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0];
        let second = [0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0];
        let found = table(&[&first, &second]).contrast(&[1.0, -1.0], Values::Events);
        let mean = 3.0 / 12.0;
        let half = t_quantile_95(11.0) * ((4.5 + 1.5 - 12.0 * mean * mean) / 11.0 / 12.0f64).sqrt();
        assert_near(found.interval, mean - half, mean + half);
        assert!((found.value - 0.3).abs() < 1e-12, "the value has no more replicates");
        // No event at all leaves an uncertainty.
        let none = table(&[&[0.0; 4], &[0.0; 4]]).contrast(&[1.0, -1.0], Values::Events);
        assert!(none.interval.unwrap().high > 0.2, "{none:?}");
        // No difference of shares is above 1.
        let all = table(&[&[1.0; 4], &[0.0; 4]]).contrast(&[1.0, -1.0], Values::Events);
        assert_eq!((all.value, all.interval.unwrap().high), (1.0, 1.0));
        // Unpaired: 2 of 3 and 0 of 2 become 3 of 5 and 1 of 4 (Agresti and Caffo).
        let unpaired = table(&[&[1.0, 1.0, 0.0], &[0.0, 0.0]]).contrast(&[1.0, -1.0], Values::Events);
        let (a, b) =
            (Sample::of(&[1.0, 1.0, 1.0, 0.0, 0.0]).unwrap(), Sample::of(&[1.0, 0.0, 0.0, 0.0]).unwrap());
        let expected = welch(&a, &b).unwrap();
        assert_near(unpaired.interval, expected.mean - expected.half_width, 1.0);
    }

    #[test]
    fn many_points_share_the_further_trials() {
        // Nine points with 4 trials each, of which the first four always have the event: the line falls by 4/3 over the range.
        let weights: Vec<f64> = (0..9).map(|point| f64::from(point - 4) * 8.0 / 60.0).collect();
        let table = |first_seed: &dyn Fn(u64) -> u64| {
            let mut table = PointTable::default();
            for point in 0..9 {
                let from = first_seed(point);
                table.push(&[from, from + 1, from + 2, from + 3], &[f64::from(u8::from(point < 4)); 4]);
            }
            table
        };
        let paired = table(&|_| 0).contrast(&weights, Values::Events);
        let unpaired = table(&|point| 4 * point).contrast(&weights, Values::Events);
        // k = 20² / 60, so each point has 0.6 more trials: 0.3 or 4.3 events of 4.6, and the means shrink by 4/4.6 towards ½.
        let (mean, squares) = (-4.0 / 3.0 * 4.0 / 4.6, 64.0 / 60.0);
        let by_seed = 4.0 * 0.6 / 4.6 * (16.0 / 9.0) + 0.6 / 4.0 * squares;
        let high = mean + t_quantile_95(3.6) * (by_seed / 3.6 / 4.6f64).sqrt();
        assert_near(paired.interval, -4.0 / 3.0, high);
        let error = (squares * 0.3 * 4.3 / (4.6 * 4.6) / 3.6f64).sqrt();
        let high = mean + t_quantile_95(3.6 * 60.0 * 60.0 / 708.0) * error;
        assert_near(unpaired.interval, -4.0 / 3.0, high);
        // Points without a weight add none.
        assert_eq!(additional_trials(&[1.0, 0.0, -1.0]), 2.0);
        assert_eq!(additional_trials(&[0.5, 0.5, -0.5, -0.5]), 1.0);
    }
}
