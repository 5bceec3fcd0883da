//! A worker's life: register, empty the outbox, then three loops beside each other (claim, heartbeat,
//! deliver) until it is told to stop; then drain.

mod claim;
mod deliver;
mod frames;
mod heartbeat;
mod held;
mod news;
mod session;

use std::io;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use tokio_util::sync::CancellationToken;
use tokio_util::task::TaskTracker;

use crate::WorkerConfig;
use crate::client::ClientError;
use session::Session;

/// How long a stopping worker tries to deliver; what is left stays in the outbox for the next start.
const LAST_DELIVERIES: Duration = Duration::from_secs(2);

/// Why a worker could not work.
#[derive(Debug, thiserror::Error)]
pub enum WorkerError {
    /// The state directory cannot be used.
    #[error("cannot use the state directory {}: {source}", path.display())]
    StateDir {
        /// The directory.
        path: PathBuf,
        /// Why not.
        source: io::Error,
    },
    /// The server's address or its answer to the registration.
    #[error(transparent)]
    Client(#[from] ClientError),
    /// The server would not have this worker any more.
    #[error("the server refuses this worker: {0}")]
    Refused(String),
}

/// Works until `shutdown` is cancelled or the server asks the worker to drain. A server that is away is
/// waited for, before the first job and in the middle of one.
///
/// # Errors
/// When the state directory cannot be used, the address is none, or the server refuses the worker.
pub async fn work(config: WorkerConfig, shutdown: CancellationToken) -> Result<(), WorkerError> {
    let session = Arc::new(Session::open(config, &shutdown)?);
    let welcome = tokio::select! {
        () = shutdown.cancelled() => return Ok(()),
        welcome = session.register() => welcome?,
    };
    tokio::select! {
        () = shutdown.cancelled() => return Ok(()),
        delivered = deliver::deliver_waiting(&session) => {
            delivered.map_err(|source| WorkerError::StateDir { path: session.config.state_dir.clone(), source })?;
        }
    }

    // Beats and deliveries outlive the claims: the runs under way need them to the end.
    let finish = CancellationToken::new();
    let background = TaskTracker::new();
    background.spawn({
        let (session, finish) = (session.clone(), finish.clone());
        async move { finish.run_until_cancelled(heartbeat::run(&session, &welcome)).await }
    });
    background.spawn({
        let (session, finish) = (session.clone(), finish.clone());
        async move { finish.run_until_cancelled(deliver::run(&session)).await }
    });
    background.close();

    let runs = TaskTracker::new();
    claim::run(&session, &runs).await;
    drain(&session, &runs, &shutdown).await;

    finish.cancel();
    background.wait().await;
    let _ = tokio::time::timeout(LAST_DELIVERIES, deliver::deliver_waiting(&session)).await;
    match session.refusal() {
        Some(reason) => Err(WorkerError::Refused(reason.clone())),
        None => Ok(()),
    }
}

/// Lets the runs end: as long as they like when the server asked to drain, for the grace when a signal did; then hands
/// back what still runs.
async fn drain(session: &Session, runs: &TaskTracker, shutdown: &CancellationToken) {
    runs.close();
    let grace = async {
        shutdown.cancelled().await;
        tokio::time::sleep(session.config.drain_grace).await;
    };
    tokio::select! {
        () = runs.wait() => return,
        () = grace => {}
    }
    session.held.release_all();
    runs.wait().await;
}
