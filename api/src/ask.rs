//! Asking a study for runs, and telling it their outcomes: clients run the proposals, or propose runs themselves.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use serde_json::Value;
use utoipa::ToSchema;

use crate::ids::JobId;
use crate::study::StudyView;
use crate::time::Timestamp;

/// A request for runs: the study's next ones for the client to run, or jobs at points of the client.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Ask {
    /// Maximum number of runs that the client will run itself; 1 unless given. The answer has their scenarios, so at most 100.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 1, maximum = 100)]
    pub count: Option<u32>,
    /// Seconds after which a run without an outcome may be handed out again; a day unless given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 1, maximum = 31_536_000)]
    pub expires_s: Option<f64>,
    /// Points at which the server makes jobs, in place of `count`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub points: Option<Vec<AskedPoint>>,
}

/// A point of the client.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct AskedPoint {
    /// Value by factor, in the unit of the factor's field, or a level. Numbers are rounded to about seven digits of the range.
    #[schema(value_type = Object)]
    pub values: BTreeMap<String, Value>,
    /// Number of further runs at the point.
    #[serde(default = "one")]
    #[schema(minimum = 1, maximum = 250)]
    pub replicates: u32,
}

fn one() -> u32 {
    1
}

/// The answer to a request for runs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Asked {
    /// Runs for the client. Fewer than asked when the budget has no room for more, or when further runs need the outcomes of these.
    pub runs: Vec<HandedOut>,
    /// Jobs at the points of the client.
    pub jobs: Vec<JobId>,
    /// The study.
    pub study: StudyView,
}

/// A run that a client was given.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct HandedOut {
    /// Its number within the study, by which its outcome is told.
    pub run: u64,
    /// Value by factor, in the unit of the factor's field.
    #[schema(value_type = Object)]
    pub values: BTreeMap<String, Value>,
    /// Its replicate at the point.
    pub replicate: u32,
    /// Its seed.
    pub seed: u64,
    /// Its complete scenario.
    #[schema(value_type = Object)]
    pub scenario: Value,
    /// When it may be handed out again.
    #[schema(value_type = String, format = DateTime)]
    pub expires_at: Timestamp,
}

/// Outcomes of runs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Tell {
    /// The outcomes, at most 1,000. All of them are recorded, or none.
    pub outcomes: Vec<RunOutcome>,
}

/// The outcome of a run: of one that was handed out (`run`), or of one at a point of the client (`values` and `seed`). It has responses, has
/// failed, or is given back.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct RunOutcome {
    /// Number of the run that was handed out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub run: Option<u64>,
    /// Value by factor of a point of the client.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(value_type = Option<Object>)]
    pub values: Option<BTreeMap<String, Value>>,
    /// Seed of a run at a point of the client. It tells runs at one point apart.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(maximum = 9_007_199_254_740_991_i64)]
    pub seed: Option<u64>,
    /// Responses by name, each one that a measure of the goal uses: a number, true or false; null where the run has none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub responses: Option<BTreeMap<String, Value>>,
    /// Whether the run ended without a usable result.
    #[serde(default)]
    pub failed: bool,
    /// Whether the client will not run it: it may then be handed out again.
    #[serde(default)]
    pub given_back: bool,
}

/// The answer to outcomes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Told {
    /// Outcomes that are new.
    pub recorded: u64,
    /// Outcomes that were told before.
    pub repeated: u64,
    /// The study.
    pub study: StudyView,
}
