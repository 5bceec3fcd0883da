//! Sensitivity: the effect of each factor on each response, with its interval and p-value. A design point counts once, with the mean of
//! its replicates: replicates share their seeds with those of all other points, and are not independent. Intervals make use of that.

use roost_api::design::{Factor, Scale};
use roost_api::table::{FactorEffect, LevelEffect, PairingGain, ResponseEffects, TrialRow};
use roost_stats::{ROUNDING, line, rank_correlation, rank_correlation_p_value};
use serde_json::Value;

use super::levels::same;
use super::replicates::{Replicates, Response, ends, gain};

/// Factors with more levels have no means by level.
const MAX_LEVELS: usize = 12;

/// The data of each design point that effects need. Points of a large sweep are added in batches.
pub(crate) struct Effects {
    factors: Vec<Factor>,
    /// The level of every factor, a row per point.
    levels: Vec<Vec<Value>>,
    replicates: Replicates,
}

impl Effects {
    /// Without points.
    pub(crate) fn of(factors: Vec<Factor>) -> Self {
        Self { factors, levels: Vec::new(), replicates: Replicates::default() }
    }

    /// Adds points with their trials, which are sorted by point and replicate.
    pub(crate) fn add(&mut self, trials: &[TrialRow]) {
        for trials in trials.chunk_by(|one, other| one.point == other.point) {
            let level = |factor: &Factor| trials[0].factors.get(factor.name()).cloned().unwrap_or_default();
            self.levels.push(self.factors.iter().map(level).collect());
        }
        self.replicates.add(trials);
    }

    /// Main effects and rank correlations of every response that varies by word or number, and what pairing did to their intervals.
    pub(crate) fn responses(mut self) -> (Vec<ResponseEffects>, PairingGain) {
        let responses = std::mem::take(&mut self.replicates).responses();
        let mut effects: Vec<_> = responses.map(|response| self.response(response)).collect();
        effects.sort_by(|one, other| one.response.cmp(&other.response));
        let ratios = effects.iter().flat_map(|of| &of.factors).filter_map(|factor| factor.width_ratio);
        let gain = gain(ratios.collect());
        (effects, gain)
    }

    fn response(&self, response: Response) -> ResponseEffects {
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

    fn effect(&self, index: usize, factor: &Factor, response: &Response, means: &[f64]) -> FactorEffect {
        let level = |row: &u32| &self.levels[*row as usize][index];
        let levels: Vec<&Value> = response.points.iter().map(level).collect();
        let is_log = factor.scale == Some(Scale::Log);
        let number = |level: &&Value| level.as_f64().map(|number| if is_log { number.ln() } else { number });
        let numbers: Vec<f64> = levels.iter().map(number).collect::<Option<_>>().unwrap_or_default();
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
            levels: by_level(&levels, response, means),
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
fn by_level(levels: &[&Value], response: &Response, means: &[f64]) -> Vec<LevelEffect> {
    let mut groups: Vec<(&Value, Vec<usize>)> = Vec::new();
    for (point, level) in levels.iter().enumerate() {
        match groups.iter().position(|(other, _)| same(other, level)) {
            Some(group) => groups[group].1.push(point),
            None if groups.len() == MAX_LEVELS => return Vec::new(),
            None => groups.push((level, vec![point])),
        }
    }
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
        let contrast = has_others.then(|| response.contrast(weights)).flatten();
        let (low_95, high_95) = ends(contrast.and_then(|contrast| contrast.interval));
        LevelEffect { level: level.clone(), points: group.len() as u64, mean: here, effect, low_95, high_95 }
    };
    groups.into_iter().map(level).collect()
}
