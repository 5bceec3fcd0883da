//! Cancel and retry by a user.

use roost_api::job::{FailureClass, JobState};

use super::Refusal;

/// The effect of a cancel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum CancelEffect {
    /// The job is cancelled at once.
    Cancel,
    /// The reply to the worker's next heartbeat requests it.
    Request,
    /// The job has ended; its result stays.
    Nothing,
}

/// Decides on a cancel.
pub(crate) fn on_cancel(state: JobState) -> CancelEffect {
    match state {
        JobState::Queued => CancelEffect::Cancel,
        JobState::Running => CancelEffect::Request,
        JobState::Succeeded | JobState::Failed | JobState::Cancelled => CancelEffect::Nothing,
    }
}

/// Decides on a retry. With `class_filter`, only jobs with this class of failure are retried.
pub(crate) fn on_retry(
    state: JobState,
    failure_class: Option<FailureClass>,
    class_filter: Option<FailureClass>,
) -> Result<(), Refusal> {
    match (state, class_filter) {
        (JobState::Failed | JobState::Cancelled, None) => Ok(()),
        (JobState::Failed, Some(_)) if failure_class == class_filter => Ok(()),
        (JobState::Failed | JobState::Cancelled, Some(wanted)) => Err(Refusal::OtherClass { wanted }),
        (JobState::Queued | JobState::Running | JobState::Succeeded, _) => {
            Err(Refusal::NotRetryable { state })
        }
    }
}
