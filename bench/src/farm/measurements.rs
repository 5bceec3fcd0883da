//! The measurement of each target.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use anyhow::{Context, Result};
use futures_util::future::{join_all, try_join_all};
use roost_terminal::message;
use tokio::time::sleep;
use uuid::Uuid;

use super::clients::{ApiClient, Results, SEEDS, grid_sweep, p99_ms, replicate_sweep, timed};
use super::data::{Data, Postgres};
use super::server::Server;
use super::{Args, Row, Target, large_sweeps, pairs, studies};

const CLAIM: &str = "claim with 100,000 queued, p99";
const CLAIM_OF_MANY: &str = "claim with many queued, p99";
const WAITING: &str = "submission to claim by a waiting worker, p99";
const SWEEP: &str = "sweep of 10,000 points accepted";
const POLLS: &str = "polls of an unchanged sweep answered 304";
const POLLS_CPU: &str = "CPU of 200 polls a second";
const BEATS_CPU: &str = "CPU of 2,000 workers that beat every 2 s";
const LOST: &str = "jobs lost by 20 kills of the server";
const TWICE: &str = "results recorded twice";
const STALE: &str = "stale writes accepted";
const MEMORY: &str = "server memory with many jobs";
const STOP: &str = "SIGTERM with 50 open event streams";

/// Measures the requested rows.
pub(super) async fn measure(args: &Args) -> Result<Vec<Row>> {
    let postgres = args.postgres.as_deref().map(Postgres::at).transpose()?;
    let mut rows = Rows { only: args.only.clone(), postgres, rows: Vec::new() };
    let length = Duration::from_secs(args.seconds);
    let results = Arc::new(Results::prepare()?);
    pairs::measure(&mut rows, &results, length, Duration::from_secs(args.hold.max(args.seconds))).await?;
    if rows.includes(&[SWEEP, WAITING, POLLS, POLLS_CPU, STOP]) {
        waiting_and_polls(&mut rows, length).await?;
    }
    if rows.includes(&[BEATS_CPU]) {
        heartbeats(&mut rows, length).await?;
    }
    if rows.includes(&[LOST, TWICE, STALE]) {
        kills(&mut rows, &results).await?;
    }
    if rows.includes(&[CLAIM, CLAIM_OF_MANY, MEMORY]) {
        many_jobs(&mut rows, args.many).await?;
    }
    large_sweeps::measure(&mut rows, &results, args.many).await?;
    studies::measure(&mut rows, length).await?;
    Ok(rows.rows)
}

/// The measured rows.
pub(super) struct Rows {
    only: Vec<String>,
    postgres: Option<Postgres>,
    rows: Vec<Row>,
}

impl Rows {
    /// Whether one of these is asked for.
    pub(super) fn includes(&self, names: &[&str]) -> bool {
        self.only.is_empty() || names.iter().any(|name| self.only.iter().any(|start| name.starts_with(start)))
    }

    /// Whether the servers use PostgreSQL.
    pub(super) fn on_postgres(&self) -> bool {
        self.postgres.is_some()
    }

    /// An empty folder and an empty database for a server.
    pub(super) fn new_data(&self) -> Result<Data> {
        Data::new(self.postgres.clone())
    }

    /// Adds a row that is asked for.
    pub(super) fn add(&mut self, name: &'static str, value: f64, unit: &'static str, target: Target) {
        if self.includes(&[name]) {
            message!("{name}: {value:.3} {unit}");
            self.rows.push(Row { name, value, unit, target, reached: target.is_reached(value) });
        }
    }
}

/// Starts a server.
pub(super) async fn start(data: &Data) -> Result<(Server, ApiClient)> {
    let server = Server::start(data).await?;
    let client = ApiClient::new(&server.url)?;
    Ok((server, client))
}

async fn waiting_and_polls(rows: &mut Rows, length: Duration) -> Result<()> {
    let data = rows.new_data()?;
    let (server, client) = start(&data).await?;
    // Fills the caches, as in a running service.
    client.post("/v1/sweeps", &grid_sweep(4)).await?;
    let (accepted, took) = timed(client.post("/v1/sweeps", &grid_sweep(10_000))).await?;
    rows.add(SWEEP, took.as_secs_f64(), "s", Target::AtMost(1.0));
    let id = accepted["id"].as_str().context("no id")?.to_owned();
    polls(rows, &server, &client, &id, length).await?;
    client.post(&format!("/v1/sweeps/{id}/cancel"), &serde_json::json!({})).await?;
    let worker = client.register().await?;
    while worker.claim(Uuid::now_v7(), 0.0).await?.is_some() {}
    let mut times = Vec::new();
    for _ in 0..20 * length.as_secs() {
        let waiting = tokio::spawn({
            let worker = worker.clone();
            async move {
                worker.claim(Uuid::now_v7(), 30.0).await.map(|claimed| (claimed.is_some(), Instant::now()))
            }
        });
        sleep(Duration::from_millis(5)).await;
        let submitted = Instant::now();
        client.post("/v1/sweeps", &replicate_sweep(1)).await?;
        let (claimed, at) = waiting.await??;
        anyhow::ensure!(claimed, "a claim returned no attempt");
        times.push(at - submitted);
    }
    rows.add(WAITING, p99_ms(times), "ms", Target::AtMost(25.0));
    let streams = try_join_all((0..50).map(|_| async {
        let mut stream = client.get(&format!("/v1/sweeps/{id}/events"), None).await?;
        stream.chunk().await?.context("an empty stream")?;
        anyhow::Ok(stream)
    }))
    .await?;
    rows.add(STOP, server.terminate().await?.as_secs_f64(), "s", Target::AtMost(5.0));
    drop(streams);
    Ok(())
}

/// 200 clients poll once a second, evenly spread over the second.
async fn polls(
    rows: &mut Rows,
    server: &Server,
    client: &ApiClient,
    id: &str,
    length: Duration,
) -> Result<()> {
    let (path, until) = (format!("/v1/sweeps/{id}"), Instant::now() + length);
    let before = server.cpu_s()?;
    let poller = async |number: u32| {
        sleep(Duration::from_millis(u64::from(number) * 5)).await;
        let (mut etag, mut unchanged, mut total) = (None::<String>, 0_u64, 0_u64);
        while Instant::now() < until {
            let next = Instant::now() + Duration::from_secs(1);
            let answer = client.get(&path, etag.as_deref()).await?;
            total += 1;
            unchanged += u64::from(answer.status() == 304);
            let header = answer.headers().get("etag").and_then(|header| header.to_str().ok());
            etag = header.map(str::to_owned);
            answer.bytes().await?;
            tokio::time::sleep_until(next.into()).await;
        }
        anyhow::Ok((unchanged, total))
    };
    let (answers, took) = timed(async { try_join_all((0..200).map(poller)).await }).await?;
    let (unchanged, total) = answers.iter().fold((0, 0), |sum, one| (sum.0 + one.0, sum.1 + one.1));
    // The first poll of each client has no ETag.
    rows.add(POLLS, 100.0 * unchanged as f64 / (total - 200).max(1) as f64, "%", Target::AtLeast(95.0));
    let cpu = 100.0 * (server.cpu_s()? - before) / took.as_secs_f64();
    rows.add(POLLS_CPU, cpu, "% of a core", Target::AtMost(5.0));
    Ok(())
}

async fn heartbeats(rows: &mut Rows, length: Duration) -> Result<()> {
    const MANY: u64 = 2000;
    let data = rows.new_data()?;
    let (server, client) = start(&data).await?;
    for _ in 0..MANY.div_ceil(SEEDS) {
        client.post("/v1/sweeps", &replicate_sweep(SEEDS)).await?;
    }
    let mut workers = Vec::new();
    for _ in 0..MANY {
        let worker = client.register().await?;
        let attempt = worker.claim(Uuid::now_v7(), 0.0).await?;
        workers.push((worker, attempt));
    }
    let (before, until) = (server.cpu_s()?, Instant::now() + length);
    let beating = workers.iter().enumerate().map(async |(number, (worker, attempt))| {
        sleep(Duration::from_millis(number as u64)).await;
        while Instant::now() < until {
            let next = Instant::now() + Duration::from_secs(2);
            worker.heartbeat(attempt.as_ref()).await?;
            tokio::time::sleep_until(next.into()).await;
        }
        anyhow::Ok(())
    });
    let (_, took) = timed(async { try_join_all(beating).await }).await?;
    let cpu = 100.0 * (server.cpu_s()? - before) / took.as_secs_f64();
    rows.add(BEATS_CPU, cpu, "% of a core", Target::AtMost(50.0));
    Ok(())
}

/// Kills the server repeatedly while workers claim and deliver. `tests/faults/` does more, with real workers.
async fn kills(rows: &mut Rows, results: &Arc<Results>) -> Result<()> {
    let data = rows.new_data()?;
    let (mut server, client) = start(&data).await?;
    let mut submitted = 0;
    for _ in 0..20 {
        client.post("/v1/sweeps", &replicate_sweep(SEEDS)).await?;
        submitted += SEEDS;
    }
    let recorded = Arc::new(Mutex::new(HashMap::<Uuid, Vec<u32>>::new()));
    let newest = Arc::new(Mutex::new(HashMap::<Uuid, u32>::new()));
    let worker = async |number: usize| {
        let worker = client.register().await?;
        let mut empty_claims_left = 50;
        let mut request = Uuid::now_v7();
        while empty_claims_left > 0 {
            let Ok(claimed) = worker.claim(request, 0.2).await else {
                sleep(Duration::from_millis(20)).await;
                continue;
            };
            request = Uuid::now_v7();
            let Some(attempt) = claimed else {
                empty_claims_left -= 1;
                continue;
            };
            record_newest(&newest, attempt.job_id, attempt.attempt);
            // Some workers wait, so that a kill hits them between claim and delivery.
            sleep(Duration::from_millis(number as u64 % 4)).await;
            let receipt = loop {
                match worker.deliver(&attempt, results).await {
                    Ok(receipt) => break receipt,
                    Err(_) => sleep(Duration::from_millis(20)).await,
                }
            };
            if receipt == Some(true) {
                let mut recorded = recorded.lock().unwrap_or_else(PoisonError::into_inner);
                recorded.entry(attempt.job_id).or_default().push(attempt.attempt);
            }
        }
        anyhow::Ok(())
    };
    let working = join_all((0..16).map(worker));
    let killing = async {
        for _ in 0..20 {
            sleep(Duration::from_millis(fastrand::u64(50..300))).await;
            server = server.kill_and_restart(&data).await?;
        }
        anyhow::Ok(server)
    };
    let (worked, server) = tokio::join!(working, killing);
    worked.into_iter().collect::<Result<Vec<_>>>()?;
    let server = server?;
    let page: serde_json::Value = client.get("/v1/sweeps?limit=500", None).await?.json().await?;
    let sweeps = page["items"].as_array().context("no sweeps")?;
    let succeeded: u64 = sweeps.iter().filter_map(|sweep| sweep["counts"]["succeeded"].as_u64()).sum();
    let recorded = recorded.lock().unwrap_or_else(PoisonError::into_inner);
    let newest = newest.lock().unwrap_or_else(PoisonError::into_inner);
    let twice = recorded.values().filter(|attempts| attempts.len() > 1).count();
    let stale =
        recorded.iter().filter(|(job, attempts)| newest.get(job).is_some_and(|n| attempts[0] < *n)).count();
    rows.add(LOST, (submitted - succeeded) as f64, "jobs", Target::AtMost(0.0));
    rows.add(TWICE, twice as f64, "results", Target::AtMost(0.0));
    rows.add(STALE, stale as f64, "writes", Target::AtMost(0.0));
    drop(server);
    Ok(())
}

fn record_newest(newest: &Mutex<HashMap<Uuid, u32>>, job: Uuid, attempt: u32) {
    let mut newest = newest.lock().unwrap_or_else(PoisonError::into_inner);
    let known = newest.entry(job).or_default();
    *known = attempt.max(*known);
}

async fn many_jobs(rows: &mut Rows, jobs: u64) -> Result<()> {
    const BATCH: u64 = 10_000;
    let data = rows.new_data()?;
    let (server, client) = start(&data).await?;
    let worker = client.register().await?;
    let claims = async || {
        let mut times = Vec::new();
        for _ in 0..500 {
            let (claimed, took) = timed(worker.claim(Uuid::now_v7(), 0.0)).await?;
            times.push(took);
            // A claim without an end would be lost and run alone.
            worker.fail(&claimed.context("the queue is empty")?).await?;
        }
        anyhow::Ok(p99_ms(times))
    };
    let fill = async |from: u64, to: u64| {
        for _ in from / BATCH..to / BATCH {
            client.post("/v1/sweeps", &replicate_sweep(BATCH)).await?;
        }
        anyhow::Ok(())
    };
    let first = jobs.min(100_000);
    fill(0, first).await?;
    rows.add(CLAIM, claims().await?, "ms", Target::AtMost(10.0));
    if rows.includes(&[CLAIM_OF_MANY, MEMORY]) {
        fill(first, jobs).await?;
        rows.add(CLAIM_OF_MANY, claims().await?, "ms", Target::AtMost(10.0));
        rows.add(MEMORY, server.memory_mib()?, "MiB", Target::AtMost(100.0));
    }
    Ok(())
}
