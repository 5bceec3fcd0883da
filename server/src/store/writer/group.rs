//! Transactions of the writer: the beginning, the writes, and the commit.
//!
//! A PostgreSQL that neither answers nor closes would block every write. Each step therefore has a deadline here too, beyond the limits
//! that PostgreSQL keeps itself. A connection that misses one is dropped like a broken one.

use std::io;
use std::sync::{Arc, OnceLock};
use std::time::{Duration, Instant};

use tokio::sync::mpsc;
use tokio::time::timeout;

use super::commits::Commits;
use super::line::{Line, Phrases};
use super::outages::Outages;
use super::queue::{Message, Next};
use super::{Finished, Write};
use crate::store::StoreError;
use crate::store::database::{Connection, Engine, postgres, raw_sql};

/// State that the writer shares with the store.
#[derive(Default)]
pub(super) struct Shared {
    pub(super) commits: Commits,
    pub(super) outages: Arc<Outages>,
    /// Why this server may not lead any more.
    pub(super) deposed: Arc<OnceLock<String>>,
}

/// Why a transaction was not committed.
pub(super) struct Failure {
    pub(super) error: Arc<sqlx::Error>,
    /// Whether the connection missed a deadline. It must not be used again.
    pub(super) is_late: bool,
}

impl From<sqlx::Error> for Failure {
    fn from(error: sqlx::Error) -> Self {
        let is_late = matches!(&error, sqlx::Error::Io(error) if error.kind() == io::ErrorKind::TimedOut);
        Self { error: Arc::new(error), is_late }
    }
}

/// The error of a missed deadline.
fn late() -> sqlx::Error {
    sqlx::Error::Io(io::ErrorKind::TimedOut.into())
}

/// Executes statements, on PostgreSQL within a limit.
async fn execute(connection: &mut Connection, sql: &'static str, limit: Duration) -> Result<(), sqlx::Error> {
    let is_limited = connection.engine() == Engine::Postgres;
    let executing = raw_sql(sql).execute(connection);
    match is_limited {
        true => timeout(limit, executing).await.map_err(|_| late())?,
        false => executing.await,
    }
    .map(drop)
}

/// Executes a write, on PostgreSQL within the limit of a statement. A late write fails its group.
async fn run_piece(
    connection: &mut Connection,
    piece: Box<dyn Write>,
    finished: &mut Vec<Finished>,
) -> Result<bool, Failure> {
    let limit = (connection.engine() == Engine::Postgres).then_some(postgres::STATEMENT_DEADLINE);
    let done = piece.run(connection, limit).await;
    let (keep, is_late) = (done.keep, done.is_late);
    // Stored before anything else can fail: it is answered in any case.
    finished.push(done);
    if is_late { Err(late().into()) } else { Ok(keep) }
}

/// Begins the transaction of a write. A broken connection is replaced.
pub(super) async fn begin(
    connection: &mut Option<Connection>,
    line: &mut Line,
    is_large: bool,
    shared: &Shared,
) -> Result<(), StoreError> {
    loop {
        let is_new = connection.is_none();
        let mut open = match connection.take() {
            Some(open) => open,
            None => {
                let open = line.open().await?;
                // The last transaction before it may have been committed.
                shared.commits.begin();
                shared.commits.end();
                shared.outages.note();
                open
            }
        };
        let phrases = Phrases::of(&open);
        let sql = if is_large { phrases.begin } else { phrases.begin_group };
        let asked = Instant::now();
        let begun = execute(&mut open, sql, postgres::BEGIN_DEADLINE).await.map_err(Failure::from);
        let is_late = begun.as_ref().is_err_and(|failure| failure.is_late);
        if begun.is_ok() || !is_late && roll_back(&mut open).await {
            if open.engine() == Engine::Postgres {
                shared.commits.note_alone(asked);
            }
            *connection = Some(open);
        } else {
            // Until the next connection, another server may write.
            shared.commits.begin();
            if !is_new && !is_late {
                // It broke while nobody wrote.
                continue;
            }
        }
        return begun.map_err(|failure| StoreError::Commit(failure.error));
    }
}

/// Ends a failed transaction. Returns whether the connection can be used again.
pub(super) async fn roll_back(connection: &mut Connection) -> bool {
    // Fails in SQLite if there is nothing to roll back, which does no harm.
    let done = execute(connection, "ROLLBACK", postgres::BEGIN_DEADLINE).await;
    done.is_ok() || connection.engine() == Engine::Sqlite
}

/// Executes a large write, and commits. Returns the start of the commit.
pub(super) async fn execute_large(
    connection: &mut Connection,
    piece: Box<dyn Write>,
    finished: &mut Vec<Finished>,
    commits: &Commits,
) -> Result<Instant, Failure> {
    let end = if run_piece(connection, piece, finished).await? { "COMMIT" } else { "ROLLBACK" };
    let started = Instant::now();
    commits.begin();
    execute(connection, end, postgres::STATEMENT_DEADLINE).await?;
    Ok(started)
}

/// Executes the first write and those that are queued now, and commits. Returns the start of the commit.
pub(super) async fn execute_group(
    connection: &mut Connection,
    first: Box<dyn Write>,
    waiting: &mut mpsc::Receiver<Message>,
    finished: &mut Vec<Finished>,
    next: &mut Next,
    commits: &Commits,
) -> Result<Instant, Failure> {
    let mut piece = first;
    let group = Phrases::of(connection).group.min(1 + waiting.len());
    loop {
        let keep = run_piece(connection, piece, finished).await?;
        let more = if finished.len() < group { next.more(waiting) } else { None };
        let sql = match (keep, &more) {
            (true, Some(_)) => "RELEASE piece; SAVEPOINT piece",
            (false, Some(_)) => "ROLLBACK TO piece",
            (true, None) => "RELEASE piece; COMMIT",
            (false, None) => "ROLLBACK TO piece; RELEASE piece; COMMIT",
        };
        let started = Instant::now();
        if more.is_none() {
            commits.begin();
        }
        let outcome = execute(connection, sql, postgres::STATEMENT_DEADLINE).await;
        match (outcome, more) {
            (Ok(_), Some(more)) => piece = more,
            (Ok(_), None) => return Ok(started),
            (Err(error), more) => {
                let failure = Failure::from(error);
                if let Some(more) = more {
                    more.refuse(StoreError::Commit(failure.error.clone()));
                }
                return Err(failure);
            }
        }
    }
}
