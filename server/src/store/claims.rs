//! Claims: jobs become attempts, those of many workers in one go.

use std::collections::HashMap;
use std::sync::Arc;
use std::time::Duration;

use roost_api::frames::FramesOrder;
use roost_api::ids::WorkerId;
use roost_api::lease::ClaimedAttempt;
use serde_json::json;
use sqlx::SqliteConnection;
use sqlx::sqlite::SqliteRow;
use uuid::Uuid;

use super::candidates::{CANDIDATES, candidates, rounds};
use super::rows::{Columns, to_json};
use super::together::{self, Collector};
use super::workers::around;
use super::writer::Writer;
use super::{Store, StoreError};
use crate::clock::Now;
use crate::queue::{Holding, Refusal, Share, Wanted, lease_end, share};

/// Takes jobs for workers, writes down who runs them from now on, and how far their owners have come; no attempt outlives its
/// `max_wall_s` by more than a lease.
pub(super) const TAKE: &str = "
    UPDATE jobs
    SET state = 'running', attempt = attempt + 1, worker_id = took.value ->> 'worker',
        lease_expires_at = took.value ->> 'until', started_at = took.value ->> 'at',
        deadline = took.value ->> 'until' + CAST(max_wall_s * 1000 AS INTEGER)
    FROM json_each(?) AS took WHERE jobs.seq = took.value ->> 'seq'
    RETURNING id, attempt, max_wall_s, frame_interval_s, lease_expires_at, priority, queue_position, seq,
              (SELECT body FROM scenarios WHERE scenarios.digest = jobs.scenario_digest) AS scenario;
    INSERT INTO attempts (job_id, number, worker_id, request_id, claimed_at)
    SELECT j.id, j.attempt, j.worker_id, took.value ->> 'request', took.value ->> 'at'
    FROM json_each(?) AS took CROSS JOIN jobs j ON j.seq = took.value ->> 'seq';
    INSERT INTO fair_share (priority, owner, queue_position, round)
    SELECT j.priority, j.owner, max(j.queue_position), max(took.value ->> 'round')
    FROM json_each(?) AS took CROSS JOIN jobs j ON j.seq = took.value ->> 'seq'
    GROUP BY j.priority, j.owner
    ON CONFLICT (priority, owner) DO UPDATE SET
        queue_position = max(queue_position, excluded.queue_position), round = max(round, excluded.round)";

/// Renews what a request has claimed and still holds.
pub(super) const REPEAT: &str = "
    UPDATE jobs SET lease_expires_at = ?
    FROM attempts a
    WHERE a.request_id = ? AND a.worker_id = ? AND a.outcome IS NULL
      AND jobs.id = a.job_id AND jobs.attempt = a.number AND jobs.state = 'running'
    RETURNING id, attempt, max_wall_s, frame_interval_s, lease_expires_at, priority, queue_position, seq,
              (SELECT body FROM scenarios WHERE scenarios.digest = jobs.scenario_digest) AS scenario";

/// Notes that workers were heard of; asks what each is and holds, whether it has failed, and whether its request is a repeat.
pub(super) const ARRIVE: &str = "
    UPDATE workers SET last_seen_at = asked.value ->> 'at'
    FROM json_each(?) AS asked WHERE workers.id = asked.value ->> 'worker';
    SELECT asked.key AS place, me.backend, me.memory_mib, me.draining,
        EXISTS (SELECT 1 FROM attempts WHERE request_id = asked.value ->> 'request' AND worker_id = me.id) AS repeated,
        EXISTS (SELECT 1 FROM attempts WHERE worker_id = me.id AND outcome = 'worker') AS has_failed,
        (SELECT count(*) FROM jobs WHERE worker_id = me.id AND state = 'running') AS jobs,
        (SELECT coalesce(max(alone), 0) FROM jobs WHERE worker_id = me.id AND state = 'running') AS alone
    FROM json_each(?) AS asked CROSS JOIN workers me ON me.id = asked.value ->> 'worker'";

/// A worker asks for work.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Claim {
    pub(crate) request_id: Uuid,
    pub(crate) worker: WorkerId,
    pub(crate) max_jobs: u32,
    pub(crate) lease: Duration,
    /// Bytes that the frames of an attempt may have.
    pub(crate) max_frames_bytes: u64,
}

/// What it got.
#[derive(Debug, Default)]
pub(crate) struct Claimed {
    pub(crate) attempts: Vec<ClaimedAttempt>,
    /// There is work for it, which it may have once it holds nothing else.
    pub(crate) held_back: bool,
}

/// A claim at its time.
pub(super) type Asked = (Claim, Now);

/// What a claim got, as it is stored.
#[derive(Default)]
pub(super) struct Got {
    rows: Vec<SqliteRow>,
    held_back: bool,
}

/// Claims that are worked together.
const GROUP: usize = 64;

/// Where claims wait for each other.
pub(super) type Collected = Collector<Asked, Result<Got, Refusal>>;

pub(super) fn collect(writer: Arc<Writer>) -> Collected {
    Collector::start(writer, GROUP, Duration::ZERO, |tx, group| Box::pin(claim_all(tx, group)))
}

impl Store {
    /// Claims up to `max_jobs` jobs for the worker, or repeats what the same request claimed before.
    pub(crate) async fn claim(&self, claim: Claim, now: Now) -> Result<Result<Claimed, Refusal>, StoreError> {
        // Documents are read once others need not wait for it.
        let got = match self.claims.ask((claim, now)).await? {
            Ok(got) => got,
            Err(refusal) => return Ok(Err(refusal)),
        };
        let attempts = got.rows.iter().map(|row| attempt(row, claim)).collect::<Result<_, _>>()?;
        Ok(Ok(Claimed { attempts, held_back: got.held_back }))
    }

    /// Whether a claim would find a job, without troubling the writer.
    pub(crate) async fn has_work(&self, claim: Claim, now: Now) -> Result<bool, StoreError> {
        let (since, until) = around(now.wall, claim.lease);
        let found = sqlx::query(CANDIDATES)
            .bind(claim.worker.to_string())
            .bind(since.0)
            .bind(until.0)
            .bind(1)
            .fetch_optional(&self.readers)
            .await?;
        Ok(found.is_some())
    }
}

/// Works claims as if one after the other; those of one worker are.
async fn claim_all(
    tx: &mut SqliteConnection,
    group: &[Arc<Asked>],
) -> Result<Vec<Result<Got, Refusal>>, StoreError> {
    let mut answers: Vec<_> = group.iter().map(|_| Err(Refusal::NoWorker)).collect();
    for places in together::rounds(group.iter().map(|asked| asked.0.worker)) {
        let round: Vec<Asked> = places.iter().map(|place| *group[*place]).collect();
        for (place, answer) in places.into_iter().zip(claim_round(tx, &round).await?) {
            answers[place] = answer;
        }
    }
    Ok(answers)
}

/// What decides which jobs suit a worker: who has failed some is of a kind of its own.
#[derive(PartialEq)]
struct Kind {
    backend: String,
    memory_mib: Option<i64>,
    failed: Option<WorkerId>,
}

/// Works claims of as many workers.
async fn claim_round(
    tx: &mut SqliteConnection,
    round: &[Asked],
) -> Result<Vec<Result<Got, Refusal>>, StoreError> {
    let arriving =
        |(claim, now): &Asked| json!({"worker": claim.worker, "request": claim.request_id, "at": now.wall.0});
    let arriving = to_json("claims", &round.iter().map(arriving).collect::<Vec<_>>())?;
    let rows = sqlx::query(ARRIVE).bind(&arriving).bind(&arriving).fetch_all(&mut *tx).await?;
    let mut answers: Vec<_> = round.iter().map(|_| Err(Refusal::NoWorker)).collect();
    let (mut kinds, mut wanting) = (Vec::<(Kind, Asked)>::new(), Vec::new());
    for row in &rows {
        let place = row.number::<u32>("place")? as usize;
        let Some(asked @ (claim, now)) = round.get(place).copied() else { continue };
        answers[place] = Ok(Got::default());
        if row.column("repeated")? {
            answers[place] = Ok(Got { rows: repeat(tx, claim, now).await?, held_back: false });
        } else if !row.column("draining")? {
            let failed = row.column::<bool>("has_failed")?.then_some(claim.worker);
            let kind =
                Kind { backend: row.column("backend")?, memory_mib: row.column("memory_mib")?, failed };
            let known = kinds.iter().position(|(other, _)| *other == kind);
            let list = known.unwrap_or(kinds.len());
            if known.is_none() {
                kinds.push((kind, asked));
            }
            let holding = Holding { jobs: row.number("jobs")?, alone: row.column("alone")? };
            wanting.push((place, Wanted { list, holding, most: claim.max_jobs as usize }));
        }
    }
    // In the order in which they asked, which is not always that of the rows.
    wanting.sort_by_key(|(place, _)| *place);
    let total: usize = wanting.iter().map(|(_, wanted)| wanted.most).sum();
    let mut lists = Vec::new();
    for (_, (claim, now)) in &kinds {
        lists.push(candidates(tx, *claim, *now, total).await?);
    }
    let wanted: Vec<_> = wanting.iter().map(|(_, wanted)| *wanted).collect();
    let shares = share(&wanted, &lists, &mut rounds(tx, &lists).await?);
    let shares: Vec<_> = wanting.iter().map(|(place, _)| *place).zip(shares).collect();
    let mut taken = take(tx, round, &shares).await?;
    for (place, share) in shares {
        let rows = share.jobs.iter().filter_map(|next| taken.remove(&next.job.seq)).collect();
        answers[place] = Ok(Got { rows, held_back: share.held_back });
    }
    Ok(answers)
}

/// What the same request claimed before and still holds, by priority, turn and age.
async fn repeat(tx: &mut SqliteConnection, claim: Claim, now: Now) -> Result<Vec<SqliteRow>, StoreError> {
    let rows = sqlx::query(REPEAT)
        .bind(lease_end(now.lease, claim.lease).0)
        .bind(claim.request_id.to_string())
        .bind(claim.worker.to_string())
        .fetch_all(&mut *tx)
        .await?;
    let mut ordered = Vec::with_capacity(rows.len());
    for row in rows {
        let priority: i64 = row.column("priority")?;
        ordered.push(((-priority, row.column::<i64>("queue_position")?, row.column::<i64>("seq")?), row));
    }
    // `RETURNING` has no order.
    ordered.sort_by_key(|(key, _)| *key);
    Ok(ordered.into_iter().map(|(_, row)| row).collect())
}

/// Makes attempts of what each place of the round gets; the rows by number of the job.
async fn take(
    tx: &mut SqliteConnection,
    round: &[Asked],
    shares: &[(usize, Share)],
) -> Result<HashMap<i64, SqliteRow>, StoreError> {
    let mut taken = Vec::new();
    for (place, share) in shares {
        let (claim, now) = &round[*place];
        let until = lease_end(now.lease, claim.lease).0;
        taken.extend(share.jobs.iter().map(|next| {
            json!({"seq": next.job.seq, "round": next.round, "worker": claim.worker, "request": claim.request_id,
                   "at": now.wall.0, "until": until})
        }));
    }
    if taken.is_empty() {
        return Ok(HashMap::new());
    }
    let taken = to_json("jobs", &taken)?;
    let rows = sqlx::query(TAKE).bind(&taken).bind(&taken).bind(&taken).fetch_all(&mut *tx).await?;
    rows.into_iter().map(|row| Ok((row.column("seq")?, row))).collect()
}

/// A claimed row as the worker gets it.
fn attempt(row: &SqliteRow, claim: Claim) -> Result<ClaimedAttempt, StoreError> {
    let interval_s: Option<f64> = row.column("frame_interval_s")?;
    let limit_bytes = claim.max_frames_bytes;
    Ok(ClaimedAttempt {
        job_id: row.parsed("id")?,
        attempt: row.number("attempt")?,
        scenario: row.json("scenario")?,
        max_wall_s: row.column("max_wall_s")?,
        frames: interval_s.map(|interval_s| FramesOrder { interval_s, limit_bytes }),
        lease_expires_at: row.moment("lease_expires_at")?,
    })
}
