//! The one writer: a task that owns the one writing connection and commits in groups.
//!
//! SQLite has one writer at a time and a commit costs a flush to disk, so whatever has queued up while a
//! group was being committed makes the next group: `BEGIN IMMEDIATE`, each piece of work in a savepoint of
//! its own, `COMMIT`, then the answers. A piece that fails is rolled back alone. Nothing but SQL on this
//! connection is awaited inside, and the next piece of a large sweep; a caller that goes away (a closed connection) does not interrupt it.
//!
//! A large piece has a transaction to itself and needs no savepoint, for which SQLite would copy every page before its first change: a
//! sweep of 10,000 jobs changes 10,000 pages of a long queue's indices.

use std::future::Future;
use std::pin::Pin;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Instant;

use prometheus_client::metrics::histogram::Histogram;
use sqlx::{Connection, SqliteConnection};
use tokio::sync::{mpsc, oneshot};
use tokio::task::JoinHandle;
use tokio_util::sync::CancellationToken;

use super::StoreError;

/// What a piece of work returns: a future that borrows the connection.
pub(super) type Work<'t, T> = Pin<Box<dyn Future<Output = Result<T, StoreError>> + Send + 't>>;

type Run<'t> = Pin<Box<dyn Future<Output = Finished> + Send + 't>>;

/// A piece of work with somebody who waits for it.
trait Piece: Send {
    /// Whether it has a transaction to itself.
    fn is_large(&self) -> bool;

    /// Does the work, which is then to be committed and answered.
    fn run<'t>(self: Box<Self>, connection: &'t mut SqliteConnection) -> Run<'t>;

    /// Answers that the work was not begun.
    fn refuse(self: Box<Self>, error: StoreError);
}

struct Asked<T, F> {
    is_large: bool,
    work: F,
    sender: oneshot::Sender<Result<T, StoreError>>,
}

impl<T, F> Piece for Asked<T, F>
where
    T: Send + 'static,
    F: for<'t> FnOnce(&'t mut SqliteConnection) -> Work<'t, T> + Send + 'static,
{
    fn is_large(&self) -> bool {
        self.is_large
    }

    fn run<'t>(self: Box<Self>, connection: &'t mut SqliteConnection) -> Run<'t> {
        Box::pin(async move {
            let Self { work, sender, .. } = *self;
            let outcome = work(connection).await;
            let keep = outcome.is_ok();
            let reply = Box::new(move |committed: Result<(), StoreError>| {
                // An error of its own says more than that of the group. Nobody may be listening any more.
                let _ = sender.send(outcome.and_then(|value| committed.map(|()| value)));
            });
            Finished { keep, reply }
        })
    }

    fn refuse(self: Box<Self>, error: StoreError) {
        let _ = self.sender.send(Err(error));
    }
}

/// Work done but not yet committed.
struct Finished {
    keep: bool,
    reply: Box<dyn FnOnce(Result<(), StoreError>) + Send>,
}

/// At most so many pieces share a commit: a bound on how long the first of them waits.
const GROUP: usize = 128;

/// Upper ends of the classes of commit times, in seconds: from an SSD with fast flushes to a disk in trouble.
const COMMIT_SECONDS: [f64; 10] = [0.0005, 0.001, 0.002, 0.005, 0.01, 0.025, 0.1, 0.5, 2.0, 10.0];

pub(super) struct Writer {
    queue: mpsc::Sender<Message>,
    task: tokio::sync::Mutex<Option<JoinHandle<()>>>,
    ended: CancellationToken,
    commits: Arc<AtomicU64>,
    commit_seconds: Histogram,
}

enum Message {
    Work(Box<dyn Piece>),
    Close,
}

impl Writer {
    pub(super) fn start(connection: SqliteConnection) -> Self {
        let (queue, waiting) = mpsc::channel(1024);
        let ended = CancellationToken::new();
        // Cancelled however the task ends, a panic included.
        let guard = ended.clone().drop_guard();
        let commits = Arc::new(AtomicU64::new(0));
        let counted = commits.clone();
        let commit_seconds = Histogram::new(COMMIT_SECONDS);
        let timed = commit_seconds.clone();
        let task = tokio::spawn(async move {
            let _guard = guard;
            run(connection, waiting, &counted, &timed).await;
        });
        Self { queue, task: tokio::sync::Mutex::new(Some(task)), ended, commits, commit_seconds }
    }

    /// How often it has committed, which the connections that read see from then on.
    pub(super) fn commits(&self) -> u64 {
        self.commits.load(Ordering::Acquire)
    }

    /// Where it counts them.
    pub(super) fn counter(&self) -> Arc<AtomicU64> {
        self.commits.clone()
    }

    /// How long commits take: the last statement of a transaction, which flushes to the disk.
    pub(super) fn commit_seconds(&self) -> Histogram {
        self.commit_seconds.clone()
    }

    /// Cancelled when the writer has ended.
    pub(super) fn end(&self) -> CancellationToken {
        self.ended.clone()
    }

    /// Returns when the writer has ended.
    pub(super) async fn ended(&self) {
        self.ended.cancelled().await;
    }

    /// Runs `work` in a transaction and returns once it is on disk.
    pub(super) async fn write<T, F>(&self, work: F) -> Result<T, StoreError>
    where
        T: Send + 'static,
        F: for<'t> FnOnce(&'t mut SqliteConnection) -> Work<'t, T> + Send + 'static,
    {
        self.write_as(false, work).await
    }

    /// The same, in a transaction of its own when it is large.
    pub(super) async fn write_as<T, F>(&self, is_large: bool, work: F) -> Result<T, StoreError>
    where
        T: Send + 'static,
        F: for<'t> FnOnce(&'t mut SqliteConnection) -> Work<'t, T> + Send + 'static,
    {
        let (sender, receiver) = oneshot::channel();
        let piece = Box::new(Asked { is_large, work, sender });
        self.queue.send(Message::Work(piece)).await.map_err(|_| StoreError::WriterGone)?;
        receiver.await.map_err(|_| StoreError::WriterGone)?
    }

    /// Ends after what is queued by now.
    pub(super) async fn close(&self) {
        let _ = self.queue.send(Message::Close).await;
        if let Some(task) = self.task.lock().await.take() {
            let _ = task.await;
        }
    }
}

/// What comes next from the queue.
#[derive(Default)]
struct Next {
    /// A large piece that came while a group was open.
    large: Option<Box<dyn Piece>>,
    /// Nothing comes any more.
    is_closed: bool,
}

impl Next {
    /// The first piece of a group.
    async fn first(&mut self, waiting: &mut mpsc::Receiver<Message>) -> Option<Box<dyn Piece>> {
        if self.large.is_some() || self.is_closed {
            return self.large.take();
        }
        match waiting.recv().await {
            Some(Message::Work(piece)) => Some(piece),
            Some(Message::Close) | None => None,
        }
    }

    /// One more for the same group, if it waits there and may join it.
    fn more(&mut self, waiting: &mut mpsc::Receiver<Message>) -> Option<Box<dyn Piece>> {
        match waiting.try_recv().ok()? {
            Message::Work(piece) if piece.is_large() => self.large = Some(piece),
            Message::Work(piece) => return Some(piece),
            Message::Close => self.is_closed = true,
        }
        None
    }
}

async fn run(
    mut connection: SqliteConnection,
    mut waiting: mpsc::Receiver<Message>,
    commits: &AtomicU64,
    seconds: &Histogram,
) {
    let mut next = Next::default();
    while let Some(first) = next.first(&mut waiting).await {
        // Several statements in one go: each way to SQLite's thread and back costs as much as a small statement.
        let begin = if first.is_large() { "BEGIN IMMEDIATE" } else { "BEGIN IMMEDIATE; SAVEPOINT piece" };
        if let Err(error) = sqlx::raw_sql(begin).execute(&mut connection).await {
            let error = StoreError::Commit(Arc::new(error));
            tracing::error!(error = error.as_dyn(), "a write was not begun");
            first.refuse(error);
            continue;
        }
        let mut finished = Vec::new();
        let committed = if first.is_large() {
            alone(&mut connection, first, &mut finished, seconds).await
        } else {
            group(&mut connection, first, &mut waiting, &mut finished, &mut next, seconds).await
        };
        // Before anybody is answered: who asks after that must not be told the versions of before.
        commits.fetch_add(1, Ordering::Release);
        let failure = committed.err();
        if let Some(error) = &failure {
            tracing::error!(%error, pieces = finished.len(), "a group of writes was not committed");
            // Fails where there is nothing to roll back, which is as good.
            let _ = sqlx::query("ROLLBACK").execute(&mut connection).await;
        }
        for piece in finished {
            (piece.reply)(failure.clone().map_or(Ok(()), |error| Err(StoreError::Commit(error))));
        }
    }
    if let Err(error) = connection.close().await {
        tracing::warn!(%error, "the database did not close cleanly");
    }
}

/// Does a large piece, and commits.
async fn alone(
    connection: &mut SqliteConnection,
    piece: Box<dyn Piece>,
    finished: &mut Vec<Finished>,
    seconds: &Histogram,
) -> Result<(), Arc<sqlx::Error>> {
    let done = piece.run(&mut *connection).await;
    let end = if done.keep { "COMMIT" } else { "ROLLBACK" };
    finished.push(done);
    let started = Instant::now();
    let ended = sqlx::raw_sql(end).execute(connection).await;
    seconds.observe(started.elapsed().as_secs_f64());
    ended.map(drop).map_err(Arc::new)
}

/// Does the first piece and what has queued up meanwhile, and commits.
async fn group(
    connection: &mut SqliteConnection,
    first: Box<dyn Piece>,
    waiting: &mut mpsc::Receiver<Message>,
    finished: &mut Vec<Finished>,
    next: &mut Next,
    seconds: &Histogram,
) -> Result<(), Arc<sqlx::Error>> {
    let mut piece = first;
    loop {
        let done = piece.run(&mut *connection).await;
        let keep = done.keep;
        // Noted before anything else can fail: it is to be answered either way.
        finished.push(done);
        let more = if finished.len() < GROUP { next.more(waiting) } else { None };
        let sql = match (keep, &more) {
            (true, Some(_)) => "RELEASE piece; SAVEPOINT piece",
            (false, Some(_)) => "ROLLBACK TO piece",
            (true, None) => "RELEASE piece; COMMIT",
            (false, None) => "ROLLBACK TO piece; RELEASE piece; COMMIT",
        };
        let started = Instant::now();
        let outcome = sqlx::raw_sql(sql).execute(&mut *connection).await;
        if more.is_none() {
            seconds.observe(started.elapsed().as_secs_f64());
        }
        match (outcome, more) {
            (Ok(_), Some(more)) => piece = more,
            (Ok(_), None) => return Ok(()),
            (Err(error), more) => {
                let error = Arc::new(error);
                if let Some(more) = more {
                    more.refuse(StoreError::Commit(error.clone()));
                }
                return Err(error);
            }
        }
    }
}

#[cfg(test)]
mod tests;
