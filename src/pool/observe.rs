//! From one look at Slurm and the server to the ledger: states of allocations, registered workers, failures.

use std::collections::{BTreeMap, BTreeSet};

use roost_api::time::Timestamp;
use roost_api::worker::WorkerView;

use super::ledger::{Allocation, AllocationState, Ledger};
use super::parse::SlurmJob;
use super::rule::WorkerKind;

/// Jobs of a worker on a GPU, if `--slots` is automatic.
const GPU_SLOTS: u32 = 16;

/// A working allocation has shown after this time that its workers work.
const PROVEN_AFTER_MS: i64 = 60_000;

/// Maximum difference between the clocks of server and pool.
const CLOCK_DIFFERENCE_MS: i64 = 3_600_000;

/// The beginning of the names of a pool's workers. Other pools of the server, on other clusters, may have the same ids of jobs.
pub(super) fn worker_prefix(pool: &str) -> String {
    format!("slurm-{}-", pool.rsplit('-').next().unwrap_or(pool))
}

/// The allocation of a worker, by its name such as `slurm-6f1d20c4-17-1-node4`.
fn allocation_of(name: &str, prefix: &str) -> Option<u64> {
    name.strip_prefix(prefix)?.split('-').next()?.parse().ok()
}

/// A search for workers of allocations that may have new ones.
#[derive(Debug)]
pub(super) struct WorkerSearch {
    prefix: String,
    /// Allocations, and the number of workers that each has at most.
    awaited: BTreeMap<u64, usize>,
    /// Workers of these allocations registered later.
    not_before: Timestamp,
}

impl WorkerSearch {
    /// The search after a look at Slurm; none if no allocation has new workers. `ended` have ended since the last search.
    pub(super) fn new(
        ledger: &Ledger,
        ended: &[u64],
        workers_per_alloc: u32,
        now: Timestamp,
    ) -> Option<Self> {
        let is_awaited = |one: &&Allocation| match one.state {
            AllocationState::Running => one.may_have_new_workers(workers_per_alloc, now),
            _ => !one.registered && ended.contains(&one.id),
        };
        let awaited: Vec<&Allocation> = ledger.allocations.iter().filter(is_awaited).collect();
        let submitted = awaited.iter().map(|one| if one.adopted { Timestamp(0) } else { one.submitted_at });
        Some(Self {
            prefix: worker_prefix(&ledger.name),
            not_before: submitted.min()?.plus_ms(-CLOCK_DIFFERENCE_MS),
            awaited: awaited.iter().map(|one| (one.id, workers_per_alloc as usize)).collect(),
        })
    }

    /// Whether a page of workers, listed newest first, ends the search.
    pub(super) fn ends_with(&mut self, page: &[WorkerView]) -> bool {
        for id in page.iter().filter_map(|worker| allocation_of(&worker.name, &self.prefix)) {
            if let Some(left) = self.awaited.get_mut(&id) {
                *left = left.saturating_sub(1);
            }
        }
        self.awaited.values().all(|left| *left == 0)
            || page.last().is_none_or(|worker| worker.registered_at < self.not_before)
    }
}

/// Records which allocations have registered workers. Returns the ids of those that had none before.
pub(super) fn record_workers(
    ledger: &mut Ledger,
    workers: &[WorkerView],
    slots: Option<u32>,
    now: Timestamp,
) -> Vec<u64> {
    let prefix = worker_prefix(&ledger.name);
    let mut registered: BTreeMap<u64, Vec<Timestamp>> = BTreeMap::new();
    for worker in workers {
        if let Some(id) = allocation_of(&worker.name, &prefix) {
            registered.entry(id).or_default().push(worker.registered_at);
        }
    }
    let mut new = Vec::new();
    for one in &mut ledger.allocations {
        let Some(found) = registered.remove(&one.id) else { continue };
        // A search may end before it has found the workers of earlier ones again.
        if found.len() > one.workers.len() {
            one.workers = found;
        }
        if !one.registered {
            (one.registered, one.working_since) = (true, Some(now));
            new.push(one.id);
        }
    }
    // Workers are listed newest first.
    let newest = workers
        .iter()
        .find(|worker| allocation_of(&worker.name, &prefix).is_some_and(|id| new.contains(&id)));
    if let Some(worker) = newest {
        let automatic = if worker.backend == "cpu" { worker.threads } else { GPU_SLOTS };
        ledger.worker = Some(WorkerKind {
            backend: worker.backend.clone(),
            memory_mib: worker.memory_mib,
            slots: slots.unwrap_or(automatic).max(1),
        });
    }
    new
}

/// Ends the failures when an allocation shows that its workers work: it has ended well, or has worked for a while. Registering alone
/// shows nothing, since a worker may die of its first job.
pub(super) fn record_proofs(ledger: &mut Ledger, ended: &[u64], now: Timestamp) {
    let mut is_proven = false;
    for one in ledger.allocations.iter_mut().filter(|one| one.registered && !one.proven) {
        one.proven = match one.state {
            AllocationState::Running => {
                one.working_since.is_some_and(|since| now.0 - since.0 >= PROVEN_AFTER_MS)
            }
            AllocationState::Completed | AllocationState::TimedOut | AllocationState::Preempted => {
                ended.contains(&one.id)
            }
            _ => false,
        };
        is_proven |= one.proven;
    }
    if is_proven {
        ledger.failures = Default::default();
    }
}

/// Records the states of all jobs that Slurm shows under the name of the pool. Jobs that the ledger lacks are adopted, if they have not
/// ended. Returns the allocations that have ended since the last look.
pub(super) fn record_jobs(ledger: &mut Ledger, jobs: &[SlurmJob], now: Timestamp) -> Vec<u64> {
    let mut ended = Vec::new();
    for job in jobs {
        let known = ledger.allocations.iter_mut().find(|one| one.id == job.id);
        let Some(one) = known else {
            if job.state.is_held() {
                let adopted = Allocation {
                    reason: job.reason.clone(),
                    adopted: true,
                    ..Allocation::waiting(job.id, now)
                };
                let started_at = (job.state == AllocationState::Running).then_some(now);
                ledger.allocations.push(Allocation { state: job.state, started_at, ..adopted });
            }
            continue;
        };
        if !one.state.is_held() && one.state != AllocationState::Forgotten {
            continue;
        }
        one.ended_at = None;
        // The pool cancels waiting allocations; this one started before.
        let has_started = one.state == AllocationState::Waiting && job.state == AllocationState::Running;
        one.cancelled_by_pool &= !has_started;
        (one.state, one.reason) = (job.state, job.reason.clone());
        if one.state != AllocationState::Waiting {
            one.started_at = one.started_at.or((one.state == AllocationState::Running).then_some(now));
        }
        if !one.state.is_held() {
            one.ended_at = Some(now);
            ended.push(one.id);
        }
    }
    ended
}

/// The allocations that the ledger holds, but Slurm's queue does not show under the name of the pool.
pub(super) fn missing(ledger: &Ledger, jobs: &[SlurmJob]) -> Vec<u64> {
    let shown: BTreeSet<u64> = jobs.iter().map(|job| job.id).collect();
    ledger.held().map(|one| one.id).filter(|id| !shown.contains(id)).collect()
}

/// Records that Slurm has forgotten an allocation.
pub(super) fn record_forgotten(ledger: &mut Ledger, id: u64, now: Timestamp) {
    if let Some(one) = ledger.allocations.iter_mut().find(|one| one.id == id) {
        (one.state, one.ended_at) = (AllocationState::Forgotten, Some(now));
    }
}

/// Counts the failures among allocations that have just ended: at most one for a look. An end before a worker has registered is a
/// failure, unless the pool asked for it. `log` gives the last line of an allocation's log.
pub(super) fn record_failures(
    ledger: &mut Ledger,
    ended: &[u64],
    log: impl Fn(u64) -> Option<String>,
    now: Timestamp,
) -> Option<String> {
    let failed = ledger.allocations.iter().filter(|one| ended.contains(&one.id)).find_map(|one| {
        let end = match (one.state, one.registered) {
            (AllocationState::Failed, true) => "failed",
            (_, true) => return None,
            (AllocationState::Cancelled | AllocationState::Forgotten, _) if one.cancelled_by_pool => {
                return None;
            }
            (AllocationState::Waiting | AllocationState::Running, _) => return None,
            (AllocationState::Failed, false) => "failed before its worker had registered",
            (AllocationState::Completed, false) => "ended before its worker had registered",
            (AllocationState::TimedOut, false) => "reached its time limit before its worker had registered",
            (AllocationState::Cancelled, false) => "was cancelled before its worker had registered",
            (AllocationState::Preempted, false) => "was preempted before its worker had registered",
            (AllocationState::Forgotten, false) => "is unknown to Slurm, and its worker had not registered",
        };
        let reason = if one.reason.is_empty() { String::new() } else { format!(" ({})", one.reason) };
        let line = log(one.id).map_or_else(String::new, |line| format!(": {line}"));
        Some(format!("allocation {} {end}{reason}{line}", one.id))
    });
    if let Some(why) = &failed {
        ledger.failures.add(now, why.clone());
    }
    failed
}

#[cfg(test)]
#[path = "observe_tests.rs"]
mod tests;
