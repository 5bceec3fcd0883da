//! The cost of a scenario: sub-particles, steps, memory and time, against the limits of a service.

use super::Limits;
use crate::engine::scene::BodyKind;
use crate::experiments::Setup;
use crate::result::Estimate;
use crate::scenario::{Fault, MAX_SAMPLES};

/// Memory of the CPU backend per sub-particle, in bytes: state, lists and their rebuilding.
const BYTES_PER_SUBPARTICLE: u64 = 1000;
/// Time of the CPU backend per particle-step on one thread, in nanoseconds: measured, for estimates only.
const NS_PER_PARTICLE_STEP: f64 = 120.0;
/// Threads of the estimated time.
const THREADS: f64 = 2.0;

/// The cost of a scenario.
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
    pub(super) fn new(setup: &Setup, timestep_s: f64) -> Self {
        let each = setup.kind_of_each();
        let sum =
            |of: &dyn Fn(&BodyKind) -> f64| -> f64 { each.iter().map(|&kind| of(&setup.kinds[kind])).sum() };
        let plan = setup.plan();
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
    pub(super) fn size_fault(&self, setup: &Setup, limits: &Limits) -> Option<Fault> {
        let (pointer, value) = setup.definition().size_field(&setup.scenario, self.fillets);
        (self.subparticles > limits.max_subparticles).then(|| {
            let detail = format!("{} sub-particles are more than this service takes", self.subparticles);
            let most = limits.max_subparticles;
            let allowed = format!(
                "at most {most} sub-particles: fewer fillets, filled or fed, or a larger sub-particle radius"
            );
            Fault::at(pointer, value, detail, allowed)
        })
    }

    /// More time steps than a service takes, at the field that sets how long the run is.
    pub(super) fn steps_fault(&self, setup: &Setup, limits: &Limits) -> Option<Fault> {
        let (pointer, value) = setup.definition().duration_field(&setup.scenario.numerics);
        (self.steps > limits.max_steps).then(|| {
            let (steps, dt, most) = (self.steps, self.timestep_s, limits.max_steps);
            let detail = format!("{steps} steps of {dt:.3e} s are more than this service takes");
            Fault::at(
                pointer,
                value,
                detail,
                format!("at most {most} steps: a shorter run or a larger time step"),
            )
        })
    }

    /// Too many samples, where other fields than `duration_s` set the duration.
    pub(super) fn samples_fault(&self, setup: &Setup) -> Option<Fault> {
        let (plan, interval) = (setup.plan(), setup.scenario.numerics.output_interval_s);
        let simulated_s = plan.longest_fill_s + plan.duration_s;
        (simulated_s / interval > MAX_SAMPLES).then(|| {
            let detail = format!("makes more than {MAX_SAMPLES} samples of {simulated_s} s");
            let least = simulated_s / MAX_SAMPLES;
            Fault::at(
                "/numerics/output_interval_s",
                interval,
                detail,
                format!("≥ {least:.2e} s for so long a run"),
            )
        })
    }

    /// The estimate, with warnings.
    pub(super) fn estimate(self, setup: &Setup, stable_timestep_s: f64, warnings: Vec<String>) -> Estimate {
        let usual_s = setup.definition().usual_s(&setup.scenario.numerics);
        let particle_steps = self.subparticles as f64 * usual_s / self.timestep_s;
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
