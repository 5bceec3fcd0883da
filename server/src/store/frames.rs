//! Frames of jobs: the stream is an object, its row says whose it is.

use std::ops::Range;

use bytes::Bytes;
use futures_util::Stream;
use roost_api::frames::FramesView;
use roost_api::ids::{JobId, WorkerId};
use roost_api::job::JobState;
use roost_api::time::Timestamp;
use sqlx::SqliteConnection;
use sqlx::sqlite::SqliteRow;

use super::facts::{Fenced, Written, fenced};
use super::objects::{Reading, Staged, Unstaged};
use super::rows::{Columns, to_json};
use super::{Store, StoreError};
use crate::queue::{Refusal, Standing};

/// Objects that are looked up at once.
const AT_ONCE: usize = 1000;

/// Those of some objects that no row names.
pub(super) const UNNAMED: &str = "SELECT value FROM json_each(?)
    WHERE NOT EXISTS (SELECT 1 FROM frames WHERE object_digest = value)";

/// The frames of a job.
pub(crate) struct StoredFrames {
    /// blake3 of the stream.
    pub(crate) object: String,
    /// Its bytes.
    pub(crate) bytes: u64,
    /// State of the job: of one that has succeeded they never change.
    pub(crate) state: JobState,
}

impl Store {
    /// Whether an attempt may still write, without troubling the writer.
    pub(crate) async fn may_write(
        &self,
        job: JobId,
        attempt: u32,
        worker: WorkerId,
    ) -> Result<Result<(), Refusal>, StoreError> {
        let mut reader = self.readers.acquire().await?;
        may_write(&mut reader, job, attempt, worker).await
    }

    /// Takes a stream in as it arrives; nobody can see it yet.
    pub(crate) async fn stage<E>(
        &self,
        bytes: impl Stream<Item = Result<Bytes, E>> + Unpin,
        limit: u64,
    ) -> Result<Staged, Unstaged<E>> {
        self.objects.stage(bytes, limit).await
    }

    /// Forgets a stream that was taken in.
    pub(crate) async fn discard(&self, staged: Staged) {
        self.objects.discard(staged).await;
    }

    /// Notes a stream as the frames of an attempt; false when it is that already.
    pub(crate) async fn record_frames(
        &self,
        job: JobId,
        attempt: u32,
        worker: WorkerId,
        staged: Staged,
        (count, stopped): (u64, Option<String>),
        now: Timestamp,
    ) -> Result<Result<bool, Refusal>, StoreError> {
        let (object, bytes) = (staged.digest.clone(), staged.bytes);
        let _open = self.objects.keep(staged).await?;
        self.writer
            .write(move |tx| {
                Box::pin(async move {
                    if let Err(refusal) = may_write(tx, job, attempt, worker).await? {
                        return Ok(Err(refusal));
                    }
                    let noted = sqlx::query(
                        "INSERT INTO frames (job_id, attempt, object_digest, bytes, count, stop_reason, recorded_at)
                         VALUES (?, ?, ?, ?, ?, ?, ?)
                         ON CONFLICT (job_id) DO UPDATE SET attempt = excluded.attempt, object_digest = excluded.object_digest,
                             bytes = excluded.bytes, count = excluded.count, stop_reason = excluded.stop_reason,
                             recorded_at = excluded.recorded_at
                         WHERE (frames.attempt, frames.object_digest) <> (excluded.attempt, excluded.object_digest)",
                    )
                    .bind(job.to_string())
                    .bind(attempt)
                    .bind(object)
                    .bind(bytes as i64)
                    .bind(count as i64)
                    .bind(stopped)
                    .bind(now.0)
                    .execute(&mut *tx)
                    .await?;
                    Ok(Ok(noted.rows_affected() > 0))
                })
            })
            .await
    }

    /// The frames of a job's newest attempt; no job, or none of them.
    pub(crate) async fn frames(
        &self,
        id: JobId,
    ) -> Result<Result<Option<StoredFrames>, Refusal>, StoreError> {
        let row = sqlx::query(
            "SELECT j.state, f.object_digest, f.bytes FROM jobs j
             LEFT JOIN frames f ON f.job_id = j.id AND f.attempt = j.attempt WHERE j.id = ?",
        )
        .bind(id.to_string())
        .fetch_optional(&self.readers)
        .await?;
        let Some(row) = row else { return Ok(Err(Refusal::NoJob)) };
        let Some(object) = row.column("object_digest")? else { return Ok(Ok(None)) };
        Ok(Ok(Some(StoredFrames { object, bytes: row.number("bytes")?, state: row.parsed("state")? })))
    }

    /// A part of a stream; none when it is not there any more.
    pub(crate) async fn read_object(
        &self,
        object: &str,
        part: Range<u64>,
    ) -> Result<Option<Reading>, StoreError> {
        self.objects.read(object, part).await
    }

    /// Removes the objects that have lain there since before then and that no row names.
    pub(crate) async fn sweep_objects(&self, then: Timestamp) -> Result<u64, StoreError> {
        let old = self.objects.older_than(then.0).await?;
        self.remove_unnamed(&old).await
    }

    /// Removes those of these objects that no row names.
    pub(super) async fn remove_unnamed(&self, objects: &[String]) -> Result<u64, StoreError> {
        let mut removed = 0;
        for some in objects.chunks(AT_ONCE) {
            let unnamed: Vec<String> =
                sqlx::query_scalar(UNNAMED).bind(to_json("objects", &some)?).fetch_all(&self.readers).await?;
            for object in unnamed {
                // Asked again while nothing can be given its name: a row may have named it meanwhile.
                let _shut = self.objects.shut().await;
                let sql = "SELECT EXISTS (SELECT 1 FROM frames WHERE object_digest = ?)";
                let is_named: bool = sqlx::query_scalar(sql).bind(&object).fetch_one(&self.readers).await?;
                if !is_named && self.objects.remove(&object).await? {
                    removed += 1;
                }
            }
        }
        Ok(removed)
    }
}

/// Looks whether an attempt may write: while it holds its job, or could.
async fn may_write(
    connection: &mut SqliteConnection,
    job: JobId,
    attempt: u32,
    worker: WorkerId,
) -> Result<Result<(), Refusal>, StoreError> {
    let found = fenced(connection, &[Written { job, attempt, worker }]).await?.pop();
    Ok(found.unwrap_or(Err(Refusal::NoJob)).and_then(|Fenced { standing, .. }| match standing {
        Standing::Holds => Ok(()),
        Standing::Ended(outcome) => Err(Refusal::AttemptEnded { outcome }),
        Standing::Stale(refusal) => Err(refusal),
    }))
}

/// What a row of a job says of its frames.
pub(super) fn frames_view(row: &SqliteRow) -> Result<Option<FramesView>, StoreError> {
    let Some(bytes) = row.number_opt("frames_bytes")? else { return Ok(None) };
    let (count, stopped) = (row.number("frames_count")?, row.column("frames_stop_reason")?);
    Ok(Some(FramesView { bytes, count, stopped }))
}
