//! Pairs of a claim and a result: with one server, with two, and beside a transaction that stays open.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::{Duration, Instant};

use anyhow::{Result, bail};
use futures_util::future::try_join_all;
use tokio::time::sleep;
use uuid::Uuid;

use super::Target;
use super::clients::{ApiClient, MANY_SEEDS, Results, replicate_sweep, timed};
use super::measurements::{Rows, start};

const PAIRS: &str = "claim and result pairs, on disk before the answer";
const OF_SLOTS: &str = "claim and result pairs, 8 in one request";
const OF_TWO: &str = "pairs with two servers";
const OF_TWO_WITH_SLOTS: &str = "claim and result pairs, 8 in one request, with two servers";
const BESIDE_A_TRANSACTION: &str = "pairs beside an open transaction, compared with before";

/// Number of workers that claim and deliver at the same time.
const WORKERS: usize = 32;

/// Jobs of a worker with several slots: it claims them together, and delivers their results together.
const SLOTS: u32 = 8;

/// Measures the requested rows. `hold` is the time for which a transaction stays open.
pub(super) async fn measure(
    rows: &mut Rows,
    results: &Arc<Results>,
    length: Duration,
    hold: Duration,
) -> Result<()> {
    if rows.includes(&[PAIRS]) {
        let target = if rows.on_postgres() { 2000.0 } else { 3000.0 };
        let rate = rate_of(rows, (1, 1), results, length).await?;
        rows.add(PAIRS, rate, "1/s", Target::AtLeast(target));
    }
    if rows.includes(&[OF_SLOTS]) {
        let target = if rows.on_postgres() { 2000.0 } else { 3000.0 };
        let rate = rate_of(rows, (1, SLOTS), results, length).await?;
        rows.add(OF_SLOTS, rate, "1/s", Target::AtLeast(target));
    }
    if rows.on_postgres() && rows.includes(&[OF_TWO]) {
        let rate = rate_of(rows, (2, 1), results, length).await?;
        rows.add(OF_TWO, rate, "1/s", Target::AtLeast(3000.0));
    }
    if rows.on_postgres() && rows.includes(&[OF_TWO_WITH_SLOTS]) {
        let rate = rate_of(rows, (2, SLOTS), results, length).await?;
        rows.add(OF_TWO_WITH_SLOTS, rate, "1/s", Target::AtLeast(3000.0));
    }
    if rows.includes(&[BESIDE_A_TRANSACTION]) {
        beside_a_transaction(rows, results, length, hold).await?;
    }
    Ok(())
}

/// Pairs per second through a server, or in turns through two servers of one PostgreSQL database, by workers with some slots.
async fn rate_of(
    rows: &Rows,
    (servers, slots): (usize, u32),
    results: &Arc<Results>,
    length: Duration,
) -> Result<f64> {
    let data = rows.new_data()?;
    let mut running = Vec::new();
    for _ in 0..servers {
        running.push(start(&data).await?);
    }
    let client = &running[0].1;
    let jobs = 8000 * length.as_secs();
    for _ in 0..jobs.div_ceil(MANY_SEEDS) {
        client.post("/v1/sweeps", &replicate_sweep(MANY_SEEDS)).await?;
    }
    let until = Instant::now() + length;
    let worker = async |client: ApiClient| {
        let worker = client.register().await?;
        let mut done = 0_u64;
        while Instant::now() < until {
            let attempts = worker.claim_up_to(slots, Uuid::now_v7(), 0.0).await?;
            done += match attempts.as_slice() {
                [] => bail!("the queue is empty"),
                [attempt] => u64::from(worker.deliver(attempt, results).await? == Some(true)),
                attempts => worker.deliver_together(attempts, results).await?,
            };
        }
        anyhow::Ok(done)
    };
    let workers = (0..WORKERS).map(|number| worker(running[number % servers].1.clone()));
    let (done, took) = timed(async { try_join_all(workers).await }).await?;
    Ok(done.iter().sum::<u64>() as f64 / took.as_secs_f64())
}

/// The rate at the end of a transaction that was open for `hold`, in percent of the rate before it. Workers claim and deliver all the
/// time, so that the transaction holds back what a vacuum or a checkpoint would clear away.
async fn beside_a_transaction(
    rows: &mut Rows,
    results: &Arc<Results>,
    length: Duration,
    hold: Duration,
) -> Result<()> {
    /// Queued jobs that are kept ready.
    const READY: u64 = 2 * MANY_SEEDS;
    let data = rows.new_data()?;
    let (_server, client) = start(&data).await?;
    let (done, is_over) = (AtomicU64::new(0), AtomicBool::new(false));
    let worker = async |client: &ApiClient| {
        let worker = client.register().await?;
        while !is_over.load(Ordering::Relaxed) {
            match worker.claim(Uuid::now_v7(), 0.0).await? {
                Some(attempt) => {
                    worker.deliver(&attempt, results).await?;
                    done.fetch_add(1, Ordering::Relaxed);
                }
                None => sleep(Duration::from_millis(5)).await,
            }
        }
        anyhow::Ok(())
    };
    let submitter = async {
        let mut submitted = 0;
        while !is_over.load(Ordering::Relaxed) {
            if submitted < done.load(Ordering::Relaxed) + READY {
                client.post("/v1/sweeps", &replicate_sweep(MANY_SEEDS)).await?;
                submitted += MANY_SEEDS;
            } else {
                sleep(Duration::from_millis(5)).await;
            }
        }
        anyhow::Ok(())
    };
    let rate = async || {
        let (before, started) = (done.load(Ordering::Relaxed), Instant::now());
        sleep(length).await;
        (done.load(Ordering::Relaxed) - before) as f64 / started.elapsed().as_secs_f64()
    };
    let windows = async {
        // The queue fills, and the caches with it.
        sleep(Duration::from_secs(5)).await;
        let before = rate().await;
        let transaction = data.open_transaction().await?;
        sleep(hold.saturating_sub(length)).await;
        let beside = rate().await;
        drop(transaction);
        is_over.store(true, Ordering::Relaxed);
        anyhow::Ok((before, beside))
    };
    let workers = try_join_all((0..WORKERS).map(|_| worker(&client)));
    let ((before, beside), (), _) = tokio::try_join!(windows, submitter, workers)?;
    rows.add(BESIDE_A_TRANSACTION, 100.0 * beside / before, "%", Target::AtLeast(50.0));
    Ok(())
}
