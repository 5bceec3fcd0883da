//! Copies of the database, and their way back.

use std::fs::{self, File};
use std::path::Path;

use sqlx::{AssertSqlSafe, Connection, SqliteConnection};

use super::{OBJECTS, StoreError, connect, objects, options, refuse_newer};

/// What a copy holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BackupReport {
    /// Bytes of the file, and of the objects beside it.
    pub bytes: u64,
    /// Jobs in it.
    pub jobs: u64,
    /// Results in it.
    pub results: u64,
    /// Objects that it names and that were not in the folder: in a bucket, or gone meanwhile.
    pub absent_objects: u64,
}

/// Copies a database, as it is at one moment, to a file that is not there yet. Whoever writes to it goes on meanwhile.
/// The objects that it names come first to stand beside it, those that are there.
pub(crate) async fn copy(from: &Path, to: &Path) -> Result<BackupReport, StoreError> {
    let beside = to.with_extension("part");
    let _ = fs::remove_file(&beside); // what a copy that broke off has left
    let (mut source, _) = connect(options(from).create_if_missing(false)).await?;
    refuse_newer(&mut source).await?;
    sqlx::query("VACUUM INTO ?").bind(beside.display().to_string()).execute(&mut source).await?;
    source.close().await?;
    let (copied, objects) = inspect(&beside).await?;
    let (there, here) = (from.with_file_name(OBJECTS), to.with_file_name(OBJECTS));
    let copying = tokio::task::spawn_blocking(move || objects::copy(&there, &here, &objects));
    let (beside_it, absent_objects) = copying.await.map_err(std::io::Error::other)??;
    // SQLite does not flush what it vacuums into.
    let sync = |path: &Path| File::open(path).and_then(|file| file.sync_all());
    sync(&beside).and_then(|()| fs::rename(&beside, to)).map_err(sqlx::Error::Io)?;
    if let Some(folder) = to.parent() {
        sync(folder).map_err(sqlx::Error::Io)?;
    }
    Ok(BackupReport { bytes: copied.bytes + beside_it, absent_objects, ..copied })
}

/// Whether a file is a sound database of ours, what it holds and which objects it names.
async fn inspect(path: &Path) -> Result<(BackupReport, Vec<String>), StoreError> {
    let (mut copy, _) = connect(options(path).create_if_missing(false)).await?;
    let verdict: String = sqlx::query_scalar("PRAGMA quick_check").fetch_one(&mut copy).await?;
    if verdict != "ok" {
        return Err(StoreError::Corrupt { what: "copy of the database", message: verdict });
    }
    let count = async |copy: &mut SqliteConnection, sql: &'static str| -> Result<u64, StoreError> {
        Ok(sqlx::query_scalar::<_, i64>(sql).fetch_one(copy).await?.unsigned_abs())
    };
    let jobs = count(&mut copy, "SELECT count(*) FROM jobs").await?;
    let results = count(&mut copy, "SELECT count(*) FROM results").await?;
    let objects = named(&mut copy).await?;
    // Leaves one file: no log beside it.
    copy.close().await?;
    let bytes = fs::metadata(path).map_err(sqlx::Error::Io)?.len();
    Ok((BackupReport { bytes, jobs, results, absent_objects: 0 }, objects))
}

/// The objects that a database names. A database of an earlier version has another name for the column, or no frames.
async fn named(copy: &mut SqliteConnection) -> Result<Vec<String>, StoreError> {
    let sql = "SELECT name FROM pragma_table_info('frames') WHERE name IN ('object', 'object_digest')";
    let column: Option<String> = sqlx::query_scalar(sql).fetch_optional(&mut *copy).await?;
    let Some(column) = column else { return Ok(Vec::new()) };
    let sql = format!("SELECT DISTINCT {column} FROM frames");
    Ok(sqlx::query_scalar(AssertSqlSafe(sql)).fetch_all(copy).await?)
}
