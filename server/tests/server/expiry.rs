//! Tokens that expire or are revoked while they are used.

use std::time::{Duration, Instant};

use reqwest::Method;
use roost_api::time::Timestamp;
use roost_api::token::Scope;
use roost_server::NewToken;
use serde_json::Value;

use super::access::ask;
use super::database;
use super::test_server::*;

#[tokio::test]
async fn an_expired_token_is_refused_as_such_and_its_streams_end() {
    let dir = tempfile::tempdir().unwrap();
    let mut tokens = database::tokens(dir.path(), true).await.unwrap();
    let now = Timestamp::now();
    let new = |expires_at| NewToken {
        name: "guest",
        user: "Guest",
        project: "default",
        scopes: &[Scope::Submit],
        expires_at,
    };
    let (_, secret) = tokens.create_for(new(Some(now.plus_ms(15_000))), now).await.unwrap();
    // Without it, the streams would end because no token is valid.
    tokens.create_for(new(None), now).await.unwrap();
    tokens.close().await.unwrap();
    let server = TestServer::on(dir.path(), |_| {}).await;
    let at = |path: &str| format!("http://{}{path}", server.address);
    let job = server.http.post(at("/v1/jobs")).bearer_auth(&secret).json(&envelope(1)).send().await.unwrap();
    assert_eq!(job.status(), 202);
    let job: Value = job.json().await.unwrap();
    let events = server.http.get(at(&format!("/v1/jobs/{}/events", text(&job["id"]))));
    let mut stream = events.bearer_auth(&secret).send().await.unwrap();
    assert_eq!(stream.status(), 200);
    let deadline = Instant::now() + Duration::from_secs(60);
    let refused = loop {
        let answer = server.http.get(at("/v1/jobs")).bearer_auth(&secret).send().await.unwrap();
        if answer.status() != 200 {
            break answer;
        }
        assert!(Instant::now() < deadline, "still valid");
        tokio::time::sleep(Duration::from_millis(50)).await;
    };
    assert_eq!(refused.status(), 401);
    let text = refused.text().await.unwrap();
    assert!(text.contains("/problems/unauthorized") && text.contains("the token expired at"), "{text}");
    let ended = async { while stream.chunk().await.unwrap().is_some() {} };
    tokio::time::timeout(Duration::from_secs(30), ended).await.expect("the stream ends");
    server.stop().await;
}

#[tokio::test]
async fn event_stream_ends_when_its_token_is_revoked() {
    let dir = tempfile::tempdir().unwrap();
    let mut tokens = database::tokens(dir.path(), true).await.unwrap();
    let (view, secret) = tokens.create("", &[Scope::Submit], Timestamp::now()).await.unwrap();
    tokens.create("", &[Scope::Admin], Timestamp::now()).await.unwrap();
    tokens.close().await.unwrap();
    let server = TestServer::on(dir.path(), |config| config.lease = Duration::from_secs(1)).await;
    let (status, job) = ask(&server, Method::POST, "/v1/jobs", Some(&secret), Some(&envelope(1))).await;
    assert_eq!(status, 202, "{job}");
    let job: Value = serde_json::from_str(&job).unwrap();
    let url = format!("http://{}/v1/jobs/{}/events", server.address, text(&job["id"]));
    let mut events = server.http.get(url).bearer_auth(&secret).send().await.unwrap();
    assert!(events.chunk().await.unwrap().is_some(), "the first event is the current view");
    let more = tokio::time::timeout(Duration::from_secs(1), events.chunk()).await;
    assert!(more.is_err(), "it goes on while the token is valid");
    let mut tokens = database::tokens(dir.path(), true).await.unwrap();
    tokens.revoke(&view.id, Timestamp::now()).await.unwrap();
    tokens.close().await.unwrap();
    let ended = async { while events.chunk().await.unwrap().is_some() {} };
    tokio::time::timeout(Duration::from_secs(10), ended).await.expect("it ends");
    server.stop().await;
}
