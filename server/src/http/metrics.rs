//! `/metrics` for Prometheus: what the server is asked, and what it has to do.

use std::sync::atomic::AtomicU64;
use std::time::Instant;

use axum::extract::{MatchedPath, Request, State};
use axum::http::header;
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use prometheus_client::encoding::EncodeLabelSet;
use prometheus_client::encoding::text::encode;
use prometheus_client::metrics::counter::Counter;
use prometheus_client::metrics::family::Family;
use prometheus_client::metrics::gauge::Gauge;
use prometheus_client::metrics::histogram::Histogram;
use prometheus_client::registry::Registry;
use roost_api::job::JobState;

use super::problem::{ApiError, Kind};
use crate::app::App;

/// Upper ends of the classes of answer times, in seconds.
const SECONDS: [f64; 10] = [0.001, 0.0025, 0.005, 0.01, 0.025, 0.05, 0.1, 0.5, 2.0, 30.0];

#[derive(Clone, Debug, PartialEq, Eq, Hash, EncodeLabelSet)]
struct Route {
    method: String,
    route: String,
}

#[derive(Clone, Debug, PartialEq, Eq, Hash, EncodeLabelSet)]
struct Answered {
    method: String,
    route: String,
    status: u16,
}

#[derive(Clone, Debug, PartialEq, Eq, Hash, EncodeLabelSet)]
struct InState {
    state: &'static str,
}

/// Everything that is measured.
pub(crate) struct Metrics {
    registry: Registry,
    requests: Family<Answered, Counter>,
    seconds: Family<Route, Histogram, fn() -> Histogram>,
    jobs: Family<InState, Gauge<i64>>,
    workers: Gauge<i64>,
    uptime: Gauge<f64, AtomicU64>,
    started: Instant,
}

impl Default for Metrics {
    fn default() -> Self {
        let mut registry = Registry::with_prefix("roost");
        let requests = Family::default();
        registry.register("http_requests", "Requests answered", requests.clone());
        let seconds = Family::new_with_constructor((|| Histogram::new(SECONDS)) as fn() -> Histogram);
        registry.register("http_request_seconds", "Time to the head of the answer", seconds.clone());
        let jobs = Family::default();
        registry.register("jobs", "Jobs by state", jobs.clone());
        let workers = Gauge::default();
        registry.register("workers", "Workers heard of within a lease", workers.clone());
        let uptime = Gauge::default();
        registry.register("uptime_seconds", "Since the server started", uptime.clone());
        Self { registry, requests, seconds, jobs, workers, uptime, started: Instant::now() }
    }
}

/// Counts a request and times its answer.
pub(crate) async fn measured(State(app): State<App>, request: Request, next: Next) -> Response {
    let path = request.extensions().get::<MatchedPath>();
    // A route, never a path: there are too many of those.
    let route = path.map_or("unknown", |path| path.as_str()).to_owned();
    let (method, started) = (request.method().to_string(), Instant::now());
    let response = next.run(request).await;
    let status = response.status().as_u16();
    let passed = started.elapsed().as_secs_f64();
    app.metrics
        .requests
        .get_or_create(&Answered { method: method.clone(), route: route.clone(), status })
        .inc();
    app.metrics.seconds.get_or_create(&Route { method, route }).observe(passed);
    response
}

/// What is measured, for Prometheus.
#[utoipa::path(get, path = "/metrics", tag = "server", operation_id = "metrics",
    responses((status = 200, description = "OpenMetrics text", body = String,
               content_type = "application/openmetrics-text")))]
pub(crate) async fn metrics(State(app): State<App>) -> Result<Response, ApiError> {
    let metrics = &app.metrics;
    let (jobs, workers) = app.store.census(app.clock.now(), app.config.lease).await?;
    for state in JobState::ALL {
        let count = jobs.iter().find(|(known, _)| known == state).map_or(0, |(_, count)| *count);
        metrics.jobs.get_or_create(&InState { state: state.as_str() }).set(count);
    }
    metrics.workers.set(workers);
    metrics.uptime.set(metrics.started.elapsed().as_secs_f64());
    let mut text = String::new();
    encode(&mut text, &metrics.registry).map_err(|error| ApiError::new(Kind::Internal, error.to_string()))?;
    let media_type = "application/openmetrics-text; version=1.0.0; charset=utf-8";
    Ok(([(header::CONTENT_TYPE, media_type)], text).into_response())
}
