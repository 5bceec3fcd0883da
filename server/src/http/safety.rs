//! Properties of every answer: errors are problem documents, and headers keep browsers from interpreting data
//! as pages.

use axum::body::to_bytes;
use axum::extract::Request;
use axum::http::{HeaderValue, StatusCode, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use roost_api::problem::MEDIA_TYPE;

use super::problem::{ApiError, ProblemKind};

/// Answers of the API are data: a browser shall load and run nothing for them.
const POLICY: HeaderValue = HeaderValue::from_static("default-src 'none'; frame-ancestors 'none'");

/// The API documentation at `/docs` runs scripts and styles of this server.
const DOCS_POLICY: HeaderValue = HeaderValue::from_static(
    "default-src 'none'; script-src 'self'; style-src 'self' 'unsafe-inline'; img-src 'self' data:; connect-src 'self'; \
     base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
);

/// Maximum length of a library's error text in `detail`, in bytes.
const MAX_DETAIL_BYTES: usize = 1024;

/// Middleware that completes every answer.
pub(super) async fn complete(request: Request, next: Next) -> Response {
    let is_docs = request.uri().path().starts_with("/docs");
    let mut response = as_problem(next.run(request).await).await;
    protect(&mut response, is_docs);
    response
}

/// Adds security headers, unless the answer has its own.
pub(super) fn protect(response: &mut Response, is_docs: bool) {
    // A browser merges the headers of a 304 into its cached answer, which has the right ones.
    if response.status() == StatusCode::NOT_MODIFIED {
        return;
    }
    let headers = response.headers_mut();
    headers.insert(header::X_CONTENT_TYPE_OPTIONS, HeaderValue::from_static("nosniff"));
    headers.entry(header::REFERRER_POLICY).or_insert(HeaderValue::from_static("no-referrer"));
    let policy = if is_docs { DOCS_POLICY } else { POLICY };
    headers.entry(header::CONTENT_SECURITY_POLICY).or_insert(policy);
}

/// Converts an error of a library, with plain text or an empty body, to a problem document.
async fn as_problem(response: Response) -> Response {
    let status = response.status();
    let is_problem =
        response.headers().get(header::CONTENT_TYPE).is_some_and(|media_type| media_type == MEDIA_TYPE);
    // A page of sign-in, for people.
    let is_page = response
        .headers()
        .get(header::CONTENT_TYPE)
        .is_some_and(|it| it.as_bytes().starts_with(b"text/html"));
    if is_problem || is_page || !(status.is_client_error() || status.is_server_error()) {
        return response;
    }
    let (mut parts, body) = response.into_parts();
    let text = to_bytes(body, MAX_DETAIL_BYTES).await.unwrap_or_default();
    let text = String::from_utf8_lossy(&text);
    let detail =
        if text.trim().is_empty() { status.canonical_reason().unwrap_or("no detail") } else { text.trim() };
    let (made, body) = ApiError::new(kind(status), detail).into_response().into_parts();
    parts.headers.extend(made.headers);
    parts.headers.remove(header::CONTENT_LENGTH);
    parts.status = made.status;
    Response::from_parts(parts, body)
}

fn kind(status: StatusCode) -> ProblemKind {
    let same = ProblemKind::ALL.iter().copied().find(|kind| kind.status() == status);
    same.unwrap_or(if status.is_client_error() { ProblemKind::InvalidPath } else { ProblemKind::Internal })
}
