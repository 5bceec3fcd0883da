//! The connection of the writer. One to PostgreSQL can break: the next write opens another.

use std::sync::Arc;
use std::time::Duration;

use backon::{BackoffBuilder, ExponentialBuilder};
use tokio::time::{Instant, timeout};

use crate::store::database::{Connection, Engine, postgres};
use crate::store::{Edition, StoreError, leader_tables};

/// How a broken connection is replaced.
pub(in crate::store) struct Line {
    /// None of a file, whose connections do not break.
    server: Option<Server>,
}

struct Server {
    address: postgres::Address,
    edition: Edition,
    /// The sessions that may hold the lock of the server: of the newest connection, and of attempts since then.
    sessions: Vec<i32>,
    /// Pauses between attempts, and the end of the present one.
    pauses: <ExponentialBuilder as BackoffBuilder>::Backoff,
    not_before: Instant,
    /// Why the last attempt failed.
    failure: Option<Arc<StoreError>>,
}

/// Pauses between attempts: each write that comes in one is refused at once.
fn pauses() -> <ExponentialBuilder as BackoffBuilder>::Backoff {
    ExponentialBuilder::default()
        .with_min_delay(Duration::from_millis(50))
        .with_max_delay(Duration::from_secs(2))
        .without_max_times()
        .with_jitter()
        .build()
}

impl Line {
    /// Of a SQLite file.
    pub(in crate::store) fn file() -> Self {
        Self { server: None }
    }

    /// Of PostgreSQL, with the session of the first connection to it.
    pub(in crate::store) fn postgres(
        address: postgres::Address,
        edition: Edition,
        sessions: Vec<i32>,
    ) -> Self {
        let (pauses, not_before) = (pauses(), Instant::now());
        Self { server: Some(Server { address, edition, sessions, pauses, not_before, failure: None }) }
    }

    /// Whether its connections can break.
    pub(super) fn can_break(&self) -> bool {
        self.server.is_some()
    }

    /// Opens a connection in place of a broken one. The earlier session has ended then, and with it the transaction whose outcome nobody
    /// was told.
    pub(super) async fn open(&mut self) -> Result<Connection, StoreError> {
        let Some(server) = &mut self.server else { return Err(StoreError::WriterGone) };
        if let Some(failure) = &server.failure
            && Instant::now() < server.not_before
        {
            return Err(StoreError::Shared(failure.clone()));
        }
        match server.open().await {
            Ok(connection) => {
                (server.pauses, server.failure) = (pauses(), None);
                Ok(connection)
            }
            Err(error) => {
                server.not_before = Instant::now() + server.pauses.next().unwrap_or_default();
                let failure = server.failure.insert(Arc::new(error));
                Err(StoreError::Shared(failure.clone()))
            }
        }
    }
}

impl Server {
    async fn open(&mut self) -> Result<Connection, StoreError> {
        let (connection, _) = self.address.connect_writer(&mut self.sessions).await?;
        let mut connection = Connection::from(connection);
        // Another server may have led and ended meanwhile, and may have upgraded the database.
        let leading = async {
            self.edition.keep_lead(&mut connection).await?;
            leader_tables::prepare(&mut connection).await
        };
        let checked = timeout(postgres::BEGIN_DEADLINE, leading).await;
        if let Err(error) = checked.unwrap_or_else(|_| Err(postgres::late().into())) {
            // The lock ends with the session.
            let _ = timeout(postgres::BEGIN_DEADLINE, connection.close()).await;
            return Err(error);
        }
        tracing::info!(database = %self.address, "connected to PostgreSQL again");
        Ok(connection)
    }
}

/// The statements around writes.
#[derive(Clone, Copy)]
pub(super) struct Phrases {
    /// Begins the transaction of a large write.
    pub(super) begin: &'static str,
    /// Begins a group: several statements per call, since each call into SQLite's thread, or to a server, costs as much as a small
    /// statement.
    pub(super) begin_group: &'static str,
    /// Maximum number of writes per commit. It bounds the time that the first of them waits.
    pub(super) group: usize,
}

impl Phrases {
    pub(super) fn of(connection: &Connection) -> Self {
        match connection.engine() {
            Engine::Sqlite => {
                let begin_group = "BEGIN IMMEDIATE; SAVEPOINT piece";
                Self { begin: "BEGIN IMMEDIATE", begin_group, group: 128 }
            }
            // With more than 64 savepoints, every reader would look them up on disk.
            Engine::Postgres => {
                Self { begin: postgres::BEGIN, begin_group: postgres::BEGIN_GROUP, group: 60 }
            }
        }
    }
}
