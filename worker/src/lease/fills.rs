//! Fills on the way between a run and the server: the download before the run, and the upload beside it.

use std::sync::Arc;
use std::time::Duration;

use roost_api::fill::{FillOrder, StoredFill};
use roost_solver::Checkpoint;
use tokio::sync::oneshot;
use tokio::task::{JoinHandle, spawn_blocking};
use tokio_util::sync::CancellationToken;

use super::attempts::AttemptKey;
use super::session::Session;
use super::transfer::{LAST_UPLOAD, LoadError, MAX_TRIES, load, send};
use crate::backoff::Backoff;
use crate::client::EncodedCheckpoint;
use crate::fills::ServerFill;

/// Time for a download while the server does not answer. The run then fills by itself.
const LONGEST_DOWNLOAD: Duration = Duration::from_secs(60);

/// Time for the upload after the end of the run, whose result waits for it.
const LONGEST_UPLOAD: Duration = Duration::from_secs(30);

/// The upload of the fill that a run computes.
#[derive(Debug)]
pub(super) struct FillUpload {
    upload: JoinHandle<()>,
    stopping: CancellationToken,
}

/// The fill of an attempt on the server, and the upload of one that the server lacks.
pub(super) fn share(session: &Arc<Session>, key: AttemptKey, order: FillOrder) -> (ServerFill, FillUpload) {
    let FillOrder { stored, limit_bytes } = order;
    let (sender, filled) = oneshot::channel();
    let (uploading, stopping) = (session.clone(), session.stop_claiming.clone());
    let upload = tokio::spawn(async move {
        // A run that ends before it has filled sends none.
        if let Ok(filled) = filled.await {
            upload(&uploading, key, filled, limit_bytes).await;
        }
    });
    let (runtime, refusing) = (tokio::runtime::Handle::current(), session.clone());
    let digest = stored.as_ref().map(|stored| stored.digest.clone());
    let refused = move |reason: String| {
        runtime.spawn(async move { withdraw(&refusing, key, digest, &reason).await });
    };
    let downloading = session.clone();
    let download = stored.map(|stored| {
        Box::pin(async move { download(&downloading, key, stored).await })
            as std::pin::Pin<Box<dyn Future<Output = Option<Checkpoint>> + Send>>
    });
    (ServerFill { download, upload: sender, refused: Box::new(refused) }, FillUpload { upload, stopping })
}

impl FillUpload {
    /// Ends after the upload, within a time limit that is shorter once the worker stops.
    pub(super) async fn finish(mut self) {
        let stopping = async {
            self.stopping.cancelled().await;
            tokio::time::sleep(LAST_UPLOAD).await;
        };
        let time_is_up = tokio::time::timeout(LONGEST_UPLOAD, stopping);
        tokio::select! {
            _ = &mut self.upload => {}
            _ = time_is_up => self.upload.abort(),
        }
    }

    /// Ends at once.
    pub(super) fn abort(self) {
        self.upload.abort();
    }
}

/// Uploads a fill. Nobody waits for one that the server does not get.
async fn upload(session: &Session, key: AttemptKey, filled: Checkpoint, limit_bytes: u64) {
    let encoded = spawn_blocking(move || EncodedCheckpoint::new(filled.head.simulated_s, filled.to_bytes()));
    let Ok(encoded) = encoded.await else { return };
    let bytes = encoded.bytes.len() as u64;
    if bytes > limit_bytes {
        let reason = format!("its {bytes} bytes are more than the server allows, {limit_bytes} bytes");
        return withdraw(session, key, None, &reason).await;
    }
    let put = |part| session.client.upload_fill(key, session.worker_id, &encoded, part);
    let (job, attempt) = key;
    match send(&session.client, bytes, put).await {
        Ok(()) => tracing::debug!(%job, attempt, bytes, "fill uploaded"),
        Err(error) => withdraw(session, key, None, &error.to_string()).await,
    }
}

/// Downloads a stored fill; none if it cannot be had.
async fn download(session: &Session, key: AttemptKey, stored: StoredFill) -> Option<Checkpoint> {
    let (job, attempt) = key;
    let get = || session.client.download_fill(job, attempt);
    match load(&stored.digest, LONGEST_DOWNLOAD, get).await {
        Ok(filled) => {
            tracing::debug!(%job, attempt, bytes = stored.bytes, "fill downloaded");
            Some(filled)
        }
        Err(LoadError::Unusable(reason)) => {
            withdraw(session, key, Some(stored.digest), &reason).await;
            None
        }
        Err(LoadError::NotDownloaded(reason)) => {
            tracing::warn!(%job, attempt, reason, "the fill was not downloaded: the run fills by itself");
            None
        }
    }
}

/// Tells the server that this attempt stores no fill, or cannot use the stored one of a digest.
async fn withdraw(session: &Session, (job, attempt): AttemptKey, digest: Option<String>, reason: &str) {
    tracing::warn!(%job, attempt, reason, "a fill is not shared");
    let mut backoff = Backoff::default();
    for _ in 0..MAX_TRIES {
        match session.client.withdraw_fill((job, attempt), session.worker_id, digest.as_deref()).await {
            Err(error) if error.is_transient() => backoff.pause().await,
            Err(error) => return tracing::debug!(%job, attempt, %error, "the fill was not withdrawn"),
            Ok(()) => return,
        }
    }
}

#[cfg(test)]
mod tests;
