//! Runs one scenario in a thread of its own, after loading its meshes. A watch channel carries progress out; a flag stops the run.
//!
//! Every [`Run`] ends with exactly one [`RunEnd`], even when the solver panics.

mod filled;
mod stop;

use std::any::Any;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use roost_api::job::AttemptOutcome;
use roost_api::{Progress, RunResult};
use roost_solver::engine::run::Snapshot;
use roost_solver::observe::Recorder;
use roost_solver::result::{EndReason, Instability};
use roost_solver::scenario::{self, Fault};
use roost_solver::{Checked, Checkpoint, Flow, Limits, Moment, Observer, SimulateError};
use serde_json::Value;
use tokio::sync::watch;
use tokio::task::{JoinError, JoinHandle};

use crate::checkpoints::{CheckpointSlot, Resume};
use crate::device::{Device, ReserveError, RunSize};
use crate::fills::FillCache;
use crate::meshes::MeshSource;
use filled::{Filled, Start};
pub use stop::{Stop, StopFlag};

const WORKER_STOPS: &str = "handed back: the worker is stopping";

const JOB_PAUSED: &str = "handed back: the job was paused";

const MEMORY_IN_USE: &str = "released: other jobs of the worker use the memory of its device";

/// How a run ended.
#[derive(Debug)]
pub enum RunEnd {
    /// With the job's result.
    Finished(RunResult),
    /// Without a result.
    Failed {
        /// The outcome of the attempt.
        outcome: AttemptOutcome,
        /// The reason in words.
        message: String,
        /// The partial result, if the physics got that far.
        result: Option<RunResult>,
    },
    /// The attempt is stale, and the server needs no report.
    Abandoned,
}

impl RunEnd {
    fn failed(outcome: AttemptOutcome, message: impl Into<String>) -> Self {
        Self::Failed { outcome, message: message.into(), result: None }
    }
}

/// Observer that records frames; shared, so that the caller can read its report after the run.
pub type FrameObserver = Arc<Mutex<dyn Observer + Send>>;

/// What a run does beside its result.
#[derive(Default)]
pub struct Extras {
    /// Records frames, in the run's thread.
    pub frames: Option<FrameObserver>,
    /// Takes its checkpoints.
    pub checkpoints: Option<CheckpointSlot>,
    /// Where it finds a filled state to start from, and leaves its own. Runs with frames do neither: frames show the fill.
    pub fills: Option<FillCache>,
    /// Where it continues from; from zero without.
    pub resume: Option<Resume>,
}

impl From<Option<FrameObserver>> for Extras {
    fn from(frames: Option<FrameObserver>) -> Self {
        Self { frames, ..Self::default() }
    }
}

/// The device and threads of a run.
#[derive(Clone, Debug)]
pub struct Resources {
    /// The device.
    pub device: Device,
    /// Threads on the CPU.
    threads: usize,
}

impl Resources {
    /// A device, and the requested number of [`threads`](crate::threads) on the CPU.
    pub fn new(device: Device, threads: usize) -> Self {
        Self { device, threads: crate::threads(threads) }
    }
}

/// A started run.
#[derive(Debug)]
pub struct Run {
    /// The newest progress; none before the first report.
    pub progress: watch::Receiver<Option<Progress>>,
    /// A copy of its samples so far, about a second old.
    pub recorder: SharedRecorder,
    /// Asks it to stop.
    pub stop: StopFlag,
    run: JoinHandle<RunEnd>,
}

impl Run {
    /// Starts a scenario document. Must be called within a tokio runtime.
    pub fn start(document: Value, meshes: MeshSource, resources: Resources, max_wall_s: Option<f64>) -> Self {
        Self::start_observed(document, meshes, resources, max_wall_s, Extras::default())
    }

    /// The same with frames and checkpoints.
    pub fn start_observed(
        document: Value,
        meshes: MeshSource,
        resources: Resources,
        max_wall_s: Option<f64>,
        mut extras: Extras,
    ) -> Self {
        let pending = resources.device.announce_run();
        let start = extras.start();
        Self::start_with(max_wall_s, extras, async move {
            let scenario = scenario::from_value(&document).map_err(|faults| invalid(&faults))?;
            let digests = scenario.meshes().into_iter().map(str::to_owned).collect();
            let meshes = meshes.load(digests).await;
            let meshes =
                meshes.map_err(|failure| RunEnd::failed(AttemptOutcome::Worker, failure.to_string()))?;
            let check = move || roost_solver::check(&scenario, &meshes, &Limits::NONE);
            let checked = tokio::task::spawn_blocking(check).await.map_err(thread_ended)?;
            let solve = solver(resources, checked.map_err(|faults| invalid(&faults))?, start).await;
            drop(pending);
            solve
        })
    }

    /// Starts a checked scenario. Must be called within a tokio runtime.
    pub fn start_checked(checked: Checked, resources: Resources, mut extras: Extras) -> Self {
        let pending = resources.device.announce_run();
        let start = extras.start();
        Self::start_with(None, extras, async move {
            let solve = solver(resources, checked, start).await;
            drop(pending);
            solve
        })
    }

    /// Starts a function that reports progress and gives a result, after `prepare` has made it.
    fn start_with<P, F>(max_wall_s: Option<f64>, extras: Extras, prepare: P) -> Self
    where
        P: Future<Output = Result<F, RunEnd>> + Send + 'static,
        F: FnOnce(&mut dyn Observer) -> Result<RunResult, SimulateError> + Send + 'static,
    {
        let (sender, progress) = watch::channel(None);
        let stop = StopFlag::default();
        let flag = stop.clone();
        let recorder = SharedRecorder::default();
        let copy = recorder.clone();
        let run = tokio::spawn(async move {
            let solve = tokio::select! {
                biased;
                prepared = prepare => match prepared {
                    Ok(solve) => solve,
                    Err(end) => return end,
                },
                why = flag.wait() => return stopped_early(why),
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
                let Extras { frames, checkpoints, fills, .. } = extras;
                let filled = Filled::new(fills.filter(|_| frames.is_none()));
                let stop = flag.clone();
                let mut observer =
                    RunObserver { report, stop, frames, checkpoints, filled, copy, copied_at: started };
                let outcome = solve(&mut observer);
                observer.filled.finish();
                classify(outcome, flag.get(), max_wall_s)
            });
            solving.await.unwrap_or_else(thread_ended)
        });
        Self { progress, recorder, stop, run }
    }

    /// A run that never starts to compute.
    #[cfg(test)]
    pub(crate) fn pending() -> Self {
        type Solve = fn(&mut dyn Observer) -> Result<RunResult, SimulateError>;
        Self::start_with(None, Extras::default(), std::future::pending::<Result<Solve, RunEnd>>())
    }

    /// Waits for the end of the run.
    pub async fn end(self) -> RunEnd {
        self.run.await.unwrap_or_else(thread_ended)
    }
}

/// Waits for the device to have memory for a scenario; the function then simulates it.
async fn solver(
    resources: Resources,
    checked: Checked,
    Start { resume, fills }: Start,
) -> Result<impl FnOnce(&mut dyn Observer) -> Result<RunResult, SimulateError> + Send + 'static, RunEnd> {
    let triangles = checked.setup().meshes.triangles();
    let has_moments = checked.scenario().bonds.moment_stiffness_factor > 0.0;
    let estimate = checked.estimate();
    let size = RunSize {
        machine_bytes: estimate.memory_bytes,
        subparticles: estimate.subparticles,
        triangles,
        has_moments,
    };
    let reserved = resources.device.reserve(resources.threads, size).await;
    let reserved = reserved.map_err(|why| match why {
        ReserveError::MemoryInUse => RunEnd::failed(AttemptOutcome::Released, MEMORY_IN_USE),
        ReserveError::Failed(reason) => RunEnd::failed(AttemptOutcome::Worker, reason),
    })?;
    let (mut checkpoint, mut refused) = match resume {
        Some(resume) => (resume.checkpoint.await, resume.refused),
        None => (None, None),
    };
    if let (None, Some(cache)) = (&checkpoint, fills) {
        let (filled, discard) = filled::load(cache, &resources.device, &checked).await?;
        (checkpoint, refused) = (filled, Some(discard));
    }
    Ok(move |observer: &mut dyn Observer| {
        match (reserved.simulate(&checked, checkpoint.as_ref(), observer), refused) {
            // Refused before the first step.
            (Err(SimulateError::Checkpoint(error)), Some(refused)) => {
                refused(error.to_string());
                reserved.simulate(&checked, None, observer)
            }
            (outcome, _) => outcome,
        }
    })
}

/// The end of a run whose thread panicked or was dropped.
fn thread_ended(error: JoinError) -> RunEnd {
    if !error.is_panic() {
        return RunEnd::failed(AttemptOutcome::Worker, "the run's thread was dropped");
    }
    let message = format!("the solver panicked: {}", panic_text(&*error.into_panic()));
    RunEnd::failed(AttemptOutcome::Worker, message)
}

/// The end of a run that was stopped before it began.
fn stopped_early(why: Stop) -> RunEnd {
    match why {
        Stop::Abandon => RunEnd::Abandoned,
        Stop::Release => RunEnd::failed(AttemptOutcome::Released, WORKER_STOPS),
        Stop::Preempt => RunEnd::failed(AttemptOutcome::Released, JOB_PAUSED),
        Stop::Cancel | Stop::Timeout => {
            RunEnd::failed(AttemptOutcome::Cancelled, "cancelled before it began")
        }
    }
}

/// The end of a run with an invalid scenario.
fn invalid(faults: &[Fault]) -> RunEnd {
    let faults: Vec<_> = faults.iter().map(Fault::to_string).collect();
    RunEnd::failed(AttemptOutcome::Invalid, faults.join("; "))
}

/// A copy of the samples of a run so far.
#[derive(Clone, Debug, Default)]
pub struct SharedRecorder(Arc<Mutex<Recorder>>);

impl SharedRecorder {
    /// All series. The run waits to copy new samples while the guard lives.
    pub fn lock(&self) -> MutexGuard<'_, Recorder> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Interval at which samples are copied.
const COPY_INTERVAL: Duration = Duration::from_secs(1);

/// Passes progress, frames and checkpoints to their receivers, and keeps a copy of the samples.
struct RunObserver<F> {
    report: F,
    stop: StopFlag,
    frames: Option<FrameObserver>,
    checkpoints: Option<CheckpointSlot>,
    filled: Filled,
    copy: SharedRecorder,
    copied_at: Instant,
}

impl<F: FnMut(&Progress) -> Flow> Observer for RunObserver<F> {
    fn progress(&mut self, progress: &Progress) -> Flow {
        (self.report)(progress)
    }

    fn wants_snapshot(&self, simulated_s: f64) -> bool {
        let frames = self.frames.as_ref().map(|frames| frames.lock());
        frames.is_some_and(|p| p.unwrap_or_else(PoisonError::into_inner).wants_snapshot(simulated_s))
    }

    fn snapshot(&mut self, snapshot: &Snapshot<'_>) {
        if let Some(frames) = &self.frames {
            frames.lock().unwrap_or_else(PoisonError::into_inner).snapshot(snapshot);
        }
    }

    fn wants_checkpoint(&mut self, moment: Moment) -> bool {
        match moment {
            Moment::Step => self.checkpoints.as_ref().is_some_and(|slot| slot.wants(self.stop.get())),
            Moment::Start => self.filled.is_wanted(),
        }
    }

    fn checkpoint(&mut self, checkpoint: Checkpoint) {
        if checkpoint.head.moment == Moment::Start {
            return self.filled.store(checkpoint);
        }
        if let Some(slot) = &self.checkpoints {
            slot.put(checkpoint);
        }
    }

    fn wants_samples(&self) -> bool {
        self.copied_at.elapsed() >= COPY_INTERVAL
    }

    fn samples(&mut self, recorder: &Recorder) {
        self.copied_at = Instant::now();
        self.copy.lock().clone_from(recorder);
    }
}

/// Classifies the end of a run by its result and the reason to stop. A run that ended before it saw the flag has a normal result.
fn classify(
    outcome: Result<RunResult, SimulateError>,
    stop: Option<Stop>,
    max_wall_s: Option<f64>,
) -> RunEnd {
    let result = match outcome {
        Ok(result) => result,
        Err(error) => return RunEnd::failed(AttemptOutcome::Worker, error.to_string()),
    };
    let (outcome, message) = match (result.end_reason, stop) {
        (_, Some(Stop::Abandon)) => return RunEnd::Abandoned,
        (EndReason::Unstable, _) => {
            let message = match &result.instability {
                Some(instability) => {
                    let Instability { reason, step, time_s } = instability;
                    format!("{reason} at step {step}, belt time {time_s:.4} s")
                }
                None => "the physics diverged".to_owned(),
            };
            (AttemptOutcome::Unstable, message)
        }
        (EndReason::Cancelled, Some(Stop::Release)) => {
            return RunEnd::failed(AttemptOutcome::Released, WORKER_STOPS);
        }
        (EndReason::Cancelled, Some(Stop::Preempt)) => {
            return RunEnd::failed(AttemptOutcome::Released, JOB_PAUSED);
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
