//! Whether what a scene is made of can stand where it is put, and what it tells is not too much.

use serde_json::json;

use super::fault;
use super::inside::{OVERLAP_RATIO, Other, clashes};
use crate::experiments::scene::scene;
use crate::mesh::Meshes;
use crate::scenario::{Fault, FreeScene, PresenceKind, Scenario};

/// The most numbers that the forces on surfaces may come to: half of what a server takes as a result.
const MOST_FORCES: f64 = 4e5;

/// Bodies inside each other or a surface, surfaces that never are there, more samples of forces than anyone reads.
pub(super) fn scene_faults(scenario: &Scenario, free: &FreeScene, meshes: &Meshes) -> Vec<Fault> {
    let mut faults = start_faults(scenario, free, meshes);
    for (index, surface) in free.surfaces.iter().enumerate() {
        if surface.presence == PresenceKind::UntilStart {
            let detail = "a scene begins at t = 0, where this surface goes".to_owned();
            let pointer = format!("/scene/surfaces/{index}/presence");
            faults.push(fault(&pointer, "until_start", detail, "always".to_owned()));
        }
    }
    let numerics = &scenario.numerics;
    let per_sample = 3.0 * free.surfaces.len() as f64;
    if per_sample * numerics.duration_s / numerics.output_interval_s > MOST_FORCES {
        let least = per_sample * numerics.duration_s / MOST_FORCES;
        faults.push(fault(
            "/numerics/output_interval_s",
            numerics.output_interval_s,
            format!(
                "the forces on {} surfaces make more than {MOST_FORCES:.0e} numbers",
                free.surfaces.len()
            ),
            format!("≥ {least:.2e} s at this duration and number of surfaces"),
        ));
    }
    faults
}

/// Bodies that start inside each other, or inside or through a surface.
fn start_faults(scenario: &Scenario, free: &FreeScene, meshes: &Meshes) -> Vec<Fault> {
    let scene = scene(scenario, free, meshes);
    let (apart, off) = ((2.0 - OVERLAP_RATIO) * scene.radius_m, (1.0 - OVERLAP_RATIO) * scene.radius_m);
    let clash = |(body, other): (usize, Other)| {
        let (detail, allowed) = match other {
            Other::Body(other) => (
                format!("starts inside the body at /scene/bodies/{other}"),
                format!("places where their sub-particles are at least {apart:.2e} m apart"),
            ),
            Other::Surface(other) => (
                format!(
                    "starts inside or through the surface \"{}\" at /scene/surfaces/{other}",
                    free.surfaces[other].name
                ),
                format!("places where its sub-particles are at least {off:.2e} m from it"),
            ),
        };
        let pointer = format!("/scene/bodies/{body}/position_m");
        fault(&pointer, json!(free.bodies[body].position_m), detail, allowed)
    };
    clashes(&scene).into_iter().map(clash).collect()
}
