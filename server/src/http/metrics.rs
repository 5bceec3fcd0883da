//! `/metrics` for Prometheus: what the server is asked, what it has to do, and what it takes of the machine.
//!
//! Every label has few values, whatever clients send: methods and routes are those of the router, all others are one value
//! together. `api.md` lists the metrics; the alerts in `deploy/alerts.yaml` read them.

use std::sync::atomic::AtomicU64;
use std::time::{Duration, Instant};

use axum::extract::{MatchedPath, Request, State};
use axum::http::{Method, StatusCode, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use prometheus_client::encoding::EncodeLabelSet;
use prometheus_client::encoding::text::encode;
use prometheus_client::metrics::counter::Counter;
use prometheus_client::metrics::family::Family;
use prometheus_client::metrics::gauge::Gauge;
use prometheus_client::metrics::histogram::Histogram;
use prometheus_client::metrics::info::Info;
use prometheus_client::registry::Registry;
use roost_api::job::{AttemptOutcome, JobState};
use roost_solver::SOLVER_REVISION;

use super::aside::aside;
use super::connections::Connections;
use super::problem::{ApiError, Kind};
use crate::app::App;
use crate::data::DATABASE;
use crate::process::{self, Usage};
use crate::store::{Census, Store};

/// Upper ends of the classes of answer times, in seconds.
const SECONDS: [f64; 10] = [0.001, 0.0025, 0.005, 0.01, 0.025, 0.05, 0.1, 0.5, 2.0, 30.0];

/// The same for answers that wait for something to happen.
const LONG_SECONDS: [f64; 6] = [0.01, 0.1, 1.0, 5.0, 15.0, 30.0];

/// Jobs and workers are counted no more often than this, however often somebody asks,
const COUNT_EVERY: Duration = Duration::from_secs(1);

/// nor before this many times the time has passed that it took: a million queued jobs take some 0.1 s.
const REST: u32 = 20;

/// The route of a path that the router does not know.
const UNKNOWN: &str = "unknown";

#[derive(Clone, Debug, PartialEq, Eq, Hash, EncodeLabelSet)]
struct Route {
    method: &'static str,
    route: String,
}

#[derive(Clone, Debug, PartialEq, Eq, Hash, EncodeLabelSet)]
struct Answered {
    method: &'static str,
    route: String,
    status: u16,
}

#[derive(Clone, Debug, PartialEq, Eq, Hash, EncodeLabelSet)]
struct LongPoll {
    route: String,
}

#[derive(Clone, Debug, PartialEq, Eq, Hash, EncodeLabelSet)]
struct InState {
    state: &'static str,
}

#[derive(Clone, Debug, PartialEq, Eq, Hash, EncodeLabelSet)]
struct Ended {
    outcome: &'static str,
}

type Histograms<L> = Family<L, Histogram, fn() -> Histogram>;

/// Everything that is measured.
pub(crate) struct Metrics {
    registry: Registry,
    requests: Family<Answered, Counter>,
    seconds: Histograms<Route>,
    long_polls: Histograms<LongPoll>,
    attempts: Family<Ended, Counter>,
    jobs: Family<InState, Gauge<i64>>,
    oldest_queued_s: Gauge<f64, AtomicU64>,
    workers: Gauge<i64>,
    database_bytes: Gauge<i64>,
    wal_bytes: Gauge<i64>,
    disk_free_bytes: Gauge<i64>,
    connections: Gauge<i64>,
    uptime: Gauge<f64, AtomicU64>,
    resident_bytes: Gauge<i64>,
    open_descriptors: Gauge<i64>,
    max_descriptors: Gauge<i64>,
    started: Instant,
    /// What was counted last, and until when that will do.
    census: tokio::sync::Mutex<Option<(Instant, Census)>>,
}

impl Metrics {
    /// Measures, from now on, a server of that store and those connections.
    pub(crate) fn new(store: &Store, connections: &Connections) -> Self {
        let mut all = Registry::default();
        let roost = all.sub_registry_with_prefix("roost");
        let build = [
            ("version", env!("CARGO_PKG_VERSION").to_owned()),
            ("solver_revision", SOLVER_REVISION.to_string()),
            // Known only to who builds: `ROOST_COMMIT=$(git rev-parse HEAD) cargo build --release`.
            ("commit", option_env!("ROOST_COMMIT").unwrap_or("unknown").to_owned()),
        ];
        roost.register("build", "Of what the server is built", Info::new(build.to_vec()));
        let requests = Family::default();
        roost.register("http_requests", "Requests answered", requests.clone());
        let seconds = Family::new_with_constructor((|| Histogram::new(SECONDS)) as fn() -> Histogram);
        let help = "Time to the head of the answer, but for long polls";
        roost.register("http_request_seconds", help, seconds.clone());
        let long_polls = Family::new_with_constructor((|| Histogram::new(LONG_SECONDS)) as fn() -> Histogram);
        let help = "Time to the head of the answer of claims, which wait for work, and of event streams";
        roost.register("http_long_poll_seconds", help, long_polls.clone());
        let attempts = Family::<Ended, Counter>::default();
        for outcome in AttemptOutcome::ALL {
            // So that the first one is an increase.
            drop(attempts.get_or_create(&Ended { outcome: outcome.as_str() }));
        }
        roost.register("attempts", "Attempts that ended, by outcome", attempts.clone());
        let jobs = Family::default();
        roost.register("jobs", "Jobs by state", jobs.clone());
        let oldest_queued_s = Gauge::default();
        let help = "How long the first submitted of the queued jobs has been queued; 0 without any";
        roost.register("oldest_queued_seconds", help, oldest_queued_s.clone());
        let workers = Gauge::default();
        roost.register("workers", "Workers heard of within a lease", workers.clone());
        roost.register("commit_seconds", "Time that commits to the database take", store.commit_seconds());
        let database_bytes = Gauge::default();
        roost.register("database_bytes", "Length of the database file", database_bytes.clone());
        let wal_bytes = Gauge::default();
        roost.register("database_wal_bytes", "Length of its write-ahead log", wal_bytes.clone());
        let disk_free_bytes = Gauge::default();
        roost.register("disk_free_bytes", "Free where the data folder is", disk_free_bytes.clone());
        let open = Gauge::default();
        roost.register("connections", "Open connections", open.clone());
        let limit = Gauge::<i64>::default();
        limit.set(whole(connections.limit() as u64));
        roost.register("connections_limit", "Connections that may be open", limit);
        let help = "Clients that had to go because too many connections were open";
        roost.register("connections_refused", help, connections.refused().clone());
        let uptime = Gauge::default();
        roost.register("uptime_seconds", "Since the server started", uptime.clone());
        let resident_bytes = Gauge::default();
        all.register("process_resident_memory_bytes", "Memory of the process", resident_bytes.clone());
        let open_descriptors = Gauge::default();
        all.register("process_open_fds", "Open file descriptors", open_descriptors.clone());
        let max_descriptors = Gauge::default();
        all.register("process_max_fds", "File descriptors that may be open", max_descriptors.clone());
        let start = Gauge::<f64, AtomicU64>::default();
        start.set(process::unix_seconds());
        all.register("process_start_time_seconds", "When the server started, in seconds since 1970", start);
        Self {
            registry: all,
            requests,
            seconds,
            long_polls,
            attempts,
            jobs,
            oldest_queued_s,
            workers,
            database_bytes,
            wal_bytes,
            disk_free_bytes,
            connections: open,
            uptime,
            resident_bytes,
            open_descriptors,
            max_descriptors,
            started: Instant::now(),
            census: tokio::sync::Mutex::default(),
        }
    }

    /// Counts an attempt that has ended.
    pub(crate) fn attempt_ended(&self, outcome: AttemptOutcome) {
        self.attempts.get_or_create(&Ended { outcome: outcome.as_str() }).inc();
    }

    /// Counts an answered request and its time.
    fn answered(&self, method: &'static str, route: String, status: StatusCode, seconds: f64) {
        // Of a method that the route does not have, the time says nothing; HEAD is answered as GET is.
        let is_timed = route != UNKNOWN
            && method != "HEAD"
            && method != OTHER
            && status != StatusCode::METHOD_NOT_ALLOWED;
        if is_timed && is_long_poll(&route) {
            self.long_polls.get_or_create(&LongPoll { route: route.clone() }).observe(seconds);
        } else if is_timed {
            self.seconds.get_or_create(&Route { method, route: route.clone() }).observe(seconds);
        }
        self.requests.get_or_create(&Answered { method, route, status: status.as_u16() }).inc();
    }

    /// Takes down what is to be counted at the moment.
    async fn update(&self, app: &App) -> Result<(), ApiError> {
        let now = app.clock.now();
        // Held while it is counted: who asks meanwhile gets the same numbers.
        let mut known = self.census.lock().await;
        let started = Instant::now();
        if known.as_ref().is_none_or(|(until, _)| *until <= started) {
            let census = app.store.census(now, app.config.lease).await?;
            *known = Some((Instant::now() + COUNT_EVERY.max(started.elapsed() * REST), census));
        }
        let Some((_, census)) = known.as_ref() else { return Ok(()) };
        for state in JobState::ALL {
            let count = census.jobs.iter().find(|(known, _)| known == state).map_or(0, |(_, count)| *count);
            self.jobs.get_or_create(&InState { state: state.as_str() }).set(count);
        }
        self.workers.set(census.workers);
        let age_ms = census.oldest_queued_at.map_or(0, |since| (now.0 - since.0).max(0));
        self.oldest_queued_s.set(age_ms as f64 / 1000.0);
        drop(known);
        self.connections.set(whole(app.connections.open() as u64));
        self.uptime.set(self.started.elapsed().as_secs_f64());
        let data = app.config.data.clone();
        let measured = move || {
            let (database, log) = (data.join(DATABASE), data.join(format!("{DATABASE}-wal")));
            let bytes = (process::file_bytes(&database), process::file_bytes(&log));
            (bytes, process::free_bytes(&data), Usage::now())
        };
        let ((database, log), free, usage) = aside(measured).await?;
        self.database_bytes.set(whole(database));
        self.wal_bytes.set(whole(log));
        for (gauge, known) in [
            (&self.disk_free_bytes, free),
            (&self.resident_bytes, usage.resident_bytes),
            (&self.open_descriptors, usage.open_descriptors),
            (&self.max_descriptors, usage.max_descriptors),
        ] {
            gauge.set(known.map_or(0, whole));
        }
        Ok(())
    }
}

fn whole(number: u64) -> i64 {
    i64::try_from(number).unwrap_or(i64::MAX)
}

fn is_long_poll(route: &str) -> bool {
    route == "/v1/claims" || route.ends_with("/events")
}

/// All methods that HTTP does not know.
const OTHER: &str = "other";

/// The name of a method of HTTP; none for what a client made up.
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
pub(crate) async fn measured(State(app): State<App>, request: Request, next: Next) -> Response {
    let path = request.extensions().get::<MatchedPath>();
    // A route, never a path: there are too many of those.
    let route = path.map_or(UNKNOWN, |path| path.as_str()).to_owned();
    let (method, started) = (known_method(request.method()).unwrap_or(OTHER), Instant::now());
    let response = next.run(request).await;
    app.metrics.answered(method, route, response.status(), started.elapsed().as_secs_f64());
    response
}

/// What is measured, for Prometheus.
#[utoipa::path(get, path = "/metrics", tag = "server", operation_id = "metrics",
    responses((status = 200, description = "OpenMetrics text", body = String,
               content_type = "application/openmetrics-text")))]
pub(crate) async fn metrics(State(app): State<App>) -> Result<Response, ApiError> {
    app.metrics.update(&app).await?;
    let mut text = String::new();
    encode(&mut text, &app.metrics.registry)
        .map_err(|error| ApiError::new(Kind::Internal, error.to_string()))?;
    let media_type = "application/openmetrics-text; version=1.0.0; charset=utf-8";
    Ok(([(header::CONTENT_TYPE, media_type)], text).into_response())
}
