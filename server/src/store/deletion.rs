//! Deleting sweeps. One transaction hides the sweep: its state is `deleting`. Its rows are then deleted in batches, so that heartbeats do
//! not wait for a large sweep, and then the objects that no row names. A background task finishes a deletion that was interrupted.
//!
//! A hidden sweep is deleted by the number of its row. Its identifier may be submitted again meanwhile.

use roost_api::ids::SweepId;
use roost_api::sweep::Deletion;
use roost_api::time::Timestamp;

use super::columns::{Columns, to_json};
use super::database::{Connection, query, query_as, query_scalar};
use super::writer::SLICE;
use super::{Store, StoreError};

/// Jobs of one batch.
const BATCH: i64 = SLICE as i64;

/// Design points of one batch, after the jobs.
const POINTS: i64 = 4 * BATCH;

/// Hides a sweep whose jobs all ended before a time, unless its study goes on. Returns the number of its row.
pub(super) const HIDE: &str = "UPDATE sweeps SET state = 'deleting' WHERE id = ? AND state = 'ready'
    AND NOT EXISTS (SELECT 1 FROM jobs WHERE sweep_id = sweeps.id AND state IN ('queued', 'running'))
    AND NOT EXISTS (SELECT 1 FROM jobs WHERE sweep_id = sweeps.id AND state IN ('succeeded', 'failed', 'cancelled')
                    AND ended_at >= ?)
    AND NOT EXISTS (SELECT 1 FROM studies WHERE sweep_id = sweeps.id AND state IN ('running', 'paused')) RETURNING seq";

impl Store {
    /// The rows and objects that a deletion of a sweep would remove.
    pub(crate) async fn deletion(&self, id: SweepId) -> Result<Option<Deletion>, StoreError> {
        let row = query(
            "SELECT points,
                    (SELECT count(*) FROM jobs WHERE sweep_id = s.id) AS jobs,
                    (SELECT count(*) FROM jobs WHERE sweep_id = s.id AND ended_at IS NULL) AS unended,
                    (SELECT count(*) FROM jobs j JOIN attempts a ON a.job_id = j.id WHERE j.sweep_id = s.id) AS attempts,
                    (SELECT count(*) FROM jobs j JOIN results r ON r.job_id = j.id WHERE j.sweep_id = s.id) AS results,
                    (SELECT CAST(coalesce(sum(f.bytes), 0) AS BIGINT) FROM jobs j JOIN frames f ON f.job_id = j.id WHERE j.sweep_id = s.id)
                        AS frames_bytes
             FROM sweeps s WHERE id = ? AND state = 'ready'",
        )
        .bind(id.to_string())
        .fetch_optional(&self.readers)
        .await?;
        let Some(row) = row else { return Ok(None) };
        Ok(Some(Deletion {
            dry_run: true,
            points: row.number("points")?,
            jobs: row.number("jobs")?,
            unended: row.number("unended")?,
            attempts: row.number("attempts")?,
            results: row.number("results")?,
            frames_bytes: row.number("frames_bytes")?,
        }))
    }

    /// Deletes a sweep. Returns false, and changes nothing, when some of its jobs have not ended.
    pub(crate) async fn delete_sweep(&self, id: SweepId, now: Timestamp) -> Result<bool, StoreError> {
        self.delete_sweep_ended_before(id, Timestamp(i64::MAX), now).await
    }

    /// Deletes a sweep whose jobs all ended before `before`. Otherwise returns false, and changes nothing.
    pub(super) async fn delete_sweep_ended_before(
        &self,
        id: SweepId,
        before: Timestamp,
        now: Timestamp,
    ) -> Result<bool, StoreError> {
        let hidden: Option<i64> = self
            .writer
            .write(move |tx| {
                Box::pin(async move {
                    let hidden = query_scalar(HIDE)
                        .bind(id.to_string())
                        .bind(before.0)
                        .fetch_optional(&mut *tx)
                        .await?;
                    if hidden.is_none() {
                        return Ok(None);
                    }
                    query(
                        "INSERT INTO deletions (sweep_id, name, deleted_at) SELECT id, name, ? FROM sweeps WHERE id = ?",
                    )
                    .bind(now.0)
                    .bind(id.to_string())
                    .execute(&mut *tx)
                    .await?;
                    Ok(hidden)
                })
            })
            .await?;
        if let Some(seq) = hidden {
            self.delete_hidden(seq).await?;
        }
        Ok(hidden.is_some())
    }

    /// Deletes the sweep of this number, if its state is `deleting`.
    pub(super) async fn delete_hidden(&self, seq: i64) -> Result<(), StoreError> {
        let mut more = true;
        while more {
            let objects;
            (more, objects) =
                self.writer.write(move |tx| Box::pin(async move { delete_batch(tx, seq).await })).await?;
            self.remove_objects(&objects).await;
        }
        Ok(())
    }

    /// Removes objects that deleted rows have named. A daily task finds those that a failure leaves.
    async fn remove_objects(&self, objects: &[String]) {
        if let Err(error) = self.remove_unreferenced(objects).await {
            tracing::warn!(error = error.as_dyn(), "removing objects of deleted jobs failed");
        }
    }

    /// Deletes the sweeps that a failure or the end of an earlier server process has left hidden.
    pub(crate) async fn delete_leftovers(&self) -> Result<(), StoreError> {
        let left =
            query_scalar("SELECT seq FROM sweeps WHERE state = 'deleting'").fetch_all(&self.readers).await?;
        for seq in left {
            if let Err(error) = self.delete_hidden(seq).await {
                tracing::error!(error = error.as_dyn(), seq, "deleting a hidden sweep failed");
            }
        }
        Ok(())
    }
}

impl Store {
    /// Deletes a batch of single jobs that ended before `before`; returns how many.
    pub(super) async fn delete_single_jobs(&self, before: Timestamp) -> Result<u64, StoreError> {
        let (gone, objects) = self
            .writer
            .write(move |tx| {
                Box::pin(async move {
                    let jobs: Vec<(String, String)> = query_as(
                        "SELECT id, scenario_digest FROM jobs WHERE sweep_id IS NULL AND ended_at < ? LIMIT ?",
                    )
                    .bind(before.0)
                    .bind(BATCH)
                    .fetch_all(&mut *tx)
                    .await?;
                    let objects = delete_jobs(tx, &jobs).await?;
                    if !jobs.is_empty() {
                        change_listings(tx).await?;
                    }
                    Ok((jobs.len() as u64, objects))
                })
            })
            .await?;
        self.remove_objects(&objects).await;
        Ok(gone)
    }
}

/// Changes the version of listings, as the row of a deleted sweep does.
pub(super) async fn change_listings(tx: &mut Connection) -> Result<(), StoreError> {
    for sql in [
        "INSERT INTO sqlite_sequence (name, seq)
         SELECT 'deletions', 0 WHERE NOT EXISTS (SELECT 1 FROM sqlite_sequence WHERE name = 'deletions')",
        "UPDATE sqlite_sequence SET seq = seq + 1 WHERE name = 'deletions'",
    ] {
        query(sql).execute(&mut *tx).await?;
    }
    Ok(())
}

/// Marks the sweeps that an earlier server process was submitting: [`Store::delete_leftovers`] deletes them.
pub(super) async fn mark_leftovers(connection: &mut Connection) -> Result<(), StoreError> {
    let sql = "UPDATE sweeps SET state = 'deleting' WHERE state = 'submitting'";
    query(sql).execute(connection).await?;
    Ok(())
}

/// Deletes a batch of jobs of a sweep that is `deleting`, with their rows, and the sweep after the last batch. Returns whether there is
/// more to do, and the objects that these jobs named.
async fn delete_batch(tx: &mut Connection, seq: i64) -> Result<(bool, Vec<String>), StoreError> {
    let id: Option<String> = query_scalar("SELECT id FROM sweeps WHERE seq = ? AND state = 'deleting'")
        .bind(seq)
        .fetch_optional(&mut *tx)
        .await?;
    let Some(id) = id else { return Ok((false, Vec::new())) };
    let jobs: Vec<(String, String)> =
        query_as("SELECT id, scenario_digest FROM jobs WHERE sweep_id = ? LIMIT ?")
            .bind(&id)
            .bind(BATCH)
            .fetch_all(&mut *tx)
            .await?;
    let objects = delete_jobs(tx, &jobs).await?;
    if jobs.len() as i64 == BATCH {
        return Ok((true, objects));
    }
    let points = "DELETE FROM design_points WHERE sweep_id = ?1
                  AND point IN (SELECT point FROM design_points WHERE sweep_id = ?1 LIMIT ?2)";
    if query(points).bind(&id).bind(POINTS).execute(&mut *tx).await?.rows_affected() as i64 == POINTS {
        return Ok((true, objects));
    }
    for sql in [
        "DELETE FROM extensions WHERE sweep_id = ?",
        "DELETE FROM asks WHERE study_id = ?",
        "DELETE FROM observations WHERE study_id = ?",
        "DELETE FROM observation_counts WHERE study_id = ?",
        "DELETE FROM studies WHERE sweep_id = ?",
        "DELETE FROM sweeps WHERE id = ?",
    ] {
        query(sql).bind(&id).execute(&mut *tx).await?;
    }
    Ok((false, objects))
}

/// Deletes jobs and their rows. Each comes with its scenario's digest. Returns the objects that they named.
async fn delete_jobs(tx: &mut Connection, jobs: &[(String, String)]) -> Result<Vec<String>, StoreError> {
    let (ids, scenarios): (Vec<&String>, Vec<&String>) = jobs.iter().map(|(id, digest)| (id, digest)).unzip();
    let (ids, scenarios) = (to_json("jobs", &ids)?, to_json("scenarios", &scenarios)?);
    let documents: Vec<String> = query_scalar(DOCUMENTS).bind(&ids).fetch_all(&mut *tx).await?;
    let objects =
        "DELETE FROM frames WHERE job_id IN (SELECT atom FROM json_each(?)) RETURNING object_digest";
    let objects = query_scalar(objects).bind(&ids).fetch_all(&mut *tx).await?;
    for (sql, names) in [
        ("DELETE FROM results WHERE job_id IN (SELECT atom FROM json_each(?))", &ids),
        ("DELETE FROM checkpoints WHERE job_id IN (SELECT atom FROM json_each(?))", &ids),
        ("DELETE FROM attempts WHERE job_id IN (SELECT atom FROM json_each(?))", &ids),
        ("DELETE FROM jobs WHERE id IN (SELECT atom FROM json_each(?))", &ids),
        (UNNAMED_DOCUMENTS, &to_json("documents", &documents)?),
        (UNNAMED_SCENARIOS, &scenarios),
    ] {
        query(sql).bind(names).execute(&mut *tx).await?;
    }
    Ok(objects)
}

const DOCUMENTS: &str = "
    SELECT document_digest FROM results WHERE job_id IN (SELECT atom FROM json_each(?1))
    UNION SELECT partial_digest FROM attempts
          WHERE job_id IN (SELECT atom FROM json_each(?1)) AND partial_digest IS NOT NULL";
const UNNAMED_DOCUMENTS: &str = "DELETE FROM documents WHERE digest IN (SELECT atom FROM json_each(?))
    AND NOT EXISTS (SELECT 1 FROM results WHERE document_digest = documents.digest)
    AND NOT EXISTS (SELECT 1 FROM attempts WHERE partial_digest = documents.digest)";
const UNNAMED_SCENARIOS: &str = "DELETE FROM scenarios WHERE digest IN (SELECT atom FROM json_each(?))
    AND NOT EXISTS (SELECT 1 FROM jobs WHERE scenario_digest = scenarios.digest)";
