//! The worker's side of a job: claim, heartbeat, result, failure. Every write is fenced by job + attempt.

use roost_solver::result::{Progress, RunResult};
use serde::{Deserialize, Serialize};
use serde_json::Value;
use utoipa::ToSchema;
use utoipa::openapi::schema::{Object, ObjectBuilder, Type};
use uuid::Uuid;

use crate::frames::FramesOrder;
use crate::ids::{JobId, WorkerId};
use crate::job::AttemptOutcome;
use crate::time::Timestamp;

/// Jobs that one claim takes at most: a batch of a device, not the whole queue.
pub const MAX_CLAIMED_JOBS: u32 = 64;

/// The longest time that a claim may ask to wait, in seconds.
pub const MAX_CLAIM_WAIT_S: f64 = 86_400.0;

/// A worker asks for work.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct ClaimRequest {
    /// A repeat with the same id, after a lost reply, returns the same attempts.
    pub request_id: Uuid,
    /// Who asks.
    pub worker_id: WorkerId,
    /// At most this many jobs.
    #[schema(schema_with = max_jobs)]
    pub max_jobs: u32,
    /// Wait this long for work before answering with none, in seconds.
    #[schema(schema_with = wait_s)]
    pub wait_s: f64,
}

fn max_jobs() -> Object {
    ObjectBuilder::new()
        .schema_type(Type::Integer)
        .minimum(Some(1))
        .maximum(Some(MAX_CLAIMED_JOBS))
        .description(Some("At most this many jobs."))
        .build()
}

fn wait_s() -> Object {
    ObjectBuilder::new()
        .schema_type(Type::Number)
        .minimum(Some(0))
        .maximum(Some(MAX_CLAIM_WAIT_S))
        .description(Some("Wait this long for work before answering with none, in seconds."))
        .build()
}

/// What a claim got.
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
    /// The scenario as run, every default written out.
    #[schema(value_type = Object)]
    pub scenario: Value,
    /// Longest wall time, in seconds.
    pub max_wall_s: Option<f64>,
    /// The frames that it is to record, if any.
    #[serde(default)]
    pub frames: Option<FramesOrder>,
    /// When the lease ends unless renewed.
    #[schema(value_type = String, format = DateTime)]
    pub lease_expires_at: Timestamp,
}

/// One heartbeat covers everything a worker runs.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct HeartbeatRequest {
    /// Every attempt the worker holds.
    pub attempts: Vec<AttemptBeat>,
}

/// A sign of life of one attempt.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct AttemptBeat {
    /// The job.
    pub job_id: JobId,
    /// Number of the attempt.
    pub attempt: u32,
    /// How far it has come.
    #[schema(value_type = Option<Object>)]
    pub progress: Option<Progress>,
    /// What it has sampled since, or some of it.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub samples: Vec<SeriesPart>,
}

/// Samples of one series, one after the other.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct SeriesPart {
    /// Name of the series.
    pub name: String,
    /// Its unit.
    pub unit: String,
    /// Samples before these; what was there from here on is replaced.
    pub from: u64,
    /// Belt times, in seconds.
    pub t_s: Vec<f64>,
    /// The samples, as many.
    pub values: Vec<f64>,
}

/// The answer to a heartbeat.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub struct HeartbeatReply {
    /// One row an attempt, in the order of the request.
    pub attempts: Vec<AttemptDirective>,
    /// The worker shall claim nothing more.
    pub drain: bool,
}

/// What the worker shall do with one attempt.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub struct AttemptDirective {
    /// The job.
    pub job_id: JobId,
    /// Number of the attempt.
    pub attempt: u32,
    /// What to do.
    pub directive: Directive,
    /// When the lease now ends; null unless `continue`.
    #[schema(value_type = Option<String>, format = DateTime)]
    pub lease_expires_at: Option<Timestamp>,
    /// The samples that came before these are not there: send all of them again.
    #[serde(default)]
    pub resend_samples: bool,
}

/// What the worker shall do with one attempt.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Directive {
    /// Go on: the lease is renewed.
    Continue,
    /// Stop and report `cancelled` with the partial series.
    Cancel,
    /// Stop and say nothing: the attempt is stale.
    Abandon,
}

/// A finished attempt delivers its result. Repeating it is safe.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct ResultDelivery {
    /// The worker that ran it.
    pub worker_id: WorkerId,
    /// The result document.
    #[schema(value_type = Object)]
    pub result: RunResult,
}

/// An attempt ended without the job's result. Repeating it is safe.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct FailureReport {
    /// The worker that ran it.
    pub worker_id: WorkerId,
    /// How it ended: `invalid`, `unstable`, `worker`, `timeout`, `released` or `cancelled`.
    pub outcome: AttemptOutcome,
    /// What happened, in words.
    pub message: String,
    /// The partial result of an unstable, cancelled or timed out run.
    #[serde(default)]
    #[schema(value_type = Option<Object>)]
    pub result: Option<RunResult>,
}
