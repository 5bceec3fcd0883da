//! Taking in jobs and sweeps.

use std::collections::BTreeMap;

use roost_api::design::DesignKind;
use roost_api::ids::{JobId, SweepId};
use roost_api::job::{Cache, Needs};
use roost_api::sweep::SweepSpec;
use roost_api::time::Timestamp;
use roost_solver::SOLVER_REVISION;
use roost_solver::scenario::Scenario;
use serde_json::Value;
use sqlx::{AssertSqlSafe, SqliteConnection};

use super::columns::to_json;
use super::job_rows::{JobBatches, JobOptions, JobRow, insert_jobs, queue_start};
use super::{Store, StoreError};
use crate::sweep::Expansion;

/// A job about to be stored.
pub(crate) struct NewJob {
    /// Its identifier.
    pub id: JobId,
    /// Identifier of the token that submitted it; empty without one.
    pub token: String,
    /// The complete scenario.
    pub scenario: Scenario,
    /// Higher is claimed first.
    pub priority: i32,
    /// Free labels.
    pub labels: BTreeMap<String, String>,
    /// Requirements on its worker.
    pub needs: Needs,
    /// Longest wall time, in seconds.
    pub max_wall_s: Option<f64>,
    /// Simulated time from frame to frame, in seconds; none without frames.
    pub frame_interval_s: Option<f64>,
    /// Whether the result may come from the cache.
    pub cache: Cache,
}

/// A sweep about to be stored.
pub(crate) struct NewSweep {
    id: SweepId,
    name: String,
    text: String,
    design: DesignKind,
    factors: String,
    labels: String,
    points: usize,
    replicates: u32,
    batches: JobBatches,
    options: JobOptions,
}

impl NewSweep {
    /// Encodes a sweep that a token submitted, with the first batch of its jobs.
    pub(crate) fn new(
        id: SweepId,
        token: String,
        submitted: &Value,
        spec: SweepSpec,
        expansion: Expansion,
    ) -> Result<Self, StoreError> {
        let (jobs, replicates) = (expansion.jobs(), expansion.replicates);
        Ok(Self {
            id,
            text: to_json("sweep", submitted)?,
            design: spec.design.kind,
            factors: to_json("factors", &expansion.factors)?,
            labels: to_json("labels", &spec.labels)?,
            points: expansion.points.len(),
            replicates,
            batches: JobBatches::new(id, jobs, expansion.points.into_trials(0, replicates))?,
            options: JobOptions::of(&spec, token)?,
            name: spec.name,
        })
    }
}

impl Store {
    /// Stores a new job, with a cached result where that is allowed.
    pub(crate) async fn insert_job(&self, job: NewJob, now: Timestamp) -> Result<(), StoreError> {
        let row = JobRow::single(&job.scenario, job.id)?;
        let options = JobOptions {
            token: job.token,
            priority: job.priority,
            labels: to_json("labels", &job.labels)?,
            needs: job.needs,
            max_wall_s: job.max_wall_s,
            frame_interval_s: job.frame_interval_s,
            cache: job.cache,
        };
        self.writer
            .write(move |tx| {
                Box::pin(async move {
                    if exists(tx, "SELECT EXISTS (SELECT 1 FROM jobs WHERE id = ?)", job.id.to_string())
                        .await?
                    {
                        return Ok(());
                    }
                    let newest = newest(tx).await?;
                    let start = queue_start(tx, &options).await?;
                    insert_jobs(tx, &[row], &options, start, now).await?;
                    answer_from_cache(tx, newest, &options, now).await
                })
            })
            .await
    }

    /// Stores a new sweep with its design points and jobs, all or nothing.
    pub(crate) async fn insert_sweep(&self, sweep: NewSweep, now: Timestamp) -> Result<(), StoreError> {
        let is_large = sweep.batches.is_large();
        self.writer.write_as(is_large, move |tx| Box::pin(insert_sweep(tx, sweep, now))).await
    }
}

async fn insert_sweep(tx: &mut SqliteConnection, sweep: NewSweep, now: Timestamp) -> Result<(), StoreError> {
    let NewSweep { id, name, text, design, factors, labels, points, replicates, batches, options } = sweep;
    if exists(tx, "SELECT EXISTS (SELECT 1 FROM sweeps WHERE id = ?)", id.to_string()).await? {
        return Ok(());
    }
    sqlx::query(
        "INSERT INTO sweeps (id, name, spec, design, factors, labels, points, replicates, submitted_at)
         VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?)",
    )
    .bind(id.to_string())
    .bind(name)
    .bind(text)
    .bind(design.as_str())
    .bind(factors)
    .bind(labels)
    .bind(points as i64)
    .bind(replicates)
    .bind(now.0)
    .execute(&mut *tx)
    .await?;
    queue(tx, batches, &options, now).await
}

/// Queues the jobs of a sweep, with cached results where that is allowed.
pub(super) async fn queue(
    tx: &mut SqliteConnection,
    batches: JobBatches,
    options: &JobOptions,
    now: Timestamp,
) -> Result<(), StoreError> {
    let newest = newest(tx).await?;
    batches.insert(tx, options, now).await?;
    answer_from_cache(tx, newest, options, now).await
}

/// The number of the newest job.
async fn newest(tx: &mut SqliteConnection) -> Result<i64, StoreError> {
    Ok(sqlx::query_scalar("SELECT coalesce(max(seq), 0) FROM jobs").fetch_one(tx).await?)
}

/// Whether an earlier request with the same identifier has stored it.
async fn exists(tx: &mut SqliteConnection, sql: &'static str, id: String) -> Result<bool, StoreError> {
    Ok(sqlx::query_scalar(sql).bind(id).fetch_one(&mut *tx).await?)
}

/// The frames of a result that have the interval that a job asks for.
const MATCHING_FRAMES: &str = "frames f JOIN jobs recorded ON recorded.id = f.job_id
    WHERE f.job_id = results.job_id AND f.attempt = results.attempt AND recorded.frame_interval_s = jobs.frame_interval_s";

/// Gives the queued jobs after `newest` the result of an earlier run of the same scenario by this solver revision. A job with frames
/// needs a run with the same frame interval, and gets its frames.
async fn answer_from_cache(
    tx: &mut SqliteConnection,
    newest: i64,
    options: &JobOptions,
    now: Timestamp,
) -> Result<(), StoreError> {
    if options.cache != Cache::Use {
        return Ok(());
    }
    let answered = sqlx::query(AssertSqlSafe(format!(
        "INSERT INTO results
         SELECT jobs.id, 0, old.scenario_digest, old.solver_revision, old.backend, old.responses, old.document_digest, ?
         FROM jobs JOIN results AS old ON old.job_id =
             (SELECT job_id FROM results WHERE scenario_digest = jobs.scenario_digest AND solver_revision = ?
              AND (jobs.frame_interval_s IS NULL OR EXISTS (SELECT 1 FROM {MATCHING_FRAMES}))
              LIMIT 1)
         WHERE jobs.seq > ?"
    )))
    .bind(now.0)
    .bind(SOLVER_REVISION)
    .bind(newest)
    .execute(&mut *tx)
    .await?
    .rows_affected();
    if answered > 0 {
        sqlx::query(
            "UPDATE jobs SET state = 'succeeded', from_cache = 1, ended_at = ?
             WHERE seq > ? AND EXISTS (SELECT 1 FROM results WHERE job_id = jobs.id)",
        )
        .bind(now.0)
        .bind(newest)
        .execute(&mut *tx)
        .await?;
        sqlx::query(AssertSqlSafe(format!(
            "INSERT INTO frames
             SELECT jobs.id, 0, old.object_digest, old.bytes, old.count, old.stop_reason, ?
             FROM jobs JOIN frames AS old ON old.job_id =
                 (SELECT job_id FROM results WHERE scenario_digest = jobs.scenario_digest AND solver_revision = ?
                  AND EXISTS (SELECT 1 FROM {MATCHING_FRAMES}) LIMIT 1)
             WHERE jobs.seq > ? AND jobs.from_cache = 1"
        )))
        .bind(now.0)
        .bind(SOLVER_REVISION)
        .bind(newest)
        .execute(&mut *tx)
        .await?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use roost_solver::Limits;
    use roost_solver::mesh::Meshes;
    use serde_json::json;

    use super::*;
    use crate::sweep::{SweepLimits, read};

    async fn numbers(store: &Store) -> (i64, i64, i64, i64, i64) {
        let sql = "SELECT (SELECT count(*) FROM sweeps), (SELECT count(*) FROM design_points), count(*),
                   count(DISTINCT seed), coalesce(max(queue_position) - min(queue_position), 0) FROM jobs";
        sqlx::query_as(sql).fetch_one(&store.readers).await.unwrap()
    }

    #[tokio::test]
    async fn a_sweep_of_many_batches_is_stored_whole_or_not_at_all() {
        let dir = tempfile::tempdir().unwrap();
        let store = Store::open(&dir.path().join("roost.db"), None).await.unwrap();
        let base = json!({"experiment": "hopper", "product": {"count": 6, "subparticle_radius_m": 0.008}});
        let factors = json!([{"pointer": "/equipment/gate_opening_m", "levels": [0.05, 0.06]}]);
        let document = json!({"name": "s", "base": base, "design": {"kind": "grid"}, "factors": factors, "replicates": 1200});
        let limits = SweepLimits { max_jobs: 10_000, scenario: Limits::default() };
        let expanded = || read(document.clone(), &Meshes::default(), limits).unwrap();
        let sweep = || {
            let (spec, expansion) = expanded();
            NewSweep::new(SweepId::new(), String::new(), &document, spec, expansion).unwrap()
        };
        let (broken, cut_off) = (sweep(), expanded().1.points.into_trials(0, 1200).take(1700));
        let batches = JobBatches::new(broken.id, 2400, cut_off).unwrap();
        assert!(batches.is_large());
        let lost = store.insert_sweep(NewSweep { batches, ..broken }, Timestamp(0)).await;
        assert!(matches!(lost, Err(StoreError::Unfinished { queued: 1700, jobs: 2400 })), "{lost:?}");
        assert_eq!(numbers(&store).await, (0, 0, 0, 0, 0));

        store.insert_sweep(sweep(), Timestamp(0)).await.unwrap();
        assert_eq!(numbers(&store).await, (1, 2, 2400, 1200, 2399));
        store.close().await;
    }
}
