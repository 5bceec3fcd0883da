//! Retention: deletes old sweeps and single jobs, and then the meshes that no document names.

use std::collections::HashSet;

use roost_api::ids::SweepId;
use roost_api::prune::{PrunedSweep, Pruning};
use roost_api::time::Timestamp;
use tokio::sync::RwLock;

use super::columns::{Columns, to_json};
use super::database::{Connection, Row, query, query_scalar};
use super::{Store, StoreError};

/// Each term reads the end of an index or table.
const NEWEST: &str = "
    SELECT max(at) FROM (
        SELECT max(last_seen_at) AS at FROM workers
        UNION ALL SELECT (SELECT at FROM events ORDER BY seq DESC LIMIT 1)
        UNION ALL SELECT (SELECT submitted_at FROM jobs ORDER BY seq DESC LIMIT 1)) AS newest";

impl Store {
    /// The newest recorded time: of a heartbeat, an event or a submission.
    pub(crate) async fn newest_record(&self) -> Result<Option<Timestamp>, StoreError> {
        let newest: Option<i64> = query_scalar(NEWEST).fetch_one(&self.readers).await?;
        Ok(newest.map(Timestamp))
    }

    /// Sweeps, jobs and meshes that pruning would delete.
    pub(crate) async fn prunable(&self, before: Timestamp) -> Result<Pruning, StoreError> {
        let rows = query(ENDED_SWEEPS).bind(before.0).fetch_all(&self.readers).await?;
        let sweep = |row: &Row| -> Result<_, StoreError> {
            Ok(PrunedSweep {
                id: row.parsed("id")?,
                name: row.column("name")?,
                jobs: row.number("jobs")?,
                ended_at: row.moment("ended_at")?,
            })
        };
        let sweeps = rows.iter().map(sweep).collect::<Result<Vec<_>, _>>()?;
        let jobs = query_scalar::<i64>(SINGLE_JOBS).bind(before.0).fetch_one(&self.readers).await?;
        let ids: Vec<SweepId> = sweeps.iter().map(|sweep| sweep.id).collect();
        let mut meshes: Vec<String> =
            query_scalar("SELECT digest FROM meshes WHERE uploaded_at < ? ORDER BY seq")
                .bind(before.0)
                .fetch_all(&self.readers)
                .await?;
        // Reads every scenario: only where there is an old mesh.
        if !meshes.is_empty() {
            let named: Vec<String> = query_scalar(NAMED)
                .bind(before.0)
                .bind(to_json("sweeps", &ids)?)
                .fetch_all(&self.readers)
                .await?;
            let named: HashSet<String> = named.into_iter().collect();
            meshes.retain(|digest| !named.contains(digest));
        }
        Ok(Pruning { dry_run: true, ended_before: before, sweeps, jobs: jobs as u64, meshes })
    }

    /// Deletes sweeps, jobs and meshes older than `before`, and returns them. `gate` is locked while meshes are deleted; submissions that
    /// name meshes hold a read lock.
    pub(crate) async fn prune(
        &self,
        before: Timestamp,
        now: Timestamp,
        gate: &RwLock<()>,
    ) -> Result<Pruning, StoreError> {
        let found = self.prunable(before).await?;
        let mut sweeps = Vec::new();
        for sweep in found.sweeps {
            if self.delete_sweep_ended_before(sweep.id, before, now).await? {
                sweeps.push(sweep);
            }
        }
        let mut jobs = 0;
        while let gone @ 1.. = self.delete_single_jobs(before).await? {
            jobs += gone;
        }
        let _lock = gate.write().await;
        // Searched again: a new submission may name one.
        let meshes = self.prunable(before).await?.meshes;
        for digest in meshes.clone() {
            self.writer.write(move |tx| Box::pin(async move { delete_mesh(tx, &digest).await })).await?;
        }
        Ok(Pruning { dry_run: false, ended_before: before, sweeps, jobs, meshes })
    }
}

/// The row goes first: a file without a row counts as an interrupted upload.
async fn delete_mesh(tx: &mut Connection, digest: &str) -> Result<(), StoreError> {
    for sql in ["DELETE FROM meshes WHERE digest = ?", "DELETE FROM mesh_parts WHERE digest = ?"] {
        query(sql).bind(digest).execute(&mut *tx).await?;
    }
    Ok(())
}

const ENDED_SWEEPS: &str = "
    SELECT s.id, s.name, (SELECT count(*) FROM jobs WHERE sweep_id = s.id) AS jobs,
           coalesce((SELECT max(ended_at) FROM jobs WHERE sweep_id = s.id), s.submitted_at) AS ended_at
    FROM sweeps s
    WHERE s.state = 'ready' AND s.submitted_at < ?1
      AND NOT EXISTS (SELECT 1 FROM jobs WHERE sweep_id = s.id AND (ended_at IS NULL OR ended_at >= ?1))
      AND NOT EXISTS (SELECT 1 FROM studies WHERE sweep_id = s.id AND state IN ('running', 'paused'))
    ORDER BY s.seq";

pub(super) const SINGLE_JOBS: &str = "SELECT count(*) FROM jobs WHERE sweep_id IS NULL AND ended_at < ?";

/// Every text that may be the digest of a mesh, except in jobs that ended before ?1 and in sweeps ?2.
const NAMED: &str = "
    SELECT DISTINCT text.atom FROM scenarios s CROSS JOIN json_tree(s.body) text
    WHERE s.body LIKE '%\"digest\"%' AND text.type = 'text' AND length(text.atom) = 64
      AND EXISTS (SELECT 1 FROM jobs j WHERE j.scenario_digest = s.digest
                  AND CASE WHEN j.sweep_id IS NULL THEN j.ended_at IS NULL OR j.ended_at >= ?1
                           ELSE j.sweep_id NOT IN (SELECT atom FROM json_each(?2)) END)
    UNION
    SELECT DISTINCT text.atom FROM sweeps s CROSS JOIN json_tree(s.spec) text
    WHERE text.type = 'text' AND length(text.atom) = 64 AND s.state <> 'deleting'
      AND s.id NOT IN (SELECT atom FROM json_each(?2))";
