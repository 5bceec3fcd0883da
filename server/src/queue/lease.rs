//! Leases: what a beat renews, and what becomes of a job whose lease or time ran out.

use roost_api::job::{FailureClass, JobState};
use roost_api::time::Timestamp;

use super::{JobChange, JobFacts, RetryPolicy, Standing};

/// What a beat of one attempt does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum BeatEffect {
    /// The lease now ends then; a job that was back in the queue runs again.
    Renew {
        /// When the lease ends.
        until: Timestamp,
        /// The worker shall stop and report `cancelled`.
        cancel: bool,
    },
    /// Nothing changes; the worker shall stop and say nothing.
    Abandon,
}

/// Decides on a beat of an attempt that stands so.
pub(crate) fn on_beat(job: &JobFacts, standing: Standing, until: Timestamp) -> BeatEffect {
    match standing {
        Standing::Holds => BeatEffect::Renew { until, cancel: job.cancelling },
        Standing::Ended(_) | Standing::Stale(_) => BeatEffect::Abandon,
    }
}

/// Decides on a running job at `now`: nothing while its lease lasts. One whose worker held others as well runs alone next time.
pub(crate) fn on_lease_expired(
    job: &JobFacts,
    lease_expires_at: Timestamp,
    had_company: bool,
    policy: RetryPolicy,
    now: Timestamp,
) -> Option<JobChange> {
    if job.state != JobState::Running || lease_expires_at > now {
        return None;
    }
    Some(if job.cancelling {
        JobChange::Cancel
    } else {
        let again = policy.lost.again(job, job.lost + 1, had_company, now);
        again.unwrap_or(JobChange::Fail(FailureClass::Lost))
    })
}

/// Decides on a running job at `now` whose worker should have stopped it at the deadline, and has not said so.
pub(crate) fn on_deadline(job: &JobFacts, deadline: Timestamp, now: Timestamp) -> Option<JobChange> {
    if job.state != JobState::Running || deadline > now {
        return None;
    }
    Some(if job.cancelling { JobChange::Cancel } else { JobChange::Fail(FailureClass::Timeout) })
}
