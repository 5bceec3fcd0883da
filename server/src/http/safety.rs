//! What every answer has, whoever made it: a problem document where it is an error, and headers that keep browsers from guessing.

use axum::body::to_bytes;
use axum::extract::Request;
use axum::http::{HeaderValue, StatusCode, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use roost_api::problem::MEDIA_TYPE;

use super::problem::{ApiError, Kind};

/// An answer of the API is data: a browser shall load and run nothing because of it.
const POLICY: HeaderValue = HeaderValue::from_static("default-src 'none'; frame-ancestors 'none'");

/// The reader of the specification runs its own scripts and styles from this server.
const READER_POLICY: HeaderValue = HeaderValue::from_static(
    "default-src 'none'; script-src 'self'; style-src 'self' 'unsafe-inline'; img-src 'self' data:; connect-src 'self'; \
     base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
);

/// The longest text of a library's error that becomes the detail of a problem, in bytes.
const LONGEST_DETAIL: usize = 1024;

/// Completes an answer on its way out.
pub(super) async fn complete(request: Request, next: Next) -> Response {
    let is_reader = request.uri().path().starts_with("/docs");
    let mut response = as_problem(next.run(request).await).await;
    protect(&mut response, is_reader);
    response
}

/// Adds the headers that keep browsers from guessing, unless the answer has its own.
pub(super) fn protect(response: &mut Response, is_reader: bool) {
    // A browser takes the headers of a 304 over into the answer that it has: those are right as they are.
    if response.status() == StatusCode::NOT_MODIFIED {
        return;
    }
    let headers = response.headers_mut();
    headers.insert(header::X_CONTENT_TYPE_OPTIONS, HeaderValue::from_static("nosniff"));
    headers.entry(header::REFERRER_POLICY).or_insert(HeaderValue::from_static("no-referrer"));
    let policy = if is_reader { READER_POLICY } else { POLICY };
    headers.entry(header::CONTENT_SECURITY_POLICY).or_insert(policy);
}

/// Turns an error of a library, which answers in plain text or not at all, into a problem document.
async fn as_problem(response: Response) -> Response {
    let status = response.status();
    let is_problem =
        response.headers().get(header::CONTENT_TYPE).is_some_and(|media_type| media_type == MEDIA_TYPE);
    if is_problem || !(status.is_client_error() || status.is_server_error()) {
        return response;
    }
    let (mut parts, body) = response.into_parts();
    let text = to_bytes(body, LONGEST_DETAIL).await.unwrap_or_default();
    let text = String::from_utf8_lossy(&text);
    let detail =
        if text.trim().is_empty() { status.canonical_reason().unwrap_or("no detail") } else { text.trim() };
    let (made, body) = ApiError::new(kind(status), detail).into_response().into_parts();
    parts.headers.extend(made.headers);
    parts.headers.remove(header::CONTENT_LENGTH);
    parts.status = made.status;
    Response::from_parts(parts, body)
}

fn kind(status: StatusCode) -> Kind {
    let same = Kind::ALL.iter().copied().find(|kind| kind.status() == status);
    same.unwrap_or(if status.is_client_error() { Kind::InvalidPath } else { Kind::Internal })
}
