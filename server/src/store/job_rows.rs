//! Jobs on their way into the store, written out piece by piece: of a large sweep only what is at work is in memory, and the next
//! piece is written out while one is inserted.

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

/// Jobs written out at once.
const PIECE: usize = 1000;

/// Rows of one `INSERT`: SQLite takes 32,766 parameters.
const ROWS: usize = 500;

/// Threads of their own: an open transaction must not wait for documents that others have checked.
static WRITERS: LazyLock<ThreadPool> = LazyLock::new(|| {
    let pool = ThreadPoolBuilder::new().thread_name(|k| format!("drafts-{k}")).build();
    pool.expect("the operating system gives threads")
});

/// A row of `jobs` before it has a state.
pub(super) struct JobRow {
    pub(super) id: JobId,
    digest: String,
    body: String,
    seed: i64,
    place: Option<(SweepId, u32, u32)>,
    /// Of a new design point, with the first of its jobs.
    levels: Option<String>,
}

impl JobRow {
    /// A job of no sweep.
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

/// What the jobs of one submission share.
pub(super) struct JobOptions {
    /// The token that asks for them, or nothing.
    pub(super) token: String,
    pub(super) priority: i32,
    /// Of a job without a sweep; those of a sweep stand with it.
    pub(super) labels: String,
    pub(super) needs: Needs,
    pub(super) max_wall_s: Option<f64>,
    pub(super) frame_interval_s: Option<f64>,
    pub(super) cache: Cache,
}

impl JobOptions {
    /// What the jobs of a sweep share that a token asks for.
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

/// The trials of a sweep that are to be queued, in their order.
type Trials = Box<dyn Iterator<Item = Trial> + Send>;

/// The jobs of a sweep that are to be queued: a piece that is written out, and what is not yet.
pub(super) struct JobBatches {
    sweep: SweepId,
    piece: Vec<JobRow>,
    rest: Trials,
    jobs: u64,
}

impl JobBatches {
    /// So many jobs, of which the first piece is written out.
    pub(super) fn new(
        sweep: SweepId,
        jobs: u64,
        trials: impl Iterator<Item = Trial> + Send + 'static,
    ) -> Result<Self, StoreError> {
        Self { sweep, piece: Vec::new(), rest: Box::new(trials), jobs }.next()
    }

    /// Whether it is more than one piece.
    pub(super) fn is_large(&self) -> bool {
        self.jobs > PIECE as u64
    }

    /// Writes out the next piece.
    fn next(mut self) -> Result<Self, StoreError> {
        self.piece = WRITERS.install(|| {
            let trials: Vec<Trial> = self.rest.by_ref().take(PIECE).collect();
            trials.par_iter().map(|trial| JobRow::of(trial, self.sweep)).collect::<Result<_, _>>()
        })?;
        Ok(self)
    }

    /// Adds the design points that are new, and queues all jobs.
    pub(super) async fn insert(
        mut self,
        tx: &mut SqliteConnection,
        options: &JobOptions,
        now: Timestamp,
    ) -> Result<(), StoreError> {
        let (jobs, mut place) = (self.jobs, queue_start(tx, options).await?);
        let mut queued = 0;
        while !self.piece.is_empty() {
            let piece = std::mem::take(&mut self.piece);
            let next = tokio::task::spawn_blocking(move || self.next());
            insert_points(tx, &piece).await?;
            insert_jobs(tx, &piece, options, place, now).await?;
            place.position += piece.len() as i64;
            queued += piece.len() as u64;
            self = next.await.map_err(|error| {
                tracing::error!(%error, "jobs of a sweep were not written out");
                StoreError::Unfinished { queued, jobs }
            })??;
        }
        if queued == jobs { Ok(()) } else { Err(StoreError::Unfinished { queued, jobs }) }
    }
}

/// Where jobs stand in the queue.
#[derive(Clone, Copy)]
pub(super) struct QueueStart {
    owner: Owner,
    /// Of the first of them.
    position: i64,
}

/// Where new jobs begin: whose they are, and the turn that this owner's jobs of their priority have come to.
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

/// Adds the design points of which these are the first jobs.
async fn insert_points(tx: &mut SqliteConnection, drafts: &[JobRow]) -> Result<(), StoreError> {
    let points: Vec<_> =
        drafts.iter().filter_map(|draft| Some((draft.place?, draft.levels.as_ref()?))).collect();
    for rows in points.chunks(ROWS) {
        let mut query = QueryBuilder::<Sqlite>::new("INSERT INTO design_points (sweep_id, point, levels) ");
        query.push_values(rows, |mut row, ((sweep, point, _), levels)| {
            row.push_bind(sweep.to_string()).push_bind(*point).push_bind(*levels);
        });
        query.build().execute(&mut *tx).await?;
    }
    Ok(())
}

/// Queues jobs, the first of which stands there.
pub(super) async fn insert_jobs(
    tx: &mut SqliteConnection,
    drafts: &[JobRow],
    options: &JobOptions,
    place: QueueStart,
    now: Timestamp,
) -> Result<(), StoreError> {
    for (chunk, rows) in drafts.chunks(ROWS).enumerate() {
        let mut query = QueryBuilder::<Sqlite>::new("INSERT INTO scenarios (digest, body) ");
        query.push_values(rows, |mut row, draft| {
            row.push_bind(&draft.digest).push_bind(&draft.body);
        });
        query.push(" ON CONFLICT (digest) DO NOTHING").build().execute(&mut *tx).await?;

        let mut query = QueryBuilder::<Sqlite>::new(
            "INSERT INTO jobs (id, sweep_id, point, replicate, scenario_digest, seed, priority, owner, queue_position, labels,
             needs_backend, needs_memory_mib, max_wall_s, frame_interval_s, cache, submitted_at) ",
        );
        query.push_values(rows.iter().enumerate(), |mut row, (index, draft)| {
            row.push_bind(draft.id.to_string())
                .push_bind(draft.place.map(|(sweep, _, _)| sweep.to_string()))
                .push_bind(draft.place.map(|(_, point, _)| point))
                .push_bind(draft.place.map(|(_, _, replicate)| replicate))
                .push_bind(&draft.digest)
                .push_bind(draft.seed)
                .push_bind(options.priority)
                .push_bind(place.owner)
                .push_bind(place.position + (chunk * ROWS + index) as i64)
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
