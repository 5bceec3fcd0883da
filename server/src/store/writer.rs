//! The one writer: a task that owns the one writing connection and commits in groups.
//!
//! SQLite has one writer at a time and a commit costs a flush to disk, so whatever has queued up while a
//! group was being committed makes the next group: `BEGIN IMMEDIATE`, each piece of work in a savepoint of
//! its own, `COMMIT`, then the answers. A piece that fails is rolled back alone. Nothing but SQL on this
//! connection is awaited inside, and a caller that goes away (a closed connection) does not interrupt it.

use std::future::Future;
use std::pin::Pin;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

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
    /// Does the work, which is then to be committed and answered.
    fn run<'t>(self: Box<Self>, connection: &'t mut SqliteConnection) -> Run<'t>;

    /// Answers that the work was not begun.
    fn refuse(self: Box<Self>, error: StoreError);
}

struct Asked<T, F> {
    work: F,
    sender: oneshot::Sender<Result<T, StoreError>>,
}

impl<T, F> Piece for Asked<T, F>
where
    T: Send + 'static,
    F: for<'t> FnOnce(&'t mut SqliteConnection) -> Work<'t, T> + Send + 'static,
{
    fn run<'t>(self: Box<Self>, connection: &'t mut SqliteConnection) -> Run<'t> {
        Box::pin(async move {
            let Self { work, sender } = *self;
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

pub(super) struct Writer {
    queue: mpsc::Sender<Message>,
    task: tokio::sync::Mutex<Option<JoinHandle<()>>>,
    ended: CancellationToken,
    commits: Arc<AtomicU64>,
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
        let task = tokio::spawn(async move {
            let _guard = guard;
            run(connection, waiting, &counted).await;
        });
        Self { queue, task: tokio::sync::Mutex::new(Some(task)), ended, commits }
    }

    /// How often it has committed, which the connections that read see from then on.
    pub(super) fn commits(&self) -> u64 {
        self.commits.load(Ordering::Acquire)
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
        let (sender, receiver) = oneshot::channel();
        let piece = Box::new(Asked { work, sender });
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

async fn run(mut connection: SqliteConnection, mut waiting: mpsc::Receiver<Message>, commits: &AtomicU64) {
    let mut open = true;
    while open {
        let Some(Message::Work(first)) = waiting.recv().await else { break };
        // Several statements in one go: each way to SQLite's thread and back costs as much as a small statement.
        if let Err(error) = sqlx::raw_sql("BEGIN IMMEDIATE; SAVEPOINT piece").execute(&mut connection).await {
            let error = StoreError::Commit(Arc::new(error));
            tracing::error!(error = error.as_dyn(), "a write was not begun");
            first.refuse(error);
            continue;
        }
        let mut finished = Vec::new();
        let committed = group(&mut connection, first, &mut waiting, &mut finished, &mut open).await;
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

/// Does the first piece and what has queued up meanwhile, and commits.
async fn group(
    connection: &mut SqliteConnection,
    first: Box<dyn Piece>,
    waiting: &mut mpsc::Receiver<Message>,
    finished: &mut Vec<Finished>,
    open: &mut bool,
) -> Result<(), Arc<sqlx::Error>> {
    let mut piece = first;
    loop {
        let done = piece.run(&mut *connection).await;
        let keep = done.keep;
        // Noted before anything else can fail: it is to be answered either way.
        finished.push(done);
        let message = if finished.len() < GROUP { waiting.try_recv().ok() } else { None };
        let next = match message {
            Some(Message::Work(piece)) => Some(piece),
            Some(Message::Close) => {
                *open = false;
                None
            }
            None => None,
        };
        let sql = match (keep, &next) {
            (true, Some(_)) => "RELEASE piece; SAVEPOINT piece",
            (false, Some(_)) => "ROLLBACK TO piece",
            (true, None) => "RELEASE piece; COMMIT",
            (false, None) => "ROLLBACK TO piece; RELEASE piece; COMMIT",
        };
        let outcome = sqlx::raw_sql(sql).execute(&mut *connection).await;
        match (outcome, next) {
            (Ok(_), Some(next)) => piece = next,
            (Ok(_), None) => return Ok(()),
            (Err(error), next) => {
                let error = Arc::new(error);
                if let Some(next) = next {
                    next.refuse(StoreError::Commit(error.clone()));
                }
                return Err(error);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use sqlx::ConnectOptions;
    use sqlx::sqlite::SqliteConnectOptions;

    use super::*;
    use crate::store::Hindrance;

    #[tokio::test]
    async fn a_busy_database_is_told_and_the_writer_goes_on() {
        let dir = tempfile::tempdir().unwrap();
        let options = SqliteConnectOptions::new().filename(dir.path().join("db")).create_if_missing(true);
        let options = options.busy_timeout(Duration::from_millis(20));
        let mut other = options.connect().await.unwrap();
        let writer = Writer::start(options.connect().await.unwrap());
        sqlx::query("BEGIN IMMEDIATE").execute(&mut other).await.unwrap();
        let error = writer.write(|_| Box::pin(async { Ok(()) })).await.unwrap_err();
        assert_eq!(error.hindrance(), Some(Hindrance::Busy), "{error:?}");
        sqlx::query("ROLLBACK").execute(&mut other).await.unwrap();
        writer.write(|_| Box::pin(async { Ok(()) })).await.unwrap();
        writer.close().await;
    }

    #[tokio::test]
    async fn a_full_disk_is_told_and_the_writer_goes_on() {
        let dir = tempfile::tempdir().unwrap();
        let options = SqliteConnectOptions::new().filename(dir.path().join("db")).create_if_missing(true);
        let mut connection = options.connect().await.unwrap();
        let small = "CREATE TABLE t (x); PRAGMA max_page_count = 3";
        sqlx::raw_sql(small).execute(&mut connection).await.unwrap();
        let writer = Writer::start(connection);
        let insert = async |bytes: i64| {
            let sql = "INSERT INTO t VALUES (zeroblob(?))";
            writer
                .write(move |tx| {
                    Box::pin(async move { Ok(sqlx::query(sql).bind(bytes).execute(tx).await.map(drop)?) })
                })
                .await
        };
        let error = insert(1_000_000).await.unwrap_err();
        assert_eq!(error.hindrance(), Some(Hindrance::Full), "{error:?}");
        insert(10).await.unwrap();
        writer.close().await;
    }

    #[tokio::test]
    async fn a_writer_that_panics_says_that_it_ended() {
        let writer = Writer::start(SqliteConnectOptions::new().in_memory(true).connect().await.unwrap());
        let lost = writer.write::<(), _>(|_| Box::pin(async { panic!("on purpose") })).await;
        assert!(matches!(lost, Err(StoreError::WriterGone)), "{lost:?}");
        tokio::time::timeout(Duration::from_secs(20), writer.ended()).await.expect("told");
    }
}
