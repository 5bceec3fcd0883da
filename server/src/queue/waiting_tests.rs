//! Tests of the reasons why jobs wait.

use super::*;

const JOB: QueuedJob = QueuedJob {
    paused: false,
    retry_at: None,
    spent: None,
    newest: None,
    alone: false,
    needs: Needs { backend: None, memory_mib: None },
};

fn worker(jobs: u32, slots: u32) -> WorkerSight {
    WorkerSight {
        name: "a".to_owned(),
        backend: "cpu".to_owned(),
        memory_mib: None,
        draining: false,
        fits: true,
        leaves_it: false,
        fill_job: None,
        jobs,
        alone: false,
        slots,
    }
}

fn before(higher: u64, same: u64) -> JobsBefore {
    JobsBefore { higher, same, is_exact: true }
}

/// Reason and words without jobs that come first.
fn why(job: &QueuedJob, workers: &[WorkerSight]) -> (WaitReason, String) {
    let cause = why_waiting(job, workers, before(0, 0));
    (cause.reason, cause.detail)
}

#[test]
fn every_waiting_reason_has_its_condition() {
    let reason = |job: &QueuedJob, workers: &[WorkerSight], first| why_waiting(job, workers, first).reason;
    let none = before(0, 0);
    let (busy, free) = (worker(2, 2), worker(1, 2));
    let paused = QueuedJob { paused: true, retry_at: Some(Timestamp(5)), ..JOB };
    assert_eq!(reason(&paused, &[], none), WaitReason::Paused);
    assert_eq!(reason(&QueuedJob { paused: false, ..paused }, &[], none), WaitReason::RetryPause);
    let spent = SpentBudget { project: "p".to_owned(), used_core_hours: 10.24, budget_core_hours: 10.0 };
    let spent = QueuedJob { spent: Some(spent), ..JOB };
    assert_eq!(reason(&spent, &[], none), WaitReason::BudgetUsed);
    assert_eq!(
        why(&spent, std::slice::from_ref(&free)).1,
        "project p has used 10.2 of 10 core-hours; raise it with `roost project set p --budget-core-hours N`"
    );
    let draining = WorkerSight { draining: true, ..free.clone() };
    assert_eq!(reason(&JOB, &[], none), WaitReason::NoWorker);
    assert_eq!(reason(&JOB, std::slice::from_ref(&draining), none), WaitReason::NoWorker);
    let misfit = WorkerSight { fits: false, ..free.clone() };
    assert_eq!(reason(&JOB, &[misfit.clone(), draining], none), WaitReason::NoFittingWorker);
    let fill = WorkerSight { fill_job: Some(JobId::new()), ..free.clone() };
    assert_eq!(reason(&JOB, &[fill.clone(), misfit], before(3, 0)), WaitReason::WaitingForFill);
    assert_eq!(reason(&JOB, &[fill, free.clone()], before(3, 0)), WaitReason::Behind);
    let alone = QueuedJob { alone: true, ..JOB };
    assert_eq!(reason(&alone, &[free.clone(), busy.clone()], before(0, 1)), WaitReason::NeedsIdleWorker);
    assert_eq!(reason(&alone, &[worker(0, 2), busy.clone()], none), WaitReason::Next);
    assert_eq!(reason(&JOB, std::slice::from_ref(&busy), before(0, 1)), WaitReason::Behind);
    assert_eq!(reason(&JOB, std::slice::from_ref(&busy), none), WaitReason::WorkersBusy);
    assert_eq!(reason(&JOB, &[busy, free], none), WaitReason::Next);
    let with_loner = WorkerSight { alone: true, ..worker(1, 4) };
    assert_eq!(
        reason(&JOB, &[with_loner], none),
        WaitReason::WorkersBusy,
        "it takes nothing beside a job that runs alone"
    );
}

#[test]
fn details_of_waiting_reasons_have_their_numbers() {
    let needs = |backend: Option<&str>, memory_mib| QueuedJob {
        needs: Needs { backend: backend.map(str::to_owned), memory_mib },
        ..JOB
    };
    let misfit = |name: &str, backend: &str, memory_mib| WorkerSight {
        name: name.to_owned(),
        backend: backend.to_owned(),
        memory_mib,
        fits: false,
        ..worker(0, 1)
    };
    let workers = [misfit("a", "cpu", None), misfit("b", "gpu", Some(8192)), misfit("c", "gpu", Some(4096))];
    let (reason, detail) = why(&needs(Some("gpu"), Some(12288)), &workers);
    assert_eq!(reason, WaitReason::NoFittingWorker);
    assert_eq!(detail, "it needs 12288 MiB of memory, and the worker with the most, b, has 8192 MiB");
    let (_, detail) = why(&needs(Some("tpu"), None), &workers);
    assert_eq!(detail, "it needs the backend tpu, and the online workers have cpu, gpu");
    let (_, detail) = why(&needs(None, Some(1)), &workers[..1]);
    assert_eq!(detail, "it needs 1 MiB of memory, and no online worker states its memory");

    let failed = QueuedJob {
        retry_at: Some(Timestamp(0)),
        newest: Some((2, AttemptOutcome::Worker, "no space".to_owned())),
        ..JOB
    };
    let expected = "attempt 2 ended as worker (no space); the next one starts at 1970-01-01T00:00:00.000Z at the earliest";
    assert_eq!(why(&failed, &[]).1, expected);

    assert_eq!(before(0, 1).in_words(), "behind 1 job");
    assert_eq!(before(12, 328).in_words(), "behind 340 jobs, 12 of them of higher priority");
    assert_eq!(before(2, 0).in_words(), "behind 2 jobs, all of higher priority");
    assert_eq!(JobsBefore { is_exact: false, ..before(0, 5000) }.in_words(), "behind about 5000 jobs");
    assert_eq!(why(&JOB, &[worker(2, 2)]).1, "it is next; 1 fitting worker with 2 slots runs 2 jobs");
    let other = WorkerSight { leaves_it: true, ..worker(0, 1) };
    let (reason, detail) = why(&JOB, &[worker(1, 1), other]);
    assert_eq!(reason, WaitReason::WorkersBusy, "the idle worker leaves the job to the other");
    assert!(detail.ends_with("; the worker a has failed it, and leaves it to another one"), "{detail}");
}
