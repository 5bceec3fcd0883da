//! Decisions of the queue: synchronous, without IO, the clock an argument.
//!
//! The store reads the facts, asks here, and carries the answer out in the same transaction. `fence` says
//! whether a write of an attempt may count, `origin` whether a result is of its job and worker, `lease` what a beat and an expired lease mean, `ending` what
//! a delivery or a failure does to the job, `retry` when it is tried again, `turns` whose job is next, `batch` what a claim gets, `control`
//! what its owner may do to it.

mod batch;
mod control;
mod ending;
mod fence;
mod lease;
mod origin;
mod retry;
#[cfg(test)]
mod tests;
mod turns;

use std::time::Duration;

use roost_api::Fault;
use roost_api::ids::{JobId, WorkerId};
use roost_api::job::{AttemptOutcome, FailureClass, JobState};
use roost_api::time::Timestamp;

pub(crate) use batch::{Holding, Share, Wanted, share};
pub(crate) use control::{CancelEffect, on_cancel, on_retry};
pub(crate) use ending::{Verdict, on_failure, on_result};
pub(crate) use fence::{Standing, standing};
pub(crate) use lease::{BeatEffect, on_beat, on_deadline, on_lease_expired};
pub(crate) use origin::Origin;
pub use retry::{RetryPolicy, Tries};
pub(crate) use turns::{Candidate, Line, Owner, Rounds};

/// What the queue knows of a job when it decides.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct JobFacts {
    /// Which it is.
    pub id: JobId,
    /// Its state.
    pub state: JobState,
    /// Whether a cancel is on its way.
    pub cancelling: bool,
    /// Number of its newest attempt; 0 before the first.
    pub attempt: u32,
    /// Attempts since the last retry that ended as `worker`.
    pub worker_failures: u32,
    /// Attempts since the last retry that ended as `lost`.
    pub lost: u32,
    /// Why it failed.
    pub failure_class: Option<FailureClass>,
}

/// What the queue knows of an attempt when it decides.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct AttemptFacts {
    /// Its number.
    pub number: u32,
    /// Who claimed it.
    pub worker_id: WorkerId,
    /// How it ended, if it has.
    pub outcome: Option<AttemptOutcome>,
}

/// What happens to a job.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum JobChange {
    /// Back to the queue.
    Requeue {
        /// Not to be claimed before then, on the clock of leases.
        not_before: Option<Timestamp>,
        /// From now on it runs alone.
        alone: bool,
    },
    /// Its result is recorded.
    Succeed,
    /// It fails for good.
    Fail(FailureClass),
    /// It is cancelled.
    Cancel,
}

/// Why a request to change a job is refused. Nothing has changed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub(crate) enum Refusal {
    /// No such job.
    #[error("there is no job with this id")]
    NoJob,
    /// No such sweep.
    #[error("there is no sweep with this id")]
    NoSweep,
    /// No such attempt.
    #[error("the job has no attempt with this number")]
    NoAttempt,
    /// No such worker.
    #[error("the worker is not known here: register with POST /v1/workers first")]
    NoWorker,
    /// A repeated registration of another solver.
    #[error(
        "this id is registered with another solver revision, backend or device: register under a fresh id"
    )]
    OtherRegistration,
    /// A newer attempt was claimed.
    #[error("stale attempt: attempt {newest} of the job was claimed since")]
    Superseded {
        /// The newest attempt.
        newest: u32,
    },
    /// The job has ended without this attempt.
    #[error("stale attempt: the job is {state} already")]
    JobEnded {
        /// How it ended.
        state: JobState,
    },
    /// The attempt has ended in another way.
    #[error("stale attempt: it ended as {outcome} already")]
    AttemptEnded {
        /// How it ended.
        outcome: AttemptOutcome,
    },
    /// Somebody else's attempt.
    #[error("the attempt belongs to another worker")]
    OtherWorker,
    /// A result of another scenario than the job's.
    #[error("the result is of another scenario than the job's: its digest differs")]
    OtherScenario,
    /// A result of another solver than its worker registered: what differs.
    #[error("the result is not of the solver that its worker registered")]
    OtherSolver(Vec<Fault>),
    /// A failure report with an outcome that is not a worker's to report.
    #[error("`{outcome}` cannot be reported as a failure here")]
    NotReportable {
        /// What was reported.
        outcome: AttemptOutcome,
    },
    /// Only what failed or was cancelled can be retried.
    #[error("the job is {state}: only a failed or cancelled job can be retried")]
    NotRetryable {
        /// Its state.
        state: JobState,
    },
    /// The job failed for another reason than the one named.
    #[error("the job did not fail as {wanted}")]
    OtherClass {
        /// The class that was asked for.
        wanted: FailureClass,
    },
}

/// When a lease taken or renewed now ends.
pub(crate) fn lease_end(now: Timestamp, lease: Duration) -> Timestamp {
    now.plus_ms(i64::try_from(lease.as_millis()).unwrap_or(i64::MAX))
}
