//! The fence: may a write of this attempt still count?
//!
//! An attempt is stale only when a newer one was claimed or the job has ended. One whose lease expired but
//! whose job nobody has claimed since may still beat and deliver: its work is good.

use roost_api::ids::WorkerId;
use roost_api::job::{AttemptOutcome, JobState};

use super::{AttemptFacts, JobFacts, Refusal};

/// Where an attempt stands.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Standing {
    /// It may write. Its lease may have expired, and the job then waits in the queue.
    Holds,
    /// It has ended by its own report: only a repeat of that report is answered.
    Ended(AttemptOutcome),
    /// It may not write.
    Stale(Refusal),
}

/// Where `attempt` of `job` stands when `worker` writes to it.
pub(crate) fn standing(job: &JobFacts, attempt: &AttemptFacts, worker: WorkerId) -> Standing {
    if attempt.worker_id != worker {
        return Standing::Stale(Refusal::OtherWorker);
    }
    match attempt.outcome {
        Some(outcome) if outcome != AttemptOutcome::Lost => Standing::Ended(outcome),
        _ if attempt.number < job.attempt => Standing::Stale(Refusal::Superseded { newest: job.attempt }),
        _ if matches!(job.state, JobState::Queued | JobState::Running) => Standing::Holds,
        _ => Standing::Stale(Refusal::JobEnded { state: job.state }),
    }
}
