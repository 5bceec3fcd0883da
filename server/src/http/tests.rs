//! The problem kinds of `api.md` against those of the code, the audit log against the routes, and the answer to a panic.

use axum::http::Method;

use super::problem::ProblemKind;

#[tokio::test]
async fn panic_is_answered_without_its_message() {
    let response = super::panicked(Box::new("the inside of the server"));
    assert_eq!(response.status(), 500);
    assert_eq!(response.headers()["content-type"], "application/problem+json");
    let body = axum::body::to_bytes(response.into_body(), 10_000).await.unwrap();
    let text = str::from_utf8(&body).unwrap();
    assert!(text.contains("/problems/internal") && !text.contains("the inside"), "{text}");
}

#[test]
fn api_md_lists_every_problem_kind_with_its_status() {
    let text = include_str!("../../../api.md");
    let rows: Vec<_> = text.lines().filter(|line| line.starts_with("| `/problems/")).collect();
    for kind in ProblemKind::ALL {
        let row = format!("| `{}` | {} |", kind.uri(), kind.status().as_u16());
        assert!(rows.iter().any(|line| line.starts_with(&row)), "{row}");
    }
    assert_eq!(rows.len(), ProblemKind::ALL.len());
}

#[test]
fn requests_that_change_data_of_users_have_an_action_in_the_audit_log() {
    /// These change no data of users.
    const WITHOUT: [&str; 6] = [
        "/v1/claims",
        "/v1/results",
        "/v1/validate",
        "/v1/studies/validate",
        "/v1/workers",
        "/v1/workers/{id}/heartbeat",
    ];
    let document: serde_json::Value = serde_json::from_str(&super::openapi()).unwrap();
    for (path, item) in document["paths"].as_object().unwrap() {
        for method in [Method::POST, Method::PUT, Method::DELETE] {
            let is_there = item.get(method.as_str().to_ascii_lowercase()).is_some();
            let is_change = !WITHOUT.contains(&path.as_str()) && !path.contains("/attempts/");
            let has_action = super::audit::action(&method, path).is_some();
            assert_eq!(has_action, is_there && is_change, "{method} {path}");
        }
    }
}
