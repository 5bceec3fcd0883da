//! The one writer: a task that owns the one writing connection and commits in groups.
//!
//! SQLite has one writer at a time and a commit costs a flush to disk, so whatever has queued up while a
//! group was being committed makes the next group: `BEGIN IMMEDIATE`, each piece of work in a savepoint of
//! its own, `COMMIT`, then the answers. A piece that fails is rolled back alone. Nothing but SQL on this
//! connection is awaited inside, and a caller that goes away (a closed connection) does not interrupt it.

use std::future::Future;
use std::pin::Pin;

use sqlx::{Connection, SqliteConnection};
use tokio::sync::{mpsc, oneshot};
use tokio::task::JoinHandle;

use super::StoreError;

/// What a piece of work returns: a future that borrows the connection.
pub(super) type Work<'t, T> = Pin<Box<dyn Future<Output = Result<T, StoreError>> + Send + 't>>;

type Piece = Box<dyn for<'t> FnOnce(&'t mut SqliteConnection) -> BorrowedFinish<'t> + Send>;
type BorrowedFinish<'t> = Pin<Box<dyn Future<Output = Finished> + Send + 't>>;

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
}

enum Message {
    Work(Piece),
    Close,
}

impl Writer {
    pub(super) fn start(connection: SqliteConnection) -> Self {
        let (queue, waiting) = mpsc::channel(1024);
        let task = tokio::spawn(run(connection, waiting));
        Self { queue, task: tokio::sync::Mutex::new(Some(task)) }
    }

    /// Runs `work` in a transaction and returns once it is on disk.
    pub(super) async fn write<T, F>(&self, work: F) -> Result<T, StoreError>
    where
        T: Send + 'static,
        F: for<'t> FnOnce(&'t mut SqliteConnection) -> Work<'t, T> + Send + 'static,
    {
        let (sender, receiver) = oneshot::channel();
        let piece: Piece = Box::new(move |connection| {
            Box::pin(async move {
                let outcome = work(connection).await;
                let keep = outcome.is_ok();
                let reply = Box::new(move |committed: Result<(), StoreError>| {
                    // An error of its own says more than that of the group. Nobody may be listening any more.
                    let _ = sender.send(outcome.and_then(|value| committed.map(|()| value)));
                });
                Finished { keep, reply }
            })
        });
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

async fn run(mut connection: SqliteConnection, mut waiting: mpsc::Receiver<Message>) {
    let mut open = true;
    while open {
        let Some(Message::Work(first)) = waiting.recv().await else { break };
        let mut finished = Vec::new();
        let mut next = Some(first);
        let committed = async {
            sqlx::query("BEGIN IMMEDIATE").execute(&mut connection).await?;
            while let Some(piece) = next.take() {
                finished.push(run_piece(&mut connection, piece).await?);
                if finished.len() < GROUP {
                    match waiting.try_recv() {
                        Ok(Message::Work(piece)) => next = Some(piece),
                        Ok(Message::Close) => open = false,
                        Err(_) => {}
                    }
                }
            }
            sqlx::query("COMMIT").execute(&mut connection).await?;
            Ok::<_, sqlx::Error>(())
        }
        .await;
        let failure = committed.err().map(|error| error.to_string());
        if let Some(message) = &failure {
            tracing::error!(message, pieces = finished.len(), "a group of writes was not committed");
            // Fails where there is nothing to roll back, which is as good.
            let _ = sqlx::query("ROLLBACK").execute(&mut connection).await;
        }
        for piece in finished {
            (piece.reply)(failure.clone().map_or(Ok(()), |message| Err(StoreError::Commit(message))));
        }
    }
    if let Err(error) = connection.close().await {
        tracing::warn!(%error, "the database did not close cleanly");
    }
}

async fn run_piece(connection: &mut SqliteConnection, piece: Piece) -> Result<Finished, sqlx::Error> {
    sqlx::query("SAVEPOINT piece").execute(&mut *connection).await?;
    let finished = piece(&mut *connection).await;
    if !finished.keep {
        sqlx::query("ROLLBACK TO piece").execute(&mut *connection).await?;
    }
    sqlx::query("RELEASE piece").execute(&mut *connection).await?;
    Ok(finished)
}
