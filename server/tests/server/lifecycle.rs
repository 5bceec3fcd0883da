//! The life of a job from submission to each of its ends.

use reqwest::StatusCode;
use roost_solver::result::{EndReason, Instability};
use serde_json::{Value, json};

use super::test_server::*;

#[tokio::test]
async fn job_is_submitted_run_and_answered() {
    let (server, _dir) = TestServer::start().await;
    let mut envelope = envelope(1);
    envelope["labels"] = json!({"line": "north"});
    let answer = server.post("/v1/jobs", &envelope).await;
    let location = answer.location.clone().unwrap();
    let job = answer.expect(StatusCode::ACCEPTED);
    assert_eq!(location, format!("/v1/jobs/{}", text(&job["id"])));
    assert_eq!((&job["state"], &job["attempt"], &job["seed"]), (&json!("queued"), &json!(0), &json!(1)));
    let no_result = server.get(&format!("{location}/result")).await.problem(404, "not-found");
    assert!(text(&no_result["detail"]).contains("queued"));

    let worker = server.worker("cpu").await;
    let attempt = worker.claim_one().await;
    assert_eq!(attempt["job_id"], job["id"]);
    assert_eq!(attempt["attempt"], 1);
    assert_eq!(attempt["scenario"]["material"]["poisson_ratio"], 0.37, "with all defaults");
    let directive = worker.beat(&attempt, progress(0.25)).await;
    assert_eq!(directive["directive"], "continue");
    assert!(text(&directive["lease_expires_at"]) > text(&job["submitted_at"]));
    let running = server.job(&job["id"]).await;
    assert_eq!(running["state"], "running");
    assert_eq!(running["progress"]["fraction"], 0.25);
    assert_eq!(text(&running["worker_id"]), worker.id);

    let receipt = worker.deliver(&attempt).await.expect(StatusCode::OK);
    assert_eq!(receipt["recorded"], true);
    let done = server.job(&job["id"]).await;
    assert_eq!((&done["state"], &done["from_cache"]), (&json!("succeeded"), &json!(false)));
    assert_eq!(done["responses"]["discharged_kg"], 31.0);
    assert_eq!(done["responses"]["time_to_99_percent_s"], Value::Null);
    assert_eq!(done["progress"], Value::Null);
    let result = server.get(&format!("{location}/result")).await.expect(StatusCode::OK);
    assert_eq!(result, json!(result_of(&attempt["scenario"])), "passed on unchanged");

    let series = server.get(&format!("{location}/series/discharged_mass")).await.expect(StatusCode::OK);
    let mut told = result["series"][0].clone();
    told["partial"] = json!(false);
    assert_eq!(series, told);
    let csv = server.get(&format!("{location}/series/discharged_mass?format=csv")).await;
    assert_eq!(csv.media_type, "text/csv; charset=utf-8");
    assert_eq!(csv.text, "t_s,discharged_mass [kg]\n0.0,0.0\n0.02,0.1\n0.04,0.3333333333333333\n");
    let unknown = server.get(&format!("{location}/series/mass")).await.problem(404, "not-found");
    assert!(text(&unknown["detail"]).contains("discharged_mass"));

    let workers = server.get("/v1/workers").await.expect(StatusCode::OK);
    assert_eq!(workers["items"][0]["succeeded"], 1);
    assert_eq!(workers["items"][0]["running"], json!([]));
    server.stop().await;
}

#[tokio::test]
async fn equal_scenario_gets_the_stored_result_unless_bypassed() {
    let (server, _dir) = TestServer::start().await;
    let worker = server.worker("cpu").await;
    server.submit(&envelope(7)).await;
    worker.deliver(&worker.claim_one().await).await.expect(StatusCode::OK);

    let mut written_out = envelope(7);
    written_out["scenario"]["material"] = json!({"poisson_ratio": 0.37});
    let hit = server.submit(&written_out).await;
    assert_eq!(hit["state"], "succeeded");
    assert_eq!((&hit["from_cache"], &hit["attempt"]), (&json!(true), &json!(0)));
    assert_eq!(hit["responses"]["discharged_kg"], 37.0);
    let result = server.get(&format!("/v1/jobs/{}/result", text(&hit["id"]))).await.expect(StatusCode::OK);
    assert_eq!(result["scenario"]["seed"], 7);

    assert_eq!(server.submit(&envelope(8)).await["state"], "queued", "another seed is another scenario");
    let mut bypass = envelope(7);
    bypass["cache"] = json!("bypass");
    assert_eq!(server.submit(&bypass).await["state"], "queued");
    server.stop().await;
}

#[tokio::test]
async fn unstable_run_fails_with_a_partial_result_that_is_not_reused() {
    let (server, _dir) = TestServer::start().await;
    let worker = server.worker("cpu").await;
    let job = server.submit(&envelope(1)).await;
    let attempt = worker.claim_one().await;
    let mut partial = result_of(&attempt["scenario"]);
    partial.end_reason = EndReason::Unstable;
    partial.instability = Some(Instability { step: 9, time_s: 0.1, reason: "too fast".to_owned() });

    let refused = worker.deliver_result(&attempt, &partial).await.problem(422, "invalid-document");
    assert_eq!(refused["errors"][0]["pointer"], "/result/end_reason");
    worker.fail(&attempt, "unstable", Some(&partial)).await.expect(StatusCode::OK);
    let failed = server.job(&job["id"]).await;
    assert_eq!((&failed["state"], &failed["failure_class"]), (&json!("failed"), &json!("unstable")));
    assert_eq!(failed["failure_message"], "it was unstable");
    assert_eq!(failed["responses"], json!({}), "only succeeded jobs have responses");
    let kept = server.get(&format!("/v1/jobs/{}/result", text(&job["id"]))).await.expect(StatusCode::OK);
    assert_eq!(kept["instability"]["step"], 9);

    assert_eq!(server.submit(&envelope(1)).await["state"], "queued", "not cached");
    server.stop().await;
}

#[tokio::test]
async fn worker_failures_are_retried_three_times_and_a_retry_resets_the_count() {
    let (server, _dir) = TestServer::start().await;
    let worker = server.worker("cpu").await;
    let job = server.submit(&envelope(1)).await;
    for (number, state) in [(1, "queued"), (2, "queued"), (3, "failed")] {
        let attempt = worker.claim_one().await;
        assert_eq!(attempt["attempt"], number);
        worker.fail(&attempt, "worker", None).await.expect(StatusCode::OK);
        assert_eq!(server.job(&job["id"]).await["state"], state);
    }
    assert_eq!(server.job(&job["id"]).await["failure_class"], "worker");

    let path = format!("/v1/jobs/{}/retry", text(&job["id"]));
    server.post(&format!("{path}?class=lost"), &json!({})).await.problem(409, "wrong-state");
    let again = server.post(&format!("{path}?class=worker"), &json!({})).await.expect(StatusCode::OK);
    assert_eq!((&again["state"], &again["failure_class"]), (&json!("queued"), &Value::Null));
    server.post(&path, &json!({})).await.problem(409, "wrong-state");
    let attempt = worker.claim_one().await;
    assert_eq!(attempt["attempt"], 4, "attempt numbers are never reused");
    worker.fail(&attempt, "worker", None).await.expect(StatusCode::OK);
    assert_eq!(server.job(&job["id"]).await["state"], "queued", "the retry has three attempts of its own");
    worker.deliver(&worker.claim_one().await).await.expect(StatusCode::OK);
    assert_eq!(server.job(&job["id"]).await["state"], "succeeded");
    server.post(&path, &json!({})).await.problem(409, "wrong-state");
    server.stop().await;
}

#[tokio::test]
async fn released_attempt_is_no_failure() {
    let (server, _dir) = TestServer::start().await;
    let worker = server.worker("cpu").await;
    let job = server.submit(&envelope(1)).await;
    for _ in 0..6 {
        let attempt = worker.claim_one().await;
        worker.fail(&attempt, "released", None).await.expect(StatusCode::OK);
        assert_eq!(server.job(&job["id"]).await["state"], "queued");
    }
    server.stop().await;
}

#[tokio::test]
async fn other_failure_classes_fail_at_once() {
    let (server, _dir) = TestServer::start().await;
    let worker = server.worker("cpu").await;
    for (seed, class) in [(1, "invalid"), (2, "timeout")] {
        let job = server.submit(&envelope(seed)).await;
        worker.fail(&worker.claim_one().await, class, None).await.expect(StatusCode::OK);
        let failed = server.job(&job["id"]).await;
        assert_eq!((&failed["state"], &failed["failure_class"]), (&json!("failed"), &json!(class)));
        let path = format!("/v1/jobs/{}/result", text(&job["id"]));
        assert!(
            text(&server.get(&path).await.problem(404, "not-found")["detail"]).contains("left no result")
        );
    }
    server.stop().await;
}

#[tokio::test]
async fn listings_are_filtered_and_paged() {
    let (server, _dir) = TestServer::start().await;
    for seed in 0..5 {
        let mut envelope = envelope(seed);
        envelope["labels"] = json!({"parity": if seed % 2 == 0 { "even" } else { "odd" }});
        server.submit(&envelope).await;
    }
    let worker = server.worker("cpu").await;
    worker.claim_one().await;
    let seeds = |page: &Value| {
        let items = page["items"].as_array().unwrap();
        items.iter().map(|job| job["seed"].as_u64().unwrap()).collect::<Vec<_>>()
    };
    let first = server.get("/v1/jobs?limit=2").await.expect(StatusCode::OK);
    assert_eq!(seeds(&first), [4, 3], "newest first");
    let next = format!("/v1/jobs?limit=3&cursor={}", text(&first["next_cursor"]));
    let last = server.get(&next).await.expect(StatusCode::OK);
    assert_eq!(seeds(&last), [2, 1, 0]);
    assert_eq!(last["next_cursor"], Value::Null);
    let running = server.get("/v1/jobs?state=running").await.expect(StatusCode::OK);
    assert_eq!(seeds(&running), [0]);
    let even = server.get("/v1/jobs?label=parity=even&state=queued").await.expect(StatusCode::OK);
    assert_eq!(seeds(&even), [4, 2]);
    assert_eq!(seeds(&server.get("/v1/jobs?label=parity").await.expect(StatusCode::OK)).len(), 5);
    assert_eq!(seeds(&server.get("/v1/jobs?label=line").await.expect(StatusCode::OK)).len(), 0);
    server.stop().await;
}
