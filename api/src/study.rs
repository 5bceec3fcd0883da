//! Studies: a question about a scenario, which the server answers by growing a sweep.
//!
//! A study and its sweep have the same identifier: results, frames and events of its runs are those of the sweep.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use serde_json::Value;
use utoipa::ToSchema;

use crate::design::Factor;
use crate::ids::SweepId;
use crate::job::{Cache, Needs};
use crate::sweep::PosteriorDraws;
use crate::time::Timestamp;
use crate::words::words;

/// The schema of a study.
pub const SCHEMA: &str = "roost.study/1";

words!(
    /// The state of a study.
    StudyState {
        /// Runs are proposed and made.
        Running = "running",
        /// Nothing is proposed or run until it is resumed.
        Paused = "paused",
        /// It has its answer.
        Finished = "finished",
        /// A user has ended it.
        Cancelled = "cancelled",
    }
);

words!(
    /// The reason why a study is finished.
    StudyEnd {
        /// The answer is as certain as asked.
        ByRule = "by_rule",
        /// The budget is spent.
        ByBudget = "by_budget",
        /// No point can be run any more.
        NothingLeft = "nothing_left",
    }
);

words!(
    /// The party that runs the proposals of a study.
    Driver {
        /// The server: proposals become jobs by themselves.
        Server = "server",
        /// Clients: they ask for runs, or for jobs at points of their own.
        Client = "client",
    }
);

/// A submitted study.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct StudySpec {
    /// `roost.study/1`, or left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub schema: Option<String>,
    /// A name for people, of at most 256 bytes.
    #[schema(max_length = 256)]
    pub name: String,
    /// The scenario that the factors vary. Each run has a seed of its own, which the server computes from the seed of this scenario, the values
    /// of the factors and the replicate. Left out in a calibration, whose tests have scenarios.
    #[serde(default, skip_serializing_if = "Value::is_null")]
    #[schema(value_type = Object)]
    pub base: Value,
    /// The factors, each with `low` and `high`, and perhaps `scale`, or with `levels`.
    pub factors: Vec<Factor>,
    /// The goal: an object with one member `estimate`, `boundary`, `optimise`, `sensitivity` or `calibrate`.
    #[schema(value_type = Object)]
    pub goal: Value,
    /// Limits of the number of runs.
    pub budget: StudyBudget,
    /// Sweeps whose finished runs it begins with. The runs are copied, and the budget does not count them.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub seeded_by: Vec<SweepId>,
    /// Parameters that each run draws from the posterior of a calibration.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub posterior: Option<PosteriorDraws>,
    /// The party that runs its proposals: the `server` by jobs, or a `client` that asks for them.
    #[serde(default = "server")]
    pub driver: Driver,
    /// Jobs of higher priority are claimed first. Values outside -100 to 100 need a token with the scope `admin`.
    #[serde(default)]
    pub priority: i32,
    /// Free labels, at most 64 with keys and values of at most 256 bytes.
    #[serde(default)]
    #[schema(schema_with = crate::job::labels_schema)]
    pub labels: BTreeMap<String, String>,
    /// Requirements of its jobs on the worker.
    #[serde(default)]
    pub needs: Needs,
    /// Maximum wall time of an attempt, in seconds.
    #[serde(default)]
    pub max_wall_s: Option<f64>,
    /// Whether cached results may be used.
    #[serde(default = "crate::job::default_cache")]
    pub cache: Cache,
}

fn server() -> Driver {
    Driver::Server
}

/// Limits of the number of runs of a study.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct StudyBudget {
    /// Maximum number of runs in all, failed ones included.
    pub max_runs: u32,
    /// Maximum number of runs at one point; 1,000 unless given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub max_replicates: Option<u32>,
    /// A point is left out when this many of its runs have failed, and they are at least half of its ended runs; 3 unless given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub max_failures: Option<u32>,
}

/// A change of a study's budget.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct BudgetChange {
    /// The new maximum number of runs; above the present one.
    pub max_runs: u32,
}

/// A change of a study's ranges.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct RangeChange {
    /// The factors whose ranges grow.
    pub ranges: Vec<WiderRange>,
}

/// A wider range of a factor.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct WiderRange {
    /// The factor: the pointer of its first field.
    pub pointer: String,
    /// The new lowest value, not above the present one; as before unless given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub low: Option<f64>,
    /// The new highest value, not below the present one; as before unless given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub high: Option<f64>,
}

/// Number of runs of a study by state.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct StudyRuns {
    /// With a result.
    pub done: u64,
    /// Failed.
    pub failed: u64,
    /// Cancelled.
    pub cancelled: u64,
    /// Queued, running, or handed out to clients.
    pub pending: u64,
    /// The budget.
    pub max_runs: u64,
    /// Ended runs that the budget does not count: those of the sweeps that it began with, and those at points of clients.
    #[serde(default)]
    pub outside_budget: u64,
}

/// A sweep that a study began with, and the number of its runs by use.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct SeedingSweep {
    /// The sweep.
    pub sweep: SweepId,
    /// Its name.
    pub name: String,
    /// Runs that were copied. Those outside the ranges are used once the ranges are wide enough.
    pub copied: u64,
    /// Runs left out because their scenario differs from the base in more than the factors and the seed.
    pub other_scenarios: u64,
    /// The first field in which the first of these differs.
    pub first_difference: Option<String>,
    /// Runs left out because a factor lacks their level, or because their value is no number. Wider ranges cannot include them.
    #[serde(default)]
    pub other_levels: u64,
    /// The factor and the level of the first of these, such as `/equipment/side_walls = "rough"`.
    #[serde(default)]
    pub first_other_level: Option<String>,
    /// Runs left out because another revision of the solver made their results.
    pub other_revisions: u64,
    /// Runs left out because they have no result.
    pub without_result: u64,
    /// Runs left out because a run with the same values of the factors and the same seed was copied before.
    pub repeated: u64,
    /// Whether copied runs at different points have a seed in common. Intervals take their deviations for independent.
    pub shares_seeds: bool,
}

/// A study as the API shows it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct StudyView {
    /// Its identifier, which is also that of its sweep.
    pub id: SweepId,
    /// Its name.
    pub name: String,
    /// Its state.
    pub state: StudyState,
    /// Why it is finished; null before.
    pub finished: Option<StudyEnd>,
    /// The question, in words.
    pub question: String,
    /// The answer so far, in sentences, the last of which tells whether the study goes on.
    pub answer: Vec<String>,
    /// Names of its factors, each the pointer of the factor's first field.
    pub factors: Vec<String>,
    /// Its runs.
    pub runs: StudyRuns,
    /// Number of points with runs.
    pub points: u64,
    /// When it was submitted.
    #[schema(value_type = String, format = DateTime)]
    pub submitted_at: Timestamp,
    /// When the answer was last computed; null before.
    #[schema(value_type = Option<String>, format = DateTime)]
    pub answered_at: Option<Timestamp>,
}

/// The answer of a study with its evidence.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct StudyAnswer {
    /// The study.
    pub study: StudyView,
    /// The factors with their present ranges.
    pub factors: Vec<Factor>,
    /// The goal, as submitted.
    #[schema(value_type = Object)]
    pub goal: Value,
    /// The sweeps that it began with.
    #[serde(default)]
    pub seeded_by: Vec<SeedingSweep>,
    /// Numbers of the answer: `runs`, `excluded` and `finding`, an object with one member named by the goal. Null before the first decision.
    #[schema(value_type = Object)]
    pub answer: Value,
}
