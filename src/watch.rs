//! Follows a sweep or a job to its end with progress bars.

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use anyhow::{Result, bail};
use roost_api::forecast::Forecast;
use roost_api::ids::{JobId, SweepId};
use roost_api::job::{FailureClass, JobState, JobView};
use roost_api::short_names::short_names;
use roost_api::sweep::{StateCounts, SweepView};
use roost_terminal::progress::{Bar, Bars};
use roost_terminal::{Exit, format, message};
use roost_worker::client::{Client, ClientError};
use serde_json::Value;
use tokio_util::sync::CancellationToken;

use crate::forecast;
use crate::run::describe;

const POLL_INTERVAL: Duration = Duration::from_millis(500);
/// Interval between two reads of the forecast.
const FORECAST_INTERVAL: Duration = Duration::from_secs(3);
/// Maximum number of bars of running jobs.
const MAX_JOB_BARS: u32 = 8;
const STOPPED: &str = "stopped waiting; the jobs continue at the server";
/// Width of the names, which aligns the bars.
const NAME_WIDTH: usize = 28;

/// Follows a sweep to its end. A signal ends only the waiting.
pub(crate) async fn sweep(client: &Client, id: SweepId, shutdown: &CancellationToken) -> Result<SweepView> {
    let started = Instant::now();
    let bars = Bars::default();
    let mut sweep_bar = bars.add(format!("{:<NAME_WIDTH$}", "sweep"));
    let mut job_bars: BTreeMap<JobId, Bar> = BTreeMap::new();
    let mut forecasts = Forecasts::default();
    loop {
        let view = retrying(|| client.sweep(id), shutdown).await?;
        let counts = view.counts;
        let elapsed_s = started.elapsed().as_secs_f64();
        if counts.is_ended() {
            job_bars.into_values().for_each(Bar::clear);
            let (fraction, text) = end_of_sweep(counts, elapsed_s);
            sweep_bar.finish(fraction, &text);
            return Ok(view);
        }
        let ends = forecasts.next(|| client.sweep_forecast(id)).await;
        let text =
            format!("{} of {} jobs done, {} running{ends}", counts.ended(), counts.total(), counts.running);
        sweep_bar.update(view.fraction, &text);

        let state = Some(JobState::Running);
        let running = retrying(|| client.sweep_jobs(id, state, None, MAX_JOB_BARS), shutdown).await?.items;
        let is_over = |id: &JobId| running.iter().all(|job| job.id != *id);
        job_bars.extract_if(.., |id, _| is_over(id)).for_each(|(_, bar)| bar.clear());
        for job in &running {
            let add_bar = || bars.add(format!("{:<NAME_WIDTH$}", short_name(job)));
            update(job_bars.entry(job.id).or_insert_with(add_bar), job);
        }
        pause(shutdown).await?;
    }
}

/// The newest forecast as the end of a line, read every few seconds.
#[derive(Default)]
pub(crate) struct Forecasts {
    read: Option<Instant>,
    text: String,
}

impl Forecasts {
    /// The text; empty without a forecast. A failed request changes nothing: older servers have none.
    pub(crate) async fn next<F>(&mut self, request: impl FnOnce() -> F) -> &str
    where
        F: Future<Output = Result<Forecast, ClientError>>,
    {
        if self.read.is_none_or(|read| read.elapsed() >= FORECAST_INTERVAL) {
            self.read = Some(Instant::now());
            if let Ok(Ok(forecast)) = tokio::time::timeout(FORECAST_INTERVAL, request()).await {
                self.text =
                    forecast::ends_in(&forecast).map_or_else(String::new, |ends| format!(" · {ends}"));
            }
        }
        &self.text
    }
}

/// Fraction done of a sweep that has ended, and a text with the final states of its jobs.
fn end_of_sweep(counts: StateCounts, elapsed_s: f64) -> (f64, String) {
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

/// Follows one job to its end. A signal ends only the waiting.
pub(crate) async fn job(client: &Client, id: JobId, shutdown: &CancellationToken) -> Result<JobView> {
    let mut bar = Bar::new("job");
    let mut fraction = 0.0;
    let mut forecasts = Forecasts::default();
    loop {
        let view = retrying(|| client.job(id), shutdown).await?;
        if view.state.is_ended() {
            let is_cancelled = view.state == JobState::Cancelled;
            bar.finish(if is_cancelled { fraction } else { 1.0 }, view.state.as_str());
            return Ok(view);
        }
        fraction = view.progress.as_ref().map_or(fraction, |progress| progress.fraction);
        match view.state {
            JobState::Queued => {
                let reason = view.waiting.as_ref().map_or_else(String::new, |it| format!(": {}", it.detail));
                let ends = forecasts.next(|| client.job_forecast(id)).await;
                bar.update(0.0, &format!("queued{reason}{ends}"));
            }
            _ => update(&mut bar, &view),
        }
        pause(shutdown).await?;
    }
}

/// The exit code of a sweep: 3 if all jobs without a result have diverged.
pub(crate) async fn exit_of_sweep(client: &Client, sweep: &SweepView) -> Result<Exit> {
    if sweep.counts.succeeded == sweep.counts.total() {
        return Ok(Exit::Done);
    }
    let trials = client.sweep_results(sweep.id).await?.trials;
    let mut failed = trials.iter().filter(|trial| trial.state != JobState::Succeeded);
    let has_diverged = failed.all(|trial| trial.failure_class == Some(FailureClass::Unstable));
    Ok(if has_diverged { Exit::Unstable } else { Exit::Failed })
}

fn update(bar: &mut Bar, job: &JobView) {
    match &job.progress {
        Some(progress) => bar.update(progress.fraction, &describe(progress)),
        None => bar.update(0.0, job.state.as_str()),
    }
}

/// The levels of a job: texts alone, numbers with the name of their factor.
fn short_name(job: &JobView) -> String {
    let names = short_names(&job.factors.keys().collect::<Vec<_>>());
    let levels = names.iter().zip(job.factors.values()).map(|(name, level)| match level {
        Value::String(word) => word.clone(),
        other => format!("{name} {}", format::cell(other)),
    });
    let replicate =
        job.replicate.filter(|replicate| *replicate > 0).map(|replicate| format!("replicate {replicate}"));
    format!("  {}", levels.chain(replicate).collect::<Vec<_>>().join(", "))
}

/// Repeats a request until the server answers, and reports the first failure. A signal ends it, even during a request.
pub(crate) async fn retrying<T, F>(request: impl Fn() -> F, shutdown: &CancellationToken) -> Result<T>
where
    F: Future<Output = Result<T, ClientError>>,
{
    let mut is_reported = false;
    loop {
        let answer = tokio::select! {
            () = shutdown.cancelled() => bail!(STOPPED),
            answer = request() => answer,
        };
        match answer {
            Ok(answer) => return Ok(answer),
            Err(error) if error.is_transient() => {
                if !std::mem::replace(&mut is_reported, true) {
                    message!("waiting for the server: {error}");
                }
                pause(shutdown).await?;
            }
            Err(error) => return Err(error.into()),
        }
    }
}

pub(crate) async fn pause(shutdown: &CancellationToken) -> Result<()> {
    tokio::select! {
        () = shutdown.cancelled() => bail!(STOPPED),
        () = tokio::time::sleep(POLL_INTERVAL) => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn end_of_a_cancelled_sweep_has_the_states_of_its_jobs() {
        let counts = StateCounts { succeeded: 3, failed: 1, cancelled: 4, ..StateCounts::default() };
        let (fraction, text) = end_of_sweep(counts, 5.0);
        assert_eq!(fraction, 0.5);
        assert_eq!(text, "cancelled after 5 s: of 8 jobs 3 succeeded, 1 failed, 4 cancelled");
        let (fraction, text) = end_of_sweep(StateCounts { cancelled: 0, ..counts }, 5.0);
        assert_eq!((fraction, text.as_str()), (1.0, "4 of 4 jobs done, 1 failed in 5 s"));
    }
}
