//! Fills that jobs share: one attempt computes each, the others wait or are passed over, and the server keeps it by content.

use std::time::{Duration, Instant};

use reqwest::{Method, StatusCode};
use roost_api::checkpoint::MEDIA_TYPE;
use roost_api::ids::WorkerId;
use serde_json::{Value, json};

use super::frames::files;
use super::test_server::*;

/// A job of a fill: the opening of the gate acts after it, the seed before.
fn job(seed: u64, gate_m: f64) -> Value {
    let mut envelope = envelope(seed);
    envelope["scenario"]["equipment"] = json!({"gate_opening_m": gate_m});
    envelope
}

fn fill_path(attempt: &Value) -> String {
    format!("/v1/jobs/{}/attempts/{}/fill", text(&attempt["job_id"]), attempt["attempt"])
}

impl Worker<'_> {
    /// Claims jobs as a worker that shares fills.
    pub(crate) async fn claim_sharing(&self, max_jobs: u32, wait_s: f64) -> Vec<Value> {
        let mut request = self.claim_request(max_jobs, wait_s);
        request["shares_fills"] = json!(true);
        let reply = self.server.post("/v1/claims", &request).await.expect(StatusCode::OK);
        reply["attempts"].as_array().unwrap().clone()
    }

    fn fill_part(&self, attempt: &Value, whole: &[u8], offset: usize) -> String {
        let (digest, bytes) = (blake3::hash(whole).to_hex(), whole.len());
        format!("{}?worker_id={}&bytes={bytes}&digest={digest}&offset={offset}", fill_path(attempt), self.id)
    }

    /// Uploads a fill in one part.
    pub(crate) async fn fill(&self, attempt: &Value, whole: &[u8]) -> TestResponse {
        self.server.put(&self.fill_part(attempt, whole, 0), MEDIA_TYPE, whole.to_vec()).await
    }

    async fn withdraw(&self, attempt: &Value, query: &str) -> TestResponse {
        let path = format!("{}?worker_id={}{query}", fill_path(attempt), self.id);
        self.server.send(Method::DELETE, &path, None).await
    }
}

async fn download(server: &TestServer, attempt: &Value) -> (u16, Vec<u8>) {
    let url = format!("http://{}{}", server.address, fill_path(attempt));
    let answer = server.http.get(url).send().await.unwrap();
    (answer.status().as_u16(), answer.bytes().await.unwrap().to_vec())
}

/// The jobs of attempts.
fn jobs(attempts: &[Value]) -> Vec<&str> {
    attempts.iter().map(|attempt| text(&attempt["job_id"])).collect()
}

/// Submits jobs of these seeds and gates, and returns their identifiers.
async fn submit(server: &TestServer, of: &[(u64, f64)]) -> Vec<String> {
    let mut ids = Vec::new();
    for (seed, gate_m) in of {
        ids.push(text(&server.submit(&job(*seed, *gate_m)).await["id"]).to_owned());
    }
    ids
}

#[tokio::test]
async fn one_attempt_computes_a_fill_and_the_others_wait_until_it_is_stored() {
    let (server, _dir) = TestServer::start().await;
    let (first, second) = (server.worker("cpu").await, server.worker("cpu").await);
    let ids = submit(&server, &[(1, 0.04), (1, 0.05), (2, 0.04), (2, 0.05), (1, 0.06)]).await;
    let got = first.claim_sharing(4, 0.0).await;
    assert_eq!(jobs(&got), [&*ids[0], &*ids[2]], "one of each fill, in one claim");
    assert_eq!(got[0]["fill"], json!({"stored": null, "limit_bytes": 256 << 20}));
    assert_eq!(second.claim_sharing(4, 0.0).await, [Value::Null; 0]);
    // A worker that shares no fills takes any job.
    assert_eq!(jobs(&second.claim(1).await), [&*ids[1]]);

    let waiting = async { second.claim_sharing(4, 20.0).await };
    let uploading = async {
        tokio::time::sleep(Duration::from_millis(300)).await;
        first.fill(&got[0], b"the fill of seed 1").await.expect(StatusCode::OK)
    };
    let (woken, receipt) = tokio::join!(waiting, uploading);
    assert_eq!(receipt, json!({"received": 18, "recorded": true}));
    assert_eq!(jobs(&woken), [&*ids[4]], "woken by the upload");
    let digest = blake3::hash(b"the fill of seed 1").to_hex().to_string();
    assert_eq!(woken[0]["fill"]["stored"], json!({"bytes": 18, "digest": digest}));
    assert_eq!(download(&server, &woken[0]).await, (200, b"the fill of seed 1".to_vec()));
    assert_eq!(download(&server, &got[1]).await.0, 404, "seed 2 has none yet");
    let again = second.fill(&woken[0], b"another").await.expect(StatusCode::OK);
    assert_eq!(again, json!({"received": 7, "recorded": false}), "the first one stays");
    server.stop().await;
}

#[tokio::test]
async fn a_fill_whose_attempt_ends_in_any_way_goes_to_the_next_job() {
    for end in ["released", "unstable", "cancelled", "result", "lost"] {
        let lease = Duration::from_secs(if end == "lost" { 5 } else { 60 });
        let (server, _dir) = TestServer::with(|config| config.lease = lease).await;
        let (first, second) = (server.worker("cpu").await, server.worker("cpu").await);
        let ids = submit(&server, &[(1, 0.04), (1, 0.05)]).await;
        let got = first.claim_sharing(2, 0.0).await.remove(0);
        assert_eq!(text(&got["job_id"]), ids[0]);
        let waiting = async { (second.claim_sharing(1, 30.0).await, Instant::now()) };
        let ending = async {
            tokio::time::sleep(Duration::from_millis(200)).await;
            match end {
                "result" => drop(first.deliver(&got).await.expect(StatusCode::OK)),
                "lost" => {}
                "cancelled" => {
                    let path = format!("/v1/jobs/{}/cancel", ids[0]);
                    server.post(&path, &json!({})).await.expect(StatusCode::OK);
                    first.fail(&got, end, None).await.expect(StatusCode::OK);
                }
                other => drop(first.fail(&got, other, None).await.expect(StatusCode::OK)),
            }
            Instant::now()
        };
        let ((next, then), ended) = tokio::join!(waiting, ending);
        assert_eq!(next.len(), 1, "{end}");
        assert_eq!(next[0]["fill"]["stored"], Value::Null, "{end}");
        assert!(
            then.duration_since(ended) < Duration::from_secs(20),
            "{end}: {:?}",
            then.duration_since(ended)
        );
        // It is the owner: the last job waits for it.
        assert_eq!(first.claim_sharing(1, 0.0).await.len(), 0, "{end}");
        server.stop().await;
    }
}

#[tokio::test]
async fn jobs_that_share_no_fill_are_not_affected() {
    let (server, _dir) = TestServer::start().await;
    let worker = server.worker("cpu").await;
    let no = |key: &str, value: Value| {
        let mut envelope = job(1, 0.05);
        envelope[key] = value;
        envelope
    };
    let mut ids = Vec::new();
    let fed = {
        let mut fed = job(1, 0.05);
        fed["scenario"]["equipment"]["shutter_while_filling"] = json!(false);
        fed
    };
    let with_frames = no("frame_interval_s", json!(0.05));
    for envelope in [job(1, 0.04), no("shared_fill", json!(false)), with_frames, fed] {
        let view = server.submit(&envelope).await;
        assert_eq!(view["shared_fill"], json!(envelope["shared_fill"] != json!(false)));
        ids.push(text(&view["id"]).to_owned());
    }
    let got = worker.claim_sharing(9, 0.0).await;
    assert_eq!(jobs(&got), ids);
    assert_eq!(got.iter().map(|it| it["fill"].is_null()).collect::<Vec<_>>(), [false, true, true, true]);
    assert_eq!(got.iter().map(|it| it["shared_fill"] == true).collect::<Vec<_>>(), [true, false, true, true]);
    let refused = worker.fill(&got[1], b"a fill").await.expect(StatusCode::OK);
    assert_eq!(refused["recorded"], false);
    server.stop().await;
    // A server that stores none.
    let (server, _dir) = TestServer::with(|config| config.fill_limit_bytes = 0).await;
    submit(&server, &[(1, 0.04), (1, 0.05)]).await;
    let got = server.worker("cpu").await.claim_sharing(9, 0.0).await;
    assert_eq!(got.iter().map(|it| &it["fill"]).collect::<Vec<_>>(), [&Value::Null; 2]);
    server.stop().await;
}

#[tokio::test]
async fn other_devices_share_no_fill() {
    let (server, _dir) = TestServer::start().await;
    let first = server.worker("cpu").await;
    let ids = submit(&server, &[(1, 0.04), (1, 0.05), (1, 0.06)]).await;
    let got = first.claim_sharing(3, 0.0).await;
    assert_eq!(jobs(&got), [&*ids[0]]);
    let mut device = registration(&WorkerId::new().to_string(), "cpu");
    device["device"] = json!("another test");
    let other = server.register(&device).await;
    assert_eq!(jobs(&other.claim_sharing(3, 0.0).await), [&*ids[1]], "one for that device");
    first.fill(&got[0], b"of the first device").await.expect(StatusCode::OK);
    assert_eq!(other.claim_sharing(3, 0.0).await.len(), 0);
    assert_eq!(jobs(&first.claim_sharing(3, 0.0).await), [&*ids[2]]);
    server.stop().await;
}

#[tokio::test]
async fn a_job_with_a_checkpoint_waits_for_no_fill() {
    let (server, _dir) = TestServer::start().await;
    let worker = server.worker("cpu").await;
    let ids = submit(&server, &[(1, 0.04), (1, 0.05)]).await;
    let first = worker.claim_sharing(1, 0.0).await.remove(0);
    worker.checkpoint(&first, 1.0, b"a checkpoint").await.expect(StatusCode::OK);
    worker.fail(&first, "preempted", None).await.expect(StatusCode::OK);
    let got = worker.claim_sharing(9, 0.0).await;
    assert_eq!(jobs(&got), ids, "the first continues, the second fills");
    worker.fill(&got[1], b"a fill").await.expect(StatusCode::OK);
    server.stop().await;
}

#[tokio::test]
async fn no_job_waits_for_a_withdrawn_fill_and_an_upload_stores_it_again() {
    let (server, dir) = TestServer::start().await;
    let worker = server.worker("cpu").await;
    submit(&server, &[(1, 0.04), (1, 0.05), (1, 0.06), (1, 0.07)]).await;
    let first = worker.claim_sharing(9, 0.0).await.remove(0);
    let withdrawn = worker.withdraw(&first, "").await;
    assert_eq!(withdrawn.status, 204, "{}", withdrawn.text);
    let others = worker.claim_sharing(2, 0.0).await;
    assert_eq!(others.len(), 2, "both fill for themselves");
    worker.fill(&others[0], b"good").await.expect(StatusCode::OK);
    let last = worker.claim_sharing(1, 0.0).await.remove(0);
    let digest = text(&last["fill"]["stored"]["digest"]).to_owned();
    let stranger = server.worker("cpu").await;
    stranger.withdraw(&last, &format!("&digest={digest}")).await.problem(409, "stale-attempt");
    worker.withdraw(&last, "&digest=A").await.problem(400, "invalid-query");
    let other = blake3::hash(b"other").to_hex();
    assert_eq!(worker.withdraw(&last, &format!("&digest={other}")).await.status, 204);
    assert_eq!(download(&server, &last).await.0, 200, "another object stays");
    assert_eq!(worker.withdraw(&last, &format!("&digest={digest}")).await.status, 204);
    assert_eq!(download(&server, &last).await.0, 404);
    wait_for_objects(dir.path(), 0).await;
    worker.fill(&last, b"again").await.expect(StatusCode::OK);
    assert_eq!(download(&server, &others[1]).await, (200, b"again".to_vec()));
    server.stop().await;
}

async fn wait_for_objects(data: &std::path::Path, count: usize) {
    let deadline = Instant::now() + Duration::from_secs(20);
    while files(&data.join("objects")).len() != count {
        assert!(Instant::now() < deadline, "{:?}", files(&data.join("objects")));
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
}

#[tokio::test]
async fn stale_and_invalid_uploads_store_no_fill() {
    let (server, dir) = TestServer::with(|config| config.max_checkpoint_bytes = 1000).await;
    let worker = server.worker("cpu").await;
    submit(&server, &[(1, 0.04)]).await;
    let first = worker.claim_sharing(1, 0.0).await.remove(0);
    assert_eq!(first["fill"]["limit_bytes"], 1000);
    let stranger = server.worker("cpu").await;
    stranger.fill(&first, b"a fill").await.problem(409, "stale-attempt");
    let long = worker.fill(&first, &[7; 1001]).await.problem(413, "too-large");
    assert!(text(&long["detail"]).contains("the fill of 1001 bytes is larger than 1000 bytes"), "{long}");
    let path = worker.fill_part(&first, b"a fill", 0);
    server.put(&path, MEDIA_TYPE, b"a FILL".to_vec()).await.problem(422, "wrong-result");
    server.put(&path, "text/plain", b"a fill".to_vec()).await.problem(415, "not-checkpoint");
    for (known, wrong) in [("bytes=6", "bytes=0"), ("offset=0", "offset=6"), ("digest=", "digest=A")] {
        let path = path.replace(known, wrong);
        server.put(&path, MEDIA_TYPE, b"a fill".to_vec()).await.problem(400, "invalid-query");
    }
    // In two parts.
    let part = async |offset: usize, end: usize| {
        let path = worker.fill_part(&first, b"a fill", offset);
        server.put(&path, MEDIA_TYPE, b"a fill"[offset..end].to_vec()).await.expect(StatusCode::OK)
    };
    assert_eq!(part(0, 2).await, json!({"received": 2, "recorded": false}));
    wait_for_objects(dir.path(), 1).await;
    worker.fail(&first, "released", None).await.expect(StatusCode::OK);
    wait_for_objects(dir.path(), 0).await;
    worker.fill(&first, b"a fill").await.problem(409, "stale-attempt");
    let second = worker.claim_sharing(1, 0.0).await.remove(0);
    worker.fill(&second, b"a fill").await.expect(StatusCode::OK);
    wait_for_objects(dir.path(), 1).await;
    server.stop().await;
}

#[tokio::test]
async fn least_recently_used_fills_are_evicted_first() {
    let (server, dir) = TestServer::with(|config| config.fill_limit_bytes = 25).await;
    let worker = server.worker("cpu").await;
    submit(&server, &[(1, 0.04), (2, 0.04), (3, 0.04), (1, 0.05), (2, 0.05)]).await;
    let got = worker.claim_sharing(3, 0.0).await;
    for attempt in &got[..2] {
        worker.fill(attempt, format!("ten bytes {}", attempt["scenario"]["seed"]).as_bytes()).await;
        tokio::time::sleep(Duration::from_millis(5)).await;
    }
    // Uses the first again.
    let again = worker.claim_sharing(1, 0.0).await.remove(0);
    assert_eq!((&again["scenario"]["seed"], again["fill"]["stored"].is_null()), (&json!(1), false));
    worker.fill(&got[2], b"ten bytes 3").await.expect(StatusCode::OK);
    let stored = [
        download(&server, &got[0]).await.0,
        download(&server, &got[1]).await.0,
        download(&server, &got[2]).await.0,
    ];
    assert_eq!(stored, [200, 404, 200]);
    wait_for_objects(dir.path(), 2).await;
    let last = worker.claim_sharing(1, 0.0).await.remove(0);
    assert_eq!(last["fill"]["stored"], Value::Null, "it is computed again");
    server.stop().await;
}

#[tokio::test]
async fn result_records_the_origin_of_its_fill() {
    let (server, _dir) = TestServer::start().await;
    let worker = server.worker("cpu").await;
    let ids = submit(&server, &[(1, 0.04), (1, 0.05), (2, 0.04)]).await;
    for (id, filled_by) in ids.iter().zip([json!("attempt"), json!("shared"), Value::Null]) {
        let attempt = worker.claim_sharing(1, 0.0).await.remove(0);
        worker.fill(&attempt, b"a fill").await.expect(StatusCode::OK);
        let mut body = json!({"worker_id": worker.id, "result": result_of(&attempt["scenario"])});
        if !filled_by.is_null() {
            body["filled_by"] = filled_by.clone();
        }
        let path = format!("/v1/jobs/{id}/attempts/1/result");
        server.post(&path, &body).await.expect(StatusCode::OK);
        assert_eq!(server.job(&json!(id)).await["filled_by"], filled_by);
    }
    server.stop().await;
}

#[tokio::test]
async fn a_claim_stays_fast_while_a_long_queue_waits_for_one_fill() {
    let (server, _dir) = TestServer::start().await;
    let worker = server.worker("cpu").await;
    let gates: Vec<f64> = (0..2000).map(|k| 0.03 + 1e-5 * f64::from(k)).collect();
    let sweep = json!({"name": "one fill", "base": scenario(1), "design": {"kind": "grid"},
                       "factors": [{"pointer": "/equipment/gate_opening_m", "levels": gates}]});
    server.post("/v1/sweeps", &sweep).await.expect(StatusCode::CREATED);
    assert_eq!(worker.claim_sharing(64, 0.0).await.len(), 1);
    let other = submit(&server, &[(2, 0.04)]).await;
    assert_eq!(jobs(&worker.claim_sharing(64, 0.0).await), [&*other[0]], "other work is there");
    // Each looks at the whole queue; the best of them, since the machine may be busy.
    let mut best = Duration::MAX;
    for _ in 0..3 {
        let began = Instant::now();
        assert_eq!(worker.claim_sharing(64, 0.0).await.len(), 0);
        best = best.min(began.elapsed());
    }
    assert!(best < Duration::from_secs(2), "{best:?}");
    server.stop().await;
}
