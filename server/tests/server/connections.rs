//! Connections of clients that send nothing, half a request or too much: other clients are still served.

use std::time::{Duration, Instant};

use reqwest::StatusCode;
use serde_json::json;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;

use super::events::Events;
use super::test_server::*;

/// An incomplete request head.
const HALF: &str = "GET /healthz HTTP/1.1\r\nhost: localhost\r\nx-more: ";

/// Maximum duration of a step, even on a busy machine.
const PATIENCE: Duration = Duration::from_secs(20);

async fn connect(server: &TestServer, text: &str) -> TcpStream {
    let mut stream = TcpStream::connect(server.address).await.unwrap();
    stream.write_all(text.as_bytes()).await.unwrap();
    stream
}

/// All bytes until the server closes the connection.
async fn read_to_end(stream: &mut TcpStream) -> String {
    let mut bytes = Vec::new();
    let read = tokio::time::timeout(PATIENCE, stream.read_to_end(&mut bytes)).await;
    // A reset also ends the connection.
    let _ = read.expect("the server closes it");
    String::from_utf8_lossy(&bytes).into_owned()
}

/// The value of a metric.
async fn metric(server: &TestServer, name: &str) -> f64 {
    let text = server.get("/metrics").await.text;
    let line = text.lines().find_map(|line| line.strip_prefix(name)?.strip_prefix(' '));
    line.unwrap_or_else(|| panic!("no {name}:\n{text}")).parse().unwrap()
}

#[tokio::test]
async fn half_requests_and_idle_connections_are_closed_in_time() {
    let timeout = Duration::from_millis(500);
    let (server, _dir) = TestServer::with(|config| config.head_timeout = timeout).await;
    let started = Instant::now();
    let mut silent = connect(&server, "").await;
    let mut half = connect(&server, HALF).await;
    let mut idle = connect(&server, "GET /healthz HTTP/1.1\r\nhost: localhost\r\n\r\n").await;
    assert_eq!(
        (read_to_end(&mut silent).await, read_to_end(&mut half).await),
        (String::new(), String::new())
    );
    let answered = read_to_end(&mut idle).await;
    assert!(answered.starts_with("HTTP/1.1 200") && answered.ends_with(r#"{"status":"ok"}"#), "{answered}");
    let took = started.elapsed();
    assert!(took > timeout / 2 && took < timeout + Duration::from_secs(9), "{took:?}");
    server.stop().await;
}

#[tokio::test]
async fn long_poll_is_not_closed_as_idle() {
    let (server, _dir) = TestServer::with(|config| config.head_timeout = Duration::from_millis(200)).await;
    let job = server.submit(&envelope(1)).await;
    let worker = server.worker("cpu").await;
    worker.claim_one().await;
    let mut events = Events::open(&server, &format!("/v1/jobs/{}", text(&job["id"])), None).await;
    assert_eq!(events.next().await.unwrap().name, "job");
    let request = worker.claim_request(1, 1.5);
    let reply = server.post("/v1/claims", &request).await.expect(StatusCode::OK);
    assert_eq!(reply["attempts"], json!([]), "still open after seven times the head timeout");
    server.post(&format!("/v1/jobs/{}/cancel", text(&job["id"])), &json!({})).await.expect(StatusCode::OK);
    assert_eq!(events.next().await.unwrap().name, "change", "still there");
    server.stop().await;
}

#[tokio::test]
async fn half_requests_are_displaced_by_new_clients() {
    let (server, _dir) = TestServer::with(|config| config.max_connections = 16).await;
    // A client that was served before the flood keeps its connection.
    let served = "GET /healthz HTTP/1.1\r\nhost: localhost\r\n\r\n";
    let mut regular = connect(&server, served).await;
    let mut buffer = [0; 1024];
    assert!(regular.read(&mut buffer).await.unwrap() > 0);
    let mut flood = Vec::new();
    for _ in 0..60 {
        flood.push(connect(&server, HALF).await);
    }
    for _ in 0..3 {
        let mut new =
            connect(&server, "GET /healthz HTTP/1.1\r\nhost: localhost\r\nconnection: close\r\n\r\n").await;
        assert!(read_to_end(&mut new).await.starts_with("HTTP/1.1 200"));
    }
    regular.write_all(served.as_bytes()).await.unwrap();
    assert!(regular.read(&mut buffer).await.unwrap() > 0, "closed before connections without a request");
    assert!(metric(&server, r#"roost_connections_refused_total{reason="no_request"}"#).await >= 45.0);
    assert_eq!(metric(&server, "roost_connections_limit").await, 16.0);
    let open = metric(&server, "roost_connections").await;
    assert!((2.0..=17.0).contains(&open), "{open}");
    assert_eq!(read_to_end(&mut flood[0]).await, "", "the oldest was closed");
    let took = server.stop().await;
    assert!(took < Duration::from_millis(2900), "half requests keep no server: {took:?}");
}

#[tokio::test]
async fn busy_server_refuses_requests_except_those_of_the_operator() {
    let (server, _dir) = TestServer::with(|config| config.max_connections = 16).await;
    let worker = server.worker("cpu").await;
    let url = format!("http://{}/v1/claims", server.address);
    let polls: Vec<_> = (0..15)
        .map(|_| tokio::spawn(server.http.post(&url).json(&worker.claim_request(1, 30.0)).send()))
        .collect();
    // The next request is the sixteenth.
    let started = Instant::now();
    let refused = loop {
        assert!(started.elapsed() < PATIENCE, "never refused");
        let answer = server.get("/v1/version").await;
        if answer.status != 200 {
            break answer;
        }
        tokio::time::sleep(Duration::from_millis(10)).await;
    };
    let problem = refused.problem(503, "unavailable");
    assert!(text(&problem["detail"]).contains("already answers 15 requests"), "{problem}");
    assert!(metric(&server, r#"roost_connections_refused_total{reason="busy"}"#).await >= 1.0);
    assert_eq!(server.get("/healthz").await.status, 200);
    server.stop().await;
    for poll in polls {
        assert_eq!(poll.await.unwrap().unwrap().status(), StatusCode::OK, "earlier requests are answered");
    }
}

#[tokio::test]
async fn event_streams_per_token_are_limited() {
    let (server, _dir) = TestServer::with(|config| config.max_connections = 64).await;
    let job = server.submit(&envelope(1)).await;
    let path = format!("/v1/jobs/{}", text(&job["id"]));
    let mut streams = Vec::new();
    for _ in 0..16 {
        streams.push(Events::open(&server, &path, None).await);
    }
    let problem = server.get(&format!("{path}/events")).await.problem(429, "too-many-requests");
    assert!(text(&problem["detail"]).contains("16 open event streams"), "{problem}");
    assert_eq!(server.get("/v1/version").await.status, 200);
    // The end of a stream frees its slot.
    streams.pop();
    let started = Instant::now();
    let url = format!("http://{}{path}/events", server.address);
    while server.http.get(&url).send().await.unwrap().status() != 200 {
        assert!(started.elapsed() < PATIENCE, "still refused");
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
    server.stop().await;
}

#[tokio::test]
async fn workers_are_answered_by_a_busy_server() {
    let (server, _dir) = TestServer::with(|config| config.max_connections = 64).await;
    let worker = server.worker("cpu").await;
    server.submit(&envelope(1)).await;
    // Requests without their bodies.
    let head = "POST /v1/jobs HTTP/1.1\r\nhost: localhost\r\ncontent-type: application/json\r\ncontent-length: 9\r\n\r\n{";
    let mut bodies = Vec::new();
    for _ in 0..60 {
        bodies.push(connect(&server, head).await);
    }
    let started = Instant::now();
    while server.get("/v1/version").await.status != 503 {
        assert!(started.elapsed() < PATIENCE, "never refused");
        tokio::time::sleep(Duration::from_millis(10)).await;
    }
    let attempt = worker.claim_one().await;
    worker.deliver(&attempt).await.expect(StatusCode::OK);
    assert_eq!(server.get("/v1/version").await.status, 503, "the bodies still take all places of others");
    server.stop().await;
}

#[tokio::test]
async fn slow_reader_is_closed_and_steady_reader_is_not() {
    let (server, _dir) = TestServer::with(|config| config.body_timeout = Duration::from_secs(5)).await;
    // One client acknowledges bytes too often for the timeout of the system; the other reads 80 kB per second.
    for (bytes, pause_ms, stays) in [(300, 100, false), (8_000, 100, true)] {
        let socket = tokio::net::TcpSocket::new_v4().unwrap();
        if !stays {
            socket.set_recv_buffer_size(4096).unwrap();
            // Small segments: a segment larger than the window would count as a client that reads nothing.
            socket2::SockRef::from(&socket).set_tcp_mss(536).unwrap();
        }
        let mut stream = socket.connect(server.address).await.unwrap();
        let ask = "GET /dashboard/plotly.min.js HTTP/1.1\r\nhost: localhost\r\n\r\n";
        stream.write_all(ask.as_bytes()).await.unwrap();
        stream.readable().await.unwrap();
        let (started, mut buffer) = (Instant::now(), vec![0; bytes]);
        let is_open = async || metric(&server, "roost_connections").await > 1.0;
        let longest = if stays { Duration::from_secs(12) } else { 2 * PATIENCE };
        while started.elapsed() < longest && is_open().await {
            // The system's buffer still has data after the server has closed.
            let _ = stream.read(&mut buffer).await;
            tokio::time::sleep(Duration::from_millis(pause_ms)).await;
        }
        assert_eq!(is_open().await, stays, "{bytes} bytes every {pause_ms} ms");
    }
    server.stop().await;
}

#[tokio::test]
async fn slow_body_is_answered_408() {
    let (server, _dir) = TestServer::with(|config| config.body_timeout = Duration::from_millis(300)).await;
    let worker = server.worker("cpu").await;
    server.submit(&envelope(1)).await;
    let attempt = worker.claim_one().await;
    let frames =
        format!("/v1/jobs/{}/attempts/1/frames?worker_id={}&count=1", text(&attempt["job_id"]), worker.id);
    for (method, path, media_type) in [
        ("POST", "/v1/jobs", "application/json"),
        ("POST", "/v1/meshes", "model/stl"),
        ("PUT", &frames, "application/octet-stream"),
    ] {
        let head = format!(
            "{method} {path} HTTP/1.1\r\nhost: localhost\r\ncontent-type: {media_type}\r\ncontent-length: 1000\r\n\r\n"
        );
        let mut stream = connect(&server, &head).await;
        // Each byte restarts the timeout.
        for _ in 0..5 {
            if stream.write_all(b"{").await.is_err() {
                break; // a busy machine let the timeout pass
            }
            tokio::time::sleep(Duration::from_millis(80)).await;
        }
        let answer = read_to_end(&mut stream).await;
        assert!(answer.starts_with("HTTP/1.1 408"), "{path}: {answer}");
        assert!(answer.contains("/problems/slow-body"), "{answer}");
    }
    server.stop().await;
}

#[tokio::test]
async fn head_above_16_kib_is_refused() {
    let (server, _dir) = TestServer::start().await;
    for (bytes, status) in [(12_000, "200"), (20_000, "431")] {
        let head = format!(
            "GET /healthz HTTP/1.1\r\nhost: localhost\r\nconnection: close\r\nx: {}\r\n\r\n",
            "x".repeat(bytes)
        );
        let mut stream = connect(&server, &head).await;
        let answer = read_to_end(&mut stream).await;
        assert!(answer.starts_with(&format!("HTTP/1.1 {status}")), "{bytes}: {answer}");
    }
    server.stop().await;
}

#[tokio::test]
async fn client_that_reads_nothing_is_closed() {
    let (server, _dir) = TestServer::with(|config| config.body_timeout = Duration::from_millis(500)).await;
    // More than the buffers of the system take.
    let ask = "GET /dashboard/plotly.min.js HTTP/1.1\r\nhost: localhost\r\n\r\n".repeat(20);
    let stalled = connect(&server, &ask).await;
    let started = Instant::now();
    stalled.readable().await.unwrap(); // its answer has begun
    while metric(&server, "roost_connections").await > 1.0 {
        assert!(started.elapsed() < PATIENCE, "still there");
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
    drop(stalled);
    server.stop().await;
}
