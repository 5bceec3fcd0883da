//! Events of event streams.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::ids::JobId;
use crate::job::{FailureClass, JobState};
use crate::time::Timestamp;

/// A change of a job.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct JobEvent {
    /// The job.
    pub job_id: JobId,
    /// Its new state.
    pub state: JobState,
    /// Number of its newest attempt.
    pub attempt: u32,
    /// Whether its cancellation was requested and is not complete.
    pub cancelling: bool,
    /// Whether it is paused.
    #[serde(default)]
    pub paused: bool,
    /// Why it failed, if it did.
    pub failure_class: Option<FailureClass>,
    /// Time of the change.
    #[schema(value_type = String, format = DateTime)]
    pub at: Timestamp,
}
