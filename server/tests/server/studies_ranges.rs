//! Wider ranges of studies: every run is kept, and a finished study goes on.

use reqwest::StatusCode;
use serde_json::{Value, json};

use super::studies::*;
use super::test_server::*;

const SPEED: &str = "/equipment/belt_speed_m_s";

async fn widen(server: &TestServer, id: &str, ranges: &Value) -> TestResponse {
    server.post(&format!("/v1/studies/{id}/ranges"), &json!({"ranges": ranges})).await
}

fn says(study: &Value, part: &str) -> bool {
    study["answer"].as_array().unwrap().iter().any(|sentence| text(sentence).contains(part))
}

#[tokio::test]
async fn finished_study_continues_in_a_wider_range() {
    let (server, _dir) = TestServer::start().await;
    let mut question = question(400);
    // Nearly every run jams here: the boundary is outside.
    question["factors"][0]["high"] = json!(0.045);
    let id = submit(&server, &question).await;
    let before = work(&server, &id, usize::MAX).await;
    assert_eq!((&before["state"], &before["finished"]), (&json!("finished"), &json!("by_rule")), "{before}");
    let runs = trials(&server, &id).await;

    let wider = widen(&server, &id, &json!([{"pointer": GATE, "high": 0.09}])).await.expect(StatusCode::OK);
    assert_eq!((&wider["state"], &wider["finished"]), (&json!("running"), &Value::Null), "{wider}");
    assert!(text(&wider["question"]).contains("gate opening from 0.03 to 0.09 m"), "{wider}");
    let study = work(&server, &id, usize::MAX).await;
    assert_eq!(study["finished"], "by_rule", "{study}");
    let after = trials(&server, &id).await;
    assert!(after.len() > runs.len());
    for run in runs.iter().filter(|run| run["state"] == "succeeded") {
        assert!(after.contains(run), "{run}");
    }
    check_runs(&server, &id).await;
    let answer = server.get(&format!("/v1/studies/{id}/answer")).await.expect(StatusCode::OK);
    assert_eq!(answer["factors"][0]["high"], 0.09);
    // Runs that end during the last decision are kept, but are not in the answer.
    let done = |runs: &Value| runs["done"].as_u64().unwrap();
    let late = done(&study["runs"]) - done(&answer["answer"]["runs"]);
    assert!(late < done(&before["runs"]), "old runs are evidence: {answer}");
    let crossings = answer["answer"]["finding"]["boundary"]["crossings"].as_array().unwrap();
    let holds = |crossing: &Value| {
        let (low, high) = (crossing["low"].as_f64().unwrap(), crossing["high"].as_f64().unwrap());
        low < TRUE_GATE_M && TRUE_GATE_M < high && high - low < 0.04
    };
    assert!(crossings.iter().any(holds), "{crossings:?}");
    assert!(says(&study, "gate opening was 0.03 to 0.045 m and is 0.03 to 0.09 m now"), "{study}");
    server.stop().await;
}

#[tokio::test]
async fn a_range_cannot_shrink_and_all_faults_are_listed() {
    let (server, _dir) = TestServer::start().await;
    let mut question = question(40);
    question["factors"].as_array_mut().unwrap().push(json!({"pointer": SPEED, "low": 0.1, "high": 0.4}));
    let id = submit(&server, &question).await;
    let refused = async |ranges: Value| {
        let problem = widen(&server, &id, &ranges).await.problem(422, "invalid-document");
        let errors = problem["errors"].as_array().unwrap();
        let mut pointers: Vec<_> = errors.iter().map(|error| text(&error["pointer"]).to_owned()).collect();
        // An end can have several faults.
        pointers.dedup();
        pointers
    };
    let found = refused(json!([
        {"pointer": SPEED, "low": 0.2, "high": 0.3},
        {"pointer": "/equipment/hopper_width_m", "high": 1},
        {"pointer": GATE, "high": 50.0},
    ]));
    assert_eq!(found.await, ["/ranges/0/low", "/ranges/0/high", "/ranges/1/pointer", "/ranges/2/high"]);
    let twice = refused(json!([{"pointer": GATE, "low": 0.02}, {"pointer": GATE, "low": 0.02}]));
    assert_eq!(twice.await, ["/ranges/1/pointer"]);
    assert_eq!(refused(json!([{"pointer": GATE, "low": "small"}])).await, ["/ranges/0/low"]);
    let problem =
        widen(&server, &id, &json!([{"pointer": GATE, "low": 0.04}])).await.problem(422, "invalid-document");
    assert_eq!(problem["errors"][0]["allowed"], "at most 0.03");
    // The present ranges are no change.
    let same = widen(&server, &id, &json!([{"pointer": GATE, "low": 0.03, "high": 0.09}])).await;
    assert_eq!(same.expect(StatusCode::OK)["question"], show(&server, &id).await["question"]);
    server.post(&format!("/v1/studies/{id}/cancel"), &json!({})).await.expect(StatusCode::OK);
    widen(&server, &id, &json!([{"pointer": GATE, "low": 0.02}])).await.problem(409, "wrong-state");
    server.stop().await;
}
