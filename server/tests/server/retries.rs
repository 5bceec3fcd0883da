//! Retries: pauses, preference of other workers, running alone after a lost batch; placement by memory.

use std::time::{Duration, Instant};

use reqwest::StatusCode;
use roost_api::ids::WorkerId;
use serde_json::{Value, json};

use super::test_server::*;

#[tokio::test]
async fn worker_failure_is_retried_after_a_pause() {
    let (server, _dir) = TestServer::with(|config| {
        config.lease = Duration::from_secs(60);
        config.retry.worker.first_pause = Duration::from_secs(8);
    })
    .await;
    let worker = server.worker("cpu").await;
    let job = server.submit(&envelope(1)).await;
    assert_eq!(job["retry_at"], Value::Null);
    let attempt = worker.claim_one().await;
    let failed = Instant::now();
    worker.fail(&attempt, "worker", None).await.expect(StatusCode::OK);
    let resting = server.job(&job["id"]).await;
    assert_eq!(resting["state"], "queued");
    assert!(resting["retry_at"].is_string(), "{resting}");
    assert_eq!(worker.claim(1).await.len(), 0, "not yet");

    // One waiting claim is woken at the end of the pause.
    let request = worker.claim_request(1, 20.0);
    let reply = server.post("/v1/claims", &request).await.expect(StatusCode::OK);
    assert_eq!(reply["attempts"][0]["attempt"], 2, "{reply}");
    let waited = failed.elapsed().as_secs_f64();
    assert!((3.9..60.0).contains(&waited), "{waited}");
    assert_eq!(server.job(&job["id"]).await["retry_at"], Value::Null);
    server.stop().await;
}

#[tokio::test]
async fn paused_job_can_be_cancelled_and_restart_ends_the_pause() {
    let rest = |config: &mut roost_server::ServerConfig| {
        config.retry.worker.first_pause = Duration::from_secs(60);
    };
    let (server, dir) = TestServer::with(rest).await;
    let worker = server.worker("cpu").await;
    let (cancelled, kept) = (server.submit(&envelope(1)).await, server.submit(&envelope(2)).await);
    for attempt in worker.claim(2).await {
        worker.fail(&attempt, "worker", None).await.expect(StatusCode::OK);
    }
    let path = format!("/v1/jobs/{}/cancel", text(&cancelled["id"]));
    assert_eq!(server.post(&path, &json!({})).await.expect(StatusCode::OK)["state"], "cancelled");
    server.stop().await;

    let server = TestServer::on(dir.path(), rest).await;
    let worker = server.worker("cpu").await;
    assert_eq!(worker.claim_one().await["job_id"], kept["id"]);
    server.stop().await;
}

#[tokio::test]
async fn another_worker_is_preferred_after_a_failure() {
    let (server, _dir) = TestServer::start().await;
    let (first, second) = (server.worker("cpu").await, server.worker("cpu").await);
    let gpu = server.worker("gpu").await;
    let mut needy = envelope(1);
    needy["needs"] = json!({"backend": "cpu"});
    let job = server.submit(&needy).await;
    let attempt = first.claim_one().await;
    first.fail(&attempt, "worker", None).await.expect(StatusCode::OK);
    assert_eq!(first.claim(1).await.len(), 0, "the second worker is preferred");
    let attempt = second.claim_one().await;
    second.fail(&attempt, "worker", None).await.expect(StatusCode::OK);

    // Both have failed the job and the third does not meet its needs: any of the two may claim it.
    assert_eq!(gpu.claim(1).await.len(), 0);
    let third = first.claim_one().await;
    assert_eq!((&third["job_id"], &third["attempt"]), (&job["id"], &json!(3)));
    server.stop().await;
}

#[tokio::test]
async fn sole_worker_retries_its_failed_job() {
    let (server, _dir) = TestServer::with(|config| config.lease = Duration::from_secs(6)).await;
    let (first, second) = (server.worker("cpu").await, server.worker("cpu").await);
    server.submit(&envelope(1)).await;
    let attempt = first.claim_one().await;
    first.fail(&attempt, "worker", None).await.expect(StatusCode::OK);
    assert_eq!(first.claim(1).await.len(), 0);
    server.post(&format!("/v1/workers/{}/drain", second.id), &json!({})).await.expect(StatusCode::ACCEPTED);
    assert_eq!(first.claim_one().await["attempt"], 2, "the other one takes nothing more");

    server.submit(&envelope(2)).await;
    let third = server.worker("cpu").await;
    let attempt = third.claim_one().await;
    third.fail(&attempt, "worker", None).await.expect(StatusCode::OK);
    let deadline = Instant::now() + Duration::from_secs(60);
    // The first worker sends no more heartbeats and counts as lost.
    while third.claim(1).await.is_empty() {
        assert!(Instant::now() < deadline, "waited for a worker that is gone");
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
    server.stop().await;
}

#[tokio::test]
async fn jobs_of_a_lost_batch_run_alone() {
    let (server, _dir) = TestServer::with(|config| config.lease = Duration::from_secs(6)).await;
    let (dead, lone) = (server.worker("cpu").await, server.worker("cpu").await);
    let jobs = [server.submit(&envelope(1)).await, server.submit(&envelope(2)).await];
    assert_eq!(dead.claim(2).await.len(), 2);
    for job in &jobs {
        assert_eq!(server.wait_for(&job["id"], "queued").await["alone"], true);
    }
    server.submit(&envelope(3)).await;
    let only = lone.claim(64).await;
    assert_eq!(only.len(), 1, "one of the lost jobs, alone");
    assert_eq!(lone.claim(64).await.len(), 0, "nor later");

    // A waiting claim gets the next job as soon as its worker has none.
    let request = lone.claim_request(64, 20.0);
    let (next, delivered) = tokio::join!(server.post("/v1/claims", &request), async {
        tokio::time::sleep(Duration::from_millis(100)).await;
        lone.deliver(&only[0]).await
    });
    delivered.expect(StatusCode::OK);
    let next = next.expect(StatusCode::OK)["attempts"].clone();
    assert_eq!(next.as_array().unwrap().len(), 1, "{next}");
    assert_eq!(server.job(&next[0]["job_id"]).await["alone"], true);
    lone.deliver(&next[0]).await.expect(StatusCode::OK);
    assert_eq!(lone.claim(64).await.len(), 1, "the third was never lost");
    server.stop().await;
}

#[tokio::test]
async fn job_lost_alone_may_run_with_others() {
    let (server, _dir) = TestServer::with(|config| config.lease = Duration::from_millis(1500)).await;
    let worker = server.worker("cpu").await;
    let job = server.submit(&envelope(1)).await;
    worker.claim_one().await;
    assert_eq!(server.wait_for(&job["id"], "queued").await["alone"], false);
    server.stop().await;
}

#[tokio::test]
async fn job_goes_to_a_worker_with_enough_memory() {
    let (server, _dir) = TestServer::start().await;
    let of = async |memory: Value| {
        let mut registration = registration(&WorkerId::new().to_string(), "cpu");
        registration["memory_mib"] = memory;
        server.register(&registration).await
    };
    let (silent, small, large) = (of(Value::Null).await, of(json!(1000)).await, of(json!(2000)).await);
    let mut needy = envelope(1);
    needy["needs"] = json!({"memory_mib": 2000});
    server.submit(&needy).await;
    for worker in [&silent, &small] {
        assert_eq!(worker.claim(1).await.len(), 0);
    }
    assert_eq!(large.claim(1).await.len(), 1);
    server.stop().await;
}

#[tokio::test]
async fn draining_worker_gets_no_jobs_and_is_notified() {
    let (server, _dir) = TestServer::start().await;
    let worker = server.worker("cpu").await;
    server.submit(&envelope(1)).await;
    let held = worker.claim_one().await;
    server.submit(&envelope(2)).await;
    let beat = format!("/v1/workers/{}/heartbeat", worker.id);
    let none = json!({"attempts": []});
    assert_eq!(server.post(&beat, &none).await.expect(StatusCode::OK)["drain"], false);
    let drain = format!("/v1/workers/{}/drain", worker.id);
    server.post(&drain, &json!({})).await.expect(StatusCode::ACCEPTED);
    assert_eq!(server.post(&beat, &none).await.expect(StatusCode::OK)["drain"], true);
    assert_eq!(worker.claim(1).await.len(), 0);
    worker.deliver(&held).await.expect(StatusCode::OK);
    let shown = server.get("/v1/workers").await.expect(StatusCode::OK)["items"][0].clone();
    assert_eq!((&shown["draining"], &shown["succeeded"]), (&json!(true), &json!(1)));
    let stranger = WorkerId::new();
    server.post(&format!("/v1/workers/{stranger}/drain"), &json!({})).await.problem(404, "not-found");
    server.stop().await;
}

#[tokio::test]
async fn attempt_beyond_max_wall_s_times_out() {
    let (server, _dir) = TestServer::with(|config| config.lease = Duration::from_millis(800)).await;
    let worker = server.worker("cpu").await;
    let mut brief = envelope(1);
    brief["max_wall_s"] = json!(0.5);
    let job = server.submit(&brief).await;
    let claimed = Instant::now();
    let attempt = worker.claim_one().await;
    // Heartbeats continue, as those of a worker whose solver hangs.
    let directive = loop {
        let row = worker.beat(&attempt, progress(0.5)).await;
        if row["directive"] != "continue" || claimed.elapsed() > Duration::from_secs(20) {
            break row["directive"].clone();
        }
        tokio::time::sleep(Duration::from_millis(50)).await;
    };
    let took = claimed.elapsed().as_secs_f64();
    assert_eq!(directive, "abandon");
    assert!(
        took > 1.29,
        "less milliseconds of rounding, max_wall_s and a lease, for its worker to say it first: {took} s"
    );
    let ended = server.job(&job["id"]).await;
    assert_eq!((&ended["state"], &ended["failure_class"]), (&json!("failed"), &json!("timeout")));
    worker.deliver(&attempt).await.problem(409, "stale-attempt");
    server.stop().await;
}
