//! Start and shutdown.

use std::time::{Duration, Instant};

use reqwest::StatusCode;
use roost_server::{DataError, Server, ServerConfig, ServerError};
use serde_json::json;

use super::test_server::*;

#[tokio::test]
async fn public_address_without_tokens_is_refused() {
    let dir = tempfile::tempdir().unwrap();
    for listen in ["0.0.0.0:0", "[::]:0", "192.0.2.1:80"] {
        let config = ServerConfig {
            listen: listen.parse().unwrap(),
            data: dir.path().join("data"),
            ..ServerConfig::default()
        };
        let error = Server::bind(config).await.err().unwrap();
        assert!(matches!(error, ServerError::NotLoopback(_)), "{error}");
        assert!(error.to_string().contains("loopback"), "{error}");
    }
    assert!(!dir.path().join("data").exists(), "refused before any file is created");
}

#[tokio::test]
async fn second_server_on_a_data_directory_is_refused() {
    let (server, dir) = TestServer::start().await;
    let config = ServerConfig {
        listen: ([127, 0, 0, 1], 0).into(),
        data: dir.path().to_owned(),
        ..ServerConfig::default()
    };
    let error = Server::bind(config.clone()).await.err().unwrap();
    assert!(matches!(error, ServerError::Data(DataError::InUse(_))), "{error}");
    // The next server may start while the previous one stops; a start waits a second for it.
    let next = async {
        let deadline = Instant::now() + Duration::from_secs(60);
        loop {
            match Server::bind(config.clone()).await {
                Err(ServerError::Data(DataError::InUse(_))) if Instant::now() < deadline => {}
                bound => break bound,
            }
        }
    };
    let (next, _) = tokio::join!(next, server.stop());
    next.expect("free again");
}

#[tokio::test]
async fn address_in_use_is_named() {
    let (server, _dir) = TestServer::start().await;
    let other = tempfile::tempdir().unwrap();
    let config =
        ServerConfig { listen: server.address, data: other.path().to_owned(), ..ServerConfig::default() };
    let error = Server::bind(config).await.err().unwrap();
    assert_eq!(
        error.to_string(),
        format!("cannot listen on {}", server.address),
        "the source speaks for itself"
    );
    assert!(!other.path().join("roost.lock").exists(), "refused before any file is created");
    server.stop().await;
}

#[tokio::test]
async fn open_long_polls_do_not_delay_shutdown() {
    let (server, _dir) = TestServer::with(|config| config.lease = Duration::from_secs(1)).await;
    let mut requests = Vec::new();
    for _ in 0..3 {
        requests.push(server.worker("cpu").await.claim_request(1, 30.0));
    }
    let seen = async || {
        let workers = server.get("/v1/workers").await.expect(StatusCode::OK);
        let rows = workers["items"].as_array().unwrap().iter();
        rows.map(|worker| text(&worker["last_seen_at"]).to_owned()).collect::<Vec<_>>()
    };
    let registered = seen().await;
    tokio::time::sleep(Duration::from_millis(300)).await; // a claim counts four times per lease
    let url = format!("http://{}/v1/claims", server.address);
    let polls: Vec<_> =
        requests.iter().map(|request| tokio::spawn(server.http.post(&url).json(request).send())).collect();
    // A client that opens a connection and sends nothing.
    let silent = tokio::net::TcpStream::connect(server.address).await.unwrap();
    // A claim counts as a heartbeat: after all three, the polls are open.
    while seen().await.iter().any(|time| registered.contains(time)) {
        tokio::time::sleep(Duration::from_millis(5)).await;
    }
    let took = server.stop().await;
    assert!(took < Duration::from_millis(2900), "took {took:?}, as long as the grace for what hangs");
    for poll in polls {
        let answer = poll.await.unwrap().unwrap();
        assert_eq!(answer.status(), StatusCode::OK);
        let reply: serde_json::Value = answer.json().await.unwrap();
        assert_eq!(reply["attempts"], json!([]), "answered, not cut off");
    }
    drop(silent);
}

#[tokio::test]
async fn health_readiness_and_version_are_answered() {
    let (server, _dir) = TestServer::start().await;
    for path in ["/healthz", "/readyz"] {
        assert_eq!(server.get(path).await.expect(StatusCode::OK), json!({"status": "ok"}));
    }
    let version = server.get("/v1/version").await.expect(StatusCode::OK);
    assert_eq!(version["solver_revision"], roost_solver::SOLVER_REVISION);
    assert_eq!(version["sqlite"], "3.51.3");
    let schema = server.get("/v1/schema/scenario").await.expect(StatusCode::OK);
    assert!(schema["properties"]["equipment"].is_object(), "{schema}");
    let table = server.get("/v1/responses").await.expect(StatusCode::OK);
    let regime = table["responses"].as_array().unwrap().iter().find(|row| row["name"] == "regime").unwrap();
    assert_eq!((&regime["type"], &regime["headline"]), (&json!("word"), &json!(true)));
    assert_eq!((&regime["unit"], &regime["experiments"]), (&json!(""), &json!(["hopper"])));
    assert_eq!(table["series"][0]["name"], "discharged_mass");
    assert!(table["curves"].as_array().unwrap().iter().any(|row| row["over"] == "strain"), "{table}");
    let library = server.get("/v1/parameters").await.expect(StatusCode::OK);
    let published = serde_json::to_value(roost_api::parameters::ParameterLibrary::of_this_version()).unwrap();
    assert!(library["entries"].as_array().is_some_and(|entries| entries.len() > 20) && library == published);
    server.stop().await;
}
