//! Checks what the field table cannot: whether the fillets fit, the step is stable, and what a run will cost.

use crate::engine::scene::Kind;
use crate::experiments::laws::laws;
use crate::experiments::{bounds_on_timestep, kind_of_each, plan, timestep_s, try_kinds};
use crate::mesh::Meshes;
use crate::result::Estimate;
use crate::scenario::{Equipment, Fault, MeshRef, Scenario, SideWalls};

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
const MOST_CELLS: f64 = 1e7;
/// Memory that the CPU backend takes for each sub-particle, in bytes: state, lists and their rebuilding.
const BYTES_PER_SUBPARTICLE: u64 = 1000;
/// Time of the CPU backend for each particle-step on one thread, in nanoseconds: measured, for estimates only.
const NS_PER_PARTICLE_STEP: f64 = 500.0;
/// Simulated time that a fill usually takes to come to rest, in seconds.
const USUAL_FILL_S: f64 = 2.0;
/// Share of the sub-particles that are on average still there while the hopper empties.
const USUAL_SHARE: f64 = 0.6;
/// Threads that the time is estimated for.
const THREADS: f64 = 2.0;

/// Checks fit, stability and cost, without running anything; the scenario's meshes must be among `meshes`. Lattice fills are remembered, so that thousands of
/// similar scenarios are checked in a second.
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
            let allowed = "a closed mesh that the lattice of sub-particles fills in one piece".to_owned();
            let digest = scenario.product.mesh.as_ref().map(|mesh| mesh.digest.clone());
            return Err(vec![fault("/product/mesh", digest, error.to_string(), allowed)]);
        }
    };
    let mut faults = fill_faults(scenario, &kinds);
    if !faults.is_empty() {
        return Err(faults);
    }
    if let Some(equipment) = scenario.equipment() {
        faults.extend(fit_faults(scenario, equipment, &kinds));
    }
    faults.extend(reach_faults(scenario));

    let numerics = &scenario.numerics;
    let bounds = bounds_on_timestep(scenario, &kinds);
    let dt = timestep_s(scenario, &bounds);
    let mut warnings = Vec::new();
    if dt > bounds.undamped_s && !numerics.allow_unstable {
        faults.push(fault(
            "/numerics/timestep_s",
            dt,
            "the time step is past the stability limit 2/ω_max; /numerics/allow_unstable runs it all the same".into(),
            format!("0 < timestep_s ≤ {:.3e} s, or \"auto\"", bounds.undamped_s),
        ));
    } else if dt > bounds.damped_s {
        warnings.push(format!(
            "timestep_s {dt:.3e} s is past {:.3e} s, the stability limit with damping: the run may diverge",
            bounds.damped_s
        ));
    }

    let each = kind_of_each(scenario, kinds.len());
    let count = each.len() as u64;
    let sum = |of: &dyn Fn(&Kind) -> f64| -> f64 { each.iter().map(|&kind| of(&kinds[kind])).sum() };
    let subparticles = sum(&|kind| kind.meta.points.len() as f64) as u64;
    let plan = plan(scenario);
    let steps = ((plan.longest_fill_s + plan.duration_s) / dt).ceil() as u64;
    if subparticles > limits.max_subparticles {
        faults.push(fault(
            "/product/count",
            count,
            format!("{subparticles} sub-particles are more than this service takes"),
            format!(
                "at most {} sub-particles: fewer fillets or a larger sub-particle radius",
                limits.max_subparticles
            ),
        ));
    }
    if steps > limits.max_steps {
        faults.push(fault(
            "/numerics/duration_s",
            numerics.duration_s,
            format!("{steps} steps of {dt:.3e} s are more than this service takes"),
            format!("at most {} steps: a shorter duration or a larger time step", limits.max_steps),
        ));
    }
    if !faults.is_empty() {
        return Err(faults);
    }
    let particle_steps = subparticles as f64 * (USUAL_FILL_S + USUAL_SHARE * numerics.duration_s) / dt;
    Ok(Estimate {
        fillets: count,
        subparticles,
        bonds: sum(&|kind| kind.meta.bonds.len() as f64) as u64,
        mass_kg: sum(&|kind| kind.subparticle_mass_kg * kind.meta.points.len() as f64),
        timestep_s: dt,
        stable_timestep_s: bounds.undamped_s,
        steps,
        memory_bytes: subparticles * BYTES_PER_SUBPARTICLE,
        wall_s: particle_steps * NS_PER_PARTICLE_STEP * 1e-9 / THREADS,
        warnings,
    })
}

/// Meshes that are not at hand, or cannot be meant in their units.
fn mesh_faults(scenario: &Scenario, meshes: &Meshes) -> Vec<Fault> {
    let faulty = |(pointer, named): (String, &MeshRef)| {
        let (name, detail, allowed) = match meshes.get(&named.digest).map(|stl| stl.in_units(named.units)) {
            None => {
                ("digest", "is not the digest of a mesh at hand".to_owned(), "that of a mesh given along")
            }
            Some(Err(error)) => ("units", error.to_string(), "\"mm\" or \"m\", as the file means it"),
            Some(Ok(_)) => return None,
        };
        Some(fault(&format!("{pointer}/{name}"), named.digest.clone(), detail, allowed.to_owned()))
    };
    scenario.named_meshes().into_iter().filter_map(faulty).collect()
}

/// Radii so small against the fillets or the hopper that even looking at them would take too long.
fn size_faults(scenario: &Scenario) -> Vec<Fault> {
    let product = &scenario.product;
    let radius = product.radius_m();
    let cells = |size: &[f64; 3]| size.iter().map(|s| s / (2.0 * radius) + 2.0).product::<f64>();
    // Each size is filled twice, as it is and mirrored.
    let points: f64 = product.scaled_sizes_m().map(|size| 2.0 * cells(&size)).sum();
    let floor = scenario
        .equipment()
        .map_or(0.0, |equipment| equipment.hopper_length_m * equipment.hopper_width_m / (radius * radius));
    [(points, "lattice points of the fillets' boxes"), (floor, "places on the hopper's floor")]
        .into_iter()
        .filter(|(number, _)| *number > MOST_CELLS)
        .map(|(number, what)| {
            let detail = format!("makes about {number:.1e} {what}");
            let allowed = format!("a radius that makes at most {MOST_CELLS:.0e}, or smaller dimensions");
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
    .filter(|(_, _, law)| f64::from(law.reach()) > radius)
    .map(|(name, pair, law)| {
        fault(
            &format!("/contact/{name}/surface_energy_j_m2"),
            pair.surface_energy_j_m2,
            format!("adhesive necks would reach {:.1e} m at this Young's modulus", law.reach()),
            format!("a neck of at most the sub-particle radius, {radius} m"),
        )
    })
    .collect()
}

/// Sizes in which the lattice leaves no sub-particle.
fn fill_faults(scenario: &Scenario, kinds: &[Kind]) -> Vec<Fault> {
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

/// Fillets that fit the hopper in no orientation, or are too many for its volume.
fn fit_faults(scenario: &Scenario, equipment: &Equipment, kinds: &[Kind]) -> Vec<Fault> {
    let product = &scenario.product;
    let radius = product.radius_m();
    let mut faults = Vec::new();
    let periodic = equipment.side_walls == SideWalls::Periodic;
    for (k, size) in product.scaled_sizes_m().enumerate() {
        // Upright, a fillet needs its two lesser dimensions; the greater of those must fit both ways, with some
        // room to turn or it would never be placed.
        let mut sorted = size;
        sorted.sort_unstable_by(f64::total_cmp);
        let mut must_fit = |pointer: &str, room: f64, dimension: f64| {
            let needs = dimension + 4.0 * radius;
            if room < needs {
                let detail = format!("fillets of size {k} of /product/sizes_m cannot fit between the walls");
                faults.push(fault(pointer, room, detail, format!("at least {needs:.4} m")));
            }
        };
        must_fit("/equipment/hopper_length_m", equipment.hopper_length_m, sorted[1]);
        // A fillet must not meet its own image.
        let across = if periodic { sorted[2] } else { sorted[1] };
        must_fit("/equipment/hopper_width_m", equipment.hopper_width_m, across);
    }
    let area = equipment.hopper_length_m * equipment.hopper_width_m;
    let lean = equipment.hopper_height_m * equipment.wall_slope_deg.to_radians().tan();
    let volume =
        area * equipment.hopper_height_m + lean * equipment.hopper_height_m / 2.0 * equipment.hopper_width_m;
    let mean = kinds.iter().map(|kind| kind.meta.volume_m3).sum::<f64>() / kinds.len() as f64;
    let most = (volume / mean) as u64;
    if u64::from(product.count) > most {
        faults.push(fault(
            "/product/count",
            product.count,
            format!("the fillets alone take more than the hopper's {volume:.4} m³"),
            format!("at most {most} fillets of these sizes, or a larger hopper"),
        ));
    }
    faults
}

fn fault(pointer: &str, value: impl Into<serde_json::Value>, detail: String, allowed: String) -> Fault {
    Fault::new(pointer, &value.into(), detail, Some(allowed))
}
