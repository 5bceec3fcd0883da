//! Tests of the temporary tables of the leader on PostgreSQL, and of claims beside a transaction that stays open.

use roost_api::ids::WorkerId;
use roost_api::time::Timestamp;
use uuid::Uuid;

use super::super::claim_statements::TAKE_IN_POSTGRES;
use super::super::database::{AssertSqlSafe, Connection, query, query_scalar, raw_sql};
use super::super::eligible_jobs::{eligible_jobs, eligible_jobs_of_writer, rounds_in};
use super::super::leader_tables::{WRONG, advance};
use super::super::testing::Place;
use super::super::*;
use super::postgres::address;
use crate::clock::Now;

/// A worker, and jobs of one queue.
const JOBS: &str = "
    INSERT INTO workers (id, name, solver_revision, backend, device, threads, registered_at, last_seen_at)
    VALUES ('00000000-0000-7000-8000-000000000001', '', 1, 'cpu', '', 1, 0, 0);
    INSERT INTO scenarios (digest, body) VALUES ('d', '{}');
    INSERT INTO jobs (id, scenario_digest, seed, priority, queue_position, labels, cache, submitted_at)
    SELECT '00000000-0000-7000-8000-' || lpad(place::text, 12, '0'), 'd', 1, 0, place, '{}', 'use', 0 FROM generate_series(1, 5000) AS place";

const WORKER: &str = "00000000-0000-7000-8000-000000000001";

async fn execute(store: &Store, sql: &'static str) {
    let write = store.writer.write(move |tx| Box::pin(async move { Ok(raw_sql(sql).execute(tx).await?) }));
    write.await.unwrap();
}

/// The pages that a statement on the connection of the writer reads. A search for jobs has the worker as its first parameter.
async fn pages(store: &Store, sql: &'static str, parameter: &'static str) -> u64 {
    let read = store.writer.write(move |tx| {
        Box::pin(async move {
            advance(tx).await?;
            let explain = AssertSqlSafe(format!("EXPLAIN (ANALYZE, BUFFERS, TIMING OFF) {sql}"));
            let mut asked = query_scalar::<String>(explain).bind(parameter);
            if parameter == WORKER {
                asked = asked.bind(0).bind(0).bind(8).bind(false).bind(8);
            }
            Ok(asked.fetch_all(tx).await?)
        })
    });
    let plan = read.await.unwrap().join("\n");
    let buffers = plan.split("Buffers: shared hit=").nth(1).expect(&plan);
    buffers.split(|letter: char| !letter.is_ascii_digit()).next().unwrap().parse().expect(&plan)
}

async fn claim(store: &Store) -> usize {
    let claim = Claim {
        request_id: Uuid::now_v7(),
        worker: WORKER.parse::<WorkerId>().unwrap(),
        max_jobs: 8,
        lease: Duration::from_secs(10),
        max_frames_bytes: 1,
        checkpoints: None,
        shares_fills: false,
        max_fill_bytes: 1,
    };
    let now = Now { wall: Timestamp(0), lease: Timestamp(0) };
    store.claim(claim, now).await.unwrap().unwrap().attempts.len()
}

#[tokio::test]
async fn claims_pass_over_no_old_versions_that_an_open_transaction_keeps() {
    let place = Place::postgres();
    let store = place.open().await;
    execute(&store, JOBS).await;
    assert_eq!(claim(&store).await, 8);
    let mut open = Connection::from(address(&place).connect().await.unwrap().0);
    let begin = "BEGIN ISOLATION LEVEL REPEATABLE READ; SELECT count(*) FROM jobs";
    raw_sql(begin).execute(&mut open).await.unwrap();

    execute(
        &store,
        "UPDATE jobs SET state = 'cancelled', ended_at = 0 WHERE state = 'queued' AND queue_position < 4900;
         DO $$ BEGIN FOR turn IN 1..5000 LOOP UPDATE fair_share SET round = round + 1; END LOOP; END $$",
    )
    .await;
    // The first claim afterwards finds the first job.
    assert_eq!(claim(&store).await, 8);
    let engine = Engine::Postgres;
    let by_reader = pages(&store, eligible_jobs(engine), WORKER).await;
    let by_writer = pages(&store, eligible_jobs_of_writer(engine), WORKER).await;
    assert!(by_reader > 300, "{by_reader} pages: old versions remain");
    assert!(by_writer < 40, "{by_writer} pages");
    let all = "SELECT round FROM fair_share WHERE (priority, owner) = (0, 0) AND ?1 = '[0]'";
    let (by_equality, from_the_end) =
        (pages(&store, all, "[0]").await, pages(&store, rounds_in(engine), "[0]").await);
    assert!(by_equality > 25, "{by_equality} pages: old versions remain");
    assert!(from_the_end < 12, "{from_the_end} pages");
    let share = TAKE_IN_POSTGRES.split(';').nth(2).unwrap();
    let changing = pages(&store, share, r#"[{"seq": 4990, "round": 1, "served": 1}]"#).await;
    assert!(changing < 30, "{changing} pages");
    store.close().await;
}

#[tokio::test]
async fn a_job_that_returns_before_the_place_of_its_queue_is_claimed_next() {
    let place = Place::postgres();
    let store = place.open().await;
    execute(&store, JOBS).await;
    execute(&store, "UPDATE jobs SET state = 'cancelled', ended_at = 0 WHERE queue_position < 4000").await;
    assert_eq!(claim(&store).await, 8);
    let claimed = async || -> Vec<i64> {
        let sql = "SELECT queue_position FROM jobs WHERE state = 'running' ORDER BY queue_position";
        query_scalar(sql).fetch_all(&store.readers).await.unwrap()
    };
    assert_eq!(claimed().await, (4000..4008).collect::<Vec<_>>());
    let again = "UPDATE jobs SET state = 'queued', ended_at = NULL WHERE queue_position IN (7, 9)";
    execute(&store, again).await;
    // A write that fails moves no place.
    let failed = store.writer.write(|tx| {
        Box::pin(async move {
            let sql = "UPDATE jobs SET state = 'cancelled', ended_at = 0 WHERE state = 'queued' AND queue_position < 4500";
            raw_sql(sql).execute(&mut *tx).await?;
            advance(tx).await?;
            Ok(raw_sql("SELECT nothing").execute(tx).await?)
        })
    });
    failed.await.unwrap_err();
    // Another session: the leader sees it when it fills its tables anew.
    let mut other = Connection::from(address(&place).connect().await.unwrap().0);
    let by_hand = "UPDATE jobs SET state = 'queued', ended_at = NULL WHERE queue_position = 3";
    query(by_hand).execute(&mut other).await.unwrap();
    assert_eq!(claim(&store).await, 8);
    assert_eq!(claimed().await, [7, 9].into_iter().chain(4000..4014).collect::<Vec<_>>());
    store.refill_leader_tables().await.unwrap();
    assert_eq!(claim(&store).await, 8);
    assert_eq!(claimed().await[..4], [3, 7, 9, 4000]);
    let wrong =
        store.writer.write(|tx| Box::pin(async move { Ok(query_scalar::<i64>(WRONG).fetch_one(tx).await?) }));
    assert_eq!(wrong.await.unwrap(), 0);
    store.close().await;
}
