//! What every answer has: a problem document where it is an error, and headers that keep browsers from guessing.

use reqwest::Method;
use serde_json::Value;

use super::farm::*;

#[tokio::test]
async fn every_answer_is_safe_to_show_and_every_error_is_a_problem_document() {
    let (farm, _dir) = Farm::start().await;
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
        let url = format!("http://{}{path}", farm.address);
        let answer =
            farm.http.request(Method::from_bytes(method.as_bytes()).unwrap(), url).send().await.unwrap();
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
    farm.stop().await;
}

#[tokio::test]
async fn an_answer_that_is_not_modified_changes_no_policy() {
    let (farm, _dir) = Farm::start().await;
    for path in ["/", "/v1/jobs"] {
        let get = || farm.http.get(format!("http://{}{path}", farm.address));
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
    farm.stop().await;
}

#[tokio::test]
async fn two_requests_have_two_ids_and_none_is_taken_from_the_caller() {
    let (farm, _dir) = Farm::start().await;
    let mut ids = Vec::new();
    for _ in 0..2 {
        let request =
            farm.http.get(format!("http://{}/healthz", farm.address)).header("x-request-id", "mine");
        ids.push(request.send().await.unwrap().headers()["x-request-id"].to_str().unwrap().to_owned());
    }
    assert!(ids[0] != ids[1] && !ids.contains(&"mine".to_owned()), "{ids:?}");
    farm.stop().await;
}
