//! `GET /metrics` for Prometheus, and the middleware that counts requests.
//!
//! Every label has few values, whatever clients send: methods and routes are those of the router, all others
//! share one value.

use std::time::Instant;

use axum::extract::{MatchedPath, Request, State};
use axum::http::{Method, StatusCode, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};

use super::blocking::run_blocking;
use super::problem::{ApiError, ProblemKind};
use crate::state::{AnsweredRequest, App, MachineUsage, RequestKind};

/// The route of paths that the router does not know.
const UNKNOWN_ROUTE: &str = "unknown";

/// The label of methods that HTTP does not define.
const OTHER_METHOD: &str = "other";

/// The name of a method of HTTP; none for one that a client made up.
pub(super) fn known_method(method: &Method) -> Option<&'static str> {
    Some(match *method {
        Method::GET => "GET",
        Method::POST => "POST",
        Method::PUT => "PUT",
        Method::DELETE => "DELETE",
        Method::HEAD => "HEAD",
        Method::OPTIONS => "OPTIONS",
        Method::PATCH => "PATCH",
        Method::CONNECT => "CONNECT",
        Method::TRACE => "TRACE",
        _ => return None,
    })
}

/// Counts a request and times its answer.
pub(crate) async fn measure(State(app): State<App>, request: Request, next: Next) -> Response {
    let path = request.extensions().get::<MatchedPath>();
    // The route, not the path: paths have too many values.
    let route = path.map_or(UNKNOWN_ROUTE, |path| path.as_str()).to_owned();
    let (method, started) = (known_method(request.method()).unwrap_or(OTHER_METHOD), Instant::now());
    let response = next.run(request).await;
    let status = response.status();
    // HEAD is answered as GET is. The time of a method that the route does not have is meaningless.
    let is_timed = route != UNKNOWN_ROUTE
        && method != "HEAD"
        && method != OTHER_METHOD
        && status != StatusCode::METHOD_NOT_ALLOWED;
    let timing = is_timed.then(|| (request_kind(&route), started.elapsed().as_secs_f64()));
    app.metrics.request_answered(AnsweredRequest { method, route, status: status.as_u16(), timing });
    response
}

fn request_kind(route: &str) -> RequestKind {
    if route == "/v1/claims" || route.ends_with("/events") {
        RequestKind::LongPoll
    } else {
        RequestKind::Immediate
    }
}

/// Media type of metrics.
const MEDIA_TYPE: &str = "application/openmetrics-text; version=1.0.0; charset=utf-8";

/// The metrics of a server that does not lead: that it does not.
pub(super) fn of_standby() -> Response {
    let text = "# HELP roost_leader Whether this server leads those of its database.\n# TYPE roost_leader gauge\nroost_leader 0\n# EOF\n";
    ([(header::CONTENT_TYPE, MEDIA_TYPE)], text).into_response()
}

/// Metrics for Prometheus.
#[utoipa::path(get, path = "/metrics", tag = "server", operation_id = "metrics",
    responses((status = 200, description = "OpenMetrics text", body = String,
               content_type = "application/openmetrics-text")))]
pub(crate) async fn metrics(State(app): State<App>) -> Result<Response, ApiError> {
    app.metrics.count(&app.store, app.clock.now(), app.config.lease).await?;
    let data = app.config.data.clone();
    let usage = run_blocking(move || MachineUsage::now(&data)).await?;
    let text = app.metrics.encode(&app.connections, usage);
    let text = text.map_err(|error| ApiError::new(ProblemKind::Internal, error.to_string()))?;
    Ok(([(header::CONTENT_TYPE, MEDIA_TYPE)], text).into_response())
}
