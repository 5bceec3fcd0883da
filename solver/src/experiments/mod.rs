//! The paper's experiments: from a scenario to a scene, and from samples to responses.

pub mod discharge;
pub mod hopper;
pub mod laws;
pub mod placement;

use std::sync::Arc;

use crate::engine::Backend;
use crate::engine::run::{Observer, Plan, run};
use crate::engine::scene::Kind;
use crate::physics::timestep::{Stability, stability};
use crate::result::{self, EndReason, PHYSICS_REVISION, RunResult, SolverInfo, VERSION};
use crate::scenario::{Auto, Scenario, Timestep};
use crate::shape::lattice::MetaParticle;
use crate::shape::{meta_particles, subparticle_mass_kg};
use discharge::HopperWatch;

/// The shapes of a scenario, with the mass of their sub-particles.
pub fn kinds(scenario: &Scenario) -> Vec<Kind> {
    let product = &scenario.product;
    let weigh =
        |meta: Arc<MetaParticle>| Kind { subparticle_mass_kg: subparticle_mass_kg(product, &meta), meta };
    let bonds = &scenario.bonds;
    meta_particles(product, bonds.types, bonds.contact_radius_ratio).into_iter().map(weigh).collect()
}

/// The bounds on the time step: those of the lightest sub-particle.
pub fn bounds_on_timestep(scenario: &Scenario, kinds: &[Kind]) -> Stability {
    let laws = laws::laws(scenario);
    let mass = kinds.iter().map(|kind| kind.subparticle_mass_kg).fold(f64::INFINITY, f64::min);
    stability(
        mass,
        scenario.product.subparticle_radius_m,
        f64::from(laws.bond.k_n),
        f64::from(laws.bond.k_t),
        kinds.iter().any(|kind| kind.meta.bonds.iter().any(|bond| bond.class > 1)),
        &laws.tissue,
        laws.contact_between_bonded,
    )
}

/// The time step that a scenario will run with, in seconds.
pub fn timestep_s(scenario: &Scenario, stability: &Stability) -> f64 {
    match scenario.numerics.timestep_s {
        Timestep::Fixed(dt) => dt,
        Timestep::Auto(Auto::Auto) => stability.auto_s.min(scenario.numerics.output_interval_s),
    }
}

/// Runs one scenario on a backend to its end; see [`crate::simulate`].
pub fn simulate<B: Backend>(scenario: &Scenario, backend: &B, observer: &mut dyn Observer) -> RunResult {
    let scene = hopper::scene(scenario);
    let numerics = &scenario.numerics;
    let plan = Plan {
        sample_interval_s: numerics.output_interval_s,
        longest_fill_s: numerics.max_fill_s,
        duration_s: numerics.duration_s,
    };
    let mut watch = HopperWatch::new(scenario, &scene);
    let ended = run(backend, &scene, plan, &mut watch, observer);
    let info = backend.info();
    RunResult {
        schema: result::SCHEMA.to_owned(),
        responses: match ended.reason {
            EndReason::Cancelled => serde_json::Map::new(),
            reason => watch.responses(reason),
        },
        series: watch.series(),
        end_reason: ended.reason,
        instability: ended.instability,
        solver: SolverInfo {
            version: VERSION.to_owned(),
            physics_revision: PHYSICS_REVISION,
            backend: info.name,
            device: info.device,
            threads: info.threads,
            timestep_s: scene.timestep_s,
        },
        performance: ended.performance,
        scenario: scenario.clone(),
        scenario_digest: scenario.digest(),
    }
}
