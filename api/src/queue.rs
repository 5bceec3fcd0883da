//! The depth of the queue, for programs that start workers on demand.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::forecast::DurationRange;
use crate::job::Needs;
use crate::time::Timestamp;

/// The depth of the queue.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct QueueDepth {
    /// Queued jobs that a worker could claim now: neither paused nor in a pause after a failure.
    pub queued: u64,
    /// Running jobs.
    pub running: u64,
    /// Both together: a target for scalers that count workers by jobs.
    pub total: u64,
    /// The queued jobs by their needs, the largest number first.
    pub by_needs: Vec<NeedsDepth>,
    /// When the server read the queue and the workers. It may be some seconds ago: workers that have registered since are not counted.
    #[schema(value_type = String, format = DateTime)]
    pub made_at: Timestamp,
}

/// The queued jobs with the same needs, and the workers that could claim them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct NeedsDepth {
    /// Requirements of the jobs on a worker.
    pub needs: Needs,
    /// Number of queued jobs; an estimate for sweeps of more than 1,000 jobs.
    pub jobs: u64,
    /// Online workers that have what they need.
    pub workers: u64,
    /// Jobs that these workers run at the same time.
    pub slots: u64,
    /// Slots without a job.
    pub free_slots: u64,
    /// Expected wall time of one of the jobs: true in about 80 % of the cases.
    pub job_time: DurationRange,
    /// Number of finished runs that the expectation rests on; 0 for the check's rough estimate.
    pub finished_runs: u64,
}
