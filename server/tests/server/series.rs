//! Series of running jobs and of sweeps; speed of workers.

use reqwest::StatusCode;
use serde_json::{Value, json};

use super::etags::poll;
use super::events::Events;
use super::test_server::*;

/// Samples every quarter of a second of simulated time.
fn part(from: usize, values: &[f64]) -> Value {
    let t_s: Vec<f64> = (0..values.len()).map(|k| 0.25 * (from + k) as f64).collect();
    json!({"name": "discharged_mass", "unit": "kg", "from": from, "t_s": t_s, "values": values})
}

/// Sends a heartbeat with samples and returns its row of the reply.
async fn beat(worker: &Worker<'_>, attempt: &Value, samples: Value) -> Value {
    beat_with(worker, attempt, json!({"t0_s": null, "samples": samples})).await
}

/// Sends a heartbeat with more fields and returns its row of the reply.
async fn beat_with(worker: &Worker<'_>, attempt: &Value, more: Value) -> Value {
    let mut beat =
        json!({"job_id": attempt["job_id"], "attempt": attempt["attempt"], "progress": progress(0.5)});
    beat.as_object_mut().unwrap().extend(more.as_object().unwrap().clone());
    let path = format!("/v1/workers/{}/heartbeat", worker.id);
    worker.server.post(&path, &json!({"attempts": [beat]})).await.expect(StatusCode::OK)["attempts"][0]
        .clone()
}

#[tokio::test]
async fn running_job_shows_its_series_until_the_result_replaces_them() {
    let (server, _dir) = TestServer::start().await;
    let worker = server.worker("cpu").await;
    let job = server.submit(&envelope(1)).await;
    let attempt = worker.claim_one().await;
    let path = format!("/v1/jobs/{}/series/discharged_mass", text(&job["id"]));
    server.get(&path).await.problem(404, "not-found");
    let mut events = Events::open(&server, &format!("/v1/jobs/{}", text(&job["id"])), None).await;
    assert_eq!(events.next().await.unwrap().name, "job");

    let row = beat(&worker, &attempt, json!([part(0, &[0.0, 1.0])])).await;
    assert_eq!(row["resend_samples"], false);
    assert_eq!(beat(&worker, &attempt, json!([part(2, &[2.0])])).await["resend_samples"], false);
    let so_far = server.get(&path).await.expect(StatusCode::OK);
    assert_eq!((&so_far["values"], &so_far["partial"]), (&json!([0.0, 1.0, 2.0]), &json!(true)));
    assert_eq!(so_far["unit"], "kg");
    let mut heard: Vec<Value> = Vec::new();
    while heard.len() < 3 {
        let event = events.next().await.unwrap();
        if event.name == "samples" {
            let part = &event.data["series"][0];
            assert_eq!(part["from"], heard.len(), "only what is new");
            heard.extend(part["values"].as_array().unwrap().clone());
        }
    }
    assert_eq!(json!(heard), so_far["values"]);
    let problem = server.get(&format!("{}x", path)).await.problem(404, "not-found");
    assert!(text(&problem["detail"]).contains("discharged_mass"), "{problem}");

    let row = beat(&worker, &attempt, json!([part(9, &[9.0])])).await;
    assert_eq!(
        (&row["missing_samples"], &row["resend_samples"]),
        (&json!({"discharged_mass": 3}), &json!(true))
    );
    let row = beat(&worker, &attempt, json!([part(0, &[8.0, 8.0])])).await;
    assert_eq!((row.get("missing_samples"), &row["resend_samples"]), (None, &json!(false)));
    assert_eq!(server.get(&path).await.expect(StatusCode::OK), so_far, "repeated samples change nothing");
    let mut uneven = part(3, &[1.0]);
    uneven["t_s"] = json!([]);
    let bad = json!({"attempts": [{"job_id": attempt["job_id"], "attempt": 1, "progress": null, "samples": [uneven]}]});
    let problem = server.post(&format!("/v1/workers/{}/heartbeat", worker.id), &bad).await;
    let problem = problem.problem(422, "invalid-document");
    assert_eq!(problem["errors"][0]["pointer"], "/attempts/0/samples/0/values");

    worker.deliver(&attempt).await.expect(StatusCode::OK);
    let whole = server.get(&path).await.expect(StatusCode::OK);
    assert_eq!((&whole["values"], &whole["partial"]), (&json!([0.0, 0.1, 1.0 / 3.0]), &json!(false)));
    server.stop().await;
}

#[tokio::test]
async fn samples_lost_in_a_restart_are_requested_again() {
    let (server, dir) = TestServer::start().await;
    let worker = server.worker("cpu").await;
    let job = server.submit(&envelope(1)).await;
    let attempt = worker.claim_one().await;
    beat(&worker, &attempt, json!([part(0, &[0.0, 1.0])])).await;
    let id = worker.id.clone();
    server.stop().await;
    let server = TestServer::on(dir.path(), |_| {}).await;
    let worker = Worker { server: &server, id };
    let row = beat(&worker, &attempt, json!([part(2, &[2.0])])).await;
    assert_eq!(
        (&row["missing_samples"], &row["resend_samples"]),
        (&json!({"discharged_mass": 0}), &json!(true))
    );
    assert_eq!(beat(&worker, &attempt, json!([part(0, &[0.0, 1.0, 2.0])])).await["resend_samples"], false);
    let path = format!("/v1/jobs/{}/series/discharged_mass", text(&job["id"]));
    assert_eq!(server.get(&path).await.expect(StatusCode::OK)["values"], json!([0.0, 1.0, 2.0]));
    server.stop().await;
}

#[tokio::test]
async fn t0_shifts_the_times_of_earlier_samples() {
    let (server, _dir) = TestServer::start().await;
    let worker = server.worker("cpu").await;
    let job = server.submit(&envelope(1)).await;
    let attempt = worker.claim_one().await;
    let path = format!("/v1/jobs/{}/series/discharged_mass", text(&job["id"]));
    let mut events = Events::open(&server, &format!("/v1/jobs/{}", text(&job["id"])), None).await;
    beat(&worker, &attempt, json!([part(0, &[0.0, 1.0, 2.0])])).await;
    let times = async || server.get(&path).await.expect(StatusCode::OK)["t_s"].clone();
    assert_eq!(times().await, json!([-0.5, -0.25, 0.0]), "they end at 0");
    let samples = async |events: &mut Events| loop {
        let event = events.next().await.unwrap();
        if event.name == "samples" {
            break event.data;
        }
    };
    let event = samples(&mut events).await;
    assert_eq!((&event["t0_s"], &event["series"]), (&Value::Null, &json!([part(0, &[0.0, 1.0, 2.0])])));

    let etag = async || poll(&server, &path, None).await.1;
    let before = etag().await;
    beat_with(&worker, &attempt, json!({"t0_s": 0.25})).await;
    assert_eq!(times().await, json!([-0.25, 0.0, 0.25]));
    assert_ne!(etag().await, before);
    let event = samples(&mut events).await;
    assert_eq!((&event["t0_s"], &event["series"]), (&json!(0.25), &json!([])), "no sample comes again");
    let before = etag().await;
    beat_with(&worker, &attempt, json!({"t0_s": 0.25})).await;
    assert_eq!(etag().await, before, "nothing has changed");
    server.stop().await;
}

#[tokio::test]
async fn workers_without_t0_can_rewrite_samples() {
    let (server, _dir) = TestServer::start().await;
    let worker = server.worker("cpu").await;
    let job = server.submit(&envelope(1)).await;
    let attempt = worker.claim_one().await;
    for values in [&[0.0, 1.0][..], &[0.0, 1.0, 2.0], &[0.0, 1.0, 2.0, 3.0]] {
        // Before this version times ended at 0, so that each heartbeat had all samples at other times.
        let t_s: Vec<f64> = (0..values.len()).map(|k| k as f64 - (values.len() - 1) as f64).collect();
        let all = json!({"name": "discharged_mass", "unit": "kg", "from": 0, "t_s": t_s, "values": values});
        let row = beat_with(&worker, &attempt, json!({"samples": [all]})).await;
        assert_eq!((&row["directive"], &row["resend_samples"]), (&json!("continue"), &json!(false)));
    }
    let path = format!("/v1/jobs/{}/series/discharged_mass", text(&job["id"]));
    assert_eq!(server.get(&path).await.expect(StatusCode::OK)["values"], json!([0.0, 1.0, 2.0, 3.0]));
    worker.deliver(&attempt).await.expect(StatusCode::OK);
    server.stop().await;
}

#[tokio::test]
async fn series_of_a_sweep_are_paged_and_thinned() {
    let (server, _dir) = TestServer::start().await;
    let document = json!({"name": "gates", "base": scenario(10), "design": {"kind": "grid"}, "replicates": 2,
        "factors": [{"pointer": "/equipment/gate_opening_m", "levels": [0.045, 0.05]}]});
    let view = server.post("/v1/sweeps", &document).await.expect(StatusCode::CREATED);
    let path = format!("/v1/sweeps/{}/series/discharged_mass", text(&view["id"]));
    let empty = server.get(&path).await.expect(StatusCode::OK);
    assert_eq!((&empty["items"], &empty["unit"]), (&json!([]), &Value::Null));
    let worker = server.worker("cpu").await;
    let attempts = worker.claim(4).await;
    for attempt in &attempts[..2] {
        worker.deliver(attempt).await.expect(StatusCode::OK);
    }
    beat(&worker, &attempts[2], json!([part(0, &[5.0])])).await;
    let page = server.get(&format!("{path}?limit=3&samples=2")).await.expect(StatusCode::OK);
    let told = |item: &Value| json!([item["point"], item["replicate"], item["partial"], item["values"]]);
    let items: Vec<_> = page["items"].as_array().unwrap().iter().map(told).collect();
    let ends = json!([0.0, 1.0 / 3.0]);
    let expected = [json!([0, 0, false, ends]), json!([0, 1, false, ends]), json!([1, 0, true, [5.0]])];
    assert_eq!((&items[..], &page["unit"]), (&expected[..], &json!("kg")));
    let rest = server.get(&format!("{path}?limit=3&cursor={}", text(&page["next_cursor"]))).await;
    let rest = rest.expect(StatusCode::OK);
    assert_eq!((&rest["items"], &rest["next_cursor"]), (&json!([]), &Value::Null));
    server.get(&format!("{path}?samples=1")).await.problem(400, "invalid-query");
    server.get(&format!("{path}?limit=201")).await.problem(400, "invalid-query");
    let problem = server.get(&path.replace("discharged_mass", "mass")).await.problem(404, "not-found");
    assert!(text(&problem["detail"]).contains("discharged_mass"), "{problem}");
    server.stop().await;
}

#[tokio::test]
async fn workers_show_progress_and_speed() {
    let (server, _dir) = TestServer::start().await;
    let worker = server.worker("cpu").await;
    server.submit(&envelope(1)).await;
    server.submit(&envelope(2)).await;
    let attempts = worker.claim(2).await;
    let shown = async || server.get("/v1/workers").await.expect(StatusCode::OK)["items"][0].clone();
    assert_eq!(shown().await["particle_steps_per_s"], Value::Null);
    worker.beat(&attempts[1], progress(0.5)).await;
    let view = shown().await;
    assert_eq!(view["running"], json!([attempts[0]["job_id"], attempts[1]["job_id"]]));
    assert_eq!((&view["progress"][0], &view["progress"][1]["fraction"]), (&Value::Null, &json!(0.5)));
    assert_eq!(view["particle_steps_per_s"], 100.0, "10 in 0.1 s");
    worker.beat(&attempts[0], progress(0.1)).await;
    assert_eq!(shown().await["particle_steps_per_s"], 200.0);
    server.stop().await;
}
