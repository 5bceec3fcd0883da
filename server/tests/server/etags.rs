//! Etags: unchanged answers are 304.

use std::time::Duration;

use reqwest::StatusCode;
use serde_json::json;

use super::test_server::*;

/// Status, etag and body of a poll.
pub(crate) async fn poll(server: &TestServer, path: &str, seen: Option<&str>) -> (u16, String, String) {
    let mut request = server.http.get(format!("http://{}{path}", server.address));
    if let Some(tag) = seen {
        request = request.header("if-none-match", tag);
    }
    let response = request.send().await.unwrap();
    let tag = response.headers().get("etag").map_or("", |tag| tag.to_str().unwrap()).to_owned();
    (response.status().as_u16(), tag, response.text().await.unwrap())
}

#[tokio::test]
async fn unchanged_answers_are_304() {
    let (server, dir) = TestServer::start().await;
    let spec =
        json!({"name": "a", "base": scenario(1), "design": {"kind": "grid"}, "factors": [], "replicates": 3});
    let sweep = server.post("/v1/sweeps", &spec).await.expect(StatusCode::CREATED);
    let other = server.submit(&envelope(50)).await;
    let worker = server.worker("cpu").await;
    let sweep = format!("/v1/sweeps/{}", text(&sweep["id"]));
    let mut attempts = worker.claim(3).await;
    let job = format!("/v1/jobs/{}", text(&attempts[0]["job_id"]));
    let paths = [
        "/v1/jobs",
        "/v1/sweeps",
        "/v1/workers",
        "/v1/meshes",
        &job,
        &sweep,
        &format!("{sweep}/jobs"),
        &format!("{sweep}/results"),
    ]
    .map(str::to_owned);
    let mut tags = Vec::new();
    for path in &paths {
        let (status, tag, _) = poll(&server, path, None).await;
        assert!(status == 200 && tag.len() > 4, "{path}: {status} {tag}");
        assert_eq!(poll(&server, path, Some(&tag)).await, (304, tag.clone(), String::new()), "{path}");
        assert_eq!(
            poll(&server, path, Some(&format!("\"x\", W/{tag}"))).await.0,
            304,
            "{path}: among others"
        );
        tags.push(tag);
    }
    let changed = async |tags: &mut Vec<String>, what: &str, expected: &[&str]| {
        for (path, tag) in paths.iter().zip(tags) {
            let (status, newest, _) = poll(&server, path, Some(tag)).await;
            let is_expected = expected.iter().any(|part| path == part);
            assert_eq!(status, if is_expected { 200 } else { 304 }, "{path} after {what}");
            *tag = newest;
        }
    };
    let of_sweep: Vec<&str> =
        paths.iter().filter(|path| path.starts_with(&sweep)).map(String::as_str).collect();
    let with = |more: &[&'static str], job: Option<&'static str>| -> Vec<&str> {
        let mut all = of_sweep.clone();
        all.extend(more);
        all.extend(job);
        all
    };
    let job: &'static str = job.clone().leak();
    changed(&mut tags, "nothing", &[]).await;
    worker.beat(&attempts[0], progress(0.3)).await;
    changed(&mut tags, "progress", &with(&["/v1/jobs", "/v1/sweeps", "/v1/workers"], Some(job))).await;
    tokio::time::sleep(Duration::from_millis(5)).await;
    worker.beat(&attempts[0], progress(0.3)).await;
    changed(&mut tags, "a heartbeat without progress", &["/v1/workers"]).await;
    worker.deliver(&attempts.remove(0)).await.expect(StatusCode::OK);
    changed(&mut tags, "a result", &with(&["/v1/jobs", "/v1/sweeps", "/v1/workers"], Some(job))).await;
    let cancel = format!("/v1/jobs/{}/cancel", text(&other["id"]));
    server.post(&cancel, &json!({})).await.expect(StatusCode::OK);
    changed(&mut tags, "an event of another sweep", &["/v1/jobs", "/v1/sweeps", "/v1/workers"]).await;
    server.submit(&envelope(60)).await;
    changed(&mut tags, "a submission", &["/v1/jobs", "/v1/sweeps"]).await;
    assert_eq!(poll(&server, "/v1/jobs", Some("*")).await.0, 304, "whatever its content");
    for seen in [None, Some("*")] {
        assert_eq!(poll(&server, "/v1/jobs/01890000-0000-7000-8000-000000000000", seen).await.0, 404);
    }
    let tag = poll(&server, &sweep, None).await.1;
    server.stop().await;

    let server = TestServer::on(dir.path(), |_| {}).await;
    assert_eq!(poll(&server, &sweep, Some(&tag)).await.0, 200, "progress is counted anew after a restart");
    server.stop().await;
}

#[tokio::test]
async fn extension_and_deletion_change_the_etag() {
    let (server, _dir) = TestServer::start().await;
    let sweep =
        |seed| json!({"name": "a", "base": scenario(seed), "design": {"kind": "grid"}, "factors": []});
    let first = server.post("/v1/sweeps", &sweep(1)).await.expect(StatusCode::CREATED);
    let second = server.post("/v1/sweeps", &sweep(2)).await.expect(StatusCode::CREATED);
    let path = |sweep: &serde_json::Value| format!("/v1/sweeps/{}", text(&sweep["id"]));
    let (first, second) = (path(&first), path(&second));
    let (_, tag, _) = poll(&server, &first, None).await;
    server.post(&format!("{first}/extend"), &json!({"replicates": 1})).await.expect(StatusCode::OK);
    assert_eq!(poll(&server, &first, Some(&tag)).await.0, 200, "it has grown");
    // The newest job stays: the version is more than its number.
    server.post("/v1/sweeps", &sweep(3)).await.expect(StatusCode::CREATED);
    for gone in [&first, &second] {
        server.post(&format!("{gone}/cancel"), &json!({})).await.expect(StatusCode::OK);
        let (_, all, _) = poll(&server, "/v1/sweeps", None).await;
        let (_, tag, _) = poll(&server, gone, None).await;
        server.send(reqwest::Method::DELETE, gone, None).await.expect(StatusCode::OK);
        assert_eq!(poll(&server, "/v1/sweeps", Some(&all)).await.0, 200, "one is gone");
        assert_eq!(poll(&server, gone, Some(&tag)).await.0, 404);
    }
    server.stop().await;
}

#[tokio::test]
async fn pruning_changes_the_etag_of_listings() {
    let (server, _dir) = TestServer::start().await;
    let ended = server.submit(&envelope(1)).await;
    server.submit(&envelope(2)).await;
    let path = format!("/v1/jobs/{}", text(&ended["id"]));
    server.post(&format!("{path}/cancel"), &json!({})).await.expect(StatusCode::OK);
    let (_, job, _) = poll(&server, &path, None).await;
    let (_, all, _) = poll(&server, "/v1/jobs", None).await;
    // Jobs that ended in this millisecond are not older than now.
    tokio::time::sleep(Duration::from_millis(5)).await;
    let gone = server.post("/v1/prune?older_than_s=0", &json!({})).await.expect(StatusCode::OK);
    assert_eq!(gone["jobs"], 1);
    assert_eq!(poll(&server, "/v1/jobs", Some(&all)).await.0, 200, "one is gone");
    assert_eq!(poll(&server, &path, Some(&job)).await.0, 404);
    server.stop().await;
}
