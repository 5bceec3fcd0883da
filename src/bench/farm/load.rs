//! Users and workers that speak to a server without simulating anything.

use std::collections::HashMap;
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail};
use reqwest::{Client, Response, StatusCode};
use roost_api::ids::WorkerId;
use roost_api::{API_VERSION, RunResult, Series};
use roost_solver::SOLVER_REVISION;
use roost_solver::result::{EndReason, Performance, SCHEMA, SolverInfo};
use roost_solver::scenario::{self, Scenario};
use roost_worker::client::{MAX_IDLE, prepare_tls};
use serde::Deserialize;
use serde_json::{Value, json};
use uuid::Uuid;

/// Seeds of the jobs of one sweep; results are written out once for each.
pub(super) const SEEDS: u64 = 500;

/// The scenario of every job.
fn base() -> Value {
    json!({"experiment": "hopper", "product": {"count": 6, "subparticle_radius_m": 0.008}})
}

/// A sweep of that many jobs that no store answers.
pub(super) fn sweep(jobs: u64) -> Value {
    json!({"name": "bench", "base": base(), "design": {"kind": "grid"}, "factors": [], "replicates": jobs,
           "cache": "bypass"})
}

/// A sweep over two fields, of that many points.
pub(super) fn grid(points: usize) -> Value {
    let side = (points as f64).sqrt().round() as usize;
    let levels = |low: f64, high: f64| -> Vec<f64> {
        (0..side).map(|step| low + (high - low) * step as f64 / side as f64).collect()
    };
    json!({"name": "bench", "base": base(), "design": {"kind": "grid"}, "cache": "bypass",
           "factors": [{"pointer": "/equipment/gate_opening_m", "levels": levels(0.04, 0.08)},
                       {"pointer": "/equipment/belt_speed_m_s", "levels": levels(0.1, 0.4)}]})
}

/// Connections to one server.
#[derive(Clone)]
pub(super) struct Load {
    http: Client,
    url: String,
}

/// An attempt, as far as a worker without a solver cares.
#[derive(Clone, Debug, Deserialize)]
pub(super) struct Attempt {
    pub(super) job_id: Uuid,
    pub(super) attempt: u32,
    scenario: Seeded,
}

#[derive(Clone, Debug, Deserialize)]
struct Seeded {
    seed: u64,
}

#[derive(Deserialize)]
struct Claimed {
    attempts: Vec<Attempt>,
}

impl Load {
    pub(super) fn on(url: &str) -> Result<Self> {
        prepare_tls();
        let http = Client::builder()
            .no_proxy()
            .pool_idle_timeout(MAX_IDLE)
            .timeout(Duration::from_secs(120))
            .build()?;
        Ok(Self { http, url: url.to_owned() })
    }

    pub(super) async fn get(&self, path: &str, seen: Option<&str>) -> Result<Response> {
        let mut request = self.http.get(format!("{}{path}", self.url));
        if let Some(tag) = seen {
            request = request.header("if-none-match", tag);
        }
        Ok(request.send().await?)
    }

    pub(super) async fn post(&self, path: &str, body: &Value) -> Result<Value> {
        let response = self.http.post(format!("{}{path}", self.url)).json(body).send().await?;
        answer(path, response).await?.json().await.context("no JSON")
    }

    pub(super) async fn register(&self) -> Result<Worker> {
        let id = WorkerId::new();
        let registration = json!({"worker_id": id, "name": "bench", "api_version": API_VERSION, "backend": "cpu",
            "solver_revision": SOLVER_REVISION, "device": "none", "threads": 1});
        self.post("/v1/workers", &registration).await?;
        Ok(Worker { load: self.clone(), id })
    }
}

async fn answer(path: &str, response: Response) -> Result<Response> {
    let status = response.status();
    if !status.is_success() {
        bail!("{path}: {status} {}", response.text().await.unwrap_or_default());
    }
    Ok(response)
}

/// A worker that runs nothing.
#[derive(Clone)]
pub(super) struct Worker {
    load: Load,
    pub(super) id: WorkerId,
}

impl Worker {
    pub(super) async fn claim(&self, request: Uuid, wait_s: f64) -> Result<Option<Attempt>> {
        let body = json!({"request_id": request, "worker_id": self.id, "max_jobs": 1, "wait_s": wait_s});
        let response = self.load.http.post(format!("{}/v1/claims", self.load.url)).json(&body).send().await?;
        let claimed: Claimed = answer("/v1/claims", response).await?.json().await?;
        Ok(claimed.attempts.into_iter().next())
    }

    /// Delivers the result of an attempt; says whether it was recorded now, or none when it is stale.
    pub(super) async fn deliver(&self, attempt: &Attempt, results: &Results) -> Result<Option<bool>> {
        let Attempt { job_id, attempt: number, scenario } = attempt;
        let path = format!("/v1/jobs/{job_id}/attempts/{number}/result");
        let result = results.0.get(&scenario.seed).context("a job of another bench")?;
        let body = format!(r#"{{"worker_id": "{}", "result": {result}}}"#, self.id);
        let request = self.load.http.post(format!("{}{path}", self.load.url));
        let response = request.header("content-type", "application/json").body(body).send().await?;
        if response.status() == StatusCode::CONFLICT {
            return Ok(None);
        }
        let receipt: Value = answer(&path, response).await?.json().await?;
        Ok(receipt["recorded"].as_bool())
    }

    /// Ends an attempt without a result, and its job for good.
    pub(super) async fn fail(&self, attempt: &Attempt) -> Result<()> {
        let path = format!("/v1/jobs/{}/attempts/{}/failure", attempt.job_id, attempt.attempt);
        let body = json!({"worker_id": self.id, "outcome": "unstable", "message": "a bench"});
        self.load.post(&path, &body).await.map(drop)
    }

    pub(super) async fn beat(&self, attempt: Option<&Attempt>) -> Result<()> {
        let held =
            attempt.map(|held| json!({"job_id": held.job_id, "attempt": held.attempt, "progress": null}));
        let body = json!({"attempts": held.into_iter().collect::<Vec<_>>()});
        self.load.post(&format!("/v1/workers/{}/heartbeat", self.id), &body).await.map(drop)
    }
}

/// Results of the jobs of [`sweep`], written out, by seed.
pub(super) struct Results(HashMap<u64, String>);

impl Results {
    pub(super) fn prepare() -> Result<Self> {
        let plain = scenario::from_value(&base()).map_err(|faults| anyhow::anyhow!("{faults:?}"))?;
        let written = |seed| {
            let scenario = Scenario { seed, ..plain.clone() };
            Ok((seed, serde_json::to_string(&result_of(scenario))?))
        };
        Ok(Self((plain.seed..plain.seed + SEEDS).map(written).collect::<Result<_>>()?))
    }
}

/// A result of the size of a small one.
fn result_of(scenario: Scenario) -> RunResult {
    let samples: Vec<f64> = (0..200).map(|sample| f64::from(sample) * 0.02).collect();
    let responses = json!({"discharged_kg": 1.0, "regime": "constant"});
    RunResult {
        schema: SCHEMA.to_owned(),
        end_reason: EndReason::Duration,
        instability: None,
        responses: responses.as_object().cloned().unwrap_or_default(),
        curves: Vec::new(),
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

/// The time that 99 in 100 do not exceed, in milliseconds.
pub(super) fn p99_ms(mut times: Vec<Duration>) -> f64 {
    times.sort();
    let index = (times.len() * 99).div_ceil(100).saturating_sub(1);
    times.get(index).copied().unwrap_or_default().as_secs_f64() * 1000.0
}

/// Times one thing.
pub(super) async fn timed<T>(work: impl Future<Output = Result<T>>) -> Result<(T, Duration)> {
    let started = Instant::now();
    let value = work.await?;
    Ok((value, started.elapsed()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_a_hundred_times_the_second_longest_is_told() {
        let times: Vec<_> = (1..=100).rev().map(Duration::from_millis).collect();
        assert_eq!(p99_ms(times), 99.0);
        assert_eq!(p99_ms(vec![Duration::from_millis(7)]), 7.0);
        assert_eq!(p99_ms(Vec::new()), 0.0);
    }
}
