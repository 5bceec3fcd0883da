//! The writer: a task that owns the only writing connection and commits in groups. It has a [`Thread`] of its own.
//!
//! The database has one writer at a time, and a commit costs a flush to disk. Writes that queue up during a transaction form the next group:
//! a transaction with a savepoint per write, `COMMIT`, for SQLite a flush by the [`Flusher`], then the answers. A failed write is rolled back alone.
//! A group takes no writes that come after its beginning: their clients would then wait together, and the writer for all of them.
//! A transaction awaits only SQL on this connection and the encoding of the next jobs of an extension. A closed connection of the client
//! does not interrupt it.
//!
//! A slice of a large sweep, or a large extension, has its own transaction without a savepoint: for a savepoint, SQLite copies every page
//! before its first change, and each job changes a page.
//!
//! A connection to PostgreSQL can break, or stop answering. All writes of its group are then refused, and the next write opens another
//! connection. If another server leads then, or a newer one has led meanwhile, the writer ends. A writer without writes begins a transaction every [`BEAT`]: this shows
//! the other servers that this one lives, and finds a broken connection. The runtime of the server asks for these transactions, so that
//! they stop if it stops.

use std::future::Future;
use std::io;
use std::path::Path;
use std::pin::Pin;
use std::sync::{Arc, OnceLock};
use std::time::{Duration, Instant};

use prometheus_client::metrics::histogram::Histogram;
use tokio::sync::{mpsc, oneshot};
use tokio::task::JoinHandle;
use tokio::time::timeout;
use tokio_util::sync::CancellationToken;

pub(super) use commits::Commits;
use group::{Failure, Shared, begin, execute_group, execute_large, roll_back};
pub(super) use line::Line;
pub(super) use outages::{Outages, STALL};
use queue::{First, Message, Next, beat};
pub(super) use thread::Thread;

use super::StoreError;
use super::database::{Connection, Engine, postgres};
use super::flusher::{Flusher, Reply};

/// Jobs that one transaction of a large sweep changes. A claim or heartbeat waits for two such transactions at most: one that runs, and one
/// beside the batch that the request missed.
pub(super) const SLICE: usize = 250;

/// Maximum pause between transactions on PostgreSQL.
pub(super) const BEAT: Duration = Duration::from_secs(2);

/// The future of a write; it borrows the connection.
pub(super) type Work<'t, T> = Pin<Box<dyn Future<Output = Result<T, StoreError>> + Send + 't>>;

type Run<'t> = Pin<Box<dyn Future<Output = Finished> + Send + 't>>;

/// A queued write.
trait Write: Send {
    /// Whether it has its own transaction.
    fn is_large(&self) -> bool;

    /// Executes it, within a limit if one is given. The caller commits and answers.
    fn run<'t>(self: Box<Self>, connection: &'t mut Connection, limit: Option<Duration>) -> Run<'t>;

    /// Answers with an error before the start.
    fn refuse(self: Box<Self>, error: StoreError);
}

struct Request<T, F> {
    is_large: bool,
    work: F,
    sender: oneshot::Sender<Result<T, StoreError>>,
}

impl<T, F> Write for Request<T, F>
where
    T: Send + 'static,
    F: for<'t> FnOnce(&'t mut Connection) -> Work<'t, T> + Send + 'static,
{
    fn is_large(&self) -> bool {
        self.is_large
    }

    fn run<'t>(self: Box<Self>, connection: &'t mut Connection, limit: Option<Duration>) -> Run<'t> {
        Box::pin(async move {
            let Self { work, sender, .. } = *self;
            let done = match limit {
                Some(limit) => timeout(limit, work(connection)).await.ok(),
                None => Some(work(connection).await),
            };
            let is_late = done.is_none();
            let outcome = done.unwrap_or_else(|| Err(sqlx::Error::Io(io::ErrorKind::TimedOut.into()).into()));
            let keep = outcome.is_ok();
            let reply = Box::new(move |committed: Result<(), StoreError>| {
                // Its own error is more specific than that of the group. The caller may have gone.
                let _ = sender.send(outcome.and_then(|value| committed.map(|()| value)));
            });
            Finished { keep, is_late, reply }
        })
    }

    fn refuse(self: Box<Self>, error: StoreError) {
        let _ = self.sender.send(Err(error));
    }
}

/// An executed write before the commit.
struct Finished {
    keep: bool,
    /// Whether it missed its limit. Its connection must not be used again.
    is_late: bool,
    reply: Box<dyn FnOnce(Result<(), StoreError>) + Send>,
}

/// Upper bounds of the histogram of commit times, in seconds, from a fast SSD to a failing disk.
const COMMIT_SECONDS: [f64; 10] = [0.0005, 0.001, 0.002, 0.005, 0.01, 0.025, 0.1, 0.5, 2.0, 10.0];

pub(super) struct Writer {
    queue: mpsc::Sender<Message>,
    task: tokio::sync::Mutex<Option<JoinHandle<()>>>,
    ended: CancellationToken,
    deposed: Arc<OnceLock<String>>,
    commits: Commits,
    outages: Arc<Outages>,
    commit_seconds: Histogram,
}

impl Writer {
    /// Starts the task on the thread that opened the connection. It flushes the write-ahead log at `log` after each commit.
    pub(super) fn open(
        thread: &Thread,
        connection: Connection,
        line: Line,
        log: Option<&Path>,
    ) -> io::Result<Self> {
        Self::spawn(thread, (connection, line), |seconds, ended| {
            log.map(|log| Flusher::start(log, seconds, ended)).transpose()
        })
    }

    /// The same for SQLite, with a flusher made from the histogram of commit times and the end of the writer; none for a database in memory.
    #[cfg(test)]
    pub(super) fn start_with(
        connection: impl Into<Connection>,
        flusher: impl FnOnce(Histogram, CancellationToken) -> io::Result<Option<Flusher>>,
    ) -> io::Result<Self> {
        Self::spawn(&Thread::start()?, (connection.into(), Line::file()), flusher)
    }

    fn spawn(
        thread: &Thread,
        opened: (Connection, Line),
        flusher: impl FnOnce(Histogram, CancellationToken) -> io::Result<Option<Flusher>>,
    ) -> io::Result<Self> {
        let (queue, waiting) = mpsc::channel(1024);
        let ended = CancellationToken::new();
        // Cancelled however the task ends, a panic included.
        let guard = ended.clone().drop_guard();
        let shared = Shared::default();
        let (commits, outages, deposed) =
            (shared.commits.clone(), shared.outages.clone(), shared.deposed.clone());
        let commit_seconds = Histogram::new(COMMIT_SECONDS);
        let seconds = commit_seconds.clone();
        let flusher = flusher(commit_seconds.clone(), ended.clone())?;
        if opened.1.can_break() {
            tokio::spawn(beat(queue.downgrade()));
        }
        let task = thread.spawn(async move {
            let _guard = guard;
            run(opened, waiting, &shared, (flusher, seconds)).await;
        });
        let task = tokio::sync::Mutex::new(Some(task));
        Ok(Self { queue, task, ended, deposed, commits, outages, commit_seconds })
    }

    /// The counter of commits.
    pub(super) fn commits(&self) -> &Commits {
        &self.commits
    }

    /// Times in which no heartbeat could be stored.
    pub(super) fn outages(&self) -> Arc<Outages> {
        self.outages.clone()
    }

    /// Durations of commits: from the last statement of a transaction to the end of its flush to disk.
    pub(super) fn commit_seconds(&self) -> Histogram {
        self.commit_seconds.clone()
    }

    /// Cancelled when the writer has ended.
    pub(super) fn end(&self) -> CancellationToken {
        self.ended.clone()
    }

    /// Why this server may not lead any more, if the writer has ended for this reason.
    pub(super) fn deposed(&self) -> Option<&str> {
        self.deposed.get().map(String::as_str)
    }

    /// Returns when the writer has ended.
    pub(super) async fn ended(&self) {
        self.ended.cancelled().await;
    }

    /// Executes `work` in a transaction and returns once it is on disk.
    pub(super) async fn write<T, F>(&self, work: F) -> Result<T, StoreError>
    where
        T: Send + 'static,
        F: for<'t> FnOnce(&'t mut Connection) -> Work<'t, T> + Send + 'static,
    {
        self.write_as(false, work).await
    }

    /// Returns when all commits that readers can see now are on disk.
    pub(super) async fn flushed(&self) -> Result<(), StoreError> {
        self.write(|_| Box::pin(async { Ok(()) })).await
    }

    /// The same, in its own transaction when it is large.
    pub(super) async fn write_as<T, F>(&self, is_large: bool, work: F) -> Result<T, StoreError>
    where
        T: Send + 'static,
        F: for<'t> FnOnce(&'t mut Connection) -> Work<'t, T> + Send + 'static,
    {
        let (sender, receiver) = oneshot::channel();
        let write = Box::new(Request { is_large, work, sender });
        self.queue.send(Message::Work(write)).await.map_err(|_| StoreError::WriterGone)?;
        receiver.await.map_err(|_| StoreError::WriterGone)?
    }

    /// Ends after the writes that are queued now.
    pub(super) async fn close(&self) {
        let _ = self.queue.send(Message::Close).await;
        if let Some(task) = self.task.lock().await.take() {
            let _ = task.await;
        }
    }
}

async fn run(
    (connection, mut line): (Connection, Line),
    mut waiting: mpsc::Receiver<Message>,
    shared: &Shared,
    (flusher, seconds): (Option<Flusher>, Histogram),
) {
    let mut next = Next::default();
    let mut open = Some(connection);
    let mut last = Instant::now();
    loop {
        let first = match next.first(&mut waiting).await {
            First::Write(piece) => Some(piece),
            First::Beat if last.elapsed() < BEAT * 3 / 4 => continue,
            First::Beat => None,
            First::End => break,
        };
        let began = Instant::now();
        last = began;
        let is_large = first.as_ref().is_none_or(|first| first.is_large());
        let begun = begin(&mut open, &mut line, is_large, shared).await;
        let connection = match (begun, &mut open) {
            (Ok(()), Some(connection)) => connection,
            (begun, _) => {
                let error = begun.err().unwrap_or(StoreError::WriterGone);
                if line.can_break() {
                    shared.outages.note();
                }
                let deposed = error.end_of_lead();
                match first {
                    Some(first) => {
                        tracing::error!(error = error.as_dyn(), "a transaction could not begin");
                        first.refuse(error);
                    }
                    None => tracing::debug!(error = error.as_dyn(), "the idle connection is broken"),
                }
                if let Some(reason) = deposed {
                    let _ = shared.deposed.set(reason);
                    break;
                }
                continue;
            }
        };
        let Some(first) = first else {
            if !roll_back(connection).await {
                shared.commits.begin();
                open = None;
            }
            if began.elapsed() > STALL {
                shared.outages.note();
            }
            continue;
        };
        let mut finished = Vec::new();
        let committed = if first.is_large() {
            execute_large(connection, first, &mut finished, &shared.commits).await
        } else {
            execute_group(connection, first, &mut waiting, &mut finished, &mut next, &shared.commits).await
        };
        let is_lost = match &committed {
            Ok(_) => false,
            Err(failure) => failure.is_late || !roll_back(connection).await,
        };
        // Before the answers: a client that reads after its answer must not get an older version. A commit on a lost connection may
        // still come, until the next connection is open.
        if is_lost {
            shared.commits.begin();
        } else {
            shared.commits.end();
        }
        if line.can_break() && (committed.is_err() || began.elapsed() > STALL) {
            shared.outages.note();
        }
        let pieces = finished.len();
        let answer: Reply = Box::new(move |committed| {
            for piece in finished {
                (piece.reply)(committed.clone().map_err(StoreError::Commit));
            }
        });
        match (committed, &flusher) {
            (Ok(started), Some(flusher)) => {
                if let Err(answer) = flusher.submit(started, answer) {
                    answer(Err(Arc::new(sqlx::Error::WorkerCrashed)));
                    break;
                }
            }
            (Ok(started), None) => {
                seconds.observe(started.elapsed().as_secs_f64());
                answer(Ok(()));
            }
            (Err(Failure { error, .. }), _) => {
                tracing::error!(%error, pieces, "writes were not committed");
                if is_lost {
                    open = None;
                }
                answer(Err(error));
            }
        }
    }
    if let Some(flusher) = flusher {
        flusher.close().await;
    }
    let Some(connection) = open else { return };
    let closed = match connection.engine() {
        Engine::Sqlite => connection.close().await,
        Engine::Postgres => timeout(postgres::BEGIN_DEADLINE, connection.close()).await.unwrap_or(Ok(())),
    };
    if let Err(error) = closed {
        tracing::warn!(%error, "the database did not close cleanly");
    }
}

mod commits;
mod group;
mod line;
mod outages;
mod queue;
#[cfg(test)]
mod tests;
mod thread;
