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

/// Does `work` to its end even if who asked for it goes away meanwhile.
pub(crate) async fn to_its_end<T: Send + 'static>(
    work: impl Future<Output = T> + Send + 'static,
) -> Result<T, ApiError> {
    tokio::spawn(work)
        .await
        .map_err(|error| ApiError::new(Kind::Internal, format!("the work ended before it was done: {error}")))
}

/// A document up to this length is worked where it is: the way to another thread takes longer.
const SHORT: usize = 64 * 1024;

/// Runs `work` on a document of so many bytes beside the threads that answer requests, unless it is short.
pub(crate) async fn unless_short<T: Send + 'static>(
    bytes: usize,
    work: impl FnOnce() -> T + Send + 'static,
) -> Result<T, ApiError> {
    if is_short(bytes) { Ok(work()) } else { aside(work).await }
}

/// Whether a document of so many bytes is short.
pub(crate) fn is_short(bytes: usize) -> bool {
    bytes <= SHORT
}
