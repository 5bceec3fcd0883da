//! Leases: lost ones come back to the queue, live ones survive a restart of the server.

use std::time::Duration;

use reqwest::StatusCode;
use serde_json::json;

use super::farm::*;

#[tokio::test]
async fn a_lost_lease_is_run_by_another_and_heartbeats_keep_one() {
    let lease = Duration::from_secs(2);
    let (farm, _dir) = Farm::with(|config| config.lease = lease).await;
    let (dead, alive) = (farm.worker("cpu").await, farm.worker("cpu").await);
    let lost = farm.submit(&envelope(1)).await;
    dead.claim_one().await;
    let kept = farm.submit(&envelope(2)).await;
    let held = alive.claim_one().await;
    for _ in 0..15 {
        assert_eq!(alive.beat(&held, progress(0.5)).await["directive"], "continue");
        tokio::time::sleep(lease / 10).await;
    }
    assert_eq!(alive.beat(&held, progress(0.5)).await["directive"], "continue");
    assert_eq!(farm.job(&kept["id"]).await["attempt"], 1, "beats renew the lease");
    assert_eq!(farm.job(&lost["id"]).await["state"], "queued");
    let second = alive.claim_one().await;
    assert_eq!((&second["job_id"], &second["attempt"]), (&lost["id"], &json!(2)));
    alive.deliver(&second).await.expect(StatusCode::OK);
    farm.stop().await;
}

#[tokio::test]
async fn an_expired_but_unclaimed_attempt_may_still_beat_and_deliver() {
    let (farm, _dir) = Farm::with(|config| config.lease = Duration::from_secs(2)).await;
    let worker = farm.worker("cpu").await;
    let job = farm.submit(&envelope(1)).await;
    let attempt = worker.claim_one().await;
    farm.wait_for(&job["id"], "queued").await;
    assert_eq!(worker.beat(&attempt, progress(0.5)).await["directive"], "continue");
    let found = farm.job(&job["id"]).await;
    assert_eq!((&found["state"], &found["attempt"]), (&json!("running"), &json!(1)));
    farm.wait_for(&job["id"], "queued").await;
    worker.deliver(&attempt).await.expect(StatusCode::OK);
    assert_eq!(farm.job(&job["id"]).await["state"], "succeeded");
    assert_eq!(worker.claim(1).await.len(), 0);
    farm.stop().await;
}

#[tokio::test]
async fn the_last_of_the_losses_fails_the_job() {
    let (farm, _dir) = Farm::with(|config| {
        config.lease = Duration::from_millis(80);
        config.retry.lost.attempts = 2;
    })
    .await;
    let worker = farm.worker("cpu").await;
    let job = farm.submit(&envelope(1)).await;
    worker.claim_one().await;
    farm.wait_for(&job["id"], "queued").await;
    let last = worker.claim_one().await;
    let failed = farm.wait_for(&job["id"], "failed").await;
    assert_eq!(failed["failure_class"], "lost");
    worker.deliver(&last).await.problem(409, "stale-attempt");
    farm.stop().await;
}

#[tokio::test]
async fn an_attempt_found_again_was_never_lost() {
    let (farm, _dir) = Farm::with(|config| {
        config.lease = Duration::from_millis(150);
        config.retry.lost.attempts = 2;
    })
    .await;
    let worker = farm.worker("cpu").await;
    let job = farm.submit(&envelope(1)).await;
    let attempt = worker.claim_one().await;
    for _ in 0..3 {
        farm.wait_for(&job["id"], "queued").await;
        assert_eq!(worker.beat(&attempt, progress(0.5)).await["directive"], "continue");
    }
    farm.stop().await;
}

#[tokio::test]
async fn a_restart_keeps_jobs_and_leases() {
    let (farm, dir) = Farm::with(|config| config.lease = Duration::from_secs(3)).await;
    let running = farm.submit(&envelope(1)).await;
    let worker = farm.worker("cpu").await;
    let worker_id = worker.id.clone();
    let attempt = worker.claim_one().await;
    let queued = farm.submit(&envelope(2)).await;
    farm.stop().await;
    tokio::time::sleep(Duration::from_millis(3200)).await; // longer than the lease

    let farm = Farm::on(dir.path(), |config| config.lease = Duration::from_secs(3)).await;
    let worker = Worker { farm: &farm, id: worker_id };
    tokio::time::sleep(Duration::from_millis(1000)).await; // long enough for expired leases to be looked for
    assert_eq!(farm.job(&running["id"]).await["state"], "running", "the lease starts anew with the server");
    assert_eq!(farm.job(&queued["id"]).await, queued);
    assert_eq!(worker.beat(&attempt, progress(0.7)).await["directive"], "continue");
    worker.deliver(&attempt).await.expect(StatusCode::OK);
    let done = farm.job(&running["id"]).await;
    assert_eq!((&done["state"], &done["attempt"]), (&json!("succeeded"), &json!(1)), "no run was lost");
    farm.stop().await;
}
