//! The values of responses over design points and their replicates, as effects and differences need them.

use std::collections::BTreeMap;

use roost_api::job::JobState;
use roost_api::table::{Pairing, PairingGain, TrialRow};
use roost_solver::experiments::is_indicator;
use roost_stats::{Contrast, Interval, PointTable, Values};

use super::summary::word;

/// Responses of design points. Points of a large sweep are added in batches, and its trials are read in several passes: a pass holds the
/// first responses by name that fit, and the next pass the following ones.
pub(super) struct ReplicateTables {
    /// Replicates in a row that have the same parameters, if these come from a posterior.
    runs_per_sample: Option<u32>,
    max_bytes: usize,
    bytes: usize,
    points: u32,
    columns: BTreeMap<String, Column>,
    /// The last response of the previous pass.
    after: Option<String>,
    /// The first response of the next pass.
    before: Option<String>,
}

/// Values of one name: numbers, and words by their place in the vocabulary.
#[derive(Default)]
struct Column {
    numbers: Rows,
    vocabulary: Vec<String>,
    words: Rows,
}

/// Values at the points that have one.
#[derive(Clone, Default)]
struct Rows {
    points: Vec<u32>,
    table: PointTable,
    bytes: usize,
}

/// One response: numbers, or the share of trials with an event.
pub(super) struct ResponseTable {
    /// Its name; `name=word` for the share of trials with a word.
    pub(super) name: String,
    /// The points with a value, in the order in which they were added.
    pub(super) points: Vec<u32>,
    /// Their values.
    pub(super) table: PointTable,
    /// Meaning of the values.
    pub(super) kind: Values,
}

impl ReplicateTables {
    /// Holds as many responses as fit into this memory, and at least one.
    pub(super) fn new(max_bytes: usize, runs_per_sample: Option<u32>) -> Self {
        Self {
            runs_per_sample,
            max_bytes,
            bytes: 0,
            points: 0,
            columns: BTreeMap::new(),
            after: None,
            before: None,
        }
    }

    /// Adds points with their succeeded trials, which are sorted by point and replicate.
    pub(super) fn add(&mut self, trials: &[TrialRow]) {
        for trials in trials.chunk_by(|one, other| one.point == other.point) {
            self.add_point(trials);
            self.points += 1;
            self.leave_to_next_pass();
        }
    }

    fn add_point(&mut self, trials: &[TrialRow]) {
        let mut numbers: BTreeMap<&str, (Vec<u64>, Vec<f64>)> = BTreeMap::new();
        let mut words: BTreeMap<&str, (Vec<u64>, Vec<f64>)> = BTreeMap::new();
        let (after, before) = (&self.after, &self.before);
        let is_of_this_pass = |name: &String| {
            after.as_ref().is_none_or(|after| name > after)
                && before.as_ref().is_none_or(|before| name < before)
        };
        for trial in trials.iter().filter(|trial| trial.state == JobState::Succeeded) {
            for (name, value) in trial.responses.iter().filter(|(name, _)| is_of_this_pass(name)) {
                let ((seeds, values), number) = if let Some(number) = value.as_f64() {
                    (numbers.entry(name).or_default(), number)
                } else if let Some(word) = word(value) {
                    let vocabulary = &mut self.columns.entry(name.clone()).or_default().vocabulary;
                    let known = vocabulary.iter().position(|known| *known == word);
                    let place = known.unwrap_or_else(|| {
                        vocabulary.push(word);
                        vocabulary.len() - 1
                    });
                    (words.entry(name).or_default(), place as f64)
                } else {
                    continue;
                };
                // Samples go by number.
                seeds.push(self.runs_per_sample.map_or(trial.seed, |_| u64::from(trial.replicate)));
                values.push(number);
            }
        }
        for (name, (seeds, values)) in numbers {
            let rows = &mut self.columns.entry(name.to_owned()).or_default().numbers;
            self.bytes += rows.push(self.points, &seeds, &values);
        }
        for (name, (seeds, values)) in words {
            let rows = &mut self.columns.entry(name.to_owned()).or_default().words;
            self.bytes += rows.push(self.points, &seeds, &values);
        }
    }

    /// Drops the last responses by name that do not fit.
    fn leave_to_next_pass(&mut self) {
        while self.bytes > self.max_bytes && self.columns.len() > 1 {
            let Some((name, column)) = self.columns.pop_last() else { return };
            self.bytes -= column.numbers.bytes + column.words.bytes;
            self.before = Some(name);
        }
    }

    /// The responses of this pass by name, one after the other, and the next pass if there are more.
    pub(super) fn finish_pass(self) -> (impl Iterator<Item = ResponseTable>, Option<Self>) {
        let last = self.columns.last_key_value().map(|(name, _)| name.clone());
        let runs = self.runs_per_sample;
        let next = self.before.map(|_| Self { after: last, ..Self::new(self.max_bytes, runs) });
        (self.columns.into_iter().flat_map(move |(name, column)| column.responses(name, runs)), next)
    }
}

impl Column {
    fn responses(self, name: String, runs_per_sample: Option<u32>) -> impl Iterator<Item = ResponseTable> {
        let Self { mut numbers, vocabulary, mut words } = self;
        if let Some(runs) = runs_per_sample {
            numbers.table = numbers.table.with_samples(runs);
            words.table = words.table.with_samples(runs);
        }
        let kind = if is_indicator(&name) { Values::Events } else { Values::Numbers };
        let of_words = name.clone();
        let numbers = (!numbers.points.is_empty()).then_some(ResponseTable {
            name,
            points: numbers.points,
            table: numbers.table,
            kind,
        });
        let words = vocabulary.into_iter().enumerate().map(move |(place, word)| ResponseTable {
            name: format!("{of_words}={word}"),
            points: words.points.clone(),
            table: words.table.map(|value| f64::from(u8::from(value == place as f64))),
            kind: Values::Events,
        });
        numbers.into_iter().chain(words)
    }
}

impl Rows {
    /// Adds a point, and returns the memory that it takes, in bytes.
    fn push(&mut self, point: u32, seeds: &[u64], values: &[f64]) -> usize {
        self.points.push(point);
        self.table.push(seeds, values);
        let bytes = size_of_val(&point) + size_of_val(values) + PointTable::BYTES_PER_POINT;
        self.bytes += bytes;
        bytes
    }
}

impl ResponseTable {
    /// How intervals of its contrasts use common seeds.
    pub(super) fn pairing(&self) -> Pairing {
        match self.table.pairing(self.kind) {
            roost_stats::Pairing::BySeed => Pairing::BySeed,
            roost_stats::Pairing::AdditiveModel => Pairing::AdditiveModel,
            roost_stats::Pairing::Unpaired => Pairing::Unpaired,
        }
    }

    /// The contrast with these weights; none without replicates, or when all weights are 0.
    pub(super) fn contrast(&self, weights: impl FnOnce() -> Vec<f64>) -> Option<Contrast> {
        Some(self.table.contrast(&self.weights(weights)?, self.kind))
    }

    /// The interval of this contrast alone.
    pub(super) fn interval(&self, weights: impl FnOnce() -> Vec<f64>) -> Option<Interval> {
        self.table.interval(&self.weights(weights)?, self.kind)
    }

    fn weights(&self, weights: impl FnOnce() -> Vec<f64>) -> Option<Vec<f64>> {
        let weights = self.table.has_replicates().then(weights)?;
        weights.iter().any(|weight| *weight != 0.0).then_some(weights)
    }
}

/// The ends of an interval.
pub(super) fn ends(interval: Option<Interval>) -> (Option<f64>, Option<f64>) {
    (interval.map(|interval| interval.low), interval.map(|interval| interval.high))
}

/// Effect of pairing on intervals, from the ratios of their widths.
pub(super) fn gain(mut ratios: Vec<f64>) -> PairingGain {
    ratios.sort_unstable_by(f64::total_cmp);
    let middle = ratios.len() / 2;
    let median = match ratios.len() {
        0 => None,
        n if n % 2 == 1 => Some(ratios[middle]),
        _ => Some((ratios[middle - 1] + ratios[middle]) / 2.0),
    };
    PairingGain::new(median, ratios.len() as u64)
}

#[cfg(test)]
mod tests {
    use roost_api::ids::JobId;
    use serde_json::json;

    use super::*;

    fn point(point: u32) -> Vec<TrialRow> {
        let trial = |replicate| TrialRow {
            job_id: JobId::new(),
            point,
            replicate,
            seed: u64::from(replicate),
            factors: Default::default(),
            parameters: serde_json::Map::new(),
            state: JobState::Succeeded,
            failure_class: None,
            backend: None,
            solver_revision: None,
            responses: json!({"a": point, "b": 1.5, "c": "word", "d": replicate})
                .as_object()
                .unwrap()
                .clone(),
        };
        (0..3).map(trial).collect()
    }

    #[test]
    fn passes_fit_the_memory_limit_and_cover_every_response_once() {
        // A response takes 3 · 8 + 4 + 8 = 36 bytes per point, 360 in all.
        for (max_bytes, expected) in [
            (1440, vec![vec!["a", "b", "c=word", "d"]]),
            (1439, vec![vec!["a", "b", "c=word"], vec!["d"]]),
            (750, vec![vec!["a", "b"], vec!["c=word", "d"]]),
            (1, vec![vec!["a"], vec!["b"], vec!["c=word"], vec!["d"]]),
        ] {
            let mut pass = Some(ReplicateTables::new(max_bytes, None));
            let mut found = Vec::new();
            while let Some(mut replicates) = pass {
                for index in 0..10 {
                    replicates.add(&point(index));
                    assert!(replicates.bytes <= max_bytes.max(360), "{} bytes", replicates.bytes);
                }
                let (responses, next) = replicates.finish_pass();
                let responses: Vec<ResponseTable> = responses.collect();
                assert!(responses.iter().all(|of| of.points == (0..10).collect::<Vec<_>>()));
                found.push(responses.into_iter().map(|of| of.name).collect::<Vec<_>>());
                pass = next;
            }
            assert_eq!(found, expected, "{max_bytes} bytes");
        }
    }
}
