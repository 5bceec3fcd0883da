//! A span for every request, named by its route, with the job, sweep or worker that its path names: for the log at `debug`, and for
//! traces.

use std::time::Duration;

use axum::extract::{MatchedPath, Request};
use axum::http::{Method, StatusCode};
use axum::response::Response;
use tower_http::classify::{ServerErrorsAsFailures, SharedClassifier};
use tower_http::trace::TraceLayer;
use tracing::Span;
use tracing::field::Empty;

use super::metrics::known_method;

/// What the conventions of OpenTelemetry call a method that HTTP does not know; the span is then named `HTTP` and the route.
const OTHER_METHOD: &str = "_OTHER";

/// So many characters of a path, or of a segment of it, go into the span: the longest path with all its identifiers is shorter.
const MAX_CHARS: usize = 160;

/// What of a path goes into the span: by the segment before it.
const NAMED: [(&str, &str); 4] =
    [("jobs", "job"), ("attempts", "attempt"), ("sweeps", "sweep"), ("workers", "worker")];

type Traced = TraceLayer<
    SharedClassifier<ServerErrorsAsFailures>,
    fn(&Request) -> Span,
    (),
    fn(&Response, Duration, &Span),
>;

/// Opens a span for each request and notes what was answered.
pub(super) fn layer() -> Traced {
    TraceLayer::new_for_http()
        .make_span_with(opened as fn(&Request) -> Span)
        .on_request(())
        .on_response(answered as fn(&Response, Duration, &Span))
}

fn opened(request: &Request) -> Span {
    let ((verb, method), path) = (names(request.method()), shortened(request.uri().path()));
    // A route, never a path: there are too many of those.
    let route = request.extensions().get::<MatchedPath>().map_or("unknown", MatchedPath::as_str);
    let span = tracing::debug_span!(
        "request",
        otel.name = format!("{verb} {route}"),
        otel.kind = "server",
        http.request.method = method,
        http.route = route,
        url.path = path,
        http.response.status_code = Empty,
        otel.status_code = Empty,
        job = Empty,
        attempt = Empty,
        sweep = Empty,
        worker = Empty
    );
    if !span.is_disabled() {
        let mut before = "";
        for (pattern, segment) in route.split('/').zip(path.split('/')) {
            let named = NAMED.iter().find(|(kind, _)| pattern.starts_with('{') && *kind == before);
            if let Some((_, name)) = named {
                span.record(*name, segment);
            }
            before = pattern;
        }
    }
    span
}

/// What a span is called for its method, and what its attribute says.
fn names(method: &Method) -> (&'static str, &'static str) {
    known_method(method).map_or(("HTTP", OTHER_METHOD), |known| (known, known))
}

/// No more of a text than anybody reads.
fn shortened(text: &str) -> &str {
    text.char_indices().nth(MAX_CHARS).map_or(text, |(end, _)| &text[..end])
}

fn answered(response: &Response, after: Duration, span: &Span) {
    let status = response.status();
    span.record("http.response.status_code", status.as_u16());
    if status.is_server_error() && status != StatusCode::SERVICE_UNAVAILABLE {
        span.record("otel.status_code", "ERROR");
    }
    tracing::debug!(status = status.as_u16(), ms = after.as_millis(), "answered");
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_text_of_a_client_goes_into_a_span_at_any_length() {
        assert_eq!(names(&Method::DELETE), ("DELETE", "DELETE"));
        assert_eq!(names(&Method::from_bytes(&[b'X'; 60_000]).unwrap()), ("HTTP", "_OTHER"));
        assert_eq!(
            names(&Method::from_bytes(b"get").unwrap()),
            ("HTTP", "_OTHER"),
            "methods have capital letters"
        );
        let id = "01890000-0000-7000-8000-000000000000";
        let path = format!("/v1/jobs/{id}/attempts/4000000000/frames");
        assert_eq!(shortened(&path), path);
        assert_eq!(shortened(&"/é".repeat(10_000)).chars().count(), MAX_CHARS);
    }
}
