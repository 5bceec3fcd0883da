//! Observations: the runs of a study that are no jobs of its own.

use std::collections::BTreeMap;

use roost_api::ids::SweepId;
use roost_design::Outcome;
use serde_json::{Map, Value};

/// The source of an observation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Source {
    /// A run of an earlier sweep, copied when the study was submitted.
    Sweep(SweepId),
    /// A proposal that was handed out to a client.
    Asked,
    /// A run at a point of a client.
    Client,
}

/// A run of a study that is no job of its own.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Observation {
    /// Its source.
    pub(crate) source: Source,
    /// Value by factor.
    pub(crate) levels: BTreeMap<String, Value>,
    /// Its replicate; another one is used if a job has it.
    pub(crate) replicate: u32,
    /// Its seed.
    pub(crate) seed: u64,
    /// Its outcome.
    pub(crate) outcome: Outcome,
}

impl Observation {
    /// Whether the budget does not count it.
    pub(super) fn is_free(&self) -> bool {
        self.source != Source::Asked
    }

    /// An order that does not depend on the order of arrival. Of two runs with the same point and seed the first counts.
    pub(super) fn order(&self) -> (bool, bool, u32, u64) {
        (self.outcome == Outcome::Pending, self.is_free(), self.replicate, self.seed)
    }
}

/// Responses as the numbers that measures use: words are left out, true is 1.
pub(super) fn numbers(responses: &Map<String, Value>) -> BTreeMap<String, f64> {
    let number =
        |value: &Value| value.as_f64().or(value.as_bool().map(|is_true| f64::from(u8::from(is_true))));
    responses.iter().filter_map(|(name, value)| Some((name.clone(), number(value)?))).collect()
}
