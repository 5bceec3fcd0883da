//! The hopper's scene: walls, gate, belt and the dropped fillets.

use glam::{DQuat, DVec3};

use super::feed::fed_kinds;
use super::{GONE_BEYOND_M, floor};
use crate::engine::scene::{Placement, Scene};
use crate::equipment::{Motion, Surface, SurfaceKind};
use crate::experiments::Setup;
use crate::experiments::placement::drop_in;
use crate::experiments::surfaces::{extent, surfaces};
use crate::scenario::{Equipment, SideWalls};

/// The belt reaches this far to the sides of the hopper, in metres.
const BELT_SIDE_M: f64 = 0.2;
/// Room below the belt and around everything, in metres.
const MARGIN_M: f64 = 0.1;

/// Height that the walls are continued to so that nothing is dropped beside the hopper, in metres.
fn wall_top(scene_top: f64, equipment: &Equipment) -> f64 {
    equipment.hopper_height_m.max(scene_top + MARGIN_M)
}

/// The scene of a hopper scenario.
pub(super) fn scene(setup: &Setup, equipment: &Equipment) -> Scene {
    let (scenario, kinds) = (&setup.scenario, &setup.kinds);
    let radius = scenario.product.radius_m();
    let floor = floor(equipment);
    let radii = [radius, radius * scenario.contact.fillet_fillet_radius_ratio];
    let bodies = drop_in(kinds, scenario.product.count as usize, radii, floor, scenario.seed);
    let top = bodies
        .iter()
        .map(|body| body.position.z + kinds[body.kind].meta.bounding_radius_m)
        .fold(0.0, f64::max);
    let longest = kinds.iter().map(|kind| 2.0 * kind.meta.bounding_radius_m).fold(0.0, f64::max);
    let fed = fed_kinds(scenario, equipment, kinds);
    // Fed fillets enter at the height of the walls, which therefore go on past them.
    let fed_top = if fed.is_empty() { 0.0 } else { equipment.hopper_height_m + longest + 2.0 * radius };
    let top = wall_top(top.max(fed_top), equipment);
    let lean = top * equipment.wall_slope_deg.to_radians().tan();
    let side = if floor.periodic_y { 0.0 } else { BELT_SIDE_M };
    let belt_end = GONE_BEYOND_M + longest + MARGIN_M;
    let mut low = DVec3::new(floor.low.x - lean - MARGIN_M, floor.low.y - side, -MARGIN_M);
    let mut high = DVec3::new(belt_end + MARGIN_M, floor.high.y + side, top + MARGIN_M);
    let mut all = if equipment.parametric { built_in(equipment, top, lean, belt_end) } else { Vec::new() };
    let further = surfaces(&equipment.surfaces, &setup.meshes);
    if let Some((lowest, highest)) = extent(&further) {
        // The domain covers them. A period stays as wide as the hopper.
        let periodic = |own: DVec3, grown: DVec3| if floor.periodic_y { grown.with_y(own.y) } else { grown };
        (low, high) = (periodic(low, low.min(lowest)), periodic(high, high.max(highest)));
    }
    all.extend(further);
    let waiting = fed.len();
    let above = DVec3::new(-equipment.hopper_length_m / 2.0, 0.0, equipment.hopper_height_m);
    let enters =
        |kind| Placement { kind, position: above, orientation: DQuat::IDENTITY, velocity: DVec3::ZERO };
    let bodies = bodies.into_iter().chain(fed.into_iter().map(enters)).collect();
    Scene { surfaces: all, low, high, periodic_y: floor.periodic_y, bodies, waiting, ..setup.empty_scene() }
}

/// The equipment that the scenario's fields make: walls up to `top`, the back wall leaning out by `lean` metres at that height, the belt running to
/// `belt_end`, past where the longest fillet leaves.
fn built_in(equipment: &Equipment, top: f64, lean: f64, belt_end: f64) -> Vec<Surface> {
    let (length, width) = (equipment.hopper_length_m, equipment.hopper_width_m);
    let periodic = equipment.side_walls == SideWalls::Periodic;
    // In a periodic hopper every surface goes on beyond the period, so that no rim is felt at the seam.
    let half = width / 2.0 + if periodic { MARGIN_M } else { 0.0 };
    let across = DVec3::Y * 2.0 * half;
    let side_kind = match equipment.side_walls {
        SideWalls::Frictionless => SurfaceKind::Frictionless,
        _ => SurfaceKind::Equipment,
    };
    let plate = |name: &str, kind, corner, u, v| Surface::parallelogram(name, kind, corner, u, v);
    let at = DVec3::new;
    let belt_half = half + if periodic { 0.0 } else { BELT_SIDE_M };
    let belt_start = -length - lean;
    let up_to_top = |from: f64| {
        plate("gate", SurfaceKind::Equipment, at(0.0, -half, from), across, DVec3::Z * (top - from))
    };
    let gate = up_to_top(equipment.gate_opening_m);
    let mut surfaces = vec![
        plate(
            "belt",
            SurfaceKind::Belt,
            at(belt_start, -belt_half, 0.0),
            DVec3::X * (belt_end - belt_start),
            DVec3::Y * 2.0 * belt_half,
        )
        .moving(Motion::Belt { velocity: DVec3::X * equipment.belt_speed_m_s }),
        plate("back wall", SurfaceKind::Equipment, at(-length, -half, 0.0), across, at(-lean, 0.0, top)),
        // One wall from belt to top while filling: the fill does not depend on the opening.
        if equipment.shutter_while_filling { gate.closed_until_start(up_to_top(0.0)) } else { gate },
    ];
    if !periodic {
        for (name, y) in [("left wall", -half), ("right wall", half)] {
            let corner = at(-length - lean, y, 0.0);
            surfaces.push(plate(name, side_kind, corner, DVec3::X * (length + lean), DVec3::Z * top));
        }
    }
    surfaces
}
