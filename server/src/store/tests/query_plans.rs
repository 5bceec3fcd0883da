//! Tests of query plans: which indices the frequent queries use.

use super::super::eligible_jobs::{ELIGIBLE_JOBS, ROUNDS};
use super::super::*;
use super::store;
use crate::store::database::{AssertSqlSafe, query};

/// The lines of `EXPLAIN QUERY PLAN`.
pub(super) async fn plan(store: &Store, sql: &str) -> String {
    let rows =
        query(AssertSqlSafe(format!("EXPLAIN QUERY PLAN {sql}"))).fetch_all(&store.readers).await.unwrap();
    rows.iter().map(|row| row.get::<String>("detail")).collect::<Vec<_>>().join("\n")
}

#[tokio::test]
async fn a_claim_walks_an_index_without_sorting() {
    let (store, _dir) = store().await;
    let steps = plan(&store, ELIGIBLE_JOBS).await;
    for step in [
        // Lazily, with one step into the index for each owner queue.
        "CO-ROUTINE heads",
        "INDEX jobs_to_claim (priority=? AND owner=? AND queue>?)",
        "INDEX jobs_to_claim (priority=? AND owner>?)",
        "INDEX jobs_to_claim (priority<?)",
        "SEARCH j USING INDEX jobs_to_claim (priority=? AND owner=? AND queue=?)",
        // Lazily, so that a claim passes over no more jobs than wait for a fill.
        "CO-ROUTINE first",
        "SEARCH f USING PRIMARY KEY (fill_digest=? AND solver_revision=? AND backend=? AND device=?)",
        "INDEX sweeps_hidden",
        "SCAN p USING COVERING INDEX projects_with_budget",
        "SEARCH o USING COVERING INDEX owners_by_project (project=?)",
    ] {
        assert!(steps.contains(step), "{step}: {steps}");
    }
    assert!(!steps.contains("TEMP B-TREE") && !steps.contains("MATERIALIZE"), "{steps}");
    let scans = steps.lines().filter(|line| line.contains("SCAN") && !line.contains(" INDEX "));
    assert!(
        scans.clone().all(|line| ["SCAN heads", "SCAN first", "SCAN top", "SCAN (subquery"]
            .iter()
            .any(|of| line.contains(of))),
        "{steps}"
    );
    let steps = plan(&store, ROUNDS).await;
    assert!(steps.contains("SEARCH f USING PRIMARY KEY (priority=?)"), "{steps}");
    assert!(steps.contains("SEARCH project_rounds USING PRIMARY KEY (priority=?)"), "{steps}");

    let sorted =
        plan(&store, "SELECT seq FROM jobs WHERE state = 'queued' ORDER BY queue_position, priority").await;
    assert!(sorted.contains("TEMP B-TREE"), "the check above finds a sort: {sorted}");
    store.close().await;
}

#[tokio::test]
async fn frequent_queries_use_an_index() {
    let (store, _dir) = store().await;
    let arrive = claim_statements::ARRIVE;
    for (sql, index) in [
        (
            heartbeats::RENEW.split(';').next().unwrap(),
            "SEARCH jobs USING INDEX sqlite_autoindex_jobs_1 (id=?)",
        ),
        (versions::JOB, "events_of_job"),
        (versions::SWEEP, "events_of_sweep"),
        (versions::QUEUE_COUNTS, "SCAN jobs USING INDEX jobs_to_claim"),
        (versions::QUEUE_COUNTS, "USING INDEX jobs_ended"),
        (versions::QUEUE_COUNTS, "COVERING INDEX jobs_by_sweep (sweep_id=?)"),
        (deletion::HIDE, "COVERING INDEX jobs_by_sweep (sweep_id=? AND state=? AND ended_at>?)"),
        (job_control::UNENDED, "SEARCH jobs USING INDEX jobs_by_sweep (sweep_id=? AND state=?)"),
        (job_control::FAILED, "SEARCH jobs USING INDEX jobs_by_sweep (sweep_id=? AND state=?)"),
        ("SELECT seq FROM sweeps WHERE state <> 'ready'", "INDEX sweeps_hidden"),
        (versions::QUEUED_AT, "events_of_job"),
        (versions::QUEUE_COUNTS, "COVERING INDEX projects_with_budget"),
        (expiry::FIRST_END, "jobs_by_lease"),
        (expiry::FIRST_PAUSE_END, "SEARCH jobs USING COVERING INDEX jobs_by_not_before"),
        ("SELECT 1 FROM jobs WHERE state = 'running' AND lease_expires_at <= 5", "jobs_by_lease"),
        ("SELECT 1 FROM jobs WHERE state = 'running' AND deadline <= 5", "jobs_by_deadline"),
        (versions::PAUSED, "COVERING INDEX jobs_paused"),
        (versions::QUEUE_COUNTS, "COVERING INDEX jobs_paused"),
        (sweeps::PAUSED, "COVERING INDEX jobs_paused (sweep_id=?)"),
        (arrive, "INDEX jobs_by_worker (worker_id=? AND state=?)"),
        (arrive, "SEARCH attempts USING COVERING INDEX attempts_by_worker (worker_id=? AND outcome=?)"),
        (arrive, "attempts_by_request (request_id=?)"),
        ("SELECT 1 FROM workers WHERE last_seen_at BETWEEN 5 AND 9", "workers_by_last_seen"),
        (workers::FORGET, "SEARCH workers USING INDEX workers_by_last_seen"),
        (workers::FORGET, "attempts_by_worker"),
        // A foreign key check of a deleted worker.
        ("SELECT 1 FROM jobs WHERE worker_id = ?", "jobs_by_worker"),
        (
            "SELECT state, count(*) FROM jobs WHERE sweep_id IN ('a') GROUP BY sweep_id, state",
            "jobs_by_sweep",
        ),
        (sweeps::COUNTS, "COVERING INDEX jobs_by_sweep"),
        (sweeps::FAILURES, "COVERING INDEX jobs_failed_of_sweep"),
        (
            "SELECT * FROM jobs j WHERE j.seq < 9 AND j.sweep_id = 'a' AND j.failure_class = ? ORDER BY j.seq DESC",
            "jobs_failed_of_sweep",
        ),
        ("SELECT * FROM jobs j WHERE j.seq < 9 AND j.failure_class = ? ORDER BY j.seq DESC", "jobs_failed"),
        (format!("SELECT j.id FROM jobs j {}", trials::FROM).as_str(), "jobs_by_point"),
        ("SELECT * FROM jobs j WHERE +j.seq < 9 AND j.sweep_id = 'a' AND j.point = 3", "jobs_by_point"),
        ("SELECT 1 FROM frames WHERE object_digest = 'a'", "frames_by_object"),
        (frames::UNREFERENCED, "frames_by_object"),
        (frames::UNREFERENCED, "checkpoints_by_object"),
        (frames::UNREFERENCED, "fills_by_object"),
        (observations::OBSERVED, "SEARCH observation_counts USING PRIMARY KEY (study_id=?)"),
        (observations::NEXT_NUMBER, "SEARCH observations USING PRIMARY KEY (study_id=?)"),
        (
            tells::OUTCOME_ELSEWHERE,
            "SEARCH observations USING INDEX observations_by_seed (study_id=? AND seed=?)",
        ),
        (fills::ENDED, "fills_by_job"),
        (fills::STORED, "SEARCH f USING PRIMARY KEY"),
        ("SELECT * FROM jobs WHERE sweep_id = 'a' AND seq < 9 ORDER BY seq DESC", "jobs_of_sweep"),
        (
            "SELECT * FROM jobs WHERE state = ? AND ended_at IS NOT NULL AND seq < 9 ORDER BY seq DESC",
            "jobs_ended",
        ),
        ("SELECT 1 FROM jobs WHERE scenario_digest = 'a'", "jobs_by_digest"),
        ("SELECT 1 FROM results WHERE document_digest = 'a'", "results_by_document"),
        ("SELECT 1 FROM attempts WHERE partial_digest = 'a'", "attempts_by_partial"),
        ("SELECT id, scenario_digest FROM jobs WHERE sweep_id = 'a' LIMIT 500", "jobs_"),
        ("SELECT 1 FROM results WHERE scenario_digest = 'a' AND solver_revision = 1", "results_by_digest"),
    ] {
        let steps = plan(&store, sql).await;
        assert!(steps.contains(index) && !steps.contains("TEMP B-TREE"), "{sql}\n{steps}");
    }
    store.close().await;
}

#[tokio::test]
async fn batched_queries_scan_no_table() {
    let (store, _dir) = store().await;
    let json = |line: &&str| line.contains("VIRTUAL TABLE");
    for sql in [
        claim_statements::ARRIVE,
        claim_statements::SEE,
        claim_statements::RECORD_SLOTS,
        claim_statements::TAKE,
        claim_statements::REPEAT,
        claim_statements::COMPUTE_FILLS,
        claim_statements::USE_FILLS,
        transitions::END,
        deliveries::RECORD,
        heartbeats::RENEW,
    ] {
        for statement in sql.split(';') {
            let steps = plan(&store, statement).await;
            let scans = steps.lines().filter(|line| line.contains("SCAN") && !json(line));
            assert_eq!(scans.count(), 0, "{statement}\n{steps}");
        }
    }
    let scan = plan(&store, "UPDATE jobs SET alone = 1 WHERE labels = '{}' RETURNING id").await;
    assert!(scan.contains("SCAN jobs"), "the check above finds a scan: {scan}");
    store.close().await;
}
