//! Runs one scenario on a thread of its own, once its meshes are there: progress comes out through a watch channel, a
//! stop flag goes in.
//!
//! Whatever happens in the solver, a [`Run`] ends with exactly one [`RunEnd`]; a panic is one too.

use std::any::Any;
use std::sync::atomic::{AtomicU8, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use roost_api::job::AttemptOutcome;
use roost_api::{Progress, RunResult, Series};
use roost_solver::engine::run::Snapshot;
use roost_solver::observe::Recorder;
use roost_solver::result::EndReason;
use roost_solver::scenario::{self, Fault};
use roost_solver::{Checked, Flow, Limits, Observer, OutOfDeviceMemory};
use serde_json::Value;
use tokio::sync::watch;
use tokio::task::{JoinError, JoinHandle};

use crate::device::{Device, NotReady, Size};
use crate::meshes::MeshSource;

/// How often a run that has not begun looks whether it is to stop.
const LOOK_AGAIN: Duration = Duration::from_millis(50);

const HANDED_BACK: &str = "handed back by a worker that is stopping";

/// What a run that was claimed and found too little memory leaves in its place.
const NO_ROOM_NOW: &str = "handed back: other runs of the worker have the memory";

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

    /// Waits until the run is to stop.
    async fn raised(&self) -> Stop {
        loop {
            if let Some(why) = self.get() {
                return why;
            }
            tokio::time::sleep(LOOK_AGAIN).await;
        }
    }
}

/// Who takes pictures of a run; shared, so that whoever hands it in can ask it what became of them.
pub type Pictures = Arc<Mutex<dyn Observer + Send>>;

/// Where a run is computed.
#[derive(Clone, Debug)]
pub struct Place {
    /// On what.
    pub device: Device,
    /// On how many threads where that is the CPU.
    threads: usize,
}

impl Place {
    /// On a device, with that many [`threads`] where it is the CPU.
    pub fn new(device: Device, threads: usize) -> Self {
        Self { device, threads: crate::threads(threads) }
    }
}

/// A run under way.
#[derive(Debug)]
pub struct Run {
    /// The newest progress; none before the first report.
    pub progress: watch::Receiver<Option<Progress>>,
    /// What it has sampled so far, about a second old.
    pub samples: Sampled,
    /// Asks it to stop.
    pub stop: StopFlag,
    run: JoinHandle<RunEnd>,
}

impl Run {
    /// Starts a scenario document, once its meshes are there. Must be called within a tokio runtime.
    pub fn start(document: Value, meshes: MeshSource, place: Place, max_wall_s: Option<f64>) -> Self {
        Self::start_pictured(document, meshes, place, max_wall_s, None)
    }

    /// Starts a scenario document, once its meshes are there, of which somebody takes pictures, on the run's thread. Must be
    /// called within a tokio runtime.
    pub fn start_pictured(
        document: Value,
        meshes: MeshSource,
        place: Place,
        max_wall_s: Option<f64>,
        pictures: Option<Pictures>,
    ) -> Self {
        let coming = place.device.expect_run();
        Self::start_with(max_wall_s, pictures, async move {
            let scenario = scenario::from_value(&document).map_err(|faults| refused(&faults))?;
            let digests = scenario.meshes().into_iter().map(str::to_owned).collect();
            let meshes = meshes.load(digests).await;
            let meshes =
                meshes.map_err(|failure| RunEnd::failed(AttemptOutcome::Worker, failure.to_string()))?;
            let check = move || roost_solver::check(&scenario, &meshes, &Limits::NONE);
            let checked = tokio::task::spawn_blocking(check).await.map_err(broken)?;
            let solve = solver(place, checked.map_err(|faults| refused(&faults))?).await;
            drop(coming);
            solve
        })
    }

    /// Starts a scenario that has been checked. Must be called within a tokio runtime.
    pub fn start_checked(checked: Checked, place: Place, pictures: Option<Pictures>) -> Self {
        let coming = place.device.expect_run();
        Self::start_with(None, pictures, async move {
            let solve = solver(place, checked).await;
            drop(coming);
            solve
        })
    }

    /// Starts anything that, once prepared, reports progress and gives a result, as the solver does.
    fn start_with<P, F>(max_wall_s: Option<f64>, pictures: Option<Pictures>, prepare: P) -> Self
    where
        P: Future<Output = Result<F, RunEnd>> + Send + 'static,
        F: FnOnce(&mut dyn Observer) -> Result<RunResult, OutOfDeviceMemory> + Send + 'static,
    {
        let (sender, progress) = watch::channel(None);
        let stop = StopFlag::default();
        let flag = stop.clone();
        let samples = Sampled::default();
        let sampled = samples.clone();
        let run = tokio::spawn(async move {
            let solve = tokio::select! {
                biased;
                prepared = prepare => match prepared {
                    Ok(solve) => solve,
                    Err(end) => return end,
                },
                why = flag.raised() => return stopped(why),
            };
            let solving = tokio::task::spawn_blocking(move || {
                let started = Instant::now();
                let report = |progress: &Progress| {
                    sender.send_replace(Some(progress.clone()));
                    if max_wall_s.is_some_and(|limit| started.elapsed().as_secs_f64() > limit) {
                        flag.set(Stop::Timeout);
                    }
                    if flag.get().is_some() { Flow::Cancel } else { Flow::Continue }
                };
                let outcome = solve(&mut Watched { report, pictures, sampled, sampled_at: started });
                judge(outcome, flag.get(), max_wall_s)
            });
            solving.await.unwrap_or_else(broken)
        });
        Self { progress, samples, stop, run }
    }

    /// A run that never begins.
    #[cfg(test)]
    pub(crate) fn of_nothing() -> Self {
        type Solve = fn(&mut dyn Observer) -> Result<RunResult, OutOfDeviceMemory>;
        Self::start_with(None, None, std::future::pending::<Result<Solve, RunEnd>>())
    }

    /// Waits for the end.
    pub async fn end(self) -> RunEnd {
        self.run.await.unwrap_or_else(broken)
    }
}

/// Waits until the device is ready for a scenario; what then simulates it.
async fn solver(
    place: Place,
    checked: Checked,
) -> Result<impl FnOnce(&mut dyn Observer) -> Result<RunResult, OutOfDeviceMemory> + Send + 'static, RunEnd> {
    let triangles = checked.setup().meshes.triangles();
    let size = Size { subparticles: checked.estimate().subparticles, triangles };
    let ready = place.device.ready(place.threads, size).await;
    let ready = ready.map_err(|why| match why {
        NotReady::NoRoomNow => RunEnd::failed(AttemptOutcome::Released, NO_ROOM_NOW),
        NotReady::Failed(reason) => RunEnd::failed(AttemptOutcome::Worker, reason),
    })?;
    Ok(move |observer: &mut dyn Observer| ready.simulate(&checked, observer))
}

/// A run whose thread ended by itself.
fn broken(error: JoinError) -> RunEnd {
    if !error.is_panic() {
        return RunEnd::failed(AttemptOutcome::Worker, "the run's thread was dropped");
    }
    let message = format!("the solver panicked: {}", panic_text(&*error.into_panic()));
    RunEnd::failed(AttemptOutcome::Worker, message)
}

/// A run that was stopped before it began.
fn stopped(why: Stop) -> RunEnd {
    match why {
        Stop::Abandon => RunEnd::Abandoned,
        Stop::Release => RunEnd::failed(AttemptOutcome::Released, HANDED_BACK),
        Stop::Cancel | Stop::Timeout => {
            RunEnd::failed(AttemptOutcome::Cancelled, "cancelled before it began")
        }
    }
}

/// A scenario that the solver would not run.
fn refused(faults: &[Fault]) -> RunEnd {
    let faults: Vec<_> = faults.iter().map(Fault::to_string).collect();
    RunEnd::failed(AttemptOutcome::Invalid, faults.join("; "))
}

/// What a run has sampled so far.
#[derive(Clone, Debug, Default)]
pub struct Sampled(Arc<Mutex<Vec<Series>>>);

impl Sampled {
    /// All of it.
    pub fn series(&self) -> MutexGuard<'_, Vec<Series>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Samples are looked at this often.
const SAMPLED_EVERY: Duration = Duration::from_secs(1);

/// Reports progress here, has pictures taken there, and keeps what was sampled for those who ask.
struct Watched<F> {
    report: F,
    pictures: Option<Pictures>,
    sampled: Sampled,
    sampled_at: Instant,
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

    fn wants_samples(&self) -> bool {
        self.sampled_at.elapsed() >= SAMPLED_EVERY
    }

    fn samples(&mut self, recorder: &Recorder) {
        self.sampled_at = Instant::now();
        *self.sampled.series() = recorder.series();
    }
}

/// What the solver's answer means, given what it had been asked. A run that came to its own end before it saw the
/// flag has a result like any other.
fn judge(
    outcome: Result<RunResult, OutOfDeviceMemory>,
    stop: Option<Stop>,
    max_wall_s: Option<f64>,
) -> RunEnd {
    let result = match outcome {
        Ok(result) => result,
        Err(no_room) => return RunEnd::failed(AttemptOutcome::Worker, no_room.to_string()),
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
            return RunEnd::failed(AttemptOutcome::Released, HANDED_BACK);
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
