//! A tracing span for every request: route, status, and the job, sweep or worker of its path.

use std::time::Duration;

use axum::extract::{MatchedPath, Request};
use axum::http::{Method, StatusCode};
use axum::response::Response;
use tower_http::classify::{ServerErrorsAsFailures, SharedClassifier};
use tower_http::trace::TraceLayer;
use tracing::Span;
use tracing::field::Empty;

use super::metrics::known_method;

/// Value of an unknown method in the conventions of OpenTelemetry; the span is then named `HTTP` and the route.
const OTHER_METHOD: &str = "_OTHER";

/// Maximum length of a path in a span. The longest path of the API is shorter.
const MAX_PATH_CHARS: usize = 160;

/// Span fields of identifiers in a path, by the segment before them.
const ID_FIELDS: [(&str, &str); 4] =
    [("jobs", "job"), ("attempts", "attempt"), ("sweeps", "sweep"), ("workers", "worker")];

type Traced = TraceLayer<
    SharedClassifier<ServerErrorsAsFailures>,
    fn(&Request) -> Span,
    (),
    fn(&Response, Duration, &Span),
>;

/// Opens a span for each request and records the answer.
pub(super) fn layer() -> Traced {
    TraceLayer::new_for_http()
        .make_span_with(open_span as fn(&Request) -> Span)
        .on_request(())
        .on_response(record_answer as fn(&Response, Duration, &Span))
}

fn open_span(request: &Request) -> Span {
    let ((verb, method), path) = (method_names(request.method()), shortened(request.uri().path()));
    // The route, not the path: paths have too many values.
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
            let named = ID_FIELDS.iter().find(|(kind, _)| pattern.starts_with('{') && *kind == before);
            if let Some((_, name)) = named {
                span.record(*name, segment);
            }
            before = pattern;
        }
    }
    span
}

/// The first word of the span name and the attribute of a method.
fn method_names(method: &Method) -> (&'static str, &'static str) {
    known_method(method).map_or(("HTTP", OTHER_METHOD), |known| (known, known))
}

/// The start of a text, short enough for a span.
fn shortened(text: &str) -> &str {
    text.char_indices().nth(MAX_PATH_CHARS).map_or(text, |(end, _)| &text[..end])
}

fn record_answer(response: &Response, after: Duration, span: &Span) {
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
    fn client_text_in_a_span_is_bounded() {
        assert_eq!(method_names(&Method::DELETE), ("DELETE", "DELETE"));
        assert_eq!(method_names(&Method::from_bytes(&[b'X'; 60_000]).unwrap()), ("HTTP", "_OTHER"));
        assert_eq!(
            method_names(&Method::from_bytes(b"get").unwrap()),
            ("HTTP", "_OTHER"),
            "methods are case-sensitive"
        );
        let id = "01890000-0000-7000-8000-000000000000";
        let path = format!("/v1/jobs/{id}/attempts/4000000000/frames");
        assert_eq!(shortened(&path), path);
        assert_eq!(shortened(&"/é".repeat(10_000)).chars().count(), MAX_PATH_CHARS);
    }
}
