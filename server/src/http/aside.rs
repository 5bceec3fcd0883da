//! Work that takes a while, on a thread of its own: heartbeats must not wait for it.

use super::problem::{ApiError, Kind};

/// Runs `work` beside the threads that answer requests.
pub(crate) async fn aside<T: Send + 'static>(
    work: impl FnOnce() -> T + Send + 'static,
) -> Result<T, ApiError> {
    tokio::task::spawn_blocking(work)
        .await
        .map_err(|error| ApiError::new(Kind::Internal, format!("the document could not be checked: {error}")))
}
