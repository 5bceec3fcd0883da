//! The election of a leader: of the servers that share a database of PostgreSQL, the one whose writing connection holds a lock.
//!
//! PostgreSQL gives the lock to one session and takes it back with the session, so that the lock and the writes end together. The name of
//! the session has the address of its server.

use std::time::Duration;

use sqlx::PgConnection;
use tokio::time::timeout;

use super::database::Connection;
use super::database::postgres::{self, Address};
use super::{Edition, StoreError};

/// A leader whose session is idle for this long has stopped, or has lost PostgreSQL: a leader writes every [`BEAT`](super::writer::BEAT).
const SILENT_S: f64 = 15.0;

/// Maximum time of a question.
const PATIENCE: Duration = Duration::from_secs(5);

/// The leader, as seen from one server.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Leader {
    /// Nobody.
    Nobody,
    /// The server at this host and port.
    At(String),
    /// A session without an address: a command that writes, or a server of an earlier version.
    Unnamed,
}

/// A connection that asks who leads.
pub(crate) struct Election {
    address: Address,
    connection: Option<PgConnection>,
}

impl Election {
    pub(crate) fn new(address: Address) -> Self {
        Self { address, connection: None }
    }

    /// The leader of this moment. Ends the session of a leader that has been silent for too long, so that another server can lead.
    pub(crate) async fn leader(&mut self) -> Result<Leader, StoreError> {
        let mut connection = self.connection().await?;
        // A connection that fails is not used again.
        let leader = within(ask(&mut connection)).await?;
        self.connection = Some(connection);
        Ok(leader)
    }

    /// Whether an access token is valid. A database that no server has opened yet has none.
    pub(crate) async fn has_tokens(&mut self) -> Result<bool, StoreError> {
        let mut connection = self.connection().await?;
        let found = within(has_tokens(&mut connection)).await?;
        self.connection = Some(connection);
        Ok(found)
    }

    /// Refuses a database that a newer program has led, before this one asks for the lock.
    pub(crate) async fn refuse_newer(&mut self, edition: Edition) -> Result<(), StoreError> {
        let mut connection = Connection::from(self.connection().await?);
        let checked = timeout(PATIENCE, edition.refuse_newer(&mut connection)).await;
        checked.unwrap_or_else(|_| Err(postgres::late().into()))?;
        if let Connection::Postgres(connection) = connection {
            self.connection = Some(*connection);
        }
        Ok(())
    }

    /// Uses another connection from now on: the last one may lead to a server of PostgreSQL that is no longer the primary.
    pub(crate) fn forget_connection(&mut self) {
        self.connection = None;
    }

    async fn connection(&mut self) -> Result<PgConnection, StoreError> {
        match self.connection.take() {
            Some(connection) => Ok(connection),
            None => Ok(self.address.connect().await?.0),
        }
    }
}

async fn within<T>(question: impl Future<Output = Result<T, sqlx::Error>>) -> Result<T, StoreError> {
    Ok(timeout(PATIENCE, question).await.map_err(|_| postgres::late()).flatten()?)
}

async fn has_tokens(connection: &mut PgConnection) -> Result<bool, sqlx::Error> {
    let exists = "SELECT to_regclass('tokens') IS NOT NULL";
    if !sqlx::query_scalar::<_, bool>(exists).fetch_one(&mut *connection).await? {
        return Ok(false);
    }
    // No other column: the schema may be that of an older leader. An expired token closes the server too.
    let valid = "SELECT EXISTS (SELECT 1 FROM tokens WHERE revoked_at IS NULL)";
    sqlx::query_scalar(valid).fetch_one(connection).await
}

async fn ask(connection: &mut PgConnection) -> Result<Leader, sqlx::Error> {
    let holder: Option<(i32, Option<String>, Option<bool>)> =
        sqlx::query_as(postgres::HOLDER).bind(SILENT_S).fetch_optional(&mut *connection).await?;
    let Some((session, name, is_silent)) = holder else { return Ok(Leader::Nobody) };
    let address = name.as_deref().and_then(postgres::address_in_name);
    if is_silent == Some(true) && address.is_some() {
        tracing::warn!(
            leader = address,
            "the leading server is silent: its session is ended, and another server leads"
        );
        sqlx::query("SELECT pg_terminate_backend($1)").bind(session).execute(connection).await?;
        return Ok(Leader::Nobody);
    }
    Ok(address.map_or(Leader::Unnamed, |address| Leader::At(address.to_owned())))
}
