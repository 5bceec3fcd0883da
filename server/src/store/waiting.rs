//! The view of claims on a queued job, and the lengths of the queues.
//!
//! The conditions are those of `eligible_jobs`, by the same macros. No query reads more than some thousand rows of a queue: longer ones
//! are known by the positions of their first and last job.

use std::collections::HashMap;
use std::time::Duration;

use roost_api::ids::{JobId, SweepId};
use roost_api::job::Needs;
use roost_api::time::Timestamp;

use super::columns::{Columns, to_json};
use super::database::{Row, query, query_scalar};
use super::eligible_jobs::{
    ROUNDS, can_continue, claimable, computing_attempt, fits, has_failed, heads, is_left_to, is_open,
    rounds_of, spent_owners,
};
use super::versions::QUEUED_AT;
use super::workers::online_window;
use super::{Store, StoreError};
use crate::queue::{Owner, Project, QueuedJob, Rounds, WorkerSight};

/// Maximum number of jobs of a queue that are counted one by one.
const MAX_COUNTED: u64 = 1000;

/// Maximum number of jobs of an owner's common queue that are counted.
const MAX_COMMON: i64 = 50_000;

/// Queued jobs of a sweep whose fills are looked at.
const MAX_FILL_JOBS: u64 = 200;

/// The place of a queued job.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct QueuePlace {
    pub(crate) seq: i64,
    pub(crate) priority: i32,
    pub(crate) owner: Owner,
    pub(crate) queue: i64,
    pub(crate) position: i64,
}

/// A queued job, its place, and when it was queued.
#[derive(Clone, Debug)]
pub(crate) struct StoredQueuedJob {
    pub(crate) job: QueuedJob,
    pub(crate) place: QueuePlace,
    pub(crate) since: Timestamp,
}

/// Jobs with the same needs in one queue that claims look at.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct QueueGroup {
    pub(crate) priority: i32,
    pub(crate) project: Project,
    pub(crate) owner: Owner,
    pub(crate) queue: i64,
    pub(crate) needs: Needs,
    /// Number of jobs.
    pub(crate) jobs: u64,
    /// Positions of the first and the last.
    pub(crate) first: i64,
    pub(crate) last: i64,
}

/// Number of jobs of a queue that come before a place, by needs.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct CountedJobs(Vec<(Needs, u64)>);

impl CountedJobs {
    /// Those with some needs.
    pub(crate) fn of(&self, needs: &Needs) -> u64 {
        self.0.iter().find(|(of, _)| of == needs).map_or(0, |(_, jobs)| *jobs)
    }

    /// Whether all were counted.
    pub(crate) fn are_all(&self) -> bool {
        self.0.iter().map(|(_, jobs)| jobs).sum::<u64>() <= MAX_COUNTED
    }
}

const JOB: &str = "SELECT j.*, a.outcome, a.message AS outcome_message FROM jobs j
    LEFT JOIN attempts a ON a.job_id = j.id AND a.number = j.attempt
    WHERE j.id = ? AND j.state = 'queued'";

/// Online workers, and what a claim of each sees of job ?1. ?4 is whether workers share fills.
pub(super) const SIGHTS: &str = concat!(
    "SELECT me.id, me.name, me.backend, me.memory_mib, me.draining, me.threads, ",
    fits!("j", "me"),
    " AS fits, NOT ",
    is_left_to!("j", "me"),
    " AS leaves_it, CASE WHEN ?4 <> 0 AND j.fill_digest IS NOT NULL AND NOT ",
    can_continue!("j", "me"),
    " THEN ",
    computing_attempt!("r.id", "j", "me"),
    " END AS fill_job,
        (SELECT count(*) FROM jobs WHERE worker_id = me.id AND state = 'running') AS jobs,
        (SELECT coalesce(max(alone), 0) FROM jobs WHERE worker_id = me.id AND state = 'running') AS alone
    FROM jobs j CROSS JOIN workers me
    WHERE j.id = ?1 AND me.last_seen_at BETWEEN ?2 AND ?3"
);

/// Every queue: number of jobs up to ?1, needs of the first one, positions of the first and the last. Whatever their length, each takes
/// some steps into the index.
pub(super) const QUEUES: &str = concat!(
    heads!(),
    "
    SELECT heads.priority, owners.project, projects.share, heads.owner, heads.queue, first.needs_backend, first.needs_memory_mib, first.queue_position AS first,
           (SELECT j.queue_position FROM jobs j WHERE ",
    claimable!("j"),
    " AND j.priority = heads.priority AND j.owner = heads.owner AND j.queue = heads.queue
            ORDER BY j.queue_position DESC, j.seq DESC LIMIT 1) AS last,
           (SELECT count(*) FROM (SELECT 1 FROM jobs j WHERE ",
    claimable!("j"),
    " AND j.priority = heads.priority AND j.owner = heads.owner AND j.queue = heads.queue LIMIT ?1) AS counted) AS jobs
    FROM heads CROSS JOIN owners ON owners.id = heads.owner CROSS JOIN projects ON projects.id = owners.project CROSS JOIN jobs first ON first.seq = (SELECT j.seq FROM jobs j WHERE ",
    claimable!("j"),
    " AND j.priority = heads.priority AND j.owner = heads.owner AND j.queue = heads.queue ORDER BY j.queue_position, j.seq LIMIT 1)
    WHERE ",
    is_open!()
);

/// The common queue of an owner by needs: the first jobs up to a limit.
pub(super) const COMMON: &str = concat!(
    "SELECT priority, owner, queue, needs_backend, needs_memory_mib,
            count(*) AS jobs, min(queue_position) AS first, max(queue_position) AS last
     FROM (SELECT * FROM jobs j WHERE ",
    claimable!("j"),
    " AND j.priority = ? AND j.owner = ? AND j.queue = 0 LIMIT ?) AS common GROUP BY priority, owner, queue, needs_backend, needs_memory_mib"
);

/// Jobs of a queue that come before a place, by needs, among the first ones up to a limit.
pub(super) const BEFORE: &str = concat!(
    "SELECT needs_backend, needs_memory_mib, count(*) AS jobs FROM (
         SELECT needs_backend, needs_memory_mib FROM jobs j WHERE ",
    claimable!("j"),
    " AND j.priority = ? AND j.owner = ? AND j.queue = ? AND (j.queue_position, j.seq) < (?, ?)
         ORDER BY j.queue_position, j.seq LIMIT ?) AS before GROUP BY needs_backend, needs_memory_mib"
);

/// The first or last queued jobs of a sweep, in the order of submission.
macro_rules! some_queued {
    ($order:literal, $limit:literal) => {
        concat!(
            "(SELECT * FROM jobs INDEXED BY jobs_by_sweep WHERE sweep_id = ?1 AND state = 'queued'
              ORDER BY ended_at ",
            $order,
            ", seq ",
            $order,
            " LIMIT ",
            $limit,
            ")"
        )
    };
}

/// Of the first jobs of sweep ?1, those that every online worker with what they need passes over because of a fill that is being
/// computed: their number, and one of the computing jobs.
pub(super) const WAITING_FOR_FILLS: &str = concat!(
    "SELECT count(*) AS jobs, min((SELECT ",
    computing_attempt!("r.id", "j", "me"),
    " FROM workers me WHERE me.last_seen_at BETWEEN ?2 AND ?3 AND ",
    fits!("j", "me"),
    " LIMIT 1)) AS fill_job FROM ",
    some_queued!("ASC", "?4"),
    " AS j WHERE ",
    claimable!("j"),
    " AND j.fill_digest IS NOT NULL AND NOT EXISTS (
         SELECT 1 FROM workers me WHERE me.last_seen_at BETWEEN ?2 AND ?3 AND me.draining = 0 AND ",
    fits!("j", "me"),
    " AND (",
    can_continue!("j", "me"),
    " OR NOT EXISTS ",
    computing_attempt!("1", "j", "me"),
    "))"
);

/// The first and the last job of sweep ?1 that claims look at, among the first and last 1,000 queued ones.
pub(super) const SWEEP_ENDS: [&str; 2] = [
    concat!(
        "SELECT * FROM ",
        some_queued!("ASC", "1000"),
        " AS j WHERE ",
        claimable!("j"),
        " ORDER BY seq LIMIT 1"
    ),
    concat!(
        "SELECT * FROM ",
        some_queued!("DESC", "1000"),
        " AS j WHERE ",
        claimable!("j"),
        " ORDER BY seq DESC LIMIT 1"
    ),
];

/// Jobs of a sweep in a pause after a failure, up to 1,000, and the oldest of them.
pub(super) const IN_PAUSE: &str = "SELECT found.jobs, (SELECT id FROM jobs WHERE seq = found.oldest) AS first FROM (
    SELECT count(*) AS jobs, min(seq) AS oldest FROM (
        SELECT seq FROM jobs INDEXED BY jobs_by_not_before WHERE not_before IS NOT NULL AND paused = 0 AND sweep_id = ? LIMIT 1000) AS pausing) AS found";

impl Store {
    /// A queued job and its place; none in any other state.
    pub(crate) async fn queued_job(&self, id: JobId) -> Result<Option<StoredQueuedJob>, StoreError> {
        let row = query(JOB).bind(id.to_string()).fetch_optional(&self.readers).await?;
        let Some(row) = row else { return Ok(None) };
        let seq: i64 = row.column("seq")?;
        let since: Option<i64> = query_scalar(QUEUED_AT).bind(seq).fetch_optional(&self.readers).await?;
        let newest = match row.parsed_opt("outcome")? {
            Some(outcome) => {
                let message: Option<String> = row.column("outcome_message")?;
                Some((row.number("attempt")?, outcome, message.unwrap_or_default()))
            }
            None => None,
        };
        let place = place(&row)?;
        let job = QueuedJob {
            spent: self.spent_budget(place.owner).await?,
            paused: row.column("paused")?,
            retry_at: row.moment_opt("not_before")?,
            newest,
            alone: row.column("alone")?,
            needs: needs(&row)?,
        };
        let since = Timestamp(since.unwrap_or(row.column("submitted_at")?));
        Ok(Some(StoredQueuedJob { job, place, since }))
    }

    /// The requirements of a job, in any state.
    pub(crate) async fn needs_of_job(&self, id: JobId) -> Result<Needs, StoreError> {
        self.needs("SELECT needs_backend, needs_memory_mib FROM jobs WHERE id = ?", id.to_string()).await
    }

    /// The requirements of each job of a sweep, in any state.
    pub(crate) async fn needs_of_sweep(&self, id: SweepId) -> Result<Needs, StoreError> {
        let sql = "SELECT needs_backend, needs_memory_mib FROM jobs WHERE sweep_id = ? LIMIT 1";
        self.needs(sql, id.to_string()).await
    }

    async fn needs(&self, sql: &'static str, id: String) -> Result<Needs, StoreError> {
        let row = query(sql).bind(id).fetch_optional(&self.readers).await?;
        row.as_ref().map_or_else(|| Ok(Needs::default()), needs)
    }

    /// Online workers, and what their claims see of a job. The caller sets the slots.
    pub(crate) async fn sights(
        &self,
        job: JobId,
        shares_fills: bool,
        now: Timestamp,
        lease: Duration,
    ) -> Result<Vec<(String, WorkerSight)>, StoreError> {
        let (since, until) = online_window(now, lease);
        let rows = query(SIGHTS)
            .bind(job.to_string())
            .bind(since.0)
            .bind(until.0)
            .bind(shares_fills)
            .fetch_all(&self.readers)
            .await?;
        let sight = |row: &Row| {
            let sight = WorkerSight {
                name: row.column("name")?,
                backend: row.column("backend")?,
                memory_mib: row.number_opt("memory_mib")?,
                draining: row.column("draining")?,
                // Unknown, and so no fit, where the worker states no memory.
                fits: row.column::<Option<bool>>("fits")?.unwrap_or(false),
                leaves_it: row.column::<Option<bool>>("leaves_it")?.unwrap_or(false),
                fill_job: row.parsed_opt("fill_job")?,
                jobs: row.number("jobs")?,
                alone: row.column("alone")?,
                slots: row.number("threads")?,
            };
            Ok((row.column("id")?, sight))
        };
        rows.iter().map(sight).collect()
    }

    /// The lengths of all queues that claims look at, by priority, and the rounds of their owners and projects.
    ///
    /// A sweep in a queue of its own has consecutive positions: above [`MAX_COUNTED`], they give the number of its jobs. Of the common
    /// queue of an owner, which has single jobs and small sweeps, up to [`MAX_COMMON`] jobs are counted by needs.
    pub(crate) async fn queue_groups(&self) -> Result<(Vec<QueueGroup>, Rounds), StoreError> {
        let rows = query(QUEUES).bind(MAX_COUNTED as i64 + 1).fetch_all(&self.readers).await?;
        let mut groups = Vec::with_capacity(rows.len());
        for row in &rows {
            let project = Project { id: row.column("project")?, share: row.number("share")? };
            let mut found = group(row, project)?;
            if found.queue == 0 {
                let common = query(COMMON).bind(found.priority).bind(found.owner).bind(MAX_COMMON);
                for row in common.fetch_all(&self.readers).await? {
                    groups.push(group(&row, project)?);
                }
                continue;
            }
            if found.jobs > MAX_COUNTED {
                found.jobs = found.jobs.max((found.last - found.first + 1).unsigned_abs());
            }
            groups.push(found);
        }
        let mut priorities: Vec<i32> = groups.iter().map(|group| group.priority).collect();
        priorities.sort_unstable();
        priorities.dedup();
        let rows = query(ROUNDS).bind(to_json("priorities", &priorities)?).fetch_all(&self.readers).await?;
        let rounds = rounds_of(&rows)?;
        Ok((groups, rounds))
    }

    /// Jobs of a queue of an owner that come before a place. Of a long queue, the first [`MAX_COUNTED`] + 1 are counted, whatever they need.
    pub(crate) async fn jobs_before(&self, queue: i64, place: QueuePlace) -> Result<CountedJobs, StoreError> {
        let rows = query(BEFORE)
            .bind(place.priority)
            .bind(place.owner)
            .bind(queue)
            .bind(place.position)
            .bind(place.seq)
            .bind(MAX_COUNTED as i64 + 1)
            .fetch_all(&self.readers)
            .await?;
        let count = |row: &Row| Ok((needs(row)?, row.number("jobs")?));
        Ok(CountedJobs(rows.iter().map(count).collect::<Result<_, StoreError>>()?))
    }

    /// The first job of a sweep that claims look at, its place, and the place of the last one.
    pub(crate) async fn sweep_ends(
        &self,
        sweep: SweepId,
    ) -> Result<Option<(JobId, QueuePlace, QueuePlace)>, StoreError> {
        let id = sweep.to_string();
        let first = query(SWEEP_ENDS[0]).bind(&id).fetch_optional(&self.readers).await?;
        let last = query(SWEEP_ENDS[1]).bind(&id).fetch_optional(&self.readers).await?;
        match (first, last) {
            (Some(first), Some(last)) => Ok(Some((first.parsed("id")?, place(&first)?, place(&last)?))),
            _ => Ok(None),
        }
    }

    /// Number of jobs of a sweep in a pause after a failure, and one of them.
    pub(crate) async fn jobs_in_pause(&self, sweep: SweepId) -> Result<(u64, Option<JobId>), StoreError> {
        let row = query(IN_PAUSE).bind(sweep.to_string()).fetch_one(&self.readers).await?;
        Ok((row.number("jobs")?, row.parsed_opt("first")?))
    }

    /// Of the first jobs of a sweep, the number that wait for fills, and a job that computes one of these.
    pub(crate) async fn waiting_for_fills(
        &self,
        sweep: SweepId,
        now: Timestamp,
        lease: Duration,
    ) -> Result<(u64, Option<JobId>), StoreError> {
        let (since, until) = online_window(now, lease);
        let row = query(WAITING_FOR_FILLS)
            .bind(sweep.to_string())
            .bind(since.0)
            .bind(until.0)
            .bind(MAX_FILL_JOBS as i64)
            .fetch_one(&self.readers)
            .await?;
        Ok((row.number("jobs")?, row.parsed_opt("fill_job")?))
    }
}

fn needs(row: &Row) -> Result<Needs, StoreError> {
    Ok(Needs { backend: row.column("needs_backend")?, memory_mib: row.number_opt("needs_memory_mib")? })
}

fn group(row: &Row, project: Project) -> Result<QueueGroup, StoreError> {
    Ok(QueueGroup {
        priority: row.column("priority")?,
        project,
        owner: row.column("owner")?,
        queue: row.column("queue")?,
        needs: needs(row)?,
        jobs: row.number("jobs")?,
        first: row.column("first")?,
        last: row.column("last")?,
    })
}

fn place(row: &Row) -> Result<QueuePlace, StoreError> {
    Ok(QueuePlace {
        seq: row.column("seq")?,
        priority: row.column("priority")?,
        owner: row.column("owner")?,
        queue: row.column("queue")?,
        position: row.column("queue_position")?,
    })
}

/// Groups by the queue of one owner and priority.
pub(crate) fn by_owner(groups: &[QueueGroup], priority: i32) -> HashMap<Owner, Vec<&QueueGroup>> {
    let mut owners: HashMap<Owner, Vec<&QueueGroup>> = HashMap::new();
    for group in groups.iter().filter(|group| group.priority == priority) {
        owners.entry(group.owner).or_default().push(group);
    }
    owners
}
