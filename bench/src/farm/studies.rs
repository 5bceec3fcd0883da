//! A study with many workers: whether its decisions keep them busy.

use std::time::{Duration, Instant};

use anyhow::{Context, Result};
use futures_util::future::try_join_all;
use roost_solver::scenario;
use serde_json::{Value, json};
use tokio::time::sleep_until;
use uuid::Uuid;

use super::Target;
use super::clients::{ApiClient, base_scenario, sample_result};
use super::measurements::{Rows, start};

const BUSY: &str = "busy share of 200 workers of a study";
const RUNS: &str = "runs of the study when it was over";

/// Number of workers.
const WORKERS: u64 = 200;

/// Shortest and longest duration of a simulated run, in seconds.
const RUN_S: (f64, f64) = (3.0, 7.0);

/// Time from the first claim on that is not measured: the queue fills.
const START: Duration = Duration::from_secs(10);

/// Measures the requested rows. The workers are observed for six lengths.
pub(super) async fn measure(rows: &mut Rows, length: Duration) -> Result<()> {
    if !rows.includes(&[BUSY, RUNS]) {
        return Ok(());
    }
    let data = rows.new_data()?;
    let (_server, client) = start(&data).await?;
    let study = client.post("/v1/studies", &question()).await?;
    let from = Instant::now() + START;
    let until = from + 6 * length;
    let workers = (0..WORKERS).map(|number| work(client.clone(), number, (from, until)));
    let waited: Duration = try_join_all(workers).await?.into_iter().sum();
    let share = 1.0 - waited.as_secs_f64() / (WORKERS as f64 * (until - from).as_secs_f64());
    rows.add(BUSY, 100.0 * share, "%", Target::AtLeast(95.0));
    let path = format!("/v1/studies/{}", study["id"].as_str().context("no id")?);
    let view: Value = client.get(&path, None).await?.json().await?;
    let done = view["runs"]["done"].as_f64().context("no runs")?;
    rows.add(RUNS, done, "", Target::AtLeast(6.0 * 30.0 * length.as_secs_f64()));
    Ok(())
}

/// A question that needs more runs than can be made.
fn question() -> Value {
    json!({"name": "bench", "base": base_scenario(), "cache": "bypass",
           "factors": [{"pointer": "/equipment/gate_opening_m", "low": 0.03, "high": 0.08},
                       {"pointer": "/equipment/belt_speed_m_s", "low": 0.1, "high": 0.4}],
           "goal": {"boundary": {"of": {"probability": "jammed"}, "level": 0.2, "misclassified": 1e-4}},
           "budget": {"max_runs": 100_000}})
}

/// Works until a moment. Returns how long the worker had no run in the measured time.
async fn work(client: ApiClient, number: u64, (from, until): (Instant, Instant)) -> Result<Duration> {
    let worker = client.register().await?;
    let mut random = fastrand::Rng::with_seed(number);
    let mut waited = Duration::ZERO;
    let mut free = Instant::now();
    while free < until {
        let attempt = worker.claim_with::<Value>(Uuid::now_v7(), 10.0).await?;
        let claimed = Instant::now();
        waited += claimed.min(until).saturating_duration_since(free.max(from));
        free = claimed;
        let Some(attempt) = attempt else { continue };
        let end = claimed + Duration::from_secs_f64(RUN_S.0 + (RUN_S.1 - RUN_S.0) * random.f64());
        if end > until {
            sleep_until(until.into()).await;
            break;
        }
        sleep_until(end.into()).await;
        let scenario =
            scenario::from_value(&attempt.scenario).map_err(|faults| anyhow::anyhow!("{faults:?}"))?;
        let gate_m = attempt.scenario["equipment"]["gate_opening_m"].as_f64().context("no gate")?;
        let jam_probability = 1.0 / (1.0 + ((gate_m - 0.05) / 0.005).exp());
        let responses = json!({"jammed": u8::from(random.f64() < jam_probability)});
        let result = serde_json::to_string(&sample_result(scenario, &responses))?;
        free = Instant::now();
        worker.deliver_result(&attempt, &result).await?;
    }
    Ok(waited)
}
