//! Running work away from the threads that answer requests: heartbeats must not wait for it.

use super::problem::{ApiError, ProblemKind};

/// Runs blocking `work` on a thread of its own.
pub(crate) async fn run_blocking<T: Send + 'static>(
    work: impl FnOnce() -> T + Send + 'static,
) -> Result<T, ApiError> {
    tokio::task::spawn_blocking(work).await.map_err(|error| failed(&error))
}

/// Completes `work` even if the client closes the connection meanwhile.
pub(crate) async fn run_detached<T: Send + 'static>(
    work: impl Future<Output = T> + Send + 'static,
) -> Result<T, ApiError> {
    tokio::spawn(work).await.map_err(|error| failed(&error))
}

fn failed(error: &tokio::task::JoinError) -> ApiError {
    ApiError::new(ProblemKind::Internal, format!("the request could not be completed: {error}"))
}

/// Maximum length of a document that is handled in place, in bytes: moving it to another thread takes longer.
const MAX_SHORT_BYTES: usize = 64 * 1024;

/// Runs `work` on a document of this length on a thread of its own, unless the document is short.
pub(crate) async fn run_blocking_if_long<T: Send + 'static>(
    bytes: usize,
    work: impl FnOnce() -> T + Send + 'static,
) -> Result<T, ApiError> {
    if is_short(bytes) { Ok(work()) } else { run_blocking(work).await }
}

/// Whether a document of this length is short.
pub(crate) fn is_short(bytes: usize) -> bool {
    bytes <= MAX_SHORT_BYTES
}
