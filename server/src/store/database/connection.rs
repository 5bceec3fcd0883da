//! Connections and pools of either engine.

use sqlx::pool::PoolConnection;
use sqlx::postgres::PgPool;
use sqlx::sqlite::SqlitePool;
use sqlx::{Connection as _, Error, PgConnection, Postgres, Sqlite, SqliteConnection};

use super::postgres;

/// The kind of a database.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::store) enum Engine {
    Sqlite,
    Postgres,
}

/// A connection, of its own or lent by a pool.
pub(in crate::store) enum Connection {
    Sqlite(Box<SqliteConnection>),
    Postgres(Box<PgConnection>),
    LentSqlite(PoolConnection<Sqlite>),
    LentPostgres(PoolConnection<Postgres>),
}

impl Connection {
    /// The kind of its database.
    pub(in crate::store) fn engine(&self) -> Engine {
        match self {
            Self::Sqlite(_) | Self::LentSqlite(_) => Engine::Sqlite,
            Self::Postgres(_) | Self::LentPostgres(_) => Engine::Postgres,
        }
    }

    /// Whether no server uses the database of this connection, nor will while it is open. Of a file, the caller knows.
    pub(in crate::store) async fn locks_out_servers(&mut self) -> Result<bool, Error> {
        match self {
            Self::Postgres(connection) => {
                sqlx::query_scalar(postgres::LOCK_SERVER).fetch_one(&mut **connection).await
            }
            _ => Ok(true),
        }
    }

    /// Closes it in order; a lent one returns to its pool.
    pub(in crate::store) async fn close(self) -> Result<(), Error> {
        match self {
            Self::Sqlite(connection) => connection.close().await,
            Self::Postgres(connection) => connection.close().await,
            Self::LentSqlite(_) | Self::LentPostgres(_) => Ok(()),
        }
    }
}

impl From<SqliteConnection> for Connection {
    fn from(connection: SqliteConnection) -> Self {
        Self::Sqlite(Box::new(connection))
    }
}

impl From<PgConnection> for Connection {
    fn from(connection: PgConnection) -> Self {
        Self::Postgres(Box::new(connection))
    }
}

/// A pool of reading connections.
#[derive(Clone, Debug)]
pub(in crate::store) enum Pool {
    Sqlite(SqlitePool),
    Postgres(PgPool),
}

impl Pool {
    /// The kind of its database.
    pub(in crate::store) fn engine(&self) -> Engine {
        match self {
            Self::Sqlite(_) => Engine::Sqlite,
            Self::Postgres(_) => Engine::Postgres,
        }
    }

    /// A connection for several queries.
    pub(in crate::store) async fn acquire(&self) -> Result<Connection, Error> {
        Ok(match self {
            Self::Sqlite(pool) => Connection::LentSqlite(pool.acquire().await?),
            Self::Postgres(pool) => Connection::LentPostgres(pool.acquire().await?),
        })
    }

    /// Closes all connections in order.
    pub(in crate::store) async fn close(&self) {
        match self {
            Self::Sqlite(pool) => pool.close().await,
            Self::Postgres(pool) => pool.close().await,
        }
    }
}

/// A connection or a pool that executes a query.
pub(in crate::store) enum Executor<'c> {
    Sqlite(&'c mut SqliteConnection),
    Postgres(&'c mut PgConnection),
    LentPostgres(&'c mut PoolConnection<Postgres>),
    SqlitePool(&'c SqlitePool),
    PostgresPool(&'c PgPool),
}

impl<'c> From<&'c mut Connection> for Executor<'c> {
    fn from(connection: &'c mut Connection) -> Self {
        match connection {
            Connection::Sqlite(connection) => Self::Sqlite(connection),
            Connection::Postgres(connection) => Self::Postgres(connection),
            Connection::LentSqlite(connection) => Self::Sqlite(connection),
            Connection::LentPostgres(connection) => Self::LentPostgres(connection),
        }
    }
}

impl<'c> From<&'c Pool> for Executor<'c> {
    fn from(pool: &'c Pool) -> Self {
        match pool {
            Pool::Sqlite(pool) => Self::SqlitePool(pool),
            Pool::Postgres(pool) => Self::PostgresPool(pool),
        }
    }
}

impl<'c> From<&'c mut SqliteConnection> for Executor<'c> {
    fn from(connection: &'c mut SqliteConnection) -> Self {
        Self::Sqlite(connection)
    }
}

impl<'c> From<&'c mut PgConnection> for Executor<'c> {
    fn from(connection: &'c mut PgConnection) -> Self {
        Self::Postgres(connection)
    }
}
