//! Tests of the queries behind reasons and forecasts.

use std::time::Duration;

use roost_api::job::Needs;
use roost_api::time::Timestamp;

use super::super::eligible_jobs::fits;
use super::super::testing::{Place, on_both_engines};
use super::super::*;
use super::query_plans::plan;
use super::store;
use crate::store::database::{query_scalar, raw_sql};

on_both_engines!(
    group_needs_are_met_by_the_rules_of_claims,
    count_of_jobs_ahead_in_the_queue_is_bounded,
    the_cost_of_a_group_is_sampled_from_its_own_jobs,
);

async fn group_needs_are_met_by_the_rules_of_claims(place: Place) {
    let store = place.open().await;
    let backends = ["cpu", "gpu"];
    for backend in backends {
        for memory_mib in [None, Some(0), Some(1000), Some(4000)] {
            let worker = OnlineWorker {
                id: "w".to_owned(),
                backend: backend.to_owned(),
                memory_mib,
                draining: false,
                threads: 1,
                jobs: 0,
            };
            for needed in [None, Some("cpu"), Some("gpu"), Some("")] {
                for needed_mib in [None, Some(0), Some(1000), Some(1001)] {
                    let needs = Needs { backend: needed.map(str::to_owned), memory_mib: needed_mib };
                    let sql = concat!(
                        "SELECT ",
                        fits!("j", "me"),
                        " FROM (SELECT ? AS backend, ? AS memory_mib) AS me,
                               (SELECT ? AS needs_backend, ? AS needs_memory_mib) AS j"
                    );
                    let by_claim: Option<bool> = query_scalar(sql)
                        .bind(backend)
                        .bind(memory_mib)
                        .bind(&needs.backend)
                        .bind(needed_mib)
                        .fetch_one(&store.readers)
                        .await
                        .unwrap();
                    assert_eq!(meets(&worker, &needs), by_claim.unwrap_or(false), "{worker:?} {needs:?}");
                }
            }
        }
    }
    store.close().await;
}

#[tokio::test]
async fn reasons_and_forecasts_use_indices_without_sorting() {
    let (store, _dir) = store().await;
    let [first, last] = waiting::SWEEP_ENDS;
    for (sql, index) in [
        (waiting::SIGHTS, "workers_by_last_seen"),
        (
            waiting::SIGHTS,
            "SEARCH f USING PRIMARY KEY (fill_digest=? AND solver_revision=? AND backend=? AND device=?)",
        ),
        (waiting::QUEUES, "INDEX jobs_to_claim (priority=? AND owner=? AND queue=?)"),
        (waiting::COMMON, "INDEX jobs_to_claim (priority=? AND owner=? AND queue=?)"),
        (waiting::BEFORE, "INDEX jobs_to_claim (priority=? AND owner=? AND queue=? AND "),
        (waiting::WAITING_FOR_FILLS, "INDEX jobs_by_sweep (sweep_id=? AND state=?)"),
        (first, "INDEX jobs_by_sweep (sweep_id=? AND state=?)"),
        (last, "INDEX jobs_by_sweep (sweep_id=? AND state=?)"),
        (waiting::IN_PAUSE, "INDEX jobs_by_not_before"),
        (speeds::FINISHED, "INDEX jobs_ended (state=?)"),
        (speeds::FINISHED_OF_SWEEP, "INDEX jobs_by_sweep (sweep_id=? AND state=?)"),
        (speeds::QUEUED, "INDEX jobs_to_claim (priority=? AND owner=? AND queue=? AND "),
    ] {
        let steps = plan(&store, sql).await;
        assert!(steps.contains(index), "{index}: {sql}\n{steps}");
        // Needs of small sweeps are sorted, and the first of the 1,000 jobs at an end of a sweep.
        let sorts = steps.matches("TEMP B-TREE").count();
        let allowed = if [waiting::COMMON, waiting::BEFORE, first, last].contains(&sql) { 1 } else { 0 };
        assert!(sorts <= allowed, "{sql}\n{steps}");
    }
    store.close().await;
}

/// Queues 3,000 jobs in the common queue of owner 0, of which every hundredth needs a GPU.
async fn queue_jobs(store: &Store) {
    let sql = "
        INSERT INTO scenarios (digest, body) VALUES ('any', '{}'), ('gpu', '{}');
        WITH RECURSIVE n (value) AS (SELECT 1 UNION ALL SELECT value + 1 FROM n WHERE value < 3000)
        INSERT INTO jobs (id, scenario_digest, seed, priority, queue_position, needs_backend, labels, cache, submitted_at)
        SELECT 'j' || value, CASE WHEN value % 100 = 0 THEN 'gpu' ELSE 'any' END, 1, 0, value,
            CASE WHEN value % 100 = 0 THEN 'gpu' END, '{}', 'use', 0 FROM n;";
    let write =
        store.writer.write(move |tx| Box::pin(async move { Ok(raw_sql(sql).execute(tx).await.map(drop)?) }));
    write.await.unwrap();
}

async fn count_of_jobs_ahead_in_the_queue_is_bounded(place: Place) {
    let store = place.open().await;
    queue_jobs(&store).await;
    let (mut groups, _) = store.queue_groups().await.unwrap();
    groups.sort_by_key(|group| group.jobs);
    let [gpu, any] = &groups[..] else { panic!("{groups:?}") };
    assert_eq!((gpu.jobs, gpu.first, gpu.last), (30, 100, 3000));
    assert_eq!((any.jobs, any.first, any.last), (2970, 1, 2999));
    let place = |position| QueuePlace { seq: position, priority: 0, owner: 0, queue: 0, position };
    let count = async |place| {
        let counted = store.jobs_before(0, place).await.unwrap();
        (counted.of(&any.needs), counted.of(&gpu.needs), counted.are_all())
    };
    for (position, expected) in [(1, (0, 0, true)), (500, (495, 4, true)), (1001, (990, 10, true))] {
        assert_eq!(count(place(position)).await, expected, "{position}");
    }
    // No more jobs are read, however few of them need a GPU.
    assert_eq!(count(place(2900)).await, (991, 10, false));
    // A job that was queued again stands behind, whatever its age.
    assert_eq!(count(QueuePlace { seq: 1, ..place(700) }).await, (693, 6, true));
    let none = store.online_workers(Timestamp(0), Duration::from_secs(1)).await.unwrap();
    assert!(none.is_empty());
    store.close().await;
}

async fn the_cost_of_a_group_is_sampled_from_its_own_jobs(place: Place) {
    let store = place.open().await;
    queue_jobs(&store).await;
    let (groups, _) = store.queue_groups().await.unwrap();
    assert_eq!(groups.len(), 2);
    for group in &groups {
        let digest = group.needs.backend.as_deref().unwrap_or("any");
        let sampled = store.sampled_queue(group).await.unwrap();
        assert!(sampled.len() >= 28, "{} scenarios at 8 places", sampled.len());
        assert!(sampled.iter().all(|scenario| scenario.digest == digest), "{digest}: {sampled:?}");
    }
    store.close().await;
}
