//! The time of a run: its steps, samples and limits.

use serde::{Deserialize, Serialize};

use super::AdvanceReport;
use super::run::RunPlan;
use crate::result::{EndReason, Phase, Progress};

/// Wall time between two calls of the progress callback, in seconds.
const PROGRESS_INTERVAL_S: f64 = 0.1;

/// Position of a run in time, and its cost so far.
pub(super) struct Timeline {
    plan: RunPlan,
    dt: f64,
    pub(super) so_far: SoFar,
    pub(super) fault: Option<String>,
}

/// The progress of a run so far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct SoFar {
    /// Steps done.
    pub(super) step: u64,
    /// Step of t = 0, once the process has started.
    pub(super) start_step: Option<u64>,
    /// Number of the next sample within the phase.
    pub(super) samples: u64,
    /// Its step.
    pub(super) sample_step: u64,
    /// Sub-particle updates done.
    pub(super) particle_steps: u64,
    /// Wall time of the steps, in seconds.
    pub(super) advancing_s: f64,
    /// Maximum overlap of sub-particles without a bond, in metres.
    pub(super) max_overlap_m: f32,
    /// How often a sub-particle has passed through a surface.
    pub(super) passed_through: u64,
}

impl Timeline {
    pub(super) fn new(plan: RunPlan, dt: f64, so_far: SoFar) -> Self {
        Self { plan, dt, so_far, fault: None }
    }

    /// Whether a run can have come there: its counts and times fit each other and the plan.
    pub(super) fn is_possible(&self) -> bool {
        let SoFar { step, start_step, samples, sample_step, advancing_s, max_overlap_m, .. } = self.so_far;
        let started = start_step.is_none_or(|start| start <= step);
        // A phase has at least one step, and a sample at most one interval ahead.
        let last = if started { self.last_step().saturating_add(1) } else { 0 };
        started
            && step <= last
            && sample_step <= last
            && samples <= last
            && advancing_s.is_finite()
            && advancing_s >= 0.0
            && max_overlap_m.is_finite()
    }

    pub(super) fn start(&mut self) {
        self.so_far.start_step = Some(self.so_far.step);
        self.so_far.samples = 0;
    }

    pub(super) fn simulated_s(&self) -> f64 {
        self.so_far.step as f64 * self.dt
    }

    pub(super) fn belt_time_s(&self) -> Option<f64> {
        self.so_far.start_step.map(|start| (self.so_far.step - start) as f64 * self.dt)
    }

    /// Belt time in seconds, before the start that of a fill as long as it may be.
    pub(super) fn time_s(&self) -> f64 {
        self.belt_time_s().unwrap_or(self.simulated_s() - self.plan.longest_fill_s)
    }

    /// Last step of the phase: the step nearest to the duration, or the first past the longest fill.
    fn last_step(&self) -> u64 {
        match self.so_far.start_step {
            Some(start) => start + (self.plan.duration_s / self.dt).round() as u64,
            None => (self.plan.longest_fill_s / self.dt).ceil() as u64,
        }
    }

    pub(super) fn time_limit_reached(&self) -> Option<EndReason> {
        let reason =
            if self.so_far.start_step.is_some() { EndReason::Duration } else { EndReason::FillNotAtRest };
        (self.so_far.step >= self.last_step()).then_some(reason)
    }

    /// Passes to the next sample: the step nearest to a multiple of the interval, counted within the phase, or its last step.
    pub(super) fn next_sample(&mut self) {
        self.so_far.samples += 1;
        let steps = (self.so_far.samples as f64 * self.plan.sample_interval_s / self.dt).round() as u64;
        let of_phase = (self.so_far.start_step.unwrap_or(0) + steps).min(self.last_step());
        self.so_far.sample_step = of_phase.max(self.so_far.step + 1);
    }

    /// Steps to the next sample.
    pub(super) fn steps_to_sample(&self) -> u64 {
        self.so_far.sample_step.saturating_sub(self.so_far.step)
    }

    /// Steps until the next progress report.
    pub(super) fn steps_to_next_progress(&self) -> u64 {
        if self.so_far.step == 0 {
            return 1;
        }
        ((PROGRESS_INTERVAL_S * self.so_far.step as f64 / self.so_far.advancing_s.max(1e-9)) as u64).max(1)
    }

    pub(super) fn record(&mut self, advance: AdvanceReport, wall_s: f64) {
        self.so_far.step += advance.steps;
        self.so_far.particle_steps += advance.particle_steps;
        self.so_far.advancing_s += wall_s;
        self.so_far.max_overlap_m = self.so_far.max_overlap_m.max(advance.max_overlap_m);
        self.so_far.passed_through += advance.passed_through;
        self.fault = advance.fault;
    }

    pub(super) fn progress(&self, subparticles: u64, wall_s: f64, discharged_kg: f64) -> Progress {
        let (simulated_s, time_s) = (self.simulated_s(), self.time_s());
        // A fill usually comes to rest in about a fifth of its time limit.
        let usual_fill_s = self.plan.longest_fill_s / 5.0;
        let (phase, fraction) = match self.belt_time_s() {
            None => {
                let filled = (simulated_s / usual_fill_s).min(0.95) * usual_fill_s;
                let whole = usual_fill_s + self.plan.duration_s;
                (Phase::Fill, filled / whole)
            }
            Some(t) => {
                let fill_s = simulated_s - t;
                (Phase::Process, simulated_s / (fill_s + self.plan.duration_s))
            }
        };
        Progress {
            phase,
            time_s,
            simulated_s,
            fraction: fraction.min(1.0),
            subparticles,
            particle_steps: self.so_far.particle_steps,
            wall_s,
            discharged_kg,
        }
    }
}
