//! Checks beyond the field table: whether the fillets fit, whether the step is stable, and the cost of a run.

mod cost;

use std::sync::Arc;

use serde_json::{Value, json};

use crate::engine::scene::BodyKind;
use crate::experiments::laws::laws;
use crate::experiments::{Setup, definition, timestep_s, warnings_of_scenario};
use crate::mesh::Meshes;
use crate::physics::timestep::Stability;
use crate::result::{Estimate, Warning};
use crate::scenario::{Experiment, Fault, Fill, MeshRef, Scenario};
use cost::Cost;

/// The limits of an operator for a single scenario.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Sub-particles at the start of a run.
    pub max_subparticles: u64,
    /// Time steps of a run.
    pub max_steps: u64,
}

impl Limits {
    /// No limits.
    pub const NONE: Self = Self { max_subparticles: u64::MAX, max_steps: u64::MAX };
}

impl Default for Limits {
    fn default() -> Self {
        Self { max_subparticles: 2_000_000, max_steps: 50_000_000 }
    }
}

/// Maximum count of cells for placing and filling: a few seconds of work.
const MAX_LATTICE_CELLS: f64 = 1e7;
/// The same for a fill by volume, which tests many points of each cell at the surface.
const MAX_SAMPLED_CELLS: f64 = 1e6;

/// A scenario that has passed the check, ready to run. Clones share its bodies and its scene.
#[derive(Clone, Debug)]
pub struct Checked {
    setup: Arc<Setup>,
    estimate: Estimate,
    warnings: Vec<Warning>,
}

impl Checked {
    /// The scenario.
    pub fn scenario(&self) -> &Scenario {
        &self.setup.scenario
    }

    /// The scenario with its bodies, meshes and scene.
    pub fn setup(&self) -> &Setup {
        &self.setup
    }

    /// The cost of a run.
    pub fn estimate(&self) -> &Estimate {
        &self.estimate
    }

    /// Warnings that need no run. Their messages are in the estimate too.
    pub fn warnings(&self) -> &[Warning] {
        &self.warnings
    }

    /// The cost of a run, alone.
    pub fn into_estimate(self) -> Estimate {
        self.estimate
    }
}

/// Checks fit, stability and cost without running anything. The scenario's meshes must be among `meshes`. Lattice fills
/// are cached, so that thousands of similar scenarios are checked in a second.
///
/// # Errors
/// Every fault found, each naming its field.
pub fn check(scenario: &Scenario, meshes: &Meshes, limits: &Limits) -> Result<Checked, Vec<Fault>> {
    none(mesh_faults(scenario, meshes))?;
    none(size_faults(scenario))?;
    let setup = Setup::new(scenario, meshes)?;
    none(fill_faults(scenario, &setup.kinds))?;
    let mut faults = setup.definition().fit_faults(&setup);
    let fits = faults.is_empty();
    faults.extend(reach_faults(scenario));
    let bounds = setup.bounds();
    let dt = timestep_s(scenario, &bounds);
    faults.extend(timestep_fault(scenario, &bounds, dt));
    let cost = Cost::new(&setup, dt);
    let size_fault = cost.size_fault(&setup, limits);
    // The start is checked only in a scenario of a permitted size that fits.
    if size_fault.is_none() && fits {
        faults.extend(setup.definition().start_faults(&setup));
    }
    faults.extend(size_fault);
    faults.extend(cost.steps_fault(&setup, limits));
    faults.extend(cost.samples_fault(&setup));
    none(faults)?;
    let warnings = warnings_of_scenario(&setup);
    let messages = warnings.iter().map(|warning| warning.message.clone()).collect();
    let estimate = cost.estimate(&setup, bounds.undamped_s, messages);
    Ok(Checked { setup: Arc::new(setup), estimate, warnings })
}

fn none(faults: Vec<Fault>) -> Result<(), Vec<Fault>> {
    if faults.is_empty() { Ok(()) } else { Err(faults) }
}

/// A time step past the estimate at which a bed diverges, unless `allow_unstable` permits it.
fn timestep_fault(scenario: &Scenario, bounds: &Stability, dt: f64) -> Option<Fault> {
    let refused = dt > bounds.undamped_s && !scenario.numerics.allow_unstable;
    refused.then(|| {
        Fault::at(
            "/numerics/timestep_s",
            dt,
            "the time step is past the stability limit 2/ω_max; /numerics/allow_unstable runs it all the same",
            format!("0 < timestep_s ≤ {:.3e} s, or \"auto\"", bounds.undamped_s),
        )
    })
}

/// Missing meshes, and meshes of an implausible size in their units.
fn mesh_faults(scenario: &Scenario, meshes: &Meshes) -> Vec<Fault> {
    let faulty = |(pointer, named): (String, &MeshRef)| {
        let told = |name: &str, value: Value, detail: String, allowed: &str| {
            Some(Fault::at(&format!("{pointer}/{name}"), value, detail, allowed.to_owned()))
        };
        match meshes.get(&named.digest).map(|stl| stl.in_units(named.units)) {
            None => {
                let detail = "is not the digest of a mesh at hand".to_owned();
                told("digest", json!(named.digest), detail, "that of a mesh given along")
            }
            Some(Err(error)) => {
                let allowed = "\"mm\" or \"m\", as the file means it";
                told("units", json!(named.units), error.to_string(), allowed)
            }
            Some(Ok(_)) => None,
        }
    };
    scenario.named_meshes().into_iter().filter_map(faulty).collect()
}

/// Radii so small against the fillets or the hopper that even the check would take too long.
fn size_faults(scenario: &Scenario) -> Vec<Fault> {
    let product = &scenario.product;
    let radius = product.radius_m();
    let definition = definition(&scenario.experiment);
    let points = definition.lattice_points(product);
    let floor = definition.floor_cells(radius);
    // The block of a compression is no shape.
    let samples = product.fill == Fill::Volume && !matches!(scenario.experiment, Experiment::Compress { .. });
    let (most, or) = match samples {
        true => (MAX_SAMPLED_CELLS, ", or /product/fill \"centres\""),
        false => (MAX_LATTICE_CELLS, ""),
    };
    [
        (points, "lattice points of the fillets' boxes", most, or),
        (floor, "places on the hopper's floor", MAX_LATTICE_CELLS, ""),
    ]
    .into_iter()
    .filter(|(number, _, most, _)| number > most)
    .map(|(number, what, most, or)| {
        let detail = format!("makes about {number:.1e} {what}");
        let allowed = format!("a radius that makes at most {most:.0e}, or smaller dimensions{or}");
        Fault::at("/product/subparticle_radius_m", radius, detail, allowed)
    })
    .collect()
}

/// Adhesion so strong against the stiffness that necks would reach past the nearest neighbours.
fn reach_faults(scenario: &Scenario) -> Vec<Fault> {
    let (laws, contact) = (laws(scenario), &scenario.contact);
    let radius = scenario.product.radius_m();
    [
        ("fillet_fillet", &contact.fillet_fillet, laws.between_bodies()),
        ("fillet_equipment", &contact.fillet_equipment, laws.equipment),
        ("fillet_belt", &contact.fillet_belt, laws.belt),
    ]
    .into_iter()
    .filter(|(_, _, law)| f64::from(law.adhesion_range()) > radius)
    .map(|(name, pair, law)| {
        Fault::at(
            &format!("/contact/{name}/surface_energy_j_m2"),
            pair.surface_energy_j_m2,
            format!("adhesive necks would reach {:.1e} m at this Young's modulus", law.adhesion_range()),
            format!("a neck of at most the sub-particle radius, {radius} m"),
        )
    })
    .collect()
}

/// Sizes in which the lattice leaves no sub-particle.
fn fill_faults(scenario: &Scenario, kinds: &[BodyKind]) -> Vec<Fault> {
    let product = &scenario.product;
    let first = product.shape.map_or(0, |shape| shape as usize);
    let empty = kinds.iter().enumerate().filter(|(_, kind)| kind.meta.points.is_empty());
    let mut sizes: Vec<usize> = empty.map(|(k, _)| (first + k) / 2).collect();
    sizes.dedup();
    sizes
        .into_iter()
        .map(|k| {
            let [length, width, thickness] = product.sizes_m[k];
            Fault::at(
                "/product/subparticle_radius_m",
                product.subparticle_radius_m,
                format!("no sub-particle fits inside size {k} of /product/sizes_m ({length} × {width} × {thickness} m)"),
                "a smaller radius, a larger size, or fill \"centres\"",
            )
        })
        .collect()
}

/// The scene of a scenario without meshes.
#[cfg(test)]
pub(crate) fn scene_of(scenario: &Scenario) -> crate::engine::scene::Scene {
    let checked = check(scenario, &Meshes::default(), &Limits::NONE).expect("a scenario that can run");
    checked.setup().scene().clone()
}
