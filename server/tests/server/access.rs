//! Access tokens: scopes, rates, sessions, foreign pages.

use std::time::{Duration, Instant};

use reqwest::Method;
use roost_api::time::Timestamp;
use roost_api::token::Scope;
use roost_server::{Server, ServerConfig, ServerError};
use serde_json::{Value, json};

use super::database;
use super::test_server::*;

/// Status and body of a request with a token.
pub(super) async fn ask(
    server: &TestServer,
    method: Method,
    path: &str,
    token: Option<&str>,
    body: Option<&Value>,
) -> (u16, String) {
    let mut request = server.http.request(method, format!("http://{}{path}", server.address));
    if let Some(token) = token {
        request = request.bearer_auth(token);
    }
    if let Some(body) = body {
        request = request.json(body);
    }
    let response = request.send().await.unwrap();
    (response.status().as_u16(), response.text().await.unwrap())
}

async fn get(server: &TestServer, path: &str, token: Option<&str>) -> (u16, String) {
    ask(server, Method::GET, path, token, None).await
}

#[tokio::test]
async fn every_request_needs_a_token_with_its_scope() {
    let dir = tempfile::tempdir().unwrap();
    let mut tokens = database::tokens(dir.path(), true).await.unwrap();
    let mut secrets = Vec::new();
    for scope in [Scope::Admin, Scope::Submit, Scope::Read, Scope::Worker] {
        secrets.push(tokens.create(scope.as_str(), &[scope], Timestamp::now()).await.unwrap().1);
    }
    tokens.close().await.unwrap();
    let server = TestServer::on(dir.path(), |_| {}).await;
    for open in ["/healthz", "/readyz", "/openapi.json"] {
        assert_eq!(get(&server, open, None).await.0, 200, "{open}");
    }
    let job = envelope(1);
    let worker = registration(&roost_api::ids::WorkerId::new().to_string(), "cpu");
    let nobody = roost_api::ids::WorkerId::new();
    let drain = format!("/v1/workers/{nobody}/drain");
    for (method, path, body, expected) in [
        // The status without a token, and with each of the four.
        (Method::GET, "/v1/jobs", None, [401, 200, 200, 200, 403]),
        (Method::GET, "/v1/version", None, [401, 200, 200, 200, 200]),
        (Method::POST, "/v1/jobs", Some(&job), [401, 202, 202, 403, 403]),
        (Method::POST, "/v1/workers", Some(&worker), [401, 200, 403, 403, 200]),
        (Method::POST, drain.as_str(), None, [401, 404, 403, 403, 403]),
        (Method::POST, "/v1/validate", Some(&job), [401, 200, 200, 200, 403]),
        // No study: that is for those who may ask.
        (Method::POST, "/v1/studies/validate", Some(&job), [401, 422, 422, 422, 403]),
    ] {
        let mut answers = vec![ask(&server, method.clone(), path, None, body).await.0];
        for secret in &secrets {
            answers.push(ask(&server, method.clone(), path, Some(secret), body).await.0);
        }
        assert_eq!(answers, expected, "{method} {path}");
    }
    let (status, text) = get(&server, "/v1/jobs", Some("roost_guessed")).await;
    assert!(status == 401 && text.contains("/problems/unauthorized"), "{text}");
    let (_, text) = get(&server, "/v1/jobs", Some(&secrets[3])).await;
    assert!(text.contains("/problems/forbidden") && text.contains("scope read"), "{text}");
    assert_eq!(get(&server, "/v1/nothing", None).await.0, 404);
    server.stop().await;
}

#[tokio::test]
async fn running_server_follows_created_and_revoked_tokens() {
    let (server, dir) = TestServer::with(|config| config.lease = Duration::from_secs(1)).await;
    assert_eq!(get(&server, "/v1/jobs", None).await.0, 200, "open without tokens");
    let mut tokens = database::tokens(dir.path(), true).await.unwrap();
    let (view, secret) = tokens.create("", &[Scope::Read], Timestamp::now()).await.unwrap();
    let until = async |token: Option<&str>, status: u16| {
        let deadline = Instant::now() + Duration::from_secs(20);
        while get(&server, "/v1/jobs", token).await.0 != status {
            assert!(Instant::now() < deadline, "still not {status}");
            tokio::time::sleep(Duration::from_millis(20)).await;
        }
    };
    until(None, 401).await;
    assert_eq!(get(&server, "/v1/jobs", Some(&secret)).await.0, 200);
    let (_, other) = tokens.create("", &[Scope::Read], Timestamp::now()).await.unwrap();
    assert!(tokens.revoke(&view.id, Timestamp::now()).await.unwrap());
    assert!(!tokens.revoke(&view.id, Timestamp::now()).await.unwrap(), "once");
    until(Some(&secret), 401).await;
    until(Some(&other), 200).await;
    let listed = tokens.list().await.unwrap();
    assert!(listed[1].revoked_at.is_some() && listed[0].revoked_at.is_none());
    assert!(!format!("{listed:?}").contains(&secret[6..]), "no secret is stored");
    tokens.close().await.unwrap();
    server.stop().await;
    if !database::is_postgres() {
        let database = std::fs::read(dir.path().join("roost.db")).unwrap();
        assert!(
            !database.windows(secret.len()).any(|bytes| bytes == secret.as_bytes()),
            "no secret is stored"
        );
    }
}

/// Repeats a request until it has this status: token changes take effect within a second.
async fn wait_for_status(server: &TestServer, token: Option<&str>, status: u16) {
    let deadline = Instant::now() + Duration::from_secs(20);
    while get(server, "/v1/jobs", token).await.0 != status {
        assert!(Instant::now() < deadline, "still not {status}");
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
}

#[tokio::test]
async fn server_without_its_last_token_stays_closed() {
    for listen in ["127.0.0.1:0", "0.0.0.0:0"] {
        let dir = tempfile::tempdir().unwrap();
        let mut tokens = database::tokens(dir.path(), true).await.unwrap();
        let (view, secret) = tokens.create("only", &[Scope::Admin], Timestamp::now()).await.unwrap();
        tokens.close().await.unwrap();
        let set = |config: &mut ServerConfig| {
            config.listen = listen.parse().unwrap();
            config.lease = Duration::from_secs(1);
        };
        let server = TestServer::on(dir.path(), set).await;
        let (status, job) = ask(&server, Method::POST, "/v1/jobs", Some(&secret), Some(&envelope(1))).await;
        assert_eq!(status, 202, "{job}");
        let job: Value = serde_json::from_str(&job).unwrap();
        let events = format!("/v1/jobs/{}/events", text(&job["id"]));
        let url = format!("http://{}{events}", server.address);
        let mut stream = server.http.get(url).bearer_auth(&secret).send().await.unwrap();
        assert!(stream.chunk().await.unwrap().is_some(), "the first event is the job");

        let mut tokens = database::tokens(dir.path(), true).await.unwrap();
        assert!(tokens.has_valid(Timestamp::now()).await.unwrap());
        tokens.revoke(&view.id, Timestamp::now()).await.unwrap();
        assert!(!tokens.has_valid(Timestamp::now()).await.unwrap());
        tokens.close().await.unwrap();
        wait_for_status(&server, Some(&secret), 401).await;
        let ended = async { while stream.chunk().await.unwrap().is_some() {} };
        tokio::time::timeout(Duration::from_secs(10), ended).await.expect("the stream ends");
        let closed = async |server: &TestServer| {
            let closed = [
                (Method::GET, "/v1/jobs"),
                (Method::GET, &events),
                (Method::GET, "/metrics"),
                (Method::POST, "/v1/prune?older_than_s=0"),
                (Method::POST, "/dashboard/session"),
            ];
            for (method, path) in closed {
                let request = server.http.request(method.clone(), format!("http://{}{path}", server.address));
                let answer = request.header("host", "localhost").send().await.unwrap();
                assert_eq!(answer.status(), 401, "{listen}: {method} {path}");
            }
        };
        closed(&server).await;
        server.stop().await;
        if listen.starts_with("127") {
            let server = TestServer::on(dir.path(), set).await;
            closed(&server).await;
            server.stop().await;
        } else {
            let config = ServerConfig {
                listen: listen.parse().unwrap(),
                data: dir.path().to_owned(),
                database: database::of(dir.path()),
                ..ServerConfig::default()
            };
            let refused = Server::bind(config).await.err().expect("no token could be valid");
            assert!(matches!(refused, ServerError::NotLoopback(_)), "{refused}");
        }
    }
}

#[tokio::test]
async fn authentication_scheme_ignores_case() {
    let dir = tempfile::tempdir().unwrap();
    let mut tokens = database::tokens(dir.path(), true).await.unwrap();
    let (_, secret) = tokens.create("", &[Scope::Read], Timestamp::now()).await.unwrap();
    tokens.close().await.unwrap();
    let server = TestServer::on(dir.path(), |_| {}).await;
    for (sent, status) in [
        (format!("Bearer {secret}"), 200),
        (format!("bearer {secret}"), 200),
        (format!("BEARER  {secret} "), 200),
        (format!("Basic {secret}"), 401),
        (format!("Bearer{secret}"), 401),
        (secret.clone(), 401),
    ] {
        let request = server.http.get(format!("http://{}/v1/jobs", server.address));
        assert_eq!(request.header("authorization", &sent).send().await.unwrap().status(), status, "{sent}");
    }
    server.stop().await;
}

#[tokio::test]
async fn open_server_refuses_a_foreign_origin() {
    let (server, dir) = TestServer::with(|config| config.lease = Duration::from_secs(1)).await;
    let own = format!("http://{}", server.address);
    let post = async |origin: &str, site: Option<&str>, token: Option<&str>| {
        let request = server.http.post(format!("{own}/v1/prune?older_than_s=0")).header("origin", origin);
        let request = site.iter().fold(request, |request, site| request.header("sec-fetch-site", *site));
        let answer =
            token.iter().fold(request, |request, token| request.bearer_auth(token)).send().await.unwrap();
        (answer.status().as_u16(), answer.text().await.unwrap())
    };
    assert_eq!(post(&own, None, None).await.0, 200, "a page of its own");
    let other_port = "http://127.0.0.1:9";
    for foreign in ["https://evil.example", other_port, "null", "http://localhost", "nonsense"] {
        let (status, text) = post(foreign, None, None).await;
        assert!(
            status == 403 && text.contains("/problems/cross-site") && text.contains(foreign),
            "{foreign}: {text}"
        );
    }
    let read = server.http.get(format!("{own}/v1/jobs")).header("origin", "https://evil.example");
    assert_eq!(read.send().await.unwrap().status(), 403, "reading too");
    // Behind a proxy that sends `host: localhost`, the origin differs, but `sec-fetch-site` is right.
    assert_eq!(post("https://roost.example", Some("same-origin"), None).await.0, 200);

    let mut tokens = database::tokens(dir.path(), true).await.unwrap();
    let (_, secret) = tokens.create("", &[Scope::Admin], Timestamp::now()).await.unwrap();
    tokens.close().await.unwrap();
    wait_for_status(&server, None, 401).await;
    assert_eq!(post("https://evil.example", None, Some(&secret)).await.0, 200, "no page has the token");
    server.stop().await;
}

#[tokio::test]
async fn public_address_needs_a_token() {
    let dir = tempfile::tempdir().unwrap();
    let config = ServerConfig {
        listen: "0.0.0.0:0".parse().unwrap(),
        data: dir.path().to_owned(),
        database: database::of(dir.path()),
        ..ServerConfig::default()
    };
    let tokens = database::tokens(dir.path(), true).await.unwrap();
    tokens.close().await.unwrap();
    let error = Server::bind(config.clone()).await.err().unwrap();
    assert!(matches!(error, ServerError::NotLoopback(_)), "none was made: {error}");
    assert!(error.to_string().contains("roost token create"), "{error}");
    let mut tokens = database::tokens(dir.path(), true).await.unwrap();
    tokens.create("", &[Scope::Admin], Timestamp::now()).await.unwrap();
    tokens.close().await.unwrap();
    assert!(Server::bind(config).await.is_ok());
}

#[tokio::test]
async fn request_above_the_rate_gets_limit_and_retry_time() {
    let (server, _dir) = TestServer::with(|config| config.max_requests_per_s = 5).await;
    let mut answers = Vec::new();
    for _ in 0..40 {
        let response = server.http.get(format!("http://{}/v1/version", server.address)).send().await.unwrap();
        let wait = response.headers().get("retry-after").map(|value| value.to_str().unwrap().to_owned());
        answers.push((response.status().as_u16(), wait, response.text().await.unwrap()));
    }
    assert_eq!(answers[0].0, 200);
    let (_, wait, text) =
        answers.iter().find(|(status, ..)| *status == 429).expect("40 at once are too many");
    assert_eq!(wait.as_deref(), Some("1"));
    let problem: Value = serde_json::from_str(text).unwrap();
    assert_eq!(problem["type"], json!("/problems/too-many-requests"));
    assert!(text.contains("max_requests_per_s") && text.contains("exceeded 5"), "{text}");
    server.stop().await;
}

#[tokio::test]
async fn foreign_pages_change_nothing_and_open_servers_refuse_foreign_hosts() {
    let (server, dir) = TestServer::with(|config| config.lease = Duration::from_secs(1)).await;
    let at = |path: &str| format!("http://{}{path}", server.address);
    let post = |site: Option<&str>| {
        let request = server.http.post(at("/v1/prune?older_than_s=0"));
        site.iter().fold(request, |request, site| request.header("sec-fetch-site", *site))
    };
    for (site, status) in [
        (None, 200),
        (Some("same-origin"), 200),
        (Some("none"), 200),
        (Some("cross-site"), 403),
        (Some("same-site"), 403),
    ] {
        let answer = post(site).send().await.unwrap();
        assert_eq!(answer.status(), status, "{site:?}");
        let text = answer.text().await.unwrap();
        assert!(status == 200 || text.contains("/problems/cross-site"), "{text}");
    }
    let read = server.http.get(at("/v1/jobs")).header("sec-fetch-site", "cross-site").send().await.unwrap();
    assert_eq!(read.status(), 200, "a link to an own page");

    let named = async |host: &str, token: Option<&str>| {
        let request = server.http.get(at("/v1/jobs")).header("host", host);
        let request = token.into_iter().fold(request, |request, token| request.bearer_auth(token));
        let answer = request.send().await.unwrap();
        (answer.status().as_u16(), answer.text().await.unwrap())
    };
    for host in ["localhost:9", "127.0.0.1", "[::1]:80"] {
        assert_eq!(named(host, None).await.0, 200, "{host}");
    }
    let (status, text) = named("rebound.example:7373", None).await;
    assert!(
        status == 421 && text.contains("/problems/wrong-host") && text.contains("rebound.example"),
        "{text}"
    );

    let raw = async |request: &str| {
        use tokio::io::{AsyncReadExt, AsyncWriteExt};
        let mut stream = tokio::net::TcpStream::connect(server.address).await.unwrap();
        stream.write_all(request.as_bytes()).await.unwrap();
        let mut answer = [0; 12];
        stream.read_exact(&mut answer).await.unwrap();
        String::from_utf8_lossy(&answer[9..]).into_owned()
    };
    for (request, status) in [
        ("GET /v1/jobs HTTP/1.1\r\nhost: localhost\r\n\r\n", "200"),
        ("GET /v1/jobs HTTP/1.1\r\n\r\n", "421"),
        ("GET /v1/jobs HTTP/1.0\r\n\r\n", "421"),
        ("GET http://rebound.example/v1/jobs HTTP/1.1\r\nhost: localhost\r\n\r\n", "421"),
        ("GET http://rebound.example/v1/jobs HTTP/1.1\r\n\r\n", "421"),
        ("GET http://127.0.0.1/v1/jobs HTTP/1.1\r\n\r\n", "200"),
    ] {
        assert_eq!(raw(request).await, status, "{request}");
    }

    // With a token any host name is accepted, as behind a proxy.
    let mut tokens = database::tokens(dir.path(), true).await.unwrap();
    let (_, secret) = tokens.create("", &[Scope::Admin], Timestamp::now()).await.unwrap();
    tokens.close().await.unwrap();
    let deadline = Instant::now() + Duration::from_secs(20);
    while named("roost.example", Some(&secret)).await.0 != 200 {
        assert!(Instant::now() < deadline, "still not 200");
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
    assert_eq!(post(Some("cross-site")).bearer_auth(&secret).send().await.unwrap().status(), 403);
    server.stop().await;
}

#[tokio::test]
async fn session_cookie_reads_and_writes_need_the_page_header() {
    let dir = tempfile::tempdir().unwrap();
    let mut tokens = database::tokens(dir.path(), true).await.unwrap();
    let secret = tokens.create("page", &[Scope::Submit], Timestamp::now()).await.unwrap().1;
    let worker = tokens.create("worker", &[Scope::Worker], Timestamp::now()).await.unwrap().1;
    tokens.close().await.unwrap();
    let server = TestServer::on(dir.path(), |_| {}).await;
    let at = |path: &str| format!("http://{}{path}", server.address);
    let begin = async |token: &str| {
        server.http.post(at("/dashboard/session")).bearer_auth(token).send().await.unwrap()
    };
    assert_eq!(begin("wrong").await.status(), 401);
    assert_eq!(begin(&worker).await.status(), 403, "it may not read");
    let begun = begin(&secret).await;
    assert_eq!(begun.status(), 204);
    let set = begun.headers()["set-cookie"].to_str().unwrap().to_owned();
    assert!(
        set.contains("; HttpOnly") && set.contains("; SameSite=Strict") && !set.contains("Secure"),
        "{set}"
    );
    let cookie = format!("other=1; {}", set.split(';').next().unwrap());
    let read = server.http.get(at("/v1/jobs")).header("cookie", &cookie).send().await.unwrap();
    assert_eq!(read.status(), 200);
    let post = || server.http.post(at("/v1/jobs")).header("cookie", &cookie).json(&envelope(1));
    assert_eq!(post().send().await.unwrap().status(), 401, "a foreign page");
    assert_eq!(post().header("x-roost-page", "dashboard").send().await.unwrap().status(), 202);
    let ended = server.http.delete(at("/dashboard/session")).send().await.unwrap();
    assert!(ended.headers()["set-cookie"].to_str().unwrap().starts_with("roost_session=; "));
    let begun = server.http.post(at("/dashboard/session")).bearer_auth(&secret);
    let begun = begun.header("x-forwarded-proto", "https").send().await.unwrap();
    assert!(begun.headers()["set-cookie"].to_str().unwrap().ends_with("; Secure"));
    server.stop().await;
}
