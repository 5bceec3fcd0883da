//! Invalid input is answered with a problem document that lists all faults, and stores nothing.

use std::time::{Duration, Instant};

use reqwest::{Method, StatusCode};
use serde_json::{Value, json};

use super::test_server::*;

const NO_JOB: &str = "01890000-0000-7000-8000-000000000000";

/// The pointers of the faults, in order.
fn pointers(problem: &Value) -> Vec<&str> {
    let mut all: Vec<_> =
        problem["errors"].as_array().unwrap().iter().map(|fault| text(&fault["pointer"])).collect();
    all.sort_unstable();
    all
}

async fn assert_nothing_stored(server: &TestServer) {
    for path in ["/v1/jobs", "/v1/sweeps"] {
        assert_eq!(server.get(path).await.expect(StatusCode::OK)["items"], json!([]), "{path}");
    }
}

#[tokio::test]
async fn unknown_paths_methods_and_identifiers_are_refused() {
    let (server, _dir) = TestServer::start().await;
    server.get("/v1/chickens").await.problem(404, "not-found");
    server.get("/nothing").await.problem(404, "not-found");
    let wrong = server.send(Method::DELETE, "/v1/jobs", None).await;
    let allow = wrong.allow.clone().unwrap();
    assert!(allow.contains("GET") && allow.contains("POST"), "{allow}");
    wrong.problem(405, "method-not-allowed");
    for path in ["/v1/jobs/7", "/v1/jobs/7/result", "/v1/sweeps/x", "/v1/sweeps/x/results", "/v1/jobs/%ff"] {
        server.get(path).await.problem(400, "invalid-path");
    }
    let attempt = format!("/v1/jobs/{NO_JOB}/attempts/first/result");
    server.post(&attempt, &json!({})).await.problem(400, "invalid-path");
    for path in
        [format!("/v1/jobs/{NO_JOB}"), format!("/v1/jobs/{NO_JOB}/result"), format!("/v1/sweeps/{NO_JOB}")]
    {
        server.get(&path).await.problem(404, "not-found");
    }
    for path in ["jobs", "sweeps"] {
        for verb in ["cancel", "retry"] {
            server.post(&format!("/v1/{path}/{NO_JOB}/{verb}"), &json!({})).await.problem(404, "not-found");
        }
    }
    for path in ["jobs", "results"] {
        server.get(&format!("/v1/sweeps/{NO_JOB}/{path}")).await.problem(404, "not-found");
    }
    server.stop().await;
}

#[tokio::test]
async fn invalid_queries_are_refused() {
    let (server, _dir) = TestServer::start().await;
    for query in [
        "state=ready",
        "limit=0",
        "limit=501",
        "limit=ten",
        "cursor=x",
        "cursor=-1",
        "colour=red",
        "label==x",
    ] {
        let problem = server.get(&format!("/v1/jobs?{query}")).await.problem(400, "invalid-query");
        assert!(!text(&problem["detail"]).is_empty(), "{query}");
    }
    server.get("/v1/sweeps?cursor=-1").await.problem(400, "invalid-query");
    server.get("/v1/workers?cursor=1").await.problem(400, "invalid-query");
    server.get(&format!("/v1/sweeps/{NO_JOB}/results?format=ods")).await.problem(400, "invalid-query");
    server
        .post(&format!("/v1/jobs/{NO_JOB}/retry?class=bad"), &json!({}))
        .await
        .problem(400, "invalid-query");
    server.stop().await;
}

#[tokio::test]
async fn invalid_json_is_one_syntax_error_with_its_line() {
    let (server, _dir) = TestServer::start().await;
    let json = "application/json";
    let problem = server.send_text("/v1/jobs", json, "{\"scenario\":\n  {\"seed\": NaN}}").await;
    let detail = problem.problem(400, "syntax")["detail"].clone();
    assert!(text(&detail).starts_with("line 2, column "), "{detail}");
    let deep = "[".repeat(100_000);
    for body in ["", "{", "{\"a\": 1} x", "{\"seed\": 1e999}", "{\"seed\": 1, \"seed\": 2}", deep.as_str()] {
        server.send_text("/v1/sweeps", json, body.to_owned()).await.problem(400, "syntax");
    }
    server.send_text("/v1/jobs", json, vec![0x7b, 0x22, 0xff, 0xfe]).await.problem(400, "syntax");
    server.send_text("/v1/jobs", "text/plain", "{}").await.problem(415, "not-json");
    server.send_text("/v1/jobs", "application/x-www-form-urlencoded", "{}").await.problem(415, "not-json");
    assert_nothing_stored(&server).await;
    server.stop().await;
}

#[tokio::test]
async fn body_above_the_limit_is_refused_with_the_limit() {
    let (server, _dir) = TestServer::with(|config| config.max_body_bytes = 2000).await;
    let mut large = envelope(1);
    large["labels"] = json!({"note": "x".repeat(2000)});
    let problem = server.post("/v1/jobs", &large).await.problem(413, "too-large");
    assert!(text(&problem["detail"]).contains("2000 bytes"), "{problem}");
    assert_nothing_stored(&server).await;

    // Deliveries have a limit of their own: users cannot make a result smaller.
    server.submit(&envelope(1)).await;
    let worker = server.worker("cpu").await;
    let attempt = worker.claim_one().await;
    let mut result = result_of(&attempt["scenario"]);
    result.series[0].t_s = vec![0.5; 2000];
    result.series[0].values = vec![0.5; 2000];
    worker.deliver_result(&attempt, &result).await.expect(StatusCode::OK);
    server.stop().await;
}

#[tokio::test]
async fn all_faults_of_scenario_and_envelope_are_listed() {
    let (server, _dir) = TestServer::start().await;
    let bad = json!({"scenario": {"experiment": "hopper", "equipment": {"gate_openning_m": 0.06, "belt_speed_m_s": "fast"},
                                  "product": {"count": -3}},
                     "priority": "high", "lables": {}});
    let problem = server.post("/v1/jobs", &bad).await.problem(422, "invalid-document");
    assert_eq!(
        pointers(&problem),
        [
            "/lables",
            "/priority",
            "/scenario/equipment/belt_speed_m_s",
            "/scenario/equipment/gate_openning_m",
            "/scenario/product/count"
        ]
    );
    let errors = problem["errors"].as_array().unwrap();
    let of = |pointer: &str| errors.iter().find(|fault| fault["pointer"] == pointer).unwrap();
    assert!(text(&of("/scenario/equipment/gate_openning_m")["detail"]).contains("gate_opening_m"));
    assert!(text(&of("/lables")["detail"]).contains("did you mean labels"));
    assert_eq!(of("/scenario/product/count")["value"], -3);
    for body in [json!([]), json!("hopper"), json!(null), json!({}), json!({"scenario": 7})] {
        server.post("/v1/jobs", &body).await.problem(422, "invalid-document");
    }
    let wall = json!({"scenario": scenario(1), "max_wall_s": 0.0});
    assert_eq!(
        pointers(&server.post("/v1/jobs", &wall).await.problem(422, "invalid-document")),
        ["/max_wall_s"]
    );
    assert_nothing_stored(&server).await;
    server.stop().await;
}

#[tokio::test]
async fn lists_in_place_of_objects_of_workers_are_refused() {
    let (server, _dir) = TestServer::start().await;
    server.submit(&envelope(1)).await;
    let worker = server.worker("cpu").await;
    let attempt = worker.claim_one().await;
    let list = json!(["fill", 1.0, 2.0, 0.5, 9, 10, 0.1, 3.0]);
    let beat = json!({"job_id": attempt["job_id"], "attempt": attempt["attempt"], "progress": list});
    let path = format!("/v1/workers/{}/heartbeat", worker.id);
    let problem = server.post(&path, &json!({"attempts": [beat]})).await.problem(422, "invalid-document");
    assert_eq!(pointers(&problem), ["/attempts/0/progress"]);

    let mut delivery = json!({"worker_id": worker.id, "result": result_of(&attempt["scenario"])});
    delivery["result"]["series"][0] = json!(["discharged_mass", "kg", [0.0], [1.0]]);
    let path = format!("/v1/jobs/{}/attempts/{}/result", text(&attempt["job_id"]), attempt["attempt"]);
    let problem = server.post(&path, &delivery).await.problem(422, "invalid-document");
    assert_eq!(pointers(&problem), ["/result/series/0"]);
    worker.deliver(&attempt).await.expect(StatusCode::OK);
    server.stop().await;
}

#[tokio::test]
async fn integers_beyond_32_bits_are_refused_with_their_range() {
    let (server, _dir) = TestServer::start().await;
    let mut beyond = registration(NO_JOB, "cpu");
    for field in ["solver_revision", "threads", "memory_mib"] {
        beyond[field] = json!(1_u64 << 33);
    }
    let problem = server.post("/v1/workers", &beyond).await.problem(422, "invalid-document");
    assert_eq!(pointers(&problem), ["/memory_mib", "/solver_revision", "/threads"]);
    for fault in problem["errors"].as_array().unwrap() {
        assert!(text(&fault["allowed"]).contains("0 to 4294967295"), "{fault}");
    }
    server.stop().await;
}

/// The server has one thread: a computation on it would block all requests, each time. A busy machine may stop a single attempt.
#[tokio::test(flavor = "current_thread")]
async fn costly_scenario_does_not_block_others() {
    let (server, _dir) = TestServer::with(|config| config.limits.max_subparticles = u64::MAX).await;
    let mut waits = Vec::new();
    while waits.len() < 4 && waits.iter().all(|(gap, took)| *gap >= *took / 2) {
        waits.push(longest_wait_beside_a_costly_scenario(&server).await);
    }
    let (gap, took) = waits[waits.len() - 1];
    assert!(gap < took / 2, "others waited {waits:?}");
    server.stop().await;
}

/// The longest time in which this thread did nothing but answer the submission of a costly scenario, and the time of this submission.
async fn longest_wait_beside_a_costly_scenario(server: &TestServer) -> (Duration, Duration) {
    let mut costly = envelope(1);
    costly["scenario"]["product"] = json!({"count": 191, "subparticle_radius_m": 0.001});
    let started = Instant::now();
    let mut submitted = Box::pin(server.send(Method::POST, "/v1/jobs", Some(&costly)));
    let (mut last, mut gap) = (started, Duration::ZERO);
    let status = loop {
        tokio::select! {
            answer = &mut submitted => break answer.status,
            () = tokio::time::sleep(Duration::from_millis(1)) => {}
        }
        gap = gap.max(last.elapsed());
        last = Instant::now();
    };
    assert_eq!(status, 202);
    (gap.max(last.elapsed()), started.elapsed())
}

#[tokio::test]
async fn impossible_or_too_costly_scenario_is_refused() {
    let (server, _dir) = TestServer::with(|config| config.limits.max_subparticles = 10).await;
    let problem = server.post("/v1/jobs", &envelope(1)).await.problem(422, "invalid-document");
    assert_eq!(pointers(&problem), ["/scenario/product/count"]);
    assert!(text(&problem["errors"][0]["allowed"]).contains("10"));
    assert_nothing_stored(&server).await;
    server.stop().await;
}

fn sweep(change: impl FnOnce(&mut Value)) -> Value {
    let mut sweep = json!({"name": "s", "base": scenario(1), "design": {"kind": "grid"},
        "factors": [{"pointer": "/equipment/gate_opening_m", "levels": [0.045, 0.06]}]});
    change(&mut sweep);
    sweep
}

#[tokio::test]
async fn all_faults_of_a_sweep_are_listed() {
    let (server, _dir) = TestServer::with(|config| config.max_jobs_per_sweep = 100).await;
    let faults = async |document: Value| {
        let problem = server.post("/v1/sweeps", &document).await.problem(422, "invalid-document");
        pointers(&problem).into_iter().map(str::to_owned).collect::<Vec<_>>()
    };
    let base = sweep(|sweep| sweep["base"] = json!({"experiment": "hopper", "sed": 1, "material": 3}));
    assert_eq!(faults(base).await, ["/base/material", "/base/sed"]);
    let gate = json!({"pointer": "/equipment/gate_opening_m", "levels": []});
    let many = sweep(|sweep| {
        sweep["factors"] = json!([gate, {"pointer": "/equipment/gate_opening", "levels": [1]},
            {"pointer": "gate", "levels": [1]}, {"pointer": "/seed", "levels": [1, 2]},
            {"pointer": "/equipment", "levels": [{}]}]);
        sweep["replicates"] = json!(0);
        sweep["name"] = json!(" ");
    });
    assert_eq!(
        faults(many).await,
        [
            "/factors/0/levels",
            "/factors/1/pointer",
            "/factors/2/pointer",
            "/factors/3/pointer",
            "/factors/4/pointer",
            "/name",
            "/replicates"
        ]
    );
    let duplicate = sweep(|sweep| {
        let factor = sweep["factors"][0].clone();
        sweep["factors"].as_array_mut().unwrap().push(factor);
    });
    assert_eq!(faults(duplicate).await, ["/factors/1/pointer"]);
    let levels = sweep(|sweep| sweep["factors"][0]["levels"] = json!([0.06, "wide", -1.0, 0.06]));
    let told = ["/factors/0/levels/1", "/factors/0/levels/2", "/factors/0/levels/3"];
    assert_eq!(faults(levels).await, told, "two unusable, one listed twice");
    let same = sweep(|sweep| {
        sweep["factors"][0] = json!({"pointer": "/equipment/belt_speed_m_s", "levels": [1, 1.0]});
    });
    assert_eq!(faults(same).await, ["/factors/0/levels/1"], "1 and 1.0 are one value");
    let levels = sweep(|sweep| sweep["factors"][0]["levels"] = json!([0.06, "wide", -1.0]));
    assert_eq!(faults(levels).await, ["/factors/0/levels/1", "/factors/0/levels/2"]);
    assert_eq!(faults(sweep(|sweep| sweep["replicates"] = json!(51))).await, ["/factors"], "102 jobs of 100");
    let seeds = sweep(|sweep| {
        sweep["base"]["seed"] = json!((1_u64 << 53) - 2);
        sweep["replicates"] = json!(3);
    });
    assert_eq!(faults(seeds).await, ["/replicates"]);
    assert_eq!(faults(sweep(|sweep| sweep["design"]["kind"] = json!("spiral"))).await, ["/design/kind"]);
    assert_eq!(faults(sweep(|sweep| sweep["schema"] = json!("roost.sweep/9"))).await, ["/schema"]);
    assert_eq!(faults(json!({"name": 1, "factrs": []})).await, ["/base", "/design", "/factrs", "/name"]);
    let extra = sweep(|sweep| sweep["design"]["extra"] = json!(1));
    assert_eq!(faults(extra).await, ["/design/extra"]);
    let mixed = sweep(|sweep| {
        sweep["base"] = json!({"experiment": "hopper", "seed": -1});
        sweep["design"]["kind"] = json!("spiral");
        sweep["replicates"] = json!(-1);
        sweep["max_wall_s"] = json!(0);
        let bad = json!({"pointer": "/equipment/gate", "levels": [1]});
        sweep["factors"] =
            json!([3, bad, {"pointer": "/equipment/gate_opening_m", "levels": [0.06, "wide"]}]);
    });
    assert_eq!(
        faults(mixed).await,
        ["/base/seed", "/design/kind", "/factors/0", "/factors/2/levels/1", "/max_wall_s", "/replicates"],
        "shape and content at once; without a base nobody knows what /factors/1 points at"
    );
    let pointer = sweep(|sweep| {
        let bad = json!({"pointer": "/equipment/gate", "levels": [1]});
        sweep["factors"] = json!([bad, {"pointer": "/equipment/gate_opening_m", "levels": [0.06, -1]}]);
    });
    assert_eq!(faults(pointer).await, ["/factors/0/pointer", "/factors/1/levels/1"]);
    assert_eq!(faults(json!(["s", {}, {"kind": "grid"}, []])).await, [""]);
    assert_nothing_stored(&server).await;
    server.stop().await;
}

#[tokio::test]
async fn huge_sweep_is_refused_before_expansion() {
    let (server, _dir) = TestServer::start().await;
    let levels: Vec<_> = (0..1000).map(|n| 0.03 + f64::from(n) * 1e-5).collect();
    let huge = sweep(|sweep| {
        let names = ["gate_opening_m", "belt_speed_m_s", "hopper_width_m", "hopper_length_m"];
        let factors = names.map(|name| json!({"pointer": format!("/equipment/{name}"), "levels": levels}));
        sweep["factors"] = json!(factors);
    });
    let problem = server.post("/v1/sweeps", &huge).await.problem(422, "invalid-document");
    assert!(
        text(&problem["errors"][0]["allowed"]).contains("1000000 jobs (max_jobs_per_sweep)"),
        "{problem}"
    );
    server.stop().await;
}

#[tokio::test]
async fn invalid_claims_registrations_and_deliveries_are_refused() {
    let (server, _dir) = TestServer::start().await;
    let worker = server.worker("cpu").await;
    for (jobs, wait) in [(0, 0.0), (65, 0.0), (1, -1.0), (1, 1e300)] {
        server.post("/v1/claims", &worker.claim_request(jobs, wait)).await.problem(422, "invalid-document");
    }
    let nameless = json!({"worker_id": "me", "backend": 1});
    let problem = server.post("/v1/workers", &nameless).await.problem(422, "invalid-document");
    assert!(pointers(&problem).contains(&"/worker_id"), "{problem}");
    server.submit(&envelope(1)).await;
    let attempt = worker.claim_one().await;
    let path = format!("/v1/jobs/{}/attempts/1/result", text(&attempt["job_id"]));
    for (job, number) in [(NO_JOB, 1), (text(&attempt["job_id"]), 2)] {
        let nowhere = format!("/v1/jobs/{job}/attempts/{number}/result");
        server.send_text(&nowhere, "application/json", "not even read").await.problem(404, "not-found");
    }
    server.send_text(&path, "application/json", "read").await.problem(400, "syntax");
    server.post(&path, &json!([worker.id, {}])).await.problem(422, "invalid-document");
    let half = json!({"worker_id": worker.id, "result": {"schema": "roost.result/1"}});
    server.post(&path, &half).await.problem(422, "invalid-document");
    assert_eq!(server.job(&attempt["job_id"]).await["state"], "running");
    server.stop().await;
}

#[tokio::test]
async fn validation_stores_nothing() {
    let (server, _dir) = TestServer::start().await;
    let validate = async |document: Value| server.post("/v1/validate", &document).await;
    let report = validate(scenario(1)).await.expect(StatusCode::OK);
    assert_eq!((&report["document"], &report["jobs"]), (&json!("scenario"), &json!(1)));
    assert_eq!(report["scenario"]["bonds"]["formulation"], "corotated");
    assert!(report["estimate"]["subparticles"].as_u64().unwrap() > 0);
    assert_eq!(validate(envelope(1)).await.expect(StatusCode::OK)["document"], "scenario");
    let report = validate(sweep(|sweep| sweep["replicates"] = json!(3))).await.expect(StatusCode::OK);
    assert_eq!((&report["document"], &report["jobs"]), (&json!("sweep"), &json!(6)));

    let plain = validate(json!({"experiment": "hopper", "seed": -1})).await.problem(422, "invalid-document");
    assert_eq!(pointers(&plain), ["/seed"]);
    let wrapped = validate(json!({"scenario": {"experiment": "hopper", "seed": -1}})).await;
    assert_eq!(pointers(&wrapped.problem(422, "invalid-document")), ["/scenario/seed"]);
    let swept = validate(sweep(|sweep| sweep["base"]["seed"] = json!(-1))).await;
    assert_eq!(pointers(&swept.problem(422, "invalid-document")), ["/base/seed"]);
    assert_nothing_stored(&server).await;
    server.stop().await;
}
