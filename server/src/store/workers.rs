//! Workers: registrations, and the jobs that they run.

use std::collections::HashMap;
use std::time::Duration;

use roost_api::ids::{JobId, WorkerId};
use roost_api::job::Needs;
use roost_api::time::Timestamp;
use roost_api::worker::{WorkerRegistration, WorkerView};

use super::columns::Columns;
use super::database::{Row, query};
use super::{Store, StoreError};
use crate::queue::Refusal;

/// Workers that were seen between these two times are online: within a lease before or after now. Times after now remain when the clock
/// is set back.
pub(super) fn online_window(now: Timestamp, lease: Duration) -> (Timestamp, Timestamp) {
    let lease_ms = i64::try_from(lease.as_millis()).unwrap_or(i64::MAX);
    (now.plus_ms(-lease_ms), now.plus_ms(lease_ms))
}

/// Every worker of a job has an attempt too, so that jobs need no check.
pub(super) const FORGET: &str = "
    DELETE FROM workers WHERE last_seen_at < ? AND NOT EXISTS (SELECT 1 FROM attempts WHERE worker_id = workers.id)";

/// An online worker.
#[derive(Clone, Debug)]
pub(crate) struct OnlineWorker {
    pub(crate) id: String,
    pub(crate) backend: String,
    pub(crate) memory_mib: Option<u32>,
    pub(crate) draining: bool,
    pub(crate) threads: u32,
    /// Jobs that it runs.
    pub(crate) jobs: u32,
}

/// Online workers.
const ONLINE: &str =
    "SELECT me.*, (SELECT count(*) FROM jobs WHERE worker_id = me.id AND state = 'running') AS jobs
    FROM workers me WHERE me.last_seen_at BETWEEN ? AND ?";

/// Whether a worker has what a group of jobs needs: the condition `fits` of claims, where there is no row of a job.
pub(crate) fn meets(worker: &OnlineWorker, needs: &Needs) -> bool {
    needs.backend.as_ref().is_none_or(|backend| *backend == worker.backend)
        && needs.memory_mib.is_none_or(|needed| worker.memory_mib.is_some_and(|has| needed <= has))
}

impl Store {
    /// Registers a worker. A repeated registration must have the same solver.
    pub(crate) async fn register_worker(
        &self,
        worker: WorkerRegistration,
        now: Timestamp,
    ) -> Result<Result<(), Refusal>, StoreError> {
        self.writer
            .write(move |tx| {
                Box::pin(async move {
                    // The solver may not change: results are checked against it, even those in an outbox.
                    let registered = query(
                        "INSERT INTO workers (id, name, solver_revision, backend, device, threads, memory_mib,
                                              registered_at, last_seen_at)
                         VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?)
                         ON CONFLICT (id) DO UPDATE SET name = excluded.name, threads = excluded.threads,
                             memory_mib = excluded.memory_mib, last_seen_at = excluded.last_seen_at
                         WHERE workers.solver_revision = excluded.solver_revision
                           AND workers.backend = excluded.backend AND workers.device = excluded.device",
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
                    Ok(if registered.rows_affected() == 0 { Err(Refusal::OtherRegistration) } else { Ok(()) })
                })
            })
            .await
    }

    /// Makes a worker drain. The reply to its next heartbeat says so.
    pub(crate) async fn drain_worker(&self, id: WorkerId) -> Result<Result<(), Refusal>, StoreError> {
        self.writer
            .write(move |tx| {
                Box::pin(async move {
                    let known = query("UPDATE workers SET draining = 1 WHERE id = ?")
                        .bind(id.to_string())
                        .execute(&mut *tx)
                        .await?;
                    Ok(if known.rows_affected() == 0 { Err(Refusal::NoWorker) } else { Ok(()) })
                })
            })
            .await
    }

    /// Removes workers last seen before `before` that have no stored attempts; returns how many.
    pub(crate) async fn forget_workers(&self, before: Timestamp) -> Result<u64, StoreError> {
        self.writer
            .write(move |tx| {
                Box::pin(
                    async move { Ok(query(FORGET).bind(before.0).execute(&mut *tx).await?.rows_affected()) },
                )
            })
            .await
    }

    /// The online workers.
    pub(crate) async fn online_workers(
        &self,
        now: Timestamp,
        lease: Duration,
    ) -> Result<Vec<OnlineWorker>, StoreError> {
        let (since, until) = online_window(now, lease);
        let rows = query(ONLINE).bind(since.0).bind(until.0).fetch_all(&self.readers).await?;
        let worker = |row: &Row| {
            Ok(OnlineWorker {
                id: row.column("id")?,
                backend: row.column("backend")?,
                memory_mib: row.number_opt("memory_mib")?,
                draining: row.column("draining")?,
                threads: row.number("threads")?,
                jobs: row.number("jobs")?,
            })
        };
        rows.iter().map(worker).collect()
    }

    /// Workers, newest first, and the one that the next page starts before.
    pub(crate) async fn workers(
        &self,
        before: Option<WorkerId>,
        limit: u32,
    ) -> Result<(Vec<WorkerView>, Option<WorkerId>), StoreError> {
        let mut running: HashMap<WorkerId, Vec<JobId>> = HashMap::new();
        let rows = query("SELECT id, worker_id FROM jobs WHERE state = 'running' ORDER BY seq")
            .fetch_all(&self.readers)
            .await?;
        for row in rows {
            running.entry(row.parsed("worker_id")?).or_default().push(row.parsed("id")?);
        }
        // Identifiers are UUIDv7, in the order in which processes started.
        let rows = query(
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
                progress: Vec::new(), // only in the server's memory
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

#[cfg(test)]
mod tests {
    use roost_api::ids::JobId;
    use uuid::Uuid;

    use super::*;
    use crate::clock::Now;
    use crate::store::Claim;
    use crate::store::database::{AssertSqlSafe, raw_sql};
    use crate::store::testing::{Place, on_both_engines};

    on_both_engines!(
        offline_workers_without_attempts_are_removed,
        a_worker_last_seen_in_the_future_is_offline,
    );

    const LEASE: Duration = Duration::from_secs(15);
    const HOUR_MS: i64 = 3_600_000;

    fn registration(worker_id: WorkerId) -> WorkerRegistration {
        WorkerRegistration {
            worker_id,
            name: "a".to_owned(),
            api_version: "1".to_owned(),
            solver_revision: 1,
            backend: "cpu".to_owned(),
            device: "a".to_owned(),
            threads: 1,
            memory_mib: None,
        }
    }

    async fn write(store: &Store, sql: String) {
        let write = store.writer.write(move |tx| {
            Box::pin(async move { Ok(raw_sql(AssertSqlSafe(sql)).execute(tx).await.map(drop)?) })
        });
        write.await.unwrap();
    }

    /// A queued job that this worker has failed once.
    async fn fail_a_job(store: &Store, worker: WorkerId) {
        let sql = format!(
            "INSERT INTO scenarios (digest, body) VALUES ('d', '{{}}');
             INSERT INTO jobs (id, scenario_digest, seed, priority, queue_position, labels, cache, submitted_at, attempt)
             VALUES ('{job}', 'd', 1, 0, 0, '{{}}', 'use', 0, 1);
             INSERT INTO attempts (job_id, number, worker_id, request_id, claimed_at, outcome, ended_at)
             VALUES ('{job}', 1, '{worker}', 'r', 0, 'worker', 0);",
            job = JobId::new()
        );
        write(store, sql).await;
    }

    async fn offline_workers_without_attempts_are_removed(place: Place) {
        let store = place.open().await;
        let (ran, idle, new) = (WorkerId::new(), WorkerId::new(), WorkerId::new());
        for (worker, seen) in [(ran, 1), (idle, 1), (new, 10)] {
            store.register_worker(registration(worker), Timestamp(seen)).await.unwrap().unwrap();
        }
        fail_a_job(&store, ran).await;
        let left = async || {
            let (workers, _) = store.workers(None, 500).await.unwrap();
            workers.into_iter().map(|worker| worker.id).collect::<std::collections::BTreeSet<_>>()
        };
        assert_eq!(store.forget_workers(Timestamp(5)).await.unwrap(), 1);
        assert_eq!(left().await, [ran, new].into(), "one has an attempt, one was seen recently");
        write(&store, "DELETE FROM attempts".to_owned()).await;
        assert_eq!(store.forget_workers(Timestamp(5)).await.unwrap(), 1);
        assert_eq!(left().await, [new].into());
        store.close().await;
    }

    async fn a_worker_last_seen_in_the_future_is_offline(place: Place) {
        let store = place.open().await;
        let (me, other, now) = (WorkerId::new(), WorkerId::new(), Timestamp(10 * HOUR_MS));
        for worker in [me, other] {
            store.register_worker(registration(worker), now).await.unwrap().unwrap();
        }
        fail_a_job(&store, me).await;
        let claim = Claim {
            request_id: Uuid::now_v7(),
            worker: me,
            max_jobs: 1,
            lease: LEASE,
            max_frames_bytes: 0,
            checkpoints: None,
            shares_fills: false,
            max_fill_bytes: 0,
        };
        let mine_at = async |wall: Timestamp| store.has_work(claim, Now { wall, lease: now }).await.unwrap();

        assert!(!mine_at(now).await, "the other worker is online and gets it");
        assert!(!mine_at(now.plus_ms(-5000)).await, "the clock was set back a little");
        assert!(
            mine_at(now.plus_ms(2 * LEASE.as_millis() as i64)).await,
            "the other worker was not seen for two leases"
        );
        assert!(
            mine_at(now.plus_ms(-HOUR_MS)).await,
            "the clock was set back, and the other worker was not seen since"
        );
        let earlier = now.plus_ms(-HOUR_MS);
        store.heartbeat(other, Vec::new(), earlier, earlier).await.unwrap().unwrap();
        assert!(!mine_at(earlier).await, "the other worker was seen since the clock was set back");
        store.close().await;
    }
}
