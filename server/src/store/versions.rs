//! Versions of what is shown: they change when it may have changed, and are read without reading it.

use roost_api::ids::{JobId, SweepId};
use roost_api::job::JobState;
use roost_api::time::Timestamp;

use super::rows::Columns;
use super::{Store, StoreError};

/// What is looked at.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Subject {
    /// Listings of all jobs or sweeps.
    Everything,
    /// One job.
    Job(JobId),
    /// One sweep and its jobs.
    Sweep(SweepId),
    /// The workers.
    Workers,
    /// The meshes.
    Meshes,
}

impl Store {
    /// The version of a subject: what happened to it last, and what was added to it last. Each is one step down an index.
    pub(crate) async fn version(&self, subject: Subject) -> Result<String, StoreError> {
        let (sql, id) = match subject {
            Subject::Everything => (EVERYTHING, None),
            Subject::Job(id) => (JOB, Some(id.to_string())),
            Subject::Sweep(id) => (SWEEP, Some(id.to_string())),
            Subject::Workers => (WORKERS, None),
            Subject::Meshes => ("SELECT 0, coalesce(max(seq), 0) FROM meshes", None),
        };
        let mut query = sqlx::query_as::<_, (i64, i64)>(sql);
        if let Some(id) = id {
            query = query.bind(id);
        }
        let (changed, added) = query.fetch_one(&self.readers).await?;
        Ok(format!("{changed}.{added}"))
    }
}

impl Store {
    /// How many jobs there are in each state, and how many workers were heard of since then.
    pub(crate) async fn census(&self, since: Timestamp) -> Result<(Vec<(JobState, i64)>, i64), StoreError> {
        let rows = sqlx::query(CENSUS).fetch_all(&self.readers).await?;
        let jobs = rows.iter().map(|row| Ok((row.parsed("state")?, row.column("jobs")?)));
        let jobs = jobs.collect::<Result<_, StoreError>>()?;
        let workers = sqlx::query_scalar("SELECT count(*) FROM workers WHERE last_seen_at >= ?")
            .bind(since.0)
            .fetch_one(&self.readers)
            .await?;
        Ok((jobs, workers))
    }
}

/// By the partial indexes: no row of a job is read.
pub(super) const CENSUS: &str = "
    SELECT 'queued' AS state, (SELECT count(*) FROM jobs WHERE state = 'queued' AND not_before IS NULL)
                            + (SELECT count(*) FROM jobs WHERE not_before IS NOT NULL) AS jobs
    UNION ALL SELECT 'running', count(*) FROM jobs WHERE state = 'running' AND lease_expires_at > 0
    UNION ALL SELECT state, count(*) FROM jobs WHERE ended_at IS NOT NULL GROUP BY state";

const EVERYTHING: &str = "SELECT (SELECT coalesce(max(seq), 0) FROM events),
    (SELECT coalesce(max(seq), 0) FROM jobs) + (SELECT coalesce(max(seq), 0) FROM sweeps)";
pub(super) const JOB: &str = "SELECT coalesce(max(seq), 0), 0 FROM events WHERE job_id = ?";
pub(super) const SWEEP: &str = "SELECT (SELECT coalesce(max(seq), 0) FROM events WHERE sweep_id = ?1),
    (SELECT coalesce(max(seq), 0) FROM jobs WHERE sweep_id = ?1)";
const WORKERS: &str = "SELECT (SELECT coalesce(max(seq), 0) FROM events),
    (SELECT coalesce(max(last_seen_at), 0) + count(*) + coalesce(sum(draining), 0) FROM workers)";
