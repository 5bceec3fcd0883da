//! What event streams carry.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::ids::JobId;
use crate::job::{FailureClass, JobState};
use crate::time::Timestamp;

/// Something happened to a job.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct JobEvent {
    /// Which.
    pub job_id: JobId,
    /// Its state since.
    pub state: JobState,
    /// Number of its newest attempt.
    pub attempt: u32,
    /// Whether a cancel is on its way.
    pub cancelling: bool,
    /// Why it failed, if it has.
    pub failure_class: Option<FailureClass>,
    /// When.
    #[schema(value_type = String, format = DateTime)]
    pub at: Timestamp,
}
