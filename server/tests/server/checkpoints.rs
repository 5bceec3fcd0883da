//! Checkpoints: upload by attempts in parts, hand-over to the next worker, and deletion with the job's end.

use std::path::Path;
use std::time::{Duration, Instant};

use reqwest::{Method, StatusCode};
use roost_api::checkpoint::MEDIA_TYPE;
use roost_api::ids::WorkerId;
use serde_json::{Value, json};

use super::frames::files;
use super::test_server::*;

/// Bytes of a checkpoint.
fn checkpoint(bytes: usize, mark: u8) -> Vec<u8> {
    (0..bytes).map(|k| (k % 241) as u8 ^ mark).collect()
}

fn attempt_path(attempt: &Value) -> String {
    format!("/v1/jobs/{}/attempts/{}/checkpoint", text(&attempt["job_id"]), attempt["attempt"])
}

impl Worker<'_> {
    /// The address of a part of a checkpoint.
    fn part(&self, attempt: &Value, simulated_s: f64, whole: &[u8], offset: usize) -> String {
        let (digest, bytes) = (blake3::hash(whole).to_hex(), whole.len());
        let (path, id) = (attempt_path(attempt), &self.id);
        format!(
            "{path}?worker_id={id}&simulated_s={simulated_s}&bytes={bytes}&digest={digest}&offset={offset}"
        )
    }

    /// Uploads a checkpoint in one part.
    pub(crate) async fn checkpoint(&self, attempt: &Value, simulated_s: f64, whole: &[u8]) -> TestResponse {
        self.server.put(&self.part(attempt, simulated_s, whole, 0), MEDIA_TYPE, whole.to_vec()).await
    }
}

async fn download(server: &TestServer, attempt: &Value) -> (u16, Vec<u8>) {
    let url = format!("http://{}{}", server.address, attempt_path(attempt));
    let answer = server.http.get(url).send().await.unwrap();
    (answer.status().as_u16(), answer.bytes().await.unwrap().to_vec())
}

/// Waits until this many objects are stored.
async fn wait_for_objects(data: &Path, count: usize) {
    let deadline = Instant::now() + Duration::from_secs(20);
    while files(&data.join("objects")).len() != count {
        assert!(Instant::now() < deadline, "{:?}", files(&data.join("objects")));
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
}

#[tokio::test]
async fn the_next_worker_gets_the_newest_checkpoint() {
    let (server, dir) = TestServer::start().await;
    let worker = server.worker("cpu").await;
    let job = server.submit(&envelope(1)).await;
    let first = worker.claim_one().await;
    assert_eq!(first["checkpoints"], json!({"interval_s": 300.0, "limit_bytes": 256 << 20}));
    assert_eq!(first["checkpoint"], Value::Null);
    let (early, late) = (checkpoint(1000, 1), checkpoint(2_000_000, 2));
    for (whole, simulated_s) in [(&early, 1.5), (&late, 2.5)] {
        let receipt = worker.checkpoint(&first, simulated_s, whole).await.expect(StatusCode::OK);
        assert_eq!(receipt, json!({"received": whole.len(), "recorded": true}));
    }
    let old = worker.checkpoint(&first, 1.5, &early).await.expect(StatusCode::OK);
    assert_eq!(old["recorded"], false, "a late repeat does not replace a later checkpoint");
    wait_for_objects(dir.path(), 1).await;
    worker.fail(&first, "preempted", None).await.expect(StatusCode::OK);
    let view = server.job(&job["id"]).await;
    assert_eq!((&view["state"], &view["resumed_from_s"]), (&json!("queued"), &Value::Null));
    assert_eq!(view["checkpoint"]["simulated_s"], 2.5);

    let other = server.worker("cpu").await;
    let request = other.claim_request(1, 0.0);
    for time in ["first", "again"] {
        let second = &server.post("/v1/claims", &request).await.expect(StatusCode::OK)["attempts"][0];
        let digest = blake3::hash(&late).to_hex().to_string();
        let expected = json!({"attempt": 1, "simulated_s": 2.5, "bytes": 2_000_000, "digest": digest,
            "solver_revision": roost_solver::SOLVER_REVISION, "backend": "cpu", "device": "a test"});
        assert_eq!((&second["attempt"], &second["checkpoint"]), (&json!(2), &expected), "{time}");
    }
    let (status, bytes) = download(&server, &first).await;
    assert_eq!((status, bytes == late), (200, true));
    let view = server.job(&job["id"]).await;
    assert_eq!(view["resumed_from_s"], 2.5);
    server.stop().await;
}

#[tokio::test]
async fn a_preempted_attempt_is_no_failure() {
    let (server, _dir) = TestServer::start().await;
    let worker = server.worker("cpu").await;
    let job = server.submit(&envelope(1)).await;
    for _ in 0..6 {
        let attempt = worker.claim_one().await;
        worker.fail(&attempt, "preempted", None).await.expect(StatusCode::OK);
        let view = server.job(&job["id"]).await;
        assert_eq!((&view["state"], &view["retry_at"]), (&json!("queued"), &Value::Null));
    }
    server.stop().await;
}

#[tokio::test]
async fn a_checkpoint_is_offered_to_the_same_solver_and_device_only() {
    let (server, _dir) = TestServer::start().await;
    let worker = server.worker("cpu").await;
    server.submit(&envelope(1)).await;
    let attempt = worker.claim_one().await;
    worker.checkpoint(&attempt, 1.5, &checkpoint(10, 0)).await.expect(StatusCode::OK);
    worker.fail(&attempt, "preempted", None).await.expect(StatusCode::OK);
    let mut device = registration(&WorkerId::new().to_string(), "cpu");
    device["device"] = json!("another test");
    for other in [server.register(&device).await, server.worker("gpu").await] {
        let attempt = other.claim_one().await;
        assert_eq!(attempt["checkpoint"], Value::Null);
        let view = server.job(&attempt["job_id"]).await;
        assert_eq!((&view["resumed_from_s"], &view["checkpoint"]["attempt"]), (&Value::Null, &json!(1)));
        other.fail(&attempt, "released", None).await.expect(StatusCode::OK);
    }
    let same = server.worker("cpu").await.claim_one().await;
    assert_eq!((&same["attempt"], &same["checkpoint"]["attempt"]), (&json!(4), &json!(1)));
    server.stop().await;
}

#[tokio::test]
async fn a_stale_attempt_changes_no_checkpoint() {
    let (server, dir) = TestServer::with(|config| config.lease = Duration::from_millis(1500)).await;
    let worker = server.worker("cpu").await;
    let job = server.submit(&envelope(1)).await;
    let first = worker.claim_one().await;
    worker.checkpoint(&first, 1.0, &checkpoint(10, 1)).await.expect(StatusCode::OK);
    let stranger = server.worker("cpu").await;
    stranger.checkpoint(&first, 9.0, &checkpoint(10, 9)).await.problem(409, "stale-attempt");
    server.wait_for(&job["id"], "queued").await;
    worker.checkpoint(&first, 2.0, &checkpoint(10, 2)).await.expect(StatusCode::OK);
    let second = worker.claim_one().await;
    assert_eq!(second["checkpoint"]["simulated_s"], 2.0, "uploaded after the lease, before the next claim");
    let discard = |attempt: &Value, id: &str| format!("{}?worker_id={id}", attempt_path(attempt));
    worker.checkpoint(&first, 3.0, &checkpoint(10, 3)).await.problem(409, "stale-attempt");
    let stale = server.send(Method::DELETE, &discard(&first, &worker.id), None).await;
    stale.problem(409, "stale-attempt");
    assert_eq!(server.job(&job["id"]).await["checkpoint"]["simulated_s"], 2.0);
    assert_eq!(download(&server, &first).await, (200, checkpoint(10, 2)));
    wait_for_objects(dir.path(), 1).await;

    let gone = server.send(Method::DELETE, &discard(&second, &worker.id), None).await;
    assert_eq!(gone.status, 204, "{}", gone.text);
    let view = server.job(&job["id"]).await;
    assert_eq!((&view["checkpoint"], &view["resumed_from_s"]), (&Value::Null, &Value::Null));
    assert_eq!(download(&server, &first).await.0, 404);
    wait_for_objects(dir.path(), 0).await;
    server.stop().await;
}

#[tokio::test]
async fn interrupted_upload_is_resumed() {
    let (server, dir) = TestServer::start().await;
    let worker = server.worker("cpu").await;
    server.submit(&envelope(1)).await;
    let attempt = worker.claim_one().await;
    let whole = checkpoint(3_000_000, 5);
    let put = async |offset: usize, end: usize| {
        let path = worker.part(&attempt, 1.0, &whole, offset);
        server.put(&path, MEDIA_TYPE, whole[offset..end].to_vec()).await.expect(StatusCode::OK)
    };
    assert_eq!(put(0, 1_000_000).await, json!({"received": 1_000_000, "recorded": false}));
    // The connection breaks within the second part.
    let broken = futures_util::stream::iter([
        Ok(whole[1_000_000..1_500_000].to_vec()),
        Err(std::io::Error::other("the connection is cut")),
    ]);
    let url = format!("http://{}{}", server.address, worker.part(&attempt, 1.0, &whole, 1_000_000));
    let body = reqwest::Body::wrap_stream(broken);
    assert!(server.http.put(url).header("content-type", MEDIA_TYPE).body(body).send().await.is_err());
    // A part that is sent again, and one that leaves a gap, learn where the upload continues.
    for offset in [0, 2_000_000] {
        assert_eq!(put(offset, 3_000_000).await, json!({"received": 1_000_000, "recorded": false}));
    }
    assert_eq!(put(1_000_000, 2_000_000).await, json!({"received": 2_000_000, "recorded": false}));
    assert_eq!(download(&server, &attempt).await.0, 404, "incomplete");
    assert_eq!(put(2_000_000, 3_000_000).await, json!({"received": 3_000_000, "recorded": true}));
    assert!(download(&server, &attempt).await.1 == whole);
    wait_for_objects(dir.path(), 1).await;
    server.stop().await;
}

#[tokio::test]
async fn an_incomplete_upload_ends_with_its_attempt() {
    let (server, dir) = TestServer::start().await;
    let worker = server.worker("cpu").await;
    server.submit(&envelope(1)).await;
    let attempt = worker.claim_one().await;
    let whole = checkpoint(3000, 5);
    for mark in [1, 2] {
        let other = checkpoint(3000, mark);
        let path = worker.part(&attempt, 1.0, &other, 0);
        server.put(&path, MEDIA_TYPE, other[..1000].to_vec()).await.expect(StatusCode::OK);
    }
    wait_for_objects(dir.path(), 1).await;
    let path = worker.part(&attempt, 1.0, &whole, 0);
    server.put(&path, MEDIA_TYPE, whole[..1000].to_vec()).await.expect(StatusCode::OK);
    worker.deliver(&attempt).await.expect(StatusCode::OK);
    wait_for_objects(dir.path(), 0).await;
    server.stop().await;
}

#[tokio::test]
async fn invalid_uploads_are_refused_and_the_last_checkpoint_stays() {
    let (server, dir) = TestServer::with(|config| config.max_checkpoint_bytes = 1000).await;
    let worker = server.worker("cpu").await;
    server.submit(&envelope(1)).await;
    let attempt = worker.claim_one().await;
    let good = checkpoint(1000, 1);
    worker.checkpoint(&attempt, 1.0, &good).await.expect(StatusCode::OK);
    let long = worker.checkpoint(&attempt, 2.0, &checkpoint(1001, 2)).await.problem(413, "too-large");
    assert!(text(&long["detail"]).contains("larger than 1000 bytes (checkpoint-limit-mib"), "{long}");
    let next = checkpoint(20, 2);
    let path = worker.part(&attempt, 2.0, &next, 0);
    server.put(&path, MEDIA_TYPE, checkpoint(20, 3)).await.problem(422, "wrong-result");
    server.put(&path, MEDIA_TYPE, checkpoint(21, 2)).await.problem(422, "wrong-result");
    server.put(&path, "text/plain", next.clone()).await.problem(415, "not-checkpoint");
    for (known, wrong) in [
        ("simulated_s=2", "simulated_s=-1"),
        ("simulated_s=2", "simulated_s=inf"),
        ("bytes=20", "bytes=0"),
        ("offset=0", "offset=20"),
        ("digest=", "digest=A"),
        ("worker_id=", "worker="),
    ] {
        assert!(path.contains(known), "{path}");
        server.put(&path.replace(known, wrong), MEDIA_TYPE, next.clone()).await.problem(400, "invalid-query");
    }
    assert_eq!(download(&server, &attempt).await, (200, good));
    wait_for_objects(dir.path(), 1).await;
    server.stop().await;
}

#[tokio::test]
async fn a_checkpoint_is_deleted_when_its_job_ends() {
    let (server, dir) = TestServer::start().await;
    let worker = server.worker("cpu").await;
    for (seed, end) in (1..).zip(["result", "cancel while running", "cancel in the queue", "unstable"]) {
        let job = server.submit(&envelope(seed)).await;
        let attempt = worker.claim_one().await;
        worker.checkpoint(&attempt, 1.0, &checkpoint(50, seed as u8)).await.expect(StatusCode::OK);
        wait_for_objects(dir.path(), 1).await;
        let cancel = async || {
            let path = format!("/v1/jobs/{}/cancel", text(&job["id"]));
            server.post(&path, &json!({})).await.expect(StatusCode::OK);
        };
        match end {
            "result" => drop(worker.deliver(&attempt).await.expect(StatusCode::OK)),
            "cancel while running" => {
                cancel().await;
                worker.fail(&attempt, "cancelled", None).await.expect(StatusCode::OK);
            }
            "cancel in the queue" => {
                worker.fail(&attempt, "preempted", None).await.expect(StatusCode::OK);
                cancel().await;
            }
            other => drop(worker.fail(&attempt, other, None).await.expect(StatusCode::OK)),
        }
        let view = server.job(&job["id"]).await;
        assert!(["succeeded", "cancelled", "failed"].contains(&text(&view["state"])), "{end}: {view}");
        assert_eq!((&view["checkpoint"], download(&server, &attempt).await.0), (&Value::Null, 404), "{end}");
        wait_for_objects(dir.path(), 0).await;
    }
    server.stop().await;
}

#[tokio::test]
async fn equal_checkpoints_of_two_jobs_share_an_object() {
    let (server, dir) = TestServer::start().await;
    let worker = server.worker("cpu").await;
    let mut attempts = Vec::new();
    for seed in 1..3 {
        server.submit(&envelope(seed)).await;
        let attempt = worker.claim_one().await;
        worker.checkpoint(&attempt, 1.0, &checkpoint(50, 0)).await.expect(StatusCode::OK);
        attempts.push(attempt);
    }
    worker.deliver(&attempts[0]).await.expect(StatusCode::OK);
    // Longer than the interval of the removal.
    tokio::time::sleep(Duration::from_millis(1500)).await;
    assert_eq!(download(&server, &attempts[1]).await, (200, checkpoint(50, 0)), "another job names it");
    worker.deliver(&attempts[1]).await.expect(StatusCode::OK);
    wait_for_objects(dir.path(), 0).await;
    server.stop().await;
}

#[tokio::test]
async fn jobs_with_frames_and_servers_without_an_interval_order_no_checkpoints() {
    let (server, _dir) = TestServer::start().await;
    let worker = server.worker("cpu").await;
    let mut job = envelope(1);
    job["frame_interval_s"] = json!(0.05);
    server.submit(&job).await;
    assert_eq!(worker.claim_one().await["checkpoints"], Value::Null);
    server.stop().await;
    let (server, _dir) = TestServer::with(|config| config.checkpoint_interval = Duration::ZERO).await;
    server.submit(&envelope(1)).await;
    assert_eq!(server.worker("cpu").await.claim_one().await["checkpoints"], Value::Null);
    server.stop().await;
}
