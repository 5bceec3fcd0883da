//! Eligible jobs: queries for the first queued jobs of each queue that a worker can run, and for the rounds of their owners.

use super::StoreError;
use super::columns::{Columns, to_json};
use super::database::{Connection, Engine, Row, query};
use crate::queue::{OwnerQueue, Rounds, Turn};

/// The condition that claims look at a job, of a row of `jobs`.
macro_rules! claimable {
    ($job:literal) => {
        concat!($job, ".state = 'queued' AND ", $job, ".not_before IS NULL AND ", $job, ".paused = 0")
    };
}

/// The condition that a worker has what a job needs.
macro_rules! fits {
    ($job:literal, $worker:literal) => {
        concat!(
            "(",
            $job,
            ".needs_backend IS NULL OR ",
            $job,
            ".needs_backend = ",
            $worker,
            ".backend) AND (",
            $job,
            ".needs_memory_mib IS NULL OR ",
            $job,
            ".needs_memory_mib <= ",
            $worker,
            ".memory_mib)"
        )
    };
}

/// The condition that a worker has failed a job since the last retry by a user.
macro_rules! has_failed {
    ($job:literal, $worker:literal) => {
        concat!(
            "EXISTS (SELECT 1 FROM attempts f WHERE f.job_id = ",
            $job,
            ".id AND f.worker_id = ",
            $worker,
            ".id AND f.outcome = 'worker' AND f.number > ",
            $job,
            ".attempts_before_retry)"
        )
    };
}

/// The condition that a worker may get a job: it has not failed the job, or no other suitable worker was seen between ?2 and ?3.
macro_rules! is_left_to {
    ($job:literal, $worker:literal) => {
        concat!(
            "(",
            $job,
            ".attempt = ",
            $job,
            ".attempts_before_retry
               OR NOT ",
            has_failed!($job, $worker),
            "
               OR NOT EXISTS (SELECT 1 FROM workers other
                              WHERE other.last_seen_at BETWEEN ?2 AND ?3 AND other.draining = 0
                              AND ",
            fits!($job, "other"),
            "
                              AND NOT ",
            has_failed!($job, "other"),
            "))"
        )
    };
}

/// An expression on the running attempt that computes the fill of a job for a worker; null without one.
macro_rules! computing_attempt {
    ($of:literal, $job:literal, $worker:literal) => {
        concat!(
            "(SELECT ",
            $of,
            " FROM fills f JOIN jobs r ON r.id = f.job_id AND r.attempt = f.attempt AND r.state = 'running'
                          WHERE f.fill_digest = ",
            $job,
            ".fill_digest AND f.solver_revision = ",
            $worker,
            ".solver_revision
                          AND f.backend = ",
            $worker,
            ".backend AND f.device = ",
            $worker,
            ".device)"
        )
    };
}

/// The condition that a worker can continue a job from a checkpoint.
macro_rules! can_continue {
    ($job:literal, $worker:literal) => {
        concat!(
            "EXISTS (SELECT 1 FROM checkpoints c WHERE c.job_id = ",
            $job,
            ".id
                     AND c.solver_revision = ",
            $worker,
            ".solver_revision AND c.backend = ",
            $worker,
            ".backend
                     AND c.device = ",
            $worker,
            ".device)"
        )
    };
}

/// `heads`: every queue with jobs that claims look at, by priority and owner. Each is found by one step into the index `jobs_to_claim`.
macro_rules! heads {
    () => {
        concat!("
    WITH RECURSIVE heads (priority, owner, queue) AS (
        SELECT * FROM (SELECT priority, owner, queue FROM jobs WHERE ", claimable!("jobs"), "
                       ORDER BY priority DESC, owner, queue LIMIT 1) AS top
        UNION ALL
        SELECT next.priority, next.owner, next.queue FROM heads CROSS JOIN jobs next ON next.seq = coalesce(
            (SELECT seq FROM jobs WHERE ", claimable!("jobs"), "
             AND priority = heads.priority AND owner = heads.owner AND queue > heads.queue ORDER BY queue LIMIT 1),
            (SELECT seq FROM jobs WHERE ", claimable!("jobs"), "
             AND priority = heads.priority AND owner > heads.owner ORDER BY owner, queue LIMIT 1),
            (SELECT seq FROM jobs WHERE ", claimable!("jobs"), "
             AND priority < heads.priority ORDER BY priority DESC, owner, queue LIMIT 1)))"
        )
    };
}

/// The owners whose projects have used up their budgets.
macro_rules! spent_owners {
    () => {
        "(SELECT o.id FROM projects p CROSS JOIN owners o ON o.project = p.id
                              WHERE p.budget_core_ms IS NOT NULL AND p.used_core_ms >= p.budget_core_ms)"
    };
}

/// The condition that claims look at a queue: its sweep is visible, and its project has budget left.
macro_rules! is_open {
    () => {
        concat!(
            "heads.queue NOT IN (SELECT seq FROM sweeps WHERE state <> 'ready')
      AND heads.owner NOT IN ",
            spent_owners!()
        )
    };
}

// Why a job waits is asked with the same conditions.
pub(super) use {
    can_continue, claimable, computing_attempt, fits, has_failed, heads, is_left_to, is_open, spent_owners,
};

/// [`ELIGIBLE_JOBS`] with the queues, the join of their projects, and the join of the jobs of each queue from a place on, which ends in
/// `$end`.
macro_rules! eligible_jobs {
    ($with:expr, $heads:literal, $projects:literal, $found:literal, $from:literal, $end:expr) => {
        concat!(
            $with,
            "
    SELECT heads.priority, heads.owner, heads.queue, owners.project, projects.share, found.queue_position, found.seq, found.alone,
           CASE WHEN found.fill_digest IS NOT NULL AND ?5 <> 0
                     AND NOT EXISTS (SELECT 1 FROM fills f WHERE f.fill_digest = found.fill_digest
                                     AND f.solver_revision = me.solver_revision AND f.backend = me.backend
                                     AND f.device = me.device AND f.job_id IS NULL)
                     AND NOT ",
            can_continue!("found", "me"),
            "
                THEN found.fill_digest END AS fill
    FROM ",
            $heads,
            " CROSS JOIN workers me CROSS JOIN owners ON owners.id = heads.owner CROSS JOIN ",
            $projects,
            "
         CROSS JOIN ",
            $found,
            " FROM jobs j
        WHERE ",
            claimable!("j"),
            "
          AND j.priority = heads.priority AND j.owner = heads.owner AND j.queue = heads.queue",
            $from,
            "
          AND (j.sweep_id IS NULL OR j.sweep_id NOT IN (SELECT id FROM sweeps WHERE state <> 'ready'))
          AND ",
            fits!("j", "me"),
            "
          AND ",
            is_left_to!("j", "me"),
            "
        ORDER BY j.queue_position, j.seq LIMIT ?6 + 500) AS first
        WHERE first.fill_digest IS NULL OR ?5 = 0
           OR NOT EXISTS ",
            computing_attempt!("1", "first", "me"),
            "
           OR ",
            can_continue!("first", "me"),
            "
        LIMIT CAST(?4 AS BIGINT))",
            $end
        )
    };
}

/// At most ?4 jobs of every queue that worker ?1 can run, by priority and owner. The cast keeps SQLite from preparing the statement again
/// for each value of a bare parameter in its last `LIMIT`. `heads` finds each queue by one step into the index
/// `jobs_to_claim`, whatever the length of the queue, and each list walks that index from there to its limit; a test checks the query
/// plan. A sweep that is not `ready`, and an owner whose project has used up its budget, are passed over in one step per queue. Rows come
/// lazily: a reader that has enough reads no further queue. A job that the worker has failed is left to another suitable worker that was
/// seen between ?2 and ?3, if there is one.
///
/// For a worker that shares fills (?5), a job is passed over while a running attempt computes its fill, unless it continues from a
/// checkpoint. Of each queue only the first ?6 + 500 jobs are looked at, so that a long queue of one fill costs a claim milliseconds.
/// `fill` is the fill that an attempt of the job would compute.
pub(super) const ELIGIBLE_JOBS: &str = eligible_jobs!(
    heads!(),
    "heads",
    "projects ON projects.id = owners.project",
    "jobs found ON found.seq IN (
        SELECT first.seq FROM (SELECT j.seq, j.id, j.fill_digest",
    "",
    concat!(
        "
    WHERE me.id = ?1 AND me.draining = 0 AND ",
        is_open!()
    )
);

/// The same for PostgreSQL, which would test each job against such a list, but makes one list per queue for a lateral join. SQLite has none.
macro_rules! eligible_jobs_in_postgres {
    ($with:expr, $heads:literal, $from:literal) => {
        eligible_jobs!(
            $with,
            $heads,
            "LATERAL (SELECT * FROM projects WHERE id >= owners.project AND id <= owners.project ORDER BY id DESC LIMIT 1) AS projects",
            "LATERAL (
        SELECT first.* FROM (SELECT j.seq, j.id, j.fill_digest, j.queue_position, j.alone",
            $from,
            concat!(
                " AS found
    WHERE me.id = ?1 AND me.draining = 0 AND ",
                is_open!(),
                "
    ORDER BY heads.priority DESC, heads.owner, heads.queue"
            )
        )
    };
}

/// [`ELIGIBLE_JOBS`] for a reader.
pub(super) fn eligible_jobs(engine: Engine) -> &'static str {
    match engine {
        Engine::Sqlite => ELIGIBLE_JOBS,
        Engine::Postgres => eligible_jobs_in_postgres!(heads!(), "heads", ""),
    }
}

/// [`ELIGIBLE_JOBS`] for the session that writes. That of PostgreSQL has the table `queue_heads`.
pub(super) fn eligible_jobs_of_writer(engine: Engine) -> &'static str {
    match engine {
        Engine::Sqlite => ELIGIBLE_JOBS,
        Engine::Postgres => eligible_jobs_in_postgres!(
            "",
            "queue_heads AS heads",
            " AND (j.queue_position, j.seq) >= (heads.queue_position, heads.seq)"
        ),
    }
}

/// The position that the queue of an owner has reached at a priority, of these expressions; null before its first job. The range finds the
/// newest version of the row (see [`leader_tables`](super::leader_tables)).
macro_rules! reached_position {
    ($priority:literal, $owner:literal) => {
        concat!(
            "(SELECT queue_position FROM fair_share WHERE (fair_share.priority, fair_share.owner) >= (",
            $priority,
            ", ",
            $owner,
            ") AND (fair_share.priority, fair_share.owner) <= (",
            $priority,
            ", ",
            $owner,
            ") ORDER BY fair_share.priority DESC, fair_share.owner DESC LIMIT 1)"
        )
    };
}

pub(super) use reached_position;

/// The rounds of the owners and of the projects of some priorities. A row without an owner is a project's.
pub(super) const ROUNDS: &str = "
    SELECT f.priority, o.project, f.owner, f.round, 0 AS turn, f.served FROM fair_share f CROSS JOIN owners o ON o.id = f.owner
    WHERE f.priority IN (SELECT CAST(atom AS BIGINT) FROM json_each(?1))
    UNION ALL SELECT priority, project, NULL, round, turn, served FROM project_rounds
    WHERE priority IN (SELECT CAST(atom AS BIGINT) FROM json_each(?1))";

/// The same for PostgreSQL. Claims change these rows all the time: the newest version has the last entry of its key, and a range of one key
/// is searched from its end.
const ROUNDS_IN_POSTGRES: &str = "
    WITH asked AS (SELECT CAST(atom AS BIGINT) AS priority FROM json_each(?1))
    SELECT f.priority, o.project, f.owner, f.round, 0 AS turn, f.served FROM asked CROSS JOIN owners o CROSS JOIN LATERAL (
        SELECT * FROM fair_share WHERE (priority, owner) >= (asked.priority, o.id) AND (priority, owner) <= (asked.priority, o.id)
        ORDER BY priority DESC, owner DESC LIMIT 1) AS f
    UNION ALL SELECT r.priority, r.project, NULL, r.round, r.turn, r.served
    FROM asked CROSS JOIN (SELECT DISTINCT project FROM owners) AS o CROSS JOIN LATERAL (
        SELECT * FROM project_rounds WHERE (priority, project) >= (asked.priority, o.project) AND (priority, project) <= (asked.priority, o.project)
        ORDER BY priority DESC, project DESC LIMIT 1) AS r";

/// [`ROUNDS`] in the words of an engine.
pub(super) fn rounds_in(engine: Engine) -> &'static str {
    match engine {
        Engine::Sqlite => ROUNDS,
        Engine::Postgres => ROUNDS_IN_POSTGRES,
    }
}

/// The rounds in rows of [`ROUNDS`].
pub(super) fn rounds_of(rows: &[Row]) -> Result<Rounds, StoreError> {
    let mut rounds = Rounds::default();
    for row in rows {
        let (priority, project, round) =
            (row.column("priority")?, row.column("project")?, row.column("round")?);
        match row.column::<Option<i64>>("owner")? {
            Some(owner) => rounds.record_owner(priority, (project, owner), round, row.column("served")?),
            None => {
                let turn = Turn { round, number: row.number("turn")? };
                rounds.record_project(priority, project, turn, row.column("served")?);
            }
        }
    }
    Ok(rounds)
}

/// The rounds of all owners and projects at the priorities of these queues.
pub(super) async fn rounds(tx: &mut Connection, queues: &[Vec<OwnerQueue>]) -> Result<Rounds, StoreError> {
    let mut priorities: Vec<i32> = queues.iter().flatten().map(|queue| queue.priority).collect();
    priorities.sort_unstable();
    priorities.dedup();
    if priorities.is_empty() {
        return Ok(Rounds::default());
    }
    rounds_of(
        &query(rounds_in(tx.engine())).bind(to_json("priorities", &priorities)?).fetch_all(&mut *tx).await?,
    )
}
