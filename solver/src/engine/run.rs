//! A run from outside: what an experiment and an observer see of it, and what they decide.

use serde_json::{Map, Value};

use super::SurfaceLoad;
use super::checkpoint::{Checkpoint, Moment};
use super::saved_fields::{SavedFields, SavedFieldsError};
use super::scene::{Placement, Scene};
use super::state::State;
use crate::observe::Recorder;
use crate::result::{Curve, EndReason, Flow, Instability, Performance, Progress, Warning};

/// Times at which an experiment samples its run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RunPlan {
    /// Simulated time between samples, in seconds.
    pub sample_interval_s: f64,
    /// Longest simulated time before t = 0, in seconds.
    pub longest_fill_s: f64,
    /// Simulated time from t = 0 on, in seconds.
    pub duration_s: f64,
}

/// A sample of a run.
#[derive(Debug)]
pub struct Sample<'a> {
    /// Simulated time since the fill began, in seconds.
    pub simulated_s: f64,
    /// Belt time in seconds; `None` before the start.
    pub belt_time_s: Option<f64>,
    /// State of all sub-particles.
    pub state: &'a State,
    /// Maximum overlap of unbonded sub-particles so far, in metres.
    pub max_overlap_m: f32,
    /// How often a sub-particle has passed through a surface so far.
    pub passed_through: u64,
    /// Load on each surface of the scene in the last step.
    pub surface_loads: &'a [SurfaceLoad],
}

/// The state of a run at one moment, for pictures.
#[derive(Debug)]
pub struct Snapshot<'a> {
    /// The scene of the run.
    pub scene: &'a Scene,
    /// Simulated time since the run began, in seconds.
    pub simulated_s: f64,
    /// Belt time in seconds; `None` before the start.
    pub belt_time_s: Option<f64>,
    /// State of all sub-particles.
    pub state: &'a State,
    /// Intact bonds, as pairs of serials, ascending.
    pub bonds: &'a [[u32; 2]],
}

/// Watches a run from outside. A function from progress to flow is an observer without pictures.
pub trait Observer {
    /// Reports progress. The answer may cancel the run.
    fn progress(&mut self, progress: &Progress) -> Flow;

    /// Whether to take a picture of the sample at this simulated time, in seconds. The sample at which the
    /// test begins is offered twice; the second time, at t = 0, counts.
    fn wants_snapshot(&self, _simulated_s: f64) -> bool {
        false
    }

    /// Takes a picture.
    fn snapshot(&mut self, _snapshot: &Snapshot<'_>) {}

    /// Whether to report the recorded samples.
    fn wants_samples(&self) -> bool {
        false
    }

    /// Reports all series recorded so far. Each call shows the samples of the call before it, with new samples appended.
    fn samples(&mut self, _recorder: &Recorder) {}

    /// Whether to save the run at this moment. Asked after every progress report, also when the answer was to cancel, and
    /// once at t = 0.
    fn wants_checkpoint(&mut self, _moment: Moment) -> bool {
        false
    }

    /// Takes the saved run.
    fn checkpoint(&mut self, _checkpoint: Checkpoint) {}
}

impl<F: FnMut(&Progress) -> Flow> Observer for F {
    fn progress(&mut self, progress: &Progress) -> Flow {
        self(progress)
    }
}

/// Decision of an experiment after a sample.
#[derive(Clone, Debug, PartialEq)]
pub enum Decision {
    /// Continue without these sub-particles.
    Continue {
        /// Serials of sub-particles that have left, ascending.
        remove: Vec<u32>,
    },
    /// Set t = 0. The run is observed again at once.
    Start,
    /// End the run.
    End(EndReason),
    /// End the run: the physics has diverged, for this reason.
    Diverged(String),
}

/// The experiment's side of a run: observes samples, decides, and evaluates the results.
pub trait ExperimentMonitor {
    /// Observes a sample and decides.
    fn observe(&mut self, sample: &Sample<'_>) -> Decision;

    /// Places of the bodies that enter after the last sample: the next of those that the scene holds back.
    fn entering(&mut self, _state: &State, _belt_time_s: Option<f64>) -> Vec<Placement> {
        Vec::new()
    }

    /// The series recorded so far.
    fn recorder(&self) -> &Recorder;

    /// Mass discharged so far, in kilograms, for progress reports.
    fn discharged_kg(&self) -> f64 {
        0.0
    }

    /// Completes derived series after the last sample.
    fn finish(&mut self) {}

    /// The data that it has gathered so far.
    fn save(&self) -> SavedFields;

    /// Takes over what a monitor of the same experiment had gathered.
    ///
    /// # Errors
    /// Fields that are not those of this monitor.
    fn restore(&mut self, saved: &SavedFields) -> Result<(), SavedFieldsError>;

    /// The responses of a run that ended for `reason`.
    fn responses(&self, reason: EndReason) -> Map<String, Value>;

    /// Results over something other than time.
    fn curves(&self) -> Vec<Curve> {
        Vec::new()
    }

    /// Warnings of a run that ended for `reason`, as far as only the monitor knows them.
    fn warnings(&self, _reason: EndReason) -> Vec<Warning> {
        Vec::new()
    }
}

/// How a run ended.
#[derive(Clone, Debug, PartialEq)]
pub struct RunSummary {
    /// Reason of the end.
    pub reason: EndReason,
    /// Where and why the physics diverged.
    pub instability: Option<Instability>,
    /// Cost of the run.
    pub performance: Performance,
}
