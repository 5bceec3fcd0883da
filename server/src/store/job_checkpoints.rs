//! Checkpoints of jobs: the newest of each job is an object, named by a row.
//!
//! Triggers of the database delete the row when the job ends, and list the objects that lose their name.

use roost_api::checkpoint::CheckpointView;
use roost_api::ids::{JobId, WorkerId};

use super::columns::{Columns, to_json};
use super::database::{AssertSqlSafe, Row, query, query_scalar};
use super::objects::Staged;
use super::transitions::fenced;
use super::{Store, StoreError};
use crate::queue::Refusal;

/// The objects that have lost a name.
const UNNAMED: &str = "SELECT digest FROM unnamed_objects LIMIT 1000";

/// Records a checkpoint, unless the same attempt has recorded a later one.
const RECORD: &str = "
    INSERT INTO checkpoints (job_id, attempt, object_digest, bytes, simulated_s, solver_revision, backend, device)
    VALUES (?, ?, ?, ?, ?, ?, ?, ?)
    ON CONFLICT (job_id) DO UPDATE SET attempt = excluded.attempt, object_digest = excluded.object_digest,
        bytes = excluded.bytes, simulated_s = excluded.simulated_s, solver_revision = excluded.solver_revision,
        backend = excluded.backend, device = excluded.device
    WHERE excluded.attempt > checkpoints.attempt OR excluded.simulated_s >= checkpoints.simulated_s";

/// The columns of [`checkpoint_view`], of the table `c`.
pub(super) const COLUMNS: &str = "c.attempt AS checkpoint_attempt, c.object_digest AS checkpoint_digest,
    c.bytes AS checkpoint_bytes, c.simulated_s AS checkpoint_s, c.solver_revision AS checkpoint_revision,
    c.backend AS checkpoint_backend, c.device AS checkpoint_device";

/// The checkpoint of a row with [`COLUMNS`].
pub(super) fn checkpoint_view(row: &Row) -> Result<Option<CheckpointView>, StoreError> {
    let Some(attempt) = row.number_opt("checkpoint_attempt")? else { return Ok(None) };
    Ok(Some(CheckpointView {
        attempt,
        simulated_s: row.column("checkpoint_s")?,
        bytes: row.number("checkpoint_bytes")?,
        digest: row.column("checkpoint_digest")?,
        solver_revision: row.number("checkpoint_revision")?,
        backend: row.column("checkpoint_backend")?,
        device: row.column("checkpoint_device")?,
    }))
}

impl Store {
    /// Joins the parts of an upload.
    pub(crate) async fn join(&self, mut parts: Vec<Staged>) -> Result<Staged, StoreError> {
        match (parts.pop(), parts.is_empty()) {
            (Some(only), true) => Ok(only),
            (last, _) => {
                parts.extend(last);
                self.objects.join(parts).await
            }
        }
    }

    /// Records a checkpoint of an attempt; false if the attempt has recorded a later one.
    pub(crate) async fn record_checkpoint(
        &self,
        job: JobId,
        attempt: u32,
        worker: WorkerId,
        staged: Staged,
        simulated_s: f64,
    ) -> Result<Result<bool, Refusal>, StoreError> {
        let (object, bytes) = (staged.digest.clone(), staged.bytes);
        let _guard = self.objects.publish(staged).await?;
        self.writer
            .write(move |tx| {
                Box::pin(async move {
                    let recorded = match fenced(tx, job, attempt, worker).await? {
                        Ok(fenced) => {
                            let made_by = fenced.provenance;
                            let recorded = query(RECORD)
                                .bind(job.to_string())
                                .bind(attempt)
                                .bind(&object)
                                .bind(bytes as i64)
                                .bind(simulated_s)
                                .bind(made_by.revision)
                                .bind(made_by.backend)
                                .bind(made_by.device)
                                .execute(&mut *tx)
                                .await?;
                            Ok(recorded.rows_affected() > 0)
                        }
                        Err(refusal) => Err(refusal),
                    };
                    if recorded != Ok(true) {
                        let sql = "INSERT INTO unnamed_objects (digest) VALUES (?) ON CONFLICT DO NOTHING";
                        query(sql).bind(object).execute(&mut *tx).await?;
                    }
                    Ok(recorded)
                })
            })
            .await
    }

    /// The checkpoint of a job that an attempt recorded, while it is the newest.
    pub(crate) async fn checkpoint(
        &self,
        job: JobId,
        attempt: u32,
    ) -> Result<Result<Option<CheckpointView>, Refusal>, StoreError> {
        let sql = format!(
            "SELECT {COLUMNS} FROM jobs j LEFT JOIN checkpoints c ON c.job_id = j.id AND c.attempt = ? WHERE j.id = ?"
        );
        let row = query(AssertSqlSafe(sql))
            .bind(attempt)
            .bind(job.to_string())
            .fetch_optional(&self.readers)
            .await?;
        row.as_ref().map_or(Ok(Err(Refusal::NoJob)), |row| checkpoint_view(row).map(Ok))
    }

    /// Deletes the checkpoint of earlier attempts, which this attempt cannot use: it begins at zero.
    pub(crate) async fn discard_checkpoint(
        &self,
        job: JobId,
        attempt: u32,
        worker: WorkerId,
    ) -> Result<Result<(), Refusal>, StoreError> {
        self.writer
            .write(move |tx| {
                Box::pin(async move {
                    if let Err(refusal) = fenced(tx, job, attempt, worker).await? {
                        return Ok(Err(refusal));
                    }
                    for sql in [
                        "DELETE FROM checkpoints WHERE job_id = ? AND attempt < ?",
                        "UPDATE attempts SET resumed_from_s = NULL WHERE job_id = ? AND number = ?",
                    ] {
                        query(sql).bind(job.to_string()).bind(attempt).execute(&mut *tx).await?;
                    }
                    Ok(Ok(()))
                })
            })
            .await
    }

    /// Removes objects that have lost their last name; returns how many.
    pub(crate) async fn remove_unnamed_objects(&self) -> Result<u64, StoreError> {
        let unnamed: Vec<String> = query_scalar(UNNAMED).fetch_all(&self.readers).await?;
        if unnamed.is_empty() {
            return Ok(0);
        }
        let removed = self.remove_unreferenced(&unnamed).await?;
        let done = to_json("objects", &unnamed)?;
        self.writer
            .write(move |tx| {
                Box::pin(async move {
                    let sql = "DELETE FROM unnamed_objects WHERE digest IN (SELECT atom FROM json_each(?))";
                    Ok(query(sql).bind(done).execute(&mut *tx).await.map(drop)?)
                })
            })
            .await?;
        Ok(removed)
    }
}
