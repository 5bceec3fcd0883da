//! Forecasts of jobs, sweeps, studies, and of documents that are not submitted.

use std::time::{Duration, Instant};

use reqwest::StatusCode;
use roost_api::time::Timestamp;
use serde_json::{Value, json};

use super::test_server::*;

/// Waits until a forecast is as wanted.
async fn until(server: &TestServer, path: &str, is_wanted: impl Fn(&Value) -> bool) -> Value {
    let deadline = Instant::now() + Duration::from_secs(60);
    loop {
        let forecast = server.get(path).await.expect(StatusCode::OK);
        if is_wanted(&forecast) {
            return forecast;
        }
        assert!(Instant::now() < deadline, "{forecast}");
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
}

/// Reasons with their numbers of jobs.
fn reasons(forecast: &Value) -> Vec<(&str, u64)> {
    let counts = forecast["waiting"].as_array().unwrap().iter();
    counts.map(|count| (text(&count["reason"]), count["jobs"].as_u64().unwrap())).collect()
}

fn time(value: &Value) -> Timestamp {
    serde_json::from_value(value.clone()).unwrap_or_else(|_| panic!("not a time: {value}"))
}

/// Both ends of a range, in seconds after the forecast was made.
fn range_s(forecast: &Value, name: &str) -> (f64, f64) {
    let after = |end: &str| (time(&forecast[name][end]).0 - time(&forecast["made_at"]).0) as f64 / 1000.0;
    (after("earliest"), after("latest"))
}

fn sweep(jobs: u64) -> Value {
    json!({"name": "s", "base": scenario(100), "design": {"kind": "grid"}, "factors": [], "replicates": jobs,
           "cache": "bypass", "shared_fill": false})
}

async fn long_lease() -> (TestServer, tempfile::TempDir) {
    TestServer::with(|config| config.lease = Duration::from_secs(600)).await
}

/// Makes six runs one after the other, and returns the time of the slowest in seconds: a busy machine stretches some.
async fn make_six_runs(worker: &Worker<'_>, run: Duration) -> f64 {
    let mut slowest_s = 0.0_f64;
    for _ in 0..6 {
        let began = Instant::now();
        let attempt = worker.claim_one().await;
        tokio::time::sleep(run).await;
        worker.deliver(&attempt).await.expect(StatusCode::OK);
        slowest_s = slowest_s.max(began.elapsed().as_secs_f64());
    }
    slowest_s
}

#[tokio::test]
async fn a_sweep_has_reasons_and_learns_from_its_runs() {
    let (server, _dir) = long_lease().await;
    let id = server.post("/v1/sweeps", &sweep(12)).await.expect(StatusCode::CREATED)["id"].clone();
    let path = format!("/v1/sweeps/{}/forecast", text(&id));
    let nobody = server.get(&path).await.expect(StatusCode::OK);
    assert_eq!(reasons(&nobody), [("no_worker", 12)]);
    assert_eq!(
        (&nobody["end"], &nobody["no_forecast"], &nobody["basis"]),
        (&Value::Null, &json!("no worker is online"), &Value::Null)
    );

    let worker = server.worker("cpu").await;
    let guess = until(&server, &path, |forecast| forecast["end"].is_object()).await;
    assert_eq!(reasons(&guess), [("next", 1), ("behind", 11)]);
    assert_eq!(guess["no_forecast"], Value::Null);
    assert_eq!(guess["basis"]["learned_from"], "nothing");
    assert_eq!((&guess["basis"]["workers"], &guess["basis"]["slots"]), (&json!(1), &json!(1)));
    assert_eq!(guess["runs_left"], json!({"least": 12, "most": 12}));
    assert_eq!(range_s(&guess, "start"), (0.0, 0.0), "a slot is free");
    let (low_s, high_s) = range_s(&guess, "end");
    assert!(low_s > 0.0 && high_s > 2.0 * low_s, "a wide guess: {low_s} to {high_s} s");

    // Runs of 0.3 s, whatever the check expects.
    let slowest_s = make_six_runs(&worker, Duration::from_millis(300)).await;
    let running = worker.claim_one().await;
    let learned = until(&server, &path, |forecast| forecast["basis"]["finished_runs"] == 6).await;
    assert_eq!(learned["basis"]["learned_from"], "sweep");
    assert_eq!(reasons(&learned), [("workers_busy", 1), ("behind", 4)]);
    assert_eq!(
        (&learned["start"], &learned["runs_left"]["most"]),
        (&Value::Null, &json!(6)),
        "it has started"
    );
    let (low_s, high_s) = range_s(&learned, "end");
    assert!(
        low_s > 0.5 && high_s < 20.0 * slowest_s,
        "5 runs of 0.3 s and the rest of one: {low_s} to {high_s} s"
    );

    let pause = server.post(&format!("/v1/sweeps/{}/pause", text(&id)), &json!({})).await;
    pause.expect(StatusCode::OK);
    worker.deliver(&running).await.expect(StatusCode::OK);
    let paused =
        until(&server, &path, |forecast| forecast["runs_left"]["most"] == 5 && forecast["end"].is_null())
            .await;
    assert_eq!(reasons(&paused), [("paused", 5)]);
    assert_eq!(paused["no_forecast"], "every job that has not ended is paused");
    server.stop().await;
}

#[tokio::test]
async fn a_job_starts_after_those_before_it() {
    let (server, _dir) = long_lease().await;
    let worker = server.worker("cpu").await;
    for seed in 1..=6 {
        server.submit(&envelope(seed)).await;
    }
    let slowest_s = make_six_runs(&worker, Duration::from_millis(200)).await;
    server.post("/v1/sweeps", &sweep(20)).await.expect(StatusCode::CREATED);
    let mut last = envelope(50);
    last["priority"] = json!(-1);
    let id = server.submit(&last).await["id"].clone();
    let path = format!("/v1/jobs/{}/forecast", text(&id));
    let waiting = until(&server, &path, |forecast| forecast["basis"]["finished_runs"] == 6).await;
    assert_eq!(
        waiting["waiting"],
        json!([{"reason": "behind", "jobs": 1, "detail": "behind 20 jobs, all of higher priority"}])
    );
    assert_eq!(waiting["basis"]["learned_from"], "backend");
    let (start, end) = (range_s(&waiting, "start"), range_s(&waiting, "end"));
    assert!(start.0 > 2.0 && start.1 < 60.0 * slowest_s, "20 runs of about 0.2 s: {start:?}");
    assert!(end.0 > start.0 && end.1 > start.1, "{end:?}");
    // Among other reasons, the best place: the forecast follows.
    server.post(&format!("/v1/jobs/{}/pause", text(&id)), &json!({})).await.expect(StatusCode::OK);
    let paused = until(&server, &path, |forecast| forecast["end"].is_null()).await;
    assert_eq!(paused["no_forecast"], "a user has paused it");

    let first = worker.claim_one().await;
    worker.beat(&first, progress(0.5)).await;
    let path = format!("/v1/jobs/{}/forecast", text(&first["job_id"]));
    let running = until(&server, &path, |forecast| forecast["end"].is_object()).await;
    assert_eq!((&running["start"], &running["waiting"]), (&Value::Null, &json!([])));
    let (low_s, high_s) = range_s(&running, "end");
    assert!(low_s > 0.05 && high_s < 0.2, "half of it took 0.1 s: {low_s} to {high_s} s");
    worker.deliver(&first).await.expect(StatusCode::OK);
    let ended = until(&server, &path, |forecast| forecast["end"].is_null()).await;
    assert_eq!(ended["no_forecast"], "the job has ended");
    assert_eq!(server.get("/v1/jobs/01890000-0000-7000-8000-000000000000/forecast").await.status, 404);
    server.stop().await;
}

#[tokio::test]
async fn the_depth_of_the_queue_counts_jobs_by_needs() {
    let (server, _dir) = long_lease().await;
    let path = "/v1/queue/depth";
    let empty = server.get(path).await.expect(StatusCode::OK);
    assert_eq!((&empty["queued"], &empty["total"], &empty["by_needs"]), (&json!(0), &json!(0), &json!([])));
    let sweep = server.post("/v1/sweeps", &sweep(12)).await.expect(StatusCode::CREATED);
    for seed in 1..=3 {
        let mut job = envelope(seed);
        job["needs"] = json!({"backend": "gpu", "memory_mib": 4000});
        server.submit(&job).await;
    }
    let depth = until(&server, path, |depth| depth["queued"] == 15).await;
    let jobs = |depth: &Value| -> Vec<(Value, u64)> {
        let groups = depth["by_needs"].as_array().unwrap().iter();
        groups.map(|group| (group["needs"]["backend"].clone(), group["jobs"].as_u64().unwrap())).collect()
    };
    assert_eq!(jobs(&depth), [(Value::Null, 12), (json!("gpu"), 3)]);
    let guess = &depth["by_needs"][0];
    assert_eq!(
        (&guess["workers"], &guess["slots"], &guess["finished_runs"]),
        (&json!(0), &json!(0), &json!(0))
    );
    let time_s = |group: &Value, end: &str| group["job_time"][end].as_f64().unwrap();
    assert!(time_s(guess, "longest_s") > 2.0 * time_s(guess, "shortest_s"), "a wide guess: {guess}");

    let worker = server.worker("cpu").await;
    let slowest_s = make_six_runs(&worker, Duration::from_millis(200)).await;
    worker.claim_one().await;
    let depth = until(&server, path, |depth| depth["queued"] == 8 && depth["running"] == 1).await;
    assert_eq!((jobs(&depth), &depth["total"]), (vec![(Value::Null, 5), (json!("gpu"), 3)], &json!(9)));
    let known = &depth["by_needs"][0];
    assert_eq!((&known["workers"], &known["slots"], &known["free_slots"]), (&json!(1), &json!(1), &json!(0)));
    assert_eq!(known["finished_runs"], 6);
    let (low_s, high_s) = (time_s(known, "shortest_s"), time_s(known, "longest_s"));
    assert!(low_s > 0.15 && high_s < 10.0 * slowest_s, "runs of 0.2 s: {low_s} to {high_s} s");
    assert_eq!(depth["by_needs"][1]["workers"], 0, "no worker has a GPU");

    let pause = server.post(&format!("/v1/sweeps/{}/pause", text(&sweep["id"])), &json!({})).await;
    pause.expect(StatusCode::OK);
    let paused = until(&server, path, |depth| depth["queued"] == 3).await;
    assert_eq!(jobs(&paused), [(json!("gpu"), 3)]);
    server.stop().await;
}

fn question(level: f64, max_runs: u64) -> Value {
    json!({"name": "gate", "base": scenario(1),
           "factors": [{"pointer": "/equipment/gate_opening_m", "low": 0.03, "high": 0.09}],
           "goal": {"boundary": {"of": {"probability": "jammed"}, "level": level}}, "budget": {"max_runs": max_runs}})
}

#[tokio::test]
async fn a_study_is_forecast_before_and_after_its_submission() {
    let (server, _dir) = long_lease().await;
    let validate = async |document: Value| server.post("/v1/studies/validate", &document).await;
    let report = validate(question(0.05, 40)).await.expect(StatusCode::OK);
    assert_eq!(report["shortage"], "the best case needs 59 runs, and the budget is 40");
    let forecast = &report["forecast"];
    assert_eq!(forecast["runs"], json!({"least": 40, "most": 40}));
    assert_eq!(
        (&forecast["duration"], &forecast["end"], &forecast["no_forecast"]),
        (&Value::Null, &Value::Null, &json!("no worker is online"))
    );
    assert!(
        forecast["processor"]["longest_s"].as_f64() > forecast["processor"]["shortest_s"].as_f64(),
        "{forecast}"
    );
    assert_eq!(server.get("/v1/studies").await.body["items"], json!([]), "nothing is stored");
    let no_study = validate(scenario(1)).await.problem(422, "invalid-document");
    assert_eq!(no_study["errors"][0]["pointer"], "/goal");

    let worker = server.worker("cpu").await;
    let mut of_client = question(0.05, 300);
    of_client["driver"] = json!("client");
    let report = validate(of_client).await.expect(StatusCode::OK);
    let runs = json!({"least": 59, "most": 300});
    let why = "clients choose when its runs are made";
    let promised = json!({"runs": runs, "processor": null, "duration": null, "end": null, "no_forecast": why, "basis": null});
    assert_eq!((&report["forecast"], &report["wall_s"]), (&promised, &json!(0.0)), "no hours of workers");
    let deadline = Instant::now() + Duration::from_secs(60);
    let report = loop {
        let report = validate(question(0.05, 300)).await.expect(StatusCode::OK);
        if report["forecast"]["end"].is_object() {
            break report;
        }
        assert!(Instant::now() < deadline, "{report}");
    };
    assert_eq!(
        (&report["shortage"], &report["min_jobs"], &report["jobs"]),
        (&Value::Null, &json!(59), &json!(300))
    );
    let duration = &report["forecast"]["duration"];
    assert!(
        duration["longest_s"].as_f64().unwrap() > 5.0 * duration["shortest_s"].as_f64().unwrap(),
        "{duration}"
    );
    let swept = server.post("/v1/validate", &sweep(4)).await.expect(StatusCode::OK);
    assert_eq!(swept["forecast"]["runs"], json!({"least": 4, "most": 4}));
    assert!(swept["forecast"]["end"].is_object(), "{swept}");

    let study = server.post("/v1/studies", &question(0.05, 300)).await.expect(StatusCode::CREATED);
    let path = format!("/v1/studies/{}/forecast", text(&study["id"]));
    let first = until(&server, &path, |forecast| forecast["end"].is_object()).await;
    assert_eq!(first["runs_left"], json!({"least": 59, "most": 300}));
    assert_eq!(reasons(&first)[0], ("next", 1));
    let result = worker.claim_one().await;
    worker.deliver(&result).await.expect(StatusCode::OK);
    until(&server, &path, |forecast| forecast["runs_left"] == json!({"least": 58, "most": 299})).await;

    let verb = async |verb: &str| {
        let path = format!("/v1/studies/{}/{verb}", text(&study["id"]));
        server.post(&path, &json!({})).await.expect(StatusCode::OK)
    };
    verb("pause").await;
    let paused = until(&server, &path, |forecast| forecast["no_forecast"] == "the study is paused").await;
    assert_eq!((&paused["end"], reasons(&paused)[0].0), (&Value::Null, "paused"));
    verb("cancel").await;
    let ended = until(&server, &path, |forecast| forecast["runs_left"]["most"] == 0).await;
    assert_eq!(ended["no_forecast"], "all runs have ended");
    server.stop().await;
}

#[tokio::test]
async fn runs_without_a_queued_job_are_forecast_for_workers_that_suit_them() {
    let (server, _dir) = long_lease().await;
    let (gpu, _cpu) = (server.worker("gpu").await, server.worker("cpu").await);
    let needs = json!({"backend": "gpu"});
    let (mut job, mut sweep, mut study) = (envelope(900), sweep(2), question(0.5, 3));
    for document in [&mut job, &mut sweep, &mut study] {
        document["needs"] = needs.clone();
    }
    let job = server.submit(&job).await;
    let sweep = server.post("/v1/sweeps", &sweep).await.expect(StatusCode::CREATED);
    let study = server.post("/v1/studies", &study).await.expect(StatusCode::CREATED);
    let mut claimed = 0;
    while claimed < 6 {
        claimed += gpu.claim(6).await.len();
    }
    for (kind, id) in [("jobs", &job["id"]), ("sweeps", &sweep["id"]), ("studies", &study["id"])] {
        let path = format!("/v1/{kind}/{}/forecast", text(id));
        let forecast = until(&server, &path, |forecast| forecast["basis"].is_object()).await;
        assert_eq!(forecast["waiting"], json!([]), "{kind}");
        assert_eq!(forecast["basis"]["workers"], 1, "{kind}: one of two workers has the backend");
    }
    server.stop().await;
}
