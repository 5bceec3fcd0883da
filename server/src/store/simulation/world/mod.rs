//! Users, workers, the network and the clock, at random from one seed. [`workers`] has the actions of workers, [`fills`] those with fills,
//! [`sweeps`] large sweeps.

mod fills;
mod sweeps;
mod workers;

use std::collections::BTreeSet;
use std::sync::LazyLock;
use std::time::Duration;

use roost_api::ids::{JobId, WorkerId};
use roost_api::job::{AttemptOutcome, Cache, FailureClass, Needs};
use roost_api::time::Timestamp;
use roost_api::worker::WorkerRegistration;
use roost_solver::SOLVER_REVISION;
use roost_solver::scenario::{self, Scenario};
use serde_json::json;
use sweeps::SimulatedSubmission;
use uuid::{Builder, Uuid};
use workers::SimulatedClaim;

use super::model::{Job, LEASE_MS, LOST_ATTEMPTS, Model, WORKER_ATTEMPTS};
use super::turns::{OWNERS, SHARES};
use crate::clock::Now;
use crate::queue::{RetryLimit, RetryPolicy};
use crate::store::database::{Engine, query, query_scalar, raw_sql};
use crate::store::testing::DANGLING;
use crate::store::{NewJob, Store, leader_tables};

/// Scenarios of the jobs: few, so that some results come from the cache. The first three have one fill, the others another.
static SCENARIOS: LazyLock<Vec<(Scenario, String)>> = LazyLock::new(|| {
    let parse = |which| {
        let (seed, gate_m) = (fill_of(which), 0.05 + 0.01 * which as f64);
        let scenario = json!({"experiment": "hopper", "seed": seed, "equipment": {"gate_opening_m": gate_m}});
        scenario::from_value(&scenario).unwrap()
    };
    (0..5).map(parse).map(|scenario| (scenario.digest(), scenario)).map(|(digest, it)| (it, digest)).collect()
});

/// The fill of a scenario.
fn fill_of(which: usize) -> usize {
    which / 3
}

/// Number of projects whose use is not the sum over their ended attempts.
const MISCOUNTED: &str = "SELECT count(*) FROM projects p WHERE p.used_core_ms <> (
    SELECT coalesce(sum(a.core_ms), 0) FROM attempts a JOIN jobs j ON j.id = a.job_id JOIN owners o ON o.id = j.owner
    WHERE o.project = p.id) OR EXISTS (SELECT 1 FROM attempts WHERE (core_ms IS NULL) <> (ended_at IS NULL))";

const DEVICE: &str = "simulated";
const BACKENDS: [&str; 2] = ["cpu", "gpu"];
const MEMORY: [u32; 2] = [1000, 4000];
const LEASE: Duration = Duration::from_millis(LEASE_MS as u64);

struct Worker {
    id: WorkerId,
    backend: &'static str,
    memory_mib: Option<u32>,
    shares_fills: bool,
    draining: bool,
    last_seen: i64,
    /// Its last claim, and the attempts that it knows of.
    request: Option<Uuid>,
    held: Vec<(JobId, u32)>,
}

/// A report, which may arrive late or twice.
#[derive(Clone, Copy, Debug)]
struct Report {
    job: JobId,
    attempt: u32,
    worker: WorkerId,
    outcome: AttemptOutcome,
    /// Whether its result names another solver than the worker's.
    forged: bool,
}

pub(super) struct World<'s> {
    store: &'s Store,
    random: fastrand::Rng,
    policy: RetryPolicy,
    now: Now,
    workers: Vec<Worker>,
    reports: Vec<Report>,
    digests: Vec<(JobId, usize)>,
    /// A sweep that is being submitted.
    submission: Option<SimulatedSubmission>,
    model: Model,
    pub(super) steps: Vec<String>,
}

impl<'s> World<'s> {
    /// An empty store and two workers.
    pub(super) async fn new(store: &'s Store, seed: u64) -> Self {
        let clear = "DELETE FROM fills; DELETE FROM checkpoints; DELETE FROM results; DELETE FROM attempts; DELETE FROM jobs; DELETE FROM design_points;
                     DELETE FROM sweeps; DELETE FROM workers; DELETE FROM fair_share;
                     DELETE FROM project_rounds; UPDATE projects SET used_core_ms = 0; DELETE FROM documents; DELETE FROM scenarios";
        let make_project =
            "INSERT INTO projects (id, name, share) VALUES (1, 'simulated', ?) ON CONFLICT (id) DO NOTHING";
        let make_token = "INSERT INTO tokens (id, name, hash, scopes, created_at, project) VALUES (?1, '', ?1, '[]', 0, ?2)
                          ON CONFLICT (id) DO NOTHING";
        let start = store.writer.write(move |tx| {
            Box::pin(async move {
                raw_sql(clear).execute(&mut *tx).await?;
                query(make_project).bind(SHARES[1]).execute(&mut *tx).await?;
                for (token, project) in OWNERS {
                    query(make_token).bind(token).bind(project).execute(&mut *tx).await?;
                }
                Ok(())
            })
        });
        start.await.unwrap();
        let mut random = fastrand::Rng::with_seed(seed);
        let tries = |attempts| RetryLimit {
            attempts,
            first_pause: Duration::from_millis(if seed.is_multiple_of(2) { 0 } else { 3000 }),
            max_pause: LEASE,
        };
        let start = Timestamp(random.i64(1_000_000_000..2_000_000_000));
        let mut world = Self {
            store,
            random,
            policy: RetryPolicy { worker: tries(WORKER_ATTEMPTS), lost: tries(LOST_ATTEMPTS) },
            now: Now { wall: start, lease: start },
            workers: Vec::new(),
            reports: Vec::new(),
            digests: Vec::new(),
            submission: None,
            model: Model::default(),
            steps: Vec::new(),
        };
        for backend in BACKENDS {
            world.arrive(backend, None).await;
        }
        world
    }

    /// Random steps, and then as many as it takes to end every job. A verbose run compares after every step with PostgreSQL too.
    pub(super) async fn run(&mut self, steps: u32, is_verbose: bool) {
        // Queries to PostgreSQL go to another process, and cost most of the time of a run.
        let compare_every =
            if self.store.readers.engine() == Engine::Postgres && !is_verbose { 4 } else { 1 };
        for step in 1..=steps {
            self.step().await;
            if step.is_multiple_of(compare_every) || step == steps {
                self.compare().await;
            }
        }
        self.finish().await;
    }

    async fn step(&mut self) {
        match self.random.u32(0..100) {
            // Few jobs, so that each has many events.
            0..10 if self.model.jobs.len() < 5 => self.submit().await,
            10..14 if self.model.jobs.len() < 5 || self.submission.is_some() => self.submit_slice().await,
            0..38 => self.claim_randomly().await,
            38..50 => self.beat().await,
            50..68 => self.report_an_end().await,
            68..73 => self.deliver_again().await,
            73 => self.deliver_batch().await,
            74 => self.upload_fill().await,
            75..78 => self.upload().await,
            78 => self.change_fills().await,
            79..82 => self.pause_or_resume().await,
            82..86 => self.wait(LEASE_MS / 3).await,
            86..88 => self.wait(2 * LEASE_MS).await,
            88 => self.discard().await,
            89..92 => self.cancel().await,
            92..95 => self.retry().await,
            95 => self.restart().await,
            96 => self.kill_a_worker(),
            97 => self.drain().await,
            98 => self.set_clock(),
            _ => {
                let (backend, memory) = (self.random.choice(BACKENDS).unwrap(), self.random.choice(MEMORY));
                self.arrive(backend, memory).await;
            }
        }
    }

    fn uuid(&mut self) -> Uuid {
        Builder::from_random_bytes(self.random.u128(..).to_le_bytes()).into_uuid()
    }

    fn any_worker(&mut self) -> usize {
        self.random.usize(0..self.workers.len())
    }

    fn any_job(&mut self) -> Option<JobId> {
        self.random.choice(self.model.jobs.keys().copied().collect::<Vec<_>>())
    }

    async fn arrive(&mut self, backend: &'static str, memory_mib: Option<u32>) {
        let id = WorkerId(self.uuid());
        let worker = WorkerRegistration {
            worker_id: id,
            name: "simulated".to_owned(),
            api_version: "v1".to_owned(),
            solver_revision: SOLVER_REVISION,
            backend: backend.to_owned(),
            device: DEVICE.to_owned(),
            threads: 1,
            memory_mib,
        };
        self.store.register_worker(worker, self.now.wall).await.unwrap().unwrap();
        self.steps
            .push(format!("worker {} arrives: {id}, {backend}, {memory_mib:?} MiB", self.workers.len()));
        let (last_seen, held) = (self.now.wall.0, Vec::new());
        let shares_fills = self.random.u32(0..5) > 0;
        self.workers.push(Worker {
            id,
            backend,
            memory_mib,
            shares_fills,
            draining: false,
            last_seen,
            request: None,
            held,
        });
    }

    async fn submit(&mut self) {
        let (id, which) = (JobId(self.uuid()), self.random.usize(0..SCENARIOS.len()));
        let cache = if self.random.bool() { Cache::Use } else { Cache::Bypass };
        let maybe = |random: &mut fastrand::Rng| random.u32(0..4) == 0;
        let backend = maybe(&mut self.random).then(|| self.random.choice(BACKENDS).unwrap());
        let memory_mib = maybe(&mut self.random).then(|| self.random.choice(MEMORY).unwrap());
        let max_wall_ms = maybe(&mut self.random).then_some(LEASE_MS);
        let (priority, (owner, _)) = (self.random.i32(0..2), self.random.choice(OWNERS).unwrap());
        let shared_fill = !maybe(&mut self.random);
        let job = NewJob {
            id,
            token: owner.to_owned(),
            scenario: SCENARIOS[which].0.clone(),
            priority,
            labels: Default::default(),
            needs: Needs { backend: backend.map(str::to_owned), memory_mib },
            max_wall_s: max_wall_ms.map(|ms| ms as f64 / 1000.0),
            frame_interval_s: None,
            cache,
            shared_fill,
        };
        let known = self.digests.iter().filter(|(_, other)| *other == which);
        let known = known.map(|(job, _)| &self.model.jobs[job]).any(|job| job.result.is_some());
        self.steps.push(format!("submit {id} of '{owner}' at {priority}: scenario {which}, {cache}, shared fill {shared_fill}, needs {backend:?} {memory_mib:?}"));
        self.store.insert_job(job, self.now.wall).await.unwrap();
        let from_cache = cache == Cache::Use && known;
        let mut job = Job::new((priority, owner), backend, memory_mib, max_wall_ms, from_cache);
        job.fill = shared_fill.then_some(fill_of(which));
        self.model.jobs.insert(id, job);
        self.digests.push((id, which));
    }

    async fn wait(&mut self, max_ms: i64) {
        let passed = self.random.i64(0..=max_ms);
        let later = |then: Timestamp| Timestamp(then.0 + passed);
        self.now = Now { wall: later(self.now.wall), lease: later(self.now.lease) };
        let ended = self.store.expire(self.policy, self.now).await.unwrap().changes;
        self.steps.push(format!("{passed} ms pass: {ended:?}"));
        let ended: BTreeSet<JobId> = ended.into_iter().map(|(id, _)| id).collect();
        assert_eq!(ended, self.model.expire(self.now.lease.0).into_iter().collect());
    }

    async fn cancel(&mut self) {
        let Some(job) = self.any_job() else { return };
        self.steps.push(format!("cancel {job}"));
        self.store.cancel_job(job, self.now.wall).await.unwrap().unwrap();
        self.model.jobs.get_mut(&job).unwrap().cancel();
    }

    async fn pause_or_resume(&mut self) {
        let Some(job) = self.any_job() else { return };
        let pause = self.random.bool();
        self.steps.push(format!("pause {job}: {pause}"));
        self.store.pause_job(job, pause).await.unwrap().unwrap();
        self.model.jobs.get_mut(&job).unwrap().pause(pause);
    }

    async fn retry(&mut self) {
        let Some(job) = self.any_job() else { return };
        let done = self.store.retry_job(job, None::<FailureClass>).await.unwrap().is_ok();
        self.steps.push(format!("retry {job}: {done}"));
        assert_eq!(done, self.model.jobs.get_mut(&job).unwrap().retry());
    }

    /// By a second, or by an hour.
    fn set_clock(&mut self) {
        let farthest = if self.random.bool() { 1000 } else { 3_600_000 };
        self.now.wall = Timestamp(self.now.wall.0 + self.random.i64(-farthest..farthest));
        self.steps.push(format!("the clock is set to {}", self.now.wall.0));
    }

    /// Leases then count from the new time.
    async fn restart(&mut self) {
        self.now.lease = self.now.wall;
        self.steps.push("the server restarts".to_owned());
        self.store.renew_all_leases(Timestamp(self.now.lease.0 + LEASE_MS)).await.unwrap();
        self.model.restart(self.now.lease.0);
        self.interrupt_submission().await;
    }

    /// Compares the store with the model, which has no job of a sweep that is being submitted.
    async fn compare(&self) {
        let sql =
            "SELECT j.id, j.state, j.attempt, j.cancelling, j.paused, j.alone, j.failure_class, r.attempt AS result,
                    c.attempt AS by, c.simulated_s, c.backend
                   FROM jobs j LEFT JOIN results r ON r.job_id = j.id LEFT JOIN checkpoints c ON c.job_id = j.id
                   WHERE j.sweep_id IS NULL OR j.sweep_id IN (SELECT id FROM sweeps WHERE state = 'ready')";
        let rows = query(sql).fetch_all(&self.store.readers).await.unwrap();
        assert_eq!(rows.len(), self.model.jobs.len());
        for row in rows {
            let id: JobId = row.get::<String>("id").parse().unwrap();
            let job = &self.model.jobs[&id];
            let class: Option<String> = row.get("failure_class");
            let stored =
                (row.get::<String>("state"), row.get("attempt"), row.get("cancelling"), row.get("alone"));
            assert_eq!(stored, (job.state.to_string(), job.newest(), job.cancelling, job.alone), "{id}");
            let stored = row
                .get::<Option<u32>>("by")
                .map(|by| (by, row.get("simulated_s"), row.get::<String>("backend")));
            let expected =
                job.checkpoint.map(|(by, simulated_s, backend)| (by, simulated_s, backend.to_owned()));
            assert_eq!((row.get::<bool>("paused"), stored), (job.paused, expected), "{id}");
            assert_eq!(class, job.class.map(|class| class.to_string()), "{id}");
            assert_eq!(row.get::<Option<u32>>("result"), job.result, "{id}");
        }
        self.compare_fills().await;
        let differing: i64 = query_scalar(MISCOUNTED).fetch_one(&self.store.readers).await.unwrap();
        assert_eq!(differing, 0, "projects whose use is not the sum over their attempts");
        let dangling: i64 = query_scalar(DANGLING).fetch_one(&self.store.readers).await.unwrap();
        assert_eq!(dangling, 0, "rows that refer to a missing one");
        if self.store.readers.engine() == Engine::Postgres {
            let wrong = self.store.writer.write(|tx| {
                Box::pin(async move { Ok(query_scalar::<i64>(leader_tables::WRONG).fetch_one(tx).await?) })
            });
            assert_eq!(wrong.await.unwrap(), 0, "rows that the temporary tables lack or have too much");
        }
    }

    /// Two capable workers register and run the remaining jobs: every job must end.
    async fn finish(&mut self) {
        while self.submission.is_some() {
            self.submit_slice().await;
        }
        let jobs: Vec<JobId> = self.model.jobs.keys().copied().collect();
        for job in jobs {
            self.store.pause_job(job, false).await.unwrap().unwrap();
            self.model.jobs.get_mut(&job).unwrap().pause(false);
        }
        let finishers = self.workers.len()..self.workers.len() + 2;
        for backend in BACKENDS {
            self.arrive(backend, Some(MEMORY[1])).await;
        }
        for _ in 0..20 * (1 + self.model.jobs.len()) {
            if self.model.jobs.values().all(|job| job.state.is_ended()) {
                return;
            }
            for index in finishers.clone() {
                let request = self.uuid();
                self.claim(&[SimulatedClaim { index, request, max_jobs: 1, lost: false }]).await;
                for (job, attempt) in std::mem::take(&mut self.workers[index].held) {
                    let (worker, outcome) = (self.workers[index].id, AttemptOutcome::Succeeded);
                    self.deliver(Report { job, attempt, worker, outcome, forged: false }).await;
                }
            }
            self.wait(LEASE_MS).await;
            self.compare().await;
        }
        let left = self.model.jobs.iter().filter(|(_, job)| !job.state.is_ended());
        panic!("never ended: {:?}", left.map(|(id, job)| (id, job.state)).collect::<Vec<_>>());
    }
}
