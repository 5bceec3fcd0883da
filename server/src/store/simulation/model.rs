//! The predicted effect of every step, from the rules of `api.md` alone.

use std::collections::BTreeMap;

use roost_api::ids::{JobId, WorkerId};
use roost_api::job::{AttemptOutcome, FailureClass, JobState};
use roost_api::lease::Directive;

use super::fills::{Fill, FillKey, Fills};
use super::turns::Served;

/// Leases, in milliseconds.
pub(super) const LEASE_MS: i64 = 10_000;
/// Maximum attempts that end as `worker`, and as `lost`: few, so that runs reach them.
pub(super) const WORKER_ATTEMPTS: u32 = 2;
pub(super) const LOST_ATTEMPTS: u32 = 2;

/// The effect of a write.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum WriteEffect {
    Recorded,
    Repeat,
    Refused,
}

#[derive(Clone, Debug)]
struct Attempt {
    worker: WorkerId,
    outcome: Option<AttemptOutcome>,
}

#[derive(Clone, Debug)]
pub(super) struct Job {
    pub(super) priority: i32,
    pub(super) owner: &'static str,
    pub(super) backend: Option<&'static str>,
    pub(super) memory_mib: Option<u32>,
    pub(super) max_wall_ms: Option<i64>,
    pub(super) state: JobState,
    pub(super) cancelling: bool,
    pub(super) paused: bool,
    /// Attempt and simulated time of the stored checkpoint, and the backend of its worker.
    pub(super) checkpoint: Option<(u32, f64, &'static str)>,
    /// The scenarios that share its fill.
    pub(super) fill: Option<usize>,
    pub(super) alone: bool,
    pub(super) class: Option<FailureClass>,
    /// The attempt whose result is recorded; 0 for a cached result.
    pub(super) result: Option<u32>,
    attempts: Vec<Attempt>,
    attempts_before_retry: usize,
    lease_ends: i64,
    deadline: Option<i64>,
}

impl Job {
    pub(super) fn new(
        (priority, owner): (i32, &'static str),
        backend: Option<&'static str>,
        memory_mib: Option<u32>,
        max_wall_ms: Option<i64>,
        from_cache: bool,
    ) -> Self {
        Self {
            priority,
            owner,
            backend,
            memory_mib,
            max_wall_ms,
            state: if from_cache { JobState::Succeeded } else { JobState::Queued },
            cancelling: false,
            paused: false,
            checkpoint: None,
            fill: None,
            alone: false,
            class: None,
            result: from_cache.then_some(0),
            attempts: Vec::new(),
            attempts_before_retry: 0,
            lease_ends: 0,
            deadline: None,
        }
    }

    pub(super) fn newest(&self) -> u32 {
        self.attempts.len() as u32
    }

    fn count(&self, outcome: AttemptOutcome) -> u32 {
        self.attempts[self.attempts_before_retry..]
            .iter()
            .filter(|attempt| attempt.outcome == Some(outcome))
            .count() as u32
    }

    /// Whether this worker has failed it since the last retry by a user.
    pub(super) fn failed_by(&self, worker: WorkerId) -> bool {
        let failed =
            |attempt: &Attempt| attempt.worker == worker && attempt.outcome == Some(AttemptOutcome::Worker);
        self.attempts[self.attempts_before_retry..].iter().any(failed)
    }

    fn holds(&self, worker: WorkerId) -> bool {
        self.state == JobState::Running
            && self.attempts.last().is_some_and(|attempt| attempt.worker == worker)
    }

    /// The effect of a write of this attempt.
    fn fence(&self, number: u32, worker: WorkerId, outcome: AttemptOutcome) -> WriteEffect {
        let attempt = &self.attempts[number as usize - 1];
        if attempt.worker != worker {
            return WriteEffect::Refused;
        }
        match attempt.outcome {
            Some(AttemptOutcome::Lost) | None => {
                let current = number == self.newest() && !self.state.is_ended();
                if current { WriteEffect::Recorded } else { WriteEffect::Refused }
            }
            Some(before) if before == outcome => WriteEffect::Repeat,
            // An attempt without a checkpoint is recorded as released.
            Some(AttemptOutcome::Released | AttemptOutcome::Preempted)
                if matches!(outcome, AttemptOutcome::Released | AttemptOutcome::Preempted) =>
            {
                WriteEffect::Repeat
            }
            Some(_) => WriteEffect::Refused,
        }
    }

    /// Whether an attempt may write. Without a report, it counts like a lost one.
    pub(super) fn may_write(&self, number: u32, worker: WorkerId) -> bool {
        self.fence(number, worker, AttemptOutcome::Lost) == WriteEffect::Recorded
    }

    fn end(&mut self, state: JobState, class: Option<FailureClass>) {
        (self.state, self.class, self.cancelling) = (state, class, false);
        if state.is_ended() {
            (self.paused, self.checkpoint) = (false, None);
        }
    }

    /// A worker reports the end of its attempt.
    pub(super) fn report(&mut self, number: u32, worker: WorkerId, outcome: AttemptOutcome) -> WriteEffect {
        let answer = self.fence(number, worker, outcome);
        if answer != WriteEffect::Recorded {
            return answer;
        }
        let failed = |class| (JobState::Failed, Some(class));
        let (state, class) = match outcome {
            AttemptOutcome::Succeeded => {
                assert_eq!(self.result, None, "a second result");
                self.result = Some(number);
                (JobState::Succeeded, None)
            }
            AttemptOutcome::Invalid => failed(FailureClass::Invalid),
            AttemptOutcome::Unstable => failed(FailureClass::Unstable),
            AttemptOutcome::Timeout => failed(FailureClass::Timeout),
            AttemptOutcome::Cancelled | AttemptOutcome::Lost if !self.cancelling => {
                return WriteEffect::Refused;
            }
            _ if self.cancelling => (JobState::Cancelled, None),
            AttemptOutcome::Worker if self.count(outcome) + 1 >= WORKER_ATTEMPTS => {
                failed(FailureClass::Worker)
            }
            _ => (JobState::Queued, None),
        };
        self.attempts[number as usize - 1].outcome = Some(outcome);
        self.end(state, class);
        WriteEffect::Recorded
    }

    /// A result of another solver changes nothing. A repeat is answered as usual.
    pub(super) fn forge(&self, number: u32, worker: WorkerId) -> WriteEffect {
        match self.fence(number, worker, AttemptOutcome::Succeeded) {
            WriteEffect::Recorded => WriteEffect::Refused,
            other => other,
        }
    }

    /// A heartbeat.
    pub(super) fn beat(&mut self, number: u32, worker: WorkerId, now: i64) -> Directive {
        if !self.may_write(number, worker) {
            return Directive::Abandon;
        }
        if self.state == JobState::Queued {
            (self.state, self.alone) = (JobState::Running, false);
        }
        self.attempts[number as usize - 1].outcome = None;
        self.lease_ends = now + LEASE_MS;
        match (self.cancelling, self.paused) {
            (true, _) => Directive::Cancel,
            (false, true) => Directive::Preempt,
            (false, false) => Directive::Continue,
        }
    }

    fn claim(&mut self, worker: WorkerId, now: i64) {
        assert_eq!(self.state, JobState::Queued, "claimed a job that is not queued");
        assert!(!self.paused, "claimed a paused job");
        self.state = JobState::Running;
        self.attempts.push(Attempt { worker, outcome: None });
        self.lease_ends = now + LEASE_MS;
        self.deadline = self.max_wall_ms.map(|longest| self.lease_ends + longest);
    }

    /// A user pauses or resumes it.
    pub(super) fn pause(&mut self, pause: bool) {
        self.paused = pause && !self.state.is_ended();
    }

    /// A worker uploads a checkpoint of its attempt; returns whether it is recorded, or none if it is refused.
    pub(super) fn upload(
        &mut self,
        number: u32,
        worker: (WorkerId, &'static str),
        simulated_s: f64,
    ) -> Option<bool> {
        if !self.may_write(number, worker.0) {
            return None;
        }
        let is_older = self.checkpoint.is_some_and(|(by, at_s, _)| by == number && at_s > simulated_s);
        if !is_older {
            self.checkpoint = Some((number, simulated_s, worker.1));
        }
        Some(!is_older)
    }

    /// A worker cannot use the checkpoint of earlier attempts; returns whether it may say so.
    pub(super) fn discard(&mut self, number: u32, worker: WorkerId) -> bool {
        let may = self.may_write(number, worker);
        if may {
            self.checkpoint = self.checkpoint.filter(|(by, ..)| *by >= number);
        }
        may
    }

    pub(super) fn cancel(&mut self) {
        match self.state {
            JobState::Queued => self.end(JobState::Cancelled, None),
            JobState::Running => self.cancelling = true,
            _ => {}
        }
    }

    /// Returns whether it is possible.
    pub(super) fn retry(&mut self) -> bool {
        let can = matches!(self.state, JobState::Failed | JobState::Cancelled);
        if can {
            self.attempts_before_retry = self.attempts.len();
            self.end(JobState::Queued, None);
        }
        can
    }
}

/// A job that a worker can run now.
#[derive(Clone, Copy, Debug)]
pub(super) struct Waiting {
    pub(super) id: JobId,
    /// Its number; older jobs have lower numbers.
    pub(super) seq: i64,
    pub(super) alone: bool,
    /// The fill that it would compute.
    pub(super) computes: Option<FillKey>,
}

/// All jobs.
#[derive(Debug, Default)]
pub(super) struct Model {
    pub(super) jobs: BTreeMap<JobId, Job>,
    pub(super) fills: Fills,
    /// Turns of projects and owners, by priority.
    served: BTreeMap<i32, Served>,
}

impl Model {
    /// The next of these jobs, which are sorted by position: of the highest priority, then by turns.
    pub(super) fn next_jobs(&self, waiting: &[Waiting], max: usize) -> Vec<Waiting> {
        let (mut left, mut served, mut next) = (waiting.to_vec(), self.served.clone(), Vec::new());
        while next.len() < max
            && let Some(priority) = left.iter().map(|job| self.jobs[&job.id].priority).max()
        {
            let served = served.entry(priority).or_default();
            let mut firsts = BTreeMap::new();
            for (place, job) in left.iter().enumerate() {
                let Job { priority: its, owner, .. } = self.jobs[&job.id];
                if its == priority {
                    firsts.entry(owner).or_insert(place);
                }
            }
            let job = left.remove(served.next(&firsts, &left));
            left.retain(|other| job.computes.is_none() || other.computes != job.computes);
            served.serve(self.jobs[&job.id].owner);
            next.push(job);
        }
        next
    }

    /// A worker claims a job, and computes its fill.
    pub(super) fn claim(&mut self, id: JobId, worker: WorkerId, computes: Option<FillKey>, now: i64) {
        if let Some(key) = computes {
            self.fills.insert(key, Fill::Computing(id, self.jobs[&id].newest() + 1));
        }
        let job = self.jobs.get_mut(&id).expect("known");
        job.claim(worker, now);
        self.served.entry(job.priority).or_default().serve(job.owner);
    }

    /// The number of jobs that a worker holds, and whether one of them runs alone.
    pub(super) fn holding(&self, worker: WorkerId) -> (usize, bool) {
        let held: Vec<_> = self.jobs.values().filter(|job| job.holds(worker)).collect();
        (held.len(), held.iter().any(|job| job.alone))
    }

    /// Ends expired leases and deadlines; returns their jobs.
    pub(super) fn expire(&mut self, now: i64) -> Vec<JobId> {
        let mut changed = Vec::new();
        let expired: Vec<JobId> = self.running(|job| job.lease_ends <= now);
        // Found before any of them ends.
        let others: Vec<bool> = expired.iter().map(|id| self.had_others(*id)).collect();
        for (id, had_others) in expired.iter().zip(others) {
            let job = self.jobs.get_mut(id).expect("known");
            let lost = job.count(AttemptOutcome::Lost) + 1;
            job.attempts.last_mut().expect("running").outcome = Some(AttemptOutcome::Lost);
            match (job.cancelling, lost >= LOST_ATTEMPTS) {
                (true, _) => job.end(JobState::Cancelled, None),
                (false, true) => job.end(JobState::Failed, Some(FailureClass::Lost)),
                (false, false) => {
                    job.alone |= had_others;
                    job.end(JobState::Queued, None);
                }
            }
            changed.push(*id);
        }
        for id in self.running(|job| job.deadline.is_some_and(|deadline| deadline <= now)) {
            let job = self.jobs.get_mut(&id).expect("known");
            job.attempts.last_mut().expect("running").outcome = Some(AttemptOutcome::Timeout);
            match job.cancelling {
                true => job.end(JobState::Cancelled, None),
                false => job.end(JobState::Failed, Some(FailureClass::Timeout)),
            }
            changed.push(id);
        }
        changed
    }

    /// A restart renews the lease and the deadline of every running attempt.
    pub(super) fn restart(&mut self, now: i64) {
        for job in self.jobs.values_mut().filter(|job| job.state == JobState::Running) {
            job.lease_ends = now + LEASE_MS;
            job.deadline = job.max_wall_ms.map(|longest| job.lease_ends + longest);
        }
    }

    fn running(&self, matches: impl Fn(&Job) -> bool) -> Vec<JobId> {
        let running = self.jobs.iter().filter(|(_, job)| job.state == JobState::Running && matches(job));
        running.map(|(id, _)| *id).collect()
    }

    /// Whether the worker of a running job runs or has lost another job.
    fn had_others(&self, id: JobId) -> bool {
        let worker = self.jobs[&id].attempts.last().expect("running").worker;
        let others = self.jobs.iter().filter(|(other, _)| **other != id);
        others.flat_map(|(_, job)| &job.attempts).any(|attempt| {
            attempt.worker == worker && matches!(attempt.outcome, None | Some(AttemptOutcome::Lost))
        })
    }
}
