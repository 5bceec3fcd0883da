//! Checkpoints: copying the write-ahead log into the database, beside the writer.
//!
//! SQLite checkpoints in the commit that makes the log long, and all requests wait while megabytes are copied and flushed. Here a
//! separate connection copies them while the writer continues. The log restarts once all of it is copied. A writer that is never
//! idle leaves no time for that; then it copies the rest itself, at [`LONG_LOG_PAGES`].

use std::time::Duration;

use sqlx::{Connection, SqliteConnection};
use tokio_util::sync::CancellationToken;

use super::StoreError;

/// Pages of 4 KiB that are worth a flush of the database.
const MIN_PAGES: i64 = 2000;

/// Length of the log, in pages of 4 KiB, at which the writer copies the rest.
pub(super) const LONG_LOG_PAGES: &str = "16000";

/// Time between checks of the log's length.
const INTERVAL: Duration = Duration::from_millis(100);

/// Copies until the writer has ended. `commits` returns the number of its commits.
pub(super) async fn run(
    mut connection: SqliteConnection,
    commits: impl Fn() -> u64,
    ended: CancellationToken,
) {
    let (mut seen, mut fails) = (0, false);
    while ended.run_until_cancelled(tokio::time::sleep(INTERVAL)).await.is_some() {
        let now = commits();
        if seen == now {
            continue;
        }
        match copy(&mut connection).await {
            Ok(_) => (seen, fails) = (now, false),
            // A full disk stays full for a while: logged once.
            Err(error) if !std::mem::replace(&mut fails, true) => {
                tracing::warn!(error = error.as_dyn(), "checkpoint failed; it is retried")
            }
            Err(_) => {}
        }
    }
    if let Err(error) = connection.close().await {
        tracing::warn!(%error, "the database did not close cleanly");
    }
}

/// Copies the log if it is long enough. Returns how many of its pages the database has.
async fn copy(connection: &mut SqliteConnection) -> Result<i64, StoreError> {
    let (_, log, copied) = checkpoint(connection, "PRAGMA wal_checkpoint(NOOP)").await?;
    if log - copied < MIN_PAGES {
        return Ok(copied);
    }
    let (_, _, copied) = checkpoint(connection, "PRAGMA wal_checkpoint(PASSIVE)").await?;
    Ok(copied)
}

/// Whether a lock prevented it, the pages in the log, and those of them that the database has.
async fn checkpoint(
    connection: &mut SqliteConnection,
    sql: &'static str,
) -> Result<(i64, i64, i64), StoreError> {
    Ok(sqlx::query_as(sql).fetch_one(connection).await?)
}

#[cfg(test)]
mod tests {
    use sqlx::ConnectOptions;

    use super::super::database::sqlite::options;
    use super::*;

    #[tokio::test]
    async fn a_long_log_is_copied_and_restarts() {
        let dir = tempfile::tempdir().unwrap();
        let options = options(&dir.path().join("db"));
        let mut writer = options.connect().await.unwrap();
        let mut copier = options.connect().await.unwrap();
        let mut insert = async |bytes: i64| {
            let sql = "CREATE TABLE IF NOT EXISTS t (x); INSERT INTO t VALUES (zeroblob(?))";
            sqlx::query(sql).bind(bytes).execute(&mut writer).await.unwrap();
        };
        insert(1_000_000).await;
        assert_eq!(copy(&mut copier).await.unwrap(), 0, "too short");
        insert(10_000_000).await;
        let copied = copy(&mut copier).await.unwrap();
        assert!(copied > MIN_PAGES, "{copied}");
        insert(1000).await;
        let (_, log, _) = checkpoint(&mut copier, "PRAGMA wal_checkpoint(NOOP)").await.unwrap();
        assert!(log < 10, "the log restarts: {log}");
    }
}
