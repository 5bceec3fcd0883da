//! A worker's life: register, empty the outbox, then three loops beside each other (claim, heartbeat,
//! deliver) until it is told to stop; then drain.

mod claim;
mod deliver;
mod frames;
mod heartbeat;
mod held;
mod news;
mod session;
#[cfg(test)]
mod tests;

use std::io;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use tokio::task::JoinHandle;
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

    // Beats and deliveries outlive the claims and the runs: an attempt is the worker's until the server has what came of it.
    let (grace_over, runs_over) = (CancellationToken::new(), CancellationToken::new());
    let grace = tokio::spawn({
        let (grace_over, grace) = (grace_over.clone(), session.config.drain_grace);
        async move {
            shutdown.cancelled().await;
            tokio::time::sleep(grace).await;
            grace_over.cancel();
        }
    });
    let beats = tokio::spawn({
        let session = session.clone();
        async move { heartbeat::run(&session, &welcome).await }
    });
    let deliveries = tokio::spawn({
        let (session, runs_over) = (session.clone(), runs_over.clone());
        async move { deliver::run(&session, &runs_over).await }
    });

    let runs = TaskTracker::new();
    claim::run(&session, &runs).await;
    drain(&session, &runs, &grace_over).await;
    runs_over.cancel();
    deliver_all(&session, deliveries, &grace_over).await;

    grace.abort();
    beats.abort();
    match session.refusal() {
        Some(reason) => Err(WorkerError::Refused(reason.clone())),
        None => Ok(()),
    }
}

/// Lets the runs end: as long as they like when the server asked to drain, for the grace when a signal did; then hands
/// back what still runs.
async fn drain(session: &Session, runs: &TaskTracker, grace_over: &CancellationToken) {
    runs.close();
    tokio::select! {
        () = runs.wait() => return,
        () = grace_over.cancelled() => {}
    }
    session.held.release_all();
    runs.wait().await;
}

/// Lets what came of the runs reach the server: for as long as that takes when the server asked to drain, within the grace
/// and a moment when a signal did; then tries once more, without the frames.
async fn deliver_all(session: &Session, mut deliveries: JoinHandle<()>, grace_over: &CancellationToken) {
    let time_is_up = async {
        // A server that refuses the worker may refuse its deliveries as well.
        if session.refusal().is_none() {
            grace_over.cancelled().await;
        }
        tokio::time::sleep(LAST_DELIVERIES).await;
    };
    tokio::select! {
        _ = &mut deliveries => return,
        () = time_is_up => {}
    }
    deliveries.abort();
    // Better a result without its frames than a run that is done again.
    session.uploads.give_up();
    let _ = tokio::time::timeout(LAST_DELIVERIES, deliver::deliver_waiting(session)).await;
}
