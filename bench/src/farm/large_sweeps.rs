//! Changes of large sweeps: the waits of other requests, and the memory of the server.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use anyhow::{Context, Result};
use tokio::time::sleep;
use uuid::Uuid;

use super::Target;
use super::clients::{Results, SEEDS, SimulatedWorker, random_sweep, replicate_sweep, timed};
use super::measurements::{Rows, start};

const LONGEST_WAIT: &str = "longest wait while 100,000 points are submitted";
const CANCEL_WAIT: &str = "longest wait while they are cancelled";
const DELETE_WAIT: &str = "longest wait while they are deleted";
const LARGE: &str = "large sweep accepted";
const LARGE_MEMORY: &str = "growth of server memory by a large sweep";

/// Measures the requested rows.
pub(super) async fn measure(rows: &mut Rows, results: &Results, many: u64) -> Result<()> {
    if rows.includes(&[LONGEST_WAIT, CANCEL_WAIT, DELETE_WAIT]) {
        large_changes(rows, results).await?;
    }
    if rows.includes(&[LARGE, LARGE_MEMORY]) {
        large_sweep(rows, many).await?;
    }
    Ok(())
}

/// The longest wait of other requests while a sweep of 100,000 points is submitted, cancelled and deleted.
async fn large_changes(rows: &mut Rows, results: &Results) -> Result<()> {
    let data = rows.new_data()?;
    let (_server, client) = start(&data).await?;
    for _ in 0..8 {
        client.post("/v1/sweeps", &replicate_sweep(SEEDS)).await?;
    }
    let (one, two) = (client.register().await?, client.register().await?);
    let submission = async { client.post("/v1/sweeps", &random_sweep(100_000)).await };
    let (sweep, wait) = longest_wait((&one, &two), results, submission).await?;
    rows.add(LONGEST_WAIT, wait, "ms", Target::AtMost(250.0));
    let path = format!("/v1/sweeps/{}", sweep["id"].as_str().context("no id")?);
    let cancel = async { client.post(&format!("{path}/cancel"), &serde_json::json!({})).await };
    let (_, wait) = longest_wait((&one, &two), results, cancel).await?;
    rows.add(CANCEL_WAIT, wait, "ms", Target::AtMost(250.0));
    let (_, wait) = longest_wait((&one, &two), results, client.delete(&path)).await?;
    rows.add(DELETE_WAIT, wait, "ms", Target::AtMost(250.0));
    Ok(())
}

/// Runs some work. Returns the longest wait for a heartbeat, a claim or a result meanwhile, in milliseconds.
async fn longest_wait<T>(
    (one, two): (&SimulatedWorker, &SimulatedWorker),
    results: &Results,
    work: impl Future<Output = Result<T>>,
) -> Result<(T, f64)> {
    const PAUSE: Duration = Duration::from_millis(10);
    let (longest, is_over) = (Mutex::new(Duration::ZERO), AtomicBool::new(false));
    let record = |took: Duration| {
        let mut longest = longest.lock().unwrap_or_else(PoisonError::into_inner);
        *longest = took.max(*longest);
    };
    let beats = async {
        while !is_over.load(Ordering::Relaxed) {
            record(timed(one.heartbeat(None)).await?.1);
            sleep(PAUSE).await;
        }
        anyhow::Ok(())
    };
    let pairs = async {
        while !is_over.load(Ordering::Relaxed) {
            let (attempt, took) = timed(two.claim(Uuid::now_v7(), 0.0)).await?;
            record(took);
            let attempt = attempt.context("the queue is empty")?;
            record(timed(two.deliver(&attempt, results)).await?.1);
            sleep(PAUSE).await;
        }
        anyhow::Ok(())
    };
    let work = async {
        let done = work.await;
        is_over.store(true, Ordering::Relaxed);
        done
    };
    let (done, (), ()) = tokio::try_join!(work, beats, pairs)?;
    let longest = longest.into_inner().unwrap_or_else(PoisonError::into_inner);
    Ok((done, longest.as_secs_f64() * 1000.0))
}

/// A sweep of many points: the time until it is accepted, and the growth of the server's memory meanwhile.
async fn large_sweep(rows: &mut Rows, points: u64) -> Result<()> {
    let data = rows.new_data()?;
    let (server, client) = start(&data).await?;
    // Fills the caches, as in a running service.
    client.post("/v1/sweeps", &random_sweep(10_000)).await?;
    let (before, mut most) = (server.memory_mib()?, 0.0_f64);
    let sweep = random_sweep(points);
    let submission = timed(client.post("/v1/sweeps", &sweep));
    tokio::pin!(submission);
    let (_, took) = loop {
        tokio::select! {
            submitted = &mut submission => break submitted?,
            () = sleep(Duration::from_millis(20)) => most = most.max(server.memory_mib()?),
        }
    };
    rows.add(LARGE, took.as_secs_f64(), "s", Target::AtMost(points as f64 / 5000.0));
    rows.add(LARGE_MEMORY, most - before, "MiB", Target::AtMost(100.0));
    Ok(())
}
