//! Why queued jobs wait: each reason made for real, and beside it what a claim gets.

use std::time::{Duration, Instant};

use reqwest::StatusCode;
use roost_api::ids::WorkerId;
use serde_json::{Value, json};

use super::test_server::*;

/// Waits until a job waits for this reason.
async fn reason(server: &TestServer, id: &Value, expected: &str) -> Value {
    let deadline = Instant::now() + Duration::from_secs(60);
    loop {
        let job = server.job(id).await;
        assert_eq!(job["state"], "queued", "{job}");
        let waiting = job["waiting"].clone();
        if waiting["reason"] == expected {
            return waiting;
        }
        assert!(Instant::now() < deadline, "not {expected}: {waiting}");
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
}

/// Waits until this many jobs come first.
async fn behind(server: &TestServer, id: &Value, count: u64) -> Value {
    let deadline = Instant::now() + Duration::from_secs(60);
    loop {
        let waiting = reason(server, id, "behind").await;
        if waiting["behind"] == count {
            return waiting;
        }
        assert!(Instant::now() < deadline, "not behind {count}: {waiting}");
    }
}

async fn ask(server: &TestServer, id: &Value, verb: &str) -> Value {
    server.post(&format!("/v1/jobs/{}/{verb}", text(id)), &json!({})).await.expect(StatusCode::OK)
}

fn needy(seed: u64, needs: Value) -> Value {
    let mut job = envelope(seed);
    job["needs"] = needs;
    job
}

#[tokio::test]
async fn a_job_waits_for_a_worker_that_fits() {
    let (server, _dir) = TestServer::with(|config| config.lease = Duration::from_secs(60)).await;
    let job = server.submit(&needy(1, json!({"memory_mib": 12288}))).await;
    let waiting = reason(&server, &job["id"], "no_worker").await;
    assert_eq!((&waiting["detail"], &waiting["behind"]), (&json!("no worker is online"), &Value::Null));
    assert_eq!(waiting["since"], job["submitted_at"]);

    let mut small = registration(&WorkerId::new().to_string(), "cpu");
    (small["memory_mib"], small["name"]) = (json!(8192), json!("small"));
    let small = server.register(&small).await;
    let waiting = reason(&server, &job["id"], "no_fitting_worker").await;
    assert_eq!(
        waiting["detail"],
        "it needs 12288 MiB of memory, and the worker with the most, small, has 8192 MiB"
    );
    assert_eq!(small.claim(1).await.len(), 0);
    let on_gpu = server.submit(&needy(2, json!({"backend": "gpu"}))).await;
    let waiting = reason(&server, &on_gpu["id"], "no_fitting_worker").await;
    assert_eq!(waiting["detail"], "it needs the backend gpu, and the online workers have cpu");

    let mut large = registration(&WorkerId::new().to_string(), "cpu");
    large["memory_mib"] = json!(16384);
    let large = server.register(&large).await;
    // The job of the GPU does not come first: no worker of the CPU would take it.
    let waiting = reason(&server, &job["id"], "next").await;
    assert_eq!(
        (&waiting["detail"], &waiting["behind"]),
        (&json!("it is next, and 1 fitting worker has a free slot"), &json!(0))
    );
    assert_eq!(large.claim_one().await["job_id"], job["id"]);
    assert_eq!(server.job(&job["id"]).await["waiting"], Value::Null, "it runs");
    for worker in [&small, &large] {
        let path = format!("/v1/workers/{}/drain", worker.id);
        server.post(&path, &json!({})).await.expect(StatusCode::ACCEPTED);
    }
    let waiting = reason(&server, &on_gpu["id"], "no_worker").await;
    assert_eq!(waiting["detail"], "2 workers are online, and none takes further jobs");
    server.stop().await;
}

#[tokio::test]
async fn a_job_waits_behind_those_that_claims_take_first() {
    let (server, _dir) = TestServer::with(|config| config.lease = Duration::from_secs(60)).await;
    let worker = server.worker("cpu").await;
    let mut jobs = Vec::new();
    for seed in 1..=4 {
        jobs.push(server.submit(&envelope(seed)).await["id"].clone());
    }
    let mut urgent = envelope(5);
    urgent["priority"] = json!(3);
    let urgent = server.submit(&urgent).await["id"].clone();
    let waiting = behind(&server, &jobs[3], 4).await;
    assert_eq!(waiting["detail"], "behind 4 jobs, 1 of them of higher priority");
    assert_eq!(behind(&server, &jobs[0], 1).await["detail"], "behind 1 job of higher priority");
    // A paused job comes before nobody.
    let paused = ask(&server, &jobs[1], "pause").await;
    assert_eq!(
        (&paused["paused"], &paused["waiting"]),
        (&json!(true), &Value::Null),
        "only a read of the job says why"
    );
    assert_eq!(reason(&server, &jobs[1], "paused").await["detail"], "a user has paused it");
    behind(&server, &jobs[3], 3).await;
    ask(&server, &jobs[1], "resume").await;

    // The order of claims is the order of the reasons.
    let mut order = vec![urgent];
    order.extend(jobs.iter().cloned());
    for (place, id) in order.iter().enumerate() {
        assert_eq!(worker.claim_one().await["job_id"], *id, "job {place}");
        if let Some(next) = order.get(place + 1) {
            let waiting = reason(&server, next, "workers_busy").await;
            let expected = format!(
                "1 fitting worker with {0} slot{1} runs {0} job{1}",
                place + 1,
                if place == 0 { "" } else { "s" }
            );
            assert_eq!(waiting["detail"], format!("it is next; {expected}"));
            assert_eq!(waiting["behind"], 0);
        }
    }
    server.stop().await;
}

#[tokio::test]
async fn a_failed_job_waits_for_its_pause_and_prefers_another_worker() {
    let (server, _dir) = TestServer::with(|config| {
        config.lease = Duration::from_secs(60);
        config.retry.worker.first_pause = Duration::from_secs(60);
    })
    .await;
    let worker = server.worker("cpu").await;
    let job = server.submit(&envelope(1)).await;
    let attempt = worker.claim_one().await;
    worker.fail(&attempt, "worker", None).await.expect(StatusCode::OK);
    let waiting = reason(&server, &job["id"], "retry_pause").await;
    let until = text(&waiting["until"]).to_owned();
    assert_eq!(server.job(&job["id"]).await["retry_at"], until.as_str());
    let expected =
        format!("attempt 1 ended as worker (it was worker); the next one starts at {until} at the earliest");
    assert_eq!(waiting["detail"], expected.as_str());
    assert_ne!(waiting["since"], job["submitted_at"], "since it is queued again");
    assert_eq!(worker.claim(1).await.len(), 0);
    server.stop().await;

    let (server, _dir) = TestServer::with(|config| config.lease = Duration::from_secs(60)).await;
    let (first, second) = (server.worker("cpu").await, server.worker("cpu").await);
    let job = server.submit(&envelope(1)).await;
    let attempt = first.claim_one().await;
    first.fail(&attempt, "worker", None).await.expect(StatusCode::OK);
    assert_eq!(first.claim(1).await.len(), 0, "it leaves the job to the second one");
    let waiting = reason(&server, &job["id"], "next").await;
    assert!(
        text(&waiting["detail"])
            .starts_with("it is next, and 1 fitting worker has a free slot; the worker bench has failed it"),
        "{waiting}"
    );
    assert_eq!(second.claim(1).await.len(), 1);
    server.stop().await;
}

#[tokio::test]
async fn a_job_waits_for_the_fill_that_another_one_computes() {
    let (server, _dir) = TestServer::with(|config| config.lease = Duration::from_secs(60)).await;
    let worker = server.worker("cpu").await;
    let mut ids = Vec::new();
    for gate_m in [0.04, 0.05] {
        let mut job = envelope(1);
        job["scenario"]["equipment"] = json!({"gate_opening_m": gate_m});
        ids.push(server.submit(&job).await["id"].clone());
    }
    let got = worker.claim_sharing(2, 0.0).await;
    assert_eq!(got.len(), 1, "one computes the fill");
    let waiting = reason(&server, &ids[1], "waiting_for_fill").await;
    assert_eq!(waiting["fill_job_id"], ids[0]);
    assert_eq!(waiting["detail"], format!("job {} computes its filled state", text(&ids[0])));
    worker.fill(&got[0], b"a fill").await.expect(StatusCode::OK);
    reason(&server, &ids[1], "next").await;
    assert_eq!(worker.claim_sharing(1, 0.0).await.len(), 1);
    server.stop().await;
}

#[tokio::test]
async fn a_job_that_runs_alone_waits_for_an_idle_worker() {
    let (server, _dir) = TestServer::with(|config| config.lease = Duration::from_secs(6)).await;
    let (dead, busy) = (server.worker("cpu").await, server.worker("cpu").await);
    let lost = [server.submit(&envelope(1)).await, server.submit(&envelope(2)).await];
    assert_eq!(dead.claim(2).await.len(), 2);
    server.submit(&envelope(3)).await;
    let held = busy.claim(2).await.remove(0);
    let deadline = Instant::now() + Duration::from_secs(60);
    loop {
        busy.beat(&held, Value::Null).await;
        let job = server.job(&lost[0]["id"]).await;
        if job["waiting"]["reason"] == "needs_idle_worker" {
            assert_eq!(job["alone"], true);
            assert_eq!(busy.claim(2).await.len(), 0, "it runs another job");
            break;
        }
        assert!(Instant::now() < deadline, "{job}");
        tokio::time::sleep(Duration::from_millis(100)).await;
    }
    busy.deliver(&held).await.expect(StatusCode::OK);
    assert_eq!(busy.claim(2).await.len(), 1, "idle, it gets one of them");
    server.stop().await;
}

#[tokio::test]
async fn etag_changes_with_the_waiting_reason() {
    let (server, _dir) = TestServer::with(|config| config.lease = Duration::from_secs(60)).await;
    let job = server.submit(&envelope(1)).await;
    let path = format!("/v1/jobs/{}", text(&job["id"]));
    let (_, tag, body) = super::etags::poll(&server, &path, None).await;
    assert!(body.contains("\"no_worker\""), "{body}");
    server.worker("cpu").await;
    let deadline = Instant::now() + Duration::from_secs(60);
    loop {
        let (status, _, body) = super::etags::poll(&server, &path, Some(&tag)).await;
        if status == 200 {
            assert!(body.contains("\"next\""), "{body}");
            break;
        }
        assert!(Instant::now() < deadline, "the job has not changed, and its reason has");
        tokio::time::sleep(Duration::from_millis(200)).await;
    }
    server.stop().await;
}
