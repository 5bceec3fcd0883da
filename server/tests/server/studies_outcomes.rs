//! Studies of clients: outcomes of runs that were handed out more than once, and ranges without a point that can be run.

use std::time::{Duration, Instant};

use reqwest::StatusCode;
use serde_json::{Value, json};

use super::studies::*;
use super::studies_asks::*;
use super::test_server::*;

fn jammed(run: &Value, jammed: u8) -> Value {
    json!({"run": run["run"], "responses": {"jammed": jammed}})
}

fn pointers(answer: TestResponse) -> Vec<String> {
    let problem = answer.problem(409, "wrong-state");
    problem["errors"].as_array().unwrap().iter().map(|error| text(&error["pointer"]).to_owned()).collect()
}

/// A run that expires, and the same run as it is handed out again.
async fn handed_out_twice(server: &TestServer, id: &str) -> (Value, Value) {
    let first = ask(server, id, json!({"count": 1, "expires_s": 1})).await.expect(StatusCode::OK);
    let first = first["runs"][0].clone();
    let deadline = Instant::now() + Duration::from_secs(20);
    while show(server, id).await["runs"]["pending"] != 0 {
        assert!(Instant::now() < deadline, "the run has expired");
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
    let second = hand_out(server, id, 1).await[0].clone();
    assert_eq!((place(&first), &first["seed"]), (place(&second), &second["seed"]));
    assert_ne!(first["run"], second["run"]);
    (first, second)
}

#[tokio::test]
async fn a_run_that_was_handed_out_twice_has_one_outcome() {
    let (server, _dir) = TestServer::start().await;
    let id = driven(&server, 60).await;
    let (first, second) = handed_out_twice(&server, &id).await;
    // Neither in one request nor in two.
    let both = [jammed(&first, 1), jammed(&second, 0)];
    assert_eq!(pointers(tell(&server, &id, &both).await), ["/outcomes/1"]);
    tell(&server, &id, &[jammed(&second, 1)]).await.expect(StatusCode::OK);
    assert_eq!(pointers(tell(&server, &id, &[jammed(&first, 0)]).await), ["/outcomes/0"]);
    let failed = json!({"run": first["run"], "failed": true});
    assert_eq!(pointers(tell(&server, &id, &[failed]).await), ["/outcomes/0"]);
    let own = |jammed: u8| json!({"values": first["values"], "seed": first["seed"], "responses": {"jammed": jammed}});
    assert_eq!(pointers(tell(&server, &id, &[own(0)]).await), ["/outcomes/0"]);
    assert_eq!(tell(&server, &id, &[own(1)]).await.expect(StatusCode::OK)["repeated"], 1);
    // The same outcome is that of the same run.
    tell(&server, &id, &[jammed(&first, 1)]).await.expect(StatusCode::OK);
    wait_for_runs(&server, &id, 1).await;

    // The late outcome may come first. The other client then gives the run back.
    let (first, second) = handed_out_twice(&server, &id).await;
    tell(&server, &id, &[jammed(&first, 0)]).await.expect(StatusCode::OK);
    assert_eq!(pointers(tell(&server, &id, &[jammed(&second, 1)]).await), ["/outcomes/0"]);
    let back = json!({"run": second["run"], "given_back": true});
    tell(&server, &id, &[back]).await.expect(StatusCode::OK);
    let answer = wait_for_runs(&server, &id, 2).await;
    let runs = &answer["study"]["runs"];
    assert_eq!((&runs["done"], &runs["pending"], &runs["outside_budget"]), (&json!(2), &json!(0), &json!(0)));
    server.stop().await;
}

#[tokio::test]
async fn a_study_of_a_client_without_a_possible_point_pauses_with_the_reason() {
    let (server, _dir) = TestServer::start().await;
    // Of 1024 combinations all are impossible but those of the first gate, those of the first height, and the last one.
    let levels = |first: f64, between: f64, step: f64, last: f64| -> Vec<f64> {
        let between = (1..31).map(|index| between + step * f64::from(index));
        [first].into_iter().chain(between).chain([last]).collect()
    };
    let (gates, heights) = (levels(0.05, 0.5, 0.003, 0.45), levels(0.6, 0.2, 0.006, 0.46));
    let mut question = question(60);
    question["driver"] = json!("client");
    question["goal"] = json!({"optimise": {"objectives": [{"maximise": {"mean": "mean_rate_kg_s"}}]}});
    question["factors"] = json!([{"pointer": GATE, "levels": gates}, {"pointer": "/equipment/hopper_height_m", "levels": heights}]);
    // With one seed in four, twenty decisions in a row find no other point.
    let mut found = None;
    for seed in 0..40 {
        question["base"]["seed"] = json!(seed);
        let id = submit(&server, &question).await;
        let asked = ask(&server, &id, json!({"count": 1})).await;
        if asked.status != StatusCode::OK {
            found = Some((id, asked));
            break;
        }
    }
    let (id, refused) = found.expect("a study without a point");
    let problem = refused.problem(409, "wrong-state");
    let reason = "/equipment/gate_opening_m";
    assert!(text(&problem["detail"]).contains(reason), "{problem}");
    let study = show(&server, &id).await;
    assert_eq!(study["state"], "paused");
    let last = text(study["answer"].as_array().unwrap().last().unwrap());
    assert!(last.starts_with(&format!("The server has paused the study: {reason}")), "{last}");
    // A resumed study looks again, and the client can still choose points of its own.
    server.post(&format!("/v1/studies/{id}/resume"), &json!({})).await.expect(StatusCode::OK);
    let points = json!([{"values": {GATE: 0.05, "/equipment/hopper_height_m": 0.6}}]);
    ask(&server, &id, json!({"points": points})).await.expect(StatusCode::OK);
    server.stop().await;
}
