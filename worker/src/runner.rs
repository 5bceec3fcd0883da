//! Runs one scenario on a thread of its own: progress comes out through a watch channel, a stop flag goes in.
//!
//! Whatever happens in the solver, a [`Run`] ends with exactly one [`RunEnd`]; a panic is one too.

use std::any::Any;
use std::sync::atomic::{AtomicU8, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

use roost_api::job::AttemptOutcome;
use roost_api::{Progress, RunResult};
use roost_solver::engine::run::Snapshot;
use roost_solver::result::EndReason;
use roost_solver::scenario::{self, Fault};
use roost_solver::{CpuOptions, Flow, Limits, Observer};
use serde_json::Value;
use tokio::sync::watch;
use tokio::task::JoinHandle;

/// How a run ended.
#[derive(Debug)]
pub enum RunEnd {
    /// With the job's result.
    Finished(RunResult),
    /// Without it.
    Failed {
        /// In which way.
        outcome: AttemptOutcome,
        /// In words.
        message: String,
        /// The partial result, if the physics got that far.
        result: Option<RunResult>,
    },
    /// Nobody wants to hear of it any more.
    Abandoned,
}

impl RunEnd {
    fn failed(outcome: AttemptOutcome, message: impl Into<String>) -> Self {
        Self::Failed { outcome, message: message.into(), result: None }
    }
}

/// Why a run is to stop before its end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Stop {
    /// Somebody cancelled the job: keep the partial result.
    Cancel = 1,
    /// The worker drains: hand the attempt back.
    Release,
    /// The attempt is stale: say nothing.
    Abandon,
    /// It ran longer than it may.
    Timeout,
}

/// Set once by whoever is first; the solver looks at it with every progress report.
#[derive(Clone, Debug, Default)]
pub struct StopFlag(Arc<AtomicU8>);

impl StopFlag {
    /// Asks the run to stop. The first reason stays, except that `Abandon` beats all others.
    pub fn set(&self, why: Stop) {
        if why == Stop::Abandon {
            self.0.store(why as u8, Ordering::Relaxed);
        } else {
            let _ = self.0.compare_exchange(0, why as u8, Ordering::Relaxed, Ordering::Relaxed);
        }
    }

    /// Why the run is to stop, if it is.
    pub fn get(&self) -> Option<Stop> {
        [Stop::Cancel, Stop::Release, Stop::Abandon, Stop::Timeout]
            .into_iter()
            .find(|why| *why as u8 == self.0.load(Ordering::Relaxed))
    }
}

/// Who takes pictures of a run; shared, so that whoever hands it in can ask it what became of them.
pub type Pictures = Arc<Mutex<dyn Observer + Send>>;

/// A run under way.
#[derive(Debug)]
pub struct Run {
    /// The newest progress; none before the first report.
    pub progress: watch::Receiver<Option<Progress>>,
    /// Asks it to stop.
    pub stop: StopFlag,
    thread: JoinHandle<RunEnd>,
}

impl Run {
    /// Starts a scenario document. Must be called within a tokio runtime.
    pub fn start(document: Value, threads: usize, max_wall_s: Option<f64>) -> Self {
        Self::start_pictured(document, threads, max_wall_s, None)
    }

    /// Starts a scenario document of which somebody takes pictures, on the run's thread. Must be called within a tokio
    /// runtime.
    pub fn start_pictured(
        document: Value,
        threads: usize,
        max_wall_s: Option<f64>,
        pictures: Option<Pictures>,
    ) -> Self {
        Self::start_with(max_wall_s, pictures, move |observer| {
            let scenario = scenario::from_value(&document)?;
            roost_solver::check(&scenario, &Limits { max_subparticles: u64::MAX, max_steps: u64::MAX })?;
            Ok(roost_solver::simulate(&scenario, CpuOptions { threads }, observer))
        })
    }

    /// Starts anything that reports progress and gives a result, as the solver does.
    fn start_with<F>(max_wall_s: Option<f64>, pictures: Option<Pictures>, solve: F) -> Self
    where
        F: FnOnce(&mut dyn Observer) -> Result<RunResult, Vec<Fault>> + Send + 'static,
    {
        let (sender, progress) = watch::channel(None);
        let stop = StopFlag::default();
        let flag = stop.clone();
        let thread = tokio::task::spawn_blocking(move || {
            let started = Instant::now();
            let report = |progress: &Progress| {
                sender.send_replace(Some(progress.clone()));
                if max_wall_s.is_some_and(|limit| started.elapsed().as_secs_f64() > limit) {
                    flag.set(Stop::Timeout);
                }
                if flag.get().is_some() { Flow::Cancel } else { Flow::Continue }
            };
            let outcome = solve(&mut Watched { report, pictures });
            judge(outcome, flag.get(), max_wall_s)
        });
        Self { progress, stop, thread }
    }

    /// Waits for the end.
    pub async fn end(self) -> RunEnd {
        match self.thread.await {
            Ok(end) => end,
            Err(error) if error.is_panic() => RunEnd::failed(
                AttemptOutcome::Worker,
                format!("the solver panicked: {}", panic_text(&*error.into_panic())),
            ),
            Err(_) => RunEnd::failed(AttemptOutcome::Worker, "the run's thread was dropped"),
        }
    }
}

/// Reports progress here, has pictures taken there.
struct Watched<F> {
    report: F,
    pictures: Option<Pictures>,
}

impl<F: FnMut(&Progress) -> Flow> Observer for Watched<F> {
    fn progress(&mut self, progress: &Progress) -> Flow {
        (self.report)(progress)
    }

    fn wants_snapshot(&self, simulated_s: f64) -> bool {
        let pictures = self.pictures.as_ref().map(|pictures| pictures.lock());
        pictures.is_some_and(|p| p.unwrap_or_else(PoisonError::into_inner).wants_snapshot(simulated_s))
    }

    fn snapshot(&mut self, snapshot: &Snapshot<'_>) {
        if let Some(pictures) = &self.pictures {
            pictures.lock().unwrap_or_else(PoisonError::into_inner).snapshot(snapshot);
        }
    }
}

/// What the solver's answer means, given what it had been asked. A run that came to its own end before it saw the
/// flag has a result like any other.
fn judge(outcome: Result<RunResult, Vec<Fault>>, stop: Option<Stop>, max_wall_s: Option<f64>) -> RunEnd {
    let result = match outcome {
        Ok(result) => result,
        Err(faults) => {
            let faults: Vec<_> = faults.iter().map(Fault::to_string).collect();
            return RunEnd::failed(AttemptOutcome::Invalid, faults.join("; "));
        }
    };
    let (outcome, message) = match (result.end_reason, stop) {
        (_, Some(Stop::Abandon)) => return RunEnd::Abandoned,
        (EndReason::Unstable, _) => {
            let message = match &result.instability {
                Some(seen) => {
                    format!("{} at step {}, belt time {:.4} s", seen.reason, seen.step, seen.time_s)
                }
                None => "the physics diverged".to_owned(),
            };
            (AttemptOutcome::Unstable, message)
        }
        (EndReason::Cancelled, Some(Stop::Release)) => {
            return RunEnd::failed(AttemptOutcome::Released, "handed back by a worker that is stopping");
        }
        (EndReason::Cancelled, Some(Stop::Timeout)) => {
            let limit = max_wall_s.unwrap_or_default();
            (AttemptOutcome::Timeout, format!("stopped after max_wall_s = {limit} s"))
        }
        (EndReason::Cancelled, _) => (AttemptOutcome::Cancelled, "cancelled while running".to_owned()),
        _ => return RunEnd::Finished(result),
    };
    RunEnd::Failed { outcome, message, result: Some(result) }
}

fn panic_text(payload: &(dyn Any + Send)) -> &str {
    let text = payload.downcast_ref::<&str>().copied();
    text.or_else(|| payload.downcast_ref::<String>().map(String::as_str)).unwrap_or("no message")
}

#[cfg(test)]
mod tests;
