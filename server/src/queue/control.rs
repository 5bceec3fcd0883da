//! What the owner of a job may do to it: cancel and retry.

use roost_api::job::{FailureClass, JobState};

use super::Refusal;

/// What a cancel does, by the state of the job.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum CancelEffect {
    /// The job is cancelled at once.
    Cancel,
    /// The worker hears of it with its next beat.
    Ask,
    /// The job has ended: what was recorded before the cancel stays.
    Nothing,
}

/// Decides on a cancel.
pub(crate) fn on_cancel(state: JobState) -> CancelEffect {
    match state {
        JobState::Queued => CancelEffect::Cancel,
        JobState::Running => CancelEffect::Ask,
        JobState::Succeeded | JobState::Failed | JobState::Cancelled => CancelEffect::Nothing,
    }
}

/// Decides on a retry; `wanted` narrows it to jobs that failed so.
pub(crate) fn on_retry(
    state: JobState,
    failure_class: Option<FailureClass>,
    wanted: Option<FailureClass>,
) -> Result<(), Refusal> {
    match (state, wanted) {
        (JobState::Failed | JobState::Cancelled, None) => Ok(()),
        (JobState::Failed, Some(_)) if failure_class == wanted => Ok(()),
        (JobState::Failed | JobState::Cancelled, Some(wanted)) => Err(Refusal::OtherClass { wanted }),
        (JobState::Queued | JobState::Running | JobState::Succeeded, _) => {
            Err(Refusal::NotRetryable { state })
        }
    }
}
