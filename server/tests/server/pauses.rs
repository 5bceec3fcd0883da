//! Pause and resume of jobs and sweeps.

use std::time::Duration;

use reqwest::StatusCode;
use serde_json::{Value, json};

use super::test_server::*;

async fn ask(server: &TestServer, path: &str) -> Value {
    server.post(path, &json!({})).await.expect(StatusCode::OK)
}

#[tokio::test]
async fn a_paused_job_is_claimed_after_its_resume() {
    let (server, _dir) = TestServer::start().await;
    let worker = server.worker("cpu").await;
    let job = server.submit(&envelope(1)).await;
    let path = |what: &str| format!("/v1/jobs/{}/{what}", text(&job["id"]));
    let paused = ask(&server, &path("pause")).await;
    assert_eq!((&paused["state"], &paused["paused"]), (&json!("queued"), &json!(true)));
    assert_eq!(worker.claim(1).await, [Value::Null; 0]);
    let metrics = server.get("/metrics").await.text;
    for line in [r#"roost_jobs{state="queued"} 1"#, "roost_jobs_paused 1", "roost_oldest_queued_seconds 0.0"]
    {
        assert!(metrics.contains(line), "{line}: {metrics}");
    }

    // The resume wakes a waiting claim.
    let request = worker.claim_request(1, 20.0);
    let claiming = server.post("/v1/claims", &request);
    let resuming = async {
        tokio::time::sleep(Duration::from_millis(100)).await;
        ask(&server, &path("resume")).await
    };
    let (claimed, resumed) = tokio::join!(claiming, resuming);
    assert_eq!(resumed["paused"], false);
    assert_eq!(claimed.expect(StatusCode::OK)["attempts"][0]["job_id"], job["id"]);
    server.stop().await;
}

#[tokio::test]
async fn a_running_job_that_is_paused_is_preempted_and_waits() {
    let (server, _dir) = TestServer::start().await;
    let worker = server.worker("cpu").await;
    let job = server.submit(&envelope(1)).await;
    let path = |what: &str| format!("/v1/jobs/{}/{what}", text(&job["id"]));
    let attempt = worker.claim_one().await;
    assert_eq!(worker.beat(&attempt, Value::Null).await["directive"], "continue");
    let etag = |answer: reqwest::Response| answer.headers()["etag"].to_str().unwrap().to_owned();
    let url = format!("http://{}/v1/jobs/{}", server.address, text(&job["id"]));
    let before = etag(server.http.get(&url).send().await.unwrap());
    let pausing = ask(&server, &path("pause")).await;
    assert_eq!((&pausing["state"], &pausing["paused"]), (&json!("running"), &json!(true)));
    assert_ne!(etag(server.http.get(&url).send().await.unwrap()), before, "pollers learn of it");
    assert_eq!(worker.beat(&attempt, progress(0.5)).await["directive"], "preempt");
    worker.fail(&attempt, "preempted", None).await.expect(StatusCode::OK);
    let waits = server.job(&job["id"]).await;
    assert_eq!((&waits["state"], &waits["paused"]), (&json!("queued"), &json!(true)));
    assert_eq!(worker.claim(1).await, [Value::Null; 0]);
    ask(&server, &path("resume")).await;
    assert_eq!(worker.claim_one().await["attempt"], 2);
    server.stop().await;
}

#[tokio::test]
async fn a_result_of_a_paused_job_is_recorded_and_an_ended_job_is_not_paused() {
    let (server, _dir) = TestServer::start().await;
    let worker = server.worker("cpu").await;
    let job = server.submit(&envelope(1)).await;
    let attempt = worker.claim_one().await;
    let path = |id: &Value, what: &str| format!("/v1/jobs/{}/{what}", text(id));
    ask(&server, &path(&job["id"], "pause")).await;
    worker.deliver(&attempt).await.expect(StatusCode::OK);
    for _ in 0..2 {
        let ended = server.job(&job["id"]).await;
        assert_eq!((&ended["state"], &ended["paused"]), (&json!("succeeded"), &json!(false)));
        ask(&server, &path(&job["id"], "pause")).await;
    }
    // A cancel ends the pause: a retry is claimed.
    let other = server.submit(&envelope(2)).await;
    ask(&server, &path(&other["id"], "pause")).await;
    let cancelled = ask(&server, &path(&other["id"], "cancel")).await;
    assert_eq!((&cancelled["state"], &cancelled["paused"]), (&json!("cancelled"), &json!(false)));
    ask(&server, &path(&other["id"], "retry")).await;
    assert_eq!(worker.claim_one().await["job_id"], other["id"]);
    let unknown = "/v1/jobs/019a0000-0000-7000-8000-000000000000/pause";
    server.post(unknown, &json!({})).await.problem(404, "not-found");
    server.stop().await;
}

#[tokio::test]
async fn a_sweep_is_paused_and_resumed() {
    let (server, _dir) = TestServer::start().await;
    let worker = server.worker("cpu").await;
    let sweep = json!({"name": "three", "base": scenario(1), "design": {"kind": "grid"},
                       "factors": [{"pointer": "/equipment/gate_opening_m", "levels": [0.045, 0.06, 0.07]}]});
    let view = server.post("/v1/sweeps", &sweep).await.expect(StatusCode::CREATED);
    let path = |what: &str| format!("/v1/sweeps/{}{what}", text(&view["id"]));
    let attempts = worker.claim(2).await;
    worker.deliver(&attempts[0]).await.expect(StatusCode::OK);
    let paused = ask(&server, &path("/pause")).await;
    let counts = |view: &Value| {
        let counts = &view["counts"];
        [&counts["queued"], &counts["running"], &counts["succeeded"], &view["paused"]]
            .map(|n| n.as_u64().unwrap())
    };
    assert_eq!(counts(&paused), [1, 1, 1, 2]);
    assert_eq!(worker.claim(3).await, [Value::Null; 0]);
    assert_eq!(worker.beat(&attempts[1], Value::Null).await["directive"], "preempt");
    let events = server.get(&format!("/v1/sweeps/{}/jobs?state=queued", text(&view["id"]))).await;
    assert_eq!(events.body["items"][0]["paused"], true);
    let resumed = ask(&server, &path("/resume")).await;
    assert_eq!(counts(&resumed), [1, 1, 1, 0]);
    assert_eq!(worker.beat(&attempts[1], Value::Null).await["directive"], "continue");
    assert_eq!(worker.claim(3).await.len(), 1);
    let unknown = "/v1/sweeps/019a0000-0000-7000-8000-000000000000/pause";
    server.post(unknown, &json!({})).await.problem(404, "not-found");
    server.stop().await;
}
