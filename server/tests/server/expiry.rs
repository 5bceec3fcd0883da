//! Tokens that expire.

use std::time::{Duration, Instant};

use roost_api::time::Timestamp;
use roost_api::token::Scope;
use roost_server::NewToken;

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
    let job: serde_json::Value = job.json().await.unwrap();
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
