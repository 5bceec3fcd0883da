//! Where a database is, and opening it: a SQLite file, or PostgreSQL.

use std::fmt;
use std::path::PathBuf;
use std::str::FromStr;

use sqlx::SqliteConnection;

use super::database::{Connection, Engine, Pool, postgres, raw_sql, sqlite};
use super::edition::Edition;
use super::migrations::migrate;
use super::writer::Line;
use super::{LocationError, StoreError};

/// Where a database is.
#[derive(Clone, Debug)]
pub enum Location {
    /// A SQLite file.
    File(PathBuf),
    /// A database of PostgreSQL.
    Postgres(postgres::Address),
}

impl Location {
    /// The same place, for the sessions of the server at this host and port.
    pub(crate) fn for_server(self, server: Option<&str>) -> Self {
        match (self, server) {
            (Self::Postgres(address), Some(server)) => Self::Postgres(address.for_server(server)),
            (place, _) => place,
        }
    }
}

/// From `postgres://USER@HOST/DATABASE`.
impl FromStr for Location {
    type Err = LocationError;

    fn from_str(text: &str) -> Result<Self, LocationError> {
        text.parse().map(Self::Postgres)
    }
}

/// Without a password.
impl fmt::Display for Location {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::File(path) => path.display().fmt(f),
            Self::Postgres(address) => address.fmt(f),
        }
    }
}

/// An open database.
pub(super) struct Opened {
    /// The only writing connection.
    pub(super) writing: Connection,
    /// Name and version of the database.
    pub(super) version: String,
    /// The write-ahead log of SQLite, which the server flushes.
    pub(super) log: Option<PathBuf>,
    /// How the writing connection is opened again.
    pub(super) line: Line,
}

/// Opens and migrates a database for a server that leads, on the thread of the writer.
pub(super) async fn open(place: &Location, edition: Edition) -> Result<Opened, StoreError> {
    match place {
        Location::File(path) => {
            let (mut writing, version) = sqlite::connect(sqlite::writer_options(path)).await?;
            let log = sqlite::settle_log(&mut writing).await?;
            let mut writing = Connection::from(writing);
            edition.take_lead(&mut writing).await?;
            let version = format!("SQLite {version}");
            Ok(Opened { writing, version, log: Some(log), line: Line::file() })
        }
        Location::Postgres(address) => {
            let mut sessions = Vec::new();
            let (writing, version) = address.connect_writer(&mut sessions).await?;
            let mut writing = Connection::from(writing);
            edition.take_lead(&mut writing).await?;
            let line = Line::postgres(address.clone(), edition, sessions);
            Ok(Opened { writing, version, log: None, line })
        }
    }
}

/// The readers of an open database. Of SQLite, also the connection that copies the write-ahead log.
pub(super) async fn open_readers(place: &Location) -> Result<(Pool, Option<SqliteConnection>), StoreError> {
    match place {
        Location::File(path) => {
            let readers = Pool::Sqlite(sqlite::readers(path).await?);
            let (copier, _) = sqlite::connect(sqlite::options(path).create_if_missing(false)).await?;
            Ok((readers, Some(copier)))
        }
        Location::Postgres(address) => Ok((Pool::Postgres(address.readers()), None)),
    }
}

/// Opens and migrates a database that no server uses. Of a file, the caller knows.
pub(super) async fn open_alone(place: &Location, create: bool) -> Result<Connection, StoreError> {
    let mut connection: Connection = match place {
        Location::File(path) => {
            sqlite::connect(sqlite::options(path).create_if_missing(create)).await?.0.into()
        }
        Location::Postgres(address) => address.connect_writer(&mut Vec::new()).await?.0.into(),
    };
    migrate(&mut connection).await?;
    if connection.engine() == Engine::Postgres {
        // A table is read and written as a whole.
        raw_sql("SET statement_timeout = 0").execute(&mut connection).await?;
    }
    Ok(connection)
}
