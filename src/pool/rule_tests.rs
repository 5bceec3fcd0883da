//! Tests of the decision in virtual time: single looks, and a simulated cluster.

use roost_api::forecast::DurationRange;

use super::*;

const LIMITS: Limits = Limits {
    backlog: 4,
    max_workers: 16,
    workers_per_alloc: 1,
    start_within: Duration::from_secs(60),
    work_time: Duration::from_secs(3540),
    retry_pause: Duration::from_secs(60),
};

fn at(seconds: i64) -> Timestamp {
    Timestamp(1000 * seconds)
}

/// Jobs of a known length, and the slots of the present workers.
fn group(jobs: u64, job_s: f64, slots: u64, free_slots: u64) -> NeedsDepth {
    NeedsDepth {
        needs: Needs::default(),
        jobs,
        workers: slots,
        slots,
        free_slots,
        job_time: DurationRange { shortest_s: job_s, longest_s: job_s },
        finished_runs: 10,
    }
}

fn worker(slots: u32) -> WorkerKind {
    WorkerKind { backend: "cpu".to_owned(), memory_mib: Some(8000), slots }
}

static NO_FAILURES: Failures = Failures { in_a_row: 0, last_at: None, why: String::new() };

fn look(by_needs: &[NeedsDepth]) -> Look<'_> {
    Look {
        now: at(1000),
        by_needs,
        empty_since: None,
        waiting: Vec::new(),
        starting: 0,
        working: 0,
        unproven: 0,
        unseen_workers: 0,
        worker: None,
        failures: &NO_FAILURES,
    }
}

/// The number of submissions for jobs of 10 minutes, and its limits.
fn submitted(jobs: u64, waiting: u64, starting: u32, working: u32, slots: u32) -> u32 {
    let (queue, worker) = ([group(jobs, 600.0, 0, 0)], worker(slots));
    let base = look(&queue);
    let look = Look { waiting: (1..=waiting).collect(), starting, working, worker: Some(&worker), ..base };
    decide(&LIMITS, &look).submit
}

#[test]
fn submissions_follow_the_queue_up_to_the_limits() {
    assert_eq!(submitted(0, 0, 0, 0, 1), 0, "no job");
    assert_eq!(submitted(3, 0, 0, 0, 1), 3, "one slot each");
    assert_eq!(submitted(100, 0, 0, 0, 1), 4, "the backlog");
    assert_eq!(submitted(100, 3, 0, 0, 1), 1, "the rest of the backlog");
    assert_eq!(submitted(100, 0, 0, 15, 1), 1, "the workers in all");
    assert_eq!(submitted(100, 0, 0, 16, 1), 0, "all workers");
    assert_eq!(submitted(3, 2, 1, 0, 1), 0, "three are to come");
    assert_eq!(submitted(9, 0, 1, 0, 8), 1, "8 slots are to come");
    assert_eq!(submitted(16, 0, 0, 0, 8), 2, "8 slots each");
}

#[test]
fn jobs_that_present_workers_start_soon_need_no_allocation() {
    let submit = |group: NeedsDepth| decide(&LIMITS, &look(&[group])).submit;
    assert_eq!(submit(group(2, 600.0, 2, 2)), 0, "free slots");
    assert_eq!(submit(group(3, 600.0, 2, 2)), 1);
    assert_eq!(submit(group(3, 600.0, 3, 0)), 3, "busy for 10 minutes");
    assert_eq!(submit(group(100, 0.5, 1, 0)), 0, "a busy slot starts 120 jobs of 0.5 s within a minute");
    assert_eq!(submit(group(121, 0.5, 1, 0)), 1);
    assert_eq!(submit(group(600, 10.0, 10, 0)), 4, "540 jobs remain: 90 slots");
    assert_eq!(submit(group(72, 10.0, 10, 0)), 2, "12 jobs remain, six for each slot");
    let unknown = NeedsDepth {
        job_time: DurationRange { shortest_s: f64::NAN, longest_s: 0.0 },
        ..group(5, 1.0, 0, 0)
    };
    assert_eq!(submit(unknown), 1, "an unknown time counts as short");
    assert_eq!(submit(group(5, 0.0, 0, 0)), 1, "and no time as well");
    assert_eq!(submit(group(3, f64::INFINITY, 1, 1)), 2, "jobs without an end need a slot each");
    assert_eq!(submit(group(3, f64::INFINITY, 3, 0)), 3, "a busy slot starts none of them");
}

#[test]
fn groups_of_needs_have_their_own_workers() {
    let gpu = |jobs| NeedsDepth {
        needs: Needs { backend: Some("gpu".to_owned()), memory_mib: Some(12_288) },
        ..group(jobs, 600.0, 0, 0)
    };
    let queue = [group(12, 600.0, 100, 100), gpu(3)];
    assert_eq!(decide(&LIMITS, &look(&queue)).submit, 3, "the free slots have no GPU");
    let cpu = worker(1);
    let decision = decide(&LIMITS, &Look { worker: Some(&cpu), ..look(&queue) });
    assert_eq!(decision.submit, 0, "the pool's workers have no GPU either");
    let warning =
        "3 queued jobs need what workers of this pool lack: they have the backend cpu with 8000 MiB";
    assert_eq!(decision.warnings, [("unfit", warning.to_owned())]);
    let small = WorkerKind { backend: "gpu".to_owned(), memory_mib: Some(8000), slots: 16 };
    assert_eq!(fitting_jobs(&queue, Some(&small)), 12, "too little memory");
    let large = WorkerKind { memory_mib: Some(80_000), ..small };
    assert_eq!(fitting_jobs(&queue, Some(&large)), 15);
}

#[test]
fn a_slot_is_given_to_one_kind_of_needs() {
    let needs = |backend: Option<&str>, memory_mib, group| NeedsDepth {
        needs: Needs { backend: backend.map(str::to_owned), memory_mib },
        ..group
    };
    let submit = |queue: &[NeedsDepth]| decide(&LIMITS, &look(queue)).submit;
    let small = needs(None, None, group(2, 600.0, 2, 2));
    let large = needs(None, Some(4000), group(2, 600.0, 2, 2));
    assert_eq!(submit(std::slice::from_ref(&small)), 0);
    assert_eq!(submit(&[small.clone(), large]), 2, "both kinds need the same two slots");
    let one_large = needs(None, Some(4000), group(1, 600.0, 1, 1));
    assert_eq!(submit(&[small, one_large]), 1, "the one with more memory takes the large job");
    let (cpu, gpu) =
        (needs(Some("cpu"), None, group(2, 600.0, 2, 2)), needs(Some("gpu"), None, group(2, 600.0, 2, 2)));
    assert_eq!(submit(&[cpu, gpu]), 0, "a worker has one backend");
    // A busy slot starts two jobs of 30 s within the minute, of one kind.
    let busy = |memory_mib| needs(None, memory_mib, group(2, 30.0, 1, 0));
    assert_eq!(submit(&[busy(None), busy(Some(4000))]), 1);
}

#[test]
fn workers_that_the_look_lacks_are_counted_as_coming() {
    let (queue, kind) = ([group(5, 600.0, 0, 0)], worker(2));
    let base = Look { worker: Some(&kind), working: 2, ..look(&queue) };
    assert_eq!(decide(&LIMITS, &base).submit, 3, "as if the working ones had no slot");
    assert_eq!(
        decide(&LIMITS, &Look { unseen_workers: 2, ..base.clone() }).submit,
        1,
        "four slots are to come"
    );
    let decision = decide(&LIMITS, &Look { unseen_workers: 3, ..base });
    assert_eq!((decision.submit, decision.why.as_str()), (0, "5 jobs wait; 3 new workers will take them up"));
}

#[test]
fn a_trial_lasts_until_its_worker_has_shown_that_it_works() {
    let failures = Failures { in_a_row: 3, last_at: Some(at(0)), why: "out of memory".to_owned() };
    let queue = [group(100, 600.0, 1, 0)];
    let submit = |working, unproven| {
        decide(&LIMITS, &Look { working, unproven, failures: &failures, ..look(&queue) }).submit
    };
    assert_eq!((submit(0, 0), submit(1, 1), submit(1, 0)), (1, 0, 1));
}

#[test]
fn several_workers_per_allocation_count_towards_the_maximum() {
    let limits = Limits { workers_per_alloc: 3, max_workers: 16, ..LIMITS };
    let queue = [group(100, 600.0, 0, 0)];
    let submit = |working| decide(&limits, &Look { working, ..look(&queue) }).submit;
    assert_eq!((submit(0), submit(3), submit(5)), (4, 2, 0), "five allocations of three");
    let few = [group(7, 600.0, 0, 0)];
    assert_eq!(decide(&limits, &look(&few)).submit, 3, "7 jobs on allocations of three");
}

#[test]
fn waiting_allocations_are_cancelled_when_the_queue_stays_empty() {
    let empty = |for_s: i64| {
        let base = look(&[]);
        let since = Some(at(1000 - for_s));
        decide(&LIMITS, &Look { waiting: vec![7, 8], empty_since: since, working: 2, ..base }).cancel
    };
    assert_eq!(empty(0), [0_u64; 0]);
    assert_eq!(empty(14), [0_u64; 0], "a study may be about to queue its next runs");
    assert_eq!(empty(15), [7, 8]);
    let queue = [group(1, 600.0, 0, 0)];
    let decision = decide(&LIMITS, &Look { waiting: vec![7, 8], ..look(&queue) });
    assert_eq!((decision.submit, decision.cancel.len()), (0, 0), "a job waits for them");
}

#[test]
fn failures_pause_the_pool_for_longer_and_longer() {
    let mut failures = Failures::default();
    let queue = [group(100, 600.0, 0, 0)];
    let decision =
        |failures: &Failures, now_s: i64| decide(&LIMITS, &Look { now: at(now_s), failures, ..look(&queue) });
    for now_s in [10, 20] {
        failures.add(at(now_s), "sbatch: invalid partition".to_owned());
        assert_eq!(decision(&failures, now_s).submit, 4, "{now_s}");
    }
    let mut pauses = Vec::new();
    let mut now_s = 30;
    for _ in 0..9 {
        failures.add(at(now_s), "sbatch: invalid partition".to_owned());
        let Decision { submit, pause: Some(pause), why, .. } = decision(&failures, now_s) else {
            panic!("no pause at {now_s} s")
        };
        assert_eq!((submit, why.as_str()), (0, "paused: sbatch: invalid partition"));
        assert_eq!(pause.why, "sbatch: invalid partition");
        let until_s = pause.until.0 / 1000;
        assert_eq!(decision(&failures, until_s - 1).submit, 0);
        let trial = decision(&failures, until_s);
        assert_eq!((trial.submit, trial.pause), (1, None), "one, as a trial");
        pauses.push(until_s - now_s);
        now_s = until_s;
    }
    assert_eq!(pauses, [60, 120, 240, 480, 960, 1920, 3600, 3600, 3600]);
    let base = look(&queue);
    let now = at(now_s + 3600);
    let decision = decide(&LIMITS, &Look { now, waiting: vec![1], failures: &failures, ..base });
    assert_eq!(decision.submit, 0, "the trial is under way");
    assert!(decision.why.ends_with("one allocation is on trial after failures"), "{}", decision.why);
}

#[test]
fn an_allocation_shorter_than_the_jobs_is_warned_of() {
    let warnings = |job_s: f64, finished_runs| {
        let queue = [NeedsDepth { finished_runs, ..group(5, job_s, 0, 0) }];
        decide(&LIMITS, &look(&queue)).warnings
    };
    assert_eq!(warnings(3000.0, 10), []);
    assert_eq!(warnings(9000.0, 0), [], "a rough estimate is no reason");
    let [(_, warning)] = &warnings(9000.0, 10)[..] else { panic!("no warning") };
    assert!(
        warning.starts_with("jobs take up to 2:30:00 by the forecast, and an allocation works for 59:00"),
        "{warning}"
    );
}

#[test]
fn every_decision_says_why() {
    let queue = [group(100, 600.0, 0, 0)];
    let why = |look: &Look<'_>| decide(&LIMITS, look).why;
    assert_eq!(why(&look(&[])), "no job waits");
    assert_eq!(why(&look(&queue)), "100 jobs wait");
    let busy = [group(1, 0.5, 1, 0)];
    assert_eq!(why(&look(&busy)), "1 job waits; the present workers start them within 1:00");
    let few = [group(2, 600.0, 0, 0)];
    let coming = Look { waiting: vec![1, 2], ..look(&few) };
    assert_eq!(why(&coming), "2 jobs wait; 2 allocations will take them up");
    let full = Look { waiting: vec![1, 2, 3, 4], ..look(&queue) };
    assert_eq!(why(&full), "100 jobs wait; --backlog 4: 4 allocations wait in Slurm's queue already");
    let all = Look { working: 16, ..look(&queue) };
    assert_eq!(why(&all), "100 jobs wait; --max-workers 16: 16 allocations in all");
}

/// An allocation of the simulated cluster: it waits, works, and is idle at the end.
#[derive(Clone, Copy)]
struct Simulated {
    id: u64,
    starts_s: i64,
    /// End of its job, if it has one.
    busy_until_s: Option<i64>,
    idle_since_s: i64,
}

/// A cluster of `nodes` on which allocations wait 30 s, jobs take `job_s`, and idle allocations end after 60 s. Returns the time of the
/// last result, the allocations submitted and cancelled, and the maximum number that waited and that there were.
fn simulate(limits: &Limits, mut jobs: u64, job_s: i64, nodes: usize) -> (i64, u64, u64, usize, usize) {
    let (mut allocations, mut next_id, mut cancelled) = (Vec::<Simulated>::new(), 0, 0);
    let (mut done_s, mut empty_since) = (0, None);
    let (mut most_waiting, mut most) = (0, 0);
    let kind = worker(1);
    for now_s in (0..200_000).step_by(5) {
        allocations.sort_by_key(|one| (one.starts_s, one.id));
        for (index, one) in allocations.iter_mut().enumerate() {
            if one.starts_s > now_s || index >= nodes {
                // Slurm starts it when a node is free.
                one.starts_s = one.starts_s.max(now_s + 5);
                one.idle_since_s = one.starts_s;
                continue;
            }
            if one.busy_until_s.is_some_and(|end_s| end_s <= now_s) {
                (one.busy_until_s, one.idle_since_s, done_s) = (None, now_s, now_s);
            }
            if one.busy_until_s.is_none() && jobs > 0 {
                jobs -= 1;
                one.busy_until_s = Some(now_s + job_s);
            }
        }
        allocations.retain(|one| one.busy_until_s.is_some() || now_s - one.idle_since_s < 60);
        let working = allocations.iter().filter(|one| one.starts_s <= now_s).count();
        let busy = allocations.iter().filter(|one| one.busy_until_s.is_some()).count();
        let waiting: Vec<u64> =
            allocations.iter().filter(|one| one.starts_s > now_s).map(|one| one.id).collect();
        let queue: Vec<NeedsDepth> = if jobs == 0 {
            Vec::new()
        } else {
            vec![group(jobs, job_s as f64, working as u64, (working - busy) as u64)]
        };
        empty_since = if jobs == 0 { empty_since.or(Some(at(now_s))) } else { None };
        (most_waiting, most) = (most_waiting.max(waiting.len()), most.max(allocations.len()));
        let base = look(&queue);
        let now = at(now_s);
        let seen = Look { now, waiting, working: working as u32, worker: Some(&kind), empty_since, ..base };
        let decision = decide(limits, &seen);
        allocations.retain(|one| !decision.cancel.contains(&one.id));
        cancelled += decision.cancel.len() as u64;
        for _ in 0..decision.submit {
            next_id += 1;
            let starts_s = now_s + 30;
            allocations.push(Simulated { id: next_id, starts_s, busy_until_s: None, idle_since_s: starts_s });
        }
        if jobs == 0 && allocations.is_empty() {
            break;
        }
    }
    assert!(
        allocations.is_empty() && jobs == 0,
        "{jobs} jobs are left, and {} allocations",
        allocations.len()
    );
    (done_s, next_id, cancelled, most_waiting, most)
}

#[test]
fn a_simulated_cluster_ends_all_jobs_and_is_empty_afterwards() {
    // 200 jobs of 5 minutes on 16 workers: 13 rounds.
    let (done_s, submitted, _, most_waiting, most) = simulate(&LIMITS, 200, 300, 100);
    assert!((13 * 300..15 * 300).contains(&done_s), "{done_s}");
    assert!(most_waiting <= 4 && most <= 16, "{most_waiting}, {most}");
    assert!((16..=24).contains(&submitted), "{submitted}");
    // A full cluster with two nodes: the backlog waits, and is cancelled at the end.
    let (done_s, submitted, cancelled, most_waiting, _) = simulate(&LIMITS, 40, 300, 2);
    assert!((20 * 300..22 * 300).contains(&done_s), "{done_s}");
    assert!(most_waiting <= 4 && submitted <= 10, "{most_waiting}, {submitted}");
    assert_eq!(cancelled, 4, "the backlog");
    // Jobs of a second: one worker does.
    let (_, submitted, ..) =
        simulate(&Limits { start_within: Duration::from_secs(600), ..LIMITS }, 100, 5, 100);
    assert_eq!(submitted, 1);
}
