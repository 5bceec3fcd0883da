//! Inserting jobs in batches: the next batch of a large sweep is encoded while one is inserted, and only these two are in memory.

use std::sync::LazyLock;

use rayon::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};
use roost_api::ids::{JobId, SweepId};
use roost_api::job::{Cache, Needs};
use roost_api::sweep::SweepSpec;
use roost_api::time::Timestamp;
use roost_solver::scenario::Scenario;
use sqlx::{QueryBuilder, Sqlite, SqliteConnection};

use super::StoreError;
use super::columns::to_json;
use crate::queue::Owner;
use crate::sweep::Trial;

/// Jobs of one batch.
const BATCH: usize = 1000;

/// Rows of one `INSERT`: SQLite takes 32,766 parameters.
const ROWS: usize = 500;

/// A separate pool: an open transaction must not wait for the validation of other documents.
static ENCODERS: LazyLock<ThreadPool> = LazyLock::new(|| {
    let pool = ThreadPoolBuilder::new().thread_name(|k| format!("job-rows-{k}")).build();
    pool.expect("threads can be started")
});

/// A new row of `jobs`.
pub(super) struct JobRow {
    pub(super) id: JobId,
    digest: String,
    body: String,
    seed: i64,
    place: Option<(SweepId, u32, u32)>,
    /// Levels of a new design point, with its first job only.
    levels: Option<String>,
}

impl JobRow {
    /// A single job.
    pub(super) fn single(scenario: &Scenario, id: JobId) -> Result<Self, StoreError> {
        let seed = scenario.seed as i64; // at most 2^53 - 1
        let (digest, body) = (scenario.digest(), to_json("scenario", scenario)?);
        Ok(Self { id, digest, body, seed, place: None, levels: None })
    }

    fn of(trial: &Trial, sweep: SweepId) -> Result<Self, StoreError> {
        let levels = trial.levels.as_ref().map(|levels| to_json("levels", levels)).transpose()?;
        let place = Some((sweep, trial.point, trial.replicate));
        Ok(Self { place, levels, ..Self::single(&trial.scenario, JobId::new())? })
    }
}

/// Options that the jobs of one submission share.
pub(super) struct JobOptions {
    /// Identifier of the token that submitted them; empty without one.
    pub(super) token: String,
    pub(super) priority: i32,
    /// Labels of a single job. The labels of a sweep are stored with the sweep.
    pub(super) labels: String,
    pub(super) needs: Needs,
    pub(super) max_wall_s: Option<f64>,
    pub(super) frame_interval_s: Option<f64>,
    pub(super) cache: Cache,
}

impl JobOptions {
    /// Options of the jobs of a sweep that a token submitted.
    pub(super) fn of(spec: &SweepSpec, token: String) -> Result<Self, StoreError> {
        Ok(Self {
            token,
            priority: spec.priority,
            labels: "{}".to_owned(),
            needs: spec.needs.clone(),
            max_wall_s: spec.max_wall_s,
            frame_interval_s: spec.frame_interval_s,
            cache: spec.cache,
        })
    }
}

/// Trials of a sweep, in order.
type Trials = Box<dyn Iterator<Item = Trial> + Send>;

/// New jobs of a sweep: an encoded batch, and the trials after it.
pub(super) struct JobBatches {
    sweep: SweepId,
    batch: Vec<JobRow>,
    rest: Trials,
    jobs: u64,
}

impl JobBatches {
    /// Encodes the first batch of this many jobs.
    pub(super) fn new(
        sweep: SweepId,
        jobs: u64,
        trials: impl Iterator<Item = Trial> + Send + 'static,
    ) -> Result<Self, StoreError> {
        Self { sweep, batch: Vec::new(), rest: Box::new(trials), jobs }.next()
    }

    /// Whether there is more than one batch.
    pub(super) fn is_large(&self) -> bool {
        self.jobs > BATCH as u64
    }

    /// Encodes the next batch.
    fn next(mut self) -> Result<Self, StoreError> {
        self.batch = ENCODERS.install(|| {
            let trials: Vec<Trial> = self.rest.by_ref().take(BATCH).collect();
            trials.par_iter().map(|trial| JobRow::of(trial, self.sweep)).collect::<Result<_, _>>()
        })?;
        Ok(self)
    }

    /// Inserts the new design points, and queues all jobs.
    pub(super) async fn insert(
        mut self,
        tx: &mut SqliteConnection,
        options: &JobOptions,
        now: Timestamp,
    ) -> Result<(), StoreError> {
        let (jobs, mut start) = (self.jobs, queue_start(tx, options).await?);
        let mut queued = 0;
        while !self.batch.is_empty() {
            let batch = std::mem::take(&mut self.batch);
            let next = tokio::task::spawn_blocking(move || self.next());
            insert_points(tx, &batch).await?;
            insert_jobs(tx, &batch, options, start, now).await?;
            start.position += batch.len() as i64;
            queued += batch.len() as u64;
            self = next.await.map_err(|error| {
                tracing::error!(%error, "encoding the jobs of a sweep failed");
                StoreError::Unfinished { queued, jobs }
            })??;
        }
        if queued == jobs { Ok(()) } else { Err(StoreError::Unfinished { queued, jobs }) }
    }
}

/// The place of new jobs in the queue.
#[derive(Clone, Copy)]
pub(super) struct QueueStart {
    owner: Owner,
    /// Position of the first job.
    position: i64,
}

/// The place of new jobs: their owner, and the position that the owner's queue has reached.
pub(super) async fn queue_start(
    tx: &mut SqliteConnection,
    options: &JobOptions,
) -> Result<QueueStart, StoreError> {
    let sql = "INSERT INTO owners (token_id) VALUES (?) ON CONFLICT (token_id) DO NOTHING";
    sqlx::query(sql).bind(&options.token).execute(&mut *tx).await?;
    let sql = "SELECT id, coalesce((SELECT queue_position FROM fair_share WHERE priority = ? AND owner = owners.id), 0)
               FROM owners WHERE token_id = ?";
    let (owner, position) =
        sqlx::query_as(sql).bind(options.priority).bind(&options.token).fetch_one(&mut *tx).await?;
    Ok(QueueStart { owner, position })
}

/// Inserts the design points whose first jobs these are.
async fn insert_points(tx: &mut SqliteConnection, jobs: &[JobRow]) -> Result<(), StoreError> {
    let points: Vec<_> = jobs.iter().filter_map(|job| Some((job.place?, job.levels.as_ref()?))).collect();
    for rows in points.chunks(ROWS) {
        let mut query = QueryBuilder::<Sqlite>::new("INSERT INTO design_points (sweep_id, point, levels) ");
        query.push_values(rows, |mut row, ((sweep, point, _), levels)| {
            row.push_bind(sweep.to_string()).push_bind(*point).push_bind(*levels);
        });
        query.build().execute(&mut *tx).await?;
    }
    Ok(())
}

/// Queues jobs from a place on.
pub(super) async fn insert_jobs(
    tx: &mut SqliteConnection,
    jobs: &[JobRow],
    options: &JobOptions,
    start: QueueStart,
    now: Timestamp,
) -> Result<(), StoreError> {
    for (chunk, rows) in jobs.chunks(ROWS).enumerate() {
        let mut query = QueryBuilder::<Sqlite>::new("INSERT INTO scenarios (digest, body) ");
        query.push_values(rows, |mut row, job| {
            row.push_bind(&job.digest).push_bind(&job.body);
        });
        query.push(" ON CONFLICT (digest) DO NOTHING").build().execute(&mut *tx).await?;

        let mut query = QueryBuilder::<Sqlite>::new(
            "INSERT INTO jobs (id, sweep_id, point, replicate, scenario_digest, seed, priority, owner, queue_position, labels,
             needs_backend, needs_memory_mib, max_wall_s, frame_interval_s, cache, submitted_at) ",
        );
        query.push_values(rows.iter().enumerate(), |mut row, (index, job)| {
            row.push_bind(job.id.to_string())
                .push_bind(job.place.map(|(sweep, _, _)| sweep.to_string()))
                .push_bind(job.place.map(|(_, point, _)| point))
                .push_bind(job.place.map(|(_, _, replicate)| replicate))
                .push_bind(&job.digest)
                .push_bind(job.seed)
                .push_bind(options.priority)
                .push_bind(start.owner)
                .push_bind(start.position + (chunk * ROWS + index) as i64)
                .push_bind(&options.labels)
                .push_bind(&options.needs.backend)
                .push_bind(options.needs.memory_mib)
                .push_bind(options.max_wall_s)
                .push_bind(options.frame_interval_s)
                .push_bind(options.cache.as_str())
                .push_bind(now.0);
        });
        query.build().execute(&mut *tx).await?;
    }
    Ok(())
}
