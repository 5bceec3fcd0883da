//! Frames of jobs: each stream is an object, named by a row.

use std::ops::Range;

use bytes::Bytes;
use futures_util::Stream;
use roost_api::frames::FramesView;
use roost_api::ids::{JobId, WorkerId};
use roost_api::job::JobState;
use roost_api::time::Timestamp;

use super::columns::{Columns, to_json};
use super::database::{Connection, Row, query, query_scalar};
use super::objects::{Reading, StageError, Staged};
use super::transitions::fenced;
use super::{Store, StoreError};
use crate::queue::Refusal;

/// Objects that are looked up with one query.
const BATCH: usize = 1000;

/// The objects of a list that no row names.
pub(super) const UNREFERENCED: &str = "SELECT atom FROM json_each(?)
    WHERE NOT EXISTS (SELECT 1 FROM frames WHERE object_digest = atom)
      AND NOT EXISTS (SELECT 1 FROM checkpoints WHERE object_digest = atom)
      AND NOT EXISTS (SELECT 1 FROM fills WHERE object_digest = atom)";

/// The frames of a job.
pub(crate) struct StoredFrames {
    /// blake3 of the stream.
    pub(crate) object: String,
    /// Its length in bytes.
    pub(crate) bytes: u64,
    /// State of the job. The frames of a job that has succeeded never change.
    pub(crate) state: JobState,
}

impl Store {
    /// Whether an attempt may still write. Uses a reader.
    pub(crate) async fn may_write(
        &self,
        job: JobId,
        attempt: u32,
        worker: WorkerId,
    ) -> Result<Result<(), Refusal>, StoreError> {
        let mut reader = self.readers.acquire().await?;
        may_write(&mut reader, job, attempt, worker).await
    }

    /// Stores a stream as it arrives, without a name yet.
    pub(crate) async fn stage<E>(
        &self,
        bytes: impl Stream<Item = Result<Bytes, E>> + Unpin,
        limit: u64,
    ) -> Result<Staged, StageError<E>> {
        self.objects.stage(bytes, limit).await
    }

    /// Removes a staged stream.
    pub(crate) async fn discard(&self, staged: Staged) {
        self.objects.discard(staged).await;
    }

    /// Records a stream as the frames of an attempt; false when it was recorded before.
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
        let _guard = self.objects.publish(staged).await?;
        self.writer
            .write(move |tx| {
                Box::pin(async move {
                    if let Err(refusal) = may_write(tx, job, attempt, worker).await? {
                        return Ok(Err(refusal));
                    }
                    let recorded = query(
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
                    Ok(Ok(recorded.rows_affected() > 0))
                })
            })
            .await
    }

    /// The frames of a job's newest attempt, if it has any.
    pub(crate) async fn frames(
        &self,
        id: JobId,
    ) -> Result<Result<Option<StoredFrames>, Refusal>, StoreError> {
        let row = query(
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

    /// A part of a stream; none when the object is gone.
    pub(crate) async fn read_object(
        &self,
        object: &str,
        part: Range<u64>,
    ) -> Result<Option<Reading>, StoreError> {
        self.objects.read(object, part).await
    }

    /// Removes the objects older than `before` that no row names.
    pub(crate) async fn sweep_objects(&self, before: Timestamp) -> Result<u64, StoreError> {
        let old = self.objects.older_than(before.0).await?;
        self.remove_unreferenced(&old).await
    }

    /// Removes the objects of a list that no row names.
    pub(super) async fn remove_unreferenced(&self, objects: &[String]) -> Result<u64, StoreError> {
        let mut removed = 0;
        for some in objects.chunks(BATCH) {
            let unreferenced: Vec<String> =
                query_scalar(UNREFERENCED).bind(to_json("objects", &some)?).fetch_all(&self.readers).await?;
            if !unreferenced.is_empty() {
                // A reader sees a commit before its flush. After a power failure, a row could name an object that is gone. On PostgreSQL,
                // this also fails if another server leads, which may have named the object.
                self.writer.flushed().await?;
            }
            for object in unreferenced {
                // Checked again under the lock: a row may have named it meanwhile.
                let _lock = self.objects.lock_removal().await;
                let sql = "SELECT EXISTS (SELECT 1 FROM frames WHERE object_digest = ?1)
                                  OR EXISTS (SELECT 1 FROM checkpoints WHERE object_digest = ?1)
                                  OR EXISTS (SELECT 1 FROM fills WHERE object_digest = ?1)";
                let is_referenced: bool = query_scalar(sql).bind(&object).fetch_one(&self.readers).await?;
                if !is_referenced && self.objects.remove(&object).await? {
                    removed += 1;
                }
            }
        }
        Ok(removed)
    }
}

/// Whether an attempt may write.
async fn may_write(
    connection: &mut Connection,
    job: JobId,
    attempt: u32,
    worker: WorkerId,
) -> Result<Result<(), Refusal>, StoreError> {
    Ok(fenced(connection, job, attempt, worker).await?.map(drop))
}

/// The frames of a row of a job.
pub(super) fn frames_view(row: &Row) -> Result<Option<FramesView>, StoreError> {
    let Some(bytes) = row.number_opt("frames_bytes")? else { return Ok(None) };
    let (count, stopped) = (row.number("frames_count")?, row.column("frames_stop_reason")?);
    Ok(Some(FramesView { bytes, count, stopped }))
}
