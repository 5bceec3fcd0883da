//! Jobs: one scenario each, from submission to result.
//!
//! ```text
//!            claim              result
//!  queued ──────────▶ running ─────────▶ succeeded
//!    ▲  ╲                │  ╲ failure, no retry left
//!    │   ╲ cancel        │   ╰─────────▶ failed
//!    │    ╲              │ cancel
//!    │     ╰─────────────┴─────────────▶ cancelled
//!    ├── lost lease, retried failure, release (from running)
//!    ╰── retry (from failed or cancelled)
//!  queued ──▶ succeeded: from the cache, without an attempt
//! ```

use std::collections::BTreeMap;

use roost_solver::result::Progress;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};
use utoipa::ToSchema;
use utoipa::openapi::schema::{Object, ObjectBuilder, Type};

use crate::frames::FramesView;
use crate::ids::{JobId, SweepId, WorkerId};
use crate::time::Timestamp;

/// Labels that a document has at most.
pub const MAX_LABELS: usize = 64;

/// The longest name, and the longest key or value of a label, in bytes of UTF-8.
pub const MAX_NAME_BYTES: usize = 256;

/// The largest magnitude of a priority that a token with the scope `submit` may ask for. Claims look at each priority that queued jobs
/// have, so their number is bounded too.
pub const MAX_SUBMIT_PRIORITY: u32 = 100;

/// Declares an enum of words that are the same in JSON, SQL and text.
macro_rules! words {
    ($(#[doc = $doc:literal])* $name:ident { $($(#[$variant_doc:meta])* $variant:ident = $word:literal),* $(,)? }) => {
        $(#[doc = $doc])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
        pub enum $name {
            $($(#[$variant_doc])* #[serde(rename = $word)] $variant),*
        }

        impl $name {
            /// Every value.
            pub const ALL: &'static [Self] = &[$(Self::$variant),*];

            /// The word in JSON, SQL and text.
            pub fn as_str(self) -> &'static str {
                match self { $(Self::$variant => $word),* }
            }
        }

        // Not derived: utoipa does not see words that come out of a macro, and would tell the variants' names.
        impl utoipa::PartialSchema for $name {
            fn schema() -> utoipa::openapi::RefOr<utoipa::openapi::schema::Schema> {
                let doc = [$($doc),*].map(str::trim).join(" ");
                utoipa::openapi::schema::ObjectBuilder::new()
                    .schema_type(utoipa::openapi::schema::Type::String)
                    .description(Some(doc))
                    .enum_values(Some(Self::ALL.iter().map(|value| value.as_str())))
                    .into()
            }
        }

        impl ToSchema for $name {}

        impl std::fmt::Display for $name {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.pad(self.as_str())
            }
        }

        impl std::str::FromStr for $name {
            type Err = String;

            fn from_str(text: &str) -> Result<Self, String> {
                Self::ALL.iter().copied().find(|value| value.as_str() == text).ok_or_else(|| {
                    let words: Vec<_> = Self::ALL.iter().map(|value| value.as_str()).collect();
                    format!("`{text}` is not one of {}", words.join(", "))
                })
            }
        }
    };
}
pub(crate) use words;

words!(
    /// The state of a job; the diagram stands above.
    JobState {
        /// Waits for a worker.
        Queued = "queued",
        /// An attempt holds its lease.
        Running = "running",
        /// Its result is recorded.
        Succeeded = "succeeded",
        /// It failed and will not be tried again by itself.
        Failed = "failed",
        /// Somebody cancelled it.
        Cancelled = "cancelled",
    }
);

impl JobState {
    /// Whether the job will not change any more by itself.
    pub fn is_ended(self) -> bool {
        matches!(self, Self::Succeeded | Self::Failed | Self::Cancelled)
    }
}

words!(
    /// Why a job failed: users rerun by class.
    FailureClass {
        /// The solver refused the scenario.
        Invalid = "invalid",
        /// The physics diverged; the partial result is kept.
        Unstable = "unstable",
        /// The worker could not run it; tried again elsewhere.
        Worker = "worker",
        /// The lease expired; tried again.
        Lost = "lost",
        /// It ran longer than `max_wall_s`.
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
        /// See [`FailureClass::Lost`]: decided by the server, never reported.
        Lost = "lost",
        /// See [`FailureClass::Timeout`].
        Timeout = "timeout",
        /// Handed back unharmed by a worker that drains: back to the queue, counted against nobody.
        Released = "released",
        /// Ended at the server's request.
        Cancelled = "cancelled",
    }
);

words!(
    /// Whether a result of the same physics may be taken from the store.
    Cache {
        /// It may.
        Use = "use",
        /// Run it all the same.
        Bypass = "bypass",
    }
);

/// What a job needs of a worker.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Needs {
    /// Name of the backend, such as `cpu`, of at most 256 bytes; any when null.
    #[schema(max_length = 256)]
    pub backend: Option<String>,
    /// Memory of its device, in MiB; any when null.
    pub memory_mib: Option<u32>,
}

/// A job as submitted: an envelope, so that the digest covers the physics alone.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct JobEnvelope {
    /// The scenario document.
    #[schema(value_type = Object)]
    pub scenario: Value,
    /// Higher is claimed first; outside -100 to 100 it takes a token with the scope `admin`.
    #[serde(default)]
    pub priority: i32,
    /// Free labels, at most 64 with keys and values of at most 256 bytes.
    #[serde(default)]
    #[schema(schema_with = labels_schema)]
    pub labels: BTreeMap<String, String>,
    /// What the job needs of a worker.
    #[serde(default)]
    pub needs: Needs,
    /// Longest wall time of an attempt, in seconds.
    #[serde(default)]
    pub max_wall_s: Option<f64>,
    /// Simulated time from frame to frame that are recorded, in seconds; without it none are.
    #[serde(default)]
    pub frame_interval_s: Option<f64>,
    /// Whether the result may come from the store.
    #[serde(default = "default_cache")]
    pub cache: Cache,
}

/// The schema of labels. JSON Schema counts characters: what it allows may still have too many bytes.
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

/// A job as the API shows it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct JobView {
    /// Its identifier.
    pub id: JobId,
    /// Its state.
    pub state: JobState,
    /// A running job whose cancel is on its way.
    pub cancelling: bool,
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
    /// Higher is claimed first.
    pub priority: i32,
    /// Its labels, or those of its sweep.
    pub labels: BTreeMap<String, String>,
    /// Number of its newest attempt; 0 before the first.
    pub attempt: u32,
    /// The worker of its newest attempt.
    pub worker_id: Option<WorkerId>,
    /// How far the running attempt has come.
    #[schema(value_type = Option<Object>)]
    pub progress: Option<Progress>,
    /// A queued job that has failed before: not to be claimed before then.
    #[schema(value_type = Option<String>, format = DateTime)]
    pub retry_at: Option<Timestamp>,
    /// Whether it runs alone, since it was lost together with others.
    pub alone: bool,
    /// Why it failed.
    pub failure_class: Option<FailureClass>,
    /// Why it failed, in words.
    pub failure_message: Option<String>,
    /// Whether the result came from the store without an attempt.
    pub from_cache: bool,
    /// Frames of its newest attempt, if it recorded some.
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
