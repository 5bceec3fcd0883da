//! Sweeps: a base scenario, factors, a design and replicates, expanded to jobs.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};
use utoipa::ToSchema;

use crate::ids::{JobId, SweepId};
use crate::job::{Cache, FailureClass, JobState, Needs};
use crate::time::Timestamp;

/// The schema name that every sweep carries once it has been read.
pub const SCHEMA: &str = "roost.sweep/1";

/// A sweep as submitted. Replicate r of every point runs with seed `base.seed + r`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct SweepSpec {
    /// `roost.sweep/1`; may be left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub schema: Option<String>,
    /// A name for people.
    pub name: String,
    /// The scenario that every point starts from.
    #[schema(value_type = Object)]
    pub base: Value,
    /// How levels are combined.
    pub design: Design,
    /// What is varied.
    pub factors: Vec<Factor>,
    /// Runs per design point, with seeds of their own.
    #[serde(default = "one")]
    pub replicates: u32,
    /// Higher is claimed first.
    #[serde(default)]
    pub priority: i32,
    /// Free labels.
    #[serde(default)]
    pub labels: BTreeMap<String, String>,
    /// What its jobs need of a worker.
    #[serde(default)]
    pub needs: Needs,
    /// Longest wall time of an attempt, in seconds.
    #[serde(default)]
    pub max_wall_s: Option<f64>,
    /// Whether results may come from the store.
    #[serde(default = "crate::job::default_cache")]
    pub cache: Cache,
}

fn one() -> u32 {
    1
}

/// How levels are combined to design points.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum Design {
    // With braces: serde lets unknown fields of a variant without fields pass.
    /// Every combination of all levels, the last factor varying fastest.
    Grid {},
}

/// A varied input.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Factor {
    /// JSON pointer of the scenario field.
    pub pointer: String,
    /// Its values.
    #[schema(value_type = Vec<Object>)]
    pub levels: Vec<Value>,
}

/// How many jobs are in each state.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct StateCounts {
    /// Waiting.
    pub queued: u64,
    /// Running.
    pub running: u64,
    /// With a result.
    pub succeeded: u64,
    /// Failed.
    pub failed: u64,
    /// Cancelled.
    pub cancelled: u64,
}

impl StateCounts {
    /// All jobs.
    pub fn total(&self) -> u64 {
        self.queued + self.running + self.ended()
    }

    /// Jobs that have ended.
    pub fn ended(&self) -> u64 {
        self.succeeded + self.failed + self.cancelled
    }

    /// Whether every job has ended.
    pub fn is_ended(&self) -> bool {
        self.queued + self.running == 0
    }
}

/// A sweep as the API shows it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct SweepView {
    /// Its identifier.
    pub id: SweepId,
    /// Its name.
    pub name: String,
    /// Design points.
    pub points: u32,
    /// Replicates of each point.
    pub replicates: u32,
    /// JSON pointers of its factors.
    pub factors: Vec<String>,
    /// Its jobs by state.
    pub counts: StateCounts,
    /// Estimated share that is done, running jobs included, 0 to 1.
    pub fraction: f64,
    /// When it was submitted.
    #[schema(value_type = String, format = DateTime)]
    pub submitted_at: Timestamp,
}

/// One trial of a sweep's result table.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct TrialRow {
    /// The job.
    pub job_id: JobId,
    /// Design point.
    pub point: u32,
    /// Replicate.
    pub replicate: u32,
    /// Seed.
    pub seed: u64,
    /// Levels by JSON pointer.
    #[schema(value_type = Object)]
    pub factors: Map<String, Value>,
    /// State of the job.
    pub state: JobState,
    /// Why it failed.
    pub failure_class: Option<FailureClass>,
    /// Backend that made the result.
    pub backend: Option<String>,
    /// Solver revision that made the result.
    pub solver_revision: Option<u32>,
    /// Scalar results.
    #[schema(value_type = Object)]
    pub responses: Map<String, Value>,
}

/// The result table of a sweep.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct SweepResults {
    /// The sweep.
    pub sweep: SweepView,
    /// One row a trial, by point and replicate.
    pub trials: Vec<TrialRow>,
}
