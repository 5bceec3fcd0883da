//! Opening SQLite files.

use std::path::{Path, PathBuf};
use std::time::Duration;

use sqlx::sqlite::{
    SqliteConnectOptions, SqliteJournalMode, SqlitePool, SqlitePoolOptions, SqliteSynchronous,
};
use sqlx::{ConnectOptions, Connection, SqliteConnection};

use crate::store::{StoreError, checkpoint};

/// The first SQLite without the WAL-reset corruption (3.7.0 to 3.51.2).
const OLDEST_SQLITE: (u32, u32, u32) = (3, 51, 3);

/// Page cache of the writer. Negative numbers are KiB.
const WRITER_CACHE_KIB: &str = "-16000";

/// How every connection opens a file.
pub(in crate::store) fn options(path: &Path) -> SqliteConnectOptions {
    SqliteConnectOptions::new()
        .filename(path)
        .create_if_missing(true)
        .journal_mode(SqliteJournalMode::Wal)
        .synchronous(SqliteSynchronous::Full)
        .foreign_keys(true)
        // Savepoints copy pages to memory, not to a file.
        .pragma("temp_store", "memory")
        .pragma("wal_autocheckpoint", checkpoint::LONG_LOG_PAGES)
        .busy_timeout(Duration::from_secs(5))
}

/// How the writer of a server opens a file. Its flusher flushes the log, after the commit.
pub(in crate::store) fn writer_options(path: &Path) -> SqliteConnectOptions {
    options(path).pragma("cache_size", WRITER_CACHE_KIB).synchronous(SqliteSynchronous::Normal)
}

/// Copies the whole log into the database where nothing prevents it, and returns the path of the log. After a power failure or a failed flush, the system may
/// have parts of the log in memory alone, and would never write them to the disk.
pub(in crate::store) async fn settle_log(connection: &mut SqliteConnection) -> Result<PathBuf, StoreError> {
    let copied: Result<(i64, i64, i64), _> =
        sqlx::query_as("PRAGMA wal_checkpoint(TRUNCATE)").fetch_one(&mut *connection).await;
    match copied {
        Ok((0, ..)) => {}
        Ok(_) => tracing::warn!("the write-ahead log was not copied: another program reads the database"),
        Err(error) => tracing::warn!(%error, "the write-ahead log was not copied"),
    }
    // SQLite follows links: the log is beside the file itself.
    let sql = "SELECT file FROM pragma_database_list WHERE name = 'main'";
    let file: String = sqlx::query_scalar(sql).fetch_one(connection).await?;
    Ok(PathBuf::from(file + "-wal"))
}

/// The readers of a file.
pub(in crate::store) async fn readers(path: &Path) -> Result<SqlitePool, StoreError> {
    Ok(SqlitePoolOptions::new()
        .max_connections(4)
        .test_before_acquire(false) // connections to a file do not break
        .connect_with(options(path).create_if_missing(false).read_only(true))
        .await?)
}

/// A connection, and the version of SQLite.
pub(in crate::store) async fn connect(
    options: SqliteConnectOptions,
) -> Result<(SqliteConnection, String), StoreError> {
    let mut connection = options.connect().await?;
    connection.ping().await?;
    let version: String = sqlx::query_scalar("SELECT sqlite_version()").fetch_one(&mut connection).await?;
    if is_sound(&version) { Ok((connection, version)) } else { Err(StoreError::OldSqlite(version)) }
}

fn is_sound(version: &str) -> bool {
    let mut numbers = version.split('.').map(|number| number.parse().unwrap_or(0));
    let mut next = || numbers.next().unwrap_or(0);
    (next(), next(), next()) >= OLDEST_SQLITE
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_old_sqlite_is_refused() {
        for (version, sound) in [
            ("3.51.3", true),
            ("3.51.2", false),
            ("3.50.9", false),
            ("3.52.0", true),
            ("4.0.0", true),
            ("3.51.10", true),
            ("", false),
        ] {
            assert_eq!(is_sound(version), sound, "{version}");
        }
    }
}
