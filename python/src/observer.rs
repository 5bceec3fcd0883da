//! The observer of a run: reports progress to Python, notices signals, records frames, and keeps the checkpoint file.

use std::time::{Duration, Instant};

use pyo3::prelude::*;
use roost_frames::FrameRecorder;
use roost_solver::engine::run::Snapshot;
use roost_solver::{Checkpoint, Flow, Moment, Observer, Progress};

use crate::checkpoint_file::CheckpointFile;
use crate::document::json;

/// Minimum wall time between two reports. Short runs would otherwise wait for the interpreter's lock at every sample.
const INTERVAL: Duration = Duration::from_millis(100);

/// The observer of a run.
pub(crate) struct PythonObserver {
    report: Option<Py<PyAny>>,
    reported_at: Instant,
    /// The exception that stops the run.
    raised: Option<PyErr>,
    /// Its checkpoint file.
    checkpoints: Option<CheckpointFile>,
    frames: Option<FrameRecorder>,
}

impl PythonObserver {
    pub(crate) fn new(
        report: Option<Py<PyAny>>,
        checkpoints: Option<CheckpointFile>,
        frames: Option<FrameRecorder>,
    ) -> Self {
        Self { report, reported_at: Instant::now(), raised: None, checkpoints, frames }
    }

    /// Completes the files of a run that has ended. Gives the exception that stopped it, and warnings.
    pub(crate) fn finish(mut self, is_at_its_end: bool) -> (Option<PyErr>, Vec<String>) {
        let stopped = self.frames.as_mut().and_then(|frames| frames.finish().stopped);
        let not_saved = self.checkpoints.as_mut().and_then(|file| file.finish(is_at_its_end));
        (self.raised, stopped.into_iter().chain(not_saved).collect())
    }

    /// Runs signal handlers, of which that of Ctrl-C raises `KeyboardInterrupt`, and reports.
    fn call(&self, progress: &Progress) -> PyResult<()> {
        Python::attach(|py| {
            py.check_signals()?;
            self.report.as_ref().map_or(Ok(()), |report| report.call1(py, (json(progress),)).map(drop))
        })
    }
}

impl Observer for PythonObserver {
    fn progress(&mut self, progress: &Progress) -> Flow {
        if self.reported_at.elapsed() < INTERVAL {
            return Flow::Continue;
        }
        self.raised = self.call(progress).err();
        self.reported_at = Instant::now();
        if self.raised.is_some() { Flow::Cancel } else { Flow::Continue }
    }

    fn wants_snapshot(&self, simulated_s: f64) -> bool {
        self.frames.as_ref().is_some_and(|frames| frames.wants_snapshot(simulated_s))
    }

    fn snapshot(&mut self, snapshot: &Snapshot<'_>) {
        if let Some(frames) = &mut self.frames {
            frames.snapshot(snapshot);
        }
    }

    fn wants_checkpoint(&mut self, moment: Moment) -> bool {
        let file = self.checkpoints.as_ref().filter(|_| moment == Moment::Step);
        file.is_some_and(|file| self.raised.is_some() || file.is_due())
    }

    fn checkpoint(&mut self, checkpoint: Checkpoint) {
        if let Some(file) = &mut self.checkpoints {
            file.write(checkpoint);
        }
    }
}
