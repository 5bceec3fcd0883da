//! Fills that jobs share: filled states at t = 0, each an object that a row names.
//!
//! ```text
//! (no row) ── claim ──► computing ── upload ──► stored ── unused, or too many bytes ──► (no row)
//!    ▲                   │  ╰── cannot store ──► withdrawn ◄── cannot use ──╯
//!    ╰── attempt ended ──┴───── an hour later ──────╯
//! ```
//!
//! Claims pass over jobs whose fill is being computed. A row counts as being computed while its attempt runs: nothing has to end with
//! the attempt. Jobs of a withdrawn fill fill for themselves, and the first upload stores it again.

use roost_api::fill::StoredFill;
use roost_api::ids::{JobId, WorkerId};
use roost_api::time::Timestamp;

use super::columns::Columns;
use super::database::query;
use super::objects::Staged;
use super::transitions::fenced;
use super::{Store, StoreError};
use crate::queue::Refusal;

/// Fills whose attempt has ended without storing them.
pub(super) const ENDED: &str = "SELECT 1 FROM fills f WHERE f.job_id IS NOT NULL
    AND NOT EXISTS (SELECT 1 FROM jobs j WHERE j.id = f.job_id AND j.attempt = f.attempt AND j.state = 'running')";

/// Ends those.
const DELETE_ENDED: &str = "DELETE FROM fills WHERE job_id IS NOT NULL
    AND NOT EXISTS (SELECT 1 FROM jobs j WHERE j.id = fills.job_id AND j.attempt = fills.attempt AND j.state = 'running')";

/// Stores a fill that no other attempt has stored.
const RECORD: &str = "
    INSERT INTO fills (fill_digest, solver_revision, backend, device, object_digest, bytes, used_at)
    SELECT j.fill_digest, ?, ?, ?, ?, ?, ? FROM jobs j WHERE j.id = ? AND j.fill_digest IS NOT NULL
    ON CONFLICT (fill_digest, solver_revision, backend, device) DO UPDATE SET job_id = NULL, attempt = NULL,
        object_digest = excluded.object_digest, bytes = excluded.bytes, used_at = excluded.used_at
    WHERE fills.object_digest IS NULL";

/// The stored fill for the device of an attempt.
pub(super) const STORED: &str = "SELECT f.object_digest, f.bytes FROM jobs j
    JOIN attempts a ON a.job_id = j.id AND a.number = ? JOIN workers w ON w.id = a.worker_id
    JOIN fills f ON f.fill_digest = j.fill_digest AND f.solver_revision = w.solver_revision
                AND f.backend = w.backend AND f.device = w.device
    WHERE j.id = ? AND f.object_digest IS NOT NULL";

/// Withdraws the fill that an attempt computes, or the stored object that it cannot use.
const WITHDRAW: &str =
    "UPDATE fills SET job_id = NULL, attempt = NULL, object_digest = NULL, bytes = NULL, used_at = ?7
    WHERE fill_digest = (SELECT fill_digest FROM jobs WHERE id = ?1)
      AND solver_revision = ?4 AND backend = ?5 AND device = ?6
      AND ((job_id = ?1 AND attempt = ?2) OR object_digest = ?3)";

/// Deletes the longest unused fills beyond a number of bytes.
const DELETE_SURPLUS: &str = "DELETE FROM fills WHERE (fill_digest, solver_revision, backend, device) IN (
    SELECT fill_digest, solver_revision, backend, device FROM (
        SELECT fill_digest, solver_revision, backend, device,
               sum(bytes) OVER (ORDER BY used_at DESC, fill_digest, solver_revision, backend, device) AS total
        FROM fills WHERE object_digest IS NOT NULL) AS sized
    WHERE total > ?)";

/// Deletes fills that nobody has used since the first time, and withdrawn ones since the second.
const DELETE_UNUSED: &str = "DELETE FROM fills WHERE used_at < ? AND object_digest IS NOT NULL
    OR used_at < ? AND object_digest IS NULL AND job_id IS NULL";

impl Store {
    /// Stores the fill of an attempt's job, and deletes the longest unused ones beyond `limit_bytes`. False if it was stored before, or if
    /// the job shares none.
    pub(crate) async fn record_fill(
        &self,
        job: JobId,
        attempt: u32,
        worker: WorkerId,
        staged: Staged,
        limit_bytes: u64,
        now: Timestamp,
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
                                .bind(made_by.revision)
                                .bind(made_by.backend)
                                .bind(made_by.device)
                                .bind(&object)
                                .bind(bytes as i64)
                                .bind(now.0)
                                .bind(job.to_string())
                                .execute(&mut *tx)
                                .await?;
                            Ok(recorded.rows_affected() > 0)
                        }
                        Err(refusal) => Err(refusal),
                    };
                    if recorded == Ok(true) {
                        let limit = i64::try_from(limit_bytes).unwrap_or(i64::MAX);
                        query(DELETE_SURPLUS).bind(limit).execute(&mut *tx).await?;
                    } else {
                        let sql = "INSERT INTO unnamed_objects (digest) VALUES (?) ON CONFLICT DO NOTHING";
                        query(sql).bind(object).execute(&mut *tx).await?;
                    }
                    Ok(recorded)
                })
            })
            .await
    }

    /// The stored fill that an attempt may start from.
    pub(crate) async fn fill(&self, job: JobId, attempt: u32) -> Result<Option<StoredFill>, StoreError> {
        let row = query(STORED).bind(attempt).bind(job.to_string()).fetch_optional(&self.readers).await?;
        row.map(|row| Ok(StoredFill { digest: row.column("object_digest")?, bytes: row.number("bytes")? }))
            .transpose()
    }

    /// An attempt will not store the fill that it computes, or cannot use the stored object of this digest. Nobody waits for the fill any
    /// more, and an upload stores it again.
    pub(crate) async fn withdraw_fill(
        &self,
        job: JobId,
        attempt: u32,
        worker: WorkerId,
        object: Option<String>,
        now: Timestamp,
    ) -> Result<Result<bool, Refusal>, StoreError> {
        self.writer
            .write(move |tx| {
                Box::pin(async move {
                    let made_by = match fenced(tx, job, attempt, worker).await? {
                        Ok(fenced) => fenced.provenance,
                        Err(refusal) => return Ok(Err(refusal)),
                    };
                    let withdrawn = query(WITHDRAW)
                        .bind(job.to_string())
                        .bind(attempt)
                        .bind(object)
                        .bind(made_by.revision)
                        .bind(made_by.backend)
                        .bind(made_by.device)
                        .bind(now.0)
                        .execute(&mut *tx)
                        .await?;
                    Ok(Ok(withdrawn.rows_affected() > 0))
                })
            })
            .await
    }

    /// Forgets that attempts compute a fill that have ended without storing it; returns how many.
    pub(crate) async fn forget_ended_fills(&self) -> Result<u64, StoreError> {
        // Usually there is none: a reader finds out without the writer.
        if query(ENDED).fetch_optional(&self.readers).await?.is_none() {
            return Ok(0);
        }
        let ended = self.writer.write(move |tx| {
            Box::pin(async move { Ok(query(DELETE_ENDED).execute(tx).await?.rows_affected()) })
        });
        ended.await
    }

    /// Deletes stored fills last used before `unused`, and withdrawn ones of before `withdrawn`. Returns how many.
    pub(crate) async fn prune_fills(
        &self,
        unused: Timestamp,
        withdrawn: Timestamp,
    ) -> Result<u64, StoreError> {
        let pruned = self.writer.write(move |tx| {
            Box::pin(async move {
                let pruned = query(DELETE_UNUSED).bind(unused.0).bind(withdrawn.0).execute(tx).await?;
                Ok(pruned.rows_affected())
            })
        });
        pruned.await
    }
}
