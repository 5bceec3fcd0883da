//! The problem kinds of `api.md` against those of the code, and the answer to a panic.

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
