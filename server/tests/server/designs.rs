//! Extension and deletion of sweeps, tables in every format, effects.

use std::path::Path;
use std::time::{Duration, Instant};

use reqwest::{Method, StatusCode};
use serde_json::{Value, json};

use super::database;
use super::test_server::*;

const GATE: &str = "/equipment/gate_opening_m";

async fn submit(server: &TestServer, design: Value, factors: Value) -> (Value, String) {
    let sweep = json!({"name": "s", "base": scenario(10), "design": design, "factors": factors, "replicates": 2,
                       "labels": {"line": "north"}, "priority": 3});
    let view = server.post("/v1/sweeps", &sweep).await.expect(StatusCode::CREATED);
    let path = format!("/v1/sweeps/{}", text(&view["id"]));
    (view, path)
}

async fn finish(worker: &Worker<'_>) {
    loop {
        let attempts = worker.claim(64).await;
        if attempts.is_empty() {
            return;
        }
        for attempt in &attempts {
            worker.deliver(attempt).await.expect(StatusCode::OK);
        }
    }
}

/// Job, point, replicate and seed of every trial.
async fn trials(server: &TestServer, path: &str) -> Vec<Value> {
    let table = server.get(&format!("{path}/results")).await.expect(StatusCode::OK);
    let of = |trial: &Value| {
        json!([
            trial["job_id"],
            trial["point"],
            trial["replicate"],
            trial["seed"],
            trial["factors"],
            trial["state"]
        ])
    };
    table["trials"].as_array().unwrap().iter().map(of).collect()
}

#[tokio::test]
async fn extension_leaves_existing_jobs_unchanged() {
    let (server, _dir) = TestServer::start().await;
    let factors = json!([{"pointer": GATE, "low": 0.05, "high": 0.07}]);
    let (view, path) = submit(&server, json!({"kind": "sobol", "points": 4}), factors).await;
    assert_eq!((&view["design"], &view["points"]), (&json!("sobol"), &json!(4)));
    let worker = server.worker("cpu").await;
    finish(&worker).await;
    let before = trials(&server, &path).await;

    let grown = server.post(&format!("{path}/extend"), &json!({"points": 3, "replicates": 1})).await;
    let grown = grown.expect(StatusCode::OK);
    assert_eq!((&grown["points"], &grown["replicates"]), (&json!(7), &json!(3)));
    assert_eq!((&grown["counts"]["succeeded"], &grown["counts"]["queued"]), (&json!(8), &json!(4 + 9)));
    let after = trials(&server, &path).await;
    let kept: Vec<&Value> = after.iter().filter(|trial| before.contains(trial)).collect();
    assert_eq!(kept.len(), 8, "the same jobs, points, seeds and results");
    let new: Vec<Value> = after
        .iter()
        .filter(|trial| !before.contains(trial))
        .map(|trial| json!([trial[1], trial[2], trial[3]]))
        .collect();
    let seeds = |point| (0..3).map(move |r| json!([point, r, 10 + r]));
    let expected: Vec<Value> =
        (0..4).map(|point| json!([point, 2, 12])).chain((4..7).flat_map(seeds)).collect();
    assert_eq!(new, expected);
    let job = server.job(&after[after.len() - 1][0]).await;
    assert_eq!(
        (&job["priority"], &job["labels"]),
        (&json!(3), &json!({"line": "north"})),
        "new jobs have the fields of the old ones"
    );
    let of_one =
        |trials: &[Value], point| trials.iter().find(|trial| trial[1] == json!(point)).unwrap()[4].clone();
    assert_eq!(of_one(&after, 2), of_one(&before, 2));

    let hypercube = json!([{"pointer": GATE, "low": 0.05, "high": 0.07}]);
    let (_, path) = submit(&server, json!({"kind": "latin_hypercube", "points": 4}), hypercube).await;
    let refused = server.post(&format!("{path}/extend"), &json!({"points": 3})).await;
    let problem = refused.problem(422, "invalid-document");
    assert!(text(&problem["errors"][0]["detail"]).contains("its own part"), "{problem}");
    let nowhere = "/v1/sweeps/01890000-0000-7000-8000-000000000000/extend";
    server.post(nowhere, &json!({"points": 3})).await.problem(404, "not-found");
    server.stop().await;
}

#[tokio::test]
async fn concurrent_extensions_all_take_effect() {
    let (server, _dir) = TestServer::start().await;
    let factors = json!([{"pointer": GATE, "low": 0.05, "high": 0.07}]);
    let (_, path) = submit(&server, json!({"kind": "random", "points": 1}), factors).await;
    let route = format!("{path}/extend");
    let body = json!({"points": 1});
    let (a, b, c, d) = tokio::join!(
        server.post(&route, &body),
        server.post(&route, &body),
        server.post(&route, &body),
        server.post(&route, &body)
    );
    for answer in [a, b, c, d] {
        answer.expect(StatusCode::OK);
    }
    let trials = trials(&server, &path).await;
    let points: Vec<_> = trials.iter().map(|trial| trial[1].clone()).collect();
    assert_eq!(points, [0, 0, 1, 1, 2, 2, 3, 3, 4, 4]);
    server.stop().await;
}

#[tokio::test]
async fn tables_by_trial_and_by_point_in_every_format() {
    let (server, _dir) = TestServer::start().await;
    let factors = json!([{"pointer": GATE, "levels": [0.05, 0.06, 0.07]}]);
    let (_, path) = submit(&server, json!({"kind": "one_at_a_time"}), factors).await;
    finish(&server.worker("cpu").await).await;
    let points = server.get(&format!("{path}/results?by=point")).await.expect(StatusCode::OK);
    let row = &points["points"][1];
    assert_eq!((&row["point"], &row["factors"][GATE]), (&json!(1), &json!(0.05)), "0.06 is the base's own");
    let mass = &row["responses"]["discharged_kg"];
    assert_eq!((&mass["n"], &mass["mean"]), (&json!(2), &json!(40.5)), "30 and the seed, of seeds 10 and 11");
    let regime = &row["responses"]["regime"];
    assert_eq!((&regime["n"], &regime["words"]), (&json!(2), &json!({"constant": 2})));
    // Wilson's interval of 2 of 2: 1 / (1 + z²/2) to 1, z = 1.959964.
    let low = regime["shares"]["constant"]["low_95"].as_f64().unwrap();
    assert!((low - 0.342_380).abs() < 1e-6, "{low}");
    let csv = server.get(&format!("{path}/results?by=point&format=csv")).await;
    assert!(csv.text.starts_with("point,/equipment/gate_opening_m,trials,"), "{}", csv.text);
    assert_eq!(csv.text.lines().count(), 4);
    for query in ["format=parquet", "format=parquet&by=point"] {
        let file = server.get(&format!("{path}/results?{query}")).await;
        assert_eq!((file.status, file.media_type.as_str()), (200, "application/vnd.apache.parquet"));
        assert!(file.text.starts_with("PAR1") && file.text.ends_with("PAR1"));
    }
    server.get(&format!("{path}/results?by=day")).await.problem(400, "invalid-query");

    let effects = server.get(&format!("{path}/effects")).await.expect(StatusCode::OK);
    let names: Vec<_> =
        effects["responses"].as_array().unwrap().iter().map(|of| text(&of["response"])).collect();
    assert_eq!(names, ["discharged_kg", "regime=constant"]);
    let effect = &effects["responses"][0]["factors"][0];
    assert_eq!((&effect["factor"], &effect["levels"][2]["level"]), (&json!(GATE), &json!(0.07)));
    assert_eq!(effect["effect"], Value::Null, "it is the same at every point");
    // Three points with two seeds each.
    let of = &effects["responses"][0];
    assert_eq!((&of["pairing"], &of["seeds"]), (&json!("additive_model"), &json!(2)));
    let sentence = "No interval is paired by seed: that needs two seeds in common at all points, and a response that varies.";
    assert_eq!(effects["pairing"], json!({"median_width_ratio": null, "intervals": 0, "sentence": sentence}));

    let differences = server.get(&format!("{path}/differences?from=0&to=2")).await.expect(StatusCode::OK);
    assert_eq!(
        (&differences["from"]["point"], &differences["to"]["factors"][GATE]),
        (&json!(0), &json!(0.07))
    );
    let discharged = &differences["responses"][0];
    assert_eq!(
        (&discharged["response"], &discharged["pairing"]),
        (&json!("discharged_kg"), &json!("by_seed"))
    );
    assert_eq!((&discharged["from_n"], &discharged["difference"]), (&json!(2), &json!(0.0)));
    let unknown = server.get(&format!("{path}/differences?from=0&to=3")).await.problem(404, "not-found");
    assert!(text(&unknown["detail"]).contains("no design point 3: allowed is 0 to 2"), "{unknown}");
    server.get(&format!("{path}/differences?from=0")).await.problem(400, "invalid-query");
    let same = server.get(&format!("{path}/differences?from=2&to=2")).await.problem(400, "invalid-query");
    let detail = "to=2 is the same design point as from=2: allowed is another one, of 0 to 2";
    assert_eq!(text(&same["detail"]), detail);
    server.stop().await;
}

#[tokio::test]
async fn deletion_removes_one_sweep_only() {
    let (server, dir) = TestServer::start().await;
    let factors = json!([{"pointer": GATE, "levels": [0.05, 0.06]}]);
    let (_, path) = submit(&server, json!({"kind": "grid"}), factors.clone()).await;
    let worker = server.worker("cpu").await;
    let dry = server.send(Method::DELETE, &format!("{path}?dry_run=true"), None).await.expect(StatusCode::OK);
    assert_eq!(
        dry,
        json!({"dry_run": true, "points": 2, "jobs": 4, "unended": 4, "attempts": 0, "results": 0, "frames_bytes": 0})
    );
    let early = server.send(Method::DELETE, &path, None).await.problem(409, "wrong-state");
    assert!(text(&early["detail"]).contains("4 of its jobs have not ended"), "{early}");

    let attempts = worker.claim(3).await;
    worker.deliver(&attempts[0]).await.expect(StatusCode::OK);
    worker
        .fail(&attempts[1], "unstable", Some(&result_of(&attempts[1]["scenario"])))
        .await
        .expect(StatusCode::OK);
    worker.deliver(&attempts[2]).await.expect(StatusCode::OK);
    server.post(&format!("{path}/cancel"), &json!({})).await.expect(StatusCode::OK);
    // Another sweep of the same scenarios uses the results of the first one and outlives it.
    let (other, other_path) = submit(&server, json!({"kind": "grid"}), factors).await;
    assert_eq!(other["counts"]["succeeded"], 2);

    let gone = server.send(Method::DELETE, &path, None).await.expect(StatusCode::OK);
    assert_eq!(
        gone,
        json!({"dry_run": false, "points": 2, "jobs": 4, "unended": 0, "attempts": 3, "results": 2, "frames_bytes": 0})
    );
    for answer in [
        server.get(&path).await,
        server.get(&format!("{path}/results")).await,
        server.get(&format!("/v1/jobs/{}", text(&attempts[0]["job_id"]))).await,
        server.post(&format!("{path}/retry"), &json!({})).await,
        server.send(Method::DELETE, &path, None).await,
    ] {
        answer.problem(404, "not-found");
    }
    assert_eq!(server.get("/v1/sweeps").await.expect(StatusCode::OK)["items"].as_array().unwrap().len(), 1);
    finish(&worker).await;
    let kept = trials(&server, &other_path).await;
    assert_eq!(kept.len(), 4);
    for trial in &kept {
        server.get(&format!("/v1/jobs/{}/result", text(&trial[0]))).await.expect(StatusCode::OK);
    }
    server.stop().await;
    let again = TestServer::on(dir.path(), |_| {}).await;
    assert_eq!(trials(&again, &other_path).await, kept);
    again.stop().await;
}

/// Unnamed rows, and all rows of the tables that a sweep fills.
async fn row_counts(data: &Path) -> (i64, i64) {
    let unnamed =
        "SELECT (SELECT count(*) FROM scenarios WHERE digest NOT IN (SELECT scenario_digest FROM jobs))
        + (SELECT count(*) FROM documents WHERE digest NOT IN (SELECT document_digest FROM results)
           AND digest NOT IN (SELECT partial_digest FROM attempts WHERE partial_digest IS NOT NULL))";
    let all =
        "SELECT (SELECT count(*) FROM sweeps) + (SELECT count(*) FROM design_points) + (SELECT count(*) FROM jobs)
        + (SELECT count(*) FROM attempts) + (SELECT count(*) FROM results)
        + (SELECT count(*) FROM scenarios) + (SELECT count(*) FROM documents)";
    (database::number(data, unnamed).await, database::number(data, all).await)
}

#[tokio::test]
async fn interrupted_deletion_is_completed_at_the_next_start() {
    let (server, dir) = TestServer::start().await;
    let factors = json!([{"pointer": GATE, "low": 0.05, "high": 0.07}]);
    // More jobs than one transaction deletes.
    let (_, path) = submit(&server, json!({"kind": "random", "points": 400}), factors.clone()).await;
    let worker = server.worker("cpu").await;
    for attempt in &worker.claim(5).await {
        worker.deliver(attempt).await.expect(StatusCode::OK);
    }
    server.post(&format!("{path}/cancel"), &json!({})).await.expect(StatusCode::OK);
    let (_, other) = submit(&server, json!({"kind": "random", "points": 3}), factors).await;
    finish(&worker).await;
    server.send(Method::DELETE, &path, None).await.expect(StatusCode::OK);
    server.post(&format!("{other}/extend"), &json!({"points": 1})).await.expect(StatusCode::OK);
    server.stop().await;

    assert_eq!(row_counts(dir.path()).await.0, 0, "files of the first sweep only are deleted");
    database::execute(dir.path(), "UPDATE sweeps SET state = 'deleting'").await;
    let again = TestServer::on(dir.path(), |_| {}).await;
    again.get(&other).await.problem(404, "not-found");
    let deadline = Instant::now() + Duration::from_secs(20);
    while row_counts(dir.path()).await != (0, 0) {
        assert!(Instant::now() < deadline, "the server does not go on where the last one stopped");
        tokio::time::sleep(Duration::from_millis(10)).await;
    }
    again.stop().await;
}

#[tokio::test]
async fn deletion_continues_when_its_client_disconnects() {
    let (server, dir) = TestServer::start().await;
    let sweep = json!({"name": "a", "base": scenario(1), "design": {"kind": "grid"}, "factors": [], "replicates": 6000});
    let sweep = server.post("/v1/sweeps", &sweep).await.expect(StatusCode::CREATED);
    let path = format!("/v1/sweeps/{}", text(&sweep["id"]));
    server.post(&format!("{path}/cancel"), &json!({})).await.expect(StatusCode::OK);
    let asking = tokio::spawn(server.http.delete(format!("http://{}{path}", server.address)).send());
    while server.get(&path).await.status != 404 {}
    asking.abort();
    // On a busy machine the deletion may have ended before.
    assert!(asking.await.map_or_else(|error| error.is_cancelled(), |answer| answer.is_ok()));
    let deadline = Instant::now() + Duration::from_secs(60);
    loop {
        let left = database::number(dir.path(), "SELECT count(*) FROM jobs").await;
        if left == 0 {
            break;
        }
        assert!(Instant::now() < deadline, "{left} jobs are left");
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
    server.stop().await;
}
