//! Leases: jobs of expired leases are queued again, valid leases survive a restart of the server.

use std::time::Duration;

use reqwest::StatusCode;
use serde_json::json;

use super::database;
use super::test_server::*;

#[tokio::test]
async fn expired_lease_requeues_the_job_and_heartbeats_renew_a_lease() {
    let lease = Duration::from_secs(2);
    let (server, _dir) = TestServer::with(|config| config.lease = lease).await;
    let (dead, alive) = (server.worker("cpu").await, server.worker("cpu").await);
    let lost = server.submit(&envelope(1)).await;
    dead.claim_one().await;
    let kept = server.submit(&envelope(2)).await;
    let held = alive.claim_one().await;
    for _ in 0..15 {
        assert_eq!(alive.beat(&held, progress(0.5)).await["directive"], "continue");
        tokio::time::sleep(lease / 10).await;
    }
    assert_eq!(alive.beat(&held, progress(0.5)).await["directive"], "continue");
    assert_eq!(server.job(&kept["id"]).await["attempt"], 1, "heartbeats renew the lease");
    server.wait_for(&lost["id"], "queued").await;
    let second = alive.claim_one().await;
    assert_eq!((&second["job_id"], &second["attempt"]), (&lost["id"], &json!(2)));
    alive.deliver(&second).await.expect(StatusCode::OK);
    server.stop().await;
}

#[tokio::test]
async fn expired_attempt_may_deliver_until_the_job_is_claimed_again() {
    let (server, _dir) = TestServer::with(|config| config.lease = Duration::from_secs(5)).await;
    let worker = server.worker("cpu").await;
    let job = server.submit(&envelope(1)).await;
    let attempt = worker.claim_one().await;
    server.wait_for(&job["id"], "queued").await;
    assert_eq!(worker.beat(&attempt, progress(0.5)).await["directive"], "continue");
    let found = server.job(&job["id"]).await;
    assert_eq!((&found["state"], &found["attempt"]), (&json!("running"), &json!(1)));
    server.wait_for(&job["id"], "queued").await;
    worker.deliver(&attempt).await.expect(StatusCode::OK);
    assert_eq!(server.job(&job["id"]).await["state"], "succeeded");
    assert_eq!(worker.claim(1).await.len(), 0);
    server.stop().await;
}

#[tokio::test]
async fn job_fails_after_the_maximum_of_losses() {
    let (server, _dir) = TestServer::with(|config| {
        config.lease = Duration::from_millis(80);
        config.retry.lost.attempts = 2;
    })
    .await;
    let worker = server.worker("cpu").await;
    let job = server.submit(&envelope(1)).await;
    worker.claim_one().await;
    server.wait_for(&job["id"], "queued").await;
    let last = worker.claim_one().await;
    let failed = server.wait_for(&job["id"], "failed").await;
    assert_eq!(failed["failure_class"], "lost");
    worker.deliver(&last).await.problem(409, "stale-attempt");
    server.stop().await;
}

#[tokio::test]
async fn recovered_attempt_does_not_count_as_lost() {
    let (server, _dir) = TestServer::with(|config| {
        config.lease = Duration::from_millis(150);
        config.retry.lost.attempts = 2;
    })
    .await;
    let worker = server.worker("cpu").await;
    let job = server.submit(&envelope(1)).await;
    let attempt = worker.claim_one().await;
    for _ in 0..3 {
        server.wait_for(&job["id"], "queued").await;
        assert_eq!(worker.beat(&attempt, progress(0.5)).await["directive"], "continue");
    }
    server.stop().await;
}

#[tokio::test]
async fn restart_preserves_jobs_and_leases() {
    let lease = Duration::from_secs(60);
    let (server, dir) = TestServer::with(|config| config.lease = lease).await;
    let running = server.submit(&envelope(1)).await;
    let worker = server.worker("cpu").await;
    let worker_id = worker.id.clone();
    let attempt = worker.claim_one().await;
    let queued = server.submit(&envelope(2)).await;
    server.stop().await;
    // As after a stop that was longer than the lease.
    for aged in [
        "UPDATE jobs SET lease_expires_at = 1 WHERE state = 'running'",
        "UPDATE workers SET last_seen_at = 1",
    ] {
        database::execute(dir.path(), aged).await;
    }

    let server = TestServer::on(dir.path(), |config| config.lease = lease).await;
    let worker = Worker { server: &server, id: worker_id };
    tokio::time::sleep(Duration::from_millis(2500)).await; // the reaper checks leases each second
    assert_eq!(server.job(&running["id"]).await["state"], "running", "the lease starts anew with the server");
    let mut kept = server.job(&queued["id"]).await;
    // Only a read of the job says why it waits.
    assert_eq!(kept["waiting"].take()["reason"], "no_worker");
    assert_eq!(kept, queued);
    assert_eq!(worker.beat(&attempt, progress(0.7)).await["directive"], "continue");
    worker.deliver(&attempt).await.expect(StatusCode::OK);
    let done = server.job(&running["id"]).await;
    assert_eq!((&done["state"], &done["attempt"]), (&json!("succeeded"), &json!(1)), "no run was lost");
    server.stop().await;
}
