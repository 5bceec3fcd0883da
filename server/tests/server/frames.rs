//! Frames: upload by attempts, download of ranges, deletion with their sweep.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::time::Duration;

use reqwest::header::HeaderMap;
use reqwest::{Method, StatusCode};
use roost_api::frames::MEDIA_TYPE;
use serde_json::{Value, json};

use super::test_server::*;

/// A stream of this length that starts like frames.
fn stream(bytes: usize, mark: u8) -> Vec<u8> {
    let mut stream = b"ROOSTF\r\n".to_vec();
    stream.extend((stream.len()..bytes).map(|k| (k % 251) as u8 ^ mark));
    stream
}

fn envelope_with_frames(seed: u64) -> Value {
    let mut job = envelope(seed);
    job["frame_interval_s"] = json!(0.05);
    job
}

/// Status, headers and bytes of a job's frames.
async fn fetch(server: &TestServer, job: &Value, headers: &[(&str, &str)]) -> (u16, HeaderMap, Vec<u8>) {
    let mut request = server.http.get(format!("http://{}/v1/jobs/{}/frames", server.address, text(job)));
    for (name, value) in headers {
        request = request.header(*name, *value);
    }
    let answer = request.send().await.unwrap();
    (answer.status().as_u16(), answer.headers().clone(), answer.bytes().await.unwrap().to_vec())
}

/// The files below a folder.
pub(crate) fn files(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder).into_iter().flatten() {
        let path = entry.unwrap().path();
        if path.is_dir() { found.extend(files(&path)) } else { found.push(path) }
    }
    found
}

#[tokio::test]
async fn frames_are_downloaded_whole_and_in_ranges() {
    let (server, dir) = TestServer::start().await;
    let worker = server.worker("cpu").await;
    let job = server.submit(&envelope_with_frames(1)).await;
    let attempt = worker.claim_one().await;
    assert_eq!(attempt["frames"], json!({"interval_s": 0.05, "limit_bytes": 200_000_000}));
    server.get(&format!("/v1/jobs/{}/frames", text(&job["id"]))).await.problem(404, "not-found");

    // More than one chunk is written.
    let bytes = stream(3_000_000, 0);
    let (status, receipt) =
        worker.upload_frames(&attempt, "&count=7&stopped=the%20disk", bytes.clone()).await;
    assert_eq!((status, &receipt["recorded"]), (200, &json!(true)), "{receipt}");
    let (_, receipt) = worker.upload_frames(&attempt, "&count=7", bytes.clone()).await;
    assert_eq!(receipt["recorded"], false, "a repeat changes nothing");
    let view = server.job(&job["id"]).await;
    assert_eq!(view["frames"], json!({"bytes": 3_000_000, "count": 7, "stopped": "the disk"}));

    let (status, headers, got) = fetch(&server, &job["id"], &[]).await;
    assert_eq!((status, got == bytes), (200, true));
    assert_eq!(headers["etag"], format!("\"{}\"", blake3::hash(&bytes).to_hex()).as_str());
    assert_eq!(headers["cache-control"], "no-cache", "it may run again");
    worker.deliver(&attempt).await.expect(StatusCode::OK);
    let (_, headers, _) = fetch(&server, &job["id"], &[]).await;
    assert!(headers["cache-control"].to_str().unwrap().contains("immutable"));
    assert_eq!(
        (&headers["accept-ranges"], &headers["content-length"]),
        (&"bytes".parse().unwrap(), &"3000000".parse().unwrap())
    );

    let tag = headers["etag"].to_str().unwrap();
    assert_eq!(fetch(&server, &job["id"], &[("if-none-match", tag)]).await.0, 304);
    for (range, first, last) in
        [("bytes=0-9", 0, 9), ("bytes=2999990-", 2_999_990, 2_999_999), ("bytes=-4", 2_999_996, 2_999_999)]
    {
        let (status, headers, got) = fetch(&server, &job["id"], &[("range", range)]).await;
        assert_eq!((status, &got[..]), (206, &bytes[first..=last]), "{range}");
        assert_eq!(headers["content-range"], format!("bytes {first}-{last}/3000000").as_str());
    }
    let (status, headers, _) = fetch(&server, &job["id"], &[("range", "bytes=3000000-")]).await;
    assert_eq!((status, &headers["content-range"]), (416, &"bytes */3000000".parse().unwrap()));
    let (status, _, got) = fetch(&server, &job["id"], &[("range", "bytes=-4000000")]).await;
    assert_eq!((status, got.len()), (200, 3_000_000), "the whole stream if it is shorter");
    let (status, _, got) =
        fetch(&server, &job["id"], &[("range", "bytes=0-9"), ("if-range", "\"another\"")]).await;
    assert_eq!((status, got.len()), (200, 3_000_000), "a range of another stream is useless");
    assert_eq!(files(&dir.path().join("objects")).len(), 1, "the same bytes are one object");

    // A job with a stored result has the frames of that run.
    let again = server.submit(&envelope_with_frames(1)).await;
    assert_eq!((&again["from_cache"], &again["frames"]["count"]), (&json!(true), &json!(7)));
    server.stop().await;
}

#[tokio::test]
async fn stored_result_without_frames_is_not_used_for_a_job_with_frames() {
    let (server, _dir) = TestServer::start().await;
    let worker = server.worker("cpu").await;
    server.submit(&envelope(1)).await;
    let attempt = worker.claim_one().await;
    assert_eq!(attempt["frames"], Value::Null);
    worker.deliver(&attempt).await.expect(StatusCode::OK);
    assert_eq!(server.submit(&envelope(1)).await["state"], "succeeded");
    assert_eq!(server.submit(&envelope_with_frames(1)).await["state"], "queued");
    server.stop().await;
}

#[tokio::test]
async fn invalid_or_stale_upload_is_refused_and_leaves_no_file() {
    let (server, dir) = TestServer::with(|config| {
        config.lease = Duration::from_millis(1500);
        config.max_frames_bytes = 1000;
    })
    .await;
    let worker = server.worker("cpu").await;
    let job = server.submit(&envelope_with_frames(1)).await;
    let first = worker.claim_one().await;
    for (query, body, status, kind) in [
        ("&count=1", b"%PDF-1.7".to_vec(), 422, "wrong-result"),
        ("&count=1", Vec::new(), 422, "wrong-result"),
        ("&count=1", stream(1001, 0), 413, "too-large"),
        ("&count=0", stream(10, 0), 400, "invalid-query"),
        ("&count=9007199254740992", stream(10, 0), 400, "invalid-query"),
        ("&count=18446744073709551615", stream(10, 0), 400, "invalid-query"),
        ("", stream(10, 0), 400, "invalid-query"),
    ] {
        let (seen, problem) = worker.upload_frames(&first, query, body).await;
        assert_eq!((seen, &problem["type"]), (status, &json!(format!("/problems/{kind}"))), "{problem}");
    }
    let (_, problem) = worker.upload_frames(&first, "&count=1", stream(1001, 0)).await;
    assert!(text(&problem["detail"]).contains("max_frames_bytes"), "{problem}");
    let path = |attempt: u32| {
        let (job, worker) = (text(&job["id"]), &worker.id);
        format!("/v1/jobs/{job}/attempts/{attempt}/frames?worker_id={worker}&count=1")
    };
    let problem = server.put(&path(1), "text/plain", stream(10, 0)).await.problem(415, "not-frames");
    assert!(text(&problem["detail"]).contains(MEDIA_TYPE), "{problem}");
    server.put(&path(2), MEDIA_TYPE, stream(10, 0)).await.problem(404, "not-found");
    let stranger = server.worker("cpu").await;
    assert_eq!(stranger.upload_frames(&first, "&count=1", stream(10, 0)).await.0, 409);

    assert_eq!(worker.upload_frames(&first, "&count=1", stream(20, 1)).await.0, 200);
    server.wait_for(&job["id"], "queued").await;
    let second = worker.claim_one().await;
    assert_eq!(worker.upload_frames(&first, "&count=1", stream(30, 2)).await.0, 409, "superseded");
    assert_eq!(
        server.job(&job["id"]).await["frames"],
        Value::Null,
        "the first attempt's are not the second's"
    );
    assert_eq!(fetch(&server, &job["id"], &[]).await.0, 404);
    assert_eq!(worker.upload_frames(&second, "&count=2", stream(40, 3)).await.0, 200);
    assert_eq!(fetch(&server, &job["id"], &[]).await.2, stream(40, 3));
    let left = files(&dir.path().join("objects"));
    assert!(left.iter().all(|file| !file.to_str().unwrap().contains("uploads")), "{left:?}");
    server.stop().await;
}

#[tokio::test]
async fn deleting_a_sweep_deletes_its_unshared_frames() {
    let (server, dir) = TestServer::start().await;
    let worker = server.worker("cpu").await;
    let sweep = json!({"name": "two", "base": scenario(1), "design": {"kind": "grid"}, "frame_interval_s": 0.05,
                       "factors": [{"pointer": "/equipment/gate_opening_m", "levels": [0.045, 0.06]}]});
    let view = server.post("/v1/sweeps", &sweep).await.expect(StatusCode::CREATED);
    for (mark, attempt) in (0..).zip(worker.claim(2).await) {
        assert_eq!(worker.upload_frames(&attempt, "&count=1", stream(100, mark)).await.0, 200);
        worker.deliver(&attempt).await.expect(StatusCode::OK);
    }
    // A single job that uses the result of the first one.
    let mut other = envelope_with_frames(1);
    other["scenario"]["equipment"] = json!({"gate_opening_m": 0.045});
    let other = server.submit(&other).await;
    assert_eq!(other["from_cache"], true);
    let objects = || files(&dir.path().join("objects")).len();
    assert_eq!(objects(), 2);
    let path = format!("/v1/sweeps/{}", text(&view["id"]));
    let gone = server.send(Method::DELETE, &path, None).await.expect(StatusCode::OK);
    assert_eq!(gone["frames_bytes"], 200);
    assert_eq!(objects(), 1, "the other job still names one");
    assert_eq!(fetch(&server, &other["id"], &[]).await.2, stream(100, 0));
    server.stop().await;
}

#[tokio::test]
async fn stored_frames_are_used_only_for_the_same_interval() {
    let (server, _dir) = TestServer::with(|config| config.lease = Duration::from_millis(1500)).await;
    let worker = server.worker("cpu").await;
    let first = server.submit(&envelope_with_frames(1)).await;
    let lost = worker.claim_one().await;
    assert_eq!(worker.upload_frames(&lost, "&count=1", stream(20, 1)).await.0, 200);
    server.wait_for(&first["id"], "queued").await;
    // The attempt with the result recorded no frames.
    let attempt = worker.claim_one().await;
    worker.deliver(&attempt).await.expect(StatusCode::OK);
    assert_eq!(server.submit(&envelope_with_frames(1)).await["state"], "queued", "frames of another attempt");
    let attempt = worker.claim_one().await;
    assert_eq!(worker.upload_frames(&attempt, "&count=1", stream(20, 2)).await.0, 200);
    worker.deliver(&attempt).await.expect(StatusCode::OK);
    let same = server.submit(&envelope_with_frames(1)).await;
    assert_eq!((&same["from_cache"], &same["frames"]["count"]), (&json!(true), &json!(1)));
    assert_eq!(fetch(&server, &same["id"], &[]).await.2, stream(20, 2));
    let closer = json!({"scenario": scenario(1), "frame_interval_s": 0.01});
    assert_eq!(server.submit(&closer).await["state"], "queued", "frames at a shorter interval");
    let without = server.submit(&envelope(1)).await;
    assert_eq!((&without["from_cache"], &without["frames"]), (&json!(true), &Value::Null), "nobody asked");
    server.stop().await;
}

#[tokio::test]
async fn pruning_deletes_frames() {
    let (server, dir) = TestServer::start().await;
    let worker = server.worker("cpu").await;
    server.submit(&envelope_with_frames(1)).await;
    let attempt = worker.claim_one().await;
    assert_eq!(worker.upload_frames(&attempt, "&count=1", stream(100, 0)).await.0, 200);
    worker.deliver(&attempt).await.expect(StatusCode::OK);
    let objects = || files(&dir.path().join("objects")).len();
    assert_eq!(objects(), 1);
    // Jobs that ended in this millisecond are not older than now.
    tokio::time::sleep(Duration::from_millis(5)).await;
    let gone = server.send(Method::POST, "/v1/prune?older_than_s=0", None).await.expect(StatusCode::OK);
    assert_eq!((&gone["jobs"], objects()), (&json!(1), 0), "{gone}");
    server.stop().await;
}

#[tokio::test]
async fn batched_and_repeated_claims_say_which_jobs_record_frames() {
    let (server, _dir) = TestServer::with(|config| config.max_frames_bytes = 1000).await;
    let workers = [server.worker("cpu").await, server.worker("cpu").await];
    let mut wanted = HashMap::new();
    for seed in 1..5 {
        let (job, frames) = match seed % 2 {
            0 => (envelope(seed), Value::Null),
            _ => (envelope_with_frames(seed), json!({"interval_s": 0.05, "limit_bytes": 1000})),
        };
        wanted.insert(text(&server.submit(&job).await["id"]).to_owned(), frames);
    }
    let requests = workers.each_ref().map(|worker| worker.claim_request(2, 0.0));
    for time in ["first", "again"] {
        let ask = |request| server.post("/v1/claims", request);
        let (one, other) = tokio::join!(ask(&requests[0]), ask(&requests[1]));
        let replies = [one, other].map(|reply| reply.expect(StatusCode::OK));
        let attempts = replies.iter().flat_map(|reply| reply["attempts"].as_array().unwrap());
        let told = attempts.map(|attempt| (text(&attempt["job_id"]).to_owned(), attempt["frames"].clone()));
        assert_eq!(told.collect::<HashMap<_, _>>(), wanted, "{time}");
    }
    server.stop().await;
}
