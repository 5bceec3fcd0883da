//! Claims: jobs become attempts.

use roost_api::ids::WorkerId;
use roost_api::lease::ClaimedAttempt;
use sqlx::SqliteConnection;
use sqlx::sqlite::SqliteRow;
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

/// Takes the jobs of a JSON list, writes down who runs them from now on, and how far the queue has come; no attempt outlives its `max_wall_s` by more than a lease.
const TAKE: &str = "UPDATE jobs
    SET state = 'running', attempt = attempt + 1, worker_id = ?, lease_expires_at = ?, started_at = ?,
        deadline = ? + CAST(max_wall_s * 1000 AS INTEGER)
    WHERE seq IN (SELECT value FROM json_each(?))
    RETURNING id, attempt, max_wall_s, lease_expires_at, priority, turn, seq,
              (SELECT body FROM scenarios WHERE scenarios.digest = jobs.digest) AS scenario;
    INSERT INTO attempts (job_id, number, worker_id, request_id, claimed_at)
    SELECT id, attempt, worker_id, ?, ? FROM jobs WHERE seq IN (SELECT value FROM json_each(?));
    INSERT INTO turns (priority, turn)
    SELECT priority, max(turn) FROM jobs WHERE seq IN (SELECT value FROM json_each(?)) GROUP BY priority
    ON CONFLICT (priority) DO UPDATE SET turn = max(turn, excluded.turn)";

/// Notes that a worker was heard of, and asks what it holds and whether the request is a repeat.
const ARRIVE: &str = "UPDATE workers SET last_seen_at = ?1 WHERE id = ?2
    RETURNING EXISTS (SELECT 1 FROM attempts WHERE request_id = ?3 AND worker_id = ?2) AS repeated,
        (SELECT count(*) FROM jobs WHERE worker_id = ?2 AND state = 'running') AS jobs,
        (SELECT coalesce(max(alone), 0) FROM jobs WHERE worker_id = ?2 AND state = 'running') AS alone";

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
                    let row = sqlx::query(ARRIVE)
                        .bind(now.wall.0)
                        .bind(claim.worker.to_string())
                        .bind(claim.request_id.to_string())
                        .fetch_optional(&mut *tx)
                        .await?;
                    let Some(row) = row else { return Ok(Err(Refusal::NoWorker)) };
                    if row.column("repeated")? {
                        let attempts = repeat(tx, claim, now).await?;
                        return Ok(Ok(Claimed { attempts, held_back: false }));
                    }
                    let holding = Holding { jobs: row.number("jobs")?, alone: row.column("alone")? };
                    take(tx, claim, holding, now).await.map(Ok)
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

/// What the same request claimed before and still holds.
async fn repeat(
    tx: &mut SqliteConnection,
    claim: Claim,
    now: Now,
) -> Result<Vec<ClaimedAttempt>, StoreError> {
    let rows = sqlx::query(
        "UPDATE jobs SET lease_expires_at = ?
         FROM attempts a
         WHERE a.request_id = ? AND a.worker_id = ? AND a.outcome IS NULL
           AND jobs.id = a.job_id AND jobs.attempt = a.number AND jobs.state = 'running'
         RETURNING id, attempt, max_wall_s, lease_expires_at, priority, turn, seq,
                   (SELECT body FROM scenarios WHERE scenarios.digest = jobs.digest) AS scenario",
    )
    .bind(lease_end(now.lease, claim.lease).0)
    .bind(claim.request_id.to_string())
    .bind(claim.worker.to_string())
    .fetch_all(&mut *tx)
    .await?;
    in_order(rows)
}

async fn take(
    tx: &mut SqliteConnection,
    claim: Claim,
    holding: Holding,
    now: Now,
) -> Result<Claimed, StoreError> {
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
    let count = batch(holding, &candidates);
    if count == 0 {
        return Ok(Claimed { attempts: Vec::new(), held_back: true });
    }
    let seqs = rows[..count].iter().map(|row| row.column("seq")).collect::<Result<Vec<i64>, _>>()?;
    let (seqs, until) = (to_json("jobs", &seqs)?, lease_end(now.lease, claim.lease).0);
    let rows = sqlx::query(TAKE)
        .bind(&worker)
        .bind(until)
        .bind(now.wall.0)
        .bind(until)
        .bind(&seqs)
        .bind(claim.request_id.to_string())
        .bind(now.wall.0)
        .bind(&seqs)
        .bind(&seqs)
        .fetch_all(&mut *tx)
        .await?;
    Ok(Claimed { attempts: in_order(rows)?, held_back: false })
}

/// Claimed rows as the worker gets them, in the order of the queue (`RETURNING` has none).
fn in_order(rows: Vec<SqliteRow>) -> Result<Vec<ClaimedAttempt>, StoreError> {
    let mut ordered = Vec::with_capacity(rows.len());
    for row in rows {
        let priority: i64 = row.column("priority")?;
        ordered.push(((-priority, row.column::<i64>("turn")?, row.column::<i64>("seq")?), row));
    }
    ordered.sort_by_key(|(key, _)| *key);
    let attempt = |(_, row): ((i64, i64, i64), SqliteRow)| {
        Ok(ClaimedAttempt {
            job_id: row.parsed("id")?,
            attempt: row.number("attempt")?,
            scenario: row.json("scenario")?,
            max_wall_s: row.column("max_wall_s")?,
            lease_expires_at: row.moment("lease_expires_at")?,
        })
    };
    ordered.into_iter().map(attempt).collect()
}
