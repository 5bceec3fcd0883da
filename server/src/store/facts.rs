//! The facts that `queue` decides on, and the changes it decides.

use roost_api::ids::{JobId, WorkerId};
use roost_api::job::{AttemptOutcome, JobState};
use roost_api::time::Timestamp;
use sqlx::sqlite::SqliteRow;
use sqlx::{AssertSqlSafe, SqliteConnection};

use super::StoreError;
use super::rows::Columns;
use crate::queue::{AttemptFacts, JobChange, JobFacts, Refusal, Standing, standing};

/// The columns of [`JobFacts`]; the counts look at the few attempts of one job.
pub(super) const JOB_FACTS: &str = "j.id, j.state, j.cancelling, j.attempt, j.failure_class,
    (SELECT count(*) FROM attempts f WHERE f.job_id = j.id AND f.number > j.forgiven AND f.outcome = 'worker')
        AS worker_failures,
    (SELECT count(*) FROM attempts f WHERE f.job_id = j.id AND f.number > j.forgiven AND f.outcome = 'lost')
        AS lost";

pub(super) fn job_facts(row: &SqliteRow) -> Result<JobFacts, StoreError> {
    Ok(JobFacts {
        id: row.parsed("id")?,
        state: row.parsed("state")?,
        cancelling: row.column("cancelling")?,
        attempt: row.number("attempt")?,
        worker_failures: row.number("worker_failures")?,
        lost: row.number("lost")?,
        failure_class: row.parsed_opt("failure_class")?,
    })
}

/// A job with one of its attempts, and where that attempt stands when `worker` writes to it.
pub(super) struct Fenced {
    pub(super) job: JobFacts,
    pub(super) digest: String,
    pub(super) standing: Standing,
}

/// Looks up an attempt that `worker` writes to.
pub(super) async fn fenced(
    tx: &mut SqliteConnection,
    job_id: JobId,
    number: u32,
    worker: WorkerId,
) -> Result<Result<Fenced, Refusal>, StoreError> {
    let sql = format!(
        "SELECT {JOB_FACTS}, j.digest, a.worker_id AS claimed_by, a.outcome
         FROM jobs j LEFT JOIN attempts a ON a.job_id = j.id AND a.number = ? WHERE j.id = ?"
    );
    let row = sqlx::query(AssertSqlSafe(sql))
        .bind(number)
        .bind(job_id.to_string())
        .fetch_optional(&mut *tx)
        .await?;
    let Some(row) = row else { return Ok(Err(Refusal::NoJob)) };
    let Some(worker_id) = row.parsed_opt("claimed_by")? else { return Ok(Err(Refusal::NoAttempt)) };
    let job = job_facts(&row)?;
    let attempt = AttemptFacts { number, worker_id, outcome: row.parsed_opt("outcome")? };
    Ok(Ok(Fenced { digest: row.column("digest")?, standing: standing(&job, &attempt, worker), job }))
}

/// How an attempt ended, and what that does to its job.
pub(super) struct Ending<'a> {
    pub(super) job: JobId,
    pub(super) attempt: u32,
    pub(super) outcome: AttemptOutcome,
    pub(super) change: &'a JobChange,
    pub(super) message: Option<&'a str>,
    /// Digest of what it came to.
    pub(super) partial: Option<&'a str>,
}

/// Carries an ending out.
pub(super) async fn end(
    tx: &mut SqliteConnection,
    ending: Ending<'_>,
    now: Timestamp,
) -> Result<(), StoreError> {
    let (state, class) = match ending.change {
        JobChange::Requeue { .. } => (JobState::Queued, None),
        JobChange::Succeed => (JobState::Succeeded, None),
        JobChange::Fail(class) => (JobState::Failed, Some(*class)),
        JobChange::Cancel => (JobState::Cancelled, None),
    };
    let (not_before, alone) = match ending.change {
        JobChange::Requeue { not_before, alone } => (not_before.map(|then| then.0), *alone),
        _ => (None, false),
    };
    sqlx::query(
        "UPDATE attempts SET outcome = ?, message = ?, partial = ?, ended_at = ? WHERE job_id = ? AND number = ?;
         UPDATE jobs SET state = ?, not_before = ?, alone = max(alone, ?), cancelling = 0, lease_expires_at = NULL,
                         failure_class = ?, failure_message = ?, ended_at = ?
         WHERE id = ?",
    )
    .bind(ending.outcome.as_str())
    .bind(ending.message)
    .bind(ending.partial)
    .bind(now.0)
    .bind(ending.job.to_string())
    .bind(ending.attempt)
    .bind(state.as_str())
    .bind(not_before)
    .bind(alone)
    .bind(class.map(|class| class.as_str()))
    .bind(class.and(ending.message))
    .bind(state.is_ended().then_some(now.0))
    .bind(ending.job.to_string())
    .execute(&mut *tx)
    .await?;
    Ok(())
}
