//! Cancellation: queued jobs at once, running jobs by heartbeat, recorded results never.

use std::time::Duration;

use reqwest::StatusCode;
use roost_solver::result::EndReason;
use serde_json::{Value, json};

use super::test_server::*;

async fn cancel(server: &TestServer, job: &Value) -> Value {
    let path = format!("/v1/jobs/{}/cancel", text(&job["id"]));
    server.post(&path, &json!({})).await.expect(StatusCode::OK)
}

#[tokio::test]
async fn queued_job_is_cancelled_at_once_and_can_be_retried() {
    let (server, _dir) = TestServer::start().await;
    let worker = server.worker("cpu").await;
    let job = server.submit(&envelope(1)).await;
    assert_eq!(cancel(&server, &job).await["state"], "cancelled");
    assert_eq!(worker.claim(1).await.len(), 0);
    let path = format!("/v1/jobs/{}/retry", text(&job["id"]));
    assert_eq!(server.post(&path, &json!({})).await.expect(StatusCode::OK)["state"], "queued");
    assert_eq!(worker.claim(1).await.len(), 1);
    server.stop().await;
}

#[tokio::test]
async fn cancelled_running_job_keeps_its_series_without_responses() {
    let (server, _dir) = TestServer::start().await;
    let worker = server.worker("cpu").await;
    let job = server.submit(&envelope(1)).await;
    let attempt = worker.claim_one().await;
    let asked = cancel(&server, &job).await;
    assert_eq!((&asked["state"], &asked["cancelling"]), (&json!("running"), &json!(true)));
    assert_eq!(worker.beat(&attempt, progress(0.4)).await["directive"], "cancel");

    let mut partial = result_of(&attempt["scenario"]);
    partial.end_reason = EndReason::Cancelled;
    worker.fail(&attempt, "cancelled", Some(&partial)).await.expect(StatusCode::OK);
    let cancelled = server.job(&job["id"]).await;
    assert_eq!((&cancelled["state"], &cancelled["cancelling"]), (&json!("cancelled"), &json!(false)));
    let kept = server.get(&format!("/v1/jobs/{}/result", text(&job["id"]))).await.expect(StatusCode::OK);
    assert_eq!(kept["responses"], json!({}));
    assert_eq!(kept["series"][0]["name"], "discharged_mass");
    assert_eq!(server.submit(&envelope(1)).await["state"], "queued", "not cached");
    server.stop().await;
}

#[tokio::test]
async fn result_recorded_before_cancellation_counts() {
    let (server, _dir) = TestServer::start().await;
    let worker = server.worker("cpu").await;
    let job = server.submit(&envelope(1)).await;
    worker.deliver(&worker.claim_one().await).await.expect(StatusCode::OK);
    assert_eq!(cancel(&server, &job).await["state"], "succeeded");

    let job = server.submit(&envelope(2)).await;
    let attempt = worker.claim_one().await;
    cancel(&server, &job).await;
    worker.deliver(&attempt).await.expect(StatusCode::OK);
    let done = server.job(&job["id"]).await;
    assert_eq!((&done["state"], &done["cancelling"]), (&json!("succeeded"), &json!(false)));
    server.stop().await;
}

#[tokio::test]
async fn cancelled_job_of_a_dead_worker_ends_with_its_lease() {
    let (server, _dir) = TestServer::with(|config| config.lease = Duration::from_millis(1500)).await;
    let worker = server.worker("cpu").await;
    let job = server.submit(&envelope(1)).await;
    let attempt = worker.claim_one().await;
    cancel(&server, &job).await;
    server.wait_for(&job["id"], "cancelled").await;
    assert_eq!(worker.beat(&attempt, Value::Null).await["directive"], "abandon");
    worker.deliver(&attempt).await.problem(409, "stale-attempt");
    server.stop().await;
}
