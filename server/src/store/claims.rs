//! Claims: jobs become attempts.

use roost_api::ids::WorkerId;
use roost_api::lease::ClaimedAttempt;
use sqlx::sqlite::SqliteRow;
use sqlx::{AssertSqlSafe, QueryBuilder, Sqlite, SqliteConnection};
use uuid::Uuid;

use super::rows::{Columns, to_json};
use super::{Store, StoreError};
use crate::clock::Now;
use crate::queue::{Holding, Refusal, batch, lease_end};

/// Jobs that suit worker ?1, in the order of the queue. The select walks `jobs_to_claim` and stops at its limit, whatever the
/// length of the queue; a test looks at the plan. A job that the worker has failed before goes to another one that has what it
/// needs and was heard of since ?2, if there is one.
pub(super) const CANDIDATES: &str = "SELECT j.seq, j.alone FROM workers me CROSS JOIN jobs j
    WHERE me.id = ?1 AND me.draining = 0 AND j.state = 'queued' AND j.not_before IS NULL
      AND (j.needs_backend IS NULL OR j.needs_backend = me.backend)
      AND (j.needs_memory_mib IS NULL OR j.needs_memory_mib <= me.memory_mib)
      AND (j.attempt = j.forgiven
           OR NOT EXISTS (SELECT 1 FROM attempts f WHERE f.job_id = j.id AND f.worker_id = ?1
                          AND f.outcome = 'worker' AND f.number > j.forgiven)
           OR NOT EXISTS (SELECT 1 FROM workers other WHERE other.last_seen_at >= ?2 AND other.draining = 0
                          AND (j.needs_backend IS NULL OR j.needs_backend = other.backend)
                          AND (j.needs_memory_mib IS NULL OR j.needs_memory_mib <= other.memory_mib)
                          AND NOT EXISTS (SELECT 1 FROM attempts f WHERE f.job_id = j.id
                                          AND f.worker_id = other.id AND f.outcome = 'worker'
                                          AND f.number > j.forgiven)))
    ORDER BY j.priority DESC, j.turn, j.seq LIMIT ?3";

/// Takes the jobs of a JSON list; no attempt outlives its `max_wall_s` by more than a lease.
const TAKE: &str = "UPDATE jobs
    SET state = 'running', attempt = attempt + 1, worker_id = ?1, lease_expires_at = ?2, started_at = ?3,
        deadline = ?2 + CAST(max_wall_s * 1000 AS INTEGER)
    WHERE seq IN (SELECT value FROM json_each(?4))
    RETURNING id, attempt, digest, max_wall_s, lease_expires_at, priority, turn, seq";

/// A worker asks for work.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Claim {
    pub(crate) request_id: Uuid,
    pub(crate) worker: WorkerId,
    pub(crate) max_jobs: u32,
    pub(crate) lease: std::time::Duration,
}

/// What it got.
#[derive(Debug, Default)]
pub(crate) struct Claimed {
    pub(crate) attempts: Vec<ClaimedAttempt>,
    /// There is work for it, which it may have once it holds nothing else.
    pub(crate) held_back: bool,
}

impl Claim {
    /// Workers that were heard of since then are there.
    fn alive_since(&self, now: Now) -> i64 {
        now.wall.0 - lease_end(roost_api::time::Timestamp(0), self.lease).0
    }
}

impl Store {
    /// Claims up to `max_jobs` jobs for the worker, or repeats what the same request claimed before.
    pub(crate) async fn claim(&self, claim: Claim, now: Now) -> Result<Result<Claimed, Refusal>, StoreError> {
        self.writer
            .write(move |tx| {
                Box::pin(async move {
                    let known = sqlx::query("UPDATE workers SET last_seen_at = ? WHERE id = ?")
                        .bind(now.wall.0)
                        .bind(claim.worker.to_string())
                        .execute(&mut *tx)
                        .await?;
                    if known.rows_affected() == 0 {
                        return Ok(Err(Refusal::NoWorker));
                    }
                    if let Some(attempts) = repeat(tx, claim, now).await? {
                        return Ok(Ok(Claimed { attempts, held_back: false }));
                    }
                    take(tx, claim, now).await.map(Ok)
                })
            })
            .await
    }

    /// Whether a claim would find a job, without troubling the writer.
    pub(crate) async fn has_work(&self, claim: Claim, now: Now) -> Result<bool, StoreError> {
        let found = sqlx::query(CANDIDATES)
            .bind(claim.worker.to_string())
            .bind(claim.alive_since(now))
            .bind(1)
            .fetch_optional(&self.readers)
            .await?;
        Ok(found.is_some())
    }
}

/// What the same request claimed before and still holds; `None` when it claimed nothing.
async fn repeat(
    tx: &mut SqliteConnection,
    claim: Claim,
    now: Now,
) -> Result<Option<Vec<ClaimedAttempt>>, StoreError> {
    let known: i64 =
        sqlx::query_scalar("SELECT count(*) FROM attempts WHERE request_id = ? AND worker_id = ?")
            .bind(claim.request_id.to_string())
            .bind(claim.worker.to_string())
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
    .bind(lease_end(now.lease, claim.lease).0)
    .bind(claim.request_id.to_string())
    .bind(claim.worker.to_string())
    .fetch_all(&mut *tx)
    .await?;
    with_scenarios(tx, rows).await.map(Some)
}

async fn take(tx: &mut SqliteConnection, claim: Claim, now: Now) -> Result<Claimed, StoreError> {
    let worker = claim.worker.to_string();
    let rows = sqlx::query(CANDIDATES)
        .bind(&worker)
        .bind(claim.alive_since(now))
        .bind(claim.max_jobs)
        .fetch_all(&mut *tx)
        .await?;
    if rows.is_empty() {
        return Ok(Claimed::default());
    }
    let candidates = rows.iter().map(|row| row.column("alone")).collect::<Result<Vec<bool>, _>>()?;
    let count = batch(holding(tx, &worker).await?, &candidates);
    if count == 0 {
        return Ok(Claimed { attempts: Vec::new(), held_back: true });
    }
    let seqs = rows[..count].iter().map(|row| row.column("seq")).collect::<Result<Vec<i64>, _>>()?;
    let rows = sqlx::query(TAKE)
        .bind(&worker)
        .bind(lease_end(now.lease, claim.lease).0)
        .bind(now.wall.0)
        .bind(to_json("jobs", &seqs)?)
        .fetch_all(&mut *tx)
        .await?;
    note_attempts(tx, &rows, &worker, claim.request_id, now).await?;
    Ok(Claimed { attempts: with_scenarios(tx, rows).await?, held_back: false })
}

async fn holding(tx: &mut SqliteConnection, worker: &str) -> Result<Holding, StoreError> {
    let sql = "SELECT count(*) AS jobs, coalesce(max(alone), 0) AS alone FROM jobs
               WHERE worker_id = ? AND state = 'running'";
    let row = sqlx::query(AssertSqlSafe(sql)).bind(worker).fetch_one(&mut *tx).await?;
    Ok(Holding { jobs: row.number("jobs")?, alone: row.column("alone")? })
}

/// Writes down who runs what from now on, and how far the queue has come.
async fn note_attempts(
    tx: &mut SqliteConnection,
    rows: &[SqliteRow],
    worker: &str,
    request_id: Uuid,
    now: Now,
) -> Result<(), StoreError> {
    let mut turns: Vec<(i64, i64)> = Vec::new();
    let mut attempts: Vec<(String, i64)> = Vec::new();
    for row in rows {
        turns.push((row.column("priority")?, row.column("turn")?));
        attempts.push((row.column("id")?, row.column("attempt")?));
    }
    let mut query = QueryBuilder::<Sqlite>::new(
        "INSERT INTO attempts (job_id, number, worker_id, request_id, claimed_at) ",
    );
    query.push_values(&attempts, |mut row, (job, number)| {
        row.push_bind(job)
            .push_bind(number)
            .push_bind(worker)
            .push_bind(request_id.to_string())
            .push_bind(now.wall.0);
    });
    query.build().execute(&mut *tx).await?;

    let mut query = QueryBuilder::<Sqlite>::new("INSERT INTO turns (priority, turn) ");
    query.push_values(&turns, |mut row, (priority, turn)| {
        row.push_bind(priority).push_bind(turn);
    });
    query.push(" ON CONFLICT (priority) DO UPDATE SET turn = max(turn, excluded.turn)");
    query.build().execute(&mut *tx).await?;
    Ok(())
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
