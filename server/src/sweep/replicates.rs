//! The values of responses over design points and their replicates, as effects and differences need them.

use std::collections::BTreeMap;

use roost_api::job::JobState;
use roost_api::table::{Pairing, PairingGain, TrialRow};
use roost_solver::experiments::is_indicator;
use roost_stats::{Contrast, Interval, PointTable, Values};

use super::summary::word;

/// Responses of design points. Points of a large sweep are added in batches.
#[derive(Default)]
pub(super) struct Replicates {
    points: u32,
    numbers: BTreeMap<String, Rows>,
    words: BTreeMap<String, Words>,
}

/// Values at the points that have one.
#[derive(Clone, Default)]
struct Rows {
    points: Vec<u32>,
    table: PointTable,
}

/// Words as numbers, by their place in the vocabulary.
#[derive(Default)]
struct Words {
    vocabulary: Vec<String>,
    rows: Rows,
}

/// One response: numbers, or the share of trials with an event.
pub(super) struct Response {
    /// Its name; `name=word` for the share of trials with a word.
    pub(super) name: String,
    /// The points with a value, in the order in which they were added.
    pub(super) points: Vec<u32>,
    /// Their values.
    pub(super) table: PointTable,
    /// Meaning of the values.
    pub(super) kind: Values,
}

impl Replicates {
    /// Adds points with their succeeded trials, which are sorted by point and replicate.
    pub(super) fn add(&mut self, trials: &[TrialRow]) {
        for trials in trials.chunk_by(|one, other| one.point == other.point) {
            self.add_point(trials);
            self.points += 1;
        }
    }

    fn add_point(&mut self, trials: &[TrialRow]) {
        let mut numbers: BTreeMap<&str, (Vec<u64>, Vec<f64>)> = BTreeMap::new();
        let mut words: BTreeMap<&str, (Vec<u64>, Vec<f64>)> = BTreeMap::new();
        for trial in trials.iter().filter(|trial| trial.state == JobState::Succeeded) {
            for (name, value) in &trial.responses {
                let ((seeds, values), number) = if let Some(number) = value.as_f64() {
                    (numbers.entry(name).or_default(), number)
                } else if let Some(word) = word(value) {
                    let vocabulary = &mut self.words.entry(name.clone()).or_default().vocabulary;
                    let known = vocabulary.iter().position(|known| *known == word);
                    let place = known.unwrap_or_else(|| {
                        vocabulary.push(word);
                        vocabulary.len() - 1
                    });
                    (words.entry(name).or_default(), place as f64)
                } else {
                    continue;
                };
                seeds.push(trial.seed);
                values.push(number);
            }
        }
        for (name, (seeds, values)) in numbers {
            self.numbers.entry(name.to_owned()).or_default().push(self.points, &seeds, &values);
        }
        for (name, (seeds, values)) in words {
            self.words.entry(name.to_owned()).or_default().rows.push(self.points, &seeds, &values);
        }
    }

    /// Every response by name, one after the other.
    pub(super) fn responses(self) -> impl Iterator<Item = Response> {
        let numbers = self.numbers.into_iter().map(|(name, rows)| {
            let kind = if is_indicator(&name) { Values::Events } else { Values::Numbers };
            Response { name, points: rows.points, table: rows.table, kind }
        });
        let words = self.words.into_iter().flat_map(|(name, Words { vocabulary, rows })| {
            vocabulary.into_iter().enumerate().map(move |(place, word)| Response {
                name: format!("{name}={word}"),
                points: rows.points.clone(),
                table: rows.table.map(|value| f64::from(u8::from(value == place as f64))),
                kind: Values::Events,
            })
        });
        numbers.chain(words)
    }
}

impl Rows {
    fn push(&mut self, point: u32, seeds: &[u64], values: &[f64]) {
        self.points.push(point);
        self.table.push(seeds, values);
    }
}

impl Response {
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
        let weights = self.table.has_replicates().then(weights)?;
        weights.iter().any(|weight| *weight != 0.0).then(|| self.table.contrast(&weights, self.kind))
    }
}

/// The ends of an interval.
pub(super) fn ends(interval: Option<Interval>) -> (Option<f64>, Option<f64>) {
    (interval.map(|interval| interval.low), interval.map(|interval| interval.high))
}

/// What pairing did to the intervals with these ratios of widths.
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
