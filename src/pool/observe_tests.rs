//! Tests of `observe`: what a look at Slurm and the server changes in the ledger.

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
    assert!(!one.ends_with(&[registered("slurm-ab-16-1-n", late), new.clone()]), "17 may be on a later page");
    assert!(one.ends_with(&[new.clone(), registered("slurm-ab-17-1-n", late)]), "both are found");
    let mut two = search(&ledger, 2);
    let page = [registered("slurm-ab-16-1-n", late), registered("slurm-ab-17-1-n", late)];
    assert!(!two.ends_with(&page), "each has two");
    assert!(two.ends_with(&[registered("other", Timestamp(8 * CLOCK_DIFFERENCE_MS))]), "the rest is older");
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
