//! Inserting jobs in batches: the next batches of a large sweep are encoded while one is inserted, and only these few are in memory.

use std::collections::BTreeMap;
use std::sync::LazyLock;

use rayon::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};
use roost_api::ids::{JobId, SweepId};
use roost_api::job::{Cache, Needs};
use roost_api::sweep::SweepSpec;
use roost_api::time::Timestamp;
use roost_solver::scenario::Scenario;
use tokio::sync::mpsc;

use super::StoreError;
use super::columns::to_json;
use super::database::{Builder, Connection, query, query_as};
use super::eligible_jobs::reached_position;
use super::writer::SLICE;
use crate::queue::Owner;
use crate::sweep::Trial;

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
    /// Digest of what acts before t = 0; none for a run that shares no fill.
    fill: Option<String>,
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
        Ok(Self { id, digest, body, fill: scenario.fill_digest(), seed, place: None, levels: None })
    }

    pub(super) fn of(trial: &Trial, sweep: SweepId) -> Result<Self, StoreError> {
        let levels = trial.levels.as_ref().map(|levels| to_json("levels", levels)).transpose()?;
        let place = Some((sweep, trial.point, trial.replicate));
        Ok(Self { place, levels, ..Self::single(&trial.scenario, JobId::new())? })
    }
}

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
    /// Whether its run may share its fill with others.
    pub shared_fill: bool,
}

impl NewJob {
    /// Its options.
    pub(super) fn options(self) -> Result<JobOptions, StoreError> {
        Ok(JobOptions {
            token: self.token,
            priority: self.priority,
            labels: to_json("labels", &self.labels)?,
            needs: self.needs,
            max_wall_s: self.max_wall_s,
            frame_interval_s: self.frame_interval_s,
            cache: self.cache,
            shared_fill: self.shared_fill,
        })
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
    pub(super) shared_fill: bool,
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
            shared_fill: spec.shared_fill,
        })
    }

    /// Whether the jobs share fills. Frames show the fill as well.
    fn shares_fills(&self) -> bool {
        self.shared_fill && self.frame_interval_s.is_none()
    }
}

/// A batch of [`SLICE`] jobs, encoded. Each `INSERT` has a row per job, and SQLite takes 32,766 parameters.
type Encoded = Result<Vec<JobRow>, StoreError>;

/// New jobs of a sweep, which another thread encodes.
pub(super) struct JobBatches {
    encoded: mpsc::Receiver<Encoded>,
    jobs: u64,
    received: u64,
}

impl JobBatches {
    /// Starts to encode this many jobs. `work` passes their trials to the encoder.
    pub(super) fn start(sweep: SweepId, jobs: u64, work: impl FnOnce(Encoder) + Send + 'static) -> Self {
        // One batch waits while the next is made and the one before is stored.
        let (batches, encoded) = mpsc::channel(1);
        tokio::task::spawn_blocking(move || work(Encoder { sweep, batches }));
        Self { encoded, jobs, received: 0 }
    }

    /// Whether there is more than one batch.
    pub(super) fn is_large(&self) -> bool {
        self.jobs > SLICE as u64
    }

    /// The next batch; none after the last job.
    pub(super) async fn next(&mut self) -> Result<Option<Vec<JobRow>>, StoreError> {
        match self.encoded.recv().await {
            Some(batch) => {
                let batch = batch?;
                self.received += batch.len() as u64;
                Ok(Some(batch))
            }
            None if self.received == self.jobs => Ok(None),
            None => Err(StoreError::Unfinished { queued: self.received, jobs: self.jobs }),
        }
    }
}

/// Encodes trials of a sweep into [`JobBatches`].
pub(super) struct Encoder {
    sweep: SweepId,
    batches: mpsc::Sender<Encoded>,
}

impl Encoder {
    /// Encodes all trials, unless nobody stores them any more.
    pub(super) fn encode(self, mut trials: impl Iterator<Item = Trial> + Send) {
        loop {
            let batch = ENCODERS.install(|| {
                let trials: Vec<Trial> = trials.by_ref().take(SLICE).collect();
                trials.par_iter().map(|trial| JobRow::of(trial, self.sweep)).collect::<Encoded>()
            });
            let is_last = batch.as_ref().map_or(true, |batch| batch.len() < SLICE);
            if batch.as_ref().is_ok_and(Vec::is_empty)
                || self.batches.blocking_send(batch).is_err()
                || is_last
            {
                return;
            }
        }
    }
}

/// The place of new jobs in the queue.
#[derive(Clone, Copy)]
pub(super) struct QueueStart {
    pub(super) owner: Owner,
    /// The queue of a sweep that is stored in slices: its row of `sweeps`; 0 is the common queue of the owner.
    pub(super) queue: i64,
    /// Position of the first job.
    pub(super) position: i64,
}

/// The place of new jobs: their owner, and the position that the owner's queue has reached.
pub(super) async fn queue_start(tx: &mut Connection, options: &JobOptions) -> Result<QueueStart, StoreError> {
    let sql = "INSERT INTO owners (token_id, project) VALUES (?1, coalesce((SELECT project FROM tokens WHERE id = ?1), 0))
               ON CONFLICT (token_id) DO NOTHING";
    query(sql).bind(&options.token).execute(&mut *tx).await?;
    let sql = concat!(
        "SELECT id, coalesce(",
        reached_position!("?1", "owners.id"),
        ", 0) FROM owners WHERE token_id = ?2"
    );
    let (owner, position) =
        query_as(sql).bind(options.priority).bind(&options.token).fetch_one(&mut *tx).await?;
    Ok(QueueStart { owner, queue: 0, position })
}

/// Inserts the design points whose first jobs these are.
pub(super) async fn insert_points(tx: &mut Connection, jobs: &[JobRow]) -> Result<(), StoreError> {
    let points: Vec<_> = jobs.iter().filter_map(|job| Some((job.place?, job.levels.as_ref()?))).collect();
    if points.is_empty() {
        return Ok(());
    }
    let mut query = Builder::new("INSERT INTO design_points (sweep_id, point, levels) ");
    query.push_values(points, |mut row, ((sweep, point, _), levels)| {
        row.push_bind(sweep.to_string()).push_bind(point).push_bind(levels);
    });
    query.build().execute(&mut *tx).await?;
    Ok(())
}

/// Queues at least one and at most [`SLICE`] jobs from a place on.
pub(super) async fn insert_jobs(
    tx: &mut Connection,
    jobs: &[JobRow],
    options: &JobOptions,
    start: QueueStart,
    now: Timestamp,
) -> Result<(), StoreError> {
    let mut query = Builder::new("INSERT INTO scenarios (digest, body) ");
    query.push_values(jobs, |mut row, job| {
        row.push_bind(&job.digest).push_bind(&job.body);
    });
    query.push(" ON CONFLICT (digest) DO NOTHING").build().execute(&mut *tx).await?;

    let mut query = Builder::new(
        "INSERT INTO jobs (id, sweep_id, point, replicate, scenario_digest, seed, priority, owner, queue, queue_position, labels,
         needs_backend, needs_memory_mib, max_wall_s, frame_interval_s, cache, shared_fill, fill_digest, submitted_at) ",
    );
    query.push_values(jobs.iter().zip(start.position..), |mut row, (job, position)| {
        row.push_bind(job.id.to_string())
            .push_bind(job.place.map(|(sweep, _, _)| sweep.to_string()))
            .push_bind(job.place.map(|(_, point, _)| point))
            .push_bind(job.place.map(|(_, _, replicate)| replicate))
            .push_bind(&job.digest)
            .push_bind(job.seed)
            .push_bind(options.priority)
            .push_bind(start.owner)
            .push_bind(start.queue)
            .push_bind(position)
            .push_bind(&options.labels)
            .push_bind(&options.needs.backend)
            .push_bind(options.needs.memory_mib)
            .push_bind(options.max_wall_s)
            .push_bind(options.frame_interval_s)
            .push_bind(options.cache.as_str())
            .push_bind(options.shared_fill)
            .push_bind(job.fill.as_ref().filter(|_| options.shares_fills()))
            .push_bind(now.0);
    });
    query.build().execute(&mut *tx).await?;
    Ok(())
}
