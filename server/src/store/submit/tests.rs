//! Tests of large sweeps: stored in slices, visible as one, and gone when interrupted.

use std::sync::Arc;
use std::time::Duration;

use roost_api::ids::{JobId, WorkerId};
use roost_api::worker::WorkerRegistration;
use roost_solver::Limits;
use roost_solver::mesh::Meshes;
use serde_json::{Value, json};
use uuid::Uuid;

use super::super::writer::SLICE as BATCH;
use super::*;
use crate::clock::Now;
use crate::queue::Refusal;
use crate::store::database::{query_as, query_scalar, raw_sql};
use crate::store::testing::{Place, on_both_engines};
use crate::store::{Claim, JobFilter};
use crate::sweep::{SweepLimits, read};

on_both_engines!(
    a_sweep_of_many_batches_is_stored_whole_or_not_at_all,
    sweep_is_neither_listed_nor_claimed_before_its_submission_ends,
    an_interrupted_submission_leaves_nothing,
    a_deletion_does_not_touch_a_new_sweep_with_the_same_identifier,
    a_deleted_sweep_does_not_return,
    jobs_of_a_hidden_sweep_do_not_change,
    other_writes_wait_for_at_most_one_submission_slice,
);

const LIMITS: SweepLimits =
    SweepLimits { max_jobs: 100_000, scenario: Limits { max_subparticles: u64::MAX, max_steps: u64::MAX } };

const NOW: Now = Now { wall: Timestamp(0), lease: Timestamp(0) };

/// Two design points with this number of replicates.
fn document(replicates: u32) -> Value {
    let base = json!({"experiment": "hopper", "product": {"count": 6, "subparticle_radius_m": 0.008}});
    let factors = json!([{"pointer": "/equipment/gate_opening_m", "levels": [0.05, 0.06]}]);
    json!({"name": "s", "base": base, "design": {"kind": "grid"}, "factors": factors, "replicates": replicates})
}

fn sweep(id: SweepId, replicates: u32) -> NewSweep {
    let (spec, expansion) = read(document(replicates), &Meshes::default(), LIMITS).unwrap();
    NewSweep::new(id, String::new(), document(replicates).to_string(), spec, expansion).unwrap()
}

/// Sweeps, points, jobs, different seeds, and the range of queue positions.
async fn numbers(store: &Store) -> (i64, i64, i64, i64, i64) {
    let sql = "SELECT (SELECT count(*) FROM sweeps), (SELECT count(*) FROM design_points), count(*),
               count(DISTINCT seed), coalesce(max(queue_position) - min(queue_position), 0) FROM jobs";
    query_as(sql).fetch_one(&store.readers).await.unwrap()
}

/// The rows that sweeps fill.
async fn rows(store: &Store) -> i64 {
    let sql = "SELECT (SELECT count(*) FROM sweeps) + (SELECT count(*) FROM design_points) + (SELECT count(*) FROM jobs)
               + (SELECT count(*) FROM scenarios) + (SELECT count(*) FROM results) + (SELECT count(*) FROM attempts)";
    query_scalar(sql).fetch_one(&store.readers).await.unwrap()
}

async fn register(store: &Store) -> WorkerId {
    let worker_id = WorkerId::new();
    let worker = WorkerRegistration {
        worker_id,
        name: "a".to_owned(),
        api_version: "v1".to_owned(),
        solver_revision: SOLVER_REVISION,
        backend: "cpu".to_owned(),
        device: "a".to_owned(),
        threads: 1,
        memory_mib: None,
    };
    store.register_worker(worker, NOW.wall).await.unwrap().unwrap();
    worker_id
}

async fn claim(store: &Store, worker: WorkerId, max_jobs: u32) -> Vec<JobId> {
    let (request_id, lease) = (Uuid::now_v7(), Duration::from_secs(9));
    let claim = Claim {
        request_id,
        worker,
        max_jobs,
        lease,
        max_frames_bytes: 0,
        checkpoints: None,
        shares_fills: false,
        max_fill_bytes: 0,
    };
    let claimed = store.claim(claim, NOW).await.unwrap().unwrap();
    claimed.attempts.iter().map(|attempt| attempt.job_id).collect()
}

async fn a_sweep_of_many_batches_is_stored_whole_or_not_at_all(place: Place) {
    let store = place.open().await;
    let broken = sweep(SweepId::new(), 1200);
    let points = read(document(1200), &Meshes::default(), LIMITS).unwrap().1.points;
    let batches = JobBatches::start(broken.head.id, 2400, move |encoder| {
        encoder.encode(points.trials(0, 1200).take(1700))
    });
    assert!(batches.is_large());
    let lost = store.insert_sweep(NewSweep { batches, ..broken }, NOW.wall, ()).await;
    assert!(matches!(lost, Err(StoreError::Unfinished { queued: 1700, jobs: 2400 })), "{lost:?}");
    assert_eq!(rows(&store).await, 0);

    let id = SweepId::new();
    store.insert_sweep(sweep(id, 1200), NOW.wall, ()).await.unwrap();
    assert_eq!(numbers(&store).await, (1, 2, 2400, 1200, 2399));
    store.insert_sweep(sweep(id, 1200), NOW.wall, ()).await.unwrap();
    assert_eq!(numbers(&store).await.2, 2400, "a repeat stores nothing");
    store.close().await;
}

async fn sweep_is_neither_listed_nor_claimed_before_its_submission_ends(place: Place) {
    let store = place.open().await;
    let (id, worker) = (SweepId::new(), register(&store).await);
    let listing = async || {
        let (jobs, _) = store.jobs(JobFilter { limit: 9, ..JobFilter::default() }).await.unwrap();
        let (sweeps, _) = store.sweeps(None, None, 9).await.unwrap();
        let counts = store.queue_counts(NOW.wall, Duration::from_secs(9)).await.unwrap();
        let queued: i64 = counts.jobs.iter().map(|(_, jobs)| jobs).sum();
        (jobs.len(), sweeps.len(), queued, counts.oldest_queued_at.is_some())
    };
    let version = async || store.version(crate::store::Subject::Everything).await.unwrap();
    let mut submission = store.begin_sweep(sweep(id, 600), NOW.wall).await.unwrap().unwrap();
    let mut slices = 0;
    loop {
        assert_eq!(listing().await, (0, 0, 0, false), "after {slices} slices");
        assert!(store.sweep(id).await.unwrap().is_none());
        assert_eq!(claim(&store, worker, 3).await, []);
        assert!(store.cancel_sweep(id, NOW.wall).await.unwrap().is_err(), "there is no such sweep yet");
        let before = version().await;
        if !store.store_slice(&mut submission, NOW.wall).await.unwrap() {
            assert_ne!(version().await, before, "listings change");
            break;
        }
        slices += 1;
    }
    assert_eq!(slices, 1200_usize.div_ceil(BATCH));
    assert_eq!(listing().await, (9, 1, 1200, true));
    assert_eq!(store.sweep(id).await.unwrap().unwrap().counts.queued, 1200);
    // The sweep alternates with a smaller one of the same owner, although its jobs have a queue of their own.
    let small = SweepId::new();
    store.insert_sweep(sweep(small, 2), NOW.wall, ()).await.unwrap();
    let claimed = claim(&store, worker, 4).await;
    let sql = "SELECT count(*) FROM jobs WHERE state = 'running' AND sweep_id = ?";
    let running: i64 = query_scalar(sql).bind(small.to_string()).fetch_one(&store.readers).await.unwrap();
    assert_eq!((claimed.len(), running), (4, 2));
    store.close().await;
}

async fn an_interrupted_submission_leaves_nothing(place: Place) {
    let store = place.open().await;
    let id = SweepId::new();
    let mut submission = store.begin_sweep(sweep(id, 3000), NOW.wall).await.unwrap().unwrap();
    for _ in 0..3 {
        assert!(store.store_slice(&mut submission, NOW.wall).await.unwrap());
    }
    assert_eq!(numbers(&store).await.2, 3 * BATCH as i64);
    store.close().await;

    let store = place.open().await;
    assert!(store.sweep(id).await.unwrap().is_none());
    assert_eq!(claim(&store, register(&store).await, 1).await, []);
    store.delete_leftovers().await.unwrap();
    assert_eq!(rows(&store).await, 0);

    // The client repeats its request before the rest is deleted.
    let mut submission = store.begin_sweep(sweep(id, 3000), NOW.wall).await.unwrap().unwrap();
    assert!(store.store_slice(&mut submission, NOW.wall).await.unwrap());
    store.insert_sweep(sweep(id, 3000), NOW.wall, ()).await.unwrap();
    assert_eq!(numbers(&store).await, (1, 2, 6000, 3000, 5999));
    store.close().await;
}

/// Changes rows as no request does.
async fn write(store: &Store, sql: &'static str) {
    store
        .writer
        .write(move |tx| Box::pin(async move { Ok(raw_sql(sql).execute(tx).await.map(drop)?) }))
        .await
        .unwrap();
}

async fn newest_sweep(store: &Store) -> i64 {
    query_scalar("SELECT max(seq) FROM sweeps").fetch_one(&store.readers).await.unwrap()
}

async fn a_deletion_does_not_touch_a_new_sweep_with_the_same_identifier(place: Place) {
    let store = place.open().await;
    let id = SweepId::new();
    let mut interrupted = store.begin_sweep(sweep(id, 1200), NOW.wall).await.unwrap().unwrap();
    let before = newest_sweep(&store).await;
    assert!(store.store_slice(&mut interrupted, NOW.wall).await.unwrap());
    write(&store, "UPDATE sweeps SET state = 'deleting'").await;
    let mut repeat = store.begin_sweep(sweep(id, 1200), NOW.wall).await.unwrap().unwrap();
    let after = newest_sweep(&store).await;
    assert_ne!(before, after);
    assert!(store.store_slice(&mut repeat, NOW.wall).await.unwrap());
    // The first deletion goes on, at first during the new submission.
    store.delete_hidden(before).await.unwrap();
    while store.store_slice(&mut repeat, NOW.wall).await.unwrap() {}
    for seq in [before, after] {
        store.delete_hidden(seq).await.unwrap();
        assert_eq!(numbers(&store).await, (1, 2, 2400, 1200, 2399), "{seq}");
    }
    store.close().await;
}

async fn a_deleted_sweep_does_not_return(place: Place) {
    let store = place.open().await;
    let mut submission = store.begin_sweep(sweep(SweepId::new(), 600), NOW.wall).await.unwrap().unwrap();
    for _ in 0..1200_usize.div_ceil(BATCH) {
        assert!(store.store_slice(&mut submission, NOW.wall).await.unwrap());
    }
    write(&store, "UPDATE sweeps SET state = 'deleting'").await;
    let last = store.store_slice(&mut submission, NOW.wall).await;
    assert!(matches!(last, Err(StoreError::Interrupted)), "{last:?}");
    store.delete_leftovers().await.unwrap();

    for replicates in [2, 1200] {
        let id = SweepId::new();
        store.insert_sweep(sweep(id, replicates), NOW.wall, ()).await.unwrap();
        store.cancel_sweep(id, NOW.wall).await.unwrap().unwrap();
        assert!(store.delete_sweep(id, NOW.wall).await.unwrap());
        store.insert_sweep(sweep(id, replicates), NOW.wall, ()).await.unwrap();
        assert_eq!(rows(&store).await, 0);
    }
    store.close().await;
}

async fn jobs_of_a_hidden_sweep_do_not_change(place: Place) {
    let store = place.open().await;
    let (id, worker) = (SweepId::new(), register(&store).await);
    store.insert_sweep(sweep(id, 2), NOW.wall, ()).await.unwrap();
    store.cancel_sweep(id, NOW.wall).await.unwrap().unwrap();
    let job = store.jobs(JobFilter { limit: 1, ..JobFilter::default() }).await.unwrap().0[0].id;
    write(&store, "UPDATE sweeps SET state = 'deleting'").await;
    assert_eq!(store.job(job).await.unwrap(), None);
    assert_eq!(store.retry_job(job, None).await.unwrap(), Err(Refusal::NoJob));
    assert_eq!(store.cancel_job(job, NOW.wall).await.unwrap(), Err(Refusal::NoJob));
    assert_eq!(store.pause_job(job, true).await.unwrap(), Err(Refusal::NoJob));
    // No request leaves these rows: the claim and the deletion do not rely on it.
    write(&store, "UPDATE jobs SET state = 'queued', ended_at = NULL").await;
    assert_eq!(claim(&store, worker, 4).await, []);
    write(&store, "INSERT INTO checkpoints SELECT id, 1, 'x', 1, 0, 1, 'cpu', 'a' FROM jobs").await;
    store.delete_leftovers().await.unwrap();
    assert_eq!(rows(&store).await, 0);
    store.close().await;
}

async fn other_writes_wait_for_at_most_one_submission_slice(place: Place) {
    let store = Arc::new(place.open().await);
    let id = SweepId::new();
    // The time that the writer is held is counted in commits, since times depend on the machine. The commits are a slice that runs,
    // one that was queued before, and the write itself.
    let (other, mut longest, mut writes) = (store.clone(), 0, 0);
    let mut change = async |work: tokio::task::JoinHandle<()>| {
        while !work.is_finished() {
            // Counted once the write is queued, and in the write itself: this task may be late with either.
            let counts = other.clone();
            let mut write = Box::pin(other.writer.write(move |_| {
                let count = counts.writer.commits().count();
                Box::pin(async move { Ok(count) })
            }));
            if futures_util::poll!(write.as_mut()).is_pending() {
                let before = other.writer.commits().count();
                longest = longest.max((write.await.unwrap() + 1).saturating_sub(before));
                writes += 1;
            }
        }
        work.await.unwrap();
    };
    let spawned = |store: Arc<Store>, step: u32| {
        tokio::spawn(async move {
            match step {
                0 => store.insert_sweep(sweep(id, 5000), NOW.wall, ()).await.unwrap(),
                1 => store.cancel_sweep(id, NOW.wall).await.unwrap().unwrap(),
                2 => assert_eq!(store.retry_sweep(id, None).await.unwrap(), Ok(10_000)),
                3 => store.cancel_sweep(id, NOW.wall).await.unwrap().unwrap(),
                _ => assert!(store.delete_sweep(id, NOW.wall).await.unwrap()),
            }
        })
    };
    for step in 0..5 {
        change(spawned(store.clone(), step)).await;
    }
    assert_eq!(rows(&store).await, 0);
    assert!(writes > 5 && longest <= 3, "{writes} writes, {longest} commits");
    store.close().await;
}
