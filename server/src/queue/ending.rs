//! The effect of a worker's report on attempt and job.

use roost_api::job::{AttemptOutcome, FailureClass};
use roost_api::time::Timestamp;

use super::{FenceState, JobChange, JobSnapshot, Refusal, RetryPolicy};

/// The decision on a report.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Verdict {
    /// It is recorded, and changes the job.
    Record(JobChange),
    /// It repeats a recorded report, and changes nothing.
    Repeat,
}

/// Decides on a delivered result. It wins over a cancel that the worker has not confirmed: the work is done.
pub(crate) fn on_result(fence: FenceState) -> Result<Verdict, Refusal> {
    match fence {
        FenceState::Current => Ok(Verdict::Record(JobChange::Succeed)),
        FenceState::Ended(AttemptOutcome::Succeeded) => Ok(Verdict::Repeat),
        FenceState::Ended(outcome) => Err(Refusal::AttemptEnded { outcome }),
        FenceState::Stale(refusal) => Err(refusal),
    }
}

/// Decides on a failure reported at `now` on the clock of leases.
pub(crate) fn on_failure(
    job: &JobSnapshot,
    fence: FenceState,
    outcome: AttemptOutcome,
    policy: RetryPolicy,
    now: Timestamp,
) -> Result<Verdict, Refusal> {
    match fence {
        FenceState::Current => change_on(job, outcome, policy, now).map(Verdict::Record),
        FenceState::Ended(before)
            if before == outcome || (is_handed_back(before) && is_handed_back(outcome)) =>
        {
            Ok(Verdict::Repeat)
        }
        FenceState::Ended(outcome) => Err(Refusal::AttemptEnded { outcome }),
        FenceState::Stale(refusal) => Err(refusal),
    }
}

/// The outcome to record: an attempt without a stored checkpoint is released, not preempted.
pub(crate) fn recorded_outcome(reported: AttemptOutcome, has_checkpoint: bool) -> AttemptOutcome {
    if reported == AttemptOutcome::Preempted && !has_checkpoint { AttemptOutcome::Released } else { reported }
}

fn is_handed_back(outcome: AttemptOutcome) -> bool {
    matches!(outcome, AttemptOutcome::Released | AttemptOutcome::Preempted)
}

fn change_on(
    job: &JobSnapshot,
    outcome: AttemptOutcome,
    policy: RetryPolicy,
    now: Timestamp,
) -> Result<JobChange, Refusal> {
    Ok(match outcome {
        AttemptOutcome::Invalid => JobChange::Fail(FailureClass::Invalid),
        AttemptOutcome::Unstable => JobChange::Fail(FailureClass::Unstable),
        AttemptOutcome::Timeout => JobChange::Fail(FailureClass::Timeout),
        AttemptOutcome::Worker | AttemptOutcome::Released | AttemptOutcome::Preempted if job.cancelling => {
            JobChange::Cancel
        }
        AttemptOutcome::Worker => policy
            .worker
            .requeue(job, job.worker_failures + 1, false, now)
            .unwrap_or(JobChange::Fail(FailureClass::Worker)),
        // No failure: it counts against no limit. A paused job waits in the queue.
        AttemptOutcome::Released | AttemptOutcome::Preempted => {
            JobChange::Requeue { not_before: None, alone: false }
        }
        AttemptOutcome::Cancelled if job.cancelling => JobChange::Cancel,
        // No cancel was requested, and success and loss are not failures that a worker reports.
        AttemptOutcome::Cancelled | AttemptOutcome::Succeeded | AttemptOutcome::Lost => {
            return Err(Refusal::NotReportable { outcome });
        }
    })
}
