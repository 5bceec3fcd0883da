//! Follows a sweep or a job at a server to its end, on progress bars.

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use anyhow::{Result, bail};
use roost_api::ids::{JobId, SweepId};
use roost_api::job::{FailureClass, JobState, JobView};
use roost_api::sweep::{StateCounts, SweepView};
use roost_worker::client::{Client, ClientError};
use serde_json::Value;
use tokio_util::sync::CancellationToken;

use crate::exit::Exit;
use crate::run::describe;
use crate::ui;
use crate::ui::format;
use crate::ui::meter::{Meter, Meters};

const LOOK_EVERY: Duration = Duration::from_millis(500);
/// More bars than this would fill the screen.
const MAX_JOB_BARS: u32 = 8;
const STOPPED: &str = "stopped watching; the server works on";
/// Width of the names, so that the bars stand under each other.
const NAME: usize = 28;

/// Follows a sweep; a signal ends the watching, not the sweep.
pub(crate) async fn sweep(client: &Client, id: SweepId, shutdown: &CancellationToken) -> Result<SweepView> {
    let started = Instant::now();
    let meters = Meters::default();
    let mut overall = meters.add(format!("{:<NAME$}", "sweep"));
    let mut bars: BTreeMap<JobId, Meter> = BTreeMap::new();
    loop {
        let view = patiently(|| client.sweep(id), shutdown).await?;
        let counts = view.counts;
        let elapsed_s = started.elapsed().as_secs_f64();
        let words = format!("{} of {} jobs done, {} running", counts.ended(), counts.total(), counts.running);
        if counts.is_ended() {
            bars.into_values().for_each(Meter::clear);
            let (fraction, words) = ending(counts, elapsed_s);
            overall.finish(fraction, words);
            return Ok(view);
        }
        let left = format::time_left(view.fraction, elapsed_s).map(|left| format!(" · {left}"));
        overall.show(view.fraction, words + &left.unwrap_or_default());

        let state = Some(JobState::Running);
        let running = patiently(|| client.sweep_jobs(id, state, None, MAX_JOB_BARS), shutdown).await?.items;
        bars.extract_if(.., |id, _| running.iter().all(|job| job.id != *id)).for_each(|(_, bar)| bar.clear());
        for job in &running {
            let bar = bars.entry(job.id).or_insert_with(|| meters.add(format!("{:<NAME$}", short_name(job))));
            show(bar, job);
        }
        pause(shutdown).await?;
    }
}

/// How much of a sweep that has ended was done, and what became of its jobs.
fn ending(counts: StateCounts, elapsed_s: f64) -> (f64, String) {
    let (total, took) = (counts.total(), format::duration(elapsed_s));
    if counts.cancelled > 0 {
        let StateCounts { succeeded, failed, cancelled, .. } = counts;
        let states = format!("{succeeded} succeeded, {failed} failed, {cancelled} cancelled");
        let fraction = (succeeded + failed) as f64 / total as f64;
        return (fraction, format!("cancelled after {took}: of {total} jobs {states}"));
    }
    let failed = if counts.failed > 0 { format!(", {} failed", counts.failed) } else { String::new() };
    (1.0, format!("{total} of {total} jobs done{failed} in {took}"))
}

/// Follows one job; a signal ends the watching, not the job.
pub(crate) async fn job(client: &Client, id: JobId, shutdown: &CancellationToken) -> Result<JobView> {
    let mut meter = Meter::new("job");
    let mut fraction = 0.0;
    loop {
        let view = patiently(|| client.job(id), shutdown).await?;
        if view.state.is_ended() {
            let is_cancelled = view.state == JobState::Cancelled;
            meter.finish(if is_cancelled { fraction } else { 1.0 }, view.state.to_string());
            return Ok(view);
        }
        fraction = view.progress.as_ref().map_or(fraction, |progress| progress.fraction);
        show(&mut meter, &view);
        pause(shutdown).await?;
    }
}

/// How a sweep's end reads as an exit code: 3 when all that failed is the physics of some trial.
pub(crate) async fn exit_of_sweep(client: &Client, sweep: &SweepView) -> Result<Exit> {
    if sweep.counts.succeeded == sweep.counts.total() {
        return Ok(Exit::Done);
    }
    let trials = client.sweep_results(sweep.id).await?.trials;
    let mut others = trials.iter().filter(|trial| trial.state != JobState::Succeeded);
    let is_physics = others.all(|trial| trial.failure_class == Some(FailureClass::Unstable));
    Ok(if is_physics { Exit::Unstable } else { Exit::Failed })
}

fn show(meter: &mut Meter, job: &JobView) {
    match &job.progress {
        Some(progress) => meter.show(progress.fraction, describe(progress)),
        None => meter.show(0.0, job.state.to_string()),
    }
}

/// The levels of a job's factors: words as they are, numbers with their field.
fn short_name(job: &JobView) -> String {
    let names = format::factor_names(job.factors.keys());
    let levels = names.iter().zip(job.factors.values()).map(|(name, level)| match level {
        Value::String(word) => word.clone(),
        other => format!("{name} {}", format::cell(other)),
    });
    let replicate =
        job.replicate.filter(|replicate| *replicate > 0).map(|replicate| format!("replicate {replicate}"));
    format!("  {}", levels.chain(replicate).collect::<Vec<_>>().join(", "))
}

/// Asks until there is an answer: a server that restarts is waited for, which is said once. A signal ends it even
/// while the server keeps us waiting.
async fn patiently<T, F>(ask: impl Fn() -> F, shutdown: &CancellationToken) -> Result<T>
where
    F: Future<Output = Result<T, ClientError>>,
{
    let mut has_complained = false;
    loop {
        let answer = tokio::select! {
            () = shutdown.cancelled() => bail!(STOPPED),
            answer = ask() => answer,
        };
        match answer {
            Ok(answer) => return Ok(answer),
            Err(error) if error.is_transient() => {
                if !std::mem::replace(&mut has_complained, true) {
                    ui::say!("waiting for the server: {error}");
                }
                pause(shutdown).await?;
            }
            Err(error) => return Err(error.into()),
        }
    }
}

async fn pause(shutdown: &CancellationToken) -> Result<()> {
    tokio::select! {
        () = shutdown.cancelled() => bail!(STOPPED),
        () = tokio::time::sleep(LOOK_EVERY) => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sweep_that_was_cancelled_says_so_and_what_became_of_its_jobs() {
        let counts = StateCounts { succeeded: 3, failed: 1, cancelled: 4, ..StateCounts::default() };
        let (fraction, words) = ending(counts, 5.0);
        assert_eq!(fraction, 0.5);
        assert_eq!(words, "cancelled after 5 s: of 8 jobs 3 succeeded, 1 failed, 4 cancelled");
        let (fraction, words) = ending(StateCounts { cancelled: 0, ..counts }, 5.0);
        assert_eq!((fraction, words.as_str()), (1.0, "4 of 4 jobs done, 1 failed in 5 s"));
    }
}
