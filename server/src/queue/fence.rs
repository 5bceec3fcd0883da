//! The fence: whether a write of an attempt still counts.
//!
//! An attempt is stale only when a newer one was claimed or the job has ended. If its lease expired but nobody has claimed
//! the job since, it may still send heartbeats and results.

use roost_api::ids::WorkerId;
use roost_api::job::{AttemptOutcome, JobState};

use super::{AttemptSnapshot, JobSnapshot, Refusal};

/// Whether an attempt may write.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum FenceState {
    /// It may write. Its lease may have expired; the job is then in the queue.
    Current,
    /// It has ended by its own report. Only a repeat of that report is accepted.
    Ended(AttemptOutcome),
    /// It may not write.
    Stale(Refusal),
}

/// Checks a write of `worker` to `attempt` of `job`.
pub(crate) fn fence(job: &JobSnapshot, attempt: &AttemptSnapshot, worker: WorkerId) -> FenceState {
    if attempt.worker_id != worker {
        return FenceState::Stale(Refusal::OtherWorker);
    }
    match attempt.outcome {
        Some(outcome) if outcome != AttemptOutcome::Lost => FenceState::Ended(outcome),
        _ if attempt.number < job.attempt => FenceState::Stale(Refusal::Superseded { newest: job.attempt }),
        _ if matches!(job.state, JobState::Queued | JobState::Running) => FenceState::Current,
        _ => FenceState::Stale(Refusal::JobEnded { state: job.state }),
    }
}
