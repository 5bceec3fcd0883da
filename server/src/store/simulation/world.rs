//! Users, workers, the network and the clock, at random from one seed.

use std::collections::BTreeSet;
use std::sync::LazyLock;
use std::time::Duration;

use roost_api::ids::{JobId, WorkerId};
use roost_api::job::{AttemptOutcome, Cache, FailureClass, JobState, Needs};
use roost_api::time::Timestamp;
use roost_api::worker::WorkerRegistration;
use roost_solver::SOLVER_REVISION;
use roost_solver::scenario::{self, Scenario};
use sqlx::Row;
use uuid::{Builder, Uuid};

use super::model::{Answer, Job, LEASE_MS, LOST_ATTEMPTS, Model, WORKER_ATTEMPTS};
use crate::clock::Now;
use crate::queue::{Refusal, RetryPolicy, Tries, Verdict};
use crate::store::claims::Claim;
use crate::store::{Beat, NewJob, Store, StoredResult};

/// What a story's jobs simulate: few, so that some are answered from the store.
static SCENARIOS: LazyLock<Vec<(Scenario, String)>> = LazyLock::new(|| {
    let parse = |seed| scenario::parse(&format!(r#"{{"experiment": "hopper", "seed": {seed}}}"#)).unwrap();
    (0..5).map(parse).map(|scenario| (scenario.digest(), scenario)).map(|(digest, it)| (it, digest)).collect()
});

const BACKENDS: [&str; 2] = ["cpu", "gpu"];
const MEMORY: [u32; 2] = [1000, 4000];
const LEASE: Duration = Duration::from_millis(LEASE_MS as u64);

struct Worker {
    id: WorkerId,
    backend: &'static str,
    memory_mib: Option<u32>,
    draining: bool,
    last_seen: i64,
    /// Its last claim, and what it has got, as far as it knows.
    request: Option<Uuid>,
    held: Vec<(JobId, u32)>,
}

/// A report on its way, which may come late or twice.
#[derive(Clone, Copy, Debug)]
struct Report {
    job: JobId,
    attempt: u32,
    worker: WorkerId,
    outcome: AttemptOutcome,
}

pub(super) struct World<'s> {
    store: &'s Store,
    random: fastrand::Rng,
    policy: RetryPolicy,
    now: Now,
    workers: Vec<Worker>,
    reports: Vec<Report>,
    digests: Vec<(JobId, usize)>,
    model: Model,
    pub(super) story: Vec<String>,
}

impl<'s> World<'s> {
    /// An empty store and two workers.
    pub(super) async fn new(store: &'s Store, seed: u64) -> Self {
        let clear = "DELETE FROM results; DELETE FROM attempts; DELETE FROM jobs; DELETE FROM workers; DELETE FROM turns;
                     DELETE FROM documents; DELETE FROM scenarios";
        store
            .writer
            .write(move |tx| Box::pin(async move { Ok(sqlx::raw_sql(clear).execute(tx).await.map(drop)?) }))
            .await
            .unwrap();
        let mut random = fastrand::Rng::with_seed(seed);
        let tries = |attempts| Tries {
            attempts,
            first_pause: Duration::from_millis(if seed.is_multiple_of(2) { 0 } else { 3000 }),
            longest_pause: LEASE,
        };
        let start = Timestamp(random.i64(1_000_000..2_000_000));
        let mut world = Self {
            store,
            random,
            policy: RetryPolicy { worker: tries(WORKER_ATTEMPTS), lost: tries(LOST_ATTEMPTS) },
            now: Now { wall: start, lease: start },
            workers: Vec::new(),
            reports: Vec::new(),
            digests: Vec::new(),
            model: Model::default(),
            story: Vec::new(),
        };
        for backend in BACKENDS {
            world.arrive(backend, None).await;
        }
        world
    }

    /// So many steps at random, then as long as it takes to bring every job to its end.
    pub(super) async fn run(&mut self, steps: u32) {
        for _ in 0..steps {
            self.step().await;
            self.compare().await;
        }
        self.finish().await;
    }

    async fn step(&mut self) {
        match self.random.u32(0..100) {
            // Few jobs, so that much happens to each.
            0..14 if self.model.jobs.len() < 5 => self.submit().await,
            0..38 => self.claim_somehow().await,
            38..50 => self.beat().await,
            50..68 => self.end_a_run().await,
            68..76 => self.deliver_again().await,
            76..86 => self.wait(LEASE_MS / 3).await,
            86..89 => self.wait(2 * LEASE_MS).await,
            89..92 => self.cancel().await,
            92..95 => self.retry().await,
            95 => self.restart().await,
            96 => self.forget_a_worker(),
            97 => self.drain().await,
            98 => self.now.wall = Timestamp(self.now.wall.0 + self.random.i64(-1000..1000)),
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
            device: String::new(),
            threads: 1,
            memory_mib,
        };
        self.store.register_worker(worker, self.now.wall).await.unwrap();
        self.story
            .push(format!("worker {} arrives: {id}, {backend}, {memory_mib:?} MiB", self.workers.len()));
        let (last_seen, held) = (self.now.wall.0, Vec::new());
        self.workers.push(Worker {
            id,
            backend,
            memory_mib,
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
        let priority = self.random.i32(0..2);
        let job = NewJob {
            id,
            scenario: SCENARIOS[which].0.clone(),
            priority,
            labels: Default::default(),
            needs: Needs { backend: backend.map(str::to_owned), memory_mib },
            max_wall_s: max_wall_ms.map(|ms| ms as f64 / 1000.0),
            cache,
        };
        let known = self.digests.iter().filter(|(_, other)| *other == which);
        let known = known.map(|(job, _)| &self.model.jobs[job]).any(|job| job.result.is_some());
        self.story.push(format!("submit {id}: scenario {which}, {cache}, needs {backend:?} {memory_mib:?}"));
        self.store.insert_job(job, self.now.wall).await.unwrap();
        let from_store = cache == Cache::Use && known;
        self.model.jobs.insert(id, Job::new(backend, memory_mib, max_wall_ms, from_store));
        self.digests.push((id, which));
    }

    /// A claim, the repeat of one, or one whose reply is lost.
    async fn claim_somehow(&mut self) {
        let (index, max_jobs) = (self.any_worker(), self.random.u32(1..4));
        let request = match self.workers[index].request.filter(|_| self.random.u32(0..4) == 0) {
            Some(request) => request,
            None => self.uuid(),
        };
        let lost = self.random.u32(0..5) == 0;
        self.claim(index, request, max_jobs, lost).await;
    }

    async fn claim(&mut self, index: usize, request: Uuid, max_jobs: u32, lost: bool) -> usize {
        let worker = self.workers[index].id;
        let repeated = self.workers[index].request == Some(request) && self.claimed_by(worker, request).await;
        let before = self.candidates(index).await;
        self.workers[index].last_seen = self.now.wall.0;
        let claim = Claim { request_id: request, worker, max_jobs, lease: LEASE };
        let got = self.store.claim(claim, self.now).await.unwrap().unwrap();
        let got: Vec<_> = got.attempts.iter().map(|attempt| (attempt.job_id, attempt.attempt)).collect();
        self.story
            .push(format!("worker {index} claims {max_jobs}, repeated {repeated}, lost {lost}: {got:?}"));
        if repeated {
            for (job, attempt) in &got {
                let model = self.model.jobs.get_mut(job).unwrap();
                assert_eq!(
                    (*attempt, model.state),
                    (model.newest(), JobState::Running),
                    "handed out what has ended"
                );
                model.beat(*attempt, worker, self.now.lease.0);
            }
        } else {
            let (held, beside) = self.model.holding(worker);
            let alone = before.first().is_some_and(|(_, alone)| *alone);
            let expected: Vec<JobId> = match (beside, alone, held) {
                (true, ..) | (false, true, 1..) => Vec::new(),
                (false, true, 0) => before[..1].iter().map(|(id, _)| *id).collect(),
                _ => before.iter().take(max_jobs as usize).take_while(|it| !it.1).map(|it| it.0).collect(),
            };
            assert_eq!(got.iter().map(|(job, _)| *job).collect::<Vec<_>>(), expected, "of {before:?}");
            for (job, attempt) in &got {
                let model = self.model.jobs.get_mut(job).unwrap();
                model.claim(worker, self.now.lease.0);
                assert_eq!(*attempt, model.newest());
            }
        }
        let worker = &mut self.workers[index];
        worker.request = Some(request);
        if !lost {
            worker.held.extend(&got);
        }
        got.len()
    }

    async fn claimed_by(&self, worker: WorkerId, request: Uuid) -> bool {
        sqlx::query_scalar("SELECT EXISTS (SELECT 1 FROM attempts WHERE request_id = ? AND worker_id = ?)")
            .bind(request.to_string())
            .bind(worker.to_string())
            .fetch_one(&self.store.readers)
            .await
            .unwrap()
    }

    /// What the worker may have, in the order of the queue, and whether it is to run alone.
    async fn candidates(&self, index: usize) -> Vec<(JobId, bool)> {
        let me = &self.workers[index];
        if me.draining {
            return Vec::new();
        }
        let fits = |job: &Job, worker: &Worker| {
            job.backend.is_none_or(|backend| backend == worker.backend)
                && job.memory_mib.is_none_or(|needed| worker.memory_mib.is_some_and(|has| has >= needed))
        };
        let spared = |job: &Job| {
            job.failed_by(me.id)
                && self.workers.iter().any(|other| {
                    let there = other.last_seen >= self.now.wall.0 - LEASE_MS && !other.draining;
                    there && fits(job, other) && !job.failed_by(other.id)
                })
        };
        let sql = "SELECT id FROM jobs WHERE state = 'queued' AND not_before IS NULL ORDER BY priority DESC, turn, seq";
        let ids: Vec<String> = sqlx::query_scalar(sql).fetch_all(&self.store.readers).await.unwrap();
        let jobs = ids.iter().map(|id| id.parse().unwrap()).map(|id: JobId| (id, &self.model.jobs[&id]));
        jobs.filter(|(_, job)| fits(job, me) && !spared(job)).map(|(id, job)| (id, job.alone)).collect()
    }

    async fn beat(&mut self) {
        let index = self.any_worker();
        let (now, worker) = (self.now, &mut self.workers[index]);
        worker.last_seen = now.wall.0;
        let beats: Vec<_> = worker.held.iter().map(|&(job_id, attempt)| Beat { job_id, attempt }).collect();
        let until = Timestamp(now.lease.0 + LEASE_MS);
        let reply = self.store.heartbeat(worker.id, beats, now.wall, until).await.unwrap().unwrap();
        assert_eq!(reply.drain, worker.draining);
        for row in &reply.attempts {
            let expected =
                self.model.jobs.get_mut(&row.job_id).unwrap().beat(row.attempt, worker.id, now.lease.0);
            assert_eq!(row.directive, expected, "{row:?}");
        }
        self.story.push(format!("worker {index} beats for {} jobs", reply.attempts.len()));
    }

    /// A worker has something to say of an attempt, true or not, and the network carries it, loses it or loses the answer.
    async fn end_a_run(&mut self) {
        let index = self.any_worker();
        let Some((job, attempt)) = self.random.choice(self.workers[index].held.clone()) else { return };
        use AttemptOutcome::{Cancelled, Invalid, Released, Succeeded, Timeout, Unstable, Worker};
        let outcomes = [
            Succeeded, Succeeded, Succeeded, Worker, Worker, Worker, Released, Unstable, Invalid, Timeout,
            Cancelled,
        ];
        let outcome = self.random.choice(outcomes).unwrap();
        let report = Report { job, attempt, worker: self.workers[index].id, outcome };
        match self.random.u32(0..10) {
            0 => self.story.push(format!("lost on its way: {report:?}")),
            1..4 => self.deliver(report).await,
            _ => {
                self.deliver(report).await;
                self.workers[index].held.retain(|held| *held != (job, attempt));
            }
        }
        self.reports.push(report);
    }

    async fn deliver_again(&mut self) {
        let Some(mut report) = self.random.choice(self.reports.clone()) else { return };
        if self.random.u32(0..8) == 0 {
            report.worker = self.workers[self.random.usize(0..self.workers.len())].id;
        }
        self.deliver(report).await;
    }

    async fn deliver(&mut self, report: Report) {
        let Report { job, attempt, worker, outcome } = report;
        let which = self.digests.iter().find(|(id, _)| *id == job).unwrap().1;
        let result = || StoredResult::stand_in(&SCENARIOS[which].1, &format!("{job}-{attempt}"));
        let answer = match outcome {
            AttemptOutcome::Succeeded => {
                self.store.record_result(job, attempt, worker, result(), self.now.wall).await
            }
            _ => {
                let (policy, now) = (self.policy, self.now);
                self.store
                    .record_failure(job, attempt, worker, outcome, String::new(), None, policy, now)
                    .await
            }
        };
        let answer = match answer.unwrap() {
            Ok(Verdict::Record(_)) => Answer::Recorded,
            Ok(Verdict::Repeat) => Answer::Repeat,
            Err(Refusal::NoJob | Refusal::NoAttempt | Refusal::OtherScenario) => panic!("{report:?}"),
            Err(_) => Answer::Refused,
        };
        self.story.push(format!("{report:?}: {answer:?}"));
        assert_eq!(
            answer,
            self.model.jobs.get_mut(&job).unwrap().report(attempt, worker, outcome),
            "{report:?}"
        );
    }

    async fn wait(&mut self, longest_ms: i64) {
        let passed = self.random.i64(0..=longest_ms);
        let later = |then: Timestamp| Timestamp(then.0 + passed);
        self.now = Now { wall: later(self.now.wall), lease: later(self.now.lease) };
        let ended = self.store.pass_time(self.policy, self.now).await.unwrap().changes;
        self.story.push(format!("{passed} ms pass: {ended:?}"));
        let ended: BTreeSet<JobId> = ended.into_iter().map(|(id, _)| id).collect();
        assert_eq!(ended, self.model.pass_time(self.now.lease.0).into_iter().collect());
    }

    async fn cancel(&mut self) {
        let Some(job) = self.any_job() else { return };
        self.story.push(format!("cancel {job}"));
        self.store.cancel_job(job, self.now.wall).await.unwrap().unwrap();
        self.model.jobs.get_mut(&job).unwrap().cancel();
    }

    async fn retry(&mut self) {
        let Some(job) = self.any_job() else { return };
        let done = self.store.retry_job(job, None::<FailureClass>).await.unwrap().is_ok();
        self.story.push(format!("retry {job}: {done}"));
        assert_eq!(done, self.model.jobs.get_mut(&job).unwrap().retry());
    }

    async fn restart(&mut self) {
        self.story.push("the server starts anew".to_owned());
        self.store.start_afresh(Timestamp(self.now.lease.0 + LEASE_MS)).await.unwrap();
        self.model.restart(self.now.lease.0);
    }

    /// It dies: nobody hears of what it held until the leases end.
    fn forget_a_worker(&mut self) {
        let index = self.any_worker();
        self.story.push(format!("worker {index} dies"));
        self.workers[index].held.clear();
    }

    async fn drain(&mut self) {
        let index = self.any_worker();
        self.story.push(format!("worker {index} drains"));
        self.store.drain_worker(self.workers[index].id).await.unwrap().unwrap();
        self.workers[index].draining = true;
    }

    /// The store and the model must say the same of every job.
    async fn compare(&self) {
        let sql =
            "SELECT j.id, j.state, j.attempt, j.cancelling, j.alone, j.failure_class, r.attempt AS result
                   FROM jobs j LEFT JOIN results r ON r.job_id = j.id";
        let rows = sqlx::query(sql).fetch_all(&self.store.readers).await.unwrap();
        assert_eq!(rows.len(), self.model.jobs.len());
        for row in rows {
            let id: JobId = row.get::<String, _>("id").parse().unwrap();
            let job = &self.model.jobs[&id];
            let class: Option<String> = row.get("failure_class");
            let stored =
                (row.get::<String, _>("state"), row.get("attempt"), row.get("cancelling"), row.get("alone"));
            assert_eq!(stored, (job.state.to_string(), job.newest(), job.cancelling, job.alone), "{id}");
            assert_eq!(class, job.class.map(|class| class.to_string()), "{id}");
            assert_eq!(row.get::<Option<u32>, _>("result"), job.result, "{id}");
        }
    }

    /// Two workers that have all it takes come and run what is left: every job must end.
    async fn finish(&mut self) {
        let helpers = self.workers.len()..self.workers.len() + 2;
        for backend in BACKENDS {
            self.arrive(backend, Some(MEMORY[1])).await;
        }
        for _ in 0..20 * (1 + self.model.jobs.len()) {
            if self.model.jobs.values().all(|job| job.state.is_ended()) {
                return;
            }
            for index in helpers.clone() {
                let request = self.uuid();
                self.claim(index, request, 1, false).await;
                for (job, attempt) in std::mem::take(&mut self.workers[index].held) {
                    let (worker, outcome) = (self.workers[index].id, AttemptOutcome::Succeeded);
                    self.deliver(Report { job, attempt, worker, outcome }).await;
                }
            }
            self.wait(LEASE_MS).await;
            self.compare().await;
        }
        let left = self.model.jobs.iter().filter(|(_, job)| !job.state.is_ended());
        panic!("never ended: {:?}", left.map(|(id, job)| (id, job.state)).collect::<Vec<_>>());
    }
}
