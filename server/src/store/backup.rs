//! Copies of the database, and their way back.

use std::fs::{self, File};
use std::path::Path;

use sqlx::{Connection, SqliteConnection};

use super::{StoreError, connect, options};

/// What a copy holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Copied {
    /// Bytes of the file.
    pub bytes: u64,
    /// Jobs in it.
    pub jobs: u64,
    /// Results in it.
    pub results: u64,
}

/// Copies a database, as it is at one moment, to a file that is not there yet. Whoever writes to it goes on meanwhile.
pub(crate) async fn copy(from: &Path, to: &Path) -> Result<Copied, StoreError> {
    let beside = to.with_extension("part");
    let _ = fs::remove_file(&beside); // what a copy that broke off has left
    let (mut source, _) = connect(options(from).create_if_missing(false)).await?;
    sqlx::query("VACUUM INTO ?").bind(beside.display().to_string()).execute(&mut source).await?;
    source.close().await?;
    let copied = inspect(&beside).await?;
    // SQLite does not flush what it vacuums into.
    let sync = |path: &Path| File::open(path).and_then(|file| file.sync_all());
    sync(&beside).and_then(|()| fs::rename(&beside, to)).map_err(sqlx::Error::Io)?;
    if let Some(folder) = to.parent() {
        sync(folder).map_err(sqlx::Error::Io)?;
    }
    Ok(copied)
}

/// Whether a file is a sound database of ours, and what it holds.
async fn inspect(path: &Path) -> Result<Copied, StoreError> {
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
    // Leaves one file: no log beside it.
    copy.close().await?;
    let bytes = fs::metadata(path).map_err(sqlx::Error::Io)?.len();
    Ok(Copied { bytes, jobs, results })
}
