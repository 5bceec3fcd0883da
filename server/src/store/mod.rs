//! Storage, and all SQL: one SQLite file with one writer and several readers, and a folder or bucket of large objects.
//!
//! A method is one query or one transaction, except for large sweeps, which change in slices. Transactions read snapshots, call a decision of `queue`, and apply it. They take `now`
//! as an argument. No other module uses sqlx.

mod asks;
mod backup;
mod batcher;
mod bucket;
mod checkpoint;
mod claims;
mod columns;
mod deletion;
mod deliveries;
mod eligible_jobs;
mod events;
mod expiry;
mod extension;
mod fills;
mod flusher;
mod frames;
mod heartbeats;
mod job_checkpoints;
mod job_control;
mod job_rows;
mod jobs;
mod meshes;
mod migrations;
mod objects;
mod observations;
mod prune;
mod results;
#[cfg(test)]
mod simulation;
mod speeds;
mod studies;
mod submissions;
mod submit;
mod sweeps;
mod tells;
#[cfg(test)]
mod tests;
mod tokens;
mod transitions;
mod trials;
#[cfg(test)]
mod upgrades;
mod versions;
mod waiting;
mod workers;
mod writer;

use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use libsqlite3_sys::{SQLITE_BUSY, SQLITE_FULL};
use prometheus_client::metrics::histogram::Histogram;
use sqlx::sqlite::{
    SqliteConnectOptions, SqliteJournalMode, SqlitePool, SqlitePoolOptions, SqliteSynchronous,
};
use sqlx::{ConnectOptions, Connection, SqliteConnection};
use tokio::sync::Mutex;
use tokio::task::JoinHandle;

pub(crate) use asks::AskedRuns;
pub use backup::BackupReport;
pub(crate) use backup::copy;
pub use bucket::{Bucket, BucketError};
pub(crate) use claims::Claim;
pub(crate) use deliveries::EncodedResult;
pub(crate) use extension::NewExtension;
pub(crate) use frames::StoredFrames;
pub(crate) use heartbeats::Beat;
pub(crate) use jobs::JobFilter;
use migrations::migrator;
pub(crate) use objects::{StageError, Staged};
pub(crate) use observations::HandedOutRun;
pub(crate) use speeds::{RunningJob, StoredScenario};
pub(crate) use studies::{MAX_PROPOSALS, NewStudy, StoredStudy};
pub(crate) use submissions::{StoredResponse, Submission, SubmissionState};
pub(crate) use submit::{NewJob, NewSweep};
pub(crate) use tells::Conflict;
pub(crate) use tokens::Token;
pub use tokens::TokenFile;
pub(crate) use trials::{MAX_DOCUMENTS, TrialDocument, TrialPlace};
pub(crate) use versions::{QueueCounts, Subject};
pub(crate) use waiting::{CountedJobs, QueueGroup, QueuePlace, by_owner};
pub(crate) use workers::{OnlineWorker, meets};
use writer::Writer;

/// The first SQLite without the WAL-reset corruption (3.7.0 to 3.51.2).
const OLDEST_SQLITE: (u32, u32, u32) = (3, 51, 3);

/// Page cache of the writer. Negative numbers are KiB.
const WRITER_CACHE_KIB: &str = "-16000";

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
}

impl StoreError {
    /// The reason, if the database is sound and only unavailable for now.
    pub(crate) fn unavailable(&self) -> Option<Unavailable> {
        let error = match self {
            Self::Sql(error) => error,
            Self::Commit(error) => error.as_ref(),
            Self::Shared(error) => return error.unavailable(),
            Self::Object(error) => return is_full(error).then_some(Unavailable::Full),
            Self::Folder(error) => return is_full(error).then_some(Unavailable::Full),
            _ => return None,
        };
        let code: i32 = error.as_database_error()?.code()?.parse().ok()?;
        match code & 0xff {
            SQLITE_BUSY => Some(Unavailable::Busy),
            SQLITE_FULL => Some(Unavailable::Full),
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

/// The folder of objects, beside the database.
pub(crate) const OBJECTS: &str = "objects";

/// The database and the objects.
pub(crate) struct Store {
    writer: Arc<Writer>,
    /// Ends after the writer.
    checkpoints: Mutex<Option<JoinHandle<()>>>,
    beats: heartbeats::BeatBatcher,
    claims: claims::ClaimBatcher,
    results: deliveries::ResultBatcher,
    versions: versions::Cache,
    readers: SqlitePool,
    objects: objects::Objects,
    sqlite_version: String,
}

impl Store {
    /// Opens the database at `path` and the objects, in a bucket or beside the database. Creates and migrates them as needed.
    pub(crate) async fn open(path: &Path, bucket: Option<&Bucket>) -> Result<Self, StoreError> {
        let objects = objects::Objects::open(&path.with_file_name(OBJECTS), bucket).await?;
        let options = options(path);
        let (mut connection, sqlite_version) =
            connect(options.clone().pragma("cache_size", WRITER_CACHE_KIB)).await?;
        migrate(&mut connection).await?;
        meshes::sweep(&mut connection).await?;
        deletion::mark_leftovers(&mut connection).await?;
        let readers = SqlitePoolOptions::new()
            .max_connections(4)
            .test_before_acquire(false) // connections to a file do not break
            .connect_with(options.clone().create_if_missing(false).read_only(true))
            .await?;
        let copier = options.create_if_missing(false).connect().await?;
        let log = path.with_file_name(format!("{}-wal", path.file_name().unwrap_or_default().display()));
        let writer = Arc::new(Writer::start(connection, &log)?);
        let copying = checkpoint::run(copier, writer.counter(), writer.end());
        let checkpoints = Mutex::new(Some(tokio::spawn(copying)));
        let beats = heartbeats::batcher(writer.clone());
        let claims = claims::batcher(writer.clone());
        let results = deliveries::batcher(writer.clone());
        let versions = versions::Cache::default();
        Ok(Self { writer, checkpoints, beats, claims, results, versions, readers, objects, sqlite_version })
    }

    /// Finishes queued writes and closes the file.
    pub(crate) async fn close(&self) {
        self.readers.close().await;
        self.writer.close().await;
        if let Some(task) = self.checkpoints.lock().await.take() {
            let _ = task.await;
        }
    }

    /// Durations of commits, in seconds.
    pub(crate) fn commit_seconds(&self) -> Histogram {
        self.writer.commit_seconds()
    }

    /// Returns when the writer has ended, which happens only after a close or a panic.
    pub(crate) async fn ended(&self) {
        self.writer.ended().await;
    }

    /// Checks that reads and writes succeed.
    pub(crate) async fn ping(&self) -> Result<(), StoreError> {
        sqlx::query("SELECT 1").execute(&self.readers).await?;
        // A write that reaches the disk: a transaction without changes would pass on a full disk.
        let change = "PRAGMA user_version = 0";
        self.writer
            .write(move |tx| Box::pin(async move { Ok(sqlx::query(change).execute(tx).await.map(drop)?) }))
            .await
    }

    /// Version of the SQLite library.
    pub(crate) fn sqlite_version(&self) -> &str {
        &self.sqlite_version
    }
}

fn options(path: &Path) -> SqliteConnectOptions {
    SqliteConnectOptions::new()
        .filename(path)
        .create_if_missing(true)
        .journal_mode(SqliteJournalMode::Wal)
        // The flusher flushes the log, after the commit.
        .synchronous(SqliteSynchronous::Normal)
        .foreign_keys(true)
        // Savepoints copy pages to memory, not to a file.
        .pragma("temp_store", "memory")
        .pragma("wal_autocheckpoint", checkpoint::LONG_LOG_PAGES)
        .busy_timeout(Duration::from_secs(5))
}

/// A connection, and the version of SQLite.
async fn connect(options: SqliteConnectOptions) -> Result<(SqliteConnection, String), StoreError> {
    let mut connection = options.connect().await?;
    let version = check_sqlite(&mut connection).await?;
    Ok((connection, version))
}

async fn migrate(connection: &mut SqliteConnection) -> Result<(), StoreError> {
    refuse_newer(connection).await?;
    Ok(migrator().run(connection).await?)
}

/// Refuses a database of a newer version, which this program would misread.
async fn refuse_newer(connection: &mut SqliteConnection) -> Result<(), StoreError> {
    let known = migrator().iter().map(|migration| migration.version).max().unwrap_or(0);
    let is_made = "SELECT EXISTS (SELECT 1 FROM sqlite_master WHERE name = '_sqlx_migrations')";
    if !sqlx::query_scalar(is_made).fetch_one(&mut *connection).await? {
        return Ok(());
    }
    let found: Option<i64> =
        sqlx::query_scalar("SELECT max(version) FROM _sqlx_migrations").fetch_one(connection).await?;
    match found {
        Some(found) if found > known => Err(StoreError::Newer { found, known }),
        _ => Ok(()),
    }
}

async fn check_sqlite(connection: &mut SqliteConnection) -> Result<String, StoreError> {
    connection.ping().await?;
    let version: String = sqlx::query_scalar("SELECT sqlite_version()").fetch_one(connection).await?;
    if is_sound(&version) { Ok(version) } else { Err(StoreError::OldSqlite(version)) }
}

fn is_sound(version: &str) -> bool {
    let mut numbers = version.split('.').map(|number| number.parse().unwrap_or(0));
    let mut next = || numbers.next().unwrap_or(0);
    (next(), next(), next()) >= OLDEST_SQLITE
}
