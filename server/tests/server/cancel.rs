//! Cancelling: at once in the queue, by heartbeat when running, never what is recorded.

use std::time::Duration;

use reqwest::StatusCode;
use roost_solver::result::EndReason;
use serde_json::{Value, json};

use super::farm::*;

async fn cancel(farm: &Farm, job: &Value) -> Value {
    let path = format!("/v1/jobs/{}/cancel", text(&job["id"]));
    farm.post(&path, &json!({})).await.expect(StatusCode::OK)
}

#[tokio::test]
async fn a_queued_job_is_cancelled_at_once_and_can_be_retried() {
    let (farm, _dir) = Farm::start().await;
    let worker = farm.worker("cpu").await;
    let job = farm.submit(&envelope(1)).await;
    assert_eq!(cancel(&farm, &job).await["state"], "cancelled");
    assert_eq!(worker.claim(1).await.len(), 0);
    let path = format!("/v1/jobs/{}/retry", text(&job["id"]));
    assert_eq!(farm.post(&path, &json!({})).await.expect(StatusCode::OK)["state"], "queued");
    assert_eq!(worker.claim(1).await.len(), 1);
    farm.stop().await;
}

#[tokio::test]
async fn a_running_job_hears_of_it_and_keeps_its_series_but_no_responses() {
    let (farm, _dir) = Farm::start().await;
    let worker = farm.worker("cpu").await;
    let job = farm.submit(&envelope(1)).await;
    let attempt = worker.claim_one().await;
    let asked = cancel(&farm, &job).await;
    assert_eq!((&asked["state"], &asked["cancelling"]), (&json!("running"), &json!(true)));
    assert_eq!(worker.beat(&attempt, progress(0.4)).await["directive"], "cancel");

    let mut partial = result_of(&attempt["scenario"]);
    partial.end_reason = EndReason::Cancelled;
    worker.fail(&attempt, "cancelled", Some(&partial)).await.expect(StatusCode::OK);
    let cancelled = farm.job(&job["id"]).await;
    assert_eq!((&cancelled["state"], &cancelled["cancelling"]), (&json!("cancelled"), &json!(false)));
    let kept = farm.get(&format!("/v1/jobs/{}/result", text(&job["id"]))).await.expect(StatusCode::OK);
    assert_eq!(kept["responses"], json!({}));
    assert_eq!(kept["series"][0]["name"], "discharged_mass");
    assert_eq!(farm.submit(&envelope(1)).await["state"], "queued", "not cached");
    farm.stop().await;
}

#[tokio::test]
async fn a_result_recorded_before_the_cancel_wins() {
    let (farm, _dir) = Farm::start().await;
    let worker = farm.worker("cpu").await;
    let job = farm.submit(&envelope(1)).await;
    worker.deliver(&worker.claim_one().await).await.expect(StatusCode::OK);
    assert_eq!(cancel(&farm, &job).await["state"], "succeeded");

    let job = farm.submit(&envelope(2)).await;
    let attempt = worker.claim_one().await;
    cancel(&farm, &job).await;
    worker.deliver(&attempt).await.expect(StatusCode::OK);
    let done = farm.job(&job["id"]).await;
    assert_eq!((&done["state"], &done["cancelling"]), (&json!("succeeded"), &json!(false)));
    farm.stop().await;
}

#[tokio::test]
async fn a_cancelled_job_of_a_dead_worker_ends_with_its_lease() {
    let (farm, _dir) = Farm::with(|config| config.lease = Duration::from_millis(300)).await;
    let worker = farm.worker("cpu").await;
    let job = farm.submit(&envelope(1)).await;
    let attempt = worker.claim_one().await;
    cancel(&farm, &job).await;
    farm.wait_for(&job["id"], "cancelled").await;
    assert_eq!(worker.beat(&attempt, Value::Null).await["directive"], "abandon");
    worker.deliver(&attempt).await.problem(409, "stale-attempt");
    farm.stop().await;
}
