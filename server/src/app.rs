//! What every request handler shares.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use roost_api::ids::{JobId, SweepId};
use roost_api::job::{JobState, JobView};
use roost_api::lease::SeriesPart;
use roost_api::prune::Pruning;
use roost_api::sweep::SweepView;
use roost_api::time::Timestamp;
use roost_api::worker::WorkerView;
use roost_api::{Progress, Series};
use roost_solver::mesh::Meshes;
use tokio::sync::{Notify, Semaphore};
use tokio_util::sync::CancellationToken;

use crate::clock::Clock;
use crate::config::ServerConfig;
use crate::http::{Access, Connections, Metrics};
use crate::kept::Kept;
use crate::samples::{Followed, MAX_OF_ALL, Samples};
use crate::store::{Store, StoreError, Subject};
use crate::sweep::Response;

/// A handle to the running server's parts.
pub(crate) type App = Arc<AppState>;

/// The running server's parts.
pub(crate) struct AppState {
    pub(crate) config: ServerConfig,
    pub(crate) store: Store,
    pub(crate) clock: Clock,
    /// The newest time in the database when the server started.
    pub(crate) newest_at_start: Option<Timestamp>,
    /// Wakes the claims that wait for work.
    pub(crate) work: Notify,
    /// What results may take in memory while they are recorded, in KiB of their bodies.
    pub(crate) deliveries: Arc<Semaphore>,
    /// STL files that are taken in at once.
    pub(crate) uploads: Arc<Semaphore>,
    /// Sweeps as they were shown last.
    pub(crate) views: Kept<SweepView>,
    /// The responses that results of sweeps have.
    pub(crate) responses: Kept<Arc<Vec<Response>>>,
    /// Meshes for the checks of submissions.
    pub(crate) shelf: tokio::sync::Mutex<Shelf>,
    /// Open to whoever is about to name a mesh, shut while meshes go that nothing names.
    pub(crate) mesh_gate: tokio::sync::RwLock<()>,
    /// Who is connected.
    pub(crate) connections: Arc<Connections>,
    /// What is measured.
    pub(crate) metrics: Metrics,
    /// Who may ask for what.
    pub(crate) access: Access,
    /// Ends everything that waits.
    pub(crate) shutdown: CancellationToken,
    /// How far running jobs have come: worth showing, not worth a write.
    pub(crate) progress: ProgressBoard,
}

impl AppState {
    /// Deletes what ended before then, and says what went.
    pub(crate) async fn prune(&self, then: Timestamp) -> Result<Pruning, StoreError> {
        self.store.prune(then, self.clock.now(), &self.mesh_gate).await
    }
}

/// Meshes that were read before, so that the submissions of one design read each file once. When it is full, all are
/// forgotten: reading one takes milliseconds.
#[derive(Default)]
pub(crate) struct Shelf {
    pub(crate) meshes: Meshes,
    /// Triangles of all of them.
    pub(crate) triangles: u64,
}

/// The latest progress of each running job with what it has sampled, and how often that has changed: for one job, for a sweep, in all.
#[derive(Default)]
pub(crate) struct ProgressBoard(Mutex<Board>);

#[derive(Default)]
struct Board {
    jobs: HashMap<JobId, Shown>,
    sweeps: HashMap<SweepId, u64>,
    samples: HashMap<JobId, Samples>,
    /// Samples of all jobs together.
    sampled: usize,
    changes: u64,
}

struct Shown {
    progress: Progress,
    sweep: Option<SweepId>,
    changes: u64,
}

impl Board {
    fn count(&mut self, sweep: Option<SweepId>) -> u64 {
        self.changes += 1;
        if let Some(sweep) = sweep {
            self.sweeps.insert(sweep, self.changes);
        }
        self.changes
    }
}

impl ProgressBoard {
    fn lock(&self) -> MutexGuard<'_, Board> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Notes a job's progress.
    pub(crate) fn set(&self, job: JobId, sweep: Option<SweepId>, progress: Progress) {
        let mut board = self.lock();
        if board.jobs.get(&job).is_some_and(|shown| shown.progress == progress) {
            return;
        }
        let changes = board.count(sweep);
        board.jobs.insert(job, Shown { progress, sweep, changes });
    }

    /// Forgets a job that runs no longer.
    pub(crate) fn forget(&self, job: JobId) {
        let mut board = self.lock();
        let gone = board.samples.remove(&job);
        board.sampled -= gone.map_or(0, |samples| samples.count());
        if let Some(shown) = board.jobs.remove(&job) {
            board.count(shown.sweep);
        }
    }

    /// Notes what an attempt has sampled since; false when what came before it is missing here.
    pub(crate) fn sample(
        &self,
        (job, attempt): (JobId, u32),
        sweep: Option<SweepId>,
        parts: Vec<SeriesPart>,
    ) -> bool {
        let mut board = self.lock();
        let now = board.count(sweep);
        let Board { samples, sampled, .. } = &mut *board;
        let samples = samples.entry(job).or_default();
        if samples.attempt() != attempt {
            *sampled -= samples.count();
            *samples = Samples::new(attempt);
        }
        let others = *sampled - samples.count();
        let mut whole = true;
        for part in parts {
            // All of them, whichever is missing something.
            whole &= samples.take(part, MAX_OF_ALL.saturating_sub(others + samples.count()), now);
        }
        *sampled = others + samples.count();
        whole
    }

    /// What a running job has sampled so far.
    pub(crate) fn series(&self, job: JobId) -> Vec<Series> {
        self.lock().samples.get(&job).map(Samples::series).unwrap_or_default()
    }

    /// What of that is new to somebody.
    pub(crate) fn news(&self, job: JobId, followed: &mut Vec<Followed>) -> Vec<SeriesPart> {
        self.lock().samples.get(&job).map(|samples| samples.news(followed)).unwrap_or_default()
    }

    /// The jobs on the board.
    pub(crate) fn jobs(&self) -> Vec<JobId> {
        let board = self.lock();
        board
            .jobs
            .keys()
            .chain(board.samples.keys().filter(|job| !board.jobs.contains_key(*job)))
            .copied()
            .collect()
    }

    /// The sweep of a job on the board, if it has one; none when it is not on the board.
    pub(crate) fn sweep_of(&self, job: JobId) -> Option<Option<SweepId>> {
        self.lock().jobs.get(&job).map(|shown| shown.sweep)
    }

    /// Another number whenever what it shows of the subject has changed, within one run of the server.
    pub(crate) fn version(&self, subject: Subject) -> u64 {
        let board = self.lock();
        match subject {
            Subject::Everything | Subject::Workers => board.changes,
            Subject::Job(job) => {
                let sampled = board.samples.get(&job).map_or(0, |samples| samples.changes);
                board.jobs.get(&job).map_or(0, |shown| shown.changes).max(sampled)
            }
            Subject::Sweep(sweep) => board.sweeps.get(&sweep).copied().unwrap_or(0),
            Subject::Meshes => 0,
        }
    }

    /// Shows the progress of a job that runs.
    pub(crate) fn show(&self, job: &mut JobView) {
        if job.state == JobState::Running {
            job.progress = self.lock().jobs.get(&job.id).map(|shown| shown.progress.clone());
        }
    }

    /// Shows how far the jobs of a worker have come, and how fast that goes.
    pub(crate) fn show_runs(&self, worker: &mut WorkerView) {
        let board = self.lock();
        let shown = worker.running.iter().map(|job| board.jobs.get(job).map(|shown| shown.progress.clone()));
        worker.progress = shown.collect();
        let moving = worker.progress.iter().flatten().filter(|progress| progress.wall_s > 0.0);
        let speeds: Vec<f64> =
            moving.map(|progress| progress.particle_steps as f64 / progress.wall_s).collect();
        worker.particle_steps_per_s = (!speeds.is_empty()).then(|| speeds.iter().sum());
    }

    /// How much of these jobs is done, in jobs.
    pub(crate) fn done(&self, jobs: &[JobId]) -> f64 {
        let board = self.lock();
        let shown = jobs.iter().filter_map(|job| board.jobs.get(job));
        shown.map(|shown| shown.progress.fraction.clamp(0.0, 1.0)).sum()
    }
}
