//! Sensitivity: the effect of each factor on each response, with its interval and p-value. A design point counts once, with the mean of
//! its replicates: replicates share their seeds with those of all other points, and are not independent. Intervals make use of that.
//!
//! The values of all responses of a million trials do not fit into the memory of a server, so effects come in several passes over them.

use roost_api::design::{Factor, Scale};
use roost_api::table::{FactorEffect, LevelEffect, PairingGain, ResponseEffects, TrialRow};
use roost_stats::{ROUNDING, line, rank_correlation, rank_correlation_p_value};
use serde_json::Value;

use super::levels::position;
use super::replicates::{ReplicateTables, ResponseTable, ends, gain};

/// Factors with more levels have no means by level.
const MAX_LEVELS: usize = 12;

/// Memory of the values of responses in one pass over the trials, in bytes.
pub(crate) const MAX_EFFECTS_BYTES: usize = 48 << 20;

/// The data of each design point that effects need. Points of a large sweep are added in batches, and in several passes: one holds the
/// responses that fit into the memory.
pub(crate) struct Effects {
    factors: Vec<Factor>,
    /// The levels of every factor.
    levels: Vec<Levels>,
    replicates: ReplicateTables,
    found: Vec<ResponseEffects>,
}

/// The levels of a factor, by design point.
#[derive(Default)]
struct Levels {
    /// NaN for a level that is no number.
    numbers: Vec<f64>,
    /// The different levels; past [`MAX_LEVELS`] this is one more, and `groups` is empty.
    different: Vec<Value>,
    /// Index in `different`.
    groups: Vec<u8>,
}

impl Levels {
    fn push(&mut self, level: &Value) {
        self.numbers.push(level.as_f64().unwrap_or(f64::NAN));
        if self.different.len() > MAX_LEVELS {
            return;
        }
        let known = position(level, &self.different);
        let group = known.unwrap_or_else(|| {
            self.different.push(level.clone());
            self.different.len() - 1
        });
        self.groups.push(group as u8);
        if self.different.len() > MAX_LEVELS {
            self.groups = Vec::new();
        }
    }
}

impl Effects {
    /// Without points. The values of one pass take at most `max_bytes`, or those of one response.
    pub(crate) fn of(factors: Vec<Factor>, max_bytes: usize, runs_per_sample: Option<u32>) -> Self {
        let levels = factors.iter().map(|_| Levels::default()).collect();
        let replicates = ReplicateTables::new(max_bytes, runs_per_sample);
        Self { factors, levels, replicates, found: Vec::new() }
    }

    /// Adds points with their trials, which are sorted by point and replicate.
    pub(crate) fn add(&mut self, trials: &[TrialRow]) {
        for trials in trials.chunk_by(|one, other| one.point == other.point) {
            for (factor, levels) in self.factors.iter().zip(&mut self.levels) {
                levels.push(trials[0].factors.get(factor.name()).unwrap_or(&Value::Null));
            }
        }
        self.replicates.add(trials);
    }

    /// Evaluates the responses of this pass. If it returns false, all points must be added once more.
    pub(crate) fn finish_pass(&mut self) -> bool {
        let replicates = std::mem::replace(&mut self.replicates, ReplicateTables::new(0, None));
        let (responses, next) = replicates.finish_pass();
        let found: Vec<_> = responses.map(|response| self.response(response)).collect();
        self.found.extend(found);
        let is_complete = next.is_none();
        if let Some(next) = next {
            self.replicates = next;
            self.levels.fill_with(Levels::default);
        }
        is_complete
    }

    /// Main effects and rank correlations of every response that varies by word or number, and what pairing did to their intervals.
    pub(crate) fn responses(self) -> (Vec<ResponseEffects>, PairingGain) {
        let mut effects = self.found;
        effects.sort_by(|one, other| one.response.cmp(&other.response));
        let ratios = effects.iter().flat_map(|of| &of.factors).filter_map(|factor| factor.width_ratio);
        let gain = gain(ratios.collect());
        (effects, gain)
    }

    fn response(&self, response: ResponseTable) -> ResponseEffects {
        let means = response.table.means();
        let mean = means.iter().sum::<f64>() / means.len() as f64;
        let factors = self.factors.iter().enumerate();
        ResponseEffects {
            points: means.len() as u64,
            mean,
            pairing: response.pairing(),
            seeds: response.table.common_seeds().map(|seeds| seeds as u64),
            factors: factors.map(|(index, factor)| self.effect(index, factor, &response, &means)).collect(),
            response: response.name,
        }
    }

    fn effect(&self, index: usize, factor: &Factor, response: &ResponseTable, means: &[f64]) -> FactorEffect {
        let levels = &self.levels[index];
        let is_log = factor.scale == Some(Scale::Log);
        let number = |row: &u32| {
            let number = levels.numbers[*row as usize];
            (!number.is_nan()).then(|| if is_log { number.ln() } else { number })
        };
        let numbers: Vec<f64> = response.points.iter().map(number).collect::<Option<_>>().unwrap_or_default();
        let pairs: Vec<(f64, f64)> = numbers.iter().copied().zip(means.iter().copied()).collect();
        let rank_correlation = rank_correlation(&pairs);
        let range = numbers.iter().fold((f64::MAX, f64::MIN), |(low, high), x| (low.min(*x), high.max(*x)));
        let effect = line(&pairs).map(|line| line.slope * (range.1 - range.0));
        let contrast = effect.and_then(|_| response.contrast(|| slope_weights(&numbers, range.1 - range.0)));
        let (low_95, high_95) = ends(contrast.and_then(|contrast| contrast.interval));
        FactorEffect {
            factor: factor.name().to_owned(),
            effect,
            low_95,
            high_95,
            width_ratio: contrast.and_then(|contrast| contrast.width_ratio),
            rank_correlation,
            p_value: rank_correlation
                .and_then(|correlation| rank_correlation_p_value(correlation, pairs.len())),
            levels: by_level(levels, response, means),
        }
    }
}

/// The weights with which the slope of the straight line, times `range`, is a sum over points.
fn slope_weights(xs: &[f64], range: f64) -> Vec<f64> {
    let mean = xs.iter().sum::<f64>() / xs.len() as f64;
    let squares = xs.iter().map(|x| (x - mean).powi(2)).sum::<f64>();
    xs.iter().map(|x| (x - mean) * range / squares).collect()
}

/// The mean at each level, sorted if the levels are numbers. Empty for more than [`MAX_LEVELS`] levels.
fn by_level(levels: &Levels, response: &ResponseTable, means: &[f64]) -> Vec<LevelEffect> {
    if levels.groups.is_empty() {
        return Vec::new();
    }
    let mut groups: Vec<(&Value, Vec<usize>)> =
        levels.different.iter().map(|level| (level, Vec::new())).collect();
    for (point, row) in response.points.iter().enumerate() {
        groups[usize::from(levels.groups[*row as usize])].1.push(point);
    }
    groups.retain(|(_, points)| !points.is_empty());
    groups.sort_by(|(one, _), (other, _)| match (one.as_f64(), other.as_f64()) {
        (Some(one), Some(other)) => one.total_cmp(&other),
        _ => std::cmp::Ordering::Equal,
    });
    let points = means.len() as f64;
    let mean = means.iter().sum::<f64>() / points;
    let has_others = groups.len() > 1;
    let level = |(level, group): (&Value, Vec<usize>)| {
        let here = group.iter().map(|point| means[*point]).sum::<f64>() / group.len() as f64;
        let effect = if (here - mean).abs() > ROUNDING * mean.abs() { here - mean } else { 0.0 };
        let weights = || {
            let mut weights = vec![-1.0 / points; means.len()];
            group.iter().for_each(|point| weights[*point] += 1.0 / group.len() as f64);
            weights
        };
        let (low_95, high_95) = ends(has_others.then(|| response.interval(weights)).flatten());
        LevelEffect { level: level.clone(), points: group.len() as u64, mean: here, effect, low_95, high_95 }
    };
    groups.into_iter().map(level).collect()
}
