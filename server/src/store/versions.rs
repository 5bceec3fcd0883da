//! Versions for ETags: a version changes when its subject may have changed, and is cheaper to read than the subject.

use std::collections::HashMap;
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use roost_api::ids::{JobId, SweepId};
use roost_api::job::JobState;
use roost_api::time::Timestamp;

use super::columns::Columns;
use super::database::{query, query_as, query_scalar};
use super::eligible_jobs::spent_owners;
use super::workers::online_window;
use super::{Store, StoreError};

/// Cached versions, each with the number of commits before it was read. A version is valid until the next commit begins.
#[derive(Default)]
pub(super) struct Cache(Mutex<HashMap<Subject, (u64, Option<String>)>>);

/// Maximum number of cached versions; then the cache is cleared.
const CACHED: usize = 1000;

impl Cache {
    fn get(&self, subject: Subject, commits: u64) -> Option<Option<String>> {
        let known = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        known.get(&subject).filter(|(at, _)| *at == commits).map(|(_, version)| version.clone())
    }

    fn put(&self, subject: Subject, commits: u64, version: Option<String>) {
        let mut known = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if known.len() >= CACHED {
            known.clear();
        }
        known.insert(subject, (commits, version));
    }
}

/// The subject of a version.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Subject {
    /// Listings of all jobs or sweeps.
    Everything,
    /// One job.
    Job(JobId),
    /// One sweep and its jobs.
    Sweep(SweepId),
    /// Listings of all studies.
    Studies,
    /// One study and its jobs.
    Study(SweepId),
    /// The workers.
    Workers,
    /// The meshes.
    Meshes,
}

impl Store {
    /// The version of a subject: the numbers of its newest event and its newest row, each from the end of an index. Of a job, the second
    /// number is 1 while it is queued. None for a job or sweep that does not exist.
    pub(crate) async fn version(&self, subject: Subject) -> Result<Option<String>, StoreError> {
        let commits = self.writer.commits().settled();
        if let Some(version) = commits.and_then(|commits| self.versions.get(subject, commits)) {
            return Ok(version);
        }
        let (sql, id) = match subject {
            Subject::Everything => (EVERYTHING, None),
            Subject::Job(id) => (JOB, Some(id.to_string())),
            Subject::Sweep(id) => (SWEEP, Some(id.to_string())),
            Subject::Studies => (STUDIES, None),
            Subject::Study(id) => (STUDY, Some(id.to_string())),
            Subject::Workers => (WORKERS, None),
            Subject::Meshes => (MESHES, None),
        };
        let mut query = query_as::<(i64, i64)>(sql);
        if let Some(id) = id {
            query = query.bind(id);
        }
        let found = query.fetch_optional(&self.readers).await?;
        let version = found.map(|(changed, added)| format!("{changed}.{added}"));
        if let Some(commits) = commits {
            self.versions.put(subject, commits, version.clone());
        }
        Ok(version)
    }
}

/// Numbers of jobs and workers.
pub(crate) struct QueueCounts {
    /// Jobs by state. A state may occur several times: the numbers add up.
    pub(crate) jobs: Vec<(JobState, i64)>,
    /// Jobs that a user has paused, queued or running.
    pub(crate) paused: i64,
    /// Time at which the oldest queued job was queued. Jobs in a pause, and of a project that has used up its budget, do not count.
    pub(crate) oldest_queued_at: Option<Timestamp>,
    /// Workers that were seen within a lease.
    pub(crate) workers: i64,
}

impl Store {
    /// Counts jobs and workers.
    pub(crate) async fn queue_counts(
        &self,
        now: Timestamp,
        lease: Duration,
    ) -> Result<QueueCounts, StoreError> {
        let rows = query(QUEUE_COUNTS).fetch_all(&self.readers).await?;
        let jobs = rows.iter().map(|row| Ok((row.parsed("state")?, row.column("jobs")?)));
        let jobs = jobs.collect::<Result<_, StoreError>>()?;
        let mut oldest: Option<i64> = None;
        for row in &rows {
            oldest = oldest.or(row.column("oldest")?);
        }
        let oldest_queued_at: Option<i64> =
            query_scalar(QUEUED_AT).bind(oldest).fetch_optional(&self.readers).await?;
        let (since, until) = online_window(now, lease);
        let workers = query_scalar("SELECT count(*) FROM workers WHERE last_seen_at BETWEEN ? AND ?")
            .bind(since.0)
            .bind(until.0)
            .fetch_one(&self.readers)
            .await?;
        let paused = query_scalar(PAUSED).fetch_one(&self.readers).await?;
        Ok(QueueCounts { jobs, paused, oldest_queued_at: oldest_queued_at.map(Timestamp), workers })
    }
}

/// Jobs that a user has paused.
pub(super) const PAUSED: &str = "SELECT count(*) FROM jobs WHERE paused = 1";

/// Partial indexes serve it: no row of a job is read. Jobs of sweeps that are being submitted or deleted are counted, and then
/// subtracted in rows of their own. `oldest` is the queued job that was submitted first, and whose project has budget left.
pub(super) const QUEUE_COUNTS: &str = concat!(
    "
    SELECT 'queued' AS state, count(*) + (SELECT count(*) FROM jobs WHERE not_before IS NOT NULL)
               + (SELECT count(*) FROM jobs WHERE paused = 1 AND state = 'queued' AND not_before IS NULL) AS jobs,
           min(seq) FILTER (WHERE queue NOT IN (SELECT seq FROM sweeps WHERE state <> 'ready') AND owner NOT IN ",
    spent_owners!(),
    ") AS oldest
    FROM jobs WHERE state = 'queued' AND not_before IS NULL AND paused = 0
    UNION ALL SELECT 'running', count(*), NULL FROM jobs WHERE state = 'running' AND lease_expires_at > 0
    UNION ALL SELECT state, count(*), NULL FROM jobs WHERE ended_at IS NOT NULL GROUP BY state
    UNION ALL SELECT state, -count(*), NULL FROM jobs
              WHERE sweep_id IN (SELECT id FROM sweeps WHERE state <> 'ready') GROUP BY sweep_id, state"
);

/// Time at which a job was queued; for a job that was queued again, the time of its newest event.
pub(super) const QUEUED_AT: &str = "
    SELECT coalesce((SELECT at FROM events WHERE job_id = jobs.id ORDER BY seq DESC LIMIT 1), submitted_at)
    FROM jobs WHERE seq = ?";

// `sqlite_sequence` has the highest number of each table, with PostgreSQL except for events. It never goes down, even when rows are
// deleted.

/// The number of the newest event ever; null before the first. PostgreSQL notes the numbers of deleted events alone.
macro_rules! last_event {
    () => {
        "(SELECT max(seq) FROM (SELECT seq FROM sqlite_sequence WHERE name = 'events' UNION ALL SELECT max(seq) FROM events) AS numbers)"
    };
}

pub(super) use last_event;

const EVERYTHING: &str = concat!("SELECT coalesce(", last_event!(), ", 0),
    (SELECT CAST(coalesce(sum(seq), 0) AS BIGINT) FROM sqlite_sequence WHERE name IN ('jobs', 'sweeps', 'deletions'))");
// Where the events of a job or sweep were deleted, the oldest stored event is the version: the deleted ones were older.
pub(super) const JOB: &str = concat!(
    "SELECT coalesce(
        (SELECT max(seq) FROM events WHERE job_id = ?1), -(SELECT min(seq) FROM events),
        -(",
    last_event!(),
    " + 1), 0), CASE state WHEN 'queued' THEN 1 ELSE 0 END
    FROM jobs WHERE id = ?1"
);
pub(super) const SWEEP: &str = concat!(
    "SELECT coalesce(
        (SELECT max(seq) FROM events WHERE sweep_id = ?1), -(SELECT min(seq) FROM events),
        -(",
    last_event!(),
    " + 1), 0),
    (SELECT coalesce(max(seq), 0) FROM jobs WHERE sweep_id = ?1)
    FROM sweeps WHERE id = ?1 AND state = 'ready'"
);
const STUDIES: &str = concat!("SELECT coalesce(", last_event!(), ", 0),
    (SELECT CAST(coalesce(sum(seq), 0) AS BIGINT) FROM sqlite_sequence WHERE name IN ('jobs', 'sweeps', 'deletions'))
        + (SELECT CAST(coalesce(sum(changes), 0) AS BIGINT) FROM studies)");

const STUDY: &str = concat!(
    "SELECT coalesce(
        (SELECT max(seq) FROM events WHERE sweep_id = ?1), -(SELECT min(seq) FROM events),
        -(",
    last_event!(),
    " + 1), 0),
    (SELECT coalesce(max(seq), 0) FROM jobs WHERE sweep_id = ?1) + studies.changes
    FROM studies JOIN sweeps ON sweeps.id = studies.sweep_id AND sweeps.state = 'ready' WHERE sweep_id = ?1"
);

const WORKERS: &str = concat!("SELECT coalesce(", last_event!(), ", 0),
    (SELECT coalesce(max(last_seen_at), 0) + count(*) + CAST(coalesce(sum(draining), 0) AS BIGINT) FROM workers)");
const MESHES: &str = "SELECT (SELECT coalesce(max(seq), 0) FROM sqlite_sequence WHERE name = 'meshes'),
    (SELECT count(*) FROM meshes)";
