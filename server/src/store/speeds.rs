//! The data from which forecasts learn: finished runs with their wall times, running jobs, and scenarios of queued ones.
//!
//! Each query reads a bounded number of rows, whatever the size of the farm.

use roost_api::ids::{JobId, SweepId};
use roost_api::time::Timestamp;

use super::columns::Columns;
use super::database::{Row, query};
use super::eligible_jobs::claimable;
use super::waiting::QueueGroup;
use super::{Store, StoreError};

/// Places of a queue where scenarios are sampled, and scenarios at each.
const PLACES: i64 = 8;
const AT_PLACE: i64 = 4;
/// Jobs at a place that are searched for those with the same needs.
const SEARCHED: i64 = 500;

/// Maximum number of running jobs that are read.
pub(crate) const MAX_RUNNING: u32 = 2000;

/// A scenario by its digest, as JSON text.
#[derive(Clone, Debug)]
pub(crate) struct StoredScenario {
    pub(crate) digest: String,
    pub(crate) body: String,
}

/// A finished run.
#[derive(Clone, Debug)]
pub(crate) struct FinishedRun {
    pub(crate) scenario: StoredScenario,
    pub(crate) backend: String,
    /// From claim to result, in seconds.
    pub(crate) took_s: f64,
}

/// A running job.
#[derive(Clone, Debug)]
pub(crate) struct RunningJob {
    pub(crate) id: JobId,
    pub(crate) worker: String,
    pub(crate) sweep: Option<SweepId>,
    pub(crate) started_at: Timestamp,
}

macro_rules! finished {
    ($newest:literal) => {
        concat!(
            "SELECT j.scenario_digest, s.body, w.backend, a.ended_at - a.claimed_at AS took_ms FROM (",
            $newest,
            ") AS j
             JOIN attempts a ON a.job_id = j.id AND a.number = j.attempt AND a.outcome = 'succeeded' AND a.resumed_from_s IS NULL
             JOIN scenarios s ON s.digest = j.scenario_digest JOIN workers w ON w.id = a.worker_id LIMIT 200"
        )
    };
}

/// Up to 200 finished runs among the newest 1,000 succeeded jobs. Cached results and resumed attempts say nothing.
pub(super) const FINISHED: &str = finished!(
    "SELECT id, attempt, scenario_digest FROM jobs WHERE state = 'succeeded' AND ended_at IS NOT NULL ORDER BY seq DESC LIMIT 1000"
);

/// The same of one sweep.
pub(super) const FINISHED_OF_SWEEP: &str = finished!(
    "SELECT id, attempt, scenario_digest FROM jobs INDEXED BY jobs_by_sweep WHERE sweep_id = ? AND state = 'succeeded'
     ORDER BY ended_at DESC LIMIT 1000"
);

/// Scenarios of a queue's jobs with some needs, from a position on.
pub(super) const QUEUED: &str = concat!(
    "SELECT j.scenario_digest, s.body FROM (
         SELECT seq, needs_backend, needs_memory_mib FROM jobs j WHERE ",
    claimable!("j"),
    " AND j.priority = ? AND j.owner = ? AND j.queue = ? AND j.queue_position >= ?
         ORDER BY j.queue_position, j.seq LIMIT ?) AS found
     JOIN jobs j ON j.seq = found.seq JOIN scenarios s ON s.digest = j.scenario_digest
     WHERE found.needs_backend IS NOT DISTINCT FROM ? AND found.needs_memory_mib IS NOT DISTINCT FROM ? LIMIT ?"
);

/// Scenarios of a sweep from a design point on.
const OF_SWEEP: &str =
    "SELECT j.scenario_digest, s.body FROM jobs j JOIN scenarios s ON s.digest = j.scenario_digest
    WHERE j.sweep_id = ? AND j.point >= ? ORDER BY j.point LIMIT ?";

impl Store {
    /// Finished runs, of one sweep or of all jobs.
    pub(crate) async fn finished_runs(&self, sweep: Option<SweepId>) -> Result<Vec<FinishedRun>, StoreError> {
        let rows = match sweep {
            Some(sweep) => query(FINISHED_OF_SWEEP).bind(sweep.to_string()).fetch_all(&self.readers).await?,
            None => query(FINISHED).fetch_all(&self.readers).await?,
        };
        let run = |row: &Row| {
            Ok(FinishedRun {
                scenario: scenario(row)?,
                backend: row.column("backend")?,
                took_s: row.column::<i64>("took_ms")? as f64 / 1000.0,
            })
        };
        rows.iter().map(run).collect()
    }

    /// The running jobs, up to [`MAX_RUNNING`].
    pub(crate) async fn jobs_running(&self) -> Result<Vec<RunningJob>, StoreError> {
        let sql = "SELECT id, worker_id, sweep_id, started_at FROM jobs
                   WHERE state = 'running' AND lease_expires_at > 0 LIMIT ?";
        let rows = query(sql).bind(MAX_RUNNING).fetch_all(&self.readers).await?;
        let job = |row: &Row| {
            Ok(RunningJob {
                id: row.parsed("id")?,
                worker: row.column("worker_id")?,
                sweep: row.parsed_opt("sweep_id")?,
                started_at: row.moment("started_at")?,
            })
        };
        rows.iter().map(job).collect()
    }

    /// Scenarios of a group at up to 8 places of its queue, the first of which is its first job.
    pub(crate) async fn sampled_queue(&self, group: &QueueGroup) -> Result<Vec<StoredScenario>, StoreError> {
        let (mut found, span) = (Vec::new(), group.last - group.first + 1);
        for place in 0..PLACES.min(span) {
            let position = group.first + span * place / PLACES.min(span);
            let rows = query(QUEUED)
                .bind(group.priority)
                .bind(group.owner)
                .bind(group.queue)
                .bind(position)
                .bind(SEARCHED)
                .bind(&group.needs.backend)
                .bind(group.needs.memory_mib)
                .bind(AT_PLACE)
                .fetch_all(&self.readers)
                .await?;
            for row in &rows {
                found.push(scenario(row)?);
            }
        }
        Ok(found)
    }

    /// Scenarios of up to 8 design points of a sweep with this many.
    pub(crate) async fn sampled_sweep(
        &self,
        sweep: SweepId,
        points: u32,
    ) -> Result<Vec<StoredScenario>, StoreError> {
        let (mut found, points) = (Vec::new(), i64::from(points.max(1)));
        for place in 0..PLACES.min(points) {
            let point = points * place / PLACES.min(points);
            let rows =
                query(OF_SWEEP).bind(sweep.to_string()).bind(point).bind(1).fetch_all(&self.readers).await?;
            for row in &rows {
                found.push(scenario(row)?);
            }
        }
        Ok(found)
    }

    /// The scenario of a job.
    pub(crate) async fn scenario_of(&self, job: JobId) -> Result<Option<StoredScenario>, StoreError> {
        let sql = "SELECT j.scenario_digest, s.body FROM jobs j JOIN scenarios s ON s.digest = j.scenario_digest WHERE j.id = ?";
        let row = query(sql).bind(job.to_string()).fetch_optional(&self.readers).await?;
        row.as_ref().map(scenario).transpose()
    }
}

fn scenario(row: &Row) -> Result<StoredScenario, StoreError> {
    Ok(StoredScenario { digest: row.column("scenario_digest")?, body: row.column("body")? })
}
