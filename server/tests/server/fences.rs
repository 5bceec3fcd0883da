//! Fencing: a stale attempt is answered 409 and changes nothing.

use std::time::Duration;

use reqwest::StatusCode;
use roost_api::ids::WorkerId;
use serde_json::{Value, json};

use super::test_server::*;

/// Lets the first attempt of a job expire and claims the job again: (first, second) attempt.
async fn superseded_attempt(worker: &Worker<'_>) -> (Value, Value) {
    let first = worker.claim_one().await;
    worker.beat(&first, progress(0.8)).await;
    worker.server.wait_for(&first["job_id"], "queued").await;
    let second = worker.claim_one().await;
    assert_eq!(second["attempt"], 2);
    (first, second)
}

#[tokio::test]
async fn superseded_attempt_can_neither_send_heartbeats_nor_deliver_nor_fail() {
    let (server, _dir) = TestServer::with(|config| config.lease = Duration::from_secs(5)).await;
    let worker = server.worker("cpu").await;
    let job = server.submit(&envelope(1)).await;
    let (first, second) = superseded_attempt(&worker).await;

    let row = worker.beat(&first, progress(0.9)).await;
    assert_eq!((&row["directive"], &row["lease_expires_at"]), (&json!("abandon"), &Value::Null));
    let stale = worker.deliver(&first).await.problem(409, "stale-attempt");
    assert!(text(&stale["detail"]).contains("attempt 2"));
    worker.fail(&first, "worker", None).await.problem(409, "stale-attempt");
    let untouched = server.job(&job["id"]).await;
    assert_eq!((&untouched["state"], &untouched["attempt"]), (&json!("running"), &json!(2)));
    assert_eq!(untouched["progress"], Value::Null, "the first attempt's progress is not the second's");

    worker.deliver(&second).await.expect(StatusCode::OK);
    worker.deliver(&first).await.problem(409, "stale-attempt");
    server.stop().await;
}

#[tokio::test]
async fn repeated_delivery_is_recorded_once() {
    let (server, _dir) = TestServer::start().await;
    let worker = server.worker("cpu").await;
    let job = server.submit(&envelope(1)).await;
    let attempt = worker.claim_one().await;
    let first = worker.deliver(&attempt).await.expect(StatusCode::OK);
    let recorded = server.job(&job["id"]).await;
    let mut other = result_of(&attempt["scenario"]);
    other.responses["discharged_kg"] = json!(99.0);
    let again = worker.deliver_result(&attempt, &other).await.expect(StatusCode::OK);
    assert_eq!((&first["recorded"], &again["recorded"]), (&json!(true), &json!(false)));
    assert_eq!(server.job(&job["id"]).await, recorded, "a repeat changes nothing");

    worker.fail(&attempt, "worker", None).await.problem(409, "stale-attempt");
    assert_eq!(worker.beat(&attempt, progress(0.5)).await["directive"], "abandon");
    assert_eq!(server.job(&job["id"]).await, recorded);
    server.stop().await;
}

#[tokio::test]
async fn results_in_one_request_are_recorded_or_refused_on_their_own() {
    let (server, _dir) = TestServer::start().await;
    let worker = server.worker("cpu").await;
    let mut jobs = Vec::new();
    for seed in 1..=4 {
        jobs.push(server.submit(&envelope(seed)).await["id"].clone());
    }
    let attempts = worker.claim(4).await;
    let own = |index: usize| result_of(&attempts[index]["scenario"]);
    worker.fail(&attempts[1], "worker", None).await.expect(StatusCode::OK);
    let mut uneven = own(3);
    uneven.series[0].values.pop();
    let (first, second) = (own(0), own(1));
    // The third job gets the result of the first; the first comes twice.
    let results = [
        (&attempts[0], &first),
        (&attempts[1], &second),
        (&attempts[2], &first),
        (&attempts[3], &uneven),
        (&attempts[0], &first),
    ];
    let reply = worker.deliver_together(&results).await.expect(StatusCode::OK);
    let answers = reply["answers"].as_array().unwrap();
    let of = |index: usize| (&answers[index]["recorded"], &answers[index]["problem"]["type"]);
    let problem = |name: &str| json!(format!("/problems/{name}"));
    assert_eq!(of(0), (&json!(true), &Value::Null));
    assert_eq!(of(1), (&json!(false), &problem("stale-attempt")));
    assert_eq!(of(2), (&json!(false), &problem("wrong-result")));
    assert_eq!(of(3), (&json!(false), &problem("invalid-document")));
    assert_eq!(of(4), (&json!(false), &Value::Null), "a repeat");
    for (answer, (attempt, _)) in answers.iter().zip(results) {
        assert_eq!((&answer["job_id"], &answer["attempt"]), (&attempt["job_id"], &attempt["attempt"]));
    }
    let mut states = Vec::new();
    for job in &jobs {
        states.push(server.job(job).await["state"].clone());
    }
    assert_eq!(states, ["succeeded", "queued", "running", "running"]);
    server.stop().await;
}

#[tokio::test]
async fn requests_with_too_many_results_are_refused() {
    let (server, _dir) = TestServer::start().await;
    let worker = server.worker("cpu").await;
    let job = server.submit(&envelope(1)).await;
    let attempt = worker.claim_one().await;
    let result = result_of(&attempt["scenario"]);
    for count in [0, 65] {
        let refused = worker.deliver_together(&vec![(&attempt, &result); count]).await;
        let refused = refused.problem(422, "invalid-document");
        assert_eq!(refused["errors"][0]["pointer"], "/results", "{refused}");
        assert!(text(&refused["errors"][0]["allowed"]).contains("64"), "{refused}");
    }
    assert_eq!(server.job(&job["id"]).await["state"], "running");
    let mut misspelt =
        json!({"results": [{"job_id": attempt["job_id"], "attempt": attempt["attempt"], "delivery": {}}]});
    misspelt["results"][0]["delivery"] = json!({"worker_id": worker.id, "results": result});
    let refused = server.post("/v1/results", &misspelt).await.problem(422, "invalid-document");
    assert!(text(&refused["errors"][0]["pointer"]).starts_with("/results/0/delivery"), "{refused}");
    let delivered = worker.deliver_together(&vec![(&attempt, &result); 64]).await.expect(StatusCode::OK);
    let recorded =
        delivered["answers"].as_array().unwrap().iter().filter(|answer| answer["recorded"] == true);
    assert_eq!(recorded.count(), 1);
    server.stop().await;
}

#[tokio::test]
async fn repeated_failure_report_is_recorded_once() {
    let (server, _dir) = TestServer::start().await;
    let worker = server.worker("cpu").await;
    let job = server.submit(&envelope(1)).await;
    let attempt = worker.claim_one().await;
    for recorded in [true, false, false, false] {
        let receipt = worker.fail(&attempt, "worker", None).await.expect(StatusCode::OK);
        assert_eq!(receipt["recorded"], recorded);
    }
    assert_eq!(server.job(&job["id"]).await["state"], "queued", "one failure, not four");
    worker.deliver(&attempt).await.problem(409, "stale-attempt");
    server.stop().await;
}

#[tokio::test]
async fn attempt_of_another_worker_is_refused() {
    let (server, _dir) = TestServer::start().await;
    let (worker, stranger) = (server.worker("cpu").await, server.worker("cpu").await);
    server.submit(&envelope(1)).await;
    let attempt = worker.claim_one().await;
    stranger.deliver(&attempt).await.problem(409, "stale-attempt");
    stranger.fail(&attempt, "worker", None).await.problem(409, "stale-attempt");
    assert_eq!(stranger.beat(&attempt, Value::Null).await["directive"], "abandon");
    worker.deliver(&attempt).await.expect(StatusCode::OK);
    server.stop().await;
}

#[tokio::test]
async fn result_of_another_scenario_is_refused() {
    let (server, _dir) = TestServer::start().await;
    let worker = server.worker("cpu").await;
    let job = server.submit(&envelope(1)).await;
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
    assert_eq!(server.job(&job["id"]).await["state"], "running");
    server.stop().await;
}

#[tokio::test]
async fn outcomes_that_workers_cannot_report_are_refused() {
    let (server, _dir) = TestServer::start().await;
    let worker = server.worker("cpu").await;
    let job = server.submit(&envelope(1)).await;
    let attempt = worker.claim_one().await;
    for outcome in ["succeeded", "lost", "cancelled"] {
        worker.fail(&attempt, outcome, None).await.problem(422, "wrong-result");
    }
    assert_eq!(server.job(&job["id"]).await["state"], "running");
    server.stop().await;
}

#[tokio::test]
async fn unknown_attempts_and_workers_are_not_found() {
    let (server, _dir) = TestServer::start().await;
    let worker = server.worker("cpu").await;
    server.submit(&envelope(1)).await;
    let mut attempt = worker.claim_one().await;
    attempt["attempt"] = json!(2);
    worker.deliver(&attempt).await.problem(404, "not-found");
    let stranger = WorkerId::new().to_string();
    let beat = server.post(&format!("/v1/workers/{stranger}/heartbeat"), &json!({"attempts": []})).await;
    assert!(text(&beat.problem(404, "not-found")["detail"]).contains("POST /v1/workers"));
    let nobody = Worker { server: &server, id: stranger };
    server.post("/v1/claims", &nobody.claim_request(1, 0.0)).await.problem(404, "not-found");
    server.stop().await;
}

#[tokio::test]
async fn worker_of_another_release_is_refused() {
    let (server, _dir) = TestServer::start().await;
    let id = WorkerId::new().to_string();
    let mut old_api = registration(&id, "cpu");
    old_api["api_version"] = json!("v0");
    let refused = server.post("/v1/workers", &old_api).await.problem(409, "worker-refused");
    assert!(text(&refused["detail"]).contains("API v0"));
    let mut old_solver = registration(&id, "cpu");
    old_solver["solver_revision"] = json!(0);
    let refused = server.post("/v1/workers", &old_solver).await.problem(409, "worker-refused");
    assert!(text(&refused["detail"]).contains("solver revision 0"));
    assert_eq!(server.get("/v1/workers").await.expect(StatusCode::OK)["items"], json!([]));
    server.stop().await;
}
