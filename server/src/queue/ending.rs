//! How an attempt ends by its worker's report, and what that does to the job.

use roost_api::job::{AttemptOutcome, FailureClass};
use roost_api::time::Timestamp;

use super::{JobChange, JobFacts, Refusal, RetryPolicy, Standing};

/// The answer to a report.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Verdict {
    /// It counts: the job changes so.
    Record(JobChange),
    /// It counted already: nothing changes.
    Repeat,
}

/// Decides on a delivered result. One that arrives while a cancel is on its way wins: the work is done.
pub(crate) fn on_result(standing: Standing) -> Result<Verdict, Refusal> {
    match standing {
        Standing::Holds => Ok(Verdict::Record(JobChange::Succeed)),
        Standing::Ended(AttemptOutcome::Succeeded) => Ok(Verdict::Repeat),
        Standing::Ended(outcome) => Err(Refusal::AttemptEnded { outcome }),
        Standing::Stale(refusal) => Err(refusal),
    }
}

/// Decides on a failure reported at `now` on the clock of leases.
pub(crate) fn on_failure(
    job: &JobFacts,
    standing: Standing,
    outcome: AttemptOutcome,
    policy: RetryPolicy,
    now: Timestamp,
) -> Result<Verdict, Refusal> {
    match standing {
        Standing::Holds => change_on(job, outcome, policy, now).map(Verdict::Record),
        Standing::Ended(before) if before == outcome => Ok(Verdict::Repeat),
        Standing::Ended(outcome) => Err(Refusal::AttemptEnded { outcome }),
        Standing::Stale(refusal) => Err(refusal),
    }
}

fn change_on(
    job: &JobFacts,
    outcome: AttemptOutcome,
    policy: RetryPolicy,
    now: Timestamp,
) -> Result<JobChange, Refusal> {
    Ok(match outcome {
        AttemptOutcome::Invalid => JobChange::Fail(FailureClass::Invalid),
        AttemptOutcome::Unstable => JobChange::Fail(FailureClass::Unstable),
        AttemptOutcome::Timeout => JobChange::Fail(FailureClass::Timeout),
        AttemptOutcome::Worker | AttemptOutcome::Released if job.cancelling => JobChange::Cancel,
        AttemptOutcome::Worker => policy
            .worker
            .again(job, job.worker_failures + 1, false, now)
            .unwrap_or(JobChange::Fail(FailureClass::Worker)),
        AttemptOutcome::Released => JobChange::Requeue { not_before: None, alone: false },
        AttemptOutcome::Cancelled if job.cancelling => JobChange::Cancel,
        // Nobody asked for it, and success and loss are not a worker's to report here.
        AttemptOutcome::Cancelled | AttemptOutcome::Succeeded | AttemptOutcome::Lost => {
            return Err(Refusal::NotReportable { outcome });
        }
    })
}
