//! Frames: uploaded by the attempt that recorded them, fetched in parts, gone with their sweep.

use std::path::{Path, PathBuf};
use std::time::Duration;

use reqwest::header::HeaderMap;
use reqwest::{Method, StatusCode};
use serde_json::{Value, json};

use super::farm::*;

/// A stream of that many bytes, as far as the server looks.
fn stream(bytes: usize, mark: u8) -> Vec<u8> {
    let mut stream = b"ROOSTF\r\n".to_vec();
    stream.extend((stream.len()..bytes).map(|k| (k % 251) as u8 ^ mark));
    stream
}

fn asking(seed: u64) -> Value {
    let mut job = envelope(seed);
    job["frame_interval_s"] = json!(0.05);
    job
}

async fn upload(worker: &Worker<'_>, attempt: &Value, query: &str, body: Vec<u8>) -> (u16, Value) {
    let (job, number, farm) = (text(&attempt["job_id"]), &attempt["attempt"], worker.farm);
    let url = format!(
        "http://{}/v1/jobs/{job}/attempts/{number}/frames?worker_id={}{query}",
        farm.address, worker.id
    );
    let answer = farm.http.put(url).body(body).send().await.unwrap();
    let status = answer.status().as_u16();
    (status, answer.json().await.unwrap())
}

/// Status, headers and bytes of a job's frames.
async fn fetch(farm: &Farm, job: &Value, headers: &[(&str, &str)]) -> (u16, HeaderMap, Vec<u8>) {
    let mut request = farm.http.get(format!("http://{}/v1/jobs/{}/frames", farm.address, text(job)));
    for (name, value) in headers {
        request = request.header(*name, *value);
    }
    let answer = request.send().await.unwrap();
    (answer.status().as_u16(), answer.headers().clone(), answer.bytes().await.unwrap().to_vec())
}

/// The files under a folder.
fn files(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder).into_iter().flatten() {
        let path = entry.unwrap().path();
        if path.is_dir() { found.extend(files(&path)) } else { found.push(path) }
    }
    found
}

#[tokio::test]
async fn frames_come_back_whole_and_in_parts() {
    let (farm, dir) = Farm::start().await;
    let worker = farm.worker("cpu").await;
    let job = farm.submit(&asking(1)).await;
    let attempt = worker.claim_one().await;
    assert_eq!(attempt["frames"], json!({"interval_s": 0.05, "limit_bytes": 200_000_000}));
    farm.get(&format!("/v1/jobs/{}/frames", text(&job["id"]))).await.problem(404, "not-found");

    // More than one part is written at a time.
    let bytes = stream(3_000_000, 0);
    let (status, receipt) = upload(&worker, &attempt, "&count=7&stopped=the%20disk", bytes.clone()).await;
    assert_eq!((status, &receipt["recorded"]), (200, &json!(true)), "{receipt}");
    let (_, receipt) = upload(&worker, &attempt, "&count=7", bytes.clone()).await;
    assert_eq!(receipt["recorded"], false, "a repeat changes nothing");
    let view = farm.job(&job["id"]).await;
    assert_eq!(view["frames"], json!({"bytes": 3_000_000, "count": 7, "stopped": "the disk"}));

    let (status, headers, got) = fetch(&farm, &job["id"], &[]).await;
    assert_eq!((status, got == bytes), (200, true));
    assert_eq!(headers["etag"], format!("\"{}\"", blake3::hash(&bytes).to_hex()).as_str());
    assert_eq!(headers["cache-control"], "no-cache", "it may run again");
    worker.deliver(&attempt).await.expect(StatusCode::OK);
    let (_, headers, _) = fetch(&farm, &job["id"], &[]).await;
    assert!(headers["cache-control"].to_str().unwrap().contains("immutable"));
    assert_eq!(
        (&headers["accept-ranges"], &headers["content-length"]),
        (&"bytes".parse().unwrap(), &"3000000".parse().unwrap())
    );

    let tag = headers["etag"].to_str().unwrap();
    assert_eq!(fetch(&farm, &job["id"], &[("if-none-match", tag)]).await.0, 304);
    for (range, first, last) in
        [("bytes=0-9", 0, 9), ("bytes=2999990-", 2_999_990, 2_999_999), ("bytes=-4", 2_999_996, 2_999_999)]
    {
        let (status, headers, got) = fetch(&farm, &job["id"], &[("range", range)]).await;
        assert_eq!((status, &got[..]), (206, &bytes[first..=last]), "{range}");
        assert_eq!(headers["content-range"], format!("bytes {first}-{last}/3000000").as_str());
    }
    let (status, headers, _) = fetch(&farm, &job["id"], &[("range", "bytes=3000000-")]).await;
    assert_eq!((status, &headers["content-range"]), (416, &"bytes */3000000".parse().unwrap()));
    let (status, _, got) = fetch(&farm, &job["id"], &[("range", "bytes=-4000000")]).await;
    assert_eq!((status, got.len()), (200, 3_000_000), "all of it, where that is less");
    let (status, _, got) =
        fetch(&farm, &job["id"], &[("range", "bytes=0-9"), ("if-range", "\"another\"")]).await;
    assert_eq!((status, got.len()), (200, 3_000_000), "a part of another stream would be of no use");
    assert_eq!(files(&dir.path().join("objects")).len(), 1, "the same bytes are one object");

    // Answered from the store, it has the frames of the run that the result is of.
    let again = farm.submit(&asking(1)).await;
    assert_eq!((&again["from_cache"], &again["frames"]["count"]), (&json!(true), &json!(7)));
    farm.stop().await;
}

#[tokio::test]
async fn a_result_without_frames_does_not_answer_who_asks_for_some() {
    let (farm, _dir) = Farm::start().await;
    let worker = farm.worker("cpu").await;
    farm.submit(&envelope(1)).await;
    let attempt = worker.claim_one().await;
    assert_eq!(attempt["frames"], Value::Null);
    worker.deliver(&attempt).await.expect(StatusCode::OK);
    assert_eq!(farm.submit(&envelope(1)).await["state"], "succeeded");
    assert_eq!(farm.submit(&asking(1)).await["state"], "queued");
    farm.stop().await;
}

#[tokio::test]
async fn what_are_no_frames_of_a_living_attempt_is_refused_and_leaves_nothing() {
    let (farm, dir) = Farm::with(|config| {
        config.lease = Duration::from_millis(800);
        config.max_frames_bytes = 1000;
    })
    .await;
    let worker = farm.worker("cpu").await;
    let job = farm.submit(&asking(1)).await;
    let first = worker.claim_one().await;
    for (query, body, status, kind) in [
        ("&count=1", b"%PDF-1.7".to_vec(), 422, "wrong-result"),
        ("&count=1", Vec::new(), 422, "wrong-result"),
        ("&count=1", stream(1001, 0), 413, "too-large"),
        ("&count=0", stream(10, 0), 400, "invalid-query"),
        ("", stream(10, 0), 400, "invalid-query"),
    ] {
        let (seen, problem) = upload(&worker, &first, query, body).await;
        assert_eq!((seen, &problem["type"]), (status, &json!(format!("/problems/{kind}"))), "{problem}");
    }
    let (_, problem) = upload(&worker, &first, "&count=1", stream(1001, 0)).await;
    assert!(text(&problem["detail"]).contains("max_frames_bytes"), "{problem}");
    let stranger = farm.worker("cpu").await;
    assert_eq!(upload(&stranger, &first, "&count=1", stream(10, 0)).await.0, 409);

    assert_eq!(upload(&worker, &first, "&count=1", stream(20, 1)).await.0, 200);
    farm.wait_for(&job["id"], "queued").await;
    let second = worker.claim_one().await;
    assert_eq!(upload(&worker, &first, "&count=1", stream(30, 2)).await.0, 409, "superseded");
    assert_eq!(farm.job(&job["id"]).await["frames"], Value::Null, "the first attempt's are not the second's");
    assert_eq!(fetch(&farm, &job["id"], &[]).await.0, 404);
    assert_eq!(upload(&worker, &second, "&count=2", stream(40, 3)).await.0, 200);
    assert_eq!(fetch(&farm, &job["id"], &[]).await.2, stream(40, 3));
    let left = files(&dir.path().join("objects"));
    assert!(left.iter().all(|file| !file.to_str().unwrap().contains("uploads")), "{left:?}");
    farm.stop().await;
}

#[tokio::test]
async fn a_deleted_sweep_takes_the_frames_along_that_nobody_else_names() {
    let (farm, dir) = Farm::start().await;
    let worker = farm.worker("cpu").await;
    let sweep = json!({"name": "two", "base": scenario(1), "design": {"kind": "grid"}, "frame_interval_s": 0.1,
                       "factors": [{"pointer": "/equipment/gate_opening_m", "levels": [0.045, 0.06]}]});
    let view = farm.post("/v1/sweeps", &sweep).await.expect(StatusCode::CREATED);
    for (mark, attempt) in (0..).zip(worker.claim(2).await) {
        assert_eq!(upload(&worker, &attempt, "&count=1", stream(100, mark)).await.0, 200);
        worker.deliver(&attempt).await.expect(StatusCode::OK);
    }
    // A job of its own, answered by the first of them.
    let mut other = asking(1);
    other["scenario"]["equipment"] = json!({"gate_opening_m": 0.045});
    let other = farm.submit(&other).await;
    assert_eq!(other["from_cache"], true);
    let objects = || files(&dir.path().join("objects")).len();
    assert_eq!(objects(), 2);
    let path = format!("/v1/sweeps/{}", text(&view["id"]));
    let gone = farm.send(Method::DELETE, &path, None).await.expect(StatusCode::OK);
    assert_eq!(gone["frames_bytes"], 200);
    assert_eq!(objects(), 1, "the other job still names one");
    assert_eq!(fetch(&farm, &other["id"], &[]).await.2, stream(100, 0));
    farm.stop().await;
}
