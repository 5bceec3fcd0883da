//! The decision of a pool: how many allocations to submit, which ones to cancel, whether to pause. It is a pure function of one
//! look at the queue and at Slurm.
//!
//! | symbol | meaning |
//! |---|---|
//! | t | mean wall time of a job, by the server's forecast |
//! | s | `--start-within` |
//! | r = ⌊s/t⌋ | jobs that a busy slot starts within s |
//! | max(r, 1) | jobs that a free slot starts within s, and a slot of an allocation that is to come |
//!
//! Jobs that the present slots do not start within s need slots: one for max(r, 1) jobs. Allocations that wait or start give
//! some of these. The rest is submitted, as far as `--backlog` and `--max-workers` allow.

use std::time::Duration;

use roost_api::job::Needs;
use roost_api::queue::NeedsDepth;
use roost_api::time::Timestamp;
use serde::{Deserialize, Serialize};

/// Looks with a failure, one after the other, from which on the pool pauses.
pub(super) const FAILURES_BEFORE_PAUSE: u32 = 3;
/// Longest pause.
const MAX_PAUSE: Duration = Duration::from_secs(3600);
/// Time for which the queue must have been empty before waiting allocations are cancelled: a study queues its next runs within seconds.
pub(super) const EMPTY_BEFORE_CANCEL: Duration = Duration::from_secs(15);

/// The user's limits.
#[derive(Clone, Copy, Debug)]
pub(super) struct Limits {
    /// Maximum number of allocations that wait in Slurm's queue.
    pub(super) backlog: u32,
    /// Maximum number of workers in all allocations.
    pub(super) max_workers: u32,
    /// Workers of one allocation.
    pub(super) workers_per_alloc: u32,
    /// Jobs that start later need more workers.
    pub(super) start_within: Duration,
    /// Wall time of a worker in an allocation, without the warning before its end.
    pub(super) work_time: Duration,
    /// The first pause after failures.
    pub(super) retry_pause: Duration,
}

/// A worker of the pool, as far as it is known.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct WorkerKind {
    /// Its backend.
    pub(super) backend: String,
    /// Memory of its device.
    pub(super) memory_mib: Option<u32>,
    /// Jobs that it runs at the same time.
    pub(super) slots: u32,
}

impl WorkerKind {
    /// Whether it has what jobs need.
    fn meets(&self, needs: &Needs) -> bool {
        needs.backend.as_ref().is_none_or(|backend| *backend == self.backend)
            && needs.memory_mib.is_none_or(|needed| self.memory_mib.is_some_and(|has| needed <= has))
    }
}

/// Failures one after the other.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Failures {
    /// Number of looks with a failure since an allocation worked.
    pub(super) in_a_row: u32,
    /// When the last one was seen.
    pub(super) last_at: Option<Timestamp>,
    /// Its reason.
    pub(super) why: String,
}

impl Failures {
    /// Counts one.
    pub(super) fn add(&mut self, now: Timestamp, why: String) {
        *self = Self { in_a_row: self.in_a_row.saturating_add(1), last_at: Some(now), why };
    }

    /// The end of the pause after these failures: it doubles with each further one.
    pub(super) fn paused_until(&self, first: Duration) -> Option<Timestamp> {
        let more = self.in_a_row.checked_sub(FAILURES_BEFORE_PAUSE)?;
        let pause = first.saturating_mul(2_u32.saturating_pow(more)).min(MAX_PAUSE.max(first));
        Some(self.last_at?.plus_ms(i64::try_from(pause.as_millis()).unwrap_or(i64::MAX)))
    }
}

/// One look at the queue and at Slurm.
#[derive(Clone, Debug)]
pub(super) struct Look<'a> {
    pub(super) now: Timestamp,
    /// Queued jobs by needs.
    pub(super) by_needs: &'a [NeedsDepth],
    /// Since when no job that fits has been queued; none while one is.
    pub(super) empty_since: Option<Timestamp>,
    /// Ids of the allocations that wait in Slurm's queue.
    pub(super) waiting: Vec<u64>,
    /// Number of allocations that run, but whose workers have not registered.
    pub(super) starting: u32,
    /// Number of allocations with registered workers.
    pub(super) working: u32,
    /// Number of those that have not shown that their workers work.
    pub(super) unproven: u32,
    /// Workers of working allocations that the look at the queue lacks: they registered later.
    pub(super) unseen_workers: u32,
    /// The pool's workers; none before the first one has registered.
    pub(super) worker: Option<&'a WorkerKind>,
    pub(super) failures: &'a Failures,
}

/// The end of a pause.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Pause {
    pub(super) until: Timestamp,
    pub(super) why: String,
}

/// The actions after a look.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Decision {
    /// Number of allocations to submit.
    pub(super) submit: u32,
    /// Waiting allocations to cancel.
    pub(super) cancel: Vec<u64>,
    /// Set while the pool pauses after failures.
    pub(super) pause: Option<Pause>,
    /// The reason in words.
    pub(super) why: String,
    /// Facts that the user should know, by subject.
    pub(super) warnings: Vec<(&'static str, String)>,
}

/// The number of queued jobs that the pool's workers can take.
pub(super) fn fitting_jobs(by_needs: &[NeedsDepth], worker: Option<&WorkerKind>) -> u64 {
    fitting(by_needs, worker).map(|group| group.jobs).sum()
}

fn fitting<'a>(
    by_needs: &'a [NeedsDepth],
    worker: Option<&WorkerKind>,
) -> impl Iterator<Item = &'a NeedsDepth> {
    by_needs.iter().filter(move |group| worker.is_none_or(|worker| worker.meets(&group.needs)))
}

/// Decides after a look.
pub(super) fn decide(limits: &Limits, look: &Look<'_>) -> Decision {
    let jobs = fitting_jobs(look.by_needs, look.worker);
    let warnings = warnings(limits, look);
    let none = |why: String| Decision { why, warnings: warnings.clone(), ..Decision::default() };
    if jobs == 0 {
        let empty_ms = look.empty_since.map_or(0, |since| look.now.0 - since.0);
        let is_over = empty_ms >= EMPTY_BEFORE_CANCEL.as_millis() as i64;
        let cancel = if is_over { look.waiting.clone() } else { Vec::new() };
        return Decision { cancel, ..none("no job waits".to_owned()) };
    }
    let (waiting, coming) = (look.waiting.len() as u32, look.waiting.len() as u32 + look.starting);
    if let Some(until) = look.failures.paused_until(limits.retry_pause)
        && look.now < until
    {
        let why = look.failures.why.clone();
        return Decision { pause: Some(Pause { until, why: why.clone() }), ..none(format!("paused: {why}")) };
    }
    let is_trial = look.failures.in_a_row >= FAILURES_BEFORE_PAUSE;
    let slots = u64::from(look.worker.map_or(1, |worker| worker.slots.max(1)));
    let per_alloc = slots * u64::from(limits.workers_per_alloc);
    let needed = slots_needed(look.by_needs, look.worker, limits.start_within);
    let given = u64::from(coming) * per_alloc + u64::from(look.unseen_workers) * slots;
    let within = seconds(limits.start_within);
    if needed == 0 {
        return none(format!("{}; the present workers start them within {within}", wait(jobs)));
    }
    if needed <= given {
        let coming = match coming {
            0 => counted(look.unseen_workers.into(), "new worker"),
            _ => counted(coming.into(), "allocation"),
        };
        return none(format!("{}; {coming} will take them up", wait(jobs)));
    }
    let wanted = (needed - given).div_ceil(per_alloc);
    let of_backlog = limits.backlog.saturating_sub(waiting);
    let allocations = coming + look.working;
    let of_workers = (limits.max_workers / limits.workers_per_alloc).saturating_sub(allocations);
    let of_trial = if is_trial { 1_u32.saturating_sub(coming + look.unproven) } else { u32::MAX };
    let submit = wanted.min(of_backlog.min(of_workers).min(of_trial).into()) as u32;
    if submit > 0 {
        let trial = if is_trial { " (one, as a trial after failures)" } else { "" };
        return Decision { submit, ..none(format!("{}{trial}", wait(jobs))) };
    }
    let limit = match (of_workers, of_backlog) {
        (0, _) => format!(
            "--max-workers {}: {} in all",
            limits.max_workers,
            counted(allocations.into(), "allocation")
        ),
        (_, 0) => format!("--backlog {}: {} already", limits.backlog, wait_in_slurm(waiting)),
        _ => "one allocation is on trial after failures".to_owned(),
    };
    none(format!("{}; {limit}", wait(jobs)))
}

/// Slots that the jobs of this worker need beyond the present ones to start within this time.
///
/// A slot may meet several kinds of needs, and each job takes it from the others. Those with the fewest slots choose first: workers
/// with more memory meet all that workers with less do.
fn slots_needed(by_needs: &[NeedsDepth], worker: Option<&WorkerKind>, within: Duration) -> u64 {
    let mut groups: Vec<&NeedsDepth> = by_needs.iter().collect();
    groups.sort_by_key(|group| group.slots);
    let (mut needed, mut taken) = (0, Vec::<(&Needs, u64, u64)>::new());
    for group in groups {
        let rounds = (within.as_secs_f64() / mean_s(group)).floor() as u64;
        let shared = taken.iter().filter(|(needs, ..)| share_workers(needs, &group.needs));
        let (taken_free, taken_busy) = shared
            .fold((0_u64, 0_u64), |(free, busy), (_, more_free, more_busy)| {
                (free + more_free, busy + more_busy)
            });
        let free = group.free_slots.saturating_sub(taken_free);
        let busy = group.slots.saturating_sub(group.free_slots).saturating_sub(taken_busy);
        let uses_free = free.min(group.jobs.div_ceil(rounds.max(1)));
        let left = group.jobs.saturating_sub(free.saturating_mul(rounds.max(1)));
        let uses_busy = if rounds == 0 { 0 } else { busy.min(left.div_ceil(rounds)) };
        taken.push((&group.needs, uses_free, uses_busy));
        if worker.is_none_or(|worker| worker.meets(&group.needs)) {
            needed += left.saturating_sub(busy.saturating_mul(rounds)).div_ceil(rounds.max(1));
        }
    }
    needed
}

/// Whether a worker may meet both needs.
fn share_workers(one: &Needs, other: &Needs) -> bool {
    one.backend.is_none() || other.backend.is_none() || one.backend == other.backend
}

/// Geometric mean of the range of a job's time: a millisecond for an unknown time, and infinite for one without an end.
fn mean_s(group: &NeedsDepth) -> f64 {
    // The larger of NaN and a number is the number.
    (group.job_time.shortest_s * group.job_time.longest_s).sqrt().max(1e-3)
}

/// Subjects of warnings.
pub(super) const WARNINGS: [&str; 2] = ["unfit", "too long"];

/// Jobs that no worker of the pool can take, and jobs that are longer than an allocation.
fn warnings(limits: &Limits, look: &Look<'_>) -> Vec<(&'static str, String)> {
    let mut found = Vec::new();
    let unfit: u64 =
        look.by_needs.iter().map(|group| group.jobs).sum::<u64>() - fitting_jobs(look.by_needs, look.worker);
    if let Some(worker) = look.worker.filter(|_| unfit > 0) {
        let memory = worker.memory_mib.map_or_else(String::new, |mib| format!(" with {mib} MiB"));
        let jobs =
            if unfit == 1 { "1 queued job needs".to_owned() } else { format!("{unfit} queued jobs need") };
        let text = format!(
            "{jobs} what workers of this pool lack: they have the backend {}{memory}",
            worker.backend
        );
        found.push((WARNINGS[0], text));
    }
    let longest_s = fitting(look.by_needs, look.worker)
        .filter(|group| group.finished_runs > 0)
        .map(|group| group.job_time.longest_s)
        .fold(0.0, f64::max);
    if longest_s > limits.work_time.as_secs_f64() {
        let text = format!(
            "jobs take up to {} by the forecast, and an allocation works for {}: they will need several allocations, and continue \
             from checkpoints; a longer --time-limit avoids that",
            seconds(Duration::from_secs_f64(longest_s.min(1e9))),
            seconds(limits.work_time)
        );
        found.push((WARNINGS[1], text));
    }
    found
}

/// A time for people.
fn seconds(time: Duration) -> String {
    roost_terminal::format::duration(time.as_secs_f64())
}

fn wait(jobs: u64) -> String {
    format!("{} {}", counted(jobs, "job"), if jobs == 1 { "waits" } else { "wait" })
}

fn wait_in_slurm(allocations: u32) -> String {
    let verb = if allocations == 1 { "waits" } else { "wait" };
    format!("{} {verb} in Slurm's queue", counted(allocations.into(), "allocation"))
}

/// A number with its noun.
pub(super) fn counted(number: u64, noun: &str) -> String {
    if number == 1 { format!("1 {noun}") } else { format!("{number} {noun}s") }
}

#[cfg(test)]
#[path = "rule_tests.rs"]
mod tests;
