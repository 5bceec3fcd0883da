//! Failures of the store, and those that pass.

use std::sync::Arc;

use libsqlite3_sys::{SQLITE_BUSY, SQLITE_FULL};
use sqlx::postgres::PgDatabaseError;

/// The reason why an address is not one of PostgreSQL.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum LocationError {
    /// It has another form.
    #[error("give a database as postgres://USER@HOST/DATABASE")]
    NotPostgres,
}

/// A failure of the store, never the fault of a request.
#[derive(Debug, thiserror::Error)]
pub enum StoreError {
    /// A query failed.
    #[error("database query failed")]
    Sql(#[from] sqlx::Error),
    /// A migration failed.
    #[error("the database could not be migrated to this version")]
    Migrate(#[from] sqlx::migrate::MigrateError),
    /// A newer program has opened this database.
    #[error(
        "the database was made by a newer roost (schema {found}; this one knows schemas up to {known}): use that version, or restore a backup \
         from before"
    )]
    Newer {
        /// The newest migration that has run.
        found: i64,
        /// The newest migration of this program.
        known: i64,
    },
    /// A running server of an older program uses this database.
    #[error(
        "the database was made by an older roost (schema {found}; this one needs schema {known}), and a server uses it: restart the server with \
         this version of roost, which upgrades the database"
    )]
    Older {
        /// The newest migration that has run.
        found: i64,
        /// The newest migration of this program.
        known: i64,
    },
    /// A server with a newer solver has led this database.
    #[error(
        "a server with solver revision {found} has led this database; this program has revision {own}, and results of two solvers must not \
         be mixed: use that version, or restore a backup from before"
    )]
    NewerSolver {
        /// The newest revision of a leader.
        found: i64,
        /// The revision of this program.
        own: i64,
    },
    /// The database has an older schema than before.
    #[error("an older state of the database has taken its place (schema {found} instead of {known})")]
    Replaced {
        /// The newest migration that has run.
        found: i64,
        /// The newest migration of this program.
        known: i64,
    },
    /// PostgreSQL did not accept a connection.
    #[error("cannot connect to {database}")]
    Connect {
        /// Its address, without a password.
        database: String,
        /// The cause.
        source: sqlx::Error,
    },
    /// Another server uses the database.
    #[error("another roost server uses {0}: stop it first, or use another database")]
    OtherServer(String),
    /// PostgreSQL accepts no writes.
    #[error("{0} cannot be used: it accepts no writes: give the address of the primary")]
    ReadOnly(String),
    /// PostgreSQL cannot hold the database of a server.
    #[error("{database} cannot be used: {reason}")]
    Unsuitable {
        /// Its address, without a password.
        database: String,
        /// The reason, and the action that corrects it.
        reason: String,
    },
    /// A copy would mix two databases.
    #[error("{0} already has rows: copy into an empty database")]
    NotEmpty(String),
    /// A copy is not equal to its source.
    #[error("the copy of the table {0} differs from its source")]
    Differs(&'static str),
    /// A commit failed.
    #[error("writes were not committed")]
    Commit(#[source] Arc<sqlx::Error>),
    /// One failure that several requests share.
    #[error(transparent)]
    Shared(Arc<StoreError>),
    /// An object could not be read or written.
    #[error("an object could not be read or written")]
    Object(#[from] object_store::Error),
    /// The bucket of objects cannot be used.
    #[error("the bucket {bucket} cannot be used: {message}")]
    Bucket {
        /// Its address.
        bucket: String,
        /// The reason with its causes.
        message: String,
    },
    /// A folder could not be used.
    #[error("a folder of the data directory could not be used")]
    Folder(#[from] std::io::Error),
    /// The jobs of a sweep were not all stored.
    #[error("only {queued} of {jobs} jobs of a sweep were stored")]
    Unfinished {
        /// Stored jobs.
        queued: u64,
        /// All jobs.
        jobs: u64,
    },
    /// Another request deleted a sweep during its submission.
    #[error("the sweep was deleted before all of its jobs were stored")]
    Interrupted,
    /// The writer has stopped.
    #[error("the database writer has stopped")]
    WriterGone,
    /// The SQLite library can corrupt a database.
    #[error("SQLite {0} can corrupt its write-ahead log; 3.51.3 or newer is needed")]
    OldSqlite(String),
    /// A stored value is not valid.
    #[error("stored {what} cannot be read: {message}")]
    Corrupt {
        /// The name of the value.
        what: &'static str,
        /// The error.
        message: String,
    },
}

/// The reason why a sound database is unavailable for now.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Unavailable {
    /// Another process holds its lock.
    Busy,
    /// The disk is full.
    Full,
    /// PostgreSQL does not answer.
    Away,
    /// The disk of PostgreSQL is full.
    FullPostgres,
    /// The database takes too long.
    Slow,
    /// PostgreSQL refuses writes.
    ReadOnly,
    /// PostgreSQL cannot hold the database of a server.
    Unsuitable,
    /// The database belongs to a newer program.
    Newer,
    /// The database has an older schema than before.
    Replaced,
}

impl Unavailable {
    /// The reason, and the action of a client or an operator.
    pub(crate) fn sentence(self) -> &'static str {
        match self {
            Self::Busy => "another program has locked the database: try again later",
            Self::Full => {
                "the disk of the server's data directory is full: nothing changed; the operator must free space"
            }
            Self::Away => "the server cannot reach PostgreSQL: try again later",
            Self::FullPostgres => {
                "the disk of PostgreSQL is full: nothing changed; its operator must free space"
            }
            Self::Slow => "the database took too long, or cannot be reached: try again later",
            Self::ReadOnly => {
                "PostgreSQL accepts no writes now, perhaps as a standby: the operator must make it the primary"
            }
            Self::Unsuitable => {
                "the server cannot use this PostgreSQL: its operator finds the reason in the server's log"
            }
            Self::Newer => {
                "a newer version of Roost has led this database: the operator must upgrade this server"
            }
            Self::Replaced => "an older state of the database has taken its place: try again later",
        }
    }
}

impl StoreError {
    /// The reason, if the database is sound and only unavailable for now.
    pub(crate) fn unavailable(&self) -> Option<Unavailable> {
        let error = match self {
            Self::Sql(error) => error,
            Self::Commit(error) => error.as_ref(),
            Self::Shared(error) => return error.unavailable(),
            Self::Connect { source, .. } => return Some(while_connecting(source)),
            Self::OtherServer(_) => return Some(Unavailable::Busy),
            Self::ReadOnly(_) => return Some(Unavailable::ReadOnly),
            Self::Unsuitable { .. } => return Some(Unavailable::Unsuitable),
            Self::Newer { .. } | Self::NewerSolver { .. } => return Some(Unavailable::Newer),
            Self::Replaced { .. } => return Some(Unavailable::Replaced),
            Self::Object(error) => return is_full(error).then_some(Unavailable::Full),
            Self::Folder(error) => return is_full(error).then_some(Unavailable::Full),
            _ => return None,
        };
        match error {
            sqlx::Error::PoolTimedOut => return Some(Unavailable::Slow),
            sqlx::Error::Io(error) if error.kind() == std::io::ErrorKind::StorageFull => {
                return Some(Unavailable::Full);
            }
            sqlx::Error::Io(_) | sqlx::Error::Tls(_) | sqlx::Error::Protocol(_) => {
                return Some(Unavailable::Away);
            }
            _ => {}
        }
        let error = error.as_database_error()?;
        let code = error.code()?;
        if error.try_downcast_ref::<PgDatabaseError>().is_some() {
            return of_postgres(&code);
        }
        let code: i32 = code.parse().ok()?;
        match code & 0xff {
            SQLITE_BUSY => Some(Unavailable::Busy),
            SQLITE_FULL => Some(Unavailable::Full),
            _ => None,
        }
    }

    /// Why a server must end its lead, if it may not write to this database any more, or must open it anew.
    pub(super) fn end_of_lead(&self) -> Option<String> {
        match self {
            Self::OtherServer(_) => Some("another server leads now".to_owned()),
            Self::Shared(error) => error.end_of_lead(),
            Self::Newer { .. } | Self::NewerSolver { .. } | Self::Replaced { .. } => Some(self.to_string()),
            _ => None,
        }
    }

    /// Whether the store has been closed.
    pub(crate) fn is_stopping(&self) -> bool {
        match self {
            Self::WriterGone => true,
            Self::Shared(error) => error.is_stopping(),
            _ => false,
        }
    }

    /// For the log, which prints the causes too.
    pub(crate) fn as_dyn(&self) -> &(dyn std::error::Error + 'static) {
        self
    }
}

/// Whether a full disk is among the causes.
fn is_full(error: &(dyn std::error::Error + 'static)) -> bool {
    let mut causes = std::iter::successors(Some(error), |error| error.source());
    causes.any(|cause| {
        cause
            .downcast_ref::<std::io::Error>()
            .is_some_and(|error| error.kind() == std::io::ErrorKind::StorageFull)
    })
}

/// The reason behind a code of PostgreSQL, if the database is only unavailable for now.
fn of_postgres(code: &str) -> Option<Unavailable> {
    match code {
        "53100" => Some(Unavailable::FullPostgres),
        "25006" => Some(Unavailable::ReadOnly),
        // A timeout of a statement, of a lock, or of a transaction.
        "57014" | "55P03" | "25P03" | "25P04" => Some(Unavailable::Slow),
        // It starts, stops or has crashed, or has no memory or connection left.
        "57P01" | "57P02" | "57P03" | "57P05" | "53200" | "53300" => Some(Unavailable::Away),
        code if code.starts_with("08") => Some(Unavailable::Away),
        _ => None,
    }
}

/// Every failure to connect may pass.
fn while_connecting(source: &sqlx::Error) -> Unavailable {
    match source.as_database_error().and_then(|error| of_postgres(&error.code()?)) {
        Some(reason) => reason,
        None => Unavailable::Away,
    }
}
