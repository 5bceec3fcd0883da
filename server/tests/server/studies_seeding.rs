//! Studies that begin with the runs of earlier sweeps.

use reqwest::{Method, StatusCode};
use serde_json::{Value, json};

use super::studies::*;
use super::test_server::*;

/// Gate openings of the sweep, in metres; the last one is outside the range of the question.
const GATES: [f64; 8] = [0.035, 0.04, 0.045, 0.05, 0.055, 0.06, 0.07, 0.095];
const REPLICATES: usize = 6;

/// A sweep over gates whose runs have all ended.
async fn swept(server: &TestServer, base: &Value) -> String {
    let sweep = json!({"name": "gates", "base": base, "design": {"kind": "grid"}, "replicates": REPLICATES,
                       "shared_fill": false, "factors": [{"pointer": GATE, "levels": GATES}]});
    let sweep = server.post("/v1/sweeps", &sweep).await.expect(StatusCode::CREATED);
    let worker = server.worker("cpu").await;
    loop {
        let attempts = worker.claim(16).await;
        if attempts.is_empty() {
            return text(&sweep["id"]).to_owned();
        }
        for attempt in attempts {
            deliver(&worker, &attempt).await;
        }
    }
}

fn says(study: &Value, part: &str) -> bool {
    study["answer"].as_array().unwrap().iter().any(|sentence| text(sentence).contains(part))
}

#[tokio::test]
async fn a_study_begins_with_the_runs_of_a_sweep() {
    let (server, _dir) = TestServer::start().await;
    let sweep = swept(&server, &scenario(1)).await;
    let mut question = question(30);
    question["seeded_by"] = json!([sweep]);
    let id = submit(&server, &question).await;
    let study = show(&server, &id).await;
    let used = (GATES.len() - 1) * REPLICATES;
    assert!(says(&study, &format!("It uses {used} runs of the sweep `gates` ({sweep})")), "{study}");
    assert!(says(&study, "Left out of this sweep: 6 runs outside the ranges."), "{study}");
    // Replicates of a sweep have the same seeds at all points.
    assert!(says(&study, "have seeds in common"), "{study}");
    assert_eq!(study["runs"]["outside_budget"], used + REPLICATES, "all were copied");

    // The copies survive their sweep, and a restart.
    server.send(Method::DELETE, &format!("/v1/sweeps/{sweep}"), None).await.expect(StatusCode::OK);
    let study = work(&server, &id, usize::MAX).await;
    assert_eq!(study["state"], "finished", "{study}");
    assert!(study["runs"]["done"].as_u64().unwrap() <= 30);
    let answer = server.get(&format!("/v1/studies/{id}/answer")).await.expect(StatusCode::OK);
    // Runs that end during the last decision are kept, but are not in the answer.
    let done = |runs: &Value| runs["done"].as_u64().unwrap() as usize;
    let possible = used + 1..=used + done(&study["runs"]);
    assert!(possible.contains(&done(&answer["answer"]["runs"])), "{answer}");
    assert_eq!(answer["seeded_by"][0]["copied"], used + REPLICATES);
    check_runs(&server, &id).await;
    // Its copies go with it.
    wait_until_idle(&server, &id).await;
    server.send(Method::DELETE, &format!("/v1/sweeps/{id}"), None).await.expect(StatusCode::OK);
    server.get(&format!("/v1/studies/{id}")).await.problem(404, "not-found");
    server.stop().await;
}

#[tokio::test]
async fn sweeps_that_cannot_be_used_are_refused_with_the_reason() {
    let (server, _dir) = TestServer::start().await;
    let mut other = scenario(1);
    other["product"]["count"] = json!(7);
    let (same, other) = (swept(&server, &scenario(1)).await, swept(&server, &other).await);
    let refused = async |question: &Value| {
        let problem = server.post("/v1/studies", question).await.problem(422, "invalid-document");
        let errors = problem["errors"].as_array().unwrap();
        let fault = |error: &Value| (text(&error["pointer"]).to_owned(), text(&error["detail"]).to_owned());
        errors.iter().map(fault).collect::<Vec<_>>()
    };
    let mut asked = question(30);
    let unknown = "00000000-0000-7000-8000-000000000001";
    asked["seeded_by"] = json!([same, unknown]);
    assert_eq!(refused(&asked).await, [("/seeded_by/1".to_owned(), "there is no such sweep".to_owned())]);
    asked["seeded_by"] = json!([same, other]);
    let found = refused(&asked).await;
    assert_eq!((found.len(), found[0].0.as_str()), (1, "/seeded_by/1"));
    assert!(
        found[0].1.contains("48 runs of other scenarios (the first differs in `/product/count`)"),
        "{found:?}"
    );
    asked["seeded_by"] = json!([same, same, "gates"]);
    let pointers: Vec<String> = refused(&asked).await.into_iter().map(|(pointer, _)| pointer).collect();
    assert_eq!(pointers, ["/seeded_by/2", "/seeded_by/1"]);
    asked["seeded_by"] = json!([same]);
    asked["goal"] = json!({"sensitivity": {"of": [{"mean": "jammed"}], "width": 0.2}});
    asked["budget"]["max_runs"] = json!(2000);
    let found = refused(&asked).await;
    assert_eq!((found.len(), found[0].0.as_str()), (1, "/seeded_by"), "{found:?}");
    server.stop().await;
}
