//! What every request handler shares.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use roost_api::Progress;
use roost_api::ids::{JobId, SweepId};
use roost_api::job::{JobState, JobView};
use roost_api::prune::Pruning;
use roost_api::time::Timestamp;
use roost_solver::mesh::Meshes;
use tokio::sync::{Notify, Semaphore};
use tokio_util::sync::CancellationToken;

use crate::clock::Clock;
use crate::config::ServerConfig;
use crate::http::{Access, Metrics};
use crate::store::{Store, StoreError, Subject};

/// A handle to the running server's parts.
pub(crate) type App = Arc<AppState>;

/// The running server's parts.
pub(crate) struct AppState {
    pub(crate) config: ServerConfig,
    pub(crate) store: Store,
    pub(crate) clock: Clock,
    /// Wakes the claims that wait for work.
    pub(crate) work: Notify,
    /// What results may take in memory while they are recorded, in KiB of their bodies.
    pub(crate) deliveries: Arc<Semaphore>,
    /// STL files that are taken in at once.
    pub(crate) uploads: Arc<Semaphore>,
    /// Meshes for the checks of submissions.
    pub(crate) shelf: tokio::sync::Mutex<Shelf>,
    /// Open to whoever is about to name a mesh, shut while meshes go that nothing names.
    pub(crate) mesh_gate: tokio::sync::RwLock<()>,
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

/// The latest progress of each running job, and how often that has changed: for one job, for a sweep, in all.
#[derive(Default)]
pub(crate) struct ProgressBoard(Mutex<Board>);

#[derive(Default)]
struct Board {
    jobs: HashMap<JobId, Shown>,
    sweeps: HashMap<SweepId, u64>,
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
        if let Some(shown) = board.jobs.remove(&job) {
            board.count(shown.sweep);
        }
    }

    /// The jobs on the board.
    pub(crate) fn jobs(&self) -> Vec<JobId> {
        self.lock().jobs.keys().copied().collect()
    }

    /// The sweep of a job on the board, if it has one; none when it is not on the board.
    pub(crate) fn sweep_of(&self, job: JobId) -> Option<Option<SweepId>> {
        self.lock().jobs.get(&job).map(|shown| shown.sweep)
    }

    /// Another number whenever what it shows of the subject has changed, within one run of the server.
    pub(crate) fn version(&self, subject: Subject) -> u64 {
        let board = self.lock();
        match subject {
            Subject::Everything => board.changes,
            Subject::Job(job) => board.jobs.get(&job).map_or(0, |shown| shown.changes),
            Subject::Sweep(sweep) => board.sweeps.get(&sweep).copied().unwrap_or(0),
            Subject::Workers | Subject::Meshes => 0,
        }
    }

    /// Shows the progress of a job that runs.
    pub(crate) fn show(&self, job: &mut JobView) {
        if job.state == JobState::Running {
            job.progress = self.lock().jobs.get(&job.id).map(|shown| shown.progress.clone());
        }
    }

    /// How much of these jobs is done, in jobs.
    pub(crate) fn done(&self, jobs: &[JobId]) -> f64 {
        let board = self.lock();
        let shown = jobs.iter().filter_map(|job| board.jobs.get(job));
        shown.map(|shown| shown.progress.fraction.clamp(0.0, 1.0)).sum()
    }
}
