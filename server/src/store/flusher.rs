//! Flushes of SQLite's write-ahead log, beside the writer.
//!
//! With `synchronous=FULL`, SQLite flushes the log inside each commit, and no other write can start meanwhile. With `NORMAL`, a commit
//! writes the log without a flush, in an order that a power failure cannot corrupt. Here a thread flushes the log after the commit, and
//! only then answers the writes of this commit. Meanwhile the writer executes the next group. Commits that queue up during a flush
//! share the next one.
//!
//! The promise is the same as before: an answered write is on disk. Readers may see a write some milliseconds before that.

use std::fs::OpenOptions;
use std::io;
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use prometheus_client::metrics::histogram::Histogram;
use tokio::sync::mpsc;
use tokio::task::JoinHandle;
use tokio_util::sync::CancellationToken;

/// Maximum number of commits that share a flush.
const MAX_COMMITS: usize = 1024;

/// Answers the writes of a commit.
pub(super) type Reply = Box<dyn FnOnce(Result<(), Arc<sqlx::Error>>) + Send>;

/// A commit that is not yet flushed.
struct Committed {
    /// The start of its last statement.
    started: Instant,
    answer: Reply,
}

/// The thread that flushes. It ends with the first failed flush, because the system may have dropped what it could not write.
pub(super) struct Flusher {
    queue: mpsc::UnboundedSender<Committed>,
    thread: JoinHandle<()>,
}

impl Flusher {
    /// Flushes the log at `path`, which must exist. `seconds` gets the durations from the last statement of a commit to the end of its
    /// flush. The end of the thread, such as after a failed flush, cancels `ended`.
    pub(super) fn start(path: &Path, seconds: Histogram, ended: CancellationToken) -> io::Result<Self> {
        // Windows flushes only files that are open for writing.
        let log = OpenOptions::new().write(true).open(path)?;
        Ok(Self::spawn(move || log.sync_data(), seconds, ended))
    }

    fn spawn(
        flush: impl FnMut() -> io::Result<()> + Send + 'static,
        seconds: Histogram,
        ended: CancellationToken,
    ) -> Self {
        let (queue, waiting) = mpsc::unbounded_channel();
        let thread = tokio::task::spawn_blocking(move || run(flush, waiting, &seconds, ended));
        Self { queue, thread }
    }

    /// Answers after the next flush. Returns the answer if the thread has ended.
    pub(super) fn submit(&self, started: Instant, answer: Reply) -> Result<(), Reply> {
        self.queue.send(Committed { started, answer }).map_err(|returned| returned.0.answer)
    }

    /// Flushes what is queued, and ends.
    pub(super) async fn close(self) {
        drop(self.queue);
        let _ = self.thread.await;
    }
}

fn run(
    mut flush: impl FnMut() -> io::Result<()>,
    mut waiting: mpsc::UnboundedReceiver<Committed>,
    seconds: &Histogram,
    ended: CancellationToken,
) {
    // Cancelled however the thread ends, a panic included.
    let _ended = ended.drop_guard();
    let mut group = Vec::new();
    while waiting.blocking_recv_many(&mut group, MAX_COMMITS) > 0 {
        // Not as an error of a connection, which a client could wait for.
        let flushed = flush().map_err(|error| Arc::new(sqlx::Error::AnyDriverError(error.into())));
        for committed in group.drain(..) {
            seconds.observe(committed.started.elapsed().as_secs_f64());
            (committed.answer)(flushed.clone());
        }
        if let Err(error) = flushed {
            tracing::error!(%error, "the write-ahead log could not be flushed; the server ends");
            waiting.close();
            while let Ok(committed) = waiting.try_recv() {
                (committed.answer)(Err(error.clone()));
            }
            return;
        }
    }
}

#[cfg(test)]
mod tests;
