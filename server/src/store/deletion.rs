//! Deleting sweeps. One transaction hides the sweep. Its rows are then deleted in batches, so that heartbeats do not wait for a large
//! sweep, and then the objects that no row names. The next start finishes a deletion that was interrupted.

use roost_api::ids::SweepId;
use roost_api::sweep::Deletion;
use roost_api::time::Timestamp;
use sqlx::{Connection, SqliteConnection};

use super::columns::Columns;
use super::{Store, StoreError};

/// Jobs of one batch.
const BATCH: i64 = 500;

impl Store {
    /// What a deletion of a sweep would remove.
    pub(crate) async fn deletion(&self, id: SweepId) -> Result<Option<Deletion>, StoreError> {
        let row = sqlx::query(
            "SELECT points,
                    (SELECT count(*) FROM jobs WHERE sweep_id = s.id) AS jobs,
                    (SELECT count(*) FROM jobs WHERE sweep_id = s.id AND ended_at IS NULL) AS unended,
                    (SELECT count(*) FROM jobs j JOIN attempts a ON a.job_id = j.id WHERE j.sweep_id = s.id) AS attempts,
                    (SELECT count(*) FROM jobs j JOIN results r ON r.job_id = j.id WHERE j.sweep_id = s.id) AS results,
                    (SELECT coalesce(sum(f.bytes), 0) FROM jobs j JOIN frames f ON f.job_id = j.id WHERE j.sweep_id = s.id)
                        AS frames_bytes
             FROM sweeps s WHERE id = ? AND deleting = 0",
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
        let marked = self
            .writer
            .write(move |tx| {
                Box::pin(async move {
                    let marked = sqlx::query(
                        "UPDATE sweeps SET deleting = 1 WHERE id = ? AND deleting = 0
                         AND NOT EXISTS (SELECT 1 FROM jobs WHERE sweep_id = sweeps.id
                                         AND (ended_at IS NULL OR ended_at >= ?))",
                    )
                    .bind(id.to_string())
                    .bind(before.0)
                    .execute(&mut *tx)
                    .await?;
                    if marked.rows_affected() == 0 {
                        return Ok(false);
                    }
                    sqlx::query(
                        "INSERT INTO deletions (sweep_id, name, deleted_at) SELECT id, name, ? FROM sweeps WHERE id = ?",
                    )
                    .bind(now.0)
                    .bind(id.to_string())
                    .execute(&mut *tx)
                    .await?;
                    Ok(true)
                })
            })
            .await?;
        let mut more = marked;
        while more {
            let objects;
            (more, objects) = self
                .writer
                .write(move |tx| Box::pin(async move { delete_batch(tx, &id.to_string()).await }))
                .await?;
            self.remove_unreferenced(&objects).await?;
        }
        Ok(marked)
    }
}

impl Store {
    /// Deletes a batch of single jobs that ended before `before`; returns how many.
    pub(super) async fn delete_single_jobs(&self, before: Timestamp) -> Result<u64, StoreError> {
        let (gone, objects) = self
            .writer
            .write(move |tx| {
                Box::pin(async move {
                    let jobs: Vec<(String, String)> = sqlx::query_as(
                        "SELECT id, scenario_digest FROM jobs WHERE sweep_id IS NULL AND ended_at < ? LIMIT ?",
                    )
                    .bind(before.0)
                    .bind(BATCH)
                    .fetch_all(&mut *tx)
                    .await?;
                    let objects = delete_jobs(tx, &jobs).await?;
                    if !jobs.is_empty() {
                        count_deletion(tx).await?;
                    }
                    Ok((jobs.len() as u64, objects))
                })
            })
            .await?;
        self.remove_unreferenced(&objects).await?;
        Ok(gone)
    }
}

/// Changes the version of listings, as the row of a deleted sweep does.
async fn count_deletion(tx: &mut SqliteConnection) -> Result<(), StoreError> {
    for sql in [
        "INSERT INTO sqlite_sequence (name, seq)
         SELECT 'deletions', 0 WHERE NOT EXISTS (SELECT 1 FROM sqlite_sequence WHERE name = 'deletions')",
        "UPDATE sqlite_sequence SET seq = seq + 1 WHERE name = 'deletions'",
    ] {
        sqlx::query(sql).execute(&mut *tx).await?;
    }
    Ok(())
}

/// Finishes deletions that an earlier server process began.
pub(super) async fn finish(connection: &mut SqliteConnection) -> Result<(), StoreError> {
    let unfinished: Vec<String> =
        sqlx::query_scalar("SELECT id FROM sweeps WHERE deleting = 1").fetch_all(&mut *connection).await?;
    for id in unfinished {
        // The sweep of objects removes the unreferenced ones later.
        let mut more = true;
        while more {
            // One flush for all statements.
            let mut tx = connection.begin().await?;
            more = delete_batch(&mut tx, &id).await?.0;
            tx.commit().await?;
        }
    }
    Ok(())
}

/// Deletes a batch of jobs with their rows, and the sweep after the last batch. Returns whether there is more to do, and the objects
/// that these jobs named.
async fn delete_batch(tx: &mut SqliteConnection, id: &str) -> Result<(bool, Vec<String>), StoreError> {
    let jobs: Vec<(String, String)> =
        sqlx::query_as("SELECT id, scenario_digest FROM jobs WHERE sweep_id = ? LIMIT ?")
            .bind(id)
            .bind(BATCH)
            .fetch_all(&mut *tx)
            .await?;
    let objects = delete_jobs(tx, &jobs).await?;
    if jobs.len() as i64 == BATCH {
        return Ok((true, objects));
    }
    for sql in [
        "DELETE FROM design_points WHERE sweep_id = ?",
        "DELETE FROM extensions WHERE sweep_id = ?",
        "DELETE FROM sweeps WHERE id = ?",
    ] {
        sqlx::query(sql).bind(id).execute(&mut *tx).await?;
    }
    Ok((false, objects))
}

/// Deletes jobs and their rows. Each comes with its scenario's digest. Returns the objects that they named.
async fn delete_jobs(
    tx: &mut SqliteConnection,
    jobs: &[(String, String)],
) -> Result<Vec<String>, StoreError> {
    let mut objects = Vec::new();
    for (job, digest) in jobs {
        let documents: Vec<String> = sqlx::query_scalar(
            "SELECT document_digest FROM results WHERE job_id = ?
             UNION SELECT partial_digest FROM attempts WHERE job_id = ? AND partial_digest IS NOT NULL",
        )
        .bind(job)
        .bind(job)
        .fetch_all(&mut *tx)
        .await?;
        let object: Option<String> =
            sqlx::query_scalar("DELETE FROM frames WHERE job_id = ? RETURNING object_digest")
                .bind(job)
                .fetch_optional(&mut *tx)
                .await?;
        objects.extend(object);
        for sql in [
            "DELETE FROM results WHERE job_id = ?",
            "DELETE FROM attempts WHERE job_id = ?",
            "DELETE FROM jobs WHERE id = ?",
        ] {
            sqlx::query(sql).bind(job).execute(&mut *tx).await?;
        }
        for document in documents {
            sqlx::query(
                "DELETE FROM documents WHERE digest = ?
                 AND NOT EXISTS (SELECT 1 FROM results WHERE document_digest = documents.digest)
                 AND NOT EXISTS (SELECT 1 FROM attempts WHERE partial_digest = documents.digest)",
            )
            .bind(document)
            .execute(&mut *tx)
            .await?;
        }
        sqlx::query(
            "DELETE FROM scenarios WHERE digest = ? AND NOT EXISTS (SELECT 1 FROM jobs WHERE scenario_digest = scenarios.digest)",
        )
        .bind(digest)
        .execute(&mut *tx)
        .await?;
    }
    Ok(objects)
}
