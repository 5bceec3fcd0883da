//! From one look at Slurm and the server to the ledger: states of allocations, registered workers, failures.

use std::collections::BTreeSet;

use roost_api::time::Timestamp;
use roost_api::worker::WorkerView;

use super::ledger::{Allocation, AllocationState, Ledger};
use super::parse::SlurmJob;
use super::rule::WorkerKind;

/// Jobs of a worker on a GPU, if `--slots` is automatic.
const GPU_SLOTS: u32 = 16;

/// The name of a worker: it has the id of its allocation.
pub(super) const WORKER_NAME: &str = "slurm-";

/// The allocation of a worker, by its name such as `slurm-17-1-node4`.
fn allocation_of(name: &str) -> Option<u64> {
    name.strip_prefix(WORKER_NAME)?.split('-').next()?.parse().ok()
}

/// Records which allocations have registered workers. Returns the ids of those that had none before.
pub(super) fn record_workers(ledger: &mut Ledger, workers: &[WorkerView], slots: Option<u32>) -> Vec<u64> {
    let registered: BTreeSet<u64> = workers.iter().filter_map(|worker| allocation_of(&worker.name)).collect();
    let mut new = Vec::new();
    for one in ledger.allocations.iter_mut().filter(|one| !one.registered && registered.contains(&one.id)) {
        one.registered = true;
        new.push(one.id);
    }
    // Workers are listed newest first.
    let newest =
        workers.iter().find(|worker| allocation_of(&worker.name).is_some_and(|id| new.contains(&id)));
    if let Some(worker) = newest {
        let automatic = if worker.backend == "cpu" { worker.threads } else { GPU_SLOTS };
        ledger.worker = Some(WorkerKind {
            backend: worker.backend.clone(),
            memory_mib: worker.memory_mib,
            slots: slots.unwrap_or(automatic).max(1),
        });
        ledger.failures = Default::default();
    }
    new
}

/// Records the states of all jobs that Slurm shows under the name of the pool. Jobs that the ledger lacks are adopted, if they have not
/// ended. Returns the allocations that have ended since the last look.
pub(super) fn record_jobs(ledger: &mut Ledger, jobs: &[SlurmJob], now: Timestamp) -> Vec<u64> {
    let mut ended = Vec::new();
    for job in jobs {
        let known = ledger.allocations.iter_mut().find(|one| one.id == job.id);
        let Some(one) = known else {
            if job.state.is_held() {
                let adopted = Allocation { reason: job.reason.clone(), ..Allocation::waiting(job.id, now) };
                let started_at = (job.state == AllocationState::Running).then_some(now);
                ledger.allocations.push(Allocation { state: job.state, started_at, ..adopted });
            }
            continue;
        };
        if !one.state.is_held() && one.state != AllocationState::Forgotten {
            continue;
        }
        one.ended_at = None;
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

/// The allocations that the ledger holds, but Slurm's queue does not show: `sacct` may know their end.
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

/// Counts the failures among allocations that have just ended: at most one for a look. `log` gives the last line of an allocation's log.
pub(super) fn record_failures(
    ledger: &mut Ledger,
    ended: &[u64],
    log: impl Fn(u64) -> Option<String>,
    now: Timestamp,
) -> Option<String> {
    let failed = ledger.allocations.iter().filter(|one| ended.contains(&one.id)).find_map(|one| {
        let end = match (one.state, one.registered) {
            (AllocationState::Failed, true) => "failed",
            (AllocationState::Failed, false) => "failed before its worker had registered",
            (AllocationState::Completed, false) => "ended before its worker had registered",
            (AllocationState::TimedOut, false) => "reached its time limit before its worker had registered",
            _ => return None,
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
        let mut ledger = Ledger::new("pool".to_owned(), Timestamp(0));
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
    fn workers_are_found_by_their_names() {
        let mut ledger = ledger(16..=18);
        ledger.failures.add(Timestamp(1), "refused".to_owned());
        let names = ["slurm-17-1-node-18-2", "node-16-1", "slurm-x", "slurm-99-1-n", "slurm-"];
        let workers: Vec<_> = names.iter().map(|name| worker(name, "cpu")).collect();
        assert_eq!(record_workers(&mut ledger, &workers, None), [17]);
        let kind = ledger.worker.clone().unwrap();
        assert_eq!((kind.backend.as_str(), kind.memory_mib, kind.slots), ("cpu", Some(4000), 8));
        assert_eq!(ledger.failures.in_a_row, 0, "a worker that registers ends the failures");
        assert_eq!(record_workers(&mut ledger, &workers, None), [0_u64; 0]);
        record_workers(&mut ledger, &[worker("slurm-18-1-n", "gpu")], None);
        assert_eq!(ledger.worker.as_ref().unwrap().slots, 16);
        record_workers(&mut ledger, &[worker("slurm-16-1-n", "gpu")], Some(3));
        assert_eq!(ledger.worker.unwrap().slots, 3);
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
        for state in [Cancelled, Preempted, Forgotten] {
            assert_eq!(failure(state, false), None, "{state:?}: nobody's fault");
        }
        assert_eq!(failure(Failed, true).unwrap(), "allocation 7 failed: roost: not found");
        assert_eq!(
            failure(Completed, false).unwrap(),
            "allocation 7 ended before its worker had registered: roost: not found"
        );
        assert!(failure(TimedOut, false).is_some() && failure(Failed, false).is_some());
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
