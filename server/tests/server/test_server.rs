//! A server for one test, and requests of users and workers.

use std::net::SocketAddr;
use std::path::Path;
use std::time::{Duration, Instant};

use reqwest::{Method, StatusCode};
use roost_api::frames;
use roost_api::ids::WorkerId;
use roost_api::{API_VERSION, RunResult};
use roost_server::{Server, ServerConfig, ServerError};
use roost_solver::SOLVER_REVISION;
use roost_solver::result::{EndReason, Performance, SCHEMA, Series, SolverInfo};
use roost_solver::scenario;
use serde_json::{Value, json};
use tempfile::TempDir;
use tokio::task::JoinHandle;
use tokio_util::sync::CancellationToken;
use uuid::Uuid;

use super::database;

/// A running server.
pub(crate) struct TestServer {
    pub address: SocketAddr,
    pub http: reqwest::Client,
    stop: CancellationToken,
    running: JoinHandle<Result<(), ServerError>>,
}

/// An answer with its body as text and as JSON, which is null if it is not JSON.
pub(crate) struct TestResponse {
    pub status: u16,
    pub media_type: String,
    pub location: Option<String>,
    pub allow: Option<String>,
    pub link: Option<String>,
    pub text: String,
    pub body: Value,
}

impl TestServer {
    /// A server with default settings.
    pub(crate) async fn start() -> (Self, TempDir) {
        Self::with(|_| {}).await
    }

    /// A server with some settings changed.
    pub(crate) async fn with(change: impl FnOnce(&mut ServerConfig)) -> (Self, TempDir) {
        let dir = tempfile::tempdir().unwrap();
        let server = Self::on(dir.path(), change).await;
        (server, dir)
    }

    /// A server on an existing data directory.
    pub(crate) async fn on(data: &Path, change: impl FnOnce(&mut ServerConfig)) -> Self {
        let mut config = ServerConfig { listen: ([127, 0, 0, 1], 0).into(), ..ServerConfig::default() };
        config.data = data.to_owned();
        config.database = database::of(data);
        // No attempt shall end because the machine is busy; tests of leases set their own.
        config.lease = Duration::from_secs(120);
        // Tests of pauses set other values.
        config.retry.worker.first_pause = Duration::ZERO;
        config.retry.lost.first_pause = Duration::ZERO;
        change(&mut config);
        let server = Server::bind(config).await.unwrap();
        let address = server.local_addr();
        let stop = CancellationToken::new();
        let running = tokio::spawn(server.run(stop.clone()));
        // reqwest needs a crypto provider, since other crates of the build enable its TLS.
        let _ = rustls::crypto::ring::default_provider().install_default();
        let http =
            reqwest::Client::builder().no_proxy().pool_idle_timeout(Duration::from_secs(5)).build().unwrap();
        Self { address, http, stop, running }
    }

    /// Stops the server and returns the duration.
    pub(crate) async fn stop(self) -> Duration {
        let before = Instant::now();
        self.stop.cancel();
        self.running.await.unwrap().unwrap();
        before.elapsed()
    }

    pub(crate) async fn send(&self, method: Method, path: &str, body: Option<&Value>) -> TestResponse {
        let mut request = self.http.request(method, format!("http://{}{path}", self.address));
        if let Some(body) = body {
            request = request.json(body);
        }
        read(request.send().await.unwrap()).await
    }

    /// Posts any body.
    pub(crate) async fn send_text(
        &self,
        path: &str,
        media_type: &str,
        body: impl Into<reqwest::Body>,
    ) -> TestResponse {
        let url = format!("http://{}{path}", self.address);
        let request = self.http.post(url).header("content-type", media_type).body(body);
        read(request.send().await.unwrap()).await
    }

    pub(crate) async fn put(
        &self,
        path: &str,
        media_type: &str,
        body: impl Into<reqwest::Body>,
    ) -> TestResponse {
        let url = format!("http://{}{path}", self.address);
        let request = self.http.put(url).header("content-type", media_type).body(body);
        read(request.send().await.unwrap()).await
    }

    pub(crate) async fn get(&self, path: &str) -> TestResponse {
        self.send(Method::GET, path, None).await
    }

    pub(crate) async fn post(&self, path: &str, body: &Value) -> TestResponse {
        self.send(Method::POST, path, Some(body)).await
    }

    /// Submits a valid envelope and returns the job.
    pub(crate) async fn submit(&self, envelope: &Value) -> Value {
        self.post("/v1/jobs", envelope).await.expect(StatusCode::ACCEPTED)
    }

    pub(crate) async fn job(&self, id: &Value) -> Value {
        self.get(&format!("/v1/jobs/{}", text(id))).await.expect(StatusCode::OK)
    }

    /// Waits until a job has a state.
    pub(crate) async fn wait_for(&self, id: &Value, state: &str) -> Value {
        let deadline = Instant::now() + Duration::from_secs(60);
        loop {
            let job = self.job(id).await;
            if job["state"] == state {
                return job;
            }
            assert!(Instant::now() < deadline, "still not {state}: {job}");
            tokio::time::sleep(Duration::from_millis(10)).await;
        }
    }

    /// Registers a worker of that backend.
    pub(crate) async fn worker(&self, backend: &str) -> Worker<'_> {
        let id = WorkerId::new().to_string();
        self.register(&registration(&id, backend)).await
    }

    pub(crate) async fn register(&self, registration: &Value) -> Worker<'_> {
        self.post("/v1/workers", registration).await.expect(StatusCode::OK);
        Worker { server: self, id: text(&registration["worker_id"]).to_owned() }
    }
}

async fn read(response: reqwest::Response) -> TestResponse {
    let header = |name: &str| response.headers().get(name).map(|value| value.to_str().unwrap().to_owned());
    let (status, media_type) = (response.status().as_u16(), header("content-type").unwrap_or_default());
    let (location, allow, link) = (header("location"), header("allow"), header("link"));
    let text = response.text().await.unwrap();
    let body = serde_json::from_str(&text).unwrap_or(Value::Null);
    TestResponse { status, media_type, location, allow, link, text, body }
}

impl TestResponse {
    /// The body of an answer with this status.
    #[track_caller]
    pub(crate) fn expect(self, status: StatusCode) -> Value {
        assert_eq!(self.status, status.as_u16(), "{}", self.text);
        self.body
    }

    /// The body of an answer with this status and problem kind.
    #[track_caller]
    pub(crate) fn problem(self, status: u16, kind: &str) -> Value {
        assert_eq!(self.status, status, "{}", self.text);
        assert_eq!(self.media_type, "application/problem+json");
        assert_eq!(self.body["type"], format!("/problems/{kind}"), "{}", self.text);
        assert_eq!(self.body["status"], status);
        assert!(!self.body["detail"].as_str().unwrap().is_empty());
        self.body
    }
}

pub(crate) fn registration(id: &str, backend: &str) -> Value {
    json!({"worker_id": id, "name": "bench", "api_version": API_VERSION, "backend": backend,
           "solver_revision": SOLVER_REVISION, "device": "a test", "threads": 1})
}

/// A registered worker.
pub(crate) struct Worker<'a> {
    pub server: &'a TestServer,
    pub id: String,
}

impl Worker<'_> {
    pub(crate) fn claim_request(&self, max_jobs: u32, wait_s: f64) -> Value {
        json!({"request_id": Uuid::now_v7(), "worker_id": self.id, "max_jobs": max_jobs, "wait_s": wait_s})
    }

    /// Claims up to `max_jobs` jobs without waiting.
    pub(crate) async fn claim(&self, max_jobs: u32) -> Vec<Value> {
        let request = self.claim_request(max_jobs, 0.0);
        let reply = self.server.post("/v1/claims", &request).await.expect(StatusCode::OK);
        reply["attempts"].as_array().unwrap().clone()
    }

    /// Claims the only queued job.
    pub(crate) async fn claim_one(&self) -> Value {
        let mut attempts = self.claim(1).await;
        assert_eq!(attempts.len(), 1, "nothing to claim");
        attempts.remove(0)
    }

    /// Uploads frames of an attempt; returns status and body.
    pub(crate) async fn upload_frames(&self, attempt: &Value, query: &str, stream: Vec<u8>) -> (u16, Value) {
        let (job, number, server) = (text(&attempt["job_id"]), &attempt["attempt"], self.server);
        let path = format!("/v1/jobs/{job}/attempts/{number}/frames?worker_id={}{query}", self.id);
        let answer = server.put(&path, frames::MEDIA_TYPE, stream).await;
        (answer.status, answer.body)
    }

    /// Sends a heartbeat for one attempt and returns its row of the reply.
    pub(crate) async fn beat(&self, attempt: &Value, progress: Value) -> Value {
        let beat = json!({"job_id": attempt["job_id"], "attempt": attempt["attempt"], "progress": progress});
        let path = format!("/v1/workers/{}/heartbeat", self.id);
        let reply = self.server.post(&path, &json!({"attempts": [beat]})).await.expect(StatusCode::OK);
        reply["attempts"][0].clone()
    }

    pub(crate) async fn deliver(&self, attempt: &Value) -> TestResponse {
        self.deliver_result(attempt, &result_of(&attempt["scenario"])).await
    }

    pub(crate) async fn deliver_result(&self, attempt: &Value, result: &RunResult) -> TestResponse {
        let body = json!({"worker_id": self.id, "result": result});
        self.server.post(&format!("{}/result", path(attempt)), &body).await
    }

    /// Delivers several results in one request.
    pub(crate) async fn deliver_together(&self, results: &[(&Value, &RunResult)]) -> TestResponse {
        let one = |(attempt, result): &(&Value, &RunResult)| {
            json!({"job_id": attempt["job_id"], "attempt": attempt["attempt"],
                   "delivery": {"worker_id": self.id, "result": result}})
        };
        let body = json!({"results": results.iter().map(one).collect::<Vec<_>>()});
        self.server.post("/v1/results", &body).await
    }

    pub(crate) async fn fail(
        &self,
        attempt: &Value,
        outcome: &str,
        partial: Option<&RunResult>,
    ) -> TestResponse {
        let body = json!({"worker_id": self.id, "outcome": outcome, "message": format!("it was {outcome}"),
                          "result": partial});
        self.server.post(&format!("{}/failure", path(attempt)), &body).await
    }
}

fn path(attempt: &Value) -> String {
    format!("/v1/jobs/{}/attempts/{}", text(&attempt["job_id"]), attempt["attempt"])
}

/// The text of a JSON string.
pub(crate) fn text(value: &Value) -> &str {
    value.as_str().unwrap_or_else(|| panic!("not a string: {value}"))
}

/// A small scenario with that seed.
pub(crate) fn scenario(seed: u64) -> Value {
    json!({"experiment": "hopper", "seed": seed, "product": {"count": 6, "subparticle_radius_m": 0.008}})
}

/// An envelope around a small scenario that no other job has run.
pub(crate) fn envelope(seed: u64) -> Value {
    json!({"scenario": scenario(seed)})
}

/// A result document of a scenario with invented numbers.
pub(crate) fn result_of(scenario: &Value) -> RunResult {
    let scenario = scenario::from_value(scenario).unwrap();
    let seed = scenario.seed as f64;
    let responses = json!({"discharged_kg": 30.0 + seed, "time_to_99_percent_s": null, "regime": "constant"});
    RunResult {
        schema: SCHEMA.to_owned(),
        end_reason: EndReason::Duration,
        instability: None,
        responses: responses.as_object().unwrap().clone(),
        curves: Vec::new(),
        warnings: Vec::new(),
        series: vec![Series {
            name: "discharged_mass".to_owned(),
            unit: "kg".to_owned(),
            t_s: vec![0.0, 0.02, 0.04],
            values: vec![0.0, 0.1, 1.0 / 3.0],
        }],
        solver: SolverInfo {
            version: "0.1.0".to_owned(),
            revision: SOLVER_REVISION,
            backend: "cpu".to_owned(),
            device: "a test".to_owned(),
            threads: 1,
            timestep_s: 1e-4,
        },
        performance: Performance {
            subparticles: 100,
            particle_steps: 1000,
            steps: 10,
            wall_s: 0.5,
            ns_per_particle_step: 500.0,
        },
        scenario_digest: scenario.digest(),
        scenario,
    }
}

/// Progress of a run at this fraction.
pub(crate) fn progress(fraction: f64) -> Value {
    json!({"phase": "process", "time_s": 1.0, "simulated_s": 2.0, "fraction": fraction, "subparticles": 9,
           "particle_steps": 10, "wall_s": 0.1, "discharged_kg": 3.0})
}
