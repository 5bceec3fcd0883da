//! Backups of the database and its objects.

use std::fs::{self, File};
use std::path::Path;

use super::database::{AssertSqlSafe, Connection, query, query_scalar, sqlite};
use super::migrations::refuse_newer;
use super::{OBJECTS, StoreError, objects};

/// The contents of a backup.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BackupReport {
    /// Bytes of the file and its objects.
    pub bytes: u64,
    /// Jobs in it.
    pub jobs: u64,
    /// Results in it.
    pub results: u64,
    /// Objects that it names but the folder did not have: they are in a bucket, or were deleted meanwhile.
    pub absent_objects: u64,
}

/// Copies a snapshot of a database to a new file, and the objects that it names. The server may write meanwhile. The objects are copied
/// before the file gets its name.
pub(crate) async fn copy(from: &Path, to: &Path) -> Result<BackupReport, StoreError> {
    let partial = to.with_extension("part");
    let _ = fs::remove_file(&partial); // of an interrupted backup
    let mut source = open(from).await?;
    refuse_newer(&mut source).await?;
    query("VACUUM INTO ?").bind(partial.display().to_string()).execute(&mut source).await?;
    source.close().await?;
    let (copied, objects) = inspect(&partial).await?;
    let (from_objects, to_objects) = (from.with_file_name(OBJECTS), to.with_file_name(OBJECTS));
    let copying = tokio::task::spawn_blocking(move || objects::copy(&from_objects, &to_objects, &objects));
    let (object_bytes, absent_objects) = copying.await.map_err(std::io::Error::other)??;
    // SQLite does not flush the target of VACUUM INTO.
    let sync = |path: &Path| File::open(path).and_then(|file| file.sync_all());
    sync(&partial).and_then(|()| fs::rename(&partial, to)).map_err(sqlx::Error::Io)?;
    if let Some(folder) = to.parent() {
        sync(folder).map_err(sqlx::Error::Io)?;
    }
    Ok(BackupReport { bytes: copied.bytes + object_bytes, absent_objects, ..copied })
}

async fn open(path: &Path) -> Result<Connection, StoreError> {
    Ok(sqlite::connect(sqlite::options(path).create_if_missing(false)).await?.0.into())
}

/// Checks a copied database. Returns its contents and the objects that it names.
async fn inspect(path: &Path) -> Result<(BackupReport, Vec<String>), StoreError> {
    let mut copy = open(path).await?;
    let verdict: String = query_scalar("PRAGMA quick_check").fetch_one(&mut copy).await?;
    if verdict != "ok" {
        return Err(StoreError::Corrupt { what: "copy of the database", message: verdict });
    }
    let count = async |copy: &mut Connection, sql: &'static str| -> Result<u64, StoreError> {
        Ok(query_scalar::<i64>(sql).fetch_one(copy).await?.unsigned_abs())
    };
    let jobs = count(&mut copy, "SELECT count(*) FROM jobs").await?;
    let results = count(&mut copy, "SELECT count(*) FROM results").await?;
    forget_fills(&mut copy).await?;
    let objects = named(&mut copy).await?;
    // Removes the log beside the file.
    copy.close().await?;
    let bytes = fs::metadata(path).map_err(sqlx::Error::Io)?.len();
    Ok((BackupReport { bytes, jobs, results, absent_objects: 0 }, objects))
}

/// Deletes the fills of a copy: they may be large, and jobs compute them again. A database of an earlier version has none.
async fn forget_fills(copy: &mut Connection) -> Result<(), StoreError> {
    let sql = "SELECT EXISTS (SELECT 1 FROM sqlite_master WHERE name = 'fills')";
    if query_scalar(sql).fetch_one(&mut *copy).await? {
        query("DELETE FROM fills").execute(copy).await?;
    }
    Ok(())
}

/// The objects that a database names. A database of an earlier version has no checkpoints, another name for the column, or no frames.
async fn named(copy: &mut Connection) -> Result<Vec<String>, StoreError> {
    let sql = "SELECT name FROM pragma_table_info('frames') WHERE name IN ('object', 'object_digest')";
    let column: Option<String> = query_scalar(sql).fetch_optional(&mut *copy).await?;
    let Some(column) = column else { return Ok(Vec::new()) };
    let sql = "SELECT EXISTS (SELECT 1 FROM sqlite_master WHERE name = 'checkpoints')";
    let checkpoints = match query_scalar::<bool>(sql).fetch_one(&mut *copy).await? {
        true => "UNION SELECT object_digest FROM checkpoints",
        false => "",
    };
    let sql = format!("SELECT DISTINCT {column} FROM frames {checkpoints}");
    Ok(query_scalar(AssertSqlSafe(sql)).fetch_all(copy).await?)
}
