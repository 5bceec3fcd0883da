//! Cancel, pause, resume and retry of one job, or of all jobs of a sweep.

use roost_api::ids::{JobId, SweepId};
use roost_api::job::{FailureClass, JobState};
use roost_api::time::Timestamp;
use sqlx::SqliteConnection;

use super::columns::Columns;
use super::{Store, StoreError};
use crate::queue::{CancelEffect, Refusal, on_cancel, on_retry};

const JOB_EXISTS: &str = "SELECT EXISTS (SELECT 1 FROM jobs WHERE id = ?)";
const SWEEP_EXISTS: &str = "SELECT EXISTS (SELECT 1 FROM sweeps WHERE id = ? AND deleting = 0)";

impl Store {
    /// Cancels a job. An ended job does not change.
    pub(crate) async fn cancel_job(
        &self,
        id: JobId,
        now: Timestamp,
    ) -> Result<Result<(), Refusal>, StoreError> {
        self.writer
            .write(move |tx| {
                Box::pin(async move {
                    if !exists(tx, JOB_EXISTS, id.to_string()).await? {
                        return Ok(Err(Refusal::NoJob));
                    }
                    cancel(tx, Some(id), None, now).await.map(Ok)
                })
            })
            .await
    }

    /// Cancels the jobs of a sweep that have not ended.
    pub(crate) async fn cancel_sweep(
        &self,
        id: SweepId,
        now: Timestamp,
    ) -> Result<Result<(), Refusal>, StoreError> {
        self.writer
            .write(move |tx| {
                Box::pin(async move {
                    if !exists(tx, SWEEP_EXISTS, id.to_string()).await? {
                        return Ok(Err(Refusal::NoSweep));
                    }
                    cancel(tx, None, Some(id), now).await.map(Ok)
                })
            })
            .await
    }

    /// Pauses or resumes a job. An ended job does not change.
    pub(crate) async fn pause_job(&self, id: JobId, pause: bool) -> Result<Result<(), Refusal>, StoreError> {
        self.writer
            .write(move |tx| {
                Box::pin(async move {
                    if !exists(tx, JOB_EXISTS, id.to_string()).await? {
                        return Ok(Err(Refusal::NoJob));
                    }
                    set_paused(
                        tx,
                        "UPDATE jobs SET paused = ? WHERE id = ? AND ended_at IS NULL",
                        pause,
                        id.to_string(),
                    )
                    .await
                    .map(Ok)
                })
            })
            .await
    }

    /// Pauses or resumes the jobs of a sweep that have not ended.
    pub(crate) async fn pause_sweep(
        &self,
        id: SweepId,
        pause: bool,
    ) -> Result<Result<(), Refusal>, StoreError> {
        self.writer
            .write(move |tx| {
                Box::pin(async move {
                    if !exists(tx, SWEEP_EXISTS, id.to_string()).await? {
                        return Ok(Err(Refusal::NoSweep));
                    }
                    let sql = "UPDATE jobs SET paused = ? WHERE sweep_id = ? AND ended_at IS NULL";
                    set_paused(tx, sql, pause, id.to_string()).await.map(Ok)
                })
            })
            .await
    }

    /// Queues a failed or cancelled job again, with new attempt limits.
    pub(crate) async fn retry_job(
        &self,
        id: JobId,
        class_filter: Option<FailureClass>,
    ) -> Result<Result<(), Refusal>, StoreError> {
        self.writer
            .write(move |tx| {
                Box::pin(async move {
                    let row = sqlx::query("SELECT state, failure_class FROM jobs WHERE id = ?")
                        .bind(id.to_string())
                        .fetch_optional(&mut *tx)
                        .await?;
                    let Some(row) = row else { return Ok(Err(Refusal::NoJob)) };
                    let (state, class) = (row.parsed("state")?, row.parsed_opt("failure_class")?);
                    if let Err(refusal) = on_retry(state, class, class_filter) {
                        return Ok(Err(refusal));
                    }
                    requeue(tx, Some(id), None, state, class).await?;
                    Ok(Ok(()))
                })
            })
            .await
    }

    /// Queues the failed and cancelled jobs of a sweep again. Returns their number.
    pub(crate) async fn retry_sweep(
        &self,
        id: SweepId,
        class_filter: Option<FailureClass>,
    ) -> Result<Result<u64, Refusal>, StoreError> {
        self.writer
            .write(move |tx| {
                Box::pin(async move {
                    if !exists(tx, SWEEP_EXISTS, id.to_string()).await? {
                        return Ok(Err(Refusal::NoSweep));
                    }
                    let classes = FailureClass::ALL.iter().map(|class| (JobState::Failed, Some(*class)));
                    let others = JobState::ALL.iter().filter(|state| **state != JobState::Failed);
                    let mut requeued = 0;
                    for (state, class) in classes.chain(others.map(|state| (*state, None))) {
                        if on_retry(state, class, class_filter).is_ok() {
                            requeued += requeue(tx, None, Some(id), state, class).await?;
                        }
                    }
                    Ok(Ok(requeued))
                })
            })
            .await
    }
}

async fn exists(tx: &mut SqliteConnection, sql: &'static str, id: String) -> Result<bool, StoreError> {
    Ok(sqlx::query_scalar(sql).bind(id).fetch_one(&mut *tx).await?)
}

async fn set_paused(
    tx: &mut SqliteConnection,
    sql: &'static str,
    pause: bool,
    id: String,
) -> Result<(), StoreError> {
    Ok(sqlx::query(sql).bind(pause).bind(id).execute(&mut *tx).await.map(drop)?)
}

/// Cancels one job, or those of a sweep.
async fn cancel(
    tx: &mut SqliteConnection,
    job: Option<JobId>,
    sweep: Option<SweepId>,
    now: Timestamp,
) -> Result<(), StoreError> {
    for state in JobState::ALL {
        let query = match on_cancel(*state) {
            CancelEffect::Cancel => sqlx::query(
                "UPDATE jobs SET state = 'cancelled', not_before = NULL, paused = 0, ended_at = ?
                 WHERE state = ? AND (id = ? OR sweep_id = ?)",
            )
            .bind(now.0),
            CancelEffect::Request => {
                sqlx::query("UPDATE jobs SET cancelling = 1 WHERE state = ? AND (id = ? OR sweep_id = ?)")
            }
            CancelEffect::Nothing => continue,
        };
        query
            .bind(state.as_str())
            .bind(job.map(|id| id.to_string()))
            .bind(sweep.map(|id| id.to_string()))
            .execute(&mut *tx)
            .await?;
    }
    Ok(())
}

/// Queues one job, or those of a sweep, again if they have this state and class. They get positions as if they were submitted now:
/// otherwise a large sweep would go before all others. Their owner stays the same.
async fn requeue(
    tx: &mut SqliteConnection,
    job: Option<JobId>,
    sweep: Option<SweepId>,
    state: JobState,
    class: Option<FailureClass>,
) -> Result<u64, StoreError> {
    let done = sqlx::query(
        "UPDATE jobs SET state = 'queued', attempts_before_retry = attempt, failure_class = NULL, failure_message = NULL,
                         ended_at = NULL,
                         queue_position = again.place + coalesce((SELECT queue_position FROM fair_share
                             WHERE fair_share.priority = jobs.priority AND fair_share.owner = jobs.owner), 0)
         FROM (SELECT seq, row_number() OVER (PARTITION BY owner ORDER BY queue_position, seq) - 1 AS place FROM jobs
               WHERE state = ? AND failure_class IS ? AND (id = ? OR sweep_id = ?)) AS again
         WHERE jobs.seq = again.seq",
    )
    .bind(state.as_str())
    .bind(class.map(|class| class.as_str()))
    .bind(job.map(|id| id.to_string()))
    .bind(sweep.map(|id| id.to_string()))
    .execute(&mut *tx)
    .await?;
    Ok(done.rows_affected())
}
