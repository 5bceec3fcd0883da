//! Starting and stopping: what is refused, and that nothing keeps a server from ending.

use std::time::Duration;

use reqwest::StatusCode;
use roost_server::{DataError, Server, ServerConfig, ServerError};
use serde_json::json;

use super::farm::*;

#[tokio::test]
async fn an_address_that_others_can_reach_is_refused() {
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
    assert!(!dir.path().join("data").exists(), "refused before anything is made");
}

#[tokio::test]
async fn one_data_directory_has_one_server() {
    let (farm, dir) = Farm::start().await;
    let config = ServerConfig {
        listen: ([127, 0, 0, 1], 0).into(),
        data: dir.path().to_owned(),
        ..ServerConfig::default()
    };
    let error = Server::bind(config.clone()).await.err().unwrap();
    assert!(matches!(error, ServerError::Data(DataError::InUse(_))), "{error}");
    // The next server may come while the one before it is going.
    let (next, _) = tokio::join!(Server::bind(config), farm.stop());
    next.expect("free again");
}

#[tokio::test]
async fn a_taken_address_is_named() {
    let (farm, _dir) = Farm::start().await;
    let other = tempfile::tempdir().unwrap();
    let config =
        ServerConfig { listen: farm.address, data: other.path().to_owned(), ..ServerConfig::default() };
    let error = Server::bind(config).await.err().unwrap();
    assert_eq!(
        error.to_string(),
        format!("cannot listen on {}", farm.address),
        "the source speaks for itself"
    );
    assert!(!other.path().join("roost.lock").exists(), "refused before anything is made");
    farm.stop().await;
}

#[tokio::test]
async fn open_long_polls_do_not_keep_a_server() {
    let (farm, _dir) = Farm::start().await;
    let mut requests = Vec::new();
    for _ in 0..3 {
        requests.push(farm.worker("cpu").await.claim_request(1, 30.0));
    }
    let seen = async || {
        let workers = farm.get("/v1/workers").await.expect(StatusCode::OK);
        let rows = workers["items"].as_array().unwrap().iter();
        rows.map(|worker| text(&worker["last_seen_at"]).to_owned()).collect::<Vec<_>>()
    };
    let registered = seen().await;
    tokio::time::sleep(Duration::from_millis(5)).await; // times have milliseconds
    let url = format!("http://{}/v1/claims", farm.address);
    let polls: Vec<_> =
        requests.iter().map(|request| tokio::spawn(farm.http.post(&url).json(request).send())).collect();
    // A client that opens a connection and says nothing.
    let silent = tokio::net::TcpStream::connect(farm.address).await.unwrap();
    // A claim is a sign of life: once all three were seen again, the polls are open.
    while seen().await.iter().any(|time| registered.contains(time)) {
        tokio::time::sleep(Duration::from_millis(5)).await;
    }
    let took = farm.stop().await;
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
async fn a_server_says_how_it_is_and_what_it_is() {
    let (farm, _dir) = Farm::start().await;
    for path in ["/healthz", "/readyz"] {
        assert_eq!(farm.get(path).await.expect(StatusCode::OK), json!({"status": "ok"}));
    }
    let version = farm.get("/v1/version").await.expect(StatusCode::OK);
    assert_eq!(version["solver_revision"], roost_solver::SOLVER_REVISION);
    assert_eq!(version["sqlite"], "3.51.3");
    let schema = farm.get("/v1/schema/scenario").await.expect(StatusCode::OK);
    assert!(schema["properties"]["equipment"].is_object(), "{schema}");
    let table = farm.get("/v1/responses").await.expect(StatusCode::OK);
    let regime = table["responses"].as_array().unwrap().iter().find(|row| row["name"] == "regime").unwrap();
    assert_eq!((&regime["type"], &regime["headline"]), (&json!("word"), &json!(true)));
    assert_eq!((&regime["unit"], &regime["experiments"]), (&json!(""), &json!(["hopper"])));
    assert_eq!(table["series"][0]["name"], "discharged_mass");
    assert!(table["curves"].as_array().unwrap().iter().any(|row| row["over"] == "strain"), "{table}");
    farm.stop().await;
}
