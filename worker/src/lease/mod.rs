//! The life of a worker: it registers and empties its outbox. Then three loops (claim, heartbeat, deliver) run until a stop; then it drains.

mod attempts;
mod checkpoints;
mod claim;
mod deliver;
mod fills;
mod frames;
mod heartbeat;
mod idle;
mod sent_samples;
mod session;
#[cfg(test)]
mod tests;
mod transfer;

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

/// Time that a stopping worker tries to deliver. The rest stays in the outbox for the next start. Tests run on busy machines.
const LAST_DELIVERIES: Duration = Duration::from_secs(if cfg!(test) { 6 } else { 2 });

/// Why a worker ended with an error.
#[derive(Debug, thiserror::Error)]
pub enum WorkerError {
    /// The state directory cannot be used.
    #[error("cannot use the state directory {}: {source}", path.display())]
    StateDir {
        /// The directory.
        path: PathBuf,
        /// The reason.
        source: io::Error,
    },
    /// The server's address is invalid, or the registration failed.
    #[error(transparent)]
    Client(#[from] ClientError),
    /// The server did not answer for the idle timeout.
    #[error("the server {0} did not answer within the idle timeout")]
    Unanswered(String),
    /// The server refuses this worker.
    #[error("the server refuses this worker: {0}")]
    Refused(String),
}

/// Runs a worker until `shutdown` is cancelled, the server asks it to drain, or it has been idle for its timeout. It waits for a server that does not answer, before the first
/// job and during one.
///
/// # Errors
/// When the state directory cannot be used, the address is invalid, the server refuses the worker, or it does not answer for the idle timeout.
pub async fn work(config: WorkerConfig, shutdown: CancellationToken) -> Result<(), WorkerError> {
    let session = Arc::new(Session::open(config, &shutdown)?);
    let welcome = tokio::select! {
        () = shutdown.cancelled() => return Ok(()),
        welcome = session.register() => welcome?,
        () = idle_timeout(&session) => return Err(WorkerError::Unanswered(session.config.server.clone())),
    };
    tokio::select! {
        () = shutdown.cancelled() => return Ok(()),
        delivered = deliver::deliver_waiting(&session) => {
            delivered.map_err(|source| WorkerError::StateDir { path: session.config.state_dir.clone(), source })?;
        }
    }

    // Heartbeats and deliveries continue after the last run: the worker holds an attempt until the server has its result.
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
    let idle = session.config.idle_timeout.map(|timeout| {
        let session = session.clone();
        tokio::spawn(async move { idle::run(&session, timeout).await })
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
    if let Some(idle) = idle {
        idle.abort();
    }
    match session.refusal() {
        Some(reason) => Err(WorkerError::Refused(reason.clone())),
        None => Ok(()),
    }
}

/// Waits for the idle timeout; for ever without one.
async fn idle_timeout(session: &Session) {
    match session.config.idle_timeout {
        Some(timeout) => tokio::time::sleep(timeout).await,
        None => std::future::pending().await,
    }
}

/// Waits for the runs to end: without limit when the server asked to drain, for the grace after a signal. Then releases the rest.
async fn drain(session: &Session, runs: &TaskTracker, grace_over: &CancellationToken) {
    runs.close();
    tokio::select! {
        () = runs.wait() => return,
        () = grace_over.cancelled() => {}
    }
    session.attempts.release_all();
    runs.wait().await;
}

/// Delivers all results: without limit when the server asked to drain, within the grace and [`LAST_DELIVERIES`] after a signal. Then tries
/// once more, without the frames.
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
    // A result without frames is better than a repeated run.
    session.uploads.give_up();
    let _ = tokio::time::timeout(LAST_DELIVERIES, deliver::deliver_waiting(session)).await;
}
