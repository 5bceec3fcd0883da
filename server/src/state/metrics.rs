//! The metrics of a server: requests, jobs, workers, and the resources of its process.
//!
//! `api.md` lists the metrics; the alerts in `deploy/alerts.yaml` read them.

use std::path::Path;
use std::sync::atomic::AtomicU64;
use std::time::{Duration, Instant};

use prometheus_client::encoding::EncodeLabelSet;
use prometheus_client::encoding::text::encode;
use prometheus_client::metrics::counter::Counter;
use prometheus_client::metrics::family::Family;
use prometheus_client::metrics::gauge::Gauge;
use prometheus_client::metrics::histogram::Histogram;
use prometheus_client::metrics::info::Info;
use prometheus_client::registry::Registry;
use roost_api::job::{AttemptOutcome, JobState};
use roost_api::time::Timestamp;
use roost_solver::SOLVER_REVISION;

use super::connections::Connections;
use crate::data::DATABASE;
use crate::process::{self, Usage};
use crate::store::{QueueCounts, Store, StoreError};

/// Upper bounds of the buckets of answer times, in seconds.
const SECONDS: [f64; 10] = [0.001, 0.0025, 0.005, 0.01, 0.025, 0.05, 0.1, 0.5, 2.0, 30.0];

/// Upper bounds of the buckets of long polls, in seconds.
const LONG_SECONDS: [f64; 6] = [0.01, 0.1, 1.0, 5.0, 15.0, 30.0];

/// Minimum time between two counts of jobs and workers.
const COUNT_EVERY: Duration = Duration::from_secs(1);

/// The pause after a count is at least this many times its duration: a million queued jobs take about 0.1 s.
const PAUSE_FACTOR: u32 = 20;

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

/// All metrics of a server.
pub(crate) struct Metrics {
    registry: Registry,
    requests: Family<Answered, Counter>,
    seconds: Histograms<Route>,
    long_polls: Histograms<LongPoll>,
    attempts: Family<Ended, Counter>,
    jobs: Family<InState, Gauge<i64>>,
    paused_jobs: Gauge<i64>,
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
    /// The last count, and until when it is valid.
    queue_counts: tokio::sync::Mutex<Option<(Instant, QueueCounts)>>,
}

impl Metrics {
    /// Metrics of a server with this store and these connections.
    pub(crate) fn new(store: &Store, connections: &Connections) -> Self {
        let mut all = Registry::default();
        let roost = all.sub_registry_with_prefix("roost");
        let build = [
            ("version", env!("CARGO_PKG_VERSION").to_owned()),
            ("solver_revision", SOLVER_REVISION.to_string()),
            // Set at build time: `ROOST_COMMIT=$(git rev-parse HEAD) cargo build --release`.
            ("commit", option_env!("ROOST_COMMIT").unwrap_or("unknown").to_owned()),
        ];
        roost.register("build", "Versions that the server was built from", Info::new(build.to_vec()));
        let leader = Gauge::<i64>::default();
        leader.set(1);
        roost.register("leader", "Whether this server leads those of its database", leader);
        let requests = Family::default();
        roost.register("http_requests", "Requests answered", requests.clone());
        let seconds = Family::new_with_constructor((|| Histogram::new(SECONDS)) as fn() -> Histogram);
        let help = "Time to the head of the answer, without long polls";
        roost.register("http_request_seconds", help, seconds.clone());
        let long_polls = Family::new_with_constructor((|| Histogram::new(LONG_SECONDS)) as fn() -> Histogram);
        let help = "Time to the head of the answer of claims, which wait for work, and of event streams";
        roost.register("http_long_poll_seconds", help, long_polls.clone());
        let attempts = Family::<Ended, Counter>::default();
        for outcome in AttemptOutcome::ALL {
            // Creates every label, so that the first attempt already shows as an increase.
            drop(attempts.get_or_create(&Ended { outcome: outcome.as_str() }));
        }
        roost.register("attempts", "Attempts that ended, by outcome", attempts.clone());
        let jobs = Family::default();
        roost.register("jobs", "Jobs by state", jobs.clone());
        let paused_jobs = Gauge::default();
        roost.register("jobs_paused", "Queued or running jobs that a user has paused", paused_jobs.clone());
        let oldest_queued_s = Gauge::default();
        let help = "Age of the oldest queued job that may be claimed; 0 without one";
        roost.register("oldest_queued_seconds", help, oldest_queued_s.clone());
        let workers = Gauge::default();
        roost.register("workers", "Workers heard of within a lease", workers.clone());
        roost.register("commit_seconds", "Duration of commits to the database", store.commit_seconds());
        let database_bytes = Gauge::default();
        roost.register("database_bytes", "Length of the database file", database_bytes.clone());
        let wal_bytes = Gauge::default();
        roost.register("database_wal_bytes", "Length of its write-ahead log", wal_bytes.clone());
        let disk_free_bytes = Gauge::default();
        roost.register(
            "disk_free_bytes",
            "Free space of the disk with the data folder",
            disk_free_bytes.clone(),
        );
        let open = Gauge::default();
        roost.register("connections", "Open connections", open.clone());
        let limit = Gauge::<i64>::default();
        limit.set(to_i64(connections.limit() as u64));
        roost.register("connections_limit", "Maximum number of open connections", limit);
        let help = "Clients that were refused because too many connections were open";
        roost.register("connections_refused", help, connections.refused().clone());
        let uptime = Gauge::default();
        roost.register("uptime_seconds", "Time since the server started", uptime.clone());
        let resident_bytes = Gauge::default();
        all.register("process_resident_memory_bytes", "Memory of the process", resident_bytes.clone());
        let open_descriptors = Gauge::default();
        all.register("process_open_fds", "Open file descriptors", open_descriptors.clone());
        let max_descriptors = Gauge::default();
        all.register("process_max_fds", "Maximum number of open file descriptors", max_descriptors.clone());
        let start = Gauge::<f64, AtomicU64>::default();
        start.set(process::unix_seconds());
        all.register("process_start_time_seconds", "Start of the server, in seconds since 1970", start);
        Self {
            registry: all,
            requests,
            seconds,
            long_polls,
            attempts,
            jobs,
            paused_jobs,
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
            queue_counts: tokio::sync::Mutex::default(),
        }
    }

    /// Counts an attempt that has ended.
    pub(crate) fn attempt_ended(&self, outcome: AttemptOutcome) {
        self.attempts.get_or_create(&Ended { outcome: outcome.as_str() }).inc();
    }

    /// Counts an answered request. Only `timing` of a known route and method is recorded.
    pub(crate) fn request_answered(&self, request: AnsweredRequest) {
        let AnsweredRequest { method, route, status, timing } = request;
        match timing {
            Some((RequestKind::LongPoll, seconds)) => {
                self.long_polls.get_or_create(&LongPoll { route: route.clone() }).observe(seconds);
            }
            Some((RequestKind::Immediate, seconds)) => {
                self.seconds.get_or_create(&Route { method, route: route.clone() }).observe(seconds);
            }
            None => {}
        }
        self.requests.get_or_create(&Answered { method, route, status }).inc();
    }

    /// Counts jobs and workers, unless a recent count is still valid.
    pub(crate) async fn count(
        &self,
        store: &Store,
        now: Timestamp,
        lease: Duration,
    ) -> Result<(), StoreError> {
        // Held during the count: concurrent readers get the same numbers.
        let mut last = self.queue_counts.lock().await;
        let started = Instant::now();
        if last.as_ref().is_none_or(|(until, _)| *until <= started) {
            let queue_counts = store.queue_counts(now, lease).await?;
            *last = Some((Instant::now() + COUNT_EVERY.max(started.elapsed() * PAUSE_FACTOR), queue_counts));
        }
        let Some((_, queue_counts)) = last.as_ref() else { return Ok(()) };
        for state in JobState::ALL {
            let counts = queue_counts.jobs.iter().filter(|(known, _)| known == state);
            let count = counts.map(|(_, count)| *count).sum();
            self.jobs.get_or_create(&InState { state: state.as_str() }).set(count);
        }
        self.paused_jobs.set(queue_counts.paused);
        self.workers.set(queue_counts.workers);
        let age_ms = queue_counts.oldest_queued_at.map_or(0, |since| (now.0 - since.0).max(0));
        self.oldest_queued_s.set(age_ms as f64 / 1000.0);
        Ok(())
    }

    /// Sets the gauges of connections, disk and process, and writes all metrics as OpenMetrics text.
    pub(crate) fn encode(
        &self,
        connections: &Connections,
        usage: MachineUsage,
    ) -> Result<String, std::fmt::Error> {
        self.connections.set(to_i64(connections.open() as u64));
        self.uptime.set(self.started.elapsed().as_secs_f64());
        self.database_bytes.set(to_i64(usage.database_bytes));
        self.wal_bytes.set(to_i64(usage.wal_bytes));
        for (gauge, value) in [
            (&self.disk_free_bytes, usage.disk_free_bytes),
            (&self.resident_bytes, usage.process.resident_bytes),
            (&self.open_descriptors, usage.process.open_descriptors),
            (&self.max_descriptors, usage.process.max_descriptors),
        ] {
            gauge.set(value.map_or(0, to_i64));
        }
        let mut text = String::new();
        encode(&mut text, &self.registry)?;
        Ok(text)
    }
}

/// A request with its answer.
pub(crate) struct AnsweredRequest {
    /// Method, one of few values.
    pub(crate) method: &'static str,
    /// Route of the router, never a path.
    pub(crate) route: String,
    /// Status of the answer.
    pub(crate) status: u16,
    /// Time to the head of the answer in seconds, where it is recorded.
    pub(crate) timing: Option<(RequestKind, f64)>,
}

/// How a request is answered.
#[derive(Clone, Copy)]
pub(crate) enum RequestKind {
    /// As soon as the answer is known.
    Immediate,
    /// When an event happens, or after a timeout.
    LongPoll,
}

/// Disk space of the data folder, and resources of the process.
pub(crate) struct MachineUsage {
    database_bytes: u64,
    wal_bytes: u64,
    disk_free_bytes: Option<u64>,
    process: Usage,
}

impl MachineUsage {
    /// The usage now. Reads files.
    pub(crate) fn now(data: &Path) -> Self {
        Self {
            database_bytes: process::file_bytes(&data.join(DATABASE)),
            wal_bytes: process::file_bytes(&data.join(format!("{DATABASE}-wal"))),
            disk_free_bytes: process::free_bytes(data),
            process: Usage::now(),
        }
    }
}

fn to_i64(number: u64) -> i64 {
    i64::try_from(number).unwrap_or(i64::MAX)
}
