//! Idempotency keys: a repeat creates nothing and gets the first answer.

use std::collections::HashSet;

use reqwest::StatusCode;
use serde_json::{Value, json};

use super::database;
use super::test_server::*;

struct Sent {
    status: u16,
    replayed: bool,
    location: Option<String>,
    body: Value,
}

async fn send(server: &TestServer, path: &str, key: &str, body: &Value) -> Sent {
    let request = server.http.post(format!("http://{}{path}", server.address));
    let response = request.header("Idempotency-Key", key).json(body).send().await.unwrap();
    let header = |name: &str| response.headers().get(name).map(|value| value.to_str().unwrap().to_owned());
    Sent {
        status: response.status().as_u16(),
        replayed: header("idempotency-replayed").is_some(),
        location: header("location"),
        body: response.json().await.unwrap(),
    }
}

async fn count(server: &TestServer, listing: &str) -> usize {
    server.get(listing).await.expect(StatusCode::OK)["items"].as_array().unwrap().len()
}

#[tokio::test]
async fn repeat_gets_the_first_answer_and_creates_nothing() {
    let (server, dir) = TestServer::start().await;
    let sweep = json!({"name": "a", "base": scenario(1), "design": {"kind": "grid"}, "factors": []});
    for (path, body, status) in [("/v1/jobs", envelope(1), 202), ("/v1/sweeps", sweep, 201)] {
        let first = send(&server, path, "one", &body).await;
        assert_eq!((first.status, first.replayed), (if path == "/v1/jobs" { status } else { 422 }, false));
        let key = format!("key of {path}");
        let first = send(&server, path, &key, &body).await;
        assert_eq!((first.status, first.replayed), (status, false), "{}", first.body);
        let before = count(&server, path).await;
        // Even if the job has changed since.
        server.worker("cpu").await.claim(64).await;
        let again = send(&server, path, &key, &body).await;
        assert_eq!((again.status, again.replayed), (status, true));
        assert_eq!((&again.body, &again.location), (&first.body, &first.location));
        assert_eq!(count(&server, path).await, before);
    }
    server.stop().await;

    let server = TestServer::on(dir.path(), |_| {}).await;
    let again = send(&server, "/v1/jobs", "one", &envelope(1)).await;
    assert_eq!((again.status, again.replayed), (202, true), "a restart forgets nothing");
    server.stop().await;
}

#[tokio::test]
async fn sweep_is_extended_once_per_key() {
    let (server, dir) = TestServer::start().await;
    let factors = json!([{"pointer": "/equipment/gate_opening_m", "levels": [0.05]}]);
    let sweep = json!({"name": "a", "base": scenario(1), "design": {"kind": "grid"}, "factors": factors});
    let sweep = server.post("/v1/sweeps", &sweep).await.expect(StatusCode::CREATED);
    let path = format!("/v1/sweeps/{}", text(&sweep["id"]));
    let route = format!("{path}/extend");
    // A second extension by this level would be a fault: the level exists already.
    let body = json!({"levels": {"/equipment/gate_opening_m": [0.06]}});
    let first = send(&server, &route, "more", &body).await;
    assert_eq!((first.status, &first.body["points"]), (200, &json!(2)), "{}", first.body);
    let again = send(&server, &route, "more", &body).await;
    assert_eq!((again.status, again.replayed, &again.body), (200, true, &first.body));
    server.stop().await;

    // The server was killed after the extension and before it stored the answer.
    database::execute(dir.path(), "UPDATE submissions SET status = NULL, body = NULL").await;
    let server = TestServer::on(dir.path(), |_| {}).await;
    let again = send(&server, &route, "more", &body).await;
    assert_eq!(
        (again.status, again.replayed, &again.body["points"]),
        (200, false, &json!(2)),
        "{}",
        again.body
    );
    server.stop().await;
}

#[tokio::test]
async fn other_request_with_the_same_key_is_refused() {
    let (server, _dir) = TestServer::start().await;
    assert_eq!(send(&server, "/v1/jobs", "one", &envelope(1)).await.status, 202);
    let other = send(&server, "/v1/jobs", "one", &envelope(2)).await;
    assert_eq!((other.status, &other.body["type"]), (422, &json!("/problems/idempotency-key-reused")));
    assert_eq!(count(&server, "/v1/jobs").await, 1);
    for key in ["", &"x".repeat(256)] {
        let refused = send(&server, "/v1/jobs", key, &envelope(3)).await;
        assert_eq!(
            (refused.status, &refused.body["type"]),
            (400, &json!("/problems/invalid-idempotency-key"))
        );
    }
    server.stop().await;
}

#[tokio::test]
async fn corrected_request_may_use_the_same_key() {
    let (server, _dir) = TestServer::start().await;
    let mut wrong = envelope(1);
    wrong["priority"] = json!("high");
    assert_eq!(send(&server, "/v1/jobs", "one", &wrong).await.status, 422);
    assert_eq!(send(&server, "/v1/jobs", "one", &envelope(1)).await.status, 202);
    server.stop().await;
}

#[tokio::test]
async fn concurrent_repeats_create_one_job() {
    let (server, _dir) = TestServer::start().await;
    let sent = eight_copies(&server).await;
    assert_eq!(sent.iter().map(|sent| sent.status).collect::<HashSet<_>>(), HashSet::from([202]));
    let made: HashSet<_> = sent.iter().map(|sent| sent.body["id"].to_string()).collect();
    assert_eq!((made.len(), count(&server, "/v1/jobs").await), (1, 1));
    server.stop().await;
}

/// Eight concurrent copies of a request.
async fn eight_copies(server: &TestServer) -> Vec<Sent> {
    let body = envelope(1);
    let one = || send(server, "/v1/jobs", "one", &body);
    let (a, b, c, d, e, f, g, h) = tokio::join!(one(), one(), one(), one(), one(), one(), one(), one());
    vec![a, b, c, d, e, f, g, h]
}

#[tokio::test]
async fn repeat_of_a_large_sweep_waits_for_the_first() {
    let (server, _dir) = TestServer::start().await;
    let sweep = json!({"name": "a", "base": scenario(1), "design": {"kind": "grid"}, "factors": [], "replicates": 3000});
    let again = || send(&server, "/v1/sweeps", "one", &sweep);
    let (first, second, third) = tokio::join!(again(), again(), again());
    for sent in [&first, &second, &third] {
        assert_eq!((sent.status, &sent.body["counts"]["queued"]), (201, &json!(3000)), "{}", sent.body);
        assert_eq!(sent.body["id"], first.body["id"]);
    }
    assert_eq!(count(&server, "/v1/sweeps").await, 1);
    server.stop().await;
}
