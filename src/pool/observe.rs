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
mod tests {
    use roost_api::ids::WorkerId;

    use super::AllocationState::*;
    use super::*;

    fn job(id: u64, state: AllocationState) -> SlurmJob {
        SlurmJob { id, state, reason: String::new() }
    }

    fn worker(name: &str, backend: &str) -> WorkerView {
        WorkerView {
            id: WorkerId::new(),
            name: name.to_owned(),
            backend: backend.to_owned(),
            device: String::new(),
            threads: 8,
            memory_mib: Some(4000),
            solver_revision: 16,
            draining: false,
            running: Vec::new(),
            progress: Vec::new(),
            particle_steps_per_s: None,
            succeeded: 0,
            failed: 0,
            registered_at: Timestamp(0),
            last_seen_at: Timestamp(0),
        }
    }

    fn ledger(ids: std::ops::RangeInclusive<u64>) -> Ledger {
        let mut ledger = Ledger::new("roost-pool-ab".to_owned(), Timestamp(0));
        ledger.allocations = ids.map(|id| Allocation::waiting(id, Timestamp(0))).collect();
        ledger
    }

    #[test]
    fn states_follow_slurm_and_unknown_jobs_are_adopted() {
        let mut ledger = ledger(1..=3);
        let jobs = [job(1, Running), job(2, Waiting), job(3, Cancelled), job(4, Running), job(5, Completed)];
        assert_eq!(record_jobs(&mut ledger, &jobs, Timestamp(9)), [3]);
        let states: Vec<_> = ledger.allocations.iter().map(|one| (one.id, one.state)).collect();
        assert_eq!(states, [(1, Running), (2, Waiting), (3, Cancelled), (4, Running)]);
        assert_eq!((ledger.waiting(), ledger.running(false)), (vec![2], 2));
        assert_eq!(ledger.allocations[0].started_at, Some(Timestamp(9)));
        assert_eq!(record_jobs(&mut ledger, &jobs, Timestamp(10)), [0_u64; 0], "ended once");
        assert_eq!(missing(&ledger, &jobs[1..2]), [1, 4]);
        record_forgotten(&mut ledger, 4, Timestamp(11));
        assert_eq!((ledger.held().count(), ledger.allocations[3].ended_at), (2, Some(Timestamp(11))));
    }

    #[test]
    fn workers_are_found_by_the_names_of_pool_and_allocation() {
        let mut ledger = ledger(16..=18);
        let names = [
            "slurm-ab-17-1-node-18-2",
            "node-16-1",
            "slurm-x",
            "slurm-ab-99-1-n",
            "slurm-cd-16-1-n",
            "slurm-16-1-n",
        ];
        let workers: Vec<_> = names.iter().map(|name| worker(name, "cpu")).collect();
        let record = |ledger: &mut Ledger, workers: &[WorkerView], slots| {
            record_workers(ledger, workers, slots, Timestamp(5))
        };
        assert_eq!(record(&mut ledger, &workers, None), [17], "those of other pools have the same ids");
        let kind = ledger.worker.clone().unwrap();
        assert_eq!((kind.backend.as_str(), kind.memory_mib, kind.slots), ("cpu", Some(4000), 8));
        assert_eq!(record(&mut ledger, &workers, None), [0_u64; 0]);
        record(&mut ledger, &[worker("slurm-ab-18-1-n", "gpu"), worker("slurm-ab-18-2-n", "gpu")], None);
        assert_eq!(ledger.worker.as_ref().unwrap().slots, 16);
        assert_eq!((ledger.allocations[1].workers.len(), ledger.allocations[2].workers.len()), (1, 2));
        record(&mut ledger, &[worker("slurm-ab-18-1-n", "gpu")], None);
        assert_eq!(ledger.allocations[2].workers.len(), 2, "a shorter list takes none away");
        record(&mut ledger, &[worker("slurm-ab-16-1-n", "gpu")], Some(3));
        assert_eq!(ledger.worker.unwrap().slots, 3);
    }

    #[test]
    fn the_search_for_workers_ends_when_all_are_found_or_the_rest_is_older() {
        let late = Timestamp(10 * CLOCK_DIFFERENCE_MS);
        let mut ledger = ledger(16..=18);
        assert!(WorkerSearch::new(&ledger, &[], 1, late).is_none(), "none has started");
        for one in &mut ledger.allocations[..2] {
            (one.state, one.submitted_at) = (Running, late);
        }
        let search = |ledger: &Ledger, per_alloc| WorkerSearch::new(ledger, &[], per_alloc, late).unwrap();
        let registered = |name: &str, at| WorkerView { registered_at: at, ..worker(name, "cpu") };
        let (mut one, new) = (search(&ledger, 1), registered("other", late));
        assert!(
            !one.ends_with(&[registered("slurm-ab-16-1-n", late), new.clone()]),
            "17 may be on a later page"
        );
        assert!(one.ends_with(&[new.clone(), registered("slurm-ab-17-1-n", late)]), "both are found");
        let mut two = search(&ledger, 2);
        let page = [registered("slurm-ab-16-1-n", late), registered("slurm-ab-17-1-n", late)];
        assert!(!two.ends_with(&page), "each has two");
        assert!(
            two.ends_with(&[registered("other", Timestamp(8 * CLOCK_DIFFERENCE_MS))]),
            "the rest is older"
        );
        assert!(search(&ledger, 1).ends_with(&[]));
        ledger.allocations[0].adopted = true;
        assert!(
            !search(&ledger, 1).ends_with(&[registered("other", Timestamp(0))]),
            "an adopted one may be older than this pool"
        );
    }

    #[test]
    fn failures_end_with_an_allocation_that_has_worked() {
        let failed = || {
            let mut ledger = ledger(7..=7);
            ledger.failures.add(Timestamp(1), "refused".to_owned());
            record_jobs(&mut ledger, &[job(7, Running)], Timestamp(5));
            record_workers(&mut ledger, &[worker("slurm-ab-7-1-n", "cpu")], None, Timestamp(5));
            ledger
        };
        let failures_after = |end, at_ms| {
            let mut ledger = failed();
            let ended = record_jobs(&mut ledger, &[job(7, end)], Timestamp(at_ms));
            record_proofs(&mut ledger, &ended, Timestamp(at_ms));
            record_failures(&mut ledger, &ended, |_| None, Timestamp(at_ms));
            ledger.failures.in_a_row
        };
        for end in [Completed, TimedOut, Preempted] {
            assert_eq!(failures_after(end, 10), 0, "{end:?}");
        }
        assert_eq!(failures_after(Failed, 10), 2, "out of memory with its first job");
        assert_eq!(failures_after(Cancelled, 10), 1);
        assert_eq!(failures_after(Running, 10), 1, "it has only registered");
        assert_eq!(failures_after(Running, 60_005), 0, "it works");
        // Others fail while it works on: it ends no failures again.
        let mut ledger = failed();
        record_proofs(&mut ledger, &[], Timestamp(60_005));
        ledger.failures.add(Timestamp(60_006), "refused".to_owned());
        record_proofs(&mut ledger, &[], Timestamp(70_000));
        assert_eq!(ledger.failures.in_a_row, 1);
    }

    #[test]
    fn ends_without_a_registered_worker_are_failures() {
        let failure = |state, registered| {
            let mut ledger = ledger(7..=7);
            ledger.allocations[0].registered = registered;
            record_jobs(&mut ledger, &[job(7, state)], Timestamp(5));
            let log = |_| Some("roost: not found".to_owned());
            let found = record_failures(&mut ledger, &[7], log, Timestamp(5));
            assert_eq!(ledger.failures.in_a_row, u32::from(found.is_some()));
            found
        };
        for state in [Completed, Cancelled, TimedOut, Preempted, Forgotten] {
            assert_eq!(failure(state, true), None, "{state:?}");
        }
        for state in [Completed, Cancelled, TimedOut, Preempted, Failed, Forgotten] {
            assert!(failure(state, false).is_some(), "{state:?}");
        }
        assert_eq!(failure(Failed, true).unwrap(), "allocation 7 failed: roost: not found");
        assert_eq!(
            failure(Completed, false).unwrap(),
            "allocation 7 ended before its worker had registered: roost: not found"
        );
    }

    #[test]
    fn a_cancellation_by_the_pool_is_no_failure() {
        let failures = |states: &[AllocationState]| {
            let mut ledger = ledger(7..=7);
            ledger.note_cancelled(&[7]);
            for state in states {
                record_jobs(&mut ledger, &[job(7, *state)], Timestamp(5));
            }
            record_failures(&mut ledger, &[7], |_| None, Timestamp(5));
            ledger.failures.in_a_row
        };
        assert_eq!(failures(&[Cancelled]), 0);
        assert_eq!(failures(&[Running, Cancelled]), 1, "it had started, so that a user has cancelled it");
        assert_eq!(failures(&[Failed]), 1);
    }

    #[test]
    fn failures_of_one_look_count_once() {
        let mut ledger = ledger(1..=4);
        let jobs: Vec<_> = (1..=4).map(|id| job(id, Failed)).collect();
        let ended = record_jobs(&mut ledger, &jobs, Timestamp(5));
        record_failures(&mut ledger, &ended, |_| None, Timestamp(5));
        assert_eq!((ended.len(), ledger.failures.in_a_row), (4, 1));
        assert_eq!(ledger.failures.why, "allocation 1 failed before its worker had registered");
    }
}
