//! Checks what the field table cannot: whether the fillets fit, the step is stable, and what a run will cost.

mod cost;
mod hopper;
mod inside;
mod scene;

use serde_json::{Value, json};

use crate::engine::scene::BodyKind;
use crate::experiments::bend::clamp_fault;
use crate::experiments::compress::lattice_fault;
use crate::experiments::laws::laws;
use crate::experiments::{bounds_on_timestep, timestep_s, try_kinds};
use crate::mesh::Meshes;
use crate::physics::timestep::Stability;
use crate::result::Estimate;
use crate::scenario::{Experiment, Fault, MeshRef, Scenario};
use cost::Cost;
use hopper::{fit_faults, surface_faults};
use scene::scene_faults;

/// What an operator allows a single scenario to cost.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Sub-particles at the start of a run.
    pub max_subparticles: u64,
    /// Time steps of a run.
    pub max_steps: u64,
}

impl Default for Limits {
    fn default() -> Self {
        Self { max_subparticles: 2_000_000, max_steps: 50_000_000 }
    }
}

/// Cells that placing and filling may make: a few seconds of work.
const MAX_LATTICE_CELLS: f64 = 1e7;
/// Checks fit, stability and cost, without running anything; the scenario's meshes must be among `meshes`. Lattice fills
/// are remembered, so that thousands of similar scenarios are checked in a second.
///
/// # Errors
/// Every fault found, each naming its field.
pub fn check(scenario: &Scenario, meshes: &Meshes, limits: &Limits) -> Result<Estimate, Vec<Fault>> {
    let faults = mesh_faults(scenario, meshes);
    if !faults.is_empty() {
        return Err(faults);
    }
    let faults = size_faults(scenario);
    if !faults.is_empty() {
        return Err(faults);
    }
    let kinds = match try_kinds(scenario, meshes) {
        Ok(kinds) => kinds,
        Err(error) => {
            if let Experiment::Compress { compress } = &scenario.experiment {
                return Err(vec![lattice_fault(compress, &error)]);
            }
            let allowed = "a closed mesh that the lattice of sub-particles fills in one piece".to_owned();
            let digest = scenario.product.mesh.as_ref().map(|mesh| mesh.digest.clone());
            return Err(vec![fault("/product/mesh", digest, error.to_string(), allowed)]);
        }
    };
    let mut faults = fill_faults(scenario, &kinds);
    if !faults.is_empty() {
        return Err(faults);
    }
    if let Experiment::Hopper { equipment } = &scenario.experiment {
        faults.extend(fit_faults(scenario, equipment, meshes, &kinds));
    }
    let fits = faults.is_empty();
    faults.extend(reach_faults(scenario));
    let bounds = bounds_on_timestep(scenario, &kinds);
    let dt = timestep_s(scenario, &bounds);
    faults.extend(timestep_fault(scenario, &bounds, dt));
    let cost = Cost::new(scenario, &kinds, dt);
    let size_fault = cost.size_fault(scenario, limits);
    // Where everything starts is looked at only when there is not too much of it, and room for it.
    if size_fault.is_none() {
        faults.extend(match &scenario.experiment {
            Experiment::Hopper { equipment } if fits => surface_faults(scenario, equipment, meshes),
            Experiment::Scene { scene } => scene_faults(scenario, scene, meshes),
            Experiment::Bend { bend } => clamp_fault(scenario, bend, &kinds).into_iter().collect(),
            _ => Vec::new(),
        });
    }
    faults.extend(size_fault);
    faults.extend(cost.steps_fault(scenario, limits));
    faults.extend(cost.samples_fault(scenario));
    if !faults.is_empty() {
        return Err(faults);
    }
    let warning = || {
        let damped = bounds.damped_s;
        format!(
            "timestep_s {dt:.3e} s is past {damped:.3e} s, the stability limit with damping: the run may diverge"
        )
    };
    let warnings = (dt > bounds.damped_s).then(warning).into_iter().collect();
    Ok(cost.estimate(scenario, bounds.undamped_s, warnings))
}

/// A time step past the estimate at which a bed diverges, unless that is what is wanted.
fn timestep_fault(scenario: &Scenario, bounds: &Stability, dt: f64) -> Option<Fault> {
    let refused = dt > bounds.undamped_s && !scenario.numerics.allow_unstable;
    refused.then(|| {
        fault(
            "/numerics/timestep_s",
            dt,
            "the time step is past the stability limit 2/ω_max; /numerics/allow_unstable runs it all the same".into(),
            format!("0 < timestep_s ≤ {:.3e} s, or \"auto\"", bounds.undamped_s),
        )
    })
}

/// Meshes that are not at hand, or cannot be meant in their units.
fn mesh_faults(scenario: &Scenario, meshes: &Meshes) -> Vec<Fault> {
    let faulty = |(pointer, named): (String, &MeshRef)| {
        let told = |name: &str, value: Value, detail: String, allowed: &str| {
            Some(fault(&format!("{pointer}/{name}"), value, detail, allowed.to_owned()))
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

/// Radii so small against the fillets or the hopper that even looking at them would take too long.
fn size_faults(scenario: &Scenario) -> Vec<Fault> {
    let product = &scenario.product;
    let radius = product.radius_m();
    let cells = |size: &[f64; 3]| size.iter().map(|s| s / (2.0 * radius) + 2.0).product::<f64>();
    // Each size is filled twice, as it is and mirrored.
    let points: f64 = match &scenario.experiment {
        Experiment::Compress { compress } => compress.lattice.map(f64::from).iter().product(),
        // A mesh is looked at when it is filled.
        _ if product.mesh.is_some() => 0.0,
        _ => product.scaled_sizes_m().map(|size| 2.0 * cells(&size)).sum(),
    };
    let floor = scenario
        .equipment()
        .map_or(0.0, |equipment| equipment.hopper_length_m * equipment.hopper_width_m / (radius * radius));
    [(points, "lattice points of the fillets' boxes"), (floor, "places on the hopper's floor")]
        .into_iter()
        .filter(|(number, _)| *number > MAX_LATTICE_CELLS)
        .map(|(number, what)| {
            let detail = format!("makes about {number:.1e} {what}");
            let allowed =
                format!("a radius that makes at most {MAX_LATTICE_CELLS:.0e}, or smaller dimensions");
            fault("/product/subparticle_radius_m", radius, detail, allowed)
        })
        .collect()
}

/// Adhesion so strong against the stiffness that necks would reach past the nearest neighbours.
fn reach_faults(scenario: &Scenario) -> Vec<Fault> {
    let (laws, contact) = (laws(scenario), &scenario.contact);
    let radius = scenario.product.radius_m();
    [
        ("fillet_fillet", &contact.fillet_fillet, laws.tissue),
        ("fillet_equipment", &contact.fillet_equipment, laws.equipment),
        ("fillet_belt", &contact.fillet_belt, laws.belt),
    ]
    .into_iter()
    .filter(|(_, _, law)| f64::from(law.adhesion_range()) > radius)
    .map(|(name, pair, law)| {
        fault(
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
            fault(
                "/product/subparticle_radius_m",
                product.subparticle_radius_m,
                format!("no sub-particle fits inside size {k} of /product/sizes_m ({length} × {width} × {thickness} m)"),
                "a smaller radius, a larger size, or fill \"centres\"".into(),
            )
        })
        .collect()
}

fn fault(pointer: &str, value: impl Into<serde_json::Value>, detail: String, allowed: String) -> Fault {
    Fault::new(pointer, &value.into(), detail, Some(allowed))
}
