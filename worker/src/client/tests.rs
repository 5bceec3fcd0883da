//! Errors of the client, against canned answers that a real server rarely gives. Other tests use a real server.

use std::sync::Arc;
use std::sync::atomic::AtomicUsize;
use std::sync::atomic::Ordering::SeqCst;

use roost_api::ids::JobId;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpListener;

use super::*;

/// Starts a server that gives every request the same answer; returns its address.
pub(crate) async fn answering(status: &str, content_type: &str, body: &str) -> String {
    let (content_type, body) = (content_type.to_owned(), body.to_owned());
    let answer = (status.to_owned(), body);
    answering_by(&content_type, move |_| answer.clone()).await
}

/// Starts a server whose answer (status and body) depends on the request; returns its address.
pub(crate) async fn answering_by(
    content_type: &str,
    answer: impl Fn(&str) -> (String, String) + Clone + Send + 'static,
) -> String {
    answering_after(content_type, move |request| (Duration::ZERO, answer(request))).await
}

/// Starts a server whose answer and delay depend on the request; returns its address.
pub(crate) async fn answering_after(
    content_type: &str,
    answer: impl Fn(&str) -> (Duration, (String, String)) + Clone + Send + 'static,
) -> String {
    let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
    let address = format!("http://{}", listener.local_addr().unwrap());
    let content_type = content_type.to_owned();
    tokio::spawn(async move {
        while let Ok((mut stream, _)) = listener.accept().await {
            let (answer, content_type) = (answer.clone(), content_type.clone());
            tokio::spawn(async move {
                let request = read_request(&mut stream).await;
                let (time, (status, body)) = answer(&request);
                tokio::time::sleep(time).await;
                let length = body.len();
                let answer = format!(
                    "HTTP/1.1 {status}\r\ncontent-type: {content_type}\r\ncontent-length: {length}\r\nconnection: close\r\n\r\n{body}"
                );
                let _ = stream.write_all(answer.as_bytes()).await;
            });
        }
    });
    address
}

/// Reads one whole request: unread bytes would reset the connection on close.
async fn read_request(stream: &mut tokio::net::TcpStream) -> String {
    let mut seen = Vec::new();
    let mut buffer = [0; 4096];
    loop {
        let text = String::from_utf8_lossy(&seen).to_lowercase();
        if let Some(end) = seen.windows(4).position(|bytes| bytes == b"\r\n\r\n") {
            let head = String::from_utf8_lossy(&seen[..end]).to_lowercase();
            let length = head.lines().find_map(|line| line.strip_prefix("content-length: ")?.parse().ok());
            if seen.len() - end - 4 >= length.unwrap_or(0) {
                return text;
            }
        }
        match stream.read(&mut buffer).await {
            Ok(0) | Err(_) => return text,
            Ok(count) => seen.extend_from_slice(&buffer[..count]),
        }
    }
}

#[tokio::test]
async fn a_problem_lists_its_faults() {
    let body = r#"{"type":"/problems/invalid-scenario","title":"Invalid scenario","status":422,
        "detail":"1 fault in the scenario","errors":[{"pointer":"/product/count","value":0,
        "detail":"too small","allowed":"1 to 10000"}]}"#;
    let server = answering("422 Unprocessable Entity", "application/problem+json", body).await;
    let error = Client::new(&server).unwrap().job(JobId::new()).await.unwrap_err();
    assert_eq!(error.problem_status(), Some(422));
    assert!(!error.is_transient());
    assert_eq!(
        error.to_string(),
        "1 fault in the scenario\n  /product/count: too small (found 0); allowed: 1 to 10000"
    );
}

#[tokio::test]
async fn answers_of_other_programs_are_transient_errors() {
    let server = answering("404 Not Found", "text/html", "<h1>nginx</h1>").await;
    let error = Client::new(&server).unwrap().job(JobId::new()).await.unwrap_err();
    assert!(error.is_transient() && error.problem_status().is_none(), "{error:?}");
    assert!(error.to_string().contains("answered 404 without a reason: <h1>nginx</h1>"), "{error}");

    let server = answering("200 OK", "application/json", "[]").await;
    let error = Client::new(&server).unwrap().job(JobId::new()).await.unwrap_err();
    assert!(matches!(error, ClientError::Body { .. }), "{error:?}");
}

#[tokio::test]
async fn an_unreachable_server_is_an_error_in_one_line() {
    // No service has this port, and no connection gets it by chance.
    let port = 1;
    let client = Client::new(&format!("http://127.0.0.1:{port}/")).unwrap();
    let error = client.job(JobId::new()).await.unwrap_err();
    assert!(error.is_transient());
    let text = error.to_string();
    assert!(text.starts_with(&format!("cannot reach http://127.0.0.1:{port}: Connection refused")), "{text}");
}

#[test]
fn invalid_addresses_are_refused() {
    for text in ["127.0.0.1:7373", "localhost:7373", "ftp://a", "http://", ""] {
        assert!(matches!(Client::new(text), Err(ClientError::Address(_))), "{text}");
    }
    assert_eq!(Client::new("http://[::1]:7373/").unwrap().server(), "http://[::1]:7373");
}

/// Starts a server that never closes a connection; returns its address and the number of connections.
async fn start_keep_alive_server() -> (String, Arc<AtomicUsize>) {
    let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
    let address = format!("http://{}", listener.local_addr().unwrap());
    let connections = Arc::<AtomicUsize>::default();
    let counted = connections.clone();
    tokio::spawn(async move {
        while let Ok((mut stream, _)) = listener.accept().await {
            counted.fetch_add(1, SeqCst);
            tokio::spawn(async move {
                while !read_request(&mut stream).await.is_empty() {
                    let answer = "HTTP/1.1 200 OK\r\ncontent-length: 2\r\n\r\n{}";
                    stream.write_all(answer.as_bytes()).await.unwrap();
                }
            });
        }
    });
    (address, connections)
}

#[tokio::test]
async fn a_long_idle_connection_is_not_used_again() {
    let (server, connections) = start_keep_alive_server().await;
    let client = Client::new(&server).unwrap();
    let count_after_call = async || {
        client.drain(WorkerId::new()).await.unwrap();
        connections.load(SeqCst)
    };
    assert_eq!((count_after_call().await, count_after_call().await), (1, 1), "used again at once");
    tokio::time::sleep(MAX_IDLE + Duration::from_millis(300)).await;
    assert_eq!(count_after_call().await, 2, "the server may be closing the first one");
}
