//! Calibrations over HTTP: what clients must not do, posteriors of studies, and jobs whose scenarios are those of the tests.

use reqwest::StatusCode;
use serde_json::{Value, json};

use super::studies::submit;
use super::test_server::*;

const FRICTION: &str = "/contact/fillet_equipment/static_friction";

fn calibration() -> Value {
    let test = |name: &str, experiment: &str, response: &str, unit: &str| {
        json!({"name": name, "scenario": {"experiment": experiment},
               "measured": {"responses": [{"response": response, "unit": unit, "mean": 26.0, "deviation": 1.0, "n": 5}]}})
    };
    json!({"name": "c", "budget": {"max_runs": 60}, "factors": [{"pointer": FRICTION, "low": 0.1, "high": 0.9}],
           "goal": {"calibrate": {"measurements": {"name": "m", "tests": [
               test("plate", "slide", "critical_angle_deg", "deg"), test("block", "compress", "modulus_pa", "kPa")]}}}})
}

#[tokio::test(flavor = "multi_thread")]
async fn jobs_simulate_the_tests_and_clients_run_none() {
    let (server, _dir) = TestServer::start().await;
    let id = submit(&server, &calibration()).await;
    let worker = server.worker("cpu").await;
    let claimed = worker.claim(4).await;
    let experiments: Vec<String> =
        claimed.iter().map(|attempt| text(&attempt["scenario"]["experiment"]).to_owned()).collect();
    assert!(experiments.contains(&"slide".to_owned()) && experiments.contains(&"compress".to_owned()));
    for (path, document) in [
        ("ask", json!({"count": 1})),
        ("ask", json!({"points": [{"values": {FRICTION: 0.5, "test": "plate"}}]})),
        ("tell", json!({"outcomes": []})),
    ] {
        let problem =
            server.post(&format!("/v1/studies/{id}/{path}"), &document).await.problem(409, "wrong-state");
        assert!(text(&problem["detail"]).contains("only the server runs the tests"), "{problem}");
    }
    let study = server.get(&format!("/v1/studies/{id}")).await.expect(StatusCode::OK);
    assert_eq!(study["state"], "running");
    let problem = server.get(&format!("/v1/sweeps/{id}/effects")).await.problem(409, "wrong-state");
    assert!(text(&problem["detail"]).contains("different tests"), "{problem}");
}

#[tokio::test(flavor = "multi_thread")]
async fn posterior_of_a_study_needs_samples() {
    let (server, _dir) = TestServer::start().await;
    let id = submit(&server, &calibration()).await;
    let sweep = |study: &str| {
        json!({"name": "s", "base": {"experiment": "slide"}, "design": {"kind": "grid"}, "factors": [], "replicates": 4,
               "posterior": {"study": study}})
    };
    for (study, detail) in [
        (id.as_str(), "has no samples yet"),
        ("019a0000-0000-7000-8000-000000000000", "there is no such study"),
    ] {
        let problem = server.post("/v1/sweeps", &sweep(study)).await.problem(422, "invalid-document");
        let found = &problem["errors"][0];
        assert_eq!(found["pointer"], "/posterior/study");
        assert!(text(&found["detail"]).contains(detail), "{problem}");
    }
}
