//! Claims: jobs become attempts, in batches of many workers.

use std::collections::{BTreeMap, HashMap};
use std::sync::Arc;
use std::time::Duration;

use roost_api::checkpoint::CheckpointOrder;
use roost_api::fill::FillOrder;
use roost_api::frames::FramesOrder;
use roost_api::ids::WorkerId;
use roost_api::lease::ClaimedAttempt;
use serde_json::{Value, json};
use uuid::Uuid;

use super::batcher::{Batcher, waves};
use super::candidates::{FillNumbers, candidates};
use super::claim_statements::{
    ARRIVE, ARRIVE_IN_POSTGRES, COMPUTE_FILLS, RECORD_SLOTS, REPEAT, SEE, TAKE, TAKE_IN_POSTGRES, USE_FILLS,
};
use super::columns::{Columns, to_json};
use super::database::{Connection, Engine, Row, query};
use super::eligible_jobs::rounds;
use super::workers::online_window;
use super::writer::Writer;
use super::{Store, StoreError, leader_tables};
use crate::clock::Now;
use crate::queue::{Allocation, Demand, Refusal, Turn, WorkerLoad, allocate, lease_end};

/// A worker asks for work.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Claim {
    pub(crate) request_id: Uuid,
    pub(crate) worker: WorkerId,
    pub(crate) max_jobs: u32,
    pub(crate) lease: Duration,
    /// Bytes that the frames of an attempt may have.
    pub(crate) max_frames_bytes: u64,
    /// The checkpoints that jobs without frames shall record.
    pub(crate) checkpoints: Option<CheckpointOrder>,
    /// Whether the worker stores the fills that it computes, and starts from stored ones.
    pub(crate) shares_fills: bool,
    /// Bytes that a fill may have.
    pub(crate) max_fill_bytes: u64,
}

/// The answer to a claim.
#[derive(Debug, Default)]
pub(crate) struct Claimed {
    pub(crate) attempts: Vec<ClaimedAttempt>,
    /// Whether a job waits until the worker is idle.
    pub(crate) held_back: bool,
    /// Jobs that the worker held before, unless the claim is a repeat.
    pub(crate) held_jobs: Option<u32>,
}

/// A claim and its time.
pub(super) type TimedClaim = (Claim, Now);

/// The rows of claimed jobs.
#[derive(Default)]
pub(super) struct ClaimedRows {
    rows: Vec<Row>,
    held_back: bool,
    held_jobs: Option<u32>,
}

/// How often claims record, during one lease, that their worker was seen. A worker may claim hundreds of jobs in that time.
const SEEN_PER_LEASE: u32 = 4;

/// Claims in one batch.
const MAX_BATCH: usize = 64;

pub(super) type ClaimBatcher = Batcher<TimedClaim, Result<ClaimedRows, Refusal>>;

pub(super) fn batcher(writer: Arc<Writer>) -> ClaimBatcher {
    Batcher::start(writer, MAX_BATCH, Duration::ZERO, |tx, batch| Box::pin(claim_all(tx, batch)))
}

impl Store {
    /// Claims up to `max_jobs` jobs for the worker, or repeats what the same request claimed before.
    pub(crate) async fn claim(&self, claim: Claim, now: Now) -> Result<Result<Claimed, Refusal>, StoreError> {
        // Scenarios are parsed outside the batch, so that other claims do not wait.
        let claimed = match self.claims.submit((claim, now)).await? {
            Ok(claimed) => claimed,
            Err(refusal) => return Ok(Err(refusal)),
        };
        let attempts = claimed.rows.iter().map(|row| attempt(row, claim)).collect::<Result<_, _>>()?;
        Ok(Ok(Claimed { attempts, held_back: claimed.held_back, held_jobs: claimed.held_jobs }))
    }
}

/// Allocates jobs to claims as if one after the other. Several claims of one worker are in different waves.
async fn claim_all(
    tx: &mut Connection,
    batch: &[Arc<TimedClaim>],
) -> Result<Vec<Result<ClaimedRows, Refusal>>, StoreError> {
    let mut answers: Vec<_> = batch.iter().map(|_| Err(Refusal::NoWorker)).collect();
    for wave in waves(batch.iter().map(|claim| claim.0.worker)) {
        let claims: Vec<TimedClaim> = wave.iter().map(|index| *batch[*index]).collect();
        for (index, answer) in wave.into_iter().zip(claim_wave(tx, &claims).await?) {
            answers[index] = answer;
        }
    }
    Ok(answers)
}

/// Workers that can run the same jobs. A worker that has failed jobs is a class of its own.
#[derive(PartialEq)]
struct WorkerClass {
    memory_mib: Option<i64>,
    failed: Option<WorkerId>,
    shares_fills: bool,
    device: FillDevice,
}

/// Solver revision, backend and device of a worker: those with equal ones can use each other's fills.
#[derive(Clone, PartialEq, Eq, Hash)]
pub(super) struct FillDevice {
    solver_revision: u32,
    backend: String,
    device: String,
}

/// Allocates jobs to claims of different workers.
async fn claim_wave(
    tx: &mut Connection,
    claims: &[TimedClaim],
) -> Result<Vec<Result<ClaimedRows, Refusal>>, StoreError> {
    let arriving = |(claim, now): &TimedClaim| {
        let (recent, _) = online_window(now.wall, claim.lease / SEEN_PER_LEASE);
        json!({"worker": claim.worker, "request": claim.request_id, "at": now.wall.0, "recent": recent.0})
    };
    let arriving = to_json("claims", &claims.iter().map(arriving).collect::<Vec<_>>())?;
    let arrive = if tx.engine() == Engine::Postgres { ARRIVE_IN_POSTGRES } else { ARRIVE };
    let rows = query(arrive).bind(arriving).fetch_all(&mut *tx).await?;
    let mut answers: Vec<_> = claims.iter().map(|_| Err(Refusal::NoWorker)).collect();
    let (mut classes, mut demands) = (Vec::<(WorkerClass, TimedClaim)>::new(), Vec::new());
    let (mut seen, mut slots_found) = (Vec::new(), Vec::new());
    for row in &rows {
        let place = row.number::<u32>("place")? as usize;
        let Some(timed @ (claim, now)) = claims.get(place).copied() else { continue };
        answers[place] = Ok(ClaimedRows::default());
        if row.column("is_due")? {
            seen.push(json!({"worker": claim.worker, "at": now.wall.0}));
        }
        if row.column("repeated")? {
            answers[place] =
                Ok(ClaimedRows { rows: repeat(tx, claim, now).await?, ..ClaimedRows::default() });
        } else if !row.column("draining")? {
            let failed = row.column::<bool>("has_failed")?.then_some(claim.worker);
            let class = WorkerClass {
                memory_mib: row.column("memory_mib")?,
                failed,
                shares_fills: claim.shares_fills,
                device: FillDevice {
                    solver_revision: row.number("solver_revision")?,
                    backend: row.column("backend")?,
                    device: row.column("device")?,
                },
            };
            let known = classes.iter().position(|(other, _)| *other == class);
            let list = known.unwrap_or(classes.len());
            if known.is_none() {
                classes.push((class, timed));
            }
            let load = WorkerLoad { jobs: row.number("jobs")?, alone: row.column("alone")? };
            // A new worker asks for all its slots. Jobs that it has yet to deliver occupy none.
            let slots = i64::from(claim.max_jobs);
            if row.column::<Option<i64>>("slots")?.unwrap_or(0) < slots {
                slots_found.push(json!({"worker": claim.worker, "slots": slots}));
            }
            demands.push((place, Demand { list, load, max_jobs: claim.max_jobs as usize }));
        }
    }
    if !seen.is_empty() {
        query(SEE).bind(to_json("workers", &seen)?).execute(&mut *tx).await?;
    }
    if !slots_found.is_empty() {
        query(RECORD_SLOTS).bind(to_json("slots", &slots_found)?).execute(&mut *tx).await?;
    }
    let loads: HashMap<usize, u32> =
        demands.iter().map(|(place, demand)| (*place, demand.load.jobs)).collect();
    // In the order of the claims, which the rows need not have.
    demands.sort_by_key(|(place, _)| *place);
    let total: usize = demands.iter().map(|(_, demand)| demand.max_jobs).sum();
    if !classes.is_empty() {
        leader_tables::advance(tx).await?;
    }
    let (mut lists, mut fills) = (Vec::new(), FillNumbers::default());
    for (class, (claim, now)) in &classes {
        lists.push(candidates(tx, *claim, *now, total, (&mut fills, &class.device)).await?);
    }
    let ordered: Vec<_> = demands.iter().map(|(_, demand)| *demand).collect();
    let allocations = allocate(&ordered, &lists, &mut rounds(tx, &lists).await?);
    let allocations: Vec<_> = demands.iter().map(|(place, _)| *place).zip(allocations).collect();
    let mut taken = start_attempts(tx, claims, &allocations).await?;
    for (place, allocation) in allocations {
        let rows = allocation.jobs.iter().filter_map(|next| taken.remove(&next.job.seq)).collect();
        let held_jobs = loads.get(&place).copied();
        answers[place] = Ok(ClaimedRows { rows, held_back: allocation.held_back, held_jobs });
    }
    Ok(answers)
}

/// The running attempts that the same request claimed before, by priority, position and age.
async fn repeat(tx: &mut Connection, claim: Claim, now: Now) -> Result<Vec<Row>, StoreError> {
    let rows = query(REPEAT)
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

/// Starts the attempts of allocated jobs, and returns their rows by job number.
async fn start_attempts(
    tx: &mut Connection,
    claims: &[TimedClaim],
    allocations: &[(usize, Allocation)],
) -> Result<HashMap<i64, Row>, StoreError> {
    let mut taken = Vec::new();
    for (place, allocation) in allocations {
        let (claim, now) = &claims[*place];
        let until = lease_end(now.lease, claim.lease).0;
        taken.extend(allocation.jobs.iter().map(|next| {
            json!({"seq": next.job.seq, "round": next.round, "served": next.served, "worker": claim.worker, "request": claim.request_id,
                   "at": now.wall.0, "until": until, "computes": u8::from(next.job.fill.is_some())})
        }));
    }
    if taken.is_empty() {
        return Ok(HashMap::new());
    }
    let computes = allocations.iter().flat_map(|(_, it)| &it.jobs).any(|next| next.job.fill.is_some());
    let (taken, turns) = (to_json("jobs", &taken)?, to_json("turns", &last_turns(allocations))?);
    let take = if tx.engine() == Engine::Postgres { TAKE_IN_POSTGRES } else { TAKE };
    let take = query(take).bind(&taken).bind(&taken).bind(&taken).bind(turns);
    let rows = take.fetch_all(&mut *tx).await?;
    if computes {
        query(COMPUTE_FILLS).bind(&taken).execute(&mut *tx).await?;
    }
    let uses = |row: &Row| Ok::<_, StoreError>(row.column::<Option<String>>("fill")?.is_some());
    if rows.iter().map(uses).collect::<Result<Vec<_>, _>>()?.contains(&true) {
        query(USE_FILLS).bind(&taken).execute(&mut *tx).await?;
    }
    rows.into_iter().map(|row| Ok((row.column("seq")?, row))).collect()
}

/// The last turn of each project. The claims are in the order of their allocation.
fn last_turns(allocations: &[(usize, Allocation)]) -> Vec<Value> {
    let mut last = BTreeMap::new();
    for next in allocations.iter().flat_map(|(_, allocation)| &allocation.jobs) {
        last.insert((next.priority, next.project.id), (next.turn, next.served));
    }
    let turn = |((priority, project), (turn, served)): (&(i32, i64), &(Turn, i64))| json!({"priority": priority, "project": project, "round": turn.round, "turn": turn.number, "served": served});
    last.iter().map(turn).collect()
}

/// The answer for one claimed row.
fn attempt(row: &Row, claim: Claim) -> Result<ClaimedAttempt, StoreError> {
    let interval_s: Option<f64> = row.column("frame_interval_s")?;
    let limit_bytes = claim.max_frames_bytes;
    let has_fill = claim.shares_fills && row.column::<Option<String>>("fill_digest")?.is_some();
    let fill = FillOrder { stored: row.json("fill")?, limit_bytes: claim.max_fill_bytes };
    Ok(ClaimedAttempt {
        job_id: row.parsed("id")?,
        attempt: row.number("attempt")?,
        scenario: row.json("scenario")?,
        max_wall_s: row.column("max_wall_s")?,
        frames: interval_s.map(|interval_s| FramesOrder { interval_s, limit_bytes }),
        // Frames would begin at the checkpoint.
        checkpoints: claim.checkpoints.filter(|_| interval_s.is_none()),
        checkpoint: row.json("checkpoint")?,
        shared_fill: row.column("shared_fill")?,
        fill: has_fill.then_some(fill),
        lease_expires_at: row.moment("lease_expires_at")?,
    })
}
