//! The region that the fillets of a hopper are dropped into, and the walls around it.

use glam::{DVec2, DVec3};

use super::placement::Floor;
use crate::engine::scene::Scene;
use crate::equipment::Motion;
use crate::mesh::ray::first_hit;
use crate::scenario::{Equipment, SideWalls};

/// Heights of the lines, as shares of the height of the hopper: in its lower half, where the bed lies.
const HEIGHTS: [f64; 3] = [1.0 / 12.0, 3.0 / 12.0, 5.0 / 12.0];
/// Places of lines along each side, in the middles of equal parts. Their number is even: CAD parts often meet in the middle.
const PLACES: usize = 6;
/// Distance of a wall from the middle, over that of the border, from which it is the wall of something else, such as a housing. Walls
/// that lean out may be farther away at greater heights.
const FARTHEST_AT_LOWEST: f64 = 2.0;

/// The floor of the hopper.
pub(super) fn floor(equipment: &Equipment) -> Floor {
    let half = equipment.hopper_width_m / 2.0;
    Floor {
        low: DVec2::new(-equipment.hopper_length_m, -half),
        high: DVec2::new(0.0, half),
        periodic_y: equipment.side_walls == SideWalls::Periodic,
    }
}

/// Heights of the lines that [`sides`] draws, in metres.
pub(super) fn heights_m(equipment: &Equipment) -> [f64; 3] {
    HEIGHTS.map(|share| share * equipment.hopper_height_m)
}

/// What horizontal lines from the middle of the floor meet on one side.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Side {
    /// Direction of the lines, as in `-x`.
    pub(super) direction: &'static str,
    /// Number of lines.
    pub(super) lines: usize,
    /// Lines that meet no wall nearby.
    pub(super) open: usize,
    /// Lines that meet a wall over the floor.
    pub(super) inside: usize,
    /// Greatest distance of such a wall from the border of the floor, in metres.
    pub(super) deepest_m: f64,
}

/// The sides that need a wall while the hopper fills. The gate may be open, and a periodic hopper has no side walls.
pub(super) fn sides(equipment: &Equipment, scene: &Scene) -> Vec<Side> {
    let floor = floor(equipment);
    let levels = heights_m(equipment).map(|height| (height, walls_at(scene, height)));
    let (middle, half) = ((floor.low + floor.high) / 2.0, (floor.high - floor.low) / 2.0);
    let side = |direction, way: DVec2| {
        let border = half.dot(way.abs());
        let mut side = Side { direction, lines: PLACES * HEIGHTS.len(), open: 0, inside: 0, deepest_m: 0.0 };
        for place in 0..PLACES {
            let share = (2 * place + 1) as f64 / PLACES as f64 - 1.0;
            let start = middle + share * half * way.perp();
            let met = levels.iter().enumerate().filter_map(|(level, (height, walls))| {
                let farthest = if level == 0 { FARTHEST_AT_LOWEST * border } else { f64::INFINITY };
                first_hit(walls.iter().copied(), start.extend(*height), way.extend(0.0))
                    .filter(|distance| *distance <= farthest)
            });
            let depths: Vec<f64> = met.map(|distance| border - distance).collect();
            side.open += HEIGHTS.len() - depths.len();
            // A wall that leans in, or a part in the hopper, is inside at one height only.
            let inside: Vec<f64> = depths.into_iter().filter(|depth| *depth > scene.radius_m).collect();
            if inside.len() > 1 {
                side.inside += inside.len();
                side.deepest_m = inside.into_iter().fold(side.deepest_m, f64::max);
            }
        }
        side
    };
    let mut sides = vec![side("-x", DVec2::NEG_X)];
    if !floor.periodic_y {
        sides.extend([side("-y", DVec2::NEG_Y), side("+y", DVec2::Y)]);
    }
    sides
}

/// The triangles of the walls that reach a height while the hopper fills. Of a large mesh, these are few.
fn walls_at(scene: &Scene, height: f64) -> Vec<&[DVec3; 3]> {
    let walls = scene.surfaces.iter().filter(|surface| !matches!(surface.motion, Motion::Belt { .. }));
    let reaches = |triangle: &&[DVec3; 3]| {
        triangle.iter().any(|corner| corner.z >= height) && triangle.iter().any(|corner| corner.z <= height)
    };
    walls.flat_map(|surface| surface.triangles_at(None)).filter(reaches).collect()
}
