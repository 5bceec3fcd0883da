//! The worker's side of a job: claim, heartbeat, result, failure. Every write is fenced by job + attempt.

use std::collections::BTreeMap;
use std::ops::Range;

use roost_solver::result::{Progress, RunResult};
use serde::{Deserialize, Serialize};
use serde_json::Value;
use utoipa::ToSchema;
use utoipa::openapi::schema::{Object, ObjectBuilder, Type};
use uuid::Uuid;

use crate::checkpoint::{CheckpointOrder, CheckpointView};
use crate::fill::FillOrder;
use crate::frames::FramesOrder;
use crate::ids::{JobId, WorkerId};
use crate::job::{AttemptOutcome, FilledBy};
use crate::problem::Problem;
use crate::solver_documents::{ProgressSchema, RunResultSchema};
use crate::time::Timestamp;

/// Maximum of jobs in one claim: enough for a batch of a device.
pub const MAX_CLAIMED_JOBS: u32 = 64;

/// Maximum of results in one request.
pub const MAX_RESULTS: usize = 64;

/// Maximum time that a claim may wait, in seconds.
pub const MAX_CLAIM_WAIT_S: f64 = 86_400.0;

/// A worker's request for jobs.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct ClaimRequest {
    /// Identifier of the claim: a repeat after a lost reply returns the same attempts.
    pub request_id: Uuid,
    /// The worker.
    pub worker_id: WorkerId,
    /// Maximum of jobs.
    #[schema(schema_with = max_jobs)]
    pub max_jobs: u32,
    /// Time that the server waits for work before it answers without any, in seconds.
    #[schema(schema_with = wait_s)]
    pub wait_s: f64,
    /// Whether the worker starts from stored fills and uploads those that it computes. Jobs with a fill that a running attempt computes
    /// are then passed over.
    #[serde(default)]
    pub shares_fills: bool,
}

fn max_jobs() -> Object {
    ObjectBuilder::new()
        .schema_type(Type::Integer)
        .minimum(Some(1))
        .maximum(Some(MAX_CLAIMED_JOBS))
        .description(Some("Maximum of jobs."))
        .build()
}

fn wait_s() -> Object {
    ObjectBuilder::new()
        .schema_type(Type::Number)
        .minimum(Some(0))
        .maximum(Some(MAX_CLAIM_WAIT_S))
        .description(Some("Time that the server waits for work before it answers without any, in seconds."))
        .build()
}

/// The answer to a claim.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub struct ClaimReply {
    /// The attempts now leased to the worker; empty when there is no work.
    pub attempts: Vec<ClaimedAttempt>,
}

/// A leased execution of a job.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub struct ClaimedAttempt {
    /// The job.
    pub job_id: JobId,
    /// Number of the attempt, from 1; it fences every write.
    pub attempt: u32,
    /// The scenario with all defaults.
    #[schema(value_type = Object)]
    pub scenario: Value,
    /// Maximum wall time, in seconds.
    pub max_wall_s: Option<f64>,
    /// The frames to record, if any.
    #[serde(default)]
    pub frames: Option<FramesOrder>,
    /// The checkpoints to record, if any.
    #[serde(default)]
    pub checkpoints: Option<CheckpointOrder>,
    /// The checkpoint to continue from. It is from the same solver revision, backend and device as the worker.
    #[serde(default)]
    pub checkpoint: Option<CheckpointView>,
    /// Whether the run may start from a filled state that another run left, and leave its own.
    #[serde(default = "crate::job::default_shared_fill")]
    pub shared_fill: bool,
    /// The fill that the job shares with others; null if it shares none, or if the claim did not say `shares_fills`.
    #[serde(default)]
    pub fill: Option<FillOrder>,
    /// End of the lease, unless it is renewed.
    #[schema(value_type = String, format = DateTime)]
    pub lease_expires_at: Timestamp,
}

/// The heartbeat of a worker, for all its attempts.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct HeartbeatRequest {
    /// Every attempt that the worker holds.
    pub attempts: Vec<AttemptBeat>,
}

/// The heartbeat of one attempt.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct AttemptBeat {
    /// The job.
    pub job_id: JobId,
    /// Number of the attempt.
    pub attempt: u32,
    /// Its progress.
    #[schema(value_type = Option<ProgressSchema>)]
    pub progress: Option<Progress>,
    /// Simulated time of t = 0, in seconds; null until it is known.
    #[serde(default)]
    pub t0_s: Option<f64>,
    /// New samples, or the first of many. The server ignores samples that it has.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub samples: Vec<SeriesPart>,
}

/// Consecutive samples of one series. Samples are only appended: a recorded sample never changes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct SeriesPart {
    /// Name of the series.
    pub name: String,
    /// Its unit.
    pub unit: String,
    /// Number of samples before these.
    pub from: u64,
    /// Simulated times since the beginning of the run, in seconds. Belt time is simulated time minus `t0_s`.
    pub t_s: Vec<f64>,
    /// The samples, as many.
    pub values: Vec<f64>,
}

impl SeriesPart {
    /// The samples of a range of places within this part.
    ///
    /// # Panics
    /// If the range ends after the last sample.
    pub fn slice(&self, places: Range<usize>) -> Self {
        Self {
            name: self.name.clone(),
            unit: self.unit.clone(),
            from: self.from + places.start as u64,
            t_s: self.t_s[places.clone()].to_vec(),
            values: self.values[places].to_vec(),
        }
    }
}

/// The answer to a heartbeat.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub struct HeartbeatReply {
    /// A directive for each attempt, in the order of the request.
    pub attempts: Vec<AttemptDirective>,
    /// Whether the worker must claim no more jobs.
    pub drain: bool,
}

/// The server's directive for one attempt.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub struct AttemptDirective {
    /// The job.
    pub job_id: JobId,
    /// Number of the attempt.
    pub attempt: u32,
    /// The directive.
    pub directive: Directive,
    /// End of the renewed lease; null unless `continue`.
    #[schema(value_type = Option<String>, format = DateTime)]
    pub lease_expires_at: Option<Timestamp>,
    /// Series whose earlier samples the server lacks, with the number that it has: continue from there.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub missing_samples: BTreeMap<String, u64>,
    /// Whether `missing_samples` has entries. Older workers read this field, and send all samples again.
    #[serde(default)]
    pub resend_samples: bool,
}

/// A directive for one attempt.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Directive {
    /// Continue: the lease is renewed.
    Continue,
    /// Stop and report `cancelled` with the partial series.
    Cancel,
    /// Stop, upload a checkpoint, and report `preempted`; without a stored checkpoint, report `released`.
    Preempt,
    /// Stop without a report: the attempt is stale.
    Abandon,
}

/// The result of an attempt. Repeating the delivery is safe.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct ResultDelivery {
    /// The worker that ran it.
    pub worker_id: WorkerId,
    /// The result document.
    #[schema(value_type = RunResultSchema)]
    pub result: RunResult,
    /// Where its filled state came from, if it shares one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub filled_by: Option<FilledBy>,
}

/// Results of several attempts in one request. Each is recorded or refused on its own.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct ResultsDelivery {
    /// The results, from 1 to 64.
    #[schema(min_items = 1, max_items = 64)]
    pub results: Vec<AttemptResult>,
}

/// The result of one of several attempts.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct AttemptResult {
    /// The job.
    pub job_id: JobId,
    /// Number of the attempt.
    pub attempt: u32,
    /// Its result.
    pub delivery: ResultDelivery,
}

/// The answer to results of several attempts.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub struct ResultsReply {
    /// An answer for each result, in the order of the request.
    pub answers: Vec<ResultAnswer>,
}

/// The answer to the result of one attempt.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub struct ResultAnswer {
    /// The job.
    pub job_id: JobId,
    /// Number of the attempt.
    pub attempt: u32,
    /// Whether this request recorded it; false for a repeat of a recorded result, and for a refused one.
    pub recorded: bool,
    /// Why it was refused; null unless it was.
    pub problem: Option<Problem>,
}

/// The report of an attempt that ended without a result. Repeating it is safe.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct FailureReport {
    /// The worker that ran it.
    pub worker_id: WorkerId,
    /// Outcome: `invalid`, `unstable`, `worker`, `timeout`, `released`, `preempted` or `cancelled`.
    pub outcome: AttemptOutcome,
    /// The reason in words.
    pub message: String,
    /// The partial result of an unstable, cancelled or timed out run.
    #[serde(default)]
    #[schema(value_type = Option<RunResultSchema>)]
    pub result: Option<RunResult>,
}
