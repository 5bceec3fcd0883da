//! Sweeps: a base scenario, factors, a design and replicates, expanded to jobs.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use serde_json::Value;
use utoipa::ToSchema;

use crate::design::{Design, DesignKind, Factor};
use crate::ids::SweepId;
use crate::job::{Cache, FailureClass, JobState, Needs};
use crate::time::Timestamp;

/// The schema of a sweep.
pub const SCHEMA: &str = "roost.sweep/1";

/// A submitted sweep. Replicate r of every design point runs with the seed `base.seed + r`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct SweepSpec {
    /// `roost.sweep/1`, or left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub schema: Option<String>,
    /// A name for people, of at most 256 bytes.
    #[schema(max_length = 256)]
    pub name: String,
    /// The scenario that the factors vary.
    #[schema(value_type = Object)]
    pub base: Value,
    /// How levels are combined to design points.
    pub design: Design,
    /// The factors. May be left out with `csv`: each column is then a factor.
    #[serde(default)]
    pub factors: Vec<Factor>,
    /// Jobs per design point, each with its own seed.
    #[serde(default = "one")]
    pub replicates: u32,
    /// Parameters that replicates draw from the posterior of a calibration.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub posterior: Option<PosteriorDraws>,
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
    /// Simulated time between recorded frames, in seconds; no frames unless given.
    #[serde(default)]
    pub frame_interval_s: Option<f64>,
    /// Whether cached results may be used.
    #[serde(default = "crate::job::default_cache")]
    pub cache: Cache,
    /// Whether runs may start from a filled state that another run left, and leave their own. No result depends on it.
    #[serde(default = "crate::job::default_shared_fill")]
    pub shared_fill: bool,
}

/// Parameters that runs draw from samples of a posterior: either of a study, or given as `parameters` and `samples`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct PosteriorDraws {
    /// A study with the goal `calibrate`. The server fills in the samples of its answer, as it is at that moment.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub study: Option<SweepId>,
    /// JSON pointers of the parameters.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub parameters: Option<Vec<String>>,
    /// Samples: a value for each parameter, in the units of the fields.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub samples: Option<Vec<Vec<f64>>>,
    /// Replicates in a row that have the same sample, with different seeds; 2 unless given. Runs of a study choose theirs by their seeds.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 1)]
    pub runs_per_sample: Option<u32>,
}

fn one() -> u32 {
    1
}

/// Number of jobs in each state.
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
    /// The number of jobs in a state.
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

/// Number of failed jobs of each class.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct FailureCounts {
    /// The solver refused the scenario.
    pub invalid: u64,
    /// The simulation diverged.
    pub unstable: u64,
    /// No worker could run them.
    pub worker: u64,
    /// Their leases expired.
    pub lost: u64,
    /// Stopped after `max_wall_s`.
    pub timeout: u64,
}

impl FailureCounts {
    /// The number of failed jobs of a class.
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
    /// Kind of its design.
    pub design: DesignKind,
    /// Number of design points.
    pub points: u32,
    /// Replicates of each design point.
    pub replicates: u32,
    /// Replicates in a row that have the same parameters, if these come from a posterior; null in any other sweep.
    #[serde(default)]
    pub runs_per_sample: Option<u32>,
    /// Names of its factors, each the pointer of the factor's first field.
    pub factors: Vec<String>,
    /// Its jobs by state.
    pub counts: StateCounts,
    /// Its paused jobs, which also count as queued or running.
    #[serde(default)]
    pub paused: u64,
    /// Its failed jobs by class.
    #[serde(default)]
    pub failures: FailureCounts,
    /// Estimated share of the work that is done, with running jobs, 0 to 1.
    pub fraction: f64,
    /// When it was submitted.
    #[schema(value_type = String, format = DateTime)]
    pub submitted_at: Timestamp,
    /// Whether it belongs to a study, which has the same identifier.
    #[serde(default)]
    pub is_study: bool,
}

/// The data that the deletion of a sweep removes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct Deletion {
    /// Whether this is a dry run, which deletes nothing.
    pub dry_run: bool,
    /// Design points.
    pub points: u64,
    /// Jobs.
    pub jobs: u64,
    /// Jobs that have not ended. While there are any, nothing is deleted.
    pub unended: u64,
    /// Attempts of the jobs.
    pub attempts: u64,
    /// Results, which no later submission can use.
    pub results: u64,
    /// Size of the frames, in bytes.
    pub frames_bytes: u64,
}
