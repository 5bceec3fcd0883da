//! Cancel, pause, resume and retry of one job, or of all jobs of a sweep.

use roost_api::ids::{JobId, SweepId};
use roost_api::job::{FailureClass, JobState};
use roost_api::time::Timestamp;
use sqlx::{AssertSqlSafe, SqliteConnection};

use super::columns::Columns;
use super::writer::SLICE;
use super::{Store, StoreError};
use crate::queue::{CancelEffect, Refusal, on_cancel, on_retry};

const JOB_EXISTS: &str = "SELECT EXISTS (SELECT 1 FROM jobs WHERE id = ?)";
const SWEEP_EXISTS: &str = "SELECT EXISTS (SELECT 1 FROM sweeps WHERE id = ? AND state = 'ready')";

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
                    cancel(tx, Scope::Job(id), now).await?;
                    Ok(Ok(()))
                })
            })
            .await
    }

    /// Cancels the jobs of a sweep that have not ended, in slices: other writes wait for one of them at most.
    pub(crate) async fn cancel_sweep(
        &self,
        id: SweepId,
        now: Timestamp,
    ) -> Result<Result<(), Refusal>, StoreError> {
        loop {
            let slice = self.writer.write(move |tx| {
                Box::pin(async move {
                    if !exists(tx, SWEEP_EXISTS, id.to_string()).await? {
                        return Ok(Err(Refusal::NoSweep));
                    }
                    cancel(tx, Scope::Sweep(id), now).await.map(Ok)
                })
            });
            match slice.await? {
                Ok(cancelled) if cancelled == SLICE as u64 => {}
                // The last slice has left no job that is queued, and has asked for the end of all running ones.
                other => return Ok(other.map(drop)),
            }
        }
    }

    /// Pauses or resumes a job. An ended job does not change.
    pub(crate) async fn pause_job(&self, id: JobId, pause: bool) -> Result<Result<(), Refusal>, StoreError> {
        self.writer
            .write(move |tx| {
                Box::pin(async move {
                    if !exists(tx, JOB_EXISTS, id.to_string()).await? {
                        return Ok(Err(Refusal::NoJob));
                    }
                    set_paused(tx, Scope::Job(id), pause, 0).await?;
                    Ok(Ok(()))
                })
            })
            .await
    }

    /// Pauses or resumes the jobs of a sweep that have not ended, in slices.
    pub(crate) async fn pause_sweep(
        &self,
        id: SweepId,
        pause: bool,
    ) -> Result<Result<(), Refusal>, StoreError> {
        let mut last_seq = 0;
        loop {
            let slice = self.writer.write(move |tx| {
                Box::pin(async move {
                    if !exists(tx, SWEEP_EXISTS, id.to_string()).await? {
                        return Ok(Err(Refusal::NoSweep));
                    }
                    set_paused(tx, Scope::Sweep(id), pause, last_seq).await.map(Ok)
                })
            });
            match slice.await? {
                Ok(Some(seq)) => last_seq = seq,
                other => return Ok(other.map(drop)),
            }
        }
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
                    requeue(tx, Scope::Job(id), state, class, Requeued::default()).await?;
                    Ok(Ok(()))
                })
            })
            .await
    }

    /// Queues the failed and cancelled jobs of a sweep again, in slices. Returns their number.
    pub(crate) async fn retry_sweep(
        &self,
        id: SweepId,
        class_filter: Option<FailureClass>,
    ) -> Result<Result<u64, Refusal>, StoreError> {
        let classes = FailureClass::ALL.iter().map(|class| (JobState::Failed, Some(*class)));
        let others = JobState::ALL.iter().filter(|state| **state != JobState::Failed);
        let (mut done, mut exists) = (Requeued::default(), false);
        for (state, class) in classes.chain(others.map(|state| (*state, None))) {
            if on_retry(state, class, class_filter).is_err() {
                continue;
            }
            // By number: a job that fails again meanwhile is not queued twice.
            done.last_seq = 0;
            let mut more = true;
            while more {
                let slice = self.writer.write(move |tx| {
                    Box::pin(async move {
                        if !self::exists(tx, SWEEP_EXISTS, id.to_string()).await? {
                            return Ok(None);
                        }
                        requeue(tx, Scope::Sweep(id), state, class, done).await.map(Some)
                    })
                });
                let Some(after) = slice.await? else { return Ok(Err(Refusal::NoSweep)) };
                more = after.jobs - done.jobs == SLICE as u64;
                (done, exists) = (after, true);
            }
        }
        if !exists && self.sweep_size(id).await?.is_none() {
            return Ok(Err(Refusal::NoSweep));
        }
        Ok(Ok(done.jobs))
    }
}

/// The jobs that a user changes.
#[derive(Clone, Copy)]
enum Scope {
    Job(JobId),
    Sweep(SweepId),
}

impl Scope {
    /// Its jobs in SQL, in the order of their state or of their number.
    fn jobs(self, is_by_state: bool) -> &'static str {
        match (self, is_by_state) {
            (Self::Job(_), _) => "jobs WHERE id = ?",
            (Self::Sweep(_), true) => "jobs INDEXED BY jobs_by_sweep WHERE sweep_id = ?",
            (Self::Sweep(_), false) => "jobs INDEXED BY jobs_of_sweep WHERE sweep_id = ?",
        }
    }

    fn id(self) -> String {
        match self {
            Self::Job(id) => id.to_string(),
            Self::Sweep(id) => id.to_string(),
        }
    }
}

async fn exists(tx: &mut SqliteConnection, sql: &'static str, id: String) -> Result<bool, StoreError> {
    Ok(sqlx::query_scalar(sql).bind(id).fetch_one(&mut *tx).await?)
}

/// Pauses or resumes jobs that have not ended, at most a slice of them, after those up to a number. Returns the highest number, if there
/// may be more.
async fn set_paused(
    tx: &mut SqliteConnection,
    scope: Scope,
    pause: bool,
    last_seq: i64,
) -> Result<Option<i64>, StoreError> {
    let jobs = scope.jobs(false);
    let sql = format!(
        "UPDATE jobs SET paused = ? WHERE seq IN (SELECT seq FROM {jobs} AND ended_at IS NULL AND seq > ? ORDER BY seq LIMIT ?)
         RETURNING seq"
    );
    let changed: Vec<i64> = sqlx::query_scalar(AssertSqlSafe(sql))
        .bind(pause)
        .bind(scope.id())
        .bind(last_seq)
        .bind(SLICE as i64)
        .fetch_all(&mut *tx)
        .await?;
    Ok(changed.iter().copied().max().filter(|_| changed.len() == SLICE))
}

/// Cancels queued jobs, at most a slice of them, and asks for the end of all running ones. Returns how many were cancelled.
async fn cancel(tx: &mut SqliteConnection, scope: Scope, now: Timestamp) -> Result<u64, StoreError> {
    let (jobs, mut cancelled) = (scope.jobs(true), 0);
    for state in JobState::ALL {
        let change = match on_cancel(*state) {
            CancelEffect::Cancel => "state = 'cancelled', not_before = NULL, paused = 0, ended_at = ?",
            CancelEffect::Request => "cancelling = 1",
            CancelEffect::Nothing => continue,
        };
        let sql =
            format!("UPDATE jobs SET {change} WHERE seq IN (SELECT seq FROM {jobs} AND state = ? LIMIT ?)");
        let mut query = sqlx::query(AssertSqlSafe(sql));
        let is_cancel = on_cancel(*state) == CancelEffect::Cancel;
        if is_cancel {
            query = query.bind(now.0);
        }
        let limit = if is_cancel { SLICE as i64 } else { -1 };
        let done = query.bind(scope.id()).bind(state.as_str()).bind(limit).execute(&mut *tx).await?;
        if is_cancel {
            cancelled += done.rows_affected();
        }
    }
    Ok(cancelled)
}

/// Jobs that were queued again.
#[derive(Clone, Copy, Default)]
struct Requeued {
    /// How many.
    jobs: u64,
    /// The highest number of those of one state and class.
    last_seq: i64,
}

/// Queues jobs of this state and class again, at most a slice of them, after those that are done. They get positions as if they were
/// submitted now: otherwise a large sweep would go before all others. Their owner stays the same.
async fn requeue(
    tx: &mut SqliteConnection,
    scope: Scope,
    state: JobState,
    class: Option<FailureClass>,
    done: Requeued,
) -> Result<Requeued, StoreError> {
    let jobs = scope.jobs(false);
    let sql = format!(
        "UPDATE jobs SET state = 'queued', attempts_before_retry = attempt, failure_class = NULL, failure_message = NULL,
                         ended_at = NULL,
                         queue_position = ? + again.place + coalesce((SELECT queue_position FROM fair_share
                             WHERE fair_share.priority = jobs.priority AND fair_share.owner = jobs.owner), 0)
         FROM (SELECT seq, row_number() OVER (PARTITION BY owner ORDER BY queue_position, seq) - 1 AS place
               FROM (SELECT seq, owner, queue_position FROM {jobs} AND state = ? AND failure_class IS ? AND seq > ?
                     ORDER BY seq LIMIT ?)) AS again
         WHERE jobs.seq = again.seq RETURNING jobs.seq"
    );
    let queued: Vec<i64> = sqlx::query_scalar(AssertSqlSafe(sql))
        .bind(done.jobs as i64)
        .bind(scope.id())
        .bind(state.as_str())
        .bind(class.map(FailureClass::as_str))
        .bind(done.last_seq)
        .bind(SLICE as i64)
        .fetch_all(&mut *tx)
        .await?;
    let last_seq = queued.iter().copied().max().unwrap_or(done.last_seq);
    Ok(Requeued { jobs: done.jobs + queued.len() as u64, last_seq })
}
