//! Checks of the hopper: whether the fillets fit it, and whether its surfaces leave them room.

use glam::DVec3;
use serde_json::json;

use super::feed::{MAX_FED, entry_box, fed_kinds};
use crate::engine::scene::Scene;
use crate::equipment::{Presence, Surface};
use crate::experiments::Setup;
use crate::experiments::clashes::{OVERLAP_RATIO, Obstacle, clashes};
use crate::experiments::loads::too_many_loads;
use crate::experiments::surfaces::extent;
use crate::mesh::{Mesh, Meshes};
use crate::scenario::{Equipment, Fault, Product, SideWalls};

/// Length, width and thickness of every size of fillet, scaled, in metres, with its name in the document.
fn sizes(product: &Product, meshes: &Meshes) -> Vec<(String, [f64; 3])> {
    if product.spheres {
        return vec![("/product/spheres".to_owned(), [2.0 * product.radius_m(); 3])];
    }
    if let Some(named) = &product.mesh {
        let mesh = meshes.get(&named.digest).and_then(|stl| stl.in_units(named.units).ok());
        let size = |mesh: Mesh| ("/product/mesh".to_owned(), (mesh.size_m() * product.scale).to_array());
        return mesh.map(size).into_iter().collect();
    }
    let there = |k: &usize| product.shape.is_none_or(|shape| shape as usize / 2 == *k);
    let sizes = product.scaled_sizes_m().enumerate().filter(|(k, _)| there(k));
    sizes.map(|(k, size)| (format!("size {k} of /product/sizes_m"), size)).collect()
}

/// Fillets that fit the hopper in no orientation, or are too many for its volume.
pub(super) fn fit_faults(setup: &Setup, equipment: &Equipment) -> Vec<Fault> {
    let (product, kinds) = (&setup.scenario.product, &setup.kinds);
    let radius = product.radius_m();
    let mut faults = Vec::new();
    let periodic = equipment.side_walls == SideWalls::Periodic;
    for (named, size) in sizes(product, &setup.meshes) {
        // Upright, a fillet needs its two lesser dimensions; the greater of those must fit both ways, with some
        // room to turn or it would never be placed.
        let mut sorted = size;
        sorted.sort_unstable_by(f64::total_cmp);
        let mut must_fit = |pointer: &str, room: f64, dimension: f64| {
            let needs = dimension + 4.0 * radius;
            if room < needs {
                let detail = format!("fillets of {named} cannot fit between the walls");
                faults.push(Fault::at(pointer, room, detail, format!("at least {needs:.4} m")));
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
        faults.push(Fault::at(
            "/product/count",
            product.count,
            format!("the fillets alone take more than the hopper's {volume:.4} m³"),
            format!("at most {most} fillets of these sizes, or a larger hopper"),
        ));
    }
    faults.extend(feed_fault(setup, equipment));
    faults
}

/// A feed of more fillets than a hopper takes.
fn feed_fault(setup: &Setup, equipment: &Equipment) -> Option<Fault> {
    let fed = fed_kinds(&setup.scenario, equipment, &setup.kinds);
    (fed.len() >= MAX_FED).then(|| {
        let kg: f64 = fed.iter().map(|&kind| setup.kinds[kind].mass_kg()).sum();
        let most = kg / setup.scenario.numerics.duration_s;
        let detail = format!("the feed brings {MAX_FED} fillets or more until /numerics/duration_s");
        let allowed = format!("below {most:.3e} kg/s for this duration");
        Fault::at("/equipment/feed_kg_s", equipment.feed_kg_s, detail, allowed)
    })
}

/// A surface that a fillet would feel on one side of the seam of a periodic hopper only.
fn seam_fault(scene: &Scene, index: usize, surface: &Surface) -> Option<Fault> {
    let (low, high) = extent(std::slice::from_ref(surface))?;
    let reach = scene.radius_m + f64::from(scene.laws.adhesion_range());
    let ends = [low.y - scene.low.y, scene.high.y - high.y];
    let is_near = ends.iter().any(|beyond| *beyond < reach);
    let goes_past = ends.iter().all(|beyond| *beyond <= -reach);
    (is_near && !goes_past).then(|| {
        Fault::at(
            &format!("/equipment/surfaces/{index}"),
            json!(surface.name),
            format!(
                "\"{}\" ends near the seam of the periodic hopper, and would be felt on one side of it only",
                surface.name
            ),
            format!(
                "y from {:.4} to {:.4} m, or past both seams, at ± {:.4} m, by {reach:.2e} m",
                scene.low.y + reach,
                scene.high.y - reach,
                scene.high.y
            ),
        )
    })
}

/// Faults of the start: surfaces that are missing or in the way, and more numbers for the loads on them than a result holds.
pub(super) fn start_faults(setup: &Setup, equipment: &Equipment) -> Vec<Fault> {
    let mut faults = surface_faults(setup, equipment);
    faults.extend(entry_faults(setup, equipment));
    let numerics = &setup.scenario.numerics;
    let count = || setup.scene().surfaces.len();
    let loads = equipment.surface_loads.then(|| too_many_loads(numerics, count())).flatten();
    faults.extend(loads.map(|(detail, interval)| {
        let allowed = format!("false, or /numerics/output_interval_s {interval}");
        Fault::at("/equipment/surface_loads", true, detail, allowed)
    }));
    faults
}

/// Surfaces of the scenario in the space in which fed fillets appear. Those that move count where they are at t = 0.
fn entry_faults(setup: &Setup, equipment: &Equipment) -> Vec<Fault> {
    if equipment.feed_kg_s == 0.0 || equipment.surfaces.is_empty() {
        return Vec::new();
    }
    let scene = setup.scene();
    let (low, high) = entry_box(equipment, scene);
    let own = &scene.surfaces[scene.surfaces.len() - equipment.surfaces.len()..];
    let in_the_way = own.iter().filter(|surface| {
        surface.presence == Presence::Always
            && surface.triangles.iter().any(|triangle| cuts_box(triangle, low, high))
    });
    let fault = |surface: &Surface| {
        let detail =
            format!("fillets would appear in the surface \"{}\", which is over the hopper", surface.name);
        let allowed = format!(
            "0, or no surface from {:.3} to {:.3} m over the floor; set /equipment/hopper_height_m above it",
            low.z, high.z
        );
        Fault::at("/equipment/feed_kg_s", equipment.feed_kg_s, detail, allowed)
    };
    in_the_way.map(fault).collect()
}

/// Whether a part of a triangle lies in a box: what is left when the six sides of the box have cut it (Sutherland and Hodgman).
fn cuts_box(triangle: &[DVec3; 3], low: DVec3, high: DVec3) -> bool {
    let mut polygon = triangle.to_vec();
    for axis in [DVec3::X, DVec3::Y, DVec3::Z] {
        for (inwards, from) in [(axis, low.dot(axis)), (-axis, -high.dot(axis))] {
            let depth = |point: DVec3| inwards.dot(point) - from;
            let mut kept = Vec::new();
            for (k, &a) in polygon.iter().enumerate() {
                let b = polygon[(k + 1) % polygon.len()];
                let (at_a, at_b) = (depth(a), depth(b));
                if at_a >= 0.0 {
                    kept.push(a);
                }
                if at_a * at_b < 0.0 {
                    kept.push(a.lerp(b, at_a / (at_a - at_b)));
                }
            }
            polygon = kept;
        }
    }
    !polygon.is_empty()
}

/// A hopper of no surfaces, or with one in the way of the fill.
fn surface_faults(setup: &Setup, equipment: &Equipment) -> Vec<Fault> {
    let pointer = "/equipment/surfaces";
    if equipment.surfaces.is_empty() {
        let nothing = || {
            let detail = "is empty, and so nothing would hold the fillets".to_owned();
            Fault::at(
                pointer,
                json!([]),
                detail,
                "a hopper's surfaces, or /equipment/parametric true".to_owned(),
            )
        };
        return (!equipment.parametric).then(nothing).into_iter().collect();
    }
    let scene = setup.scene();
    let built_in = scene.surfaces.len() - equipment.surfaces.len();
    let mut faults: Vec<Fault> = Vec::new();
    if scene.periodic_y {
        let own = scene.surfaces[built_in..].iter().enumerate();
        faults.extend(own.filter_map(|(index, surface)| seam_fault(scene, index, surface)));
    }
    for (fillet, other) in clashes(scene) {
        let Obstacle::Surface(surface) = other else { continue };
        let Some(index) = surface.checked_sub(built_in) else { continue };
        let at = format!("{pointer}/{index}");
        if faults.iter().all(|fault| fault.pointer != at) {
            let name = &equipment.surfaces[index].name;
            let detail =
                format!("\"{name}\" is in the way of the fill: fillet {fillet} would start inside it");
            let apart = (1.0 - OVERLAP_RATIO) * scene.radius_m;
            let allowed = format!(
                "sub-particles at least {apart:.2e} m from it, where fillets are stacked over the floor"
            );
            faults.push(Fault::at(&at, json!(name), detail, allowed));
        }
    }
    faults
}
