//! Clients of a server: users, and workers that simulate nothing.

use std::collections::HashMap;
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail};
use reqwest::{Client, Response, StatusCode};
use roost_api::ids::WorkerId;
use roost_api::lease::ResultsReply;
use roost_api::{API_VERSION, RunResult, Series};
use roost_solver::SOLVER_REVISION;
use roost_solver::result::{EndReason, Performance, SCHEMA, SolverInfo};
use roost_solver::scenario::{self, Scenario};
use roost_worker::client::{MAX_IDLE, prepare_tls};
use serde::Deserialize;
use serde::de::DeserializeOwned;
use serde_json::{Value, json};
use uuid::Uuid;

/// Number of jobs of a small sweep.
pub(super) const SEEDS: u64 = 500;

/// Number of jobs of a large sweep, each with its own seed; a result is prepared for each.
pub(super) const MANY_SEEDS: u64 = 10_000;

/// The scenario of every job.
pub(super) fn base_scenario() -> Value {
    json!({"experiment": "hopper", "product": {"count": 6, "subparticle_radius_m": 0.008}})
}

/// A sweep with this number of jobs, without cached results.
pub(super) fn replicate_sweep(jobs: u64) -> Value {
    json!({"name": "bench", "base": base_scenario(), "design": {"kind": "grid"}, "factors": [], "replicates": jobs,
           "cache": "bypass"})
}

/// A sweep over two factors with this number of design points.
pub(super) fn grid_sweep(points: usize) -> Value {
    let side = (points as f64).sqrt().round() as usize;
    let levels = |low: f64, high: f64| -> Vec<f64> {
        (0..side).map(|step| low + (high - low) * step as f64 / side as f64).collect()
    };
    json!({"name": "bench", "base": base_scenario(), "design": {"kind": "grid"}, "cache": "bypass",
           "factors": [{"pointer": "/equipment/gate_opening_m", "levels": levels(0.04, 0.08)},
                       {"pointer": "/equipment/belt_speed_m_s", "levels": levels(0.1, 0.4)}]})
}

/// A sweep with this number of design points, drawn at random. Other sweeps are claimed first.
pub(super) fn random_sweep(points: u64) -> Value {
    json!({"name": "bench", "base": base_scenario(), "design": {"kind": "random", "points": points}, "cache": "bypass",
           "priority": -1,
           "factors": [{"pointer": "/equipment/gate_opening_m", "low": 0.04, "high": 0.08},
                       {"pointer": "/equipment/belt_speed_m_s", "low": 0.1, "high": 0.4}]})
}

/// A client of the HTTP API.
#[derive(Clone)]
pub(super) struct ApiClient {
    http: Client,
    url: String,
}

/// The fields of an attempt that a worker without a solver needs, with a scenario or its seed.
#[derive(Clone, Debug, Deserialize)]
pub(super) struct Attempt<S = Seeded> {
    pub(super) job_id: Uuid,
    pub(super) attempt: u32,
    pub(super) scenario: S,
}

/// The seed of a scenario.
#[derive(Clone, Debug, Deserialize)]
pub(super) struct Seeded {
    seed: u64,
}

#[derive(Deserialize)]
struct Claimed<S> {
    attempts: Vec<Attempt<S>>,
}

impl ApiClient {
    pub(super) fn new(url: &str) -> Result<Self> {
        prepare_tls();
        let http = Client::builder()
            .no_proxy()
            .pool_idle_timeout(MAX_IDLE)
            .timeout(Duration::from_secs(1800))
            .build()?;
        Ok(Self { http, url: url.to_owned() })
    }

    pub(super) async fn get(&self, path: &str, etag: Option<&str>) -> Result<Response> {
        let mut request = self.http.get(format!("{}{path}", self.url));
        if let Some(etag) = etag {
            request = request.header("if-none-match", etag);
        }
        Ok(request.send().await?)
    }

    pub(super) async fn post(&self, path: &str, body: &Value) -> Result<Value> {
        let response = self.http.post(format!("{}{path}", self.url)).json(body).send().await?;
        success(path, response).await?.json().await.context("no JSON")
    }

    pub(super) async fn delete(&self, path: &str) -> Result<Value> {
        let response = self.http.delete(format!("{}{path}", self.url)).send().await?;
        success(path, response).await?.json().await.context("no JSON")
    }

    pub(super) async fn register(&self) -> Result<SimulatedWorker> {
        let id = WorkerId::new();
        let registration = json!({"worker_id": id, "name": "bench", "api_version": API_VERSION, "backend": "cpu",
            "solver_revision": SOLVER_REVISION, "device": "none", "threads": 1});
        self.post("/v1/workers", &registration).await?;
        Ok(SimulatedWorker { client: self.clone(), id })
    }
}

/// The response, or an error if its status is none of success.
async fn success(path: &str, response: Response) -> Result<Response> {
    let status = response.status();
    if !status.is_success() {
        bail!("{path}: {status} {}", response.text().await.unwrap_or_default());
    }
    Ok(response)
}

/// A worker that simulates nothing.
#[derive(Clone)]
pub(super) struct SimulatedWorker {
    client: ApiClient,
    pub(super) id: WorkerId,
}

impl SimulatedWorker {
    pub(super) async fn claim(&self, request: Uuid, wait_s: f64) -> Result<Option<Attempt>> {
        self.claim_with(request, wait_s).await
    }

    /// Claims one job, with its whole scenario or a part of it.
    pub(super) async fn claim_with<S: DeserializeOwned>(
        &self,
        request: Uuid,
        wait_s: f64,
    ) -> Result<Option<Attempt<S>>> {
        Ok(self.claim_up_to(1, request, wait_s).await?.into_iter().next())
    }

    /// Claims up to `max_jobs` jobs.
    pub(super) async fn claim_up_to<S: DeserializeOwned>(
        &self,
        max_jobs: u32,
        request: Uuid,
        wait_s: f64,
    ) -> Result<Vec<Attempt<S>>> {
        let body =
            json!({"request_id": request, "worker_id": self.id, "max_jobs": max_jobs, "wait_s": wait_s});
        let response =
            self.client.http.post(format!("{}/v1/claims", self.client.url)).json(&body).send().await?;
        let claimed: Claimed<S> = success("/v1/claims", response).await?.json().await?;
        Ok(claimed.attempts)
    }

    /// Delivers the results of attempts in one request. Returns how many were recorded now.
    pub(super) async fn deliver_together(&self, attempts: &[Attempt], results: &Results) -> Result<u64> {
        let mut items = Vec::with_capacity(attempts.len());
        for Attempt { job_id, attempt, scenario } in attempts {
            let result = results.of(scenario.seed)?;
            items.push(format!(
                r#"{{"job_id": "{job_id}", "attempt": {attempt}, "delivery": {{"worker_id": "{}", "result": {result}}}}}"#,
                self.id
            ));
        }
        let body = format!(r#"{{"results": [{}]}}"#, items.join(","));
        let request = self.client.http.post(format!("{}/v1/results", self.client.url));
        let response = request.header("content-type", "application/json").body(body).send().await?;
        let reply: ResultsReply = success("/v1/results", response).await?.json().await?;
        if let Some(problem) = reply.answers.iter().find_map(|answer| answer.problem.as_ref()) {
            bail!("/v1/results: {}", problem.detail);
        }
        Ok(reply.answers.iter().filter(|answer| answer.recorded).count() as u64)
    }

    /// Delivers the result of an attempt. Returns whether it was recorded now, or none for a stale attempt.
    pub(super) async fn deliver(&self, attempt: &Attempt, results: &Results) -> Result<Option<bool>> {
        self.deliver_result(attempt, &results.of(attempt.scenario.seed)?).await
    }

    /// Delivers a result, given as JSON. Returns whether it was recorded now, or none for a stale attempt.
    pub(super) async fn deliver_result<S>(&self, attempt: &Attempt<S>, result: &str) -> Result<Option<bool>> {
        let path = format!("/v1/jobs/{}/attempts/{}/result", attempt.job_id, attempt.attempt);
        let body = format!(r#"{{"worker_id": "{}", "result": {result}}}"#, self.id);
        let request = self.client.http.post(format!("{}{path}", self.client.url));
        let response = request.header("content-type", "application/json").body(body).send().await?;
        if response.status() == StatusCode::CONFLICT {
            return Ok(None);
        }
        let receipt: Value = success(&path, response).await?.json().await?;
        Ok(receipt["recorded"].as_bool())
    }

    /// Fails an attempt and its job.
    pub(super) async fn fail(&self, attempt: &Attempt) -> Result<()> {
        let path = format!("/v1/jobs/{}/attempts/{}/failure", attempt.job_id, attempt.attempt);
        let body = json!({"worker_id": self.id, "outcome": "unstable", "message": "bench"});
        self.client.post(&path, &body).await.map(drop)
    }

    pub(super) async fn heartbeat(&self, attempt: Option<&Attempt>) -> Result<()> {
        let attempts = attempt
            .map(|attempt| json!({"job_id": attempt.job_id, "attempt": attempt.attempt, "progress": null}));
        let body = json!({"attempts": attempts.into_iter().collect::<Vec<_>>()});
        self.client.post(&format!("/v1/workers/{}/heartbeat", self.id), &body).await.map(drop)
    }
}

/// Results of the jobs of [`replicate_sweep`] as JSON, which differ in their scenarios only.
pub(super) struct Results {
    /// A result with [`SCENARIO`] and [`DIGEST`] in place of its own.
    template: String,
    /// Scenarios and their digests as JSON, by seed.
    scenarios: HashMap<u64, (String, String)>,
}

const SCENARIO: &str = r#""<scenario>""#;
const DIGEST: &str = r#""<digest>""#;

impl Results {
    pub(super) fn prepare() -> Result<Self> {
        let base = scenario::from_value(&base_scenario()).map_err(|faults| anyhow::anyhow!("{faults:?}"))?;
        let responses = json!({"discharged_kg": 1.0, "regime": "constant"});
        let mut template = serde_json::to_value(sample_result(base.clone(), &responses))?;
        template["scenario"] = json!("<scenario>");
        template["scenario_digest"] = json!("<digest>");
        let entry = |seed| {
            let scenario = Scenario { seed, ..base.clone() };
            Ok((seed, (serde_json::to_string(&scenario)?, serde_json::to_string(&scenario.digest())?)))
        };
        let scenarios = (base.seed..base.seed + MANY_SEEDS).map(entry).collect::<Result<_>>()?;
        Ok(Self { template: template.to_string(), scenarios })
    }

    /// The result of the job with this seed.
    fn of(&self, seed: u64) -> Result<String> {
        let (scenario, digest) = self.scenarios.get(&seed).context("no result for this seed")?;
        Ok(self.template.replacen(DIGEST, digest, 1).replacen(SCENARIO, scenario, 1))
    }
}

/// A result with the size of a small simulation.
pub(super) fn sample_result(scenario: Scenario, responses: &Value) -> RunResult {
    let samples: Vec<f64> = (0..200).map(|sample| f64::from(sample) * 0.02).collect();
    RunResult {
        schema: SCHEMA.to_owned(),
        end_reason: EndReason::Duration,
        instability: None,
        responses: responses.as_object().cloned().unwrap_or_default(),
        curves: Vec::new(),
        warnings: Vec::new(),
        series: vec![Series {
            name: "discharged_mass".to_owned(),
            unit: "kg".to_owned(),
            t_s: samples.clone(),
            values: samples,
        }],
        solver: SolverInfo {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            revision: SOLVER_REVISION,
            backend: "cpu".to_owned(),
            device: "none".to_owned(),
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

/// 99th percentile of times, in milliseconds.
pub(super) fn p99_ms(mut times: Vec<Duration>) -> f64 {
    times.sort();
    let index = (times.len() * 99).div_ceil(100).saturating_sub(1);
    times.get(index).copied().unwrap_or_default().as_secs_f64() * 1000.0
}

/// Times some work.
pub(super) async fn timed<T>(work: impl Future<Output = Result<T>>) -> Result<(T, Duration)> {
    let started = Instant::now();
    let value = work.await?;
    Ok((value, started.elapsed()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn p99_of_a_hundred_times_is_the_second_longest() {
        let times: Vec<_> = (1..=100).rev().map(Duration::from_millis).collect();
        assert_eq!(p99_ms(times), 99.0);
        assert_eq!(p99_ms(vec![Duration::from_millis(7)]), 7.0);
        assert_eq!(p99_ms(Vec::new()), 0.0);
    }
}
