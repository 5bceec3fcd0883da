//! Properties of every answer: problem documents for errors, security headers, request ids.

use reqwest::Method;
use serde_json::Value;

use super::test_server::*;

#[tokio::test]
async fn every_answer_has_security_headers_and_every_error_is_a_problem_document() {
    let (server, _dir) = TestServer::start().await;
    for (method, path, status) in [
        ("GET", "/", 200),
        ("GET", "/healthz", 200),
        ("GET", "/metrics", 200),
        ("GET", "/openapi.json", 200),
        ("GET", "/docs/", 200),
        ("GET", "/docs/swagger-ui.css", 200),
        ("GET", "/docs/nothing.js", 404),
        ("GET", "/dashboard/main.js", 200),
        ("GET", "/dashboard/nothing.js", 404),
        ("GET", "/dashboard/%FF", 400),
        ("DELETE", "/dashboard/session", 204),
        ("PATCH", "/dashboard/session", 405),
        ("PATCH", "/docs/", 405),
        ("GET", "/v1/jobs", 200),
        ("GET", "/v1/jobs/nonsense", 400),
        ("GET", "/v1/jobs/%FF", 400),
        ("GET", "/v1/jobs?limit=x", 400),
        ("PUT", "/v1/jobs", 405),
        ("POST", "/v1/jobs", 415),
        ("GET", "/nothing", 404),
        ("GET", "/%FF", 404),
    ] {
        let url = format!("http://{}{path}", server.address);
        let answer =
            server.http.request(Method::from_bytes(method.as_bytes()).unwrap(), url).send().await.unwrap();
        let asked = format!("{method} {path}");
        assert_eq!(answer.status(), status, "{asked}");
        let header = |name: &str| {
            let value = answer.headers().get(name).unwrap_or_else(|| panic!("{asked}: no {name}"));
            value.to_str().unwrap().to_owned()
        };
        assert_eq!(header("x-content-type-options"), "nosniff", "{asked}");
        assert_eq!(header("referrer-policy"), "no-referrer", "{asked}");
        let policy = header("content-security-policy");
        assert!(
            policy.contains("default-src 'none'") && policy.contains("frame-ancestors 'none'"),
            "{asked}: {policy}"
        );
        assert_eq!(header("x-request-id").len(), 36, "{asked}");
        if status >= 400 {
            assert_eq!(header("content-type"), "application/problem+json", "{asked}");
            let problem: Value = serde_json::from_str(&answer.text().await.unwrap()).unwrap();
            assert_eq!(problem["status"], status, "{asked}");
            assert!(!text(&problem["detail"]).is_empty(), "{asked}");
        }
    }
    server.stop().await;
}

#[tokio::test]
async fn not_modified_answer_has_no_policy() {
    let (server, _dir) = TestServer::start().await;
    for path in ["/", "/v1/jobs"] {
        let get = || server.http.get(format!("http://{}{path}", server.address));
        let first = get().send().await.unwrap();
        let tag = first.headers()["etag"].clone();
        assert!(first.headers().contains_key("content-security-policy"), "{path}");
        let again = get().header("if-none-match", tag).send().await.unwrap();
        assert_eq!(again.status(), 304, "{path}");
        assert!(
            !again.headers().contains_key("content-security-policy"),
            "{path}: a browser would take it over"
        );
    }
    server.stop().await;
}

#[tokio::test]
async fn request_ids_are_unique_and_not_from_the_client() {
    let (server, _dir) = TestServer::start().await;
    let mut ids = Vec::new();
    for _ in 0..2 {
        let request =
            server.http.get(format!("http://{}/healthz", server.address)).header("x-request-id", "mine");
        ids.push(request.send().await.unwrap().headers()["x-request-id"].to_str().unwrap().to_owned());
    }
    assert!(ids[0] != ids[1] && !ids.contains(&"mine".to_owned()), "{ids:?}");
    server.stop().await;
}
