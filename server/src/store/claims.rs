//! Claims: jobs become attempts.

use roost_api::ids::WorkerId;
use roost_api::lease::ClaimedAttempt;
use roost_api::time::Timestamp;
use sqlx::sqlite::SqliteRow;
use sqlx::{QueryBuilder, Sqlite, SqliteConnection};
use uuid::Uuid;

use super::rows::Columns;
use super::{Store, StoreError};
use crate::queue::Refusal;

/// Takes the next jobs that suit the worker. The inner select walks `jobs_to_claim` in its order and stops
/// at the limit, whatever the length of the queue; a test looks at the plan.
pub(super) const CLAIM: &str = "UPDATE jobs
    SET state = 'running', attempt = attempt + 1, worker_id = ?1, lease_expires_at = ?2, started_at = ?3
    WHERE seq IN (
        SELECT seq FROM jobs
        WHERE state = 'queued' AND (needs_backend IS NULL OR needs_backend = ?4)
        ORDER BY priority DESC, turn, seq LIMIT ?5)
    RETURNING id, attempt, digest, max_wall_s, lease_expires_at, priority, turn, seq";

impl Store {
    /// Claims up to `max_jobs` jobs for the worker, or repeats what the same request claimed before.
    pub(crate) async fn claim(
        &self,
        request_id: Uuid,
        worker: WorkerId,
        max_jobs: u32,
        now: Timestamp,
        until: Timestamp,
    ) -> Result<Result<Vec<ClaimedAttempt>, Refusal>, StoreError> {
        self.writer
            .write(move |tx| {
                Box::pin(async move {
                    let backend: Option<String> = sqlx::query_scalar(
                        "UPDATE workers SET last_seen_at = ? WHERE id = ? RETURNING backend",
                    )
                    .bind(now.0)
                    .bind(worker.to_string())
                    .fetch_optional(&mut *tx)
                    .await?;
                    let Some(backend) = backend else { return Ok(Err(Refusal::NoWorker)) };
                    if let Some(before) = repeat(tx, request_id, worker, until).await? {
                        return Ok(Ok(before));
                    }
                    claim(tx, request_id, worker, &backend, max_jobs, now, until).await.map(Ok)
                })
            })
            .await
    }
}

/// What the same request claimed before and still holds; `None` when it claimed nothing.
async fn repeat(
    tx: &mut SqliteConnection,
    request_id: Uuid,
    worker: WorkerId,
    until: Timestamp,
) -> Result<Option<Vec<ClaimedAttempt>>, StoreError> {
    let known: i64 =
        sqlx::query_scalar("SELECT count(*) FROM attempts WHERE request_id = ? AND worker_id = ?")
            .bind(request_id.to_string())
            .bind(worker.to_string())
            .fetch_one(&mut *tx)
            .await?;
    if known == 0 {
        return Ok(None);
    }
    let rows = sqlx::query(
        "UPDATE jobs SET lease_expires_at = ?
         FROM attempts a
         WHERE a.request_id = ? AND a.worker_id = ? AND a.outcome IS NULL
           AND jobs.id = a.job_id AND jobs.attempt = a.number AND jobs.state = 'running'
         RETURNING id, attempt, digest, max_wall_s, lease_expires_at, priority, turn, seq",
    )
    .bind(until.0)
    .bind(request_id.to_string())
    .bind(worker.to_string())
    .fetch_all(&mut *tx)
    .await?;
    with_scenarios(tx, rows).await.map(Some)
}

async fn claim(
    tx: &mut SqliteConnection,
    request_id: Uuid,
    worker: WorkerId,
    backend: &str,
    max_jobs: u32,
    now: Timestamp,
    until: Timestamp,
) -> Result<Vec<ClaimedAttempt>, StoreError> {
    let rows = sqlx::query(CLAIM)
        .bind(worker.to_string())
        .bind(until.0)
        .bind(now.0)
        .bind(backend)
        .bind(max_jobs)
        .fetch_all(&mut *tx)
        .await?;
    if rows.is_empty() {
        return Ok(Vec::new());
    }
    let mut turns: Vec<(i64, i64)> = Vec::new();
    let mut attempts: Vec<(String, i64)> = Vec::new();
    for row in &rows {
        turns.push((row.column("priority")?, row.column("turn")?));
        attempts.push((row.column("id")?, row.column("attempt")?));
    }
    let mut query = QueryBuilder::<Sqlite>::new(
        "INSERT INTO attempts (job_id, number, worker_id, request_id, claimed_at) ",
    );
    query.push_values(&attempts, |mut row, (job, number)| {
        row.push_bind(job)
            .push_bind(number)
            .push_bind(worker.to_string())
            .push_bind(request_id.to_string())
            .push_bind(now.0);
    });
    query.build().execute(&mut *tx).await?;

    let mut query = QueryBuilder::<Sqlite>::new("INSERT INTO turns (priority, turn) ");
    query.push_values(&turns, |mut row, (priority, turn)| {
        row.push_bind(priority).push_bind(turn);
    });
    query.push(" ON CONFLICT (priority) DO UPDATE SET turn = max(turn, excluded.turn)");
    query.build().execute(&mut *tx).await?;
    with_scenarios(tx, rows).await
}

/// Claimed rows as the worker gets them, in the order of the queue (`RETURNING` has none).
async fn with_scenarios(
    tx: &mut SqliteConnection,
    rows: Vec<SqliteRow>,
) -> Result<Vec<ClaimedAttempt>, StoreError> {
    let mut ordered = Vec::with_capacity(rows.len());
    for row in rows {
        let priority: i64 = row.column("priority")?;
        ordered.push(((-priority, row.column::<i64>("turn")?, row.column::<i64>("seq")?), row));
    }
    ordered.sort_by_key(|(key, _)| *key);
    let mut attempts = Vec::with_capacity(ordered.len());
    for (_, row) in ordered {
        let body: String = sqlx::query_scalar("SELECT body FROM scenarios WHERE digest = ?")
            .bind(row.column::<String>("digest")?)
            .fetch_one(&mut *tx)
            .await?;
        attempts.push(ClaimedAttempt {
            job_id: row.parsed("id")?,
            attempt: row.number("attempt")?,
            scenario: super::rows::from_json("scenario", &body)?,
            max_wall_s: row.column("max_wall_s")?,
            lease_expires_at: row.moment("lease_expires_at")?,
        });
    }
    Ok(attempts)
}
