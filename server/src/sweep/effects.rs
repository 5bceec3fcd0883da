//! Sensitivity: how much each factor moves each response, and how surely. A design point counts once, with the mean of its
//! replicates: those share their seeds with all other points and are no further witnesses.

use std::collections::{BTreeMap, BTreeSet};

use roost_api::design::{Factor, Scale};
use roost_api::table::{FactorEffect, LevelEffect, PointRow, ResponseEffects};
use serde_json::Value;

use super::levels::same;
use crate::stats::{chance, line, rank_correlation};

/// A factor with more values than this has no means by level.
const MAX_LEVELS: usize = 12;

/// Main effects and rank correlations of every response that varies by word or number.
pub(crate) fn effects(factors: &[Factor], points: &[PointRow]) -> Vec<ResponseEffects> {
    let mut responses: BTreeMap<String, Vec<(&PointRow, f64)>> = BTreeMap::new();
    for point in points {
        for (name, summary) in &point.responses {
            if let Some(mean) = summary.mean {
                responses.entry(name.clone()).or_default().push((point, mean));
            }
        }
    }
    for (name, word) in words(points) {
        let share = |point: &PointRow| {
            let counts = point.responses.get(&name)?.words.as_ref()?;
            let all = counts.values().sum::<u64>() as f64;
            Some(counts.get(&word).copied().unwrap_or(0) as f64 / all)
        };
        let shares = points.iter().filter_map(|point| Some((point, share(point)?))).collect();
        responses.insert(format!("{name}={word}"), shares);
    }
    responses.into_iter().map(|(name, values)| response(name, factors, &values)).collect()
}

/// Every response of words with each word that was an answer.
fn words(points: &[PointRow]) -> BTreeSet<(String, String)> {
    let of_point = |point: &PointRow| {
        let counted =
            point.responses.iter().filter_map(|(name, summary)| Some((name, summary.words.as_ref()?)));
        counted
            .flat_map(|(name, words)| words.keys().map(|word| (name.clone(), word.clone())))
            .collect::<Vec<_>>()
    };
    points.iter().flat_map(of_point).collect()
}

fn response(name: String, factors: &[Factor], values: &[(&PointRow, f64)]) -> ResponseEffects {
    let mean = values.iter().map(|(_, value)| value).sum::<f64>() / values.len() as f64;
    let factors = factors.iter().map(|factor| effect(factor, values, mean)).collect();
    ResponseEffects { response: name, points: values.len() as u64, mean, factors }
}

fn effect(factor: &Factor, values: &[(&PointRow, f64)], mean: f64) -> FactorEffect {
    let name = factor.name();
    let level = |point: &PointRow| point.factors.get(name).cloned().unwrap_or_default();
    let levels: Vec<(Value, f64)> = values.iter().map(|(point, value)| (level(point), *value)).collect();
    let is_log = factor.scale == Some(Scale::Log);
    let number = |level: &Value| level.as_f64().map(|number| if is_log { number.ln() } else { number });
    let numbers: Option<Vec<(f64, f64)>> =
        levels.iter().map(|(level, value)| Some((number(level)?, *value))).collect();
    let pairs = numbers.unwrap_or_default();
    let range = pairs.iter().fold((f64::MAX, f64::MIN), |(low, high), (x, _)| (low.min(*x), high.max(*x)));
    let rank_correlation = rank_correlation(&pairs);
    FactorEffect {
        factor: name.to_owned(),
        effect: line(&pairs).map(|line| line.slope * (range.1 - range.0)),
        rank_correlation,
        p_value: rank_correlation.and_then(|correlation| chance(correlation, pairs.len())),
        levels: by_level(&levels, mean),
    }
}

/// The mean at each value, numbers in their order, others as they come; nothing where there are many.
fn by_level(values: &[(Value, f64)], mean: f64) -> Vec<LevelEffect> {
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
        LevelEffect { level: level.clone(), points: group.len() as u64, mean: here, effect: here - mean }
    };
    groups.into_iter().map(level).collect()
}
