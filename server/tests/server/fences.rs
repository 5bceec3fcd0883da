//! Every write of an attempt is fenced: a stale one is answered 409 and changes nothing.

use std::time::Duration;

use reqwest::StatusCode;
use roost_api::ids::WorkerId;
use serde_json::{Value, json};

use super::farm::*;

/// Lets a job's first attempt expire and be claimed again: (first, second) attempt.
async fn superseded(worker: &Worker<'_>) -> (Value, Value) {
    let first = worker.claim_one().await;
    worker.beat(&first, progress(0.8)).await;
    worker.farm.wait_for(&first["job_id"], "queued").await;
    let second = worker.claim_one().await;
    assert_eq!(second["attempt"], 2);
    (first, second)
}

#[tokio::test]
async fn a_superseded_attempt_can_neither_beat_nor_deliver_nor_fail() {
    let (farm, _dir) = Farm::with(|config| config.lease = Duration::from_millis(800)).await;
    let worker = farm.worker("cpu").await;
    let job = farm.submit(&envelope(1)).await;
    let (first, second) = superseded(&worker).await;

    let row = worker.beat(&first, progress(0.9)).await;
    assert_eq!((&row["directive"], &row["lease_expires_at"]), (&json!("abandon"), &Value::Null));
    let stale = worker.deliver(&first).await.problem(409, "stale-attempt");
    assert!(text(&stale["detail"]).contains("attempt 2"));
    worker.fail(&first, "worker", None).await.problem(409, "stale-attempt");
    let untouched = farm.job(&job["id"]).await;
    assert_eq!((&untouched["state"], &untouched["attempt"]), (&json!("running"), &json!(2)));
    assert_eq!(untouched["progress"], Value::Null, "the first attempt's progress is not the second's");

    worker.deliver(&second).await.expect(StatusCode::OK);
    worker.deliver(&first).await.problem(409, "stale-attempt");
    farm.stop().await;
}

#[tokio::test]
async fn a_result_is_recorded_once_however_often_it_is_delivered() {
    let (farm, _dir) = Farm::start().await;
    let worker = farm.worker("cpu").await;
    let job = farm.submit(&envelope(1)).await;
    let attempt = worker.claim_one().await;
    let first = worker.deliver(&attempt).await.expect(StatusCode::OK);
    let recorded = farm.job(&job["id"]).await;
    let mut other = result_of(&attempt["scenario"]);
    other.responses["discharged_kg"] = json!(99.0);
    let again = worker.deliver_result(&attempt, &other).await.expect(StatusCode::OK);
    assert_eq!((&first["recorded"], &again["recorded"]), (&json!(true), &json!(false)));
    assert_eq!(farm.job(&job["id"]).await, recorded, "a repeat changes nothing");

    worker.fail(&attempt, "worker", None).await.problem(409, "stale-attempt");
    assert_eq!(worker.beat(&attempt, progress(0.5)).await["directive"], "abandon");
    assert_eq!(farm.job(&job["id"]).await, recorded);
    farm.stop().await;
}

#[tokio::test]
async fn a_failure_is_recorded_once_however_often_it_is_reported() {
    let (farm, _dir) = Farm::start().await;
    let worker = farm.worker("cpu").await;
    let job = farm.submit(&envelope(1)).await;
    let attempt = worker.claim_one().await;
    for recorded in [true, false, false, false] {
        let receipt = worker.fail(&attempt, "worker", None).await.expect(StatusCode::OK);
        assert_eq!(receipt["recorded"], recorded);
    }
    assert_eq!(farm.job(&job["id"]).await["state"], "queued", "one failure, not four");
    worker.deliver(&attempt).await.problem(409, "stale-attempt");
    farm.stop().await;
}

#[tokio::test]
async fn an_attempt_belongs_to_its_worker() {
    let (farm, _dir) = Farm::start().await;
    let (worker, stranger) = (farm.worker("cpu").await, farm.worker("cpu").await);
    farm.submit(&envelope(1)).await;
    let attempt = worker.claim_one().await;
    stranger.deliver(&attempt).await.problem(409, "stale-attempt");
    stranger.fail(&attempt, "worker", None).await.problem(409, "stale-attempt");
    assert_eq!(stranger.beat(&attempt, Value::Null).await["directive"], "abandon");
    worker.deliver(&attempt).await.expect(StatusCode::OK);
    farm.stop().await;
}

#[tokio::test]
async fn a_result_must_be_of_the_jobs_scenario() {
    let (farm, _dir) = Farm::start().await;
    let worker = farm.worker("cpu").await;
    let job = farm.submit(&envelope(1)).await;
    let attempt = worker.claim_one().await;
    let mut other = attempt["scenario"].clone();
    other["seed"] = json!(2);
    worker.deliver_result(&attempt, &result_of(&other)).await.problem(422, "wrong-result");
    worker.fail(&attempt, "unstable", Some(&result_of(&other))).await.problem(422, "wrong-result");

    let mut forged = result_of(&other);
    forged.scenario_digest = result_of(&attempt["scenario"]).scenario_digest;
    let found = worker.deliver_result(&attempt, &forged).await.problem(422, "invalid-document");
    assert_eq!(found["errors"][0]["pointer"], "/result/scenario_digest");
    let mut uneven = result_of(&attempt["scenario"]);
    uneven.series[0].values.pop();
    let found = worker.deliver_result(&attempt, &uneven).await.problem(422, "invalid-document");
    assert_eq!(found["errors"][0]["pointer"], "/result/series/0/values");
    assert_eq!(farm.job(&job["id"]).await["state"], "running");
    farm.stop().await;
}

#[tokio::test]
async fn what_is_not_a_workers_to_report_is_refused() {
    let (farm, _dir) = Farm::start().await;
    let worker = farm.worker("cpu").await;
    let job = farm.submit(&envelope(1)).await;
    let attempt = worker.claim_one().await;
    for outcome in ["succeeded", "lost", "cancelled"] {
        worker.fail(&attempt, outcome, None).await.problem(422, "wrong-result");
    }
    assert_eq!(farm.job(&job["id"]).await["state"], "running");
    farm.stop().await;
}

#[tokio::test]
async fn attempts_and_workers_that_never_were_are_not_found() {
    let (farm, _dir) = Farm::start().await;
    let worker = farm.worker("cpu").await;
    farm.submit(&envelope(1)).await;
    let mut attempt = worker.claim_one().await;
    attempt["attempt"] = json!(2);
    worker.deliver(&attempt).await.problem(404, "not-found");
    let stranger = WorkerId::new().to_string();
    let beat = farm.post(&format!("/v1/workers/{stranger}/heartbeat"), &json!({"attempts": []})).await;
    assert!(text(&beat.problem(404, "not-found")["detail"]).contains("POST /v1/workers"));
    let nobody = Worker { farm: &farm, id: stranger };
    farm.post("/v1/claims", &nobody.claim_request(1, 0.0)).await.problem(404, "not-found");
    farm.stop().await;
}

#[tokio::test]
async fn a_worker_of_another_release_is_refused_with_a_sentence() {
    let (farm, _dir) = Farm::start().await;
    let id = WorkerId::new().to_string();
    let mut old_api = registration(&id, "cpu");
    old_api["api_version"] = json!("v0");
    let refused = farm.post("/v1/workers", &old_api).await.problem(409, "worker-refused");
    assert!(text(&refused["detail"]).contains("API v0"));
    let mut old_solver = registration(&id, "cpu");
    old_solver["solver_revision"] = json!(0);
    let refused = farm.post("/v1/workers", &old_solver).await.problem(409, "worker-refused");
    assert!(text(&refused["detail"]).contains("solver revision 0"));
    assert_eq!(farm.get("/v1/workers").await.expect(StatusCode::OK)["items"], json!([]));
    farm.stop().await;
}
