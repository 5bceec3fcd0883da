//! Snapshots that `queue` decides on, and the transitions that it decides.

use roost_api::ids::{JobId, WorkerId};
use roost_api::job::{AttemptOutcome, FilledBy, JobState};
use roost_api::time::Timestamp;
use serde_json::{Value, json};

use super::StoreError;
use super::columns::{Columns, to_json};
use super::database::{AssertSqlSafe, Connection, Row, query};
use crate::queue::{
    AttemptSnapshot, ChargedAttempt, FenceState, JobChange, JobSnapshot, Provenance, Refusal, Stated,
    core_ms, fence,
};

/// The number of attempts of a job, since it was last retried, with an outcome. A first attempt that runs has none before it.
macro_rules! attempts_with {
    ($outcome:literal) => {
        concat!(
            "CASE WHEN j.state = 'running' AND j.attempt = j.attempts_before_retry + 1 THEN 0 ELSE
                (SELECT count(*) FROM attempts f
                 WHERE f.job_id = j.id AND f.number > j.attempts_before_retry AND f.outcome = '",
            $outcome,
            "') END"
        )
    };
}

/// The columns of a [`JobSnapshot`]. The counts read only the few attempts of one job.
pub(super) const JOB_COLUMNS: &str = concat!(
    "j.id, j.state, j.cancelling, j.paused, j.attempt, j.failure_class, ",
    attempts_with!("worker"),
    " AS worker_failures, ",
    attempts_with!("lost"),
    " AS lost"
);

/// The columns of a [`ChargedAttempt`], of an attempt and its worker.
pub(super) const CHARGED_COLUMNS: &str =
    "a.claimed_at, w.last_seen_at, w.backend = 'cpu' AS on_cpu, w.threads, w.slots";

pub(super) fn job_snapshot(row: &Row) -> Result<JobSnapshot, StoreError> {
    Ok(JobSnapshot {
        id: row.parsed("id")?,
        state: row.parsed("state")?,
        cancelling: row.column("cancelling")?,
        paused: row.column("paused")?,
        attempt: row.number("attempt")?,
        worker_failures: row.number("worker_failures")?,
        lost: row.number("lost")?,
        failure_class: row.parsed_opt("failure_class")?,
    })
}

/// What an attempt is charged by; none without a worker.
pub(super) fn charged_attempt(row: &Row) -> Result<Option<ChargedAttempt>, StoreError> {
    let Some(on_cpu) = row.column("on_cpu")? else { return Ok(None) };
    let slots: Option<i64> = row.column("slots")?;
    Ok(Some(ChargedAttempt {
        claimed_at: row.moment("claimed_at")?,
        last_seen_at: row.moment("last_seen_at")?,
        on_cpu,
        threads: row.number("threads")?,
        slots: slots.and_then(|slots| u32::try_from(slots).ok()),
    }))
}

/// An attempt, and the worker that writes to it.
#[derive(Clone, Copy, Debug)]
pub(super) struct AttemptRef {
    pub(super) job: JobId,
    pub(super) attempt: u32,
    pub(super) worker: WorkerId,
}

/// A job, and whether one of its attempts may write.
pub(super) struct FencedAttempt {
    pub(super) job: JobSnapshot,
    /// Provenance that results of the attempt must have.
    pub(super) provenance: Provenance,
    pub(super) fence: FenceState,
    pub(super) charged: Option<ChargedAttempt>,
}

/// Checks writes to attempts, and answers in their order.
pub(super) async fn fence_attempts(
    tx: &mut Connection,
    attempts: &[AttemptRef],
) -> Result<Vec<Result<FencedAttempt, Refusal>>, StoreError> {
    let mut found: Vec<_> = attempts.iter().map(|_| Err(Refusal::NoJob)).collect();
    if attempts.is_empty() {
        return Ok(found);
    }
    let writes: Vec<_> = attempts.iter().map(|it| json!({"job": it.job, "attempt": it.attempt})).collect();
    let sql = format!(
        "SELECT CAST(write.key AS BIGINT) AS place, {JOB_COLUMNS}, j.scenario_digest, a.worker_id AS claimed_by, a.outcome,
                w.solver_revision, w.backend, w.device, {CHARGED_COLUMNS}
         FROM json_each(?) AS write CROSS JOIN jobs j ON j.id = write.value ->> 'job'
         LEFT JOIN attempts a ON a.job_id = j.id AND a.number = CAST(write.value ->> 'attempt' AS BIGINT)
         LEFT JOIN workers w ON w.id = a.worker_id"
    );
    let rows = query(AssertSqlSafe(sql)).bind(to_json("attempts", &writes)?).fetch_all(&mut *tx).await?;
    for row in &rows {
        let place = row.number::<u32>("place")? as usize;
        let Some(AttemptRef { attempt: number, worker, .. }) = attempts.get(place).copied() else { continue };
        found[place] = match row.parsed_opt("claimed_by")? {
            None => Err(Refusal::NoAttempt),
            Some(worker_id) => {
                let job = job_snapshot(row)?;
                let attempt = AttemptSnapshot { number, worker_id, outcome: row.parsed_opt("outcome")? };
                let provenance = Provenance {
                    scenario: row.column("scenario_digest")?,
                    revision: row.number("solver_revision")?,
                    backend: row.column("backend")?,
                    device: row.column("device")?,
                };
                let fence = fence(&job, &attempt, worker);
                Ok(FencedAttempt { provenance, fence, job, charged: charged_attempt(row)? })
            }
        };
    }
    Ok(found)
}

/// An attempt that may write.
pub(super) async fn fenced(
    connection: &mut Connection,
    job: JobId,
    attempt: u32,
    worker: WorkerId,
) -> Result<Result<FencedAttempt, Refusal>, StoreError> {
    let found = fence_attempts(connection, &[AttemptRef { job, attempt, worker }]).await?.pop();
    Ok(found.unwrap_or(Err(Refusal::NoJob)).and_then(|fenced| match fenced.fence {
        FenceState::Current => Ok(fenced),
        FenceState::Ended(outcome) => Err(Refusal::AttemptEnded { outcome }),
        FenceState::Stale(refusal) => Err(refusal),
    }))
}

/// The end of an attempt, and the change of its job.
pub(super) struct AttemptEnd<'a> {
    pub(super) job: JobId,
    pub(super) attempt: u32,
    pub(super) outcome: AttemptOutcome,
    pub(super) change: &'a JobChange,
    pub(super) message: Option<&'a str>,
    /// Digest of its partial result.
    pub(super) partial: Option<&'a str>,
    /// Where its filled state came from.
    pub(super) filled_by: Option<FilledBy>,
    /// Threads and wall time of the run, by its result.
    pub(super) stated: Option<Stated>,
    /// What it is charged by.
    pub(super) charged: Option<ChargedAttempt>,
    pub(super) at: Timestamp,
}

impl AttemptEnd<'_> {
    fn to_value(&self) -> Value {
        let core_ms = self.charged.map(|charged| core_ms(charged, self.stated, self.at));
        let (state, class) = match self.change {
            JobChange::Requeue { .. } => (JobState::Queued, None),
            JobChange::Succeed => (JobState::Succeeded, None),
            JobChange::Fail(class) => (JobState::Failed, Some(*class)),
            JobChange::Cancel => (JobState::Cancelled, None),
        };
        let (not_before, alone) = match self.change {
            JobChange::Requeue { not_before, alone } => (not_before.map(|then| then.0), *alone),
            _ => (None, false),
        };
        json!({
            "job": self.job, "attempt": self.attempt, "outcome": self.outcome.as_str(), "message": self.message,
            "partial": self.partial, "filled_by": self.filled_by.map(FilledBy::as_str), "core_ms": core_ms, "at": self.at.0, "state": state.as_str(), "not_before": not_before,
            "alone": u8::from(alone), "class": class.map(|class| class.as_str()),
            "why": class.and(self.message), "ended_at": state.is_ended().then_some(self.at.0),
        })
    }
}

/// Ends attempts of different jobs.
pub(super) async fn end_attempts(tx: &mut Connection, endings: &[AttemptEnd<'_>]) -> Result<(), StoreError> {
    if endings.is_empty() {
        return Ok(());
    }
    let endings: Vec<_> = endings.iter().map(AttemptEnd::to_value).collect();
    let endings = to_json("endings", &endings)?;
    query(END).bind(&endings).bind(&endings).execute(&mut *tx).await?;
    Ok(())
}

pub(super) const END: &str = "
    UPDATE attempts SET outcome = e.value ->> 'outcome', message = e.value ->> 'message',
                        partial_digest = e.value ->> 'partial', filled_by = e.value ->> 'filled_by',
                        core_ms = CAST(e.value ->> 'core_ms' AS BIGINT), ended_at = CAST(e.value ->> 'at' AS BIGINT)
    FROM json_each(?) AS e
    WHERE attempts.job_id = e.value ->> 'job' AND attempts.number = CAST(e.value ->> 'attempt' AS BIGINT);
    UPDATE jobs SET state = e.value ->> 'state', not_before = CAST(e.value ->> 'not_before' AS BIGINT),
                    alone = CASE WHEN CAST(e.value ->> 'alone' AS BIGINT) = 1 THEN 1 ELSE alone END, cancelling = 0, lease_expires_at = NULL,
                    paused = CASE WHEN e.value ->> 'ended_at' IS NULL THEN paused ELSE 0 END,
                    failure_class = e.value ->> 'class', failure_message = e.value ->> 'why',
                    ended_at = CAST(e.value ->> 'ended_at' AS BIGINT)
    FROM json_each(?) AS e WHERE jobs.id = e.value ->> 'job'";
