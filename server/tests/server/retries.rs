//! Another attempt: after a pause, elsewhere if that can be, alone after a lost batch; and where jobs may go at all.

use std::time::{Duration, Instant};

use reqwest::StatusCode;
use roost_api::ids::WorkerId;
use serde_json::{Value, json};

use super::farm::*;

#[tokio::test]
async fn what_a_worker_failed_rests_before_it_is_tried_again() {
    let (farm, _dir) = Farm::with(|config| {
        config.lease = Duration::from_secs(2);
        config.retry.worker.first_pause = Duration::from_secs(2);
    })
    .await;
    let worker = farm.worker("cpu").await;
    let job = farm.submit(&envelope(1)).await;
    assert_eq!(job["retry_at"], Value::Null);
    let attempt = worker.claim_one().await;
    worker.fail(&attempt, "worker", None).await.expect(StatusCode::OK);
    let failed = Instant::now();
    let resting = farm.job(&job["id"]).await;
    assert_eq!(resting["state"], "queued");
    assert!(resting["retry_at"].is_string(), "{resting}");
    assert_eq!(worker.claim(1).await.len(), 0, "not yet");

    // One claim waits all the while, and is woken.
    let request = worker.claim_request(1, 20.0);
    let reply = farm.post("/v1/claims", &request).await.expect(StatusCode::OK);
    assert_eq!(reply["attempts"][0]["attempt"], 2, "{reply}");
    let waited = failed.elapsed().as_secs_f64();
    assert!((0.9..10.0).contains(&waited), "{waited}");
    assert_eq!(farm.job(&job["id"]).await["retry_at"], Value::Null);
    farm.stop().await;
}

#[tokio::test]
async fn a_resting_job_can_be_cancelled_and_a_restart_ends_its_rest() {
    let rest = |config: &mut roost_server::ServerConfig| {
        config.retry.worker.first_pause = Duration::from_secs(60);
    };
    let (farm, dir) = Farm::with(rest).await;
    let worker = farm.worker("cpu").await;
    let (cancelled, kept) = (farm.submit(&envelope(1)).await, farm.submit(&envelope(2)).await);
    for attempt in worker.claim(2).await {
        worker.fail(&attempt, "worker", None).await.expect(StatusCode::OK);
    }
    let path = format!("/v1/jobs/{}/cancel", text(&cancelled["id"]));
    assert_eq!(farm.post(&path, &json!({})).await.expect(StatusCode::OK)["state"], "cancelled");
    farm.stop().await;

    let farm = Farm::on(dir.path(), rest).await;
    let worker = farm.worker("cpu").await;
    assert_eq!(worker.claim_one().await["job_id"], kept["id"]);
    farm.stop().await;
}

#[tokio::test]
async fn another_worker_is_preferred_after_a_failure() {
    let (farm, _dir) = Farm::with(|config| config.lease = Duration::from_secs(2)).await;
    let (first, second) = (farm.worker("cpu").await, farm.worker("cpu").await);
    let gpu = farm.worker("gpu").await;
    let mut needy = envelope(1);
    needy["needs"] = json!({"backend": "cpu"});
    let job = farm.submit(&needy).await;
    let attempt = first.claim_one().await;
    first.fail(&attempt, "worker", None).await.expect(StatusCode::OK);
    assert_eq!(first.claim(1).await.len(), 0, "the second shall have it");
    let attempt = second.claim_one().await;
    second.fail(&attempt, "worker", None).await.expect(StatusCode::OK);

    // Both have failed it, and the third has not what it needs: then any of the two.
    assert_eq!(gpu.claim(1).await.len(), 0);
    let third = first.claim_one().await;
    assert_eq!((&third["job_id"], &third["attempt"]), (&job["id"], &json!(3)));
    farm.stop().await;
}

#[tokio::test]
async fn with_no_other_worker_the_same_one_tries_again() {
    let (farm, _dir) = Farm::with(|config| config.lease = Duration::from_secs(2)).await;
    let (first, second) = (farm.worker("cpu").await, farm.worker("cpu").await);
    farm.submit(&envelope(1)).await;
    let attempt = first.claim_one().await;
    first.fail(&attempt, "worker", None).await.expect(StatusCode::OK);
    assert_eq!(first.claim(1).await.len(), 0);
    farm.post(&format!("/v1/workers/{}/drain", second.id), &json!({})).await.expect(StatusCode::ACCEPTED);
    assert_eq!(first.claim_one().await["attempt"], 2, "the other one takes nothing more");

    farm.submit(&envelope(2)).await;
    let third = farm.worker("cpu").await;
    let attempt = third.claim_one().await;
    third.fail(&attempt, "worker", None).await.expect(StatusCode::OK);
    let deadline = Instant::now() + Duration::from_secs(20);
    // The first says nothing more and counts as gone.
    while third.claim(1).await.is_empty() {
        assert!(Instant::now() < deadline, "waited for a worker that is gone");
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
    farm.stop().await;
}

#[tokio::test]
async fn after_a_lost_batch_its_jobs_run_alone() {
    let (farm, _dir) = Farm::with(|config| config.lease = Duration::from_millis(500)).await;
    let (dead, lone) = (farm.worker("cpu").await, farm.worker("cpu").await);
    let jobs = [farm.submit(&envelope(1)).await, farm.submit(&envelope(2)).await];
    assert_eq!(dead.claim(2).await.len(), 2);
    for job in &jobs {
        assert_eq!(farm.wait_for(&job["id"], "queued").await["alone"], true);
    }
    farm.submit(&envelope(3)).await;
    let only = lone.claim(64).await;
    assert_eq!(only.len(), 1, "one of the lost, and nothing beside it");
    assert_eq!(lone.claim(64).await.len(), 0, "nor later");

    // A claim that waits gets the next one as soon as its worker is empty.
    let request = lone.claim_request(64, 20.0);
    let (next, delivered) = tokio::join!(farm.post("/v1/claims", &request), async {
        tokio::time::sleep(Duration::from_millis(100)).await;
        lone.deliver(&only[0]).await
    });
    delivered.expect(StatusCode::OK);
    let next = next.expect(StatusCode::OK)["attempts"].clone();
    assert_eq!(next.as_array().unwrap().len(), 1, "{next}");
    assert_eq!(farm.job(&next[0]["job_id"]).await["alone"], true);
    lone.deliver(&next[0]).await.expect(StatusCode::OK);
    assert_eq!(lone.claim(64).await.len(), 1, "the third was never lost");
    farm.stop().await;
}

#[tokio::test]
async fn what_was_lost_by_itself_needs_no_place_of_its_own() {
    let (farm, _dir) = Farm::with(|config| config.lease = Duration::from_millis(500)).await;
    let worker = farm.worker("cpu").await;
    let job = farm.submit(&envelope(1)).await;
    worker.claim_one().await;
    assert_eq!(farm.wait_for(&job["id"], "queued").await["alone"], false);
    farm.stop().await;
}

#[tokio::test]
async fn jobs_go_where_there_is_memory_enough() {
    let (farm, _dir) = Farm::start().await;
    let of = async |memory: Value| {
        let mut registration = registration(&WorkerId::new().to_string(), "cpu");
        registration["memory_mib"] = memory;
        farm.register(&registration).await
    };
    let (silent, small, large) = (of(Value::Null).await, of(json!(1000)).await, of(json!(2000)).await);
    let mut needy = envelope(1);
    needy["needs"] = json!({"memory_mib": 2000});
    farm.submit(&needy).await;
    for worker in [&silent, &small] {
        assert_eq!(worker.claim(1).await.len(), 0);
    }
    assert_eq!(large.claim(1).await.len(), 1);
    farm.stop().await;
}

#[tokio::test]
async fn a_worker_that_drains_gets_nothing_more_and_hears_of_it() {
    let (farm, _dir) = Farm::start().await;
    let worker = farm.worker("cpu").await;
    farm.submit(&envelope(1)).await;
    let held = worker.claim_one().await;
    farm.submit(&envelope(2)).await;
    let beat = format!("/v1/workers/{}/heartbeat", worker.id);
    let none = json!({"attempts": []});
    assert_eq!(farm.post(&beat, &none).await.expect(StatusCode::OK)["drain"], false);
    let drain = format!("/v1/workers/{}/drain", worker.id);
    farm.post(&drain, &json!({})).await.expect(StatusCode::ACCEPTED);
    assert_eq!(farm.post(&beat, &none).await.expect(StatusCode::OK)["drain"], true);
    assert_eq!(worker.claim(1).await.len(), 0);
    worker.deliver(&held).await.expect(StatusCode::OK);
    let shown = farm.get("/v1/workers").await.expect(StatusCode::OK)["items"][0].clone();
    assert_eq!((&shown["draining"], &shown["succeeded"]), (&json!(true), &json!(1)));
    let stranger = WorkerId::new();
    farm.post(&format!("/v1/workers/{stranger}/drain"), &json!({})).await.problem(404, "not-found");
    farm.stop().await;
}

#[tokio::test]
async fn what_its_worker_does_not_stop_in_time_times_out() {
    let (farm, _dir) = Farm::with(|config| config.lease = Duration::from_millis(800)).await;
    let worker = farm.worker("cpu").await;
    let mut brief = envelope(1);
    brief["max_wall_s"] = json!(0.5);
    let job = farm.submit(&brief).await;
    let attempt = worker.claim_one().await;
    let claimed = Instant::now();
    // It beats and beats, as a worker does whose solver hangs.
    let directive = loop {
        let row = worker.beat(&attempt, progress(0.5)).await;
        if row["directive"] != "continue" || claimed.elapsed() > Duration::from_secs(20) {
            break row["directive"].clone();
        }
        tokio::time::sleep(Duration::from_millis(50)).await;
    };
    let took = claimed.elapsed().as_secs_f64();
    assert_eq!(directive, "abandon");
    assert!(took > 1.3, "max_wall_s and a lease, for its worker to say it first: {took} s");
    let ended = farm.job(&job["id"]).await;
    assert_eq!((&ended["state"], &ended["failure_class"]), (&json!("failed"), &json!("timeout")));
    worker.deliver(&attempt).await.problem(409, "stale-attempt");
    farm.stop().await;
}
