//! Decisions of the queue: synchronous, without IO, the clock an argument.
//!
//! The store reads snapshots, calls a decision, and applies it in the same transaction.
//!
//! | module | decision |
//! |---|---|
//! | `fence` | whether a write of an attempt still counts |
//! | `provenance` | whether a result belongs to its job and worker |
//! | `lease` | the effect of a heartbeat, an expired lease, a passed deadline |
//! | `ending` | the effect of a result or a failure report |
//! | `retry` | whether and when a job is tried again |
//! | `fair_share` | the order of the queue |
//! | `allocation` | the jobs of each claim |
//! | `charge` | what an ended attempt counts in the budget of its project |
//! | `control` | the effect of a cancel or a retry by a user |
//! | `waiting` | why a queued job waits |

mod allocation;
mod charge;
mod control;
mod ending;
mod fair_share;
mod fence;
mod lease;
mod provenance;
mod retry;
#[cfg(test)]
mod tests;
mod waiting;

use std::time::Duration;

use roost_api::Fault;
use roost_api::ids::{JobId, WorkerId};
use roost_api::job::{AttemptOutcome, FailureClass, JobState};
use roost_api::time::Timestamp;

pub(crate) use allocation::{Allocation, Demand, WorkerLoad, allocate};
pub(crate) use charge::{Attempt as ChargedAttempt, Stated, core_ms};
pub(crate) use control::{CancelEffect, on_cancel, on_retry};
pub(crate) use ending::{Verdict, on_failure, on_result, recorded_outcome};
pub(crate) use fair_share::{EligibleJob, Owner, OwnerQueue, Project, Rounds, Turn};
pub(crate) use fence::{FenceState, fence};
pub(crate) use lease::{BeatEffect, StopRequest, on_beat, on_deadline, on_lease_expired};
pub(crate) use provenance::Provenance;
pub use retry::{RetryLimit, RetryPolicy};
pub(crate) use waiting::{JobsBefore, QueuedJob, SpentBudget, WorkerSight, why_waiting};

/// The state of a job that decisions depend on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct JobSnapshot {
    /// Its identifier.
    pub id: JobId,
    /// Its state.
    pub state: JobState,
    /// Whether a cancel was requested and its worker has not confirmed it.
    pub cancelling: bool,
    /// Whether a user has paused it.
    pub paused: bool,
    /// Number of its newest attempt; 0 before the first.
    pub attempt: u32,
    /// Attempts since the last retry that ended as `worker`.
    pub worker_failures: u32,
    /// Attempts since the last retry that ended as `lost`.
    pub lost: u32,
    /// Class of its failure.
    pub failure_class: Option<FailureClass>,
}

/// The state of an attempt that decisions depend on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct AttemptSnapshot {
    /// Its number.
    pub number: u32,
    /// The worker that claimed it.
    pub worker_id: WorkerId,
    /// How it ended, if it has.
    pub outcome: Option<AttemptOutcome>,
}

/// A change of the state of a job.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum JobChange {
    /// Back to the queue.
    Requeue {
        /// Earliest time of the next claim, on the clock of leases.
        not_before: Option<Timestamp>,
        /// Whether it runs alone from now on.
        alone: bool,
    },
    /// Its result is recorded.
    Succeed,
    /// It fails without a retry.
    Fail(FailureClass),
    /// It is cancelled.
    Cancel,
}

/// The reason why a change of a job is refused. A refusal changes nothing.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub(crate) enum Refusal {
    /// No such job.
    #[error("there is no job with this id")]
    NoJob,
    /// No such sweep.
    #[error("there is no sweep with this id")]
    NoSweep,
    /// No such study.
    #[error("there is no study with this id")]
    NoStudy,
    /// No such attempt.
    #[error("the job has no attempt with this number")]
    NoAttempt,
    /// No such worker.
    #[error("the worker is not registered: register with POST /v1/workers first")]
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
    /// Another worker's attempt.
    #[error("the attempt belongs to another worker")]
    OtherWorker,
    /// A result of another scenario than the job's.
    #[error("the digest of the result's scenario differs from the job's")]
    OtherScenario,
    /// A result of another solver than its worker registered, with the differences.
    #[error("the result comes from another solver than the one its worker registered")]
    OtherSolver(Vec<Fault>),
    /// A failure report with an outcome that workers do not report.
    #[error("a worker cannot report `{outcome}` as a failure")]
    NotReportable {
        /// The reported outcome.
        outcome: AttemptOutcome,
    },
    /// Only a failed or cancelled job can be retried.
    #[error("the job is {state}: only a failed or cancelled job can be retried")]
    NotRetryable {
        /// Its state.
        state: JobState,
    },
    /// The job failed with another class than the requested one.
    #[error("the job did not fail as {wanted}")]
    OtherClass {
        /// The requested class.
        wanted: FailureClass,
    },
}

/// The end of a lease that is taken or renewed now.
pub(crate) fn lease_end(now: Timestamp, lease: Duration) -> Timestamp {
    now.plus_ms(i64::try_from(lease.as_millis()).unwrap_or(i64::MAX))
}
