//! Tests of the core-hours that attempts count.

use super::*;

on_both_engines!(an_attempt_counts_once_when_it_ends, an_attempt_counts_no_more_than_the_run_that_is_known);

async fn an_attempt_counts_once_when_it_ends(place: Place) {
    let (store, tokens) = with_projects(&place, &[("p", 1, 1)]).await;
    let worker = register(&store).await;
    submit(&store, &tokens[0][0], 2).await;
    let used = async || {
        let projects = listed(&store).await;
        (projects[0].name.clone(), projects[0].used_core_hours)
    };
    let hours = |hours: f64| ("p".to_owned(), hours);
    let jobs = claim(&store, worker, 1, at(0)).await;
    assert_eq!(used().await, hours(0.0), "it runs");
    let beat = async |at_ms, until_ms| {
        let beats = vec![Beat { job_id: jobs[0].0, attempt: jobs[0].1 }];
        store.heartbeat(worker, beats, Timestamp(at_ms), Timestamp(until_ms)).await.unwrap().unwrap();
    };
    beat(HOUR_MS / 2, HOUR_MS).await;
    // A lost attempt counts its slot of the worker, here all threads, until the worker was last seen.
    let policy = RetryPolicy::default();
    assert_eq!(store.expire(policy, at(HOUR_MS)).await.unwrap().lost, 1);
    assert_eq!(used().await, hours(4.0));
    // A late heartbeat: it was never lost.
    beat(HOUR_MS, 2 * HOUR_MS).await;
    assert_eq!(used().await, hours(0.0));
    succeed(&store, worker, jobs[0], 2 * HOUR_MS).await;
    assert_eq!(used().await, hours(6.0));
    succeed(&store, worker, jobs[0], 3 * HOUR_MS).await;
    assert_eq!(used().await, hours(6.0), "a repeated delivery");
    // The clock was set back.
    let jobs = claim(&store, worker, 1, at(2 * HOUR_MS)).await;
    succeed(&store, worker, jobs[0], HOUR_MS).await;
    assert_eq!(used().await, hours(6.0));
    // The used hours stay used.
    for (sweep,) in query_as::<(String,)>("SELECT id FROM sweeps").fetch_all(&store.readers).await.unwrap() {
        assert!(store.delete_sweep(sweep.parse().unwrap(), Timestamp(0)).await.unwrap());
    }
    store.delete_leftovers().await.unwrap();
    let attempts: i64 =
        query_scalar("SELECT count(*) FROM attempts").fetch_one(&store.readers).await.unwrap();
    assert_eq!((attempts, used().await), (0, hours(6.0)));
    store.close().await;
}

/// An outage of the server lasts for two days, during which runs end and workers stop.
async fn an_attempt_counts_no_more_than_the_run_that_is_known(place: Place) {
    let (store, tokens) = with_projects(&place, &[("p", 1, 1)]).await;
    let worker = register(&store).await;
    submit(&store, &tokens[0][0], 4).await;
    let used = async || listed(&store).await[0].used_core_hours;
    let jobs = claim(&store, worker, 4, at(0)).await;
    let beats = jobs.iter().map(|(job_id, attempt)| Beat { job_id: *job_id, attempt: *attempt }).collect();
    store.heartbeat(worker, beats, Timestamp(HOUR_MS), Timestamp(3 * HOUR_MS)).await.unwrap().unwrap();
    let end = 48 * HOUR_MS;
    // The worker has four slots: a lost attempt counts two of eight threads.
    assert_eq!(store.expire(RetryPolicy::default(), at(end)).await.unwrap().lost, 4);
    assert_eq!(used().await, 4.0 * 2.0);
    // A result replaces this: three threads for two hours.
    deliver(&store, worker, jobs[0], Stated { threads: 3, wall_ms: 2 * HOUR_MS }, end).await;
    assert_eq!(used().await, 3.0 * 2.0 + 6.0);
    // A worker cannot state more threads than it registered.
    deliver(&store, worker, jobs[1], Stated { threads: 60_000, wall_ms: HOUR_MS }, end).await;
    assert_eq!(used().await, 2.0 * 2.0 + 6.0 + 8.0);
    // The stated time includes an earlier attempt.
    deliver(&store, worker, jobs[2], Stated { threads: 1, wall_ms: 100 * HOUR_MS }, end).await;
    assert_eq!(used().await, 2.0 + 6.0 + 8.0 + 48.0);
    store.close().await;
}
