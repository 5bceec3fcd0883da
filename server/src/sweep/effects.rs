//! Sensitivity: the effect of each factor on each response, with its p-value. A design point counts once, with the mean of its
//! replicates: replicates share their seeds with those of all other points, and are not independent.

use std::collections::BTreeMap;

use roost_api::design::{Factor, Scale};
use roost_api::table::{FactorEffect, LevelEffect, PointRow, ResponseEffects, Summary};
use roost_stats::{ROUNDING, line, rank_correlation, rank_correlation_p_value};
use serde_json::Value;

use super::levels::same;

/// Factors with more levels have no means by level.
const MAX_LEVELS: usize = 12;

/// The data of each design point that effects need. Points of a large sweep are added in batches.
pub(crate) struct Effects {
    factors: Vec<Factor>,
    /// The level of every factor, a row per point.
    levels: Vec<Vec<Value>>,
    /// Means of numeric responses.
    means: BTreeMap<String, Values>,
    /// Number of words at each point, for responses that are words.
    counts: BTreeMap<String, Values>,
    /// Number of times that one word occurs, at the points where it occurs.
    words: BTreeMap<(String, String), Values>,
}

/// Values with the rows of their points, in order.
type Values = Vec<(u32, f64)>;

impl Effects {
    /// Without points.
    pub(crate) fn of(factors: Vec<Factor>) -> Self {
        let (means, counts, words) = Default::default();
        Self { factors, levels: Vec::new(), means, counts, words }
    }

    /// Adds points.
    pub(crate) fn add(&mut self, points: Vec<PointRow>) {
        for PointRow { factors, responses, .. } in points {
            let row = self.levels.len() as u32;
            let level = |factor: &Factor| factors.get(factor.name()).cloned().unwrap_or_default();
            self.levels.push(self.factors.iter().map(level).collect());
            for (name, Summary { mean, words, .. }) in responses {
                if let Some(words) = words {
                    let all = words.values().sum::<u64>() as f64;
                    for (word, count) in words {
                        self.words.entry((name.clone(), word)).or_default().push((row, count as f64));
                    }
                    self.counts.entry(name.clone()).or_default().push((row, all));
                }
                if let Some(mean) = mean {
                    self.means.entry(name).or_default().push((row, mean));
                }
            }
        }
    }

    /// Main effects and rank correlations of every response that varies by word or number.
    pub(crate) fn responses(mut self) -> Vec<ResponseEffects> {
        let mut values = std::mem::take(&mut self.means);
        for ((name, word), count) in std::mem::take(&mut self.words) {
            let mut count = count.into_iter().peekable();
            // A point without this word has a share of 0.
            let share = |(row, all): &(u32, f64)| {
                let here = count.next_if(|(counted, _)| counted == row).map_or(0.0, |(_, count)| count);
                (*row, here / all)
            };
            let shares = self.counts[&name].iter().map(share).collect();
            values.insert(format!("{name}={word}"), shares);
        }
        values.into_iter().map(|(name, values)| self.response(name, &values)).collect()
    }

    fn response(&self, name: String, values: &Values) -> ResponseEffects {
        let mean = values.iter().map(|(_, value)| value).sum::<f64>() / values.len() as f64;
        let factors = self.factors.iter().enumerate();
        let factors = factors.map(|(index, factor)| self.effect(index, factor, values, mean)).collect();
        ResponseEffects { response: name, points: values.len() as u64, mean, factors }
    }

    fn effect(&self, index: usize, factor: &Factor, values: &Values, mean: f64) -> FactorEffect {
        let level = |row: u32| &self.levels[row as usize][index];
        let levels: Vec<(&Value, f64)> = values.iter().map(|(row, value)| (level(*row), *value)).collect();
        let is_log = factor.scale == Some(Scale::Log);
        let number = |level: &Value| level.as_f64().map(|number| if is_log { number.ln() } else { number });
        let numbers: Option<Vec<(f64, f64)>> =
            levels.iter().map(|(level, value)| Some((number(level)?, *value))).collect();
        let pairs = numbers.unwrap_or_default();
        let range =
            pairs.iter().fold((f64::MAX, f64::MIN), |(low, high), (x, _)| (low.min(*x), high.max(*x)));
        let rank_correlation = rank_correlation(&pairs);
        FactorEffect {
            factor: factor.name().to_owned(),
            effect: line(&pairs).map(|line| line.slope * (range.1 - range.0)),
            rank_correlation,
            p_value: rank_correlation
                .and_then(|correlation| rank_correlation_p_value(correlation, pairs.len())),
            levels: by_level(&levels, mean),
        }
    }
}

/// The mean at each level, sorted if the levels are numbers. Empty for more than [`MAX_LEVELS`] levels.
fn by_level(values: &[(&Value, f64)], mean: f64) -> Vec<LevelEffect> {
    let mut groups: Vec<(&Value, Vec<f64>)> = Vec::new();
    for (level, value) in values {
        match groups.iter().position(|(other, _)| same(other, level)) {
            Some(group) => groups[group].1.push(*value),
            None if groups.len() == MAX_LEVELS => return Vec::new(),
            None => groups.push((level, vec![*value])),
        }
    }
    groups.sort_by(|(one, _), (other, _)| match (one.as_f64(), other.as_f64()) {
        (Some(one), Some(other)) => one.total_cmp(&other),
        _ => std::cmp::Ordering::Equal,
    });
    let level = |(level, group): (&Value, Vec<f64>)| {
        let here = group.iter().sum::<f64>() / group.len() as f64;
        let effect = if (here - mean).abs() > ROUNDING * mean.abs() { here - mean } else { 0.0 };
        LevelEffect { level: level.clone(), points: group.len() as u64, mean: here, effect }
    };
    groups.into_iter().map(level).collect()
}
