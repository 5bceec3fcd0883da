//! A span for every request, named by its route, with the job, sweep or worker that its path names: for the log at `debug`, and for
//! traces.

use std::time::Duration;

use axum::extract::{MatchedPath, Request};
use axum::http::StatusCode;
use axum::response::Response;
use tower_http::classify::{ServerErrorsAsFailures, SharedClassifier};
use tower_http::trace::TraceLayer;
use tracing::Span;
use tracing::field::Empty;

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
    let (method, path) = (request.method(), request.uri().path());
    // A route, never a path: there are too many of those.
    let route = request.extensions().get::<MatchedPath>().map_or("unknown", MatchedPath::as_str);
    let span = tracing::debug_span!(
        "request", otel.name = format!("{method} {route}"), otel.kind = "server", http.request.method = %method,
        http.route = route, url.path = path, http.response.status_code = Empty, otel.status_code = Empty,
        job = Empty, attempt = Empty, sweep = Empty, worker = Empty
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

fn answered(response: &Response, after: Duration, span: &Span) {
    let status = response.status();
    span.record("http.response.status_code", status.as_u16());
    if status.is_server_error() && status != StatusCode::SERVICE_UNAVAILABLE {
        span.record("otel.status_code", "ERROR");
    }
    tracing::debug!(status = status.as_u16(), ms = after.as_millis(), "answered");
}
