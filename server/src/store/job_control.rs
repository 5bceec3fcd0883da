//! Cancel, pause, resume and retry of one job, or of all jobs of a sweep.

use futures_util::TryStreamExt;
use roost_api::ids::{JobId, SweepId};
use roost_api::job::{FailureClass, JobState};
use roost_api::study::StudyState;
use roost_api::time::Timestamp;

use super::columns::{Columns, to_json};
use super::database::{AssertSqlSafe, Connection, Row, query, query_scalar};
use super::eligible_jobs::reached_position;
use super::writer::SLICE;
use super::{Store, StoreError};
use crate::queue::{CancelEffect, Refusal, on_cancel, on_retry};

/// A job, unless its sweep is hidden.
const JOB: &str = "SELECT seq, state, failure_class FROM jobs WHERE id = ?
    AND NOT EXISTS (SELECT 1 FROM sweeps WHERE sweeps.id = jobs.sweep_id AND sweeps.state <> 'ready')";
const SWEEP_EXISTS: &str = "SELECT EXISTS (SELECT 1 FROM sweeps WHERE id = ? AND state = 'ready')";

/// The jobs of a sweep that a pause or resume may change. A reader finds them, since a sweep has many other jobs.
pub(super) const UNENDED: &str = "SELECT seq FROM jobs INDEXED BY jobs_by_sweep
    WHERE sweep_id = ? AND state IN ('queued', 'running') AND paused <> ?";

/// The jobs of a sweep that a retry may queue again.
pub(super) const FAILED: &str = "SELECT seq, state, failure_class FROM jobs INDEXED BY jobs_by_sweep
    WHERE sweep_id = ? AND state IN ('failed', 'cancelled')";

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
                    if job(tx, id).await?.is_none() {
                        return Ok(Err(Refusal::NoJob));
                    }
                    cancel(tx, Scope::Job(id), now).await?;
                    Ok(Ok(()))
                })
            })
            .await
    }

    /// Cancels the jobs of a sweep that have not ended, and the study that would add further ones.
    pub(crate) async fn cancel_sweep(
        &self,
        id: SweepId,
        now: Timestamp,
    ) -> Result<Result<(), Refusal>, StoreError> {
        self.change_study(id, &[StudyState::Running, StudyState::Paused], StudyState::Cancelled, None)
            .await?;
        self.cancel_jobs(id, now).await
    }

    /// Cancels the jobs of a sweep that have not ended, in slices: other writes wait for one of them at most.
    async fn cancel_jobs(&self, id: SweepId, now: Timestamp) -> Result<Result<(), Refusal>, StoreError> {
        loop {
            let slice = self.writer.write(move |tx| {
                Box::pin(async move {
                    if !sweep_exists(tx, id).await? {
                        return Ok(Err(Refusal::NoSweep));
                    }
                    cancel(tx, Scope::Sweep(id), now).await.map(Ok)
                })
            });
            match slice.await? {
                Ok(changed) if changed == SLICE as u64 => {}
                // The last slice has left no job that is queued, and no running one without a request.
                other => return Ok(other.map(drop)),
            }
        }
    }

    /// Pauses or resumes a job. An ended job does not change.
    pub(crate) async fn pause_job(&self, id: JobId, pause: bool) -> Result<Result<(), Refusal>, StoreError> {
        self.writer
            .write(move |tx| {
                Box::pin(async move {
                    let Some(row) = job(tx, id).await? else { return Ok(Err(Refusal::NoJob)) };
                    set_paused(tx, &[row.column("seq")?], pause).await?;
                    Ok(Ok(()))
                })
            })
            .await
    }

    /// Pauses or resumes a sweep: the jobs that have not ended, and the study that adds further ones.
    pub(crate) async fn pause_sweep(
        &self,
        id: SweepId,
        pause: bool,
    ) -> Result<Result<(), Refusal>, StoreError> {
        if self.sweep_size(id).await?.is_none() {
            return Ok(Err(Refusal::NoSweep));
        }
        if pause {
            // First: no job is added while the others are paused.
            self.change_study(id, &[StudyState::Running], StudyState::Paused, None).await?;
            return self.pause_jobs(id, true).await;
        }
        let resumed = self.pause_jobs(id, false).await?;
        self.change_study(id, &[StudyState::Paused], StudyState::Running, None).await?;
        Ok(resumed)
    }

    /// Pauses or resumes the jobs of a sweep that have not ended, in slices.
    async fn pause_jobs(&self, id: SweepId, pause: bool) -> Result<Result<(), Refusal>, StoreError> {
        let sql = query_scalar(UNENDED).bind(id.to_string()).bind(pause);
        let mut unended: Vec<i64> = sql.fetch_all(&self.readers).await?;
        unended.sort_unstable();
        for slice in unended.chunks(SLICE) {
            let slice = slice.to_vec();
            let changed = self.writer.write(move |tx| {
                Box::pin(async move {
                    if !sweep_exists(tx, id).await? {
                        return Ok(Err(Refusal::NoSweep));
                    }
                    set_paused(tx, &slice, pause).await.map(Ok)
                })
            });
            if let Err(refusal) = changed.await? {
                return Ok(Err(refusal));
            }
        }
        Ok(Ok(()))
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
                    let Some(row) = job(tx, id).await? else { return Ok(Err(Refusal::NoJob)) };
                    let (state, class) = (row.parsed("state")?, row.parsed_opt("failure_class")?);
                    if let Err(refusal) = on_retry(state, class, class_filter) {
                        return Ok(Err(refusal));
                    }
                    requeue(tx, &[row.column("seq")?], class_filter, 0).await?;
                    Ok(Ok(()))
                })
            })
            .await
    }

    /// Queues the failed and cancelled jobs of a sweep again, in slices. Returns their number. Without a class of failures, a cancelled
    /// study goes on even if it has no such jobs: its runs may all have ended, or be those of clients.
    pub(crate) async fn retry_sweep(
        &self,
        id: SweepId,
        class_filter: Option<FailureClass>,
    ) -> Result<Result<u64, Refusal>, StoreError> {
        if self.sweep_size(id).await?.is_none() {
            return Ok(Err(Refusal::NoSweep));
        }
        // By number: a job that fails again meanwhile is not queued twice.
        let mut failed: Vec<i64> = Vec::new();
        let mut rows = query(FAILED).bind(id.to_string()).fetch(&self.readers);
        while let Some(row) = rows.try_next().await? {
            if is_retryable(&row, class_filter)? {
                failed.push(row.column("seq")?);
            }
        }
        drop(rows);
        failed.sort_unstable();
        let mut queued = 0;
        for slice in failed.chunks(SLICE) {
            let slice = slice.to_vec();
            let more = self.writer.write(move |tx| {
                Box::pin(async move {
                    if !sweep_exists(tx, id).await? {
                        return Ok(Err(Refusal::NoSweep));
                    }
                    requeue(tx, &slice, class_filter, queued).await.map(Ok)
                })
            });
            match more.await? {
                Ok(more) => queued += more,
                Err(refusal) => return Ok(Err(refusal)),
            }
        }
        if class_filter.is_none() {
            self.change_study(id, &[StudyState::Cancelled], StudyState::Running, None).await?;
        }
        Ok(Ok(queued))
    }
}

/// The jobs that a user cancels.
#[derive(Clone, Copy)]
enum Scope {
    Job(JobId),
    Sweep(SweepId),
}

impl Scope {
    /// Its jobs in SQL.
    fn jobs(self) -> &'static str {
        match self {
            Self::Job(_) => "jobs WHERE id = ?",
            Self::Sweep(_) => "jobs INDEXED BY jobs_by_sweep WHERE sweep_id = ?",
        }
    }

    fn id(self) -> String {
        match self {
            Self::Job(id) => id.to_string(),
            Self::Sweep(id) => id.to_string(),
        }
    }
}

async fn job(tx: &mut Connection, id: JobId) -> Result<Option<Row>, StoreError> {
    Ok(query(JOB).bind(id.to_string()).fetch_optional(&mut *tx).await?)
}

async fn sweep_exists(tx: &mut Connection, id: SweepId) -> Result<bool, StoreError> {
    Ok(query_scalar(SWEEP_EXISTS).bind(id.to_string()).fetch_one(&mut *tx).await?)
}

fn is_retryable(row: &Row, class_filter: Option<FailureClass>) -> Result<bool, StoreError> {
    Ok(on_retry(row.parsed("state")?, row.parsed_opt("failure_class")?, class_filter).is_ok())
}

/// Pauses or resumes those of these jobs that have not ended.
async fn set_paused(tx: &mut Connection, jobs: &[i64], pause: bool) -> Result<(), StoreError> {
    let sql = "UPDATE jobs SET paused = ?1 WHERE seq IN (SELECT CAST(atom AS BIGINT) FROM json_each(?2))
               AND ended_at IS NULL AND paused <> ?1";
    query(sql).bind(pause).bind(to_json("jobs", jobs)?).execute(&mut *tx).await?;
    Ok(())
}

/// Cancels queued jobs, and asks for the end of running ones, at most a slice of each. Returns the larger number.
async fn cancel(tx: &mut Connection, scope: Scope, now: Timestamp) -> Result<u64, StoreError> {
    let (jobs, mut changed) = (scope.jobs(), 0);
    for state in JobState::ALL {
        let (change, unless) = match on_cancel(*state) {
            CancelEffect::Cancel => ("state = 'cancelled', not_before = NULL, paused = 0, ended_at = ?", ""),
            CancelEffect::Request => ("cancelling = 1", "AND cancelling = 0"),
            CancelEffect::Nothing => continue,
        };
        let sql = format!(
            "UPDATE jobs SET {change} WHERE seq IN (SELECT seq FROM {jobs} AND state = ? {unless} LIMIT ?)"
        );
        let mut query = query(AssertSqlSafe(sql));
        if on_cancel(*state) == CancelEffect::Cancel {
            query = query.bind(now.0);
        }
        let query = query.bind(scope.id()).bind(state.as_str()).bind(SLICE as i64);
        changed = changed.max(query.execute(&mut *tx).await?.rows_affected());
    }
    Ok(changed)
}

/// Queues those of these jobs again that may be, after `before` others of the same sweep; returns how many. They get positions as if they
/// were submitted now: otherwise a large sweep would go before all others. Their owner stays the same.
async fn requeue(
    tx: &mut Connection,
    jobs: &[i64],
    class_filter: Option<FailureClass>,
    before: u64,
) -> Result<u64, StoreError> {
    let sql = "SELECT seq, state, failure_class FROM jobs WHERE seq IN (SELECT CAST(atom AS BIGINT) FROM json_each(?))";
    let rows = query(sql).bind(to_json("jobs", jobs)?).fetch_all(&mut *tx).await?;
    let mut again: Vec<i64> = Vec::with_capacity(rows.len());
    for row in &rows {
        if is_retryable(row, class_filter)? {
            again.push(row.column("seq")?);
        }
    }
    let sql = concat!(
        "
        UPDATE jobs SET state = 'queued', attempts_before_retry = attempt, failure_class = NULL, failure_message = NULL,
                        ended_at = NULL,
                        queue_position = ? + again.place + coalesce(",
        reached_position!("jobs.priority", "jobs.owner"),
        ", 0)
        FROM (SELECT seq, row_number() OVER (PARTITION BY owner ORDER BY queue_position, seq) - 1 AS place
              FROM jobs WHERE seq IN (SELECT CAST(atom AS BIGINT) FROM json_each(?))) AS again
        WHERE jobs.seq = again.seq"
    );
    let again = to_json("jobs", &again)?;
    // A study that had ended awaits the results of its jobs. A decision that is being made takes them for ended: the news refuse it.
    let study = "UPDATE studies SET news = news + 1, changes = changes + 1, finished = NULL,
                     state = CASE WHEN state IN ('finished', 'cancelled') THEN 'running' ELSE state END
                 WHERE sweep_id IN (SELECT sweep_id FROM jobs WHERE seq IN (SELECT CAST(atom AS BIGINT) FROM json_each(?)))";
    query(study).bind(&again).execute(&mut *tx).await?;
    let queued = query(sql).bind(before as i64).bind(&again).execute(&mut *tx).await?;
    Ok(queued.rows_affected())
}
