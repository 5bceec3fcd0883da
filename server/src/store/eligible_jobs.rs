//! What suits a worker: the jobs of one owner at one priority make a line, and of each line the first come.

use futures_util::TryStreamExt;
use sqlx::SqliteConnection;

use super::StoreError;
use super::claims::Claim;
use super::columns::{Columns, to_json};
use super::workers::around;
use crate::clock::Now;
use crate::queue::{EligibleJob, OwnerQueue, Rounds};

/// At most ?4 jobs that suit worker ?1 of every line, the lines by priority. Whatever the length of the queue, `heads` finds each line
/// by one step into `jobs_to_claim`, and each list walks that index from there to its limit; a test looks at the plan. Rows come as
/// they are asked for: a reader that has enough looks at no further line. A job that the worker has failed before goes to another one
/// that has what it needs and was heard of between ?2 and ?3, if there is one.
pub(super) const ELIGIBLE_JOBS: &str = "
    WITH RECURSIVE heads (priority, owner) AS (
        SELECT * FROM (SELECT priority, owner FROM jobs WHERE state = 'queued' AND not_before IS NULL
                       ORDER BY priority DESC, owner LIMIT 1)
        UNION ALL
        SELECT next.priority, next.owner FROM heads CROSS JOIN jobs next ON next.seq = coalesce(
            (SELECT seq FROM jobs WHERE state = 'queued' AND not_before IS NULL
             AND priority = heads.priority AND owner > heads.owner ORDER BY owner LIMIT 1),
            (SELECT seq FROM jobs WHERE state = 'queued' AND not_before IS NULL
             AND priority < heads.priority ORDER BY priority DESC, owner LIMIT 1)))
    SELECT heads.priority, heads.owner, found.queue_position, found.seq, found.alone
    FROM heads CROSS JOIN workers me CROSS JOIN jobs found ON found.seq IN (
        SELECT j.seq FROM jobs j
        WHERE j.state = 'queued' AND j.not_before IS NULL
          AND j.priority = heads.priority AND j.owner = heads.owner
          AND (j.needs_backend IS NULL OR j.needs_backend = me.backend)
          AND (j.needs_memory_mib IS NULL OR j.needs_memory_mib <= me.memory_mib)
          AND (j.attempt = j.attempts_before_retry
               OR NOT EXISTS (SELECT 1 FROM attempts f WHERE f.job_id = j.id AND f.worker_id = ?1
                              AND f.outcome = 'worker' AND f.number > j.attempts_before_retry)
               OR NOT EXISTS (SELECT 1 FROM workers other
                              WHERE other.last_seen_at BETWEEN ?2 AND ?3 AND other.draining = 0
                              AND (j.needs_backend IS NULL OR j.needs_backend = other.backend)
                              AND (j.needs_memory_mib IS NULL OR j.needs_memory_mib <= other.memory_mib)
                              AND NOT EXISTS (SELECT 1 FROM attempts f WHERE f.job_id = j.id
                                              AND f.worker_id = other.id AND f.outcome = 'worker'
                                              AND f.number > j.attempts_before_retry)))
        ORDER BY j.queue_position, j.seq LIMIT ?4)
    WHERE me.id = ?1 AND me.draining = 0";

/// The rounds that the owners of some priorities have come to.
pub(super) const ROUNDS: &str =
    "SELECT priority, owner, round FROM fair_share WHERE priority IN (SELECT value FROM json_each(?))";

/// The first jobs that suit a worker: as many of each line as are wanted, and no line of a lower priority than it takes to have them.
pub(super) async fn candidates(
    tx: &mut SqliteConnection,
    claim: Claim,
    now: Now,
    wanted: usize,
) -> Result<Vec<OwnerQueue>, StoreError> {
    let (since, until) = around(now.wall, claim.lease);
    let mut rows = sqlx::query(ELIGIBLE_JOBS)
        .bind(claim.worker.to_string())
        .bind(since.0)
        .bind(until.0)
        .bind(i64::try_from(wanted).unwrap_or(i64::MAX))
        .fetch(&mut *tx);
    let mut lines: Vec<(OwnerQueue, Vec<(i64, EligibleJob)>)> = Vec::new();
    let mut found = 0;
    while let Some(row) = rows.try_next().await? {
        let (priority, owner) = (row.column("priority")?, row.column("owner")?);
        let last = lines.last().map(|(line, _)| (line.priority, line.owner));
        if last.is_some_and(|(before, _)| before > priority && found >= wanted) {
            break;
        }
        if last != Some((priority, owner)) {
            lines.push((OwnerQueue { priority, owner, jobs: Default::default() }, Vec::new()));
        }
        if let Some((_, jobs)) = lines.last_mut() {
            jobs.push((
                row.column("queue_position")?,
                EligibleJob { seq: row.column("seq")?, alone: row.column("alone")? },
            ));
            found += 1;
        }
    }
    let in_order = |(line, mut jobs): (OwnerQueue, Vec<(i64, EligibleJob)>)| {
        jobs.sort_by_key(|(turn, job)| (*turn, job.seq));
        OwnerQueue { jobs: jobs.into_iter().map(|(_, job)| job).collect(), ..line }
    };
    Ok(lines.into_iter().map(in_order).collect())
}

/// The rounds that the owners of these lines, and those beside them, have come to.
pub(super) async fn rounds(
    tx: &mut SqliteConnection,
    lines: &[Vec<OwnerQueue>],
) -> Result<Rounds, StoreError> {
    let mut priorities: Vec<i32> = lines.iter().flatten().map(|line| line.priority).collect();
    priorities.sort_unstable();
    priorities.dedup();
    let mut rounds = Rounds::default();
    if priorities.is_empty() {
        return Ok(rounds);
    }
    for row in sqlx::query(ROUNDS).bind(to_json("priorities", &priorities)?).fetch_all(&mut *tx).await? {
        rounds.record(row.column("priority")?, row.column("owner")?, row.column("round")?);
    }
    Ok(rounds)
}
