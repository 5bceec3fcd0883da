//! Retention: sweeps and single jobs that ended long ago go, and then the meshes that nobody names any more.

use std::collections::HashSet;

use roost_api::ids::SweepId;
use roost_api::prune::{PrunedSweep, Pruning};
use roost_api::time::Timestamp;
use sqlx::SqliteConnection;
use sqlx::sqlite::SqliteRow;
use tokio::sync::RwLock;

use super::columns::{Columns, to_json};
use super::{Store, StoreError};

/// Each is the end of an index, or of the table.
const NEWEST: &str = "
    SELECT max(at) FROM (
        SELECT max(last_seen_at) AS at FROM workers
        UNION ALL SELECT (SELECT at FROM events ORDER BY seq DESC LIMIT 1)
        UNION ALL SELECT (SELECT submitted_at FROM jobs ORDER BY seq DESC LIMIT 1))";

impl Store {
    /// The newest time that is recorded: when a worker was heard of, something happened to a job, or one was submitted.
    pub(crate) async fn newest_record(&self) -> Result<Option<Timestamp>, StoreError> {
        let newest: Option<i64> = sqlx::query_scalar(NEWEST).fetch_one(&self.readers).await?;
        Ok(newest.map(Timestamp))
    }

    /// What ended before then.
    pub(crate) async fn prunable(&self, then: Timestamp) -> Result<Pruning, StoreError> {
        let rows = sqlx::query(ENDED_SWEEPS).bind(then.0).fetch_all(&self.readers).await?;
        let sweep = |row: &SqliteRow| -> Result<_, StoreError> {
            Ok(PrunedSweep {
                id: row.parsed("id")?,
                name: row.column("name")?,
                jobs: row.number("jobs")?,
                ended_at: row.moment("ended_at")?,
            })
        };
        let sweeps = rows.iter().map(sweep).collect::<Result<Vec<_>, _>>()?;
        let jobs = sqlx::query_scalar::<_, i64>(SINGLE_JOBS).bind(then.0).fetch_one(&self.readers).await?;
        let ids: Vec<SweepId> = sweeps.iter().map(|sweep| sweep.id).collect();
        let mut meshes: Vec<String> =
            sqlx::query_scalar("SELECT digest FROM meshes WHERE uploaded_at < ? ORDER BY seq")
                .bind(then.0)
                .fetch_all(&self.readers)
                .await?;
        // Every scenario is looked through: only where there is a reason.
        if !meshes.is_empty() {
            let named: Vec<String> = sqlx::query_scalar(NAMED)
                .bind(then.0)
                .bind(to_json("sweeps", &ids)?)
                .fetch_all(&self.readers)
                .await?;
            let named: HashSet<String> = named.into_iter().collect();
            meshes.retain(|digest| !named.contains(digest));
        }
        Ok(Pruning { dry_run: true, ended_before: then, sweeps, jobs: jobs as u64, meshes })
    }

    /// Deletes what ended before then, and says what went. `gate` is shut while meshes go: who is about to name one holds it open.
    pub(crate) async fn prune(
        &self,
        then: Timestamp,
        now: Timestamp,
        gate: &RwLock<()>,
    ) -> Result<Pruning, StoreError> {
        let found = self.prunable(then).await?;
        let mut sweeps = Vec::new();
        for sweep in found.sweeps {
            if self.delete_sweep_ended_before(sweep.id, then, now).await? {
                sweeps.push(sweep);
            }
        }
        let mut jobs = 0;
        while let gone @ 1.. = self.delete_single_jobs(then).await? {
            jobs += gone;
        }
        let _shut = gate.write().await;
        // Looked up anew: what was submitted meanwhile may name one.
        let meshes = self.prunable(then).await?.meshes;
        for digest in meshes.clone() {
            self.writer.write(move |tx| Box::pin(async move { delete_mesh(tx, &digest).await })).await?;
        }
        Ok(Pruning { dry_run: false, ended_before: then, sweeps, jobs, meshes })
    }
}

/// The row first: a file that no row names is taken for the rest of an upload.
async fn delete_mesh(tx: &mut SqliteConnection, digest: &str) -> Result<(), StoreError> {
    for sql in ["DELETE FROM meshes WHERE digest = ?", "DELETE FROM mesh_parts WHERE digest = ?"] {
        sqlx::query(sql).bind(digest).execute(&mut *tx).await?;
    }
    Ok(())
}

const ENDED_SWEEPS: &str = "
    SELECT s.id, s.name, (SELECT count(*) FROM jobs WHERE sweep_id = s.id) AS jobs,
           (SELECT max(ended_at) FROM jobs WHERE sweep_id = s.id) AS ended_at
    FROM sweeps s
    WHERE s.deleting = 0 AND s.submitted_at < ?1
      AND NOT EXISTS (SELECT 1 FROM jobs WHERE sweep_id = s.id AND (ended_at IS NULL OR ended_at >= ?1))
    ORDER BY s.seq";

pub(super) const SINGLE_JOBS: &str = "SELECT count(*) FROM jobs WHERE sweep_id IS NULL AND ended_at < ?";

/// Every text that may be the digest of a mesh, in what stays: without jobs that ended before ?1 and without sweeps ?2.
const NAMED: &str = "
    SELECT DISTINCT text.atom FROM scenarios s CROSS JOIN json_tree(s.body) text
    WHERE instr(s.body, '\"digest\"') > 0 AND text.type = 'text' AND length(text.atom) = 64
      AND EXISTS (SELECT 1 FROM jobs j WHERE j.scenario_digest = s.digest
                  AND CASE WHEN j.sweep_id IS NULL THEN j.ended_at IS NULL OR j.ended_at >= ?1
                           ELSE j.sweep_id NOT IN (SELECT value FROM json_each(?2)) END)
    UNION
    SELECT DISTINCT text.atom FROM sweeps s CROSS JOIN json_tree(s.spec) text
    WHERE text.type = 'text' AND length(text.atom) = 64 AND s.deleting = 0
      AND s.id NOT IN (SELECT value FROM json_each(?2))";
