//! Sweeps: expansion, counts, tables, cancel and retry.

use reqwest::StatusCode;
use serde_json::{Value, json};

use super::test_server::*;

/// Two levels, three levels, two replicates.
fn sweep() -> Value {
    json!({"name": "gate by belt", "base": scenario(10), "design": {"kind": "grid"},
           "factors": [{"pointer": "/equipment/gate_opening_m", "levels": [0.045, 0.06]},
                       {"pointer": "/contact/condition", "levels": ["dry", "wet"]}],
           "replicates": 2, "labels": {"line": "north"}})
}

async fn submit(server: &TestServer, sweep: &Value) -> Value {
    let answer = server.post("/v1/sweeps", sweep).await;
    let location = answer.location.clone();
    let view = answer.expect(StatusCode::CREATED);
    assert_eq!(location.unwrap(), format!("/v1/sweeps/{}", text(&view["id"])));
    view
}

#[tokio::test]
async fn sweep_is_expanded_run_and_shown_as_table() {
    let (server, _dir) = TestServer::start().await;
    let view = submit(&server, &sweep()).await;
    let path = format!("/v1/sweeps/{}", text(&view["id"]));
    assert_eq!((&view["points"], &view["replicates"]), (&json!(4), &json!(2)));
    assert_eq!(view["factors"], json!(["/equipment/gate_opening_m", "/contact/condition"]));
    assert_eq!((&view["counts"]["queued"], &view["fraction"]), (&json!(8), &json!(0.0)));

    let worker = server.worker("cpu").await;
    let attempts = worker.claim(64).await;
    let told = |attempt: &Value| {
        let scenario = &attempt["scenario"];
        json!([scenario["equipment"]["gate_opening_m"], scenario["contact"]["condition"], scenario["seed"]])
    };
    let order: Vec<_> = attempts.iter().map(told).collect();
    let expected = [
        json!([0.045, "dry", 10]),
        json!([0.045, "dry", 11]),
        json!([0.045, "wet", 10]),
        json!([0.045, "wet", 11]),
        json!([0.06, "dry", 10]),
        json!([0.06, "dry", 11]),
        json!([0.06, "wet", 10]),
        json!([0.06, "wet", 11]),
    ];
    assert_eq!(order, expected, "the last factor fastest, replicates from the base seed on");
    let belt = |attempt: &Value| attempt["scenario"]["contact"]["fillet_belt"]["static_friction"].clone();
    assert_ne!(belt(&attempts[0]), belt(&attempts[2]), "wet selects other defaults at every level");

    worker.beat(&attempts[0], progress(0.5)).await;
    let running = server.get(&path).await.expect(StatusCode::OK);
    assert_eq!((&running["counts"]["running"], &running["fraction"]), (&json!(8), &json!(0.0625)));
    for attempt in &attempts[..6] {
        worker.deliver(attempt).await.expect(StatusCode::OK);
    }
    worker.fail(&attempts[6], "unstable", None).await.expect(StatusCode::OK);
    let view = server.get(&path).await.expect(StatusCode::OK);
    assert_eq!(
        view["counts"],
        json!({"queued": 0, "running": 1, "succeeded": 6, "failed": 1, "cancelled": 0})
    );
    assert_eq!(view["fraction"], 0.875);

    let results = server.get(&format!("{path}/results")).await.expect(StatusCode::OK);
    let trial = &results["trials"][3];
    assert_eq!((&trial["point"], &trial["replicate"], &trial["seed"]), (&json!(1), &json!(1), &json!(11)));
    assert_eq!(trial["factors"], json!({"/contact/condition": "wet", "/equipment/gate_opening_m": 0.045}));
    assert_eq!(trial["responses"]["discharged_kg"], 41.0);
    assert_eq!(results["trials"][6]["failure_class"], "unstable");
    let csv = server.get(&format!("{path}/results?format=csv")).await;
    assert_eq!(csv.media_type, "text/csv; charset=utf-8");
    let lines: Vec<_> = csv.text.lines().collect();
    assert_eq!(
        lines[0],
        "job_id,point,replicate,seed,/equipment/gate_opening_m,/contact/condition,state,failure_class,\
         backend,solver_revision,discharged_kg,regime,time_to_99_percent_s"
    );
    assert_eq!(lines.len(), 9);
    let revision = roost_solver::SOLVER_REVISION;
    assert!(lines[1].ends_with(&format!(",0,0,10,0.045,dry,succeeded,,cpu,{revision},40.0,constant,")));
    assert!(lines[7].ends_with(",3,0,10,0.06,wet,failed,unstable,,,,,"), "{}", lines[7]);
    server.stop().await;
}

#[tokio::test]
async fn jobs_of_a_sweep_are_listed() {
    let (server, _dir) = TestServer::start().await;
    server.submit(&envelope(1)).await;
    let view = submit(&server, &sweep()).await;
    let path = format!("/v1/sweeps/{}/jobs", text(&view["id"]));
    let page = server.get(&format!("{path}?limit=5")).await.expect(StatusCode::OK);
    assert_eq!(page["items"].as_array().unwrap().len(), 5);
    let cursor = text(&page["next_cursor"]);
    let rest = server.get(&format!("{path}?limit=5&cursor={cursor}")).await.expect(StatusCode::OK);
    assert_eq!(rest["items"].as_array().unwrap().len(), 3);
    let first = &rest["items"][2];
    assert_eq!(
        (&first["point"], &first["replicate"], &first["sweep_id"]),
        (&json!(0), &json!(0), &view["id"])
    );
    assert_eq!(first["factors"]["/contact/condition"], "dry");
    assert_eq!(first["labels"], json!({"line": "north"}), "jobs carry the labels of their sweep");
    let listed = server.get("/v1/sweeps?label=line=north").await.expect(StatusCode::OK);
    assert_eq!(listed["items"][0]["id"], view["id"]);
    let none = server.get("/v1/sweeps?label=line=south").await.expect(StatusCode::OK);
    assert_eq!(none["items"], json!([]));
    server.stop().await;
}

#[tokio::test]
async fn sweep_is_cancelled_and_retried_by_class() {
    let (server, _dir) = TestServer::start().await;
    let view = submit(&server, &sweep()).await;
    let path = format!("/v1/sweeps/{}", text(&view["id"]));
    let worker = server.worker("cpu").await;
    let attempts = worker.claim(3).await;
    worker.deliver(&attempts[0]).await.expect(StatusCode::OK);
    worker.fail(&attempts[1], "invalid", None).await.expect(StatusCode::OK);
    let cancelled = server.post(&format!("{path}/cancel"), &json!({})).await.expect(StatusCode::OK);
    assert_eq!(
        cancelled["counts"],
        json!({"queued": 0, "running": 1, "succeeded": 1, "failed": 1, "cancelled": 5})
    );
    assert_eq!(worker.beat(&attempts[2], Value::Null).await["directive"], "cancel");
    worker.fail(&attempts[2], "cancelled", None).await.expect(StatusCode::OK);

    let lost = server.post(&format!("{path}/retry?class=lost"), &json!({})).await.expect(StatusCode::OK);
    assert_eq!(lost["counts"]["queued"], 0);
    let invalid =
        server.post(&format!("{path}/retry?class=invalid"), &json!({})).await.expect(StatusCode::OK);
    assert_eq!((&invalid["counts"]["queued"], &invalid["counts"]["failed"]), (&json!(1), &json!(0)));
    let all = server.post(&format!("{path}/retry"), &json!({})).await.expect(StatusCode::OK);
    assert_eq!((&all["counts"]["queued"], &all["counts"]["succeeded"]), (&json!(7), &json!(1)));
    server.stop().await;
}

#[tokio::test]
async fn sweep_uses_stored_results() {
    let (server, _dir) = TestServer::start().await;
    let worker = server.worker("cpu").await;
    let mut known = envelope(10);
    known["scenario"]["equipment"] = json!({"gate_opening_m": 0.045});
    server.submit(&known).await;
    worker.deliver(&worker.claim_one().await).await.expect(StatusCode::OK);
    let view = submit(&server, &sweep()).await;
    assert_eq!((&view["counts"]["succeeded"], &view["counts"]["queued"]), (&json!(1), &json!(7)));
    server.stop().await;
}
