//! Runs one scenario in a thread of its own, after loading its meshes. A watch channel carries progress out; a flag stops the run.
//!
//! Every [`Run`] ends with exactly one [`RunEnd`], even when the solver panics.

mod ending;
mod filled;

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use roost_api::job::{AttemptOutcome, FilledBy};
use roost_api::{Progress, RunResult};
use roost_solver::engine::run::Snapshot;
use roost_solver::observe::Recorder;
use roost_solver::scenario;
use roost_solver::{Checked, Checkpoint, Flow, Limits, Moment, Observer, SimulateError};
use serde_json::Value;
use tokio::sync::watch;
use tokio::task::JoinHandle;

use crate::checkpoints::{CheckpointSlot, Resume};
use crate::device::{Device, ReserveError, RunSize};
use crate::fills::{FillCache, ServerFill};
use crate::memory_budget::PendingRun;
use crate::meshes::MeshSource;
use crate::stop::{Stop, StopFlag};
use ending::{classify, invalid, stopped_early, thread_ended};
use filled::{Filled, Start};

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

/// The tasks of a run beside its result.
#[derive(Default)]
pub struct Extras {
    /// Records frames, in the run's thread.
    pub frames: Option<FrameObserver>,
    /// Takes its checkpoints.
    pub checkpoints: Option<CheckpointSlot>,
    /// Where it finds a filled state to start from, and leaves its own. Runs with frames do neither: frames show the fill.
    pub fills: Option<FillCache>,
    /// The fill on the server, which the run uses after its cache.
    pub server_fill: Option<ServerFill>,
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
    filled: Filled,
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
        let (start, filled) = extras.start();
        Self::start_with(max_wall_s, extras, filled, async move {
            let scenario = scenario::from_value(&document).map_err(|faults| invalid(&faults))?;
            let digests = scenario.meshes().into_iter().map(str::to_owned).collect();
            let meshes = meshes.load(digests).await;
            let meshes =
                meshes.map_err(|failure| RunEnd::failed(AttemptOutcome::Worker, failure.to_string()))?;
            let check = move || roost_solver::check(&scenario, &meshes, &Limits::NONE);
            let checked = tokio::task::spawn_blocking(check).await.map_err(thread_ended)?;
            solver(resources, checked.map_err(|faults| invalid(&faults))?, start, pending).await
        })
    }

    /// Starts a checked scenario. Must be called within a tokio runtime.
    pub fn start_checked(checked: Checked, resources: Resources, mut extras: Extras) -> Self {
        let pending = resources.device.announce_run();
        let (start, filled) = extras.start();
        Self::start_with(
            None,
            extras,
            filled,
            async move { solver(resources, checked, start, pending).await },
        )
    }

    /// Starts a function that reports progress and gives a result, after `prepare` has made it.
    fn start_with<P, F>(max_wall_s: Option<f64>, extras: Extras, filled: Filled, prepare: P) -> Self
    where
        P: Future<Output = Result<F, RunEnd>> + Send + 'static,
        F: FnOnce(&mut dyn Observer) -> Result<RunResult, SimulateError> + Send + 'static,
    {
        let (sender, progress) = watch::channel(None);
        let stop = StopFlag::default();
        let flag = stop.clone();
        let recorder = SharedRecorder::default();
        let copy = recorder.clone();
        let observed = filled.clone();
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
                let Extras { frames, checkpoints, .. } = extras;
                let stop = flag.clone();
                let mut observer = RunObserver {
                    report,
                    stop,
                    frames,
                    checkpoints,
                    filled: observed,
                    copy,
                    copied_at: started,
                };
                let outcome = solve(&mut observer);
                observer.filled.finish();
                classify(outcome, flag.get(), max_wall_s)
            });
            solving.await.unwrap_or_else(thread_ended)
        });
        Self { progress, recorder, stop, filled, run }
    }

    /// A run that never starts to compute.
    #[cfg(test)]
    pub(crate) fn pending() -> Self {
        type Solve = fn(&mut dyn Observer) -> Result<RunResult, SimulateError>;
        Self::start_plain(std::future::pending::<Result<Solve, RunEnd>>())
    }

    /// A run without extras.
    #[cfg(test)]
    fn start_plain<P, F>(prepare: P) -> Self
    where
        P: Future<Output = Result<F, RunEnd>> + Send + 'static,
        F: FnOnce(&mut dyn Observer) -> Result<RunResult, SimulateError> + Send + 'static,
    {
        let mut extras = Extras::default();
        let (_, filled) = extras.start();
        Self::start_with(None, extras, filled, prepare)
    }

    /// Waits for the end of the run.
    pub async fn end(self) -> RunEnd {
        self.end_with_fill().await.0
    }

    /// The same, and where its filled state came from.
    pub(crate) async fn end_with_fill(self) -> (RunEnd, Option<FilledBy>) {
        let end = self.run.await.unwrap_or_else(thread_ended);
        // Also of a run that did not begin to compute: nobody waits for its fill.
        self.filled.finish();
        (end, self.filled.filled_by())
    }
}

/// Waits for the device to have memory for a scenario, and for its fill; the function then simulates it.
async fn solver(
    resources: Resources,
    checked: Checked,
    Start { resume, fills }: Start,
    pending: Option<PendingRun>,
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
    // Its size is known. Waiting for a fill must not keep the worker from claims.
    drop(pending);
    let (mut checkpoint, mut refused) = match resume {
        Some(resume) => (resume.checkpoint.await, resume.refused),
        None => (None, None),
    };
    match (&checkpoint, fills) {
        (None, Some(fills)) => (checkpoint, refused) = fills.load(&resources.device, &checked).await?,
        (Some(_), Some(fills)) => fills.keep(),
        (_, None) => {}
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

#[cfg(test)]
mod tests;
