//! Summaries of design points over their replicates.

use std::collections::BTreeMap;

use roost_api::job::{FailureClass, JobState};
use roost_api::table::{PointRow, ShareInterval, Summary, TrialRow};
use roost_solver::experiments::is_indicator;
use roost_stats::{Nested, Sample, share_interval};
use serde_json::Value;

/// Summarises trials, which are sorted by design point. `runs_per_sample` are the replicates in a row that have the same parameters, if
/// these come from a posterior.
pub(crate) fn by_point(trials: &[TrialRow], runs_per_sample: Option<u32>) -> Vec<PointRow> {
    let points = trials.chunk_by(|one, other| one.point == other.point);
    points.map(|trials| point(trials, runs_per_sample)).collect()
}

fn point(trials: &[TrialRow], runs_per_sample: Option<u32>) -> PointRow {
    let mut row = PointRow {
        point: trials[0].point,
        factors: trials[0].factors.clone(),
        counts: Default::default(),
        unstable: 0,
        responses: BTreeMap::new(),
    };
    let mut values: BTreeMap<&str, Vec<&Value>> = BTreeMap::new();
    for trial in trials {
        *row.counts.of(trial.state) += 1;
        row.unstable += u64::from(trial.failure_class == Some(FailureClass::Unstable));
        for (name, value) in trial.responses.iter().filter(|_| trial.state == JobState::Succeeded) {
            values.entry(name).or_default().push(value);
        }
    }
    row.responses =
        values.into_iter().map(|(name, values)| (name.to_owned(), summary(name, &values))).collect();
    if let Some(runs) = runs_per_sample {
        for (name, summary) in &mut row.responses {
            add_input(name, summary, trials, runs);
        }
    }
    row
}

/// Separates what comes from the parameters of a posterior from chance, and widens the interval by it.
fn add_input(name: &str, summary: &mut Summary, trials: &[TrialRow], runs_per_sample: u32) {
    let mut groups: BTreeMap<u32, Vec<f64>> = BTreeMap::new();
    for trial in trials.iter().filter(|trial| trial.state == JobState::Succeeded) {
        let value = trial.responses.get(name).and_then(Value::as_f64);
        groups.entry(trial.replicate / runs_per_sample).or_default().extend(value);
    }
    let groups: Vec<Vec<f64>> = groups.into_values().collect();
    let Some(Nested { input_deviation, chance_deviation, interval: (low, high), .. }) = Nested::of(&groups)
    else {
        return;
    };
    (summary.input_deviation, summary.chance_deviation) = (Some(input_deviation), chance_deviation);
    if is_indicator(name) {
        // Equal answers of yes or no would look certain: the interval is at least that of the share.
        summary.low_95 = summary.low_95.map(|share| share.min(low.max(0.0)));
        summary.high_95 = summary.high_95.map(|share| share.max(high.min(1.0)));
    } else {
        (summary.low_95, summary.high_95) = (Some(low), Some(high));
    }
}

/// The mean of numbers; the counts and the shares of words. The mean of an indicator is a share. Null is no value.
fn summary(name: &str, values: &[&Value]) -> Summary {
    let numbers: Vec<f64> = values.iter().filter_map(|value| value.as_f64()).collect();
    let mut words: BTreeMap<String, u64> = BTreeMap::new();
    for word in values.iter().filter_map(|value| word(value)) {
        *words.entry(word).or_default() += 1;
    }
    let trials: u64 = words.values().sum();
    let share = |count: u64| {
        share_interval(count, trials).map(|share| ShareInterval { low_95: share.low, high_95: share.high })
    };
    let shares: BTreeMap<String, ShareInterval> =
        words.iter().filter_map(|(word, count)| Some((word.clone(), share(*count)?))).collect();
    let sample = Sample::of(&numbers);
    let mean = sample.map(|sample| sample.mean);
    let interval = if is_indicator(name) {
        let ones = numbers.iter().filter(|value| **value == 1.0).count();
        share_interval(ones as u64, numbers.len() as u64).map(|share| (share.low, share.high))
    } else {
        let half_width = sample.and_then(|sample| sample.half_width());
        mean.zip(half_width).map(|(mean, half)| (mean - half, mean + half))
    };
    Summary {
        n: numbers.len() as u64 + trials,
        mean,
        standard_deviation: sample.and_then(|sample| sample.deviation),
        input_deviation: None,
        chance_deviation: None,
        low_95: interval.map(|(low, _)| low),
        high_95: interval.map(|(_, high)| high),
        words: (!words.is_empty()).then_some(words),
        shares: (!shares.is_empty()).then_some(shares),
        unseen_high_95: share(0).map(|share| share.high_95),
    }
}

/// A value that is counted, not averaged.
pub(super) fn word(value: &Value) -> Option<String> {
    match value {
        Value::String(word) => Some(word.clone()),
        Value::Bool(flag) => Some(flag.to_string()),
        _ => None,
    }
}
