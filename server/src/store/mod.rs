//! Storage, and all SQL: a database with one writer and several readers, and a folder or bucket of large objects. The database is a SQLite
//! file or in PostgreSQL.
//!
//! A method is one query or one transaction, except for large sweeps, which change in slices. Transactions read snapshots, call a decision of `queue`, and apply it. They take `now`
//! as an argument. No other module uses sqlx.

mod asks;
mod backup;
mod batcher;
mod bucket;
mod candidates;
mod checkpoint;
mod claim_statements;
mod claims;
mod columns;
mod database;
mod deletion;
mod deliveries;
mod edition;
mod election;
mod eligible_jobs;
mod error;
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
mod leader_tables;
mod location;
mod meshes;
mod migrations;
mod objects;
mod observations;
mod projects;
mod prune;
mod results;
mod sessions;
#[cfg(test)]
mod simulation;
mod speeds;
mod studies;
mod submissions;
mod submit;
mod sweeps;
mod tells;
#[cfg(test)]
mod testing;
#[cfg(test)]
mod tests;
mod tokens;
mod transfer;
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

use prometheus_client::metrics::histogram::Histogram;
use tokio::sync::Mutex;
use tokio::task::JoinHandle;
use tokio_util::task::AbortOnDropHandle;

pub(crate) use asks::AskedRuns;
pub use backup::BackupReport;
pub(crate) use backup::copy;
pub use bucket::{Bucket, BucketError};
pub(crate) use claims::Claim;
use database::{Engine, Pool, query, raw_sql};
pub(crate) use deliveries::EncodedResult;
pub(crate) use edition::Edition;
pub(crate) use election::{Election, Leader};
pub(crate) use error::Unavailable;
pub use error::{LocationError, StoreError};
pub(crate) use events::EVENTS_AT_ONCE;
pub(crate) use expiry::Expired;
pub(crate) use extension::NewExtension;
pub(crate) use frames::StoredFrames;
pub(crate) use heartbeats::Beat;
pub(crate) use jobs::JobFilter;
pub use location::Location;
use location::Opened;
pub(crate) use objects::{StageError, Staged};
pub(crate) use observations::HandedOutRun;
pub use projects::{ProjectChange, ProjectError};
pub(crate) use projects::{ProjectCounts, ProjectValues};
pub(crate) use sessions::NewSession;
pub(crate) use speeds::{RunningJob, StoredScenario};
pub(crate) use studies::{MAX_PROPOSALS, NewStudy, StoredStudy};
pub(crate) use submissions::{IdempotentRequest, StoredResponse, SubmissionState};
pub(crate) use submit::{NewJob, NewSweep};
pub(crate) use tells::Conflict;
pub(crate) use tokens::Token;
pub use tokens::{NewToken, TokenFile};
pub use transfer::CopiedTable;
pub(crate) use transfer::transfer;
pub(crate) use trials::{MAX_DOCUMENTS, TrialDocument, TrialPlace};
pub(crate) use versions::{QueueCounts, Subject};
pub(crate) use waiting::{CountedJobs, QueueGroup, QueuePlace, by_owner};
pub(crate) use workers::{OnlineWorker, meets};
use writer::{Thread, Writer};

/// The folder of objects, beside the database.
pub(crate) const OBJECTS: &str = "objects";

/// Maximum time of a check of PostgreSQL. A probe of Kubernetes waits 5 s.
const PING: Duration = Duration::from_secs(4);

/// The database and the objects.
pub(crate) struct Store {
    writer: Arc<Writer>,
    /// Ends after the writer.
    checkpoints: Mutex<Option<JoinHandle<()>>>,
    beats: heartbeats::BeatBatcher,
    claims: claims::ClaimBatcher,
    results: deliveries::ResultBatcher,
    versions: versions::Cache,
    readers: Pool,
    objects: objects::Objects,
    version: String,
}

impl Store {
    /// Opens the database at `place` and the objects, in a bucket or in a folder. Creates and migrates them as needed.
    #[cfg(test)]
    pub(crate) async fn open(
        place: &Location,
        folder: &Path,
        bucket: Option<&Bucket>,
    ) -> Result<Self, StoreError> {
        Self::open_as(Edition::default(), place, folder, bucket).await
    }

    /// The same for a server of this edition, which leads then.
    pub(crate) async fn open_as(
        edition: Edition,
        place: &Location,
        folder: &Path,
        bucket: Option<&Bucket>,
    ) -> Result<Self, StoreError> {
        let objects = objects::Objects::open(folder, bucket).await?;
        let thread = Thread::start()?;
        let here = place.clone();
        let opening = thread.spawn(async move {
            let mut opened = location::open(&here, edition).await?;
            meshes::sweep(&mut opened.writing).await?;
            deletion::mark_leftovers(&mut opened.writing).await?;
            leader_tables::prepare(&mut opened.writing).await?;
            Ok::<_, StoreError>(opened)
        });
        let Opened { writing, version, log, line } = match AbortOnDropHandle::new(opening).await {
            Ok(opened) => opened?,
            Err(error) => match error.try_into_panic() {
                Ok(panic) => std::panic::resume_unwind(panic),
                Err(_) => return Err(StoreError::WriterGone),
            },
        };
        let (readers, copier) = location::open_readers(place).await?;
        let writer = Arc::new(Writer::open(&thread, writing, line, log.as_deref())?);
        let commits = writer.commits().clone();
        let copying = copier.map(|copier| checkpoint::run(copier, move || commits.count(), writer.end()));
        let checkpoints = Mutex::new(copying.map(tokio::spawn));
        let beats = heartbeats::batcher(writer.clone());
        let claims = claims::batcher(writer.clone());
        let results = deliveries::batcher(writer.clone());
        let versions = versions::Cache::default();
        // With the lock of the server, and while its writer shows that it lives: a bucket may be slow.
        objects.remove_unfinished().await?;
        Ok(Self { writer, checkpoints, beats, claims, results, versions, readers, objects, version })
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

    /// Returns when the writer has ended: after a close, a panic, or a failed flush.
    pub(crate) async fn ended(&self) {
        self.writer.ended().await;
    }

    /// Why this server may not lead any more, if the writer has ended for this reason.
    pub(crate) fn deposed(&self) -> Option<&str> {
        self.writer.deposed()
    }

    /// Checks that reads and writes succeed.
    pub(crate) async fn ping(&self) -> Result<(), StoreError> {
        match self.readers {
            Pool::Sqlite(_) => self.read_and_write().await,
            // A connection whose other end is gone says nothing for a minute.
            Pool::Postgres(_) => tokio::time::timeout(PING, self.read_and_write())
                .await
                .unwrap_or(Err(StoreError::Sql(sqlx::Error::PoolTimedOut))),
        }
    }

    async fn read_and_write(&self) -> Result<(), StoreError> {
        query("SELECT 1").execute(&self.readers).await?;
        // A write that reaches the disk: a transaction without changes would pass on a full disk.
        let ping = self.writer.write(|tx| {
            Box::pin(async move {
                let change = match tx.engine() {
                    Engine::Sqlite => "PRAGMA user_version = 0",
                    // The pages of a small change exist already. Rows beyond the memory go to a temporary file, which needs space.
                    Engine::Postgres => {
                        "INSERT INTO row_numbers (name, seq) VALUES ('ping', 0) ON CONFLICT (name) DO UPDATE SET seq = 0;
                         SET LOCAL work_mem = '64kB'; SELECT count(*) FROM generate_series(1, 20000); SET LOCAL work_mem TO DEFAULT"
                    }
                };
                Ok(raw_sql(change).execute(tx).await?)
            })
        });
        ping.await
    }

    /// Version of the SQLite library.
    pub(crate) fn sqlite_version() -> &'static str {
        libsqlite3_sys::SQLITE_VERSION.to_str().unwrap_or_default()
    }

    /// Name and version of the database.
    pub(crate) fn version_of_database(&self) -> &str {
        &self.version
    }
}
