//! The actions of workers: claim, heartbeat, report, die and drain. The model predicts the effect of each.

use bytes::Bytes;
use futures_util::future::join_all;
use roost_api::ids::{JobId, WorkerId};
use roost_api::job::{AttemptOutcome, JobState};
use roost_api::time::Timestamp;
use roost_solver::SOLVER_REVISION;
use uuid::Uuid;

use super::super::model::{Job, LEASE_MS, Waiting, WriteEffect};
use super::{DEVICE, LEASE, Report, SCENARIOS, Worker, World};
use crate::queue::{Provenance, Refusal, Verdict};
use crate::store::claims::Claim;
use crate::store::database::{query_as, query_scalar};
use crate::store::{Beat, EncodedResult};

/// A claim.
pub(super) struct SimulatedClaim {
    pub(super) index: usize,
    pub(super) request: Uuid,
    pub(super) max_jobs: u32,
    pub(super) lost: bool,
}

impl World<'_> {
    /// Claims of one or several workers at once: new ones, repeats, and some whose reply is lost.
    pub(super) async fn claim_randomly(&mut self) {
        let mut workers = vec![self.any_worker()];
        while self.random.bool() {
            workers.push(self.any_worker());
        }
        workers.sort_unstable();
        workers.dedup();
        self.random.shuffle(&mut workers);
        let mut claims = Vec::new();
        for index in workers {
            let max_jobs = self.random.u32(1..4);
            let request = match self.workers[index].request.filter(|_| self.random.u32(0..4) == 0) {
                Some(request) => request,
                None => self.uuid(),
            };
            claims.push(SimulatedClaim { index, request, max_jobs, lost: self.random.u32(0..5) == 0 });
        }
        self.claim(&claims).await;
    }

    /// Claims of one batch get the jobs that they would get one after the other.
    pub(super) async fn claim(&mut self, claims: &[SimulatedClaim]) {
        let mut repeated = Vec::new();
        for SimulatedClaim { index, request, .. } in claims {
            let worker = &mut self.workers[*index];
            // A recent time stays.
            if !(self.now.wall.0 - LEASE_MS / 4..=self.now.wall.0).contains(&worker.last_seen) {
                worker.last_seen = self.now.wall.0;
            }
            let (id, is_known) = (worker.id, worker.request == Some(*request));
            repeated.push(is_known && self.claimed_by(id, *request).await);
        }
        let queue = self.queue().await;
        let send = |it: &SimulatedClaim| {
            let (request_id, worker) = (it.request, self.workers[it.index].id);
            let (max_jobs, lease, max_frames_bytes, checkpoints) = (it.max_jobs, LEASE, 1, None);
            let (shares_fills, max_fill_bytes) = (self.workers[it.index].shares_fills, 1);
            let claim = Claim {
                request_id,
                worker,
                max_jobs,
                lease,
                max_frames_bytes,
                checkpoints,
                shares_fills,
                max_fill_bytes,
            };
            self.store.claim(claim, self.now)
        };
        let claimed = join_all(claims.iter().map(send)).await;
        for ((claim, repeated), claimed) in claims.iter().zip(repeated).zip(claimed) {
            let claimed = claimed.unwrap().unwrap().attempts;
            for attempt in &claimed {
                // Only checkpoints of the worker's own device; these workers differ by backend alone.
                let offered = attempt.checkpoint.as_ref().map(|it| (it.attempt, it.simulated_s));
                let stored = self.model.jobs[&attempt.job_id].checkpoint;
                let backend = self.workers[claim.index].backend;
                assert_eq!(
                    offered,
                    stored.filter(|it| it.2 == backend).map(|it| (it.0, it.1)),
                    "{attempt:?}"
                );
                self.check_fill(claim.index, attempt);
            }
            let claimed: Vec<_> = claimed.iter().map(|attempt| (attempt.job_id, attempt.attempt)).collect();
            self.check_claim(claim, repeated, &queue, &claimed);
        }
    }

    /// Checks the jobs of a claim, in the state after the claims before it.
    fn check_claim(
        &mut self,
        claim: &SimulatedClaim,
        repeated: bool,
        queue: &[(JobId, i64)],
        claimed: &[(JobId, u32)],
    ) {
        let SimulatedClaim { index, request, max_jobs, lost } = *claim;
        let worker = self.workers[index].id;
        self.steps
            .push(format!("worker {index} claims {max_jobs}, repeated {repeated}, lost {lost}: {claimed:?}"));
        if repeated {
            for (job, attempt) in claimed {
                let model = self.model.jobs.get_mut(job).unwrap();
                assert_eq!(
                    (*attempt, model.state),
                    (model.newest(), JobState::Running),
                    "the attempt is not running"
                );
                model.beat(*attempt, worker, self.now.lease.0);
            }
        } else {
            let before = self.candidates(index, queue);
            let next = self.model.next_jobs(&before, max_jobs as usize);
            let (held, holds_alone) = self.model.holding(worker);
            let alone = next.first().is_some_and(|first| first.alone);
            let expected: Vec<JobId> = match (holds_alone, alone, held) {
                (true, ..) | (false, true, 1..) => Vec::new(),
                (false, true, 0) => next[..1].iter().map(|first| first.id).collect(),
                _ => next.iter().take_while(|next| !next.alone).map(|next| next.id).collect(),
            };
            assert_eq!(claimed.iter().map(|(job, _)| *job).collect::<Vec<_>>(), expected, "of {before:?}");
            for ((job, attempt), next) in claimed.iter().zip(&next) {
                self.model.claim(*job, worker, next.computes, self.now.lease.0);
                assert_eq!(*attempt, self.model.jobs[job].newest());
            }
        }
        let worker = &mut self.workers[index];
        worker.request = Some(request);
        if !lost {
            worker.held.extend(claimed);
        }
    }

    async fn claimed_by(&self, worker: WorkerId, request: Uuid) -> bool {
        query_scalar("SELECT EXISTS (SELECT 1 FROM attempts WHERE request_id = ? AND worker_id = ?)")
            .bind(request.to_string())
            .bind(worker.to_string())
            .fetch_one(&self.store.readers)
            .await
            .unwrap()
    }

    /// Claimable jobs by position, with their numbers. The model knows none of a sweep that is being submitted.
    async fn queue(&self) -> Vec<(JobId, i64)> {
        let sql = "SELECT id, seq FROM jobs WHERE state = 'queued' AND not_before IS NULL AND paused = 0 ORDER BY queue_position, seq";
        let rows: Vec<(String, i64)> = query_as(sql).fetch_all(&self.store.readers).await.unwrap();
        let rows = rows.iter().map(|(id, seq)| (id.parse().unwrap(), *seq));
        rows.filter(|(id, _)| self.model.jobs.contains_key(id)).collect()
    }

    /// The queued jobs that the worker can run now.
    fn candidates(&self, index: usize, queue: &[(JobId, i64)]) -> Vec<Waiting> {
        let me = &self.workers[index];
        if me.draining {
            return Vec::new();
        }
        let fits = |job: &Job, worker: &Worker| {
            job.backend.is_none_or(|backend| backend == worker.backend)
                && job.memory_mib.is_none_or(|needed| worker.memory_mib.is_some_and(|has| has >= needed))
        };
        let left_to_another = |job: &Job| {
            job.failed_by(me.id)
                && self.workers.iter().any(|other| {
                    let is_online = (other.last_seen - self.now.wall.0).abs() <= LEASE_MS;
                    is_online && !other.draining && fits(job, other) && !job.failed_by(other.id)
                })
        };
        let jobs = queue.iter().map(|(id, seq)| (*id, *seq, &self.model.jobs[id]));
        let jobs = jobs
            .filter(|(_, _, job)| job.state == JobState::Queued && fits(job, me) && !left_to_another(job))
            .filter(|(_, _, job)| !me.shares_fills || !self.model.waits(job, me.backend));
        let waiting = |(id, seq, job): (JobId, i64, &Job)| {
            let computes = self.model.computes(job, me.backend).filter(|_| me.shares_fills);
            Waiting { id, seq, alone: job.alone, computes }
        };
        jobs.map(waiting).collect()
    }

    pub(super) async fn beat(&mut self) {
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
        self.steps.push(format!("worker {index} beats for {} jobs", reply.attempts.len()));
    }

    /// A worker reports the end of an attempt, possibly a false one. The network may lose the report or the answer.
    pub(super) async fn report_an_end(&mut self) {
        let index = self.any_worker();
        let Some((job, attempt)) = self.random.choice(self.workers[index].held.clone()) else { return };
        use AttemptOutcome::{Cancelled, Invalid, Preempted, Released, Succeeded, Timeout, Unstable, Worker};
        let outcomes = [
            Succeeded, Succeeded, Succeeded, Worker, Worker, Worker, Released, Preempted, Unstable, Invalid,
            Timeout, Cancelled,
        ];
        let outcome = self.random.choice(outcomes).unwrap();
        // Some results name another solver than their worker registered.
        let forged = outcome == Succeeded && self.random.u32(0..8) == 0;
        let report = Report { job, attempt, worker: self.workers[index].id, outcome, forged };
        match self.random.u32(0..10) {
            0 => self.steps.push(format!("lost: {report:?}")),
            1..4 => self.deliver(report).await,
            _ => {
                self.deliver(report).await;
                self.workers[index].held.retain(|held| *held != (job, attempt));
            }
        }
        self.reports.push(report);
    }

    /// A worker, at times a stale one, uploads a checkpoint.
    pub(super) async fn upload(&mut self) {
        let index = self.any_worker();
        let held = self.workers[index].held.clone();
        let known: Vec<_> =
            held.into_iter().chain(self.reports.iter().map(|it| (it.job, it.attempt))).collect();
        let Some((job, attempt)) = self.random.choice(known) else { return };
        let (id, backend) = (self.workers[index].id, self.workers[index].backend);
        let simulated_s = f64::from(self.random.u32(0..4));
        let bytes = Bytes::from(format!("{job} {attempt} {simulated_s}"));
        let stream = futures_util::stream::iter([Ok::<_, std::io::Error>(bytes)]);
        let staged = self.store.stage(stream, 1000).await.expect("within the limit");
        let recorded = self.store.record_checkpoint(job, attempt, id, staged, simulated_s).await.unwrap();
        self.steps.push(format!("worker {index} uploads {simulated_s} s of {job} {attempt}: {recorded:?}"));
        let expected = self.model.jobs.get_mut(&job).unwrap().upload(attempt, (id, backend), simulated_s);
        assert_eq!(recorded.ok(), expected);
    }

    /// A worker cannot use a checkpoint.
    pub(super) async fn discard(&mut self) {
        let index = self.any_worker();
        let Some((job, attempt)) = self.random.choice(self.workers[index].held.clone()) else { return };
        let id = self.workers[index].id;
        let done = self.store.discard_checkpoint(job, attempt, id).await.unwrap().is_ok();
        self.steps.push(format!("worker {index} discards the checkpoint of {job}: {done}"));
        assert_eq!(done, self.model.jobs.get_mut(&job).unwrap().discard(attempt, id));
    }

    pub(super) async fn deliver_again(&mut self) {
        let Some(mut report) = self.random.choice(self.reports.clone()) else { return };
        if self.random.u32(0..8) == 0 {
            report.worker = self.workers[self.random.usize(0..self.workers.len())].id;
        }
        self.deliver(report).await;
    }

    pub(super) async fn deliver(&mut self, report: Report) {
        self.deliver_all(&[report]).await;
    }

    /// Several results in one batch, some of them twice.
    pub(super) async fn deliver_batch(&mut self) {
        let succeeded = |report: &Report| report.outcome == AttemptOutcome::Succeeded;
        let mut reports: Vec<_> = self.reports.iter().copied().filter(succeeded).collect();
        for worker in &self.workers {
            let (id, outcome) = (worker.id, AttemptOutcome::Succeeded);
            reports.extend(worker.held.iter().map(|&(job, attempt)| Report {
                job,
                attempt,
                worker: id,
                outcome,
                forged: false,
            }));
        }
        self.random.shuffle(&mut reports);
        reports.truncate(self.random.usize(1..5));
        self.deliver_all(&reports).await;
        self.reports.extend(reports);
    }

    /// Sends several results, or one report of any kind.
    async fn deliver_all(&mut self, reports: &[Report]) {
        let result = |report: &Report| {
            let which = self.digests.iter().find(|(id, _)| *id == report.job).unwrap().1;
            let worker = self.workers.iter().find(|worker| worker.id == report.worker).unwrap();
            let provenance = Provenance {
                scenario: SCENARIOS[which].1.clone(),
                revision: SOLVER_REVISION + u32::from(report.forged),
                backend: worker.backend.to_owned(),
                device: DEVICE.to_owned(),
            };
            EncodedResult::sample(provenance, &format!("{}-{}", report.job, report.attempt))
        };
        let answers = join_all(reports.iter().map(async |report| {
            let Report { job, attempt, worker, outcome, .. } = *report;
            if outcome == AttemptOutcome::Succeeded {
                let result = (result(report), None);
                return self.store.record_result(job, attempt, worker, result, self.now.wall).await;
            }
            let (policy, now) = (self.policy, self.now);
            self.store.record_failure(job, attempt, worker, outcome, String::new(), None, policy, now).await
        }));
        for (report, answer) in reports.iter().zip(answers.await) {
            let Report { job, attempt, worker, outcome, forged } = *report;
            let answer = match answer.unwrap() {
                Ok(Verdict::Record(_)) => WriteEffect::Recorded,
                Ok(Verdict::Repeat) => WriteEffect::Repeat,
                Err(Refusal::NoJob | Refusal::NoAttempt | Refusal::OtherScenario) => panic!("{report:?}"),
                Err(_) => WriteEffect::Refused,
            };
            self.steps.push(format!("{report:?}: {answer:?}"));
            let model = self.model.jobs.get_mut(&job).unwrap();
            let expected = match forged {
                true => model.forge(attempt, worker),
                false => model.report(attempt, worker, outcome),
            };
            assert_eq!(answer, expected, "{report:?}");
        }
    }

    /// A worker dies: its leases expire.
    pub(super) fn kill_a_worker(&mut self) {
        let index = self.any_worker();
        self.steps.push(format!("worker {index} dies"));
        self.workers[index].held.clear();
    }

    pub(super) async fn drain(&mut self) {
        let index = self.any_worker();
        self.steps.push(format!("worker {index} drains"));
        self.store.drain_worker(self.workers[index].id).await.unwrap().unwrap();
        self.workers[index].draining = true;
    }
}
