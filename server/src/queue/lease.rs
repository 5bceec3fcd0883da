//! Leases: the effect of heartbeats, of expired leases and of deadlines.

use roost_api::job::{FailureClass, JobState};
use roost_api::time::Timestamp;

use super::{FenceState, JobChange, JobSnapshot, RetryPolicy};

/// The effect of a heartbeat on one attempt.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum BeatEffect {
    /// The lease is renewed. A job that was back in the queue runs again.
    Renew {
        /// When the lease ends.
        until: Timestamp,
        /// Whether the worker is to stop.
        stop: Option<StopRequest>,
    },
    /// Nothing changes. The worker is to stop without a report.
    Abandon,
}

/// How a worker is to stop a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum StopRequest {
    /// Report `cancelled`: a user has cancelled the job.
    Cancel,
    /// Store a checkpoint and hand the job back: a user has paused it.
    Preempt,
}

/// Decides on a heartbeat. A cancel comes before a pause.
pub(crate) fn on_beat(job: &JobSnapshot, fence: FenceState, until: Timestamp) -> BeatEffect {
    match fence {
        FenceState::Current => {
            let stop = match (job.cancelling, job.paused) {
                (true, _) => Some(StopRequest::Cancel),
                (false, true) => Some(StopRequest::Preempt),
                (false, false) => None,
            };
            BeatEffect::Renew { until, stop }
        }
        FenceState::Ended(_) | FenceState::Stale(_) => BeatEffect::Abandon,
    }
}

/// Decides on a running job at `now`; none while its lease lasts. If its worker held other jobs too, it runs alone next time.
pub(crate) fn on_lease_expired(
    job: &JobSnapshot,
    lease_expires_at: Timestamp,
    had_others: bool,
    policy: RetryPolicy,
    now: Timestamp,
) -> Option<JobChange> {
    if job.state != JobState::Running || lease_expires_at > now {
        return None;
    }
    Some(if job.cancelling {
        JobChange::Cancel
    } else {
        let requeue = policy.lost.requeue(job, job.lost + 1, had_others, now);
        requeue.unwrap_or(JobChange::Fail(FailureClass::Lost))
    })
}

/// Decides on a running job at `now` whose worker has not reported by the deadline.
pub(crate) fn on_deadline(job: &JobSnapshot, deadline: Timestamp, now: Timestamp) -> Option<JobChange> {
    if job.state != JobState::Running || deadline > now {
        return None;
    }
    Some(if job.cancelling { JobChange::Cancel } else { JobChange::Fail(FailureClass::Timeout) })
}
