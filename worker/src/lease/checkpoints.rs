//! Checkpoints on the way between a run and the server: uploads beside the run, and the download before it.

use std::sync::Arc;
use std::time::Duration;

use roost_api::checkpoint::{CheckpointOrder, CheckpointView};
use roost_solver::Checkpoint;
use tokio::task::{JoinHandle, spawn_blocking};

use super::attempts::AttemptKey;
use super::session::Session;
use crate::backoff::Backoff;
use crate::checkpoints::{CheckpointSlot, Resume};
use crate::client::{ClientError, EncodedCheckpoint, digest};

/// Bytes of one part of an upload. A part that is cut is sent again.
const PART_BYTES: usize = 4 << 20;

/// Failures in a row after which an upload or a download is given up.
const MAX_TRIES: u32 = 5;

/// Time for the upload of the last checkpoint of a run that is handed back. The service manager kills the worker soon.
const LAST_UPLOAD: Duration = Duration::from_secs(4);

/// Uploads the checkpoints of a run, one at a time and beside it.
#[derive(Debug)]
pub(super) struct Uploader {
    slot: CheckpointSlot,
    uploads: JoinHandle<bool>,
}

impl Uploader {
    /// Starts to wait for checkpoints.
    pub(super) fn start(session: Arc<Session>, key: AttemptKey, order: CheckpointOrder) -> Self {
        let interval = Duration::try_from_secs_f64(order.interval_s).unwrap_or(Duration::MAX);
        let slot = CheckpointSlot::new(interval);
        let checkpoints = slot.clone();
        let uploads = tokio::spawn(async move {
            let mut is_stored = false;
            while let Some(checkpoint) = checkpoints.take().await {
                is_stored = upload(&session, key, checkpoint, order.limit_bytes).await;
            }
            is_stored
        });
        Self { slot, uploads }
    }

    /// Where the run puts its checkpoints.
    pub(super) fn slot(&self) -> CheckpointSlot {
        self.slot.clone()
    }

    /// Ends after the last upload of a run that is handed back. Returns whether the server has its checkpoint.
    pub(super) async fn finish(mut self) -> bool {
        self.slot.close();
        match tokio::time::timeout(LAST_UPLOAD, &mut self.uploads).await {
            Ok(is_stored) => is_stored.unwrap_or(false),
            Err(_) => {
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
    match send(session, key, &encoded).await {
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

/// Sends the parts of a checkpoint, from where the server asks.
async fn send(session: &Session, key: AttemptKey, encoded: &EncodedCheckpoint) -> Result<(), ClientError> {
    let (mut received, mut failures, mut backoff) = (0, 0, Backoff::default());
    loop {
        let part = (received, PART_BYTES);
        match session.client.upload_checkpoint(key, session.worker_id, encoded, part).await {
            Ok(receipt) if receipt.received >= encoded.bytes.len() as u64 => return Ok(()),
            Ok(receipt) => {
                // The server starts over after a restart.
                failures = if receipt.received > received { 0 } else { failures + 1 };
                received = receipt.received;
            }
            Err(error) if error.is_transient() && failures + 1 < MAX_TRIES => {
                failures += 1;
                backoff.pause().await;
            }
            Err(error) => return Err(error),
        }
        if failures >= MAX_TRIES {
            return Err(ClientError::Body {
                server: session.client.server().to_owned(),
                reason: format!("the upload does not get past byte {received}"),
            });
        }
    }
}

/// The checkpoint that an attempt continues from.
pub(super) fn resume(session: &Arc<Session>, key: AttemptKey, stored: CheckpointView) -> Resume {
    let (loading, refusing) = (session.clone(), session.clone());
    let checkpoint = async move {
        match load(&loading, key, &stored).await {
            Ok(checkpoint) => {
                let (simulated_s, job) = (stored.simulated_s, key.0);
                tracing::info!(%job, attempt = key.1, simulated_s, "the run continues from a checkpoint");
                Some(checkpoint)
            }
            Err(reason) => {
                discard(&loading, key, &reason).await;
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

/// Downloads a checkpoint and checks its bytes.
async fn load(
    session: &Session,
    (job, _): AttemptKey,
    stored: &CheckpointView,
) -> Result<Checkpoint, String> {
    let (mut failures, mut backoff) = (0, Backoff::default());
    let bytes = loop {
        let reason = match session.client.download_checkpoint(job, stored.attempt).await {
            Ok(bytes) if digest(&bytes) == stored.digest => break bytes,
            Ok(_) => "the downloaded bytes have another digest".to_owned(),
            Err(error) if error.is_transient() => error.to_string(),
            Err(error) => return Err(error.to_string()),
        };
        failures += 1;
        if failures >= MAX_TRIES {
            return Err(reason);
        }
        backoff.pause().await;
    };
    match spawn_blocking(move || Checkpoint::from_bytes(&bytes)).await {
        Ok(checkpoint) => checkpoint.map_err(|error| error.to_string()),
        Err(error) => Err(error.to_string()),
    }
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
