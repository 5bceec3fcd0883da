//! The paper's experiments: from a scenario to a scene, and from samples to responses.

pub(crate) mod bend;
mod bending;
pub(crate) mod compress;
mod curl;
pub mod discharge;
pub mod drop;
pub mod hopper;
mod impact;
pub mod laws;
pub mod placement;
mod responses;
pub mod scene;
mod slide;
pub mod surfaces;

pub use responses::response_names;

use std::sync::Arc;

use glam::{DQuat, DVec3, EulerRot};
use serde_json::{Map, Value};

use crate::engine::Backend;
use crate::engine::run::{Decision, ExperimentMonitor, Observer, RunPlan, Sample, run};
use crate::engine::scene::{BodyKind, Scene};
use crate::engine::state::State;
use crate::mesh::Meshes;
use crate::physics::timestep::{Stability, stability};
use crate::result::{self, Curve, EndReason, RunResult, SOLVER_REVISION, Series, SolverInfo, VERSION};
use crate::scenario::{Auto, Experiment, Scenario, Timestep};
use crate::shape::lattice::{MetaParticle, max_bond_class};
use crate::shape::{ShapeError, from_block, meta_particles, subparticle_mass_kg};

/// An experiment, ready to run.
pub struct Prepared {
    /// What runs.
    pub scene: Scene,
    /// When it is looked at, and for how long it runs.
    pub plan: RunPlan,
    /// Who looks.
    pub watch: Box<dyn Watch>,
}

/// An experiment's side of a run: decides while it runs, and afterwards tells what came out.
pub trait Watch: ExperimentMonitor {
    /// The responses of the run that ended for `reason`.
    fn responses(&self, reason: EndReason) -> Map<String, Value>;

    /// What was sampled over time.
    fn series(&self) -> Vec<Series>;

    /// What came out over something else than time.
    fn curves(&self) -> Vec<Curve> {
        Vec::new()
    }
}

/// Makes an experiment of a scenario that [`crate::check()`] has passed with the same meshes.
pub fn prepare(scenario: &Scenario, meshes: &Meshes) -> Prepared {
    match &scenario.experiment {
        Experiment::Hopper { equipment } => hopper::prepare(scenario, equipment, meshes),
        Experiment::Drop { drop } => drop::prepare(scenario, drop, meshes),
        Experiment::Scene { scene } => scene::prepare(scenario, scene, meshes),
        Experiment::Compress { compress } => compress::prepare(scenario, compress, meshes),
        Experiment::Slide { slide } => slide::prepare(scenario, slide, meshes),
        Experiment::Bend { bend } => bend::prepare(scenario, bend, meshes),
    }
}

/// When a scenario is looked at, and for how long it runs at most, before t = 0 and from there on.
pub fn plan(scenario: &Scenario) -> RunPlan {
    let numerics = &scenario.numerics;
    let (longest_fill_s, duration_s) = match &scenario.experiment {
        Experiment::Hopper { .. } | Experiment::Bend { .. } => (numerics.max_fill_s, numerics.duration_s),
        Experiment::Drop { .. } | Experiment::Scene { .. } => (0.0, numerics.duration_s),
        Experiment::Slide { slide } => (numerics.max_fill_s, slide.max_tilt_deg / slide.tilt_rate_deg_s),
        Experiment::Compress { compress } => (0.0, compress::duration_s(compress)),
    };
    RunPlan { sample_interval_s: numerics.output_interval_s, longest_fill_s, duration_s }
}

/// The orientation of intrinsic yaw (about z), pitch (about y) and roll (about x), in degrees.
pub fn orientation([yaw, pitch, roll]: [f64; 3]) -> DQuat {
    DQuat::from_euler(EulerRot::ZYX, yaw.to_radians(), pitch.to_radians(), roll.to_radians())
}

/// The shapes that bodies of a scenario may have, with the mass of their sub-particles.
///
/// # Panics
/// Where [`try_kinds`] fails.
pub fn kinds(scenario: &Scenario, meshes: &Meshes) -> Vec<BodyKind> {
    try_kinds(scenario, meshes).expect("the scenario has passed the check")
}

/// The shapes that bodies of a scenario may have, with the mass of their sub-particles: all of the product's, or the one
/// that is asked for.
///
/// # Errors
/// A mesh that is no product, a block of too many sub-particles.
pub fn try_kinds(scenario: &Scenario, meshes: &Meshes) -> Result<Vec<BodyKind>, ShapeError> {
    let product = &scenario.product;
    let weigh =
        |meta: Arc<MetaParticle>| BodyKind { subparticle_mass_kg: subparticle_mass_kg(product, &meta), meta };
    let bonds = &scenario.bonds;
    if let Experiment::Compress { compress } = &scenario.experiment {
        let reach = max_bond_class(bonds.types, bonds.contact_radius_ratio);
        return Ok(vec![weigh(from_block(compress.lattice, product.radius_m(), reach)?)]);
    }
    let all = meta_particles(product, meshes, bonds.types, bonds.contact_radius_ratio)?;
    Ok(match product.shape {
        Some(shape) => all.into_iter().skip(shape as usize).take(1).map(weigh).collect(),
        None => all.into_iter().map(weigh).collect(),
    })
}

/// The kind of each body, by its index among `kinds` of them.
pub fn kind_of_each(scenario: &Scenario, kinds: usize) -> Vec<usize> {
    match &scenario.experiment {
        Experiment::Scene { scene } => scene.bodies.iter().map(|body| body.shape as usize).collect(),
        _ => (0..scenario.product.count as usize).map(|i| i % kinds).collect(),
    }
}

/// The bounds on the time step: those of the lightest sub-particle.
pub fn bounds_on_timestep(scenario: &Scenario, kinds: &[BodyKind]) -> Stability {
    let laws = laws::laws(scenario);
    let mass = kinds.iter().map(|kind| kind.subparticle_mass_kg).fold(f64::INFINITY, f64::min);
    let diagonals = kinds.iter().any(|kind| kind.meta.bonds.iter().any(|bond| bond.class > 1));
    stability(
        mass,
        scenario.product.radius_m(),
        &laws.tissue,
        &laws.bond,
        laws.contact_between_bonded,
        diagonals,
    )
}

/// How far bodies may move in a step of `"auto"` as they start, as a share of R: further, and what they hit is felt too late and too
/// much at once. Six fillets dropped flat at 4 m/s lost 1.5 % of their bonds at 0.33 to 0.37 R, and up to 1 % below, as at the paper's step.
const FARTHEST_RATIO: f64 = 0.25;

/// The time step that a scenario will run with, in seconds.
pub fn timestep_s(scenario: &Scenario, stability: &Stability) -> f64 {
    let numerics = &scenario.numerics;
    match numerics.timestep_s {
        Timestep::Fixed(dt) => dt,
        Timestep::Auto(Auto::Auto) => {
            let farthest = FARTHEST_RATIO * scenario.product.radius_m();
            stability.auto_s.min(farthest / fastest_start_m_s(scenario)).min(numerics.output_interval_s)
        }
    }
}

/// The greatest speed of a body at the start, in m/s.
fn fastest_start_m_s(scenario: &Scenario) -> f64 {
    match &scenario.experiment {
        Experiment::Drop { drop } => drop.speed_m_s,
        Experiment::Scene { scene } => {
            let speeds = scene.bodies.iter().map(|body| DVec3::from(body.velocity_m_s).length());
            speeds.fold(0.0, f64::max)
        }
        _ => 0.0,
    }
}

/// The sub-particles, by serial, that are outside a box.
fn strayed(state: &State, low: DVec3, high: DVec3) -> Vec<u32> {
    let inside = |x: DVec3| x.cmpge(low).all() && x.cmple(high).all();
    let outside = (0..state.particles.len()).filter(|&i| !inside(state.position(i)));
    outside.map(|i| state.serials[i]).collect()
}

/// A watch as the director of a run.
struct Directing<'a>(&'a mut dyn Watch);

impl ExperimentMonitor for Directing<'_> {
    fn observe(&mut self, sample: &Sample<'_>) -> Decision {
        self.0.observe(sample)
    }

    fn discharged_kg(&self) -> f64 {
        self.0.discharged_kg()
    }

    fn series_so_far(&self) -> Vec<Series> {
        self.0.series()
    }
}

/// Runs one scenario on a backend to its end; see [`crate::simulate`].
pub fn simulate<B: Backend>(
    scenario: &Scenario,
    meshes: &Meshes,
    backend: &B,
    observer: &mut dyn Observer,
) -> RunResult {
    let Prepared { scene, plan, mut watch } = prepare(scenario, meshes);
    let ended = run(backend, &scene, plan, &mut Directing(&mut *watch), observer);
    let info = backend.info();
    RunResult {
        schema: result::SCHEMA.to_owned(),
        responses: match ended.reason {
            EndReason::Cancelled => serde_json::Map::new(),
            reason => watch.responses(reason),
        },
        series: watch.series(),
        curves: watch.curves(),
        end_reason: ended.reason,
        instability: ended.instability,
        solver: SolverInfo {
            version: VERSION.to_owned(),
            revision: SOLVER_REVISION,
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
