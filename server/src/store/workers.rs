//! Workers: who has registered, and what they do now.

use std::collections::HashMap;

use roost_api::ids::{JobId, WorkerId};
use roost_api::time::Timestamp;
use roost_api::worker::{WorkerRegistration, WorkerView};

use super::rows::Columns;
use super::{Store, StoreError};
use crate::queue::Refusal;

impl Store {
    /// Notes a worker; a repeat is the same worker.
    pub(crate) async fn register_worker(
        &self,
        worker: WorkerRegistration,
        now: Timestamp,
    ) -> Result<(), StoreError> {
        self.writer
            .write(move |tx| {
                Box::pin(async move {
                    sqlx::query(
                        "INSERT INTO workers (id, name, solver_revision, backend, device, threads, memory_mib,
                                              registered_at, last_seen_at)
                         VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?)
                         ON CONFLICT (id) DO UPDATE SET name = excluded.name, backend = excluded.backend,
                             solver_revision = excluded.solver_revision, device = excluded.device,
                             threads = excluded.threads, memory_mib = excluded.memory_mib,
                             last_seen_at = excluded.last_seen_at",
                    )
                    .bind(worker.worker_id.to_string())
                    .bind(worker.name)
                    .bind(worker.solver_revision)
                    .bind(worker.backend)
                    .bind(worker.device)
                    .bind(worker.threads)
                    .bind(worker.memory_mib)
                    .bind(now.0)
                    .bind(now.0)
                    .execute(&mut *tx)
                    .await?;
                    Ok(())
                })
            })
            .await
    }

    /// Asks a worker to claim nothing more; its next heartbeat carries it.
    pub(crate) async fn drain_worker(&self, id: WorkerId) -> Result<Result<(), Refusal>, StoreError> {
        self.writer
            .write(move |tx| {
                Box::pin(async move {
                    let known = sqlx::query("UPDATE workers SET draining = 1 WHERE id = ?")
                        .bind(id.to_string())
                        .execute(&mut *tx)
                        .await?;
                    Ok(if known.rows_affected() == 0 { Err(Refusal::NoWorker) } else { Ok(()) })
                })
            })
            .await
    }

    /// Workers, newest first, and the one that the next page starts before.
    pub(crate) async fn workers(
        &self,
        before: Option<WorkerId>,
        limit: u32,
    ) -> Result<(Vec<WorkerView>, Option<WorkerId>), StoreError> {
        let mut running: HashMap<WorkerId, Vec<JobId>> = HashMap::new();
        let rows = sqlx::query("SELECT id, worker_id FROM jobs WHERE state = 'running' ORDER BY seq")
            .fetch_all(&self.readers)
            .await?;
        for row in rows {
            running.entry(row.parsed("worker_id")?).or_default().push(row.parsed("id")?);
        }
        // Identifiers are UUIDv7: their order is that of the processes' starts.
        let rows = sqlx::query(
            "SELECT w.*, (SELECT count(*) FROM attempts WHERE worker_id = w.id AND outcome = 'succeeded')
                AS succeeded,
                (SELECT count(*) FROM attempts WHERE worker_id = w.id AND outcome = 'worker') AS failed
             FROM workers w WHERE ?1 IS NULL OR w.id < ?1 ORDER BY w.id DESC LIMIT ?2",
        )
        .bind(before.map(|id| id.to_string()))
        .bind(i64::from(limit) + 1)
        .fetch_all(&self.readers)
        .await?;
        let more = rows.len() > limit as usize;
        let mut views = Vec::new();
        for row in rows.iter().take(limit as usize) {
            let id = row.parsed("id")?;
            views.push(WorkerView {
                id,
                name: row.column("name")?,
                backend: row.column("backend")?,
                device: row.column("device")?,
                threads: row.number("threads")?,
                memory_mib: row.number_opt("memory_mib")?,
                solver_revision: row.number("solver_revision")?,
                draining: row.column("draining")?,
                running: running.remove(&id).unwrap_or_default(),
                progress: Vec::new(), // known to the server's memory only
                particle_steps_per_s: None,
                succeeded: row.number("succeeded")?,
                failed: row.number("failed")?,
                registered_at: row.moment("registered_at")?,
                last_seen_at: row.moment("last_seen_at")?,
            });
        }
        let next = views.last().filter(|_| more).map(|last| last.id);
        Ok((views, next))
    }
}
