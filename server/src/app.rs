//! What every request handler shares.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use roost_api::Progress;
use roost_api::ids::JobId;
use roost_api::job::{JobState, JobView};
use roost_solver::mesh::Meshes;
use tokio::sync::{Notify, Semaphore};
use tokio_util::sync::CancellationToken;

use crate::clock::Clock;
use crate::config::ServerConfig;
use crate::store::Store;

/// A handle to the running server's parts.
pub(crate) type App = Arc<AppState>;

/// The running server's parts.
pub(crate) struct AppState {
    pub(crate) config: ServerConfig,
    pub(crate) store: Store,
    pub(crate) clock: Clock,
    /// Wakes the claims that wait for work.
    pub(crate) work: Notify,
    /// Long documents that are read at once.
    pub(crate) deliveries: Arc<Semaphore>,
    /// STL files that are taken in at once.
    pub(crate) uploads: Arc<Semaphore>,
    /// Meshes for the checks of submissions.
    pub(crate) shelf: tokio::sync::Mutex<Shelf>,
    /// Ends everything that waits.
    pub(crate) shutdown: CancellationToken,
    /// How far running jobs have come: worth showing, not worth a write.
    pub(crate) progress: ProgressBoard,
}

/// Meshes that were read before, so that the submissions of one design read each file once. When it is full, all are
/// forgotten: reading one takes milliseconds.
#[derive(Default)]
pub(crate) struct Shelf {
    pub(crate) meshes: Meshes,
    /// Triangles of all of them.
    pub(crate) triangles: u64,
}

/// The latest progress of each running job.
#[derive(Default)]
pub(crate) struct ProgressBoard(Mutex<HashMap<JobId, Progress>>);

impl ProgressBoard {
    fn lock(&self) -> MutexGuard<'_, HashMap<JobId, Progress>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Notes a job's progress.
    pub(crate) fn set(&self, job: JobId, progress: Progress) {
        self.lock().insert(job, progress);
    }

    /// Forgets a job that runs no longer.
    pub(crate) fn forget(&self, job: JobId) {
        self.lock().remove(&job);
    }

    /// The jobs on the board.
    pub(crate) fn jobs(&self) -> Vec<JobId> {
        self.lock().keys().copied().collect()
    }

    /// Shows the progress of a job that runs.
    pub(crate) fn show(&self, job: &mut JobView) {
        if job.state == JobState::Running {
            job.progress = self.lock().get(&job.id).cloned();
        }
    }

    /// How much of these jobs is done, in jobs.
    pub(crate) fn done(&self, jobs: &[JobId]) -> f64 {
        let board = self.lock();
        jobs.iter().filter_map(|job| board.get(job)).map(|progress| progress.fraction.clamp(0.0, 1.0)).sum()
    }
}
