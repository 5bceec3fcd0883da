//! Sign-in without a provider: which servers are open, and what they say. `tests/sign_in/main.rs` has a provider.

use std::time::Duration;

use roost_server::{Server, ServerConfig, SignInOptions, SignInSettings};
use serde_json::json;

use super::test_server::*;

#[tokio::test]
async fn a_server_with_sign_in_is_closed_and_may_listen_on_every_address() {
    let dir = tempfile::tempdir().unwrap();
    let secret = dir.path().join("client.secret");
    std::fs::write(&secret, "secret").unwrap();
    let options = SignInOptions {
        issuer: Some("https://idp.invalid".to_owned()),
        client_id: Some("roost".to_owned()),
        client_secret_file: Some(secret),
        redirect: Some("https://roost.example".to_owned()),
        allow: vec!["*=default:read".to_owned()],
        groups_claim: "groups".to_owned(),
        user_claim: "email".to_owned(),
        session: Duration::from_secs(60),
    };
    let sign_in = SignInSettings::of(&options).unwrap();
    let listen = "0.0.0.0:0".parse().unwrap();
    let data = dir.path().join("public");
    let config = ServerConfig { listen, data, sign_in: sign_in.clone(), ..ServerConfig::default() };
    assert!(Server::bind(config).await.is_ok());

    let (server, _dir) = TestServer::with(|config| config.sign_in = sign_in).await;
    assert_eq!(server.get("/v1/jobs").await.status, 401, "closed, without any token");
    assert_eq!(
        server.get("/dashboard/session").await.body,
        json!({"provider": "idp.invalid", "session": null})
    );
    server.stop().await;
}

#[tokio::test]
async fn a_server_without_provider_says_so() {
    let (server, _dir) = TestServer::start().await;
    assert_eq!(server.get("/dashboard/session").await.body, json!({"provider": null, "session": null}));
    for path in ["/dashboard/sign-in", "/dashboard/sign-in/callback?code=c&state=s"] {
        let page = server.get(path).await;
        assert!(page.status == 404 && page.text.contains("no identity provider"), "{path}: {}", page.text);
        assert_eq!(page.media_type, "text/html; charset=utf-8");
    }
    server.stop().await;
}
