//! What computed a result must be what its worker registered, and its responses those of its experiment.

use reqwest::StatusCode;
use roost_api::RunResult;
use roost_api::ids::WorkerId;
use serde_json::{Value, json};

use super::farm::*;

fn pointers(problem: &Value) -> Vec<&str> {
    problem["errors"].as_array().unwrap().iter().map(|fault| text(&fault["pointer"])).collect()
}

#[tokio::test]
async fn a_result_of_another_solver_than_the_workers_is_refused_and_changes_nothing() {
    let (farm, _dir) = Farm::start().await;
    let worker = farm.worker("cpu").await;
    let job = farm.submit(&envelope(1)).await;
    let attempt = worker.claim_one().await;
    let before = farm.job(&job["id"]).await;
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
        assert_eq!(farm.job(&job["id"]).await, before);
    }
    worker.deliver(&attempt).await.expect(StatusCode::OK);
    assert_eq!(farm.job(&job["id"]).await["state"], "succeeded");
    farm.stop().await;
}

#[tokio::test]
async fn a_response_that_the_experiment_has_not_is_refused() {
    let (farm, _dir) = Farm::start().await;
    let worker = farm.worker("cpu").await;
    let job = farm.submit(&envelope(1)).await;
    let attempt = worker.claim_one().await;
    let mut result = result_of(&attempt["scenario"]);
    // One of another experiment, and one that is nobody's.
    result.responses.insert("critical_angle_deg".to_owned(), json!(1.0));
    result.responses.insert("a/b".to_owned(), json!(2.0));
    let problem = worker.deliver_result(&attempt, &result).await.problem(422, "invalid-document");
    assert_eq!(pointers(&problem), ["/result/responses/a~1b", "/result/responses/critical_angle_deg"]);
    assert!(text(&problem["errors"][0]["allowed"]).contains("discharged_kg"), "{problem}");
    result.end_reason = roost_solver::result::EndReason::Unstable;
    let problem = worker.fail(&attempt, "unstable", Some(&result)).await.problem(422, "invalid-document");
    assert_eq!(pointers(&problem).len(), 2);
    assert_eq!(farm.job(&job["id"]).await["state"], "running");

    let long = "x".repeat(100_000);
    for index in 0..200 {
        result.responses.insert(format!("{index}{long}"), json!(1.0));
    }
    result.end_reason = roost_solver::result::EndReason::Duration;
    let refused = worker.deliver_result(&attempt, &result).await;
    assert!(refused.text.len() < 100_000, "{} bytes", refused.text.len());
    refused.problem(422, "invalid-document");
    worker.deliver(&attempt).await.expect(StatusCode::OK);
    farm.stop().await;
}

#[tokio::test]
async fn a_worker_registers_its_solver_once() {
    let (farm, _dir) = Farm::start().await;
    let worker = farm.worker("cpu").await;
    let repeat = |name: &str, value: Value| {
        let mut repeat = registration(&worker.id, "cpu");
        repeat[name] = value;
        repeat
    };
    for (name, value) in [("backend", json!("gpu")), ("device", json!("another"))] {
        let problem = farm.post("/v1/workers", &repeat(name, value)).await.problem(409, "worker-refused");
        assert!(text(&problem["detail"]).contains("fresh id"), "{problem}");
    }
    farm.post("/v1/workers", &repeat("threads", json!(7))).await.expect(StatusCode::OK);
    let workers = farm.get("/v1/workers").await.expect(StatusCode::OK);
    let shown = &workers["items"][0];
    assert_eq!(
        (&shown["backend"], &shown["device"], &shown["threads"]),
        (&json!("cpu"), &json!("a test"), &json!(7))
    );
    farm.stop().await;
}

/// A worker's process ends with a result in its outbox; the next one registers afresh and delivers it as that of the first.
#[tokio::test]
async fn a_result_from_an_outbox_is_held_to_the_registration_that_ran_it() {
    let (farm, dir) = Farm::start().await;
    let before = farm.worker("cpu").await;
    let job = farm.submit(&envelope(1)).await;
    let attempt = before.claim_one().await;
    let (before, address) = (before.id.clone(), dir.path().join("roost.db"));
    farm.stop().await;

    // The upgrade: the registration that ran it is one of an older revision, which named a response in another way.
    use sqlx::Connection;
    let mut database = sqlx::SqliteConnection::connect(address.to_str().unwrap()).await.unwrap();
    sqlx::query("UPDATE workers SET solver_revision = solver_revision - 1")
        .execute(&mut database)
        .await
        .unwrap();
    database.close().await.unwrap();
    let farm = Farm::on(dir.path(), |_| {}).await;
    let mut after = registration(&WorkerId::new().to_string(), "gpu");
    after["device"] = json!("another");
    farm.register(&after).await;

    let old = Worker { farm: &farm, id: before };
    let mut result = result_of(&attempt["scenario"]);
    old.deliver_result(&attempt, &result).await.problem(422, "wrong-result");
    result.solver.revision -= 1;
    result.responses.insert("renamed_since".to_owned(), json!(3.0));
    old.deliver_result(&attempt, &result).await.expect(StatusCode::OK);
    let recorded = farm.job(&job["id"]).await;
    assert_eq!(
        (&recorded["state"], &recorded["responses"]["renamed_since"]),
        (&json!("succeeded"), &json!(3.0))
    );
    // What was computed by another revision answers nobody.
    assert_eq!(farm.submit(&envelope(1)).await["state"], "queued");
    farm.stop().await;
}
