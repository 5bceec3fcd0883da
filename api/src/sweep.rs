//! Sweeps: a base scenario, factors, a design and replicates, expanded to jobs.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use serde_json::Value;
use utoipa::ToSchema;

use crate::design::{Design, DesignKind, Factor};
use crate::ids::SweepId;
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
    /// A name for people, of at most 256 bytes.
    #[schema(max_length = 256)]
    pub name: String,
    /// The scenario that every point starts from.
    #[schema(value_type = Object)]
    pub base: Value,
    /// How values are combined to points.
    pub design: Design,
    /// What is varied. May be left out with `csv`: each column is then a factor.
    #[serde(default)]
    pub factors: Vec<Factor>,
    /// Runs per design point, with seeds of their own.
    #[serde(default = "one")]
    pub replicates: u32,
    /// Higher is claimed first; outside -100 to 100 it takes a token with the scope `admin`.
    #[serde(default)]
    pub priority: i32,
    /// Free labels, at most 64 with keys and values of at most 256 bytes.
    #[serde(default)]
    #[schema(schema_with = crate::job::labels_schema)]
    pub labels: BTreeMap<String, String>,
    /// What its jobs need of a worker.
    #[serde(default)]
    pub needs: Needs,
    /// Longest wall time of an attempt, in seconds.
    #[serde(default)]
    pub max_wall_s: Option<f64>,
    /// Simulated time from frame to frame that its jobs record, in seconds; without it none are.
    #[serde(default)]
    pub frame_interval_s: Option<f64>,
    /// Whether results may come from the store.
    #[serde(default = "crate::job::default_cache")]
    pub cache: Cache,
}

fn one() -> u32 {
    1
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
    /// The number of those in a state.
    pub fn of(&mut self, state: JobState) -> &mut u64 {
        match state {
            JobState::Queued => &mut self.queued,
            JobState::Running => &mut self.running,
            JobState::Succeeded => &mut self.succeeded,
            JobState::Failed => &mut self.failed,
            JobState::Cancelled => &mut self.cancelled,
        }
    }

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

/// How many jobs have failed in each way.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct FailureCounts {
    /// Refused by the solver.
    pub invalid: u64,
    /// Diverged.
    pub unstable: u64,
    /// Not run by any worker.
    pub worker: u64,
    /// Lost with their workers.
    pub lost: u64,
    /// Stopped after `max_wall_s`.
    pub timeout: u64,
}

impl FailureCounts {
    /// The number of those of a class.
    pub fn of(&mut self, class: FailureClass) -> &mut u64 {
        match class {
            FailureClass::Invalid => &mut self.invalid,
            FailureClass::Unstable => &mut self.unstable,
            FailureClass::Worker => &mut self.worker,
            FailureClass::Lost => &mut self.lost,
            FailureClass::Timeout => &mut self.timeout,
        }
    }
}

/// A sweep as the API shows it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct SweepView {
    /// Its identifier.
    pub id: SweepId,
    /// Its name.
    pub name: String,
    /// How its points were made.
    pub design: DesignKind,
    /// Design points.
    pub points: u32,
    /// Replicates of each point.
    pub replicates: u32,
    /// Names of its factors: the pointer of each one's first field.
    pub factors: Vec<String>,
    /// Its jobs by state.
    pub counts: StateCounts,
    /// Those that failed, by class.
    #[serde(default)]
    pub failures: FailureCounts,
    /// Estimated share that is done, running jobs included, 0 to 1.
    pub fraction: f64,
    /// When it was submitted.
    #[schema(value_type = String, format = DateTime)]
    pub submitted_at: Timestamp,
}

/// What a deletion takes away, or would take away.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct Deletion {
    /// Whether nothing has been deleted yet.
    pub dry_run: bool,
    /// Design points.
    pub points: u64,
    /// Jobs.
    pub jobs: u64,
    /// Those of them that have not ended: while there are any, nothing is deleted.
    pub unended: u64,
    /// Attempts of those jobs.
    pub attempts: u64,
    /// Their results, which can then answer no other submission.
    pub results: u64,
    /// Bytes of their frames.
    pub frames_bytes: u64,
}
