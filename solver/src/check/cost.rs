//! What a scenario costs: sub-particles, steps, memory and time, and whether that is more than a service takes.

use serde_json::{Value, json};

use super::{Limits, fault};
use crate::engine::scene::BodyKind;
use crate::experiments::{kind_of_each, plan};
use crate::result::Estimate;
use crate::scenario::{Experiment, Fault, MAX_SAMPLES, Scenario};

/// Memory that the CPU backend takes for each sub-particle, in bytes: state, lists and their rebuilding.
const BYTES_PER_SUBPARTICLE: u64 = 1000;
/// Time of the CPU backend for each particle-step on one thread, in nanoseconds: measured, for estimates only.
const NS_PER_PARTICLE_STEP: f64 = 120.0;
/// Simulated time that a fill usually takes to come to rest, in seconds.
const USUAL_FILL_S: f64 = 2.0;
/// Share of the sub-particles that are on average still there while the hopper empties.
const USUAL_SHARE: f64 = 0.6;
/// Simulated time after which dropped fillets usually are at rest, in seconds.
const USUAL_DROP_S: f64 = 1.5;
/// Threads that the time is estimated for.
const THREADS: f64 = 2.0;

/// What a scenario comes to, whether or not anyone would run it.
#[derive(Clone, Debug)]
pub(super) struct Cost {
    fillets: u64,
    subparticles: u64,
    bonds: u64,
    mass_kg: f64,
    timestep_s: f64,
    steps: u64,
}

impl Cost {
    pub(super) fn new(scenario: &Scenario, kinds: &[BodyKind], timestep_s: f64) -> Self {
        let each = kind_of_each(scenario, kinds.len());
        let sum = |of: &dyn Fn(&BodyKind) -> f64| -> f64 { each.iter().map(|&kind| of(&kinds[kind])).sum() };
        let plan = plan(scenario);
        Self {
            fillets: each.len() as u64,
            subparticles: sum(&|kind| kind.meta.points.len() as f64) as u64,
            bonds: sum(&|kind| kind.meta.bonds.len() as f64) as u64,
            mass_kg: sum(&|kind| kind.subparticle_mass_kg * kind.meta.points.len() as f64),
            timestep_s,
            steps: ((plan.longest_fill_s + plan.duration_s) / timestep_s).ceil() as u64,
        }
    }

    /// More sub-particles than a service takes, at the field that most likely makes them so many.
    pub(super) fn size_fault(&self, scenario: &Scenario, limits: &Limits) -> Option<Fault> {
        let (pointer, value): (_, Value) = match &scenario.experiment {
            Experiment::Hopper { .. } | Experiment::Drop { .. } => ("/product/count", self.fillets.into()),
            Experiment::Scene { .. } => ("/scene/bodies", self.fillets.into()),
            Experiment::Compress { compress } => ("/compress/lattice", json!(compress.lattice)),
            Experiment::Bend { .. } | Experiment::Slide { .. } => {
                ("/product/subparticle_radius_m", scenario.product.subparticle_radius_m.into())
            }
        };
        (self.subparticles > limits.max_subparticles).then(|| {
            let detail = format!("{} sub-particles are more than this service takes", self.subparticles);
            let most = limits.max_subparticles;
            let allowed =
                format!("at most {most} sub-particles: fewer fillets or a larger sub-particle radius");
            fault(pointer, value, detail, allowed)
        })
    }

    /// More time steps than a service takes, at the field that sets how long the run is.
    pub(super) fn steps_fault(&self, scenario: &Scenario, limits: &Limits) -> Option<Fault> {
        let (pointer, value) = match &scenario.experiment {
            Experiment::Slide { slide } => ("/slide/tilt_rate_deg_s", slide.tilt_rate_deg_s),
            Experiment::Compress { compress } => ("/compress/strain_rate_1_s", compress.strain_rate_1_s),
            _ => ("/numerics/duration_s", scenario.numerics.duration_s),
        };
        (self.steps > limits.max_steps).then(|| {
            let (steps, dt, most) = (self.steps, self.timestep_s, limits.max_steps);
            let detail = format!("{steps} steps of {dt:.3e} s are more than this service takes");
            fault(
                pointer,
                value,
                detail,
                format!("at most {most} steps: a shorter run or a larger time step"),
            )
        })
    }

    /// More samples than anyone reads, where how long the run is follows from other fields than `duration_s`.
    pub(super) fn samples_fault(&self, scenario: &Scenario) -> Option<Fault> {
        let (plan, interval) = (plan(scenario), scenario.numerics.output_interval_s);
        let simulated_s = plan.longest_fill_s + plan.duration_s;
        (simulated_s / interval > MAX_SAMPLES).then(|| {
            let detail = format!("makes more than {MAX_SAMPLES} samples of {simulated_s} s");
            let least = simulated_s / MAX_SAMPLES;
            fault(
                "/numerics/output_interval_s",
                interval,
                detail,
                format!("≥ {least:.2e} s for so long a run"),
            )
        })
    }

    /// The estimate, with what a user should know.
    pub(super) fn estimate(
        self,
        scenario: &Scenario,
        stable_timestep_s: f64,
        warnings: Vec<String>,
    ) -> Estimate {
        let particle_steps = self.subparticles as f64 * usual_s(scenario) / self.timestep_s;
        Estimate {
            fillets: self.fillets,
            subparticles: self.subparticles,
            bonds: self.bonds,
            mass_kg: self.mass_kg,
            timestep_s: self.timestep_s,
            stable_timestep_s,
            steps: self.steps,
            memory_bytes: self.subparticles * BYTES_PER_SUBPARTICLE,
            wall_s: particle_steps * NS_PER_PARTICLE_STEP * 1e-9 / THREADS,
            warnings,
        }
    }
}

/// Simulated time that a run usually takes, counted as if all sub-particles were there all the time, in seconds.
fn usual_s(scenario: &Scenario) -> f64 {
    let plan = plan(scenario);
    let fill_s = plan.longest_fill_s.min(USUAL_FILL_S);
    match &scenario.experiment {
        Experiment::Hopper { .. } => fill_s + USUAL_SHARE * plan.duration_s,
        Experiment::Drop { .. } if scenario.numerics.stop.when_done => plan.duration_s.min(USUAL_DROP_S),
        _ => fill_s + plan.duration_s,
    }
}
