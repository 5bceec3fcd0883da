//! The run loop: advances a scene from sample to sample, lets the experiment observe and decide, reports
//! progress.

use std::time::Instant;

use serde_json::{Map, Value};

use super::scene::{Placement, Scene};
use super::state::State;
use super::{AdvanceReport, Backend, SurfaceLoad};
use crate::observe::Recorder;
use crate::result::{Curve, EndReason, Flow, Instability, Performance, Phase, Progress, Warning};

/// Wall time between two calls of the progress callback, in seconds.
const PROGRESS_INTERVAL_S: f64 = 0.1;

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

/// Runs a scene to its end.
pub fn run<B: Backend>(
    backend: &B,
    scene: &Scene,
    plan: RunPlan,
    monitor: &mut dyn ExperimentMonitor,
    observer: &mut dyn Observer,
) -> RunSummary {
    let clock = Instant::now();
    let mut run = backend.prepare(scene);
    let mut timeline = Timeline::new(plan, scene.timestep_s);
    let subparticles = backend.state(&mut run).particles.len() as u64;
    let mut entered = scene.present().len();
    let (reason, fault) = loop {
        let surface_loads = backend.surface_loads(&mut run);
        let state = backend.state(&mut run);
        let sample = Sample {
            simulated_s: timeline.simulated_s(),
            belt_time_s: timeline.belt_time_s(),
            state,
            max_overlap_m: timeline.max_overlap_m,
            passed_through: timeline.passed_through,
            surface_loads: &surface_loads,
        };
        let decision = monitor.observe(&sample);
        let wanted = observer.wants_snapshot(timeline.simulated_s());
        // A picture at t = 0 is taken after the start, at the second offer.
        if wanted && !matches!(decision, Decision::Start) {
            let bonds = backend.bonds(&mut run);
            observer.snapshot(&Snapshot {
                scene,
                simulated_s: timeline.simulated_s(),
                belt_time_s: timeline.belt_time_s(),
                state: backend.state(&mut run),
                bonds: &bonds,
            });
        }
        match decision {
            Decision::End(reason) => break (reason, None),
            Decision::Diverged(seen) => break (EndReason::Unstable, Some(seen)),
            Decision::Start => {
                backend.start(&mut run);
                timeline.start();
                continue;
            }
            Decision::Continue { remove } if remove.is_empty() => {}
            Decision::Continue { remove } => backend.remove(&mut run, &remove),
        }
        if observer.wants_samples() {
            observer.samples(monitor.recorder());
        }
        if let Some(reason) = timeline.time_limit_reached() {
            break (reason, None);
        }
        let entering = monitor.entering(backend.state(&mut run), timeline.belt_time_s());
        if !entering.is_empty() {
            backend.enter(&mut run, scene, entered, &entering);
            entered += entering.len();
        }
        // The count holds until the next sample. A call to the device would cost
        // time.
        let left = backend.state(&mut run).particles.len() as u64;
        let next = timeline.next_sample_step();
        let mut cancelled = false;
        while timeline.step < next && timeline.fault.is_none() && !cancelled {
            let steps = timeline.steps_to_next_progress().min(next - timeline.step);
            let before = Instant::now();
            let advance = backend.advance(&mut [(&mut run, steps)]).swap_remove(0);
            timeline.record(advance, before.elapsed().as_secs_f64());
            let progress = timeline.progress(left, clock.elapsed().as_secs_f64(), monitor.discharged_kg());
            cancelled = observer.progress(&progress) == Flow::Cancel;
        }
        if let Some(fault) = timeline.fault.take() {
            break (EndReason::Unstable, Some(fault));
        }
        if cancelled {
            break (EndReason::Cancelled, None);
        }
    };
    monitor.finish();
    let instability = fault.map(|reason| Instability {
        step: timeline.step,
        time_s: timeline.belt_time_s().unwrap_or(timeline.simulated_s() - plan.longest_fill_s),
        reason,
    });
    let wall_s = clock.elapsed().as_secs_f64();
    let performance = Performance {
        subparticles,
        particle_steps: timeline.particle_steps,
        steps: timeline.step,
        wall_s,
        ns_per_particle_step: timeline.advancing_s * 1e9 / timeline.particle_steps.max(1) as f64,
    };
    RunSummary { reason, instability, performance }
}

/// Position of a run in time, and its cost so far.
struct Timeline {
    plan: RunPlan,
    dt: f64,
    step: u64,
    start_step: Option<u64>,
    samples: u64,
    particle_steps: u64,
    advancing_s: f64,
    max_overlap_m: f32,
    passed_through: u64,
    fault: Option<String>,
}

impl Timeline {
    fn new(plan: RunPlan, dt: f64) -> Self {
        Self {
            plan,
            dt,
            step: 0,
            start_step: None,
            samples: 0,
            particle_steps: 0,
            advancing_s: 0.0,
            max_overlap_m: 0.0,
            passed_through: 0,
            fault: None,
        }
    }

    fn start(&mut self) {
        self.start_step = Some(self.step);
        self.samples = 0;
    }

    fn simulated_s(&self) -> f64 {
        self.step as f64 * self.dt
    }

    fn belt_time_s(&self) -> Option<f64> {
        self.start_step.map(|start| (self.step - start) as f64 * self.dt)
    }

    /// Last step of the phase: the step nearest to the duration, or the first past the longest fill.
    fn last_step(&self) -> u64 {
        match self.start_step {
            Some(start) => start + (self.plan.duration_s / self.dt).round() as u64,
            None => (self.plan.longest_fill_s / self.dt).ceil() as u64,
        }
    }

    fn time_limit_reached(&self) -> Option<EndReason> {
        let reason = if self.start_step.is_some() { EndReason::Duration } else { EndReason::FillNotAtRest };
        (self.step >= self.last_step()).then_some(reason)
    }

    /// The next sample: the step nearest to a multiple of the interval, counted within the phase, or its last
    /// step.
    fn next_sample_step(&mut self) -> u64 {
        self.samples += 1;
        let steps = (self.samples as f64 * self.plan.sample_interval_s / self.dt).round() as u64;
        (self.start_step.unwrap_or(0) + steps).min(self.last_step()).max(self.step + 1)
    }

    /// Steps until the next progress report.
    fn steps_to_next_progress(&self) -> u64 {
        if self.step == 0 {
            return 1;
        }
        ((PROGRESS_INTERVAL_S * self.step as f64 / self.advancing_s.max(1e-9)) as u64).max(1)
    }

    fn record(&mut self, advance: AdvanceReport, wall_s: f64) {
        self.step += advance.steps;
        self.particle_steps += advance.particle_steps;
        self.advancing_s += wall_s;
        self.max_overlap_m = self.max_overlap_m.max(advance.max_overlap_m);
        self.passed_through += advance.passed_through;
        self.fault = advance.fault;
    }

    fn progress(&self, subparticles: u64, wall_s: f64, discharged_kg: f64) -> Progress {
        let simulated_s = self.simulated_s();
        // A fill usually comes to rest in about a fifth of its time limit.
        let usual_fill_s = self.plan.longest_fill_s / 5.0;
        let (phase, time_s, fraction) = match self.belt_time_s() {
            None => {
                let filled = (simulated_s / usual_fill_s).min(0.95) * usual_fill_s;
                let whole = usual_fill_s + self.plan.duration_s;
                (Phase::Fill, simulated_s - self.plan.longest_fill_s, filled / whole)
            }
            Some(t) => {
                let fill_s = simulated_s - t;
                (Phase::Process, t, simulated_s / (fill_s + self.plan.duration_s))
            }
        };
        Progress {
            phase,
            time_s,
            simulated_s,
            fraction: fraction.min(1.0),
            subparticles,
            particle_steps: self.particle_steps,
            wall_s,
            discharged_kg,
        }
    }
}
