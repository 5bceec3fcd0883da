//! Uploads in parts and checked downloads, of checkpoints and fills.

use std::time::{Duration, Instant};

use roost_api::checkpoint::CheckpointReceipt;
use roost_solver::Checkpoint;
use tokio::task::spawn_blocking;

use crate::backoff::Backoff;
use crate::client::{Client, ClientError, ClientResult, digest};

/// Bytes of one part of an upload. A part that is cut is sent again.
const PART_BYTES: usize = 4 << 20;

/// Failures in a row after which an upload is given up, or downloads of other bytes after which a checkpoint counts as damaged.
pub(super) const MAX_TRIES: u32 = 5;

/// Time for the last upload after the worker was told to stop. The service manager kills it soon.
pub(super) const LAST_UPLOAD: Duration = Duration::from_secs(3);

/// Sends the parts of a whole of so many bytes, from where the server asks. `put` sends at most so many bytes from an offset on.
pub(super) async fn send<F>(
    client: &Client,
    bytes: u64,
    put: impl Fn((u64, usize)) -> F,
) -> Result<(), ClientError>
where
    F: Future<Output = ClientResult<CheckpointReceipt>>,
{
    let (mut received, mut failures, mut backoff) = (0, 0, Backoff::default());
    loop {
        match put((received, PART_BYTES)).await {
            Ok(receipt) if receipt.received >= bytes => return Ok(()),
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
                server: client.server().to_owned(),
                reason: format!("the upload does not get past byte {received}"),
            });
        }
    }
}

/// Why a run does not start from a stored checkpoint or fill.
pub(super) enum LoadError {
    /// No run can start from it.
    Unusable(String),
    /// It was not downloaded. It may be good.
    NotDownloaded(String),
}

/// Downloads a checkpoint and checks its bytes. While the server does not answer, tries again within a time limit.
pub(super) async fn load<F>(
    expected: &str,
    limit: Duration,
    get: impl Fn() -> F,
) -> Result<Checkpoint, LoadError>
where
    F: Future<Output = ClientResult<Vec<u8>>>,
{
    let (mut damaged, mut backoff, began) = (0, Backoff::default(), Instant::now());
    let bytes = loop {
        match get().await {
            Ok(bytes) if digest(&bytes) == expected => break bytes,
            Ok(_) => {
                damaged += 1;
                if damaged >= MAX_TRIES {
                    return Err(LoadError::Unusable("the downloaded bytes have another digest".to_owned()));
                }
            }
            Err(error) if error.problem_status() == Some(404) => {
                return Err(LoadError::Unusable(error.to_string()));
            }
            Err(error) if error.is_transient() && began.elapsed() < limit => {
                tracing::debug!(%error, "the download failed; retrying");
            }
            Err(error) => return Err(LoadError::NotDownloaded(error.to_string())),
        }
        backoff.pause().await;
    };
    match spawn_blocking(move || Checkpoint::from_bytes(&bytes)).await {
        Ok(checkpoint) => checkpoint.map_err(|error| LoadError::Unusable(error.to_string())),
        Err(error) => Err(LoadError::NotDownloaded(error.to_string())),
    }
}
