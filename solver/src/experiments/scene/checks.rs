//! Checks of a scene: bodies that start inside something, surfaces that never appear, and too many samples of loads.

use serde_json::json;

use crate::experiments::Setup;
use crate::experiments::clashes::{OVERLAP_RATIO, Obstacle, clashes};
use crate::experiments::loads::too_many_loads;
use crate::scenario::{Fault, FreeScene, PresenceKind};

/// Maximum number of bodies that are reported. A document of many thousand bodies may be wrong in each.
const MAX_FAULTS: usize = 1000;

/// Bodies inside each other or a surface, surfaces that never are there, more samples of forces than anyone reads.
pub(super) fn faults(setup: &Setup, free: &FreeScene) -> Vec<Fault> {
    let mut faults = start_faults(setup, free);
    for (index, surface) in free.surfaces.iter().enumerate() {
        if surface.presence == PresenceKind::UntilStart {
            let detail = "a scene begins at t = 0, where this surface goes".to_owned();
            let pointer = format!("/scene/surfaces/{index}/presence");
            faults.push(Fault::at(&pointer, "until_start", detail, "always".to_owned()));
        }
    }
    let numerics = &setup.scenario.numerics;
    if let Some((detail, allowed)) = too_many_loads(numerics, free.surfaces.len()) {
        let pointer = "/numerics/output_interval_s";
        faults.push(Fault::at(pointer, numerics.output_interval_s, detail, allowed));
    }
    faults
}

/// Bodies that start inside each other, or inside or through a surface.
fn start_faults(setup: &Setup, free: &FreeScene) -> Vec<Fault> {
    let scene = setup.scene();
    let ratio = f64::from(scene.laws.body_radius_ratio);
    let (apart, off) =
        ((2.0 * ratio - OVERLAP_RATIO) * scene.radius_m, (1.0 - OVERLAP_RATIO) * scene.radius_m);
    let clash = |(body, other): (usize, Obstacle)| {
        let (detail, allowed) = match other {
            Obstacle::Body(other) => (
                format!("starts inside the body at /scene/bodies/{other}"),
                format!("places where their sub-particles are at least {apart:.2e} m apart"),
            ),
            Obstacle::Surface(other) => (
                format!(
                    "starts inside or through the surface \"{}\" at /scene/surfaces/{other}",
                    free.surfaces[other].name
                ),
                format!("places where its sub-particles are at least {off:.2e} m from it"),
            ),
        };
        let pointer = format!("/scene/bodies/{body}/position_m");
        Fault::at(&pointer, json!(free.bodies[body].position_m), detail, allowed)
    };
    clashes(scene).into_iter().map(clash).take(MAX_FAULTS).collect()
}
