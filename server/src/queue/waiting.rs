//! Why a queued job waits: the first reason that applies, from what claims see of it.
//!
//! | reason | condition |
//! |---|---|
//! | `paused`, `retry_pause`, `budget_used` | no claim looks at the job |
//! | `no_worker` | no online worker takes jobs |
//! | `no_fitting_worker` | no such worker has what the job needs |
//! | `waiting_for_fill` | each worker that may take it would pass over it, because a running attempt computes its fill |
//! | `needs_idle_worker` | it runs alone, and each of these workers runs another job |
//! | `behind` | other jobs come first |
//! | `workers_busy` | it is next, and each of these workers has all its slots taken |
//! | `next` | it is next, and one of them has a free slot |
//!
//! The store asks the conditions of a claim, `fits` and the others of [`WorkerSight`], in the SQL text that claims use.

use roost_api::forecast::WaitReason;
use roost_api::ids::JobId;
use roost_api::job::{AttemptOutcome, Needs};
use roost_api::time::Timestamp;

/// A queued job.
#[derive(Clone, Debug)]
pub(crate) struct QueuedJob {
    /// Whether a user has paused it.
    pub paused: bool,
    /// The end of its pause after a failure.
    pub retry_at: Option<Timestamp>,
    /// The budget of its project, if it is used up.
    pub spent: Option<SpentBudget>,
    /// Number, outcome and message of its newest attempt.
    pub newest: Option<(u32, AttemptOutcome, String)>,
    /// Whether it runs alone.
    pub alone: bool,
    /// Its requirements.
    pub needs: Needs,
}

/// The budget of a project that has used it up.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct SpentBudget {
    /// The name of the project.
    pub project: String,
    /// Core-hours that its ended attempts have used.
    pub used_core_hours: f64,
    /// Its budget, in core-hours.
    pub budget_core_hours: f64,
}

impl SpentBudget {
    /// In words, with the command that raises the budget.
    fn in_words(&self) -> String {
        let Self { project, used_core_hours, budget_core_hours } = self;
        format!(
            "project {project} has used {used_core_hours:.1} of {} core-hours; raise it with `roost project set {project} --budget-core-hours N`",
            (budget_core_hours * 1000.0).round() / 1000.0
        )
    }
}

/// An online worker, and what its next claim would see of the job.
#[derive(Clone, Debug)]
pub(crate) struct WorkerSight {
    /// Its name.
    pub name: String,
    /// Its backend.
    pub backend: String,
    /// Memory of its device, in MiB.
    pub memory_mib: Option<u32>,
    /// Whether it claims no more jobs.
    pub draining: bool,
    /// Whether it has what the job needs.
    pub fits: bool,
    /// Whether it has failed the job, and leaves it to another worker.
    pub leaves_it: bool,
    /// The job whose running attempt computes the fill, for which this worker passes over the job.
    pub fill_job: Option<JobId>,
    /// Jobs that it runs.
    pub jobs: u32,
    /// Whether one of them runs alone.
    pub alone: bool,
    /// Jobs that it runs at the same time.
    pub slots: u32,
}

impl WorkerSight {
    /// Whether a claim of this worker can get the job at all.
    fn may_take(&self) -> bool {
        self.fits && !self.draining && !self.leaves_it
    }

    fn is_full(&self) -> bool {
        self.alone || self.jobs >= self.slots
    }
}

/// Jobs that come before a job.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct JobsBefore {
    /// Of a higher priority.
    pub higher: u64,
    /// Of the same priority.
    pub same: u64,
    /// Whether they were counted one by one.
    pub is_exact: bool,
}

impl JobsBefore {
    /// All of them.
    pub(crate) fn total(self) -> u64 {
        self.higher + self.same
    }
}

/// Why a job waits.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct WaitCause {
    /// The reason.
    pub reason: WaitReason,
    /// The reason in words.
    pub detail: String,
    /// The job that computes the fill.
    pub fill_job: Option<JobId>,
}

/// Why a queued job waits, among the workers that are online.
pub(crate) fn why_waiting(job: &QueuedJob, workers: &[WorkerSight], before: JobsBefore) -> WaitCause {
    let cause = |reason, detail: String| WaitCause { reason, detail, fill_job: None };
    if job.paused {
        return cause(WaitReason::Paused, "a user has paused it".to_owned());
    }
    if let Some(retry_at) = job.retry_at {
        return cause(WaitReason::RetryPause, pause(job, retry_at));
    }
    if let Some(spent) = &job.spent {
        return cause(WaitReason::BudgetUsed, spent.in_words());
    }
    let active: Vec<_> = workers.iter().filter(|worker| !worker.draining).collect();
    if active.is_empty() {
        let detail = match workers.len() {
            0 => "no worker is online".to_owned(),
            count => format!("{} online, and none takes further jobs", are(count, "worker")),
        };
        return cause(WaitReason::NoWorker, detail);
    }
    if !active.iter().any(|worker| worker.fits) {
        return cause(WaitReason::NoFittingWorker, misfit(&job.needs, &active));
    }
    let takers: Vec<_> = active.into_iter().filter(|worker| worker.may_take()).collect();
    let fill_job = takers.first().and_then(|worker| worker.fill_job);
    if let Some(computing) = fill_job.filter(|_| takers.iter().all(|worker| worker.fill_job.is_some())) {
        let detail = format!("job {computing} computes its filled state");
        return WaitCause { reason: WaitReason::WaitingForFill, detail, fill_job };
    }
    let elsewhere = match workers.iter().find(|worker| worker.leaves_it) {
        Some(worker) => format!("; the worker {} has failed it, and leaves it to another one", worker.name),
        None => String::new(),
    };
    let (jobs, slots) =
        takers.iter().fold((0, 0), |(jobs, slots), worker| (jobs + worker.jobs, slots + worker.slots));
    let fitting = counted(takers.len() as u64, "fitting worker");
    if job.alone && takers.iter().all(|worker| worker.jobs > 0) {
        let detail = format!(
            "it runs alone, since it was lost together with other jobs, and no fitting worker is idle{elsewhere}"
        );
        return cause(WaitReason::NeedsIdleWorker, detail);
    }
    if before.total() > 0 {
        return cause(WaitReason::Behind, format!("{}{elsewhere}", before.in_words()));
    }
    if takers.iter().all(|worker| worker.is_full()) {
        let detail = format!(
            "it is next; {fitting} with {} {} {}{elsewhere}",
            counted(slots.into(), "slot"),
            if takers.len() == 1 { "runs" } else { "run" },
            counted(jobs.into(), "job")
        );
        return cause(WaitReason::WorkersBusy, detail);
    }
    cause(
        WaitReason::Next,
        format!(
            "it is next, and {fitting} {} a free slot{elsewhere}",
            if takers.len() == 1 { "has" } else { "have" }
        ),
    )
}

impl JobsBefore {
    /// In words, such as `behind 340 jobs, 12 of them of higher priority`.
    pub(crate) fn in_words(self) -> String {
        let about = if self.is_exact { "" } else { "about " };
        let higher = match self.higher {
            0 => String::new(),
            all if self.same == 0 && all == 1 => " of higher priority".to_owned(),
            _ if self.same == 0 => ", all of higher priority".to_owned(),
            some => format!(", {some} of them of higher priority"),
        };
        format!("behind {about}{}{higher}", counted(self.total(), "job"))
    }
}

/// The pause after a failure, in words.
fn pause(job: &QueuedJob, retry_at: Timestamp) -> String {
    let failure = match &job.newest {
        Some((number, outcome, message)) if message.is_empty() => {
            format!("attempt {number} ended as {outcome}")
        }
        Some((number, outcome, message)) => format!("attempt {number} ended as {outcome} ({message})"),
        None => "an attempt has failed".to_owned(),
    };
    format!("{failure}; the next one starts at {retry_at} at the earliest")
}

/// The need that no worker meets, and the best worker.
fn misfit(needs: &Needs, workers: &[&WorkerSight]) -> String {
    let of_backend =
        |worker: &&&WorkerSight| needs.backend.as_ref().is_none_or(|backend| *backend == worker.backend);
    let mut backends: Vec<_> = workers.iter().map(|worker| worker.backend.as_str()).collect();
    backends.sort_unstable();
    backends.dedup();
    let candidates: Vec<_> = workers.iter().filter(of_backend).collect();
    if let (Some(backend), true) = (&needs.backend, candidates.is_empty()) {
        return format!(
            "it needs the backend {backend}, and the online workers have {}",
            backends.join(", ")
        );
    }
    let memory_mib = needs.memory_mib.unwrap_or(0);
    let best = candidates.iter().filter_map(|worker| Some((worker.memory_mib?, &worker.name))).max();
    match best {
        Some((most_mib, name)) => {
            format!(
                "it needs {memory_mib} MiB of memory, and the worker with the most, {name}, has {most_mib} MiB"
            )
        }
        None => format!("it needs {memory_mib} MiB of memory, and no online worker states its memory"),
    }
}

/// A number with its noun.
fn counted(number: u64, noun: &str) -> String {
    if number == 1 { format!("1 {noun}") } else { format!("{number} {noun}s") }
}

fn are(number: usize, noun: &str) -> String {
    format!("{} {}", counted(number as u64, noun), if number == 1 { "is" } else { "are" })
}

#[cfg(test)]
#[path = "waiting_tests.rs"]
mod tests;
