//! Jobs: one scenario each, from submission to result.
//!
//! ```text
//!            claim              result
//!  queued ──────────▶ running ─────────▶ succeeded
//!    ▲  ╲                │  ╲ failure, no retry left
//!    │   ╲ cancel        │   ╰─────────▶ failed
//!    │    ╲              │ cancel
//!    │     ╰─────────────┴─────────────▶ cancelled
//!    ├── lost lease, retried failure, release, preemption (from running)
//!    ╰── retry (from failed or cancelled)
//!  queued ──▶ succeeded: from the cache, without an attempt
//! ```
//!
//! A queued or running job can be paused. No worker claims a paused job; a running one is preempted.

use std::collections::BTreeMap;

use roost_solver::result::Progress;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};
use utoipa::ToSchema;
use utoipa::openapi::schema::{Object, ObjectBuilder, Type};

use crate::checkpoint::CheckpointView;
use crate::forecast::Waiting;
use crate::frames::FramesView;
use crate::ids::{JobId, SweepId, WorkerId};
use crate::solver_documents::ProgressSchema;
use crate::time::Timestamp;
use crate::words::words;

/// Maximum of labels in a document.
pub const MAX_LABELS: usize = 64;

/// Maximum length of a name, and of a key or value of a label, in bytes of UTF-8.
pub const MAX_NAME_BYTES: usize = 256;

/// Maximum magnitude of a priority with a token of the scope `submit`. It bounds the number of priorities, each of which a claim reads.
pub const MAX_SUBMIT_PRIORITY: u32 = 100;

words!(
    /// The state of a job.
    JobState {
        /// Waiting for a worker.
        Queued = "queued",
        /// Leased to an attempt.
        Running = "running",
        /// Its result is recorded.
        Succeeded = "succeeded",
        /// Failed, without another automatic attempt.
        Failed = "failed",
        /// Cancelled by a user.
        Cancelled = "cancelled",
    }
);

impl JobState {
    /// Whether the job has ended; only a retry changes its state again.
    pub fn is_ended(self) -> bool {
        matches!(self, Self::Succeeded | Self::Failed | Self::Cancelled)
    }
}

words!(
    /// Why a job failed. Retries can select a class.
    FailureClass {
        /// The solver refused the scenario.
        Invalid = "invalid",
        /// The simulation diverged; the partial result is kept.
        Unstable = "unstable",
        /// The worker could not run it; another worker retries it.
        Worker = "worker",
        /// The lease expired; it is retried.
        Lost = "lost",
        /// The wall time exceeded `max_wall_s`.
        Timeout = "timeout",
    }
);

words!(
    /// How an attempt ended.
    AttemptOutcome {
        /// It delivered the job's result.
        Succeeded = "succeeded",
        /// See [`FailureClass::Invalid`].
        Invalid = "invalid",
        /// See [`FailureClass::Unstable`].
        Unstable = "unstable",
        /// See [`FailureClass::Worker`].
        Worker = "worker",
        /// See [`FailureClass::Lost`]: set by the server, never reported by a worker.
        Lost = "lost",
        /// See [`FailureClass::Timeout`].
        Timeout = "timeout",
        /// Released by a worker that stops: the job returns to the queue, and the attempt does not count as a failure.
        Released = "released",
        /// Released like `released`, after its checkpoint was stored: the next attempt continues from there.
        Preempted = "preempted",
        /// Cancelled at the server's request.
        Cancelled = "cancelled",
    }
);

words!(
    /// Whether a cached result of an equal scenario may be used.
    Cache {
        /// Use a cached result.
        Use = "use",
        /// Always run the simulation.
        Bypass = "bypass",
    }
);

words!(
    /// Where the filled state of an attempt came from.
    FilledBy {
        /// The attempt filled by itself.
        Attempt = "attempt",
        /// An earlier run had filled: the attempt started from its state at t = 0.
        Shared = "shared",
    }
);

/// Requirements of a job on its worker.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Needs {
    /// Name of the backend, such as `cpu`, of at most 256 bytes; any when null.
    #[schema(max_length = 256)]
    pub backend: Option<String>,
    /// Memory of the device, in MiB; any when null.
    pub memory_mib: Option<u32>,
}

/// A submitted job. The scenario is a field of its own, so that its digest covers the physics alone.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct JobEnvelope {
    /// The scenario document.
    #[schema(value_type = Object)]
    pub scenario: Value,
    /// Jobs of higher priority are claimed first. Values outside -100 to 100 need a token with the scope `admin`.
    #[serde(default)]
    pub priority: i32,
    /// Free labels, at most 64 with keys and values of at most 256 bytes.
    #[serde(default)]
    #[schema(schema_with = labels_schema)]
    pub labels: BTreeMap<String, String>,
    /// Requirements on the worker.
    #[serde(default)]
    pub needs: Needs,
    /// Maximum wall time of an attempt, in seconds.
    #[serde(default)]
    pub max_wall_s: Option<f64>,
    /// Simulated time between recorded frames, in seconds; no frames unless given.
    #[serde(default)]
    pub frame_interval_s: Option<f64>,
    /// Whether a cached result may be used.
    #[serde(default = "default_cache")]
    pub cache: Cache,
    /// Whether the run may start from a filled state that another run left, and leave its own. No result depends on it.
    #[serde(default = "default_shared_fill")]
    pub shared_fill: bool,
}

/// The schema of labels. JSON Schema limits characters, not bytes: the server checks bytes as well.
pub(crate) fn labels_schema() -> Object {
    let text = || ObjectBuilder::new().schema_type(Type::String).max_length(Some(MAX_NAME_BYTES));
    let doc =
        format!("Free labels, at most {MAX_LABELS} with keys and values of at most {MAX_NAME_BYTES} bytes.");
    ObjectBuilder::new()
        .schema_type(Type::Object)
        .max_properties(Some(MAX_LABELS))
        .property_names(Some(text()))
        .additional_properties(Some(text()))
        .description(Some(doc))
        .build()
}

/// The default of [`JobEnvelope::cache`].
pub fn default_cache() -> Cache {
    Cache::Use
}

/// The default of [`JobEnvelope::shared_fill`].
pub fn default_shared_fill() -> bool {
    true
}

/// A job as the API shows it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct JobView {
    /// Its identifier.
    pub id: JobId,
    /// Its state.
    pub state: JobState,
    /// Whether its cancellation was requested and is not complete.
    pub cancelling: bool,
    /// Whether it is paused: no worker claims it. A running job is still being stopped.
    #[serde(default)]
    pub paused: bool,
    /// The sweep it belongs to.
    pub sweep_id: Option<SweepId>,
    /// Index of its design point in the sweep.
    pub point: Option<u32>,
    /// Replicate of the design point.
    pub replicate: Option<u32>,
    /// Levels of the factors at its design point, by JSON pointer.
    #[schema(value_type = Object)]
    pub factors: Map<String, Value>,
    /// Seed of its scenario.
    pub seed: u64,
    /// Digest of its scenario.
    pub scenario_digest: String,
    /// Jobs of higher priority are claimed first.
    pub priority: i32,
    /// The user whose token created it; null if unknown, as without tokens.
    #[serde(default)]
    pub user: Option<String>,
    /// The project of this token.
    #[serde(default)]
    pub project: String,
    /// Its labels, or those of its sweep.
    pub labels: BTreeMap<String, String>,
    /// Number of its newest attempt; 0 before the first.
    pub attempt: u32,
    /// The worker of its newest attempt.
    pub worker_id: Option<WorkerId>,
    /// Simulated time from which its newest attempt continues, in seconds; null if it began at zero.
    #[serde(default)]
    pub resumed_from_s: Option<f64>,
    /// Its newest checkpoint. It is deleted when the job ends.
    #[serde(default)]
    pub checkpoint: Option<CheckpointView>,
    /// Whether its run may start from a filled state that another run left, and leave its own.
    #[serde(default = "default_shared_fill")]
    pub shared_fill: bool,
    /// Where the filled state of its newest attempt came from; null until it has a result, and for runs that share none.
    #[serde(default)]
    pub filled_by: Option<FilledBy>,
    /// Progress of the running attempt.
    #[schema(value_type = Option<ProgressSchema>)]
    pub progress: Option<Progress>,
    /// Why it waits, while it is queued. Null in listings.
    #[serde(default)]
    pub waiting: Option<Waiting>,
    /// Earliest time of the next attempt of a failed job that is queued again.
    #[schema(value_type = Option<String>, format = DateTime)]
    pub retry_at: Option<Timestamp>,
    /// Whether it runs alone on a worker, because it was lost together with other jobs.
    pub alone: bool,
    /// Why it failed.
    pub failure_class: Option<FailureClass>,
    /// Why it failed, in words.
    pub failure_message: Option<String>,
    /// Whether the result is a cached one, without an attempt.
    pub from_cache: bool,
    /// Frames of its newest attempt, if any.
    pub frames: Option<FramesView>,
    /// Scalar results, once succeeded.
    #[schema(value_type = Object)]
    pub responses: Map<String, Value>,
    /// When it was submitted.
    #[schema(value_type = String, format = DateTime)]
    pub submitted_at: Timestamp,
    /// When its newest attempt was claimed.
    #[schema(value_type = Option<String>, format = DateTime)]
    pub started_at: Option<Timestamp>,
    /// When it ended.
    #[schema(value_type = Option<String>, format = DateTime)]
    pub ended_at: Option<Timestamp>,
}
