//! A result must come from the registered solver of its worker and have responses of its experiment.

use reqwest::StatusCode;
use roost_api::RunResult;
use roost_api::ids::WorkerId;
use serde_json::{Value, json};

use super::database;
use super::test_server::*;

fn pointers(problem: &Value) -> Vec<&str> {
    problem["errors"].as_array().unwrap().iter().map(|fault| text(&fault["pointer"])).collect()
}

#[tokio::test]
async fn result_of_another_solver_is_refused_and_changes_nothing() {
    let (server, _dir) = TestServer::start().await;
    let worker = server.worker("cpu").await;
    let job = server.submit(&envelope(1)).await;
    let attempt = worker.claim_one().await;
    let before = server.job(&job["id"]).await;
    let changed = |change: fn(&mut RunResult)| {
        let mut result = result_of(&attempt["scenario"]);
        change(&mut result);
        result
    };
    let revision = changed(|result| result.solver.revision += 1);
    let backend = changed(|result| result.solver.backend = "gpu".to_owned());
    let device = changed(|result| result.solver.device = "another".to_owned());
    let all = changed(|result| {
        result.solver.revision = 0;
        (result.solver.backend, result.solver.device) = ("x".repeat(5000), "another".to_owned());
    });
    let of = |name: &str| format!("/result/solver/{name}");
    for (result, expected) in [
        (revision, vec![of("revision")]),
        (backend, vec![of("backend")]),
        (device, vec![of("device")]),
        (all, vec![of("revision"), of("backend"), of("device")]),
    ] {
        let delivered = worker.deliver_result(&attempt, &result).await;
        assert!(delivered.text.len() < 3000, "{} bytes", delivered.text.len());
        let problem = delivered.problem(422, "wrong-result");
        assert_eq!(pointers(&problem), expected);
        let mut partial = result;
        partial.end_reason = roost_solver::result::EndReason::Unstable;
        let problem = worker.fail(&attempt, "unstable", Some(&partial)).await.problem(422, "wrong-result");
        assert_eq!(pointers(&problem), expected);
        if expected.contains(&of("device")) {
            assert_eq!(problem["errors"][expected.len() - 1]["value"], json!("another"));
            assert_eq!(problem["errors"][expected.len() - 1]["allowed"], json!("a test"));
        }
        assert_eq!(server.job(&job["id"]).await, before);
    }
    worker.deliver(&attempt).await.expect(StatusCode::OK);
    assert_eq!(server.job(&job["id"]).await["state"], "succeeded");
    server.stop().await;
}

#[tokio::test]
async fn response_of_another_experiment_is_refused() {
    let (server, _dir) = TestServer::start().await;
    let worker = server.worker("cpu").await;
    let job = server.submit(&envelope(1)).await;
    let attempt = worker.claim_one().await;
    let mut result = result_of(&attempt["scenario"]);
    // A response of another experiment, and one of none.
    result.responses.insert("critical_angle_deg".to_owned(), json!(1.0));
    result.responses.insert("a/b".to_owned(), json!(2.0));
    let problem = worker.deliver_result(&attempt, &result).await.problem(422, "invalid-document");
    assert_eq!(pointers(&problem), ["/result/responses/a~1b", "/result/responses/critical_angle_deg"]);
    assert!(text(&problem["errors"][0]["allowed"]).contains("discharged_kg"), "{problem}");
    result.end_reason = roost_solver::result::EndReason::Unstable;
    let problem = worker.fail(&attempt, "unstable", Some(&result)).await.problem(422, "invalid-document");
    assert_eq!(pointers(&problem).len(), 2);
    assert_eq!(server.job(&job["id"]).await["state"], "running");

    let long = "x".repeat(100_000);
    for index in 0..200 {
        result.responses.insert(format!("{index}{long}"), json!(1.0));
    }
    result.end_reason = roost_solver::result::EndReason::Duration;
    let refused = worker.deliver_result(&attempt, &result).await;
    assert!(refused.text.len() < 100_000, "{} bytes", refused.text.len());
    refused.problem(422, "invalid-document");
    worker.deliver(&attempt).await.expect(StatusCode::OK);
    server.stop().await;
}

#[tokio::test]
async fn worker_cannot_register_another_solver() {
    let (server, _dir) = TestServer::start().await;
    let worker = server.worker("cpu").await;
    let repeat = |name: &str, value: Value| {
        let mut repeat = registration(&worker.id, "cpu");
        repeat[name] = value;
        repeat
    };
    for (name, value) in [("backend", json!("gpu")), ("device", json!("another"))] {
        let problem = server.post("/v1/workers", &repeat(name, value)).await.problem(409, "worker-refused");
        assert!(text(&problem["detail"]).contains("fresh id"), "{problem}");
    }
    server.post("/v1/workers", &repeat("threads", json!(7))).await.expect(StatusCode::OK);
    let workers = server.get("/v1/workers").await.expect(StatusCode::OK);
    let shown = &workers["items"][0];
    assert_eq!(
        (&shown["backend"], &shown["device"], &shown["threads"]),
        (&json!("cpu"), &json!("a test"), &json!(7))
    );
    server.stop().await;
}

/// A worker process exits with a result in its outbox. The next process registers anew and delivers it under
/// the first id.
#[tokio::test]
async fn result_from_an_outbox_must_match_the_registration_that_ran_it() {
    let (server, dir) = TestServer::start().await;
    let before = server.worker("cpu").await;
    let job = server.submit(&envelope(1)).await;
    let attempt = before.claim_one().await;
    let before = before.id.clone();
    server.stop().await;

    // The upgrade: the registration of the attempt has an older revision with another response name.
    database::execute(dir.path(), "UPDATE workers SET solver_revision = solver_revision - 1").await;
    let server = TestServer::on(dir.path(), |_| {}).await;
    let mut after = registration(&WorkerId::new().to_string(), "gpu");
    after["device"] = json!("another");
    server.register(&after).await;

    let old = Worker { server: &server, id: before };
    let mut result = result_of(&attempt["scenario"]);
    old.deliver_result(&attempt, &result).await.problem(422, "wrong-result");
    result.solver.revision -= 1;
    result.responses.insert("renamed_since".to_owned(), json!(3.0));
    old.deliver_result(&attempt, &result).await.expect(StatusCode::OK);
    let recorded = server.job(&job["id"]).await;
    assert_eq!(
        (&recorded["state"], &recorded["responses"]["renamed_since"]),
        (&json!("succeeded"), &json!(3.0))
    );
    // Results of another revision are not reused.
    assert_eq!(server.submit(&envelope(1)).await["state"], "queued");
    server.stop().await;
}
