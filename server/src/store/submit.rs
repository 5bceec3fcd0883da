//! Taking in jobs and sweeps.
//!
//! A large sweep is stored in slices, each a transaction, so that other writes wait for one slice at most. Its state is `submitting`
//! meanwhile: no query shows it and no claim takes its jobs. One update makes it `ready`, which all of its jobs then are.
//!
//! ```text
//! submitting ──► ready ──► deleting ──► (no row)
//!      └──────── failed or interrupted ────┘
//! ```

use std::sync::Arc;

use roost_api::design::DesignKind;
use roost_api::ids::SweepId;
use roost_api::job::Cache;
use roost_api::sweep::SweepSpec;
use roost_api::time::Timestamp;
use roost_solver::SOLVER_REVISION;

use super::columns::to_json;
use super::database::{AssertSqlSafe, Connection, query, query_scalar};
use super::deletion::change_listings;
pub(crate) use super::job_rows::NewJob;
use super::job_rows::{JobBatches, JobOptions, JobRow, QueueStart, insert_jobs, insert_points, queue_start};
use super::{Store, StoreError};
#[cfg(test)]
use crate::sweep::Trial;
use crate::sweep::{Expansion, runs_per_sample};

/// A sweep about to be stored.
pub(crate) struct NewSweep {
    head: SweepHead,
    batches: JobBatches,
    options: JobOptions,
}

/// The row of a sweep.
struct SweepHead {
    id: SweepId,
    name: String,
    text: String,
    design: DesignKind,
    factors: String,
    labels: String,
    points: usize,
    replicates: u32,
    runs_per_sample: Option<u32>,
}

impl NewSweep {
    /// A sweep that a token submitted as the JSON `text`. Encoding of its jobs begins.
    pub(crate) fn new(
        id: SweepId,
        token: String,
        text: String,
        spec: SweepSpec,
        expansion: Expansion,
    ) -> Result<Self, StoreError> {
        let Expansion { factors, points, replicates, .. } = expansion;
        let jobs = points.len() as u64 * u64::from(replicates);
        Ok(Self {
            options: JobOptions::of(&spec, token)?,
            head: SweepHead {
                id,
                text,
                design: spec.design.kind,
                factors: to_json("factors", &factors)?,
                labels: to_json("labels", &spec.labels)?,
                runs_per_sample: runs_per_sample(&spec),
                name: spec.name,
                points: points.len(),
                replicates,
            },
            batches: JobBatches::start(id, jobs, move |encoder| encoder.encode(points.trials(0, replicates))),
        })
    }
}

#[cfg(test)]
impl NewSweep {
    /// A sweep of these trials.
    pub(super) fn simulated(id: SweepId, (token, priority): (&str, i32), trials: Vec<Trial>) -> Self {
        let jobs = trials.len();
        let json = || "{}".to_owned();
        Self {
            head: SweepHead {
                id,
                name: "simulated".to_owned(),
                text: json(),
                design: DesignKind::Grid,
                factors: json(),
                labels: json(),
                points: jobs,
                replicates: 1,
                runs_per_sample: None,
            },
            options: JobOptions {
                token: token.to_owned(),
                priority,
                labels: json(),
                needs: Default::default(),
                max_wall_s: None,
                frame_interval_s: None,
                cache: Cache::Bypass,
                shared_fill: true,
            },
            batches: JobBatches::start(id, jobs as u64, move |encoder| encoder.encode(trials.into_iter())),
        }
    }
}

/// A sweep that is stored in slices.
pub(crate) struct SlicedSweep {
    batches: JobBatches,
    options: Arc<JobOptions>,
    next: QueueStart,
}

impl Store {
    /// Stores a new job, with a cached result where that is allowed.
    pub(crate) async fn insert_job(&self, job: NewJob, now: Timestamp) -> Result<(), StoreError> {
        let row = JobRow::single(&job.scenario, job.id)?;
        let (id, options) = (job.id, job.options()?);
        self.writer
            .write(move |tx| {
                Box::pin(async move {
                    if exists(tx, "SELECT EXISTS (SELECT 1 FROM jobs WHERE id = ?)", id.to_string()).await? {
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

    /// Stores a new sweep with its design points and jobs, all or nothing. Drops `mesh_lock` once a row names its meshes.
    pub(crate) async fn insert_sweep(
        &self,
        sweep: NewSweep,
        now: Timestamp,
        mesh_lock: impl Send,
    ) -> Result<(), StoreError> {
        if !sweep.batches.is_large() {
            return self.insert_small(sweep, now).await;
        }
        let id = sweep.head.id;
        let Some(mut submission) = self.begin_sweep(sweep, now).await? else { return Ok(()) };
        drop(mesh_lock);
        loop {
            match self.store_slice(&mut submission, now).await {
                Ok(true) => {}
                Ok(false) => return Ok(()),
                Err(error) => {
                    // If this fails too, a background task or the next start deletes them.
                    if let Err(error) = self.delete_remains(id).await {
                        tracing::error!(
                            error = error.as_dyn(),
                            "deleting the jobs of a failed submission failed"
                        );
                    }
                    return Err(error);
                }
            }
        }
    }

    /// Stores a sweep of one batch in one transaction.
    async fn insert_small(&self, sweep: NewSweep, now: Timestamp) -> Result<(), StoreError> {
        let NewSweep { head, mut batches, options } = sweep;
        self.delete_remains(head.id).await?;
        let batch = batches.next().await?.unwrap_or_default();
        // The second call checks that no job is missing.
        batches.next().await?;
        self.writer
            .write(move |tx| {
                Box::pin(async move {
                    if exists(tx, SUBMITTED, head.id.to_string()).await? {
                        return Ok(());
                    }
                    insert_head(tx, head, "ready", now).await?;
                    let start = queue_start(tx, &options).await?;
                    queue_jobs(tx, &batch, &options, start, now).await
                })
            })
            .await
    }

    /// Stores the row of a large sweep in the state `submitting`. None if an earlier request has stored the sweep, or a user has deleted it.
    pub(super) async fn begin_sweep(
        &self,
        sweep: NewSweep,
        now: Timestamp,
    ) -> Result<Option<SlicedSweep>, StoreError> {
        let NewSweep { head, batches, options } = sweep;
        let (id, options) = (head.id, Arc::new(options));
        self.delete_remains(id).await?;
        let shared = options.clone();
        let begun = self.writer.write(move |tx| {
            Box::pin(async move {
                if exists(tx, SUBMITTED, id.to_string()).await? {
                    return Ok(None);
                }
                let queue = insert_head(tx, head, "submitting", now).await?;
                Ok(Some(QueueStart { queue, ..queue_start(tx, &shared).await? }))
            })
        });
        Ok(begun.await?.map(|next| SlicedSweep { batches, options, next }))
    }

    /// Stores the next jobs of a sweep. Returns false when all are stored and the sweep is visible.
    pub(super) async fn store_slice(
        &self,
        submission: &mut SlicedSweep,
        now: Timestamp,
    ) -> Result<bool, StoreError> {
        let seq = submission.next.queue;
        let Some(batch) = submission.batches.next().await? else {
            let shown = self.writer.write(move |tx| {
                Box::pin(async move {
                    let sql = "UPDATE sweeps SET state = 'ready' WHERE seq = ? AND state = 'submitting'";
                    if query(sql).bind(seq).execute(&mut *tx).await?.rows_affected() == 0 {
                        return Err(StoreError::Interrupted);
                    }
                    change_listings(tx).await
                })
            });
            return shown.await.map(|()| false);
        };
        let (options, start) = (submission.options.clone(), submission.next);
        submission.next.position += batch.len() as i64;
        self.writer
            .write_as(true, move |tx| {
                Box::pin(async move { queue_jobs(tx, &batch, &options, start, now).await })
            })
            .await?;
        Ok(true)
    }

    /// Deletes what a failed or interrupted submission of the same sweep has left.
    async fn delete_remains(&self, id: SweepId) -> Result<(), StoreError> {
        let sql = "SELECT EXISTS (SELECT 1 FROM sweeps WHERE id = ? AND state <> 'ready')";
        if !query_scalar(sql).bind(id.to_string()).fetch_one(&self.readers).await? {
            return Ok(());
        }
        let hidden = self.writer.write(move |tx| {
            Box::pin(async move {
                let sql =
                    "UPDATE sweeps SET state = 'deleting' WHERE id = ? AND state <> 'ready' RETURNING seq";
                Ok(query_scalar(sql).bind(id.to_string()).fetch_optional(&mut *tx).await?)
            })
        });
        if let Some(seq) = hidden.await? {
            self.delete_hidden(seq).await?;
        }
        Ok(())
    }
}

/// Whether an earlier request has stored a sweep. One that a user has deleted does not return with a repeat of its submission.
const SUBMITTED: &str = "SELECT EXISTS (SELECT 1 FROM sweeps WHERE id = ?1) OR EXISTS (SELECT 1 FROM deletions WHERE sweep_id = ?1)";

/// Stores the row of a study's sweep. Returns false, and changes nothing, if an earlier request has stored it.
pub(super) async fn insert_study_sweep(
    tx: &mut Connection,
    id: SweepId,
    spec: &SweepSpec,
    (factors, points): (&[String], u32),
    now: Timestamp,
) -> Result<bool, StoreError> {
    if exists(tx, SUBMITTED, id.to_string()).await? {
        return Ok(false);
    }
    let head = SweepHead {
        id,
        name: spec.name.clone(),
        text: to_json("sweep", spec)?,
        design: spec.design.kind,
        factors: to_json("factors", factors)?,
        labels: to_json("labels", &spec.labels)?,
        // A study that clients drive begins without a job, and a sweep has at least one point.
        points: points.max(1) as usize,
        runs_per_sample: None,
        replicates: 1,
    };
    insert_head(tx, head, "ready", now).await?;
    Ok(true)
}

/// Stores the row of a sweep, and returns its number.
async fn insert_head(
    tx: &mut Connection,
    head: SweepHead,
    state: &'static str,
    now: Timestamp,
) -> Result<i64, StoreError> {
    let sql = "INSERT INTO sweeps (id, name, spec, design, factors, labels, points, replicates, submitted_at, state, runs_per_sample)
               VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?) RETURNING seq";
    let seq = query_scalar(sql)
        .bind(head.id.to_string())
        .bind(head.name)
        .bind(head.text)
        .bind(head.design.as_str())
        .bind(head.factors)
        .bind(head.labels)
        .bind(head.points as i64)
        .bind(head.replicates)
        .bind(now.0)
        .bind(state)
        .bind(head.runs_per_sample);
    Ok(seq.fetch_one(tx).await?)
}

/// Stores the design points that begin in a batch of jobs, and queues the jobs, with cached results where that is allowed.
pub(super) async fn queue_jobs(
    tx: &mut Connection,
    batch: &[JobRow],
    options: &JobOptions,
    start: QueueStart,
    now: Timestamp,
) -> Result<(), StoreError> {
    let newest = newest(tx).await?;
    insert_points(tx, batch).await?;
    insert_jobs(tx, batch, options, start, now).await?;
    answer_from_cache(tx, newest, options, now).await
}

/// The number of the newest job.
async fn newest(tx: &mut Connection) -> Result<i64, StoreError> {
    Ok(query_scalar("SELECT coalesce(max(seq), 0) FROM jobs").fetch_one(tx).await?)
}

/// Whether an earlier request with the same identifier has stored it.
async fn exists(tx: &mut Connection, sql: &'static str, id: String) -> Result<bool, StoreError> {
    Ok(query_scalar(sql).bind(id).fetch_one(&mut *tx).await?)
}

/// The frames of a result that have the interval that a job asks for.
const MATCHING_FRAMES: &str = "frames f JOIN jobs recorded ON recorded.id = f.job_id
    WHERE f.job_id = results.job_id AND f.attempt = results.attempt AND recorded.frame_interval_s = jobs.frame_interval_s";

/// Gives the queued jobs after `newest` the result of an earlier run of the same scenario by this solver revision. A job with frames
/// needs a run with the same frame interval, and gets its frames.
async fn answer_from_cache(
    tx: &mut Connection,
    newest: i64,
    options: &JobOptions,
    now: Timestamp,
) -> Result<(), StoreError> {
    if options.cache != Cache::Use {
        return Ok(());
    }
    let answered = query(AssertSqlSafe(format!(
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
        query(
            "UPDATE jobs SET state = 'succeeded', from_cache = 1, ended_at = ?
             WHERE seq > ? AND EXISTS (SELECT 1 FROM results WHERE job_id = jobs.id)",
        )
        .bind(now.0)
        .bind(newest)
        .execute(&mut *tx)
        .await?;
        query(AssertSqlSafe(format!(
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
mod tests;
