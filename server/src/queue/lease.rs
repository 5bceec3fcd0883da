//! Leases: what a beat renews, and what becomes of a job whose lease ran out.

use roost_api::job::{FailureClass, JobState};
use roost_api::time::Timestamp;

use super::{AttemptLimits, JobChange, JobFacts, Standing};

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

/// Decides on a running job at `now`: nothing while its lease lasts.
pub(crate) fn on_lease_expired(
    job: &JobFacts,
    lease_expires_at: Timestamp,
    limits: AttemptLimits,
    now: Timestamp,
) -> Option<JobChange> {
    if job.state != JobState::Running || lease_expires_at > now {
        return None;
    }
    Some(if job.cancelling {
        JobChange::Cancel
    } else if job.lost + 1 >= limits.lost {
        JobChange::Fail(FailureClass::Lost)
    } else {
        JobChange::Requeue
    })
}
