//! Checkpoints on the way between a run and the server: uploads beside the run, and the download before it.

use std::sync::Arc;
use std::time::Duration;

use roost_api::checkpoint::{CheckpointOrder, CheckpointView};
use roost_solver::Checkpoint;
use tokio::task::{JoinHandle, spawn_blocking};
use tokio_util::sync::CancellationToken;

use super::attempts::AttemptKey;
use super::session::Session;
use super::transfer::{LAST_UPLOAD, LoadError, MAX_TRIES, load, send};
use crate::backoff::Backoff;
use crate::checkpoints::{CheckpointSlot, Resume};
use crate::client::EncodedCheckpoint;

/// Time for a download while the server does not answer. The run then begins at zero.
const LONGEST_DOWNLOAD: Duration = Duration::from_secs(300);

/// Uploads the checkpoints of a run, one at a time and beside it.
#[derive(Debug)]
pub(super) struct Uploader {
    slot: CheckpointSlot,
    uploads: JoinHandle<bool>,
    stopping: CancellationToken,
}

impl Uploader {
    /// Starts to wait for checkpoints.
    pub(super) fn start(session: Arc<Session>, key: AttemptKey, order: CheckpointOrder) -> Self {
        let interval = Duration::try_from_secs_f64(order.interval_s).unwrap_or(Duration::MAX);
        let slot = CheckpointSlot::new(interval);
        let (checkpoints, stopping) = (slot.clone(), session.stop_claiming.clone());
        let uploads = tokio::spawn(async move {
            let mut is_stored = false;
            while let Some(checkpoint) = checkpoints.take().await {
                is_stored = upload(&session, key, checkpoint, order.limit_bytes).await;
            }
            is_stored
        });
        Self { slot, uploads, stopping }
    }

    /// Where the run puts its checkpoints.
    pub(super) fn slot(&self) -> CheckpointSlot {
        self.slot.clone()
    }

    /// Ends after the last upload of a run that is handed back, which has a time limit once the worker stops. Returns whether the
    /// server has its checkpoint.
    pub(super) async fn finish(mut self) -> bool {
        self.slot.close();
        let time_is_up = async {
            self.stopping.cancelled().await;
            tokio::time::sleep(LAST_UPLOAD).await;
        };
        tokio::select! {
            is_stored = &mut self.uploads => is_stored.unwrap_or(false),
            () = time_is_up => {
                tracing::warn!("the last checkpoint was not uploaded within {} s", LAST_UPLOAD.as_secs());
                self.uploads.abort();
                false
            }
        }
    }

    /// Ends at once: the job needs no checkpoint any more.
    pub(super) fn abort(self) {
        self.uploads.abort();
    }
}

/// Uploads a checkpoint; returns whether the server has it. A failure is only logged: the next checkpoint follows.
async fn upload(session: &Session, key: AttemptKey, checkpoint: Checkpoint, limit_bytes: u64) -> bool {
    let simulated_s = checkpoint.head.simulated_s;
    let Ok(encoded) =
        spawn_blocking(move || EncodedCheckpoint::new(simulated_s, checkpoint.to_bytes())).await
    else {
        return false;
    };
    let (job, attempt) = key;
    let bytes = encoded.bytes.len() as u64;
    if bytes > limit_bytes {
        tracing::warn!(%job, attempt, bytes, limit_bytes, "the checkpoint is larger than the server allows");
        return false;
    }
    let put = |part| session.client.upload_checkpoint(key, session.worker_id, &encoded, part);
    match send(&session.client, bytes, put).await {
        Ok(()) => {
            tracing::debug!(%job, attempt, bytes, simulated_s, "checkpoint uploaded");
            true
        }
        Err(error) => {
            tracing::warn!(%job, attempt, %error, "the checkpoint was not uploaded");
            false
        }
    }
}

/// The checkpoint that an attempt continues from.
pub(super) fn resume(session: &Arc<Session>, key: AttemptKey, stored: CheckpointView) -> Resume {
    resume_within(LONGEST_DOWNLOAD, session, key, stored)
}

fn resume_within(limit: Duration, session: &Arc<Session>, key: AttemptKey, stored: CheckpointView) -> Resume {
    let (loading, refusing) = (session.clone(), session.clone());
    let checkpoint = async move {
        let (job, attempt) = key;
        let get = || loading.client.download_checkpoint(job, stored.attempt);
        match load(&stored.digest, limit, get).await {
            Ok(checkpoint) => {
                let simulated_s = stored.simulated_s;
                tracing::info!(%job, attempt, simulated_s, "the run continues from a checkpoint");
                Some(checkpoint)
            }
            Err(LoadError::Unusable(reason)) => {
                discard(&loading, key, &reason).await;
                None
            }
            Err(LoadError::NotDownloaded(reason)) => {
                tracing::warn!(%job, attempt, reason, "the checkpoint was not downloaded: the run begins at zero");
                None
            }
        }
    };
    let runtime = tokio::runtime::Handle::current();
    let refused = move |reason: String| {
        runtime.spawn(async move { discard(&refusing, key, &reason).await });
    };
    Resume { checkpoint: Box::pin(checkpoint), refused: Some(Box::new(refused)) }
}

/// Tells the server that the attempt begins at zero, so that no later attempt gets the same checkpoint.
async fn discard(session: &Session, (job, attempt): AttemptKey, reason: &str) {
    tracing::warn!(%job, attempt, reason, "cannot use the checkpoint: the run begins at zero");
    let mut backoff = Backoff::default();
    for _ in 0..MAX_TRIES {
        match session.client.discard_checkpoint(job, attempt, session.worker_id).await {
            Err(error) if error.is_transient() => backoff.pause().await,
            Err(error) => return tracing::debug!(%job, attempt, %error, "the checkpoint was not discarded"),
            Ok(()) => return,
        }
    }
}

#[cfg(test)]
mod tests;
