//! Checkpoints: what the log has come to hold is brought over to the database, beside the writer.
//!
//! SQLite does that in the commit that makes the log long, and everybody waits while megabytes are copied and flushed. Here a connection
//! of its own copies them while the writer goes on. The log begins anew once all of it is copied, for which a writer that
//! never rests leaves no time: then it does the rest itself, at [`LONG_LOG_PAGES`].

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use sqlx::{Connection, SqliteConnection};
use tokio_util::sync::CancellationToken;

use super::StoreError;

/// Pages of 4 KiB that are worth a flush of the database.
const PAGES: i64 = 2000;

/// The writer copies what is left once the log has so many pages of 4 KiB.
pub(super) const LONG_LOG_PAGES: &str = "16000";

/// How often it is looked how long the log has become.
const EVERY: Duration = Duration::from_millis(100);

/// Copies until the writer, which counts its `commits`, has ended.
pub(super) async fn run(mut connection: SqliteConnection, commits: Arc<AtomicU64>, ended: CancellationToken) {
    let (mut seen, mut fails) = (0, false);
    while ended.run_until_cancelled(tokio::time::sleep(EVERY)).await.is_some() {
        let now = commits.load(Ordering::Acquire);
        if seen == now {
            continue;
        }
        match copy(&mut connection).await {
            Ok(_) => (seen, fails) = (now, false),
            // A full disk stays full for a while: that is told once.
            Err(error) if !std::mem::replace(&mut fails, true) => tracing::warn!(
                error = error.as_dyn(),
                "the log was not brought over to the database: tried again"
            ),
            Err(_) => {}
        }
    }
    if let Err(error) = connection.close().await {
        tracing::warn!(%error, "the database did not close cleanly");
    }
}

/// Copies what is in the log, if it is worth it; how many of its pages are in the database now.
async fn copy(connection: &mut SqliteConnection) -> Result<i64, StoreError> {
    let (_, log, copied) = checkpoint(connection, "PRAGMA wal_checkpoint(NOOP)").await?;
    if log - copied < PAGES {
        return Ok(copied);
    }
    let (_, _, copied) = checkpoint(connection, "PRAGMA wal_checkpoint(PASSIVE)").await?;
    Ok(copied)
}

/// Whether somebody was in the way, pages in the log, and those of them that are in the database.
async fn checkpoint(
    connection: &mut SqliteConnection,
    sql: &'static str,
) -> Result<(i64, i64, i64), StoreError> {
    Ok(sqlx::query_as(sql).fetch_one(connection).await?)
}

#[cfg(test)]
mod tests {
    use sqlx::ConnectOptions;

    use super::super::options;
    use super::*;

    #[tokio::test]
    async fn a_long_log_is_copied_and_begins_anew() {
        let dir = tempfile::tempdir().unwrap();
        let options = options(&dir.path().join("db"));
        let mut writer = options.connect().await.unwrap();
        let mut copier = options.connect().await.unwrap();
        let mut insert = async |bytes: i64| {
            let sql = "CREATE TABLE IF NOT EXISTS t (x); INSERT INTO t VALUES (zeroblob(?))";
            sqlx::query(sql).bind(bytes).execute(&mut writer).await.unwrap();
        };
        insert(1_000_000).await;
        assert_eq!(copy(&mut copier).await.unwrap(), 0, "not worth a flush");
        insert(10_000_000).await;
        let copied = copy(&mut copier).await.unwrap();
        assert!(copied > PAGES, "{copied}");
        insert(1000).await;
        let (_, log, _) = checkpoint(&mut copier, "PRAGMA wal_checkpoint(NOOP)").await.unwrap();
        assert!(log < 10, "the log begins anew: {log}");
    }
}
