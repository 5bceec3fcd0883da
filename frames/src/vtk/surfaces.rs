//! The equipment as triangles at their position.

use glam::DVec3;
use roost_solver::engine::scene::Scene;
use roost_solver::equipment::motion::Pose;
use roost_solver::equipment::{Motion, Surface};
use serde_json::json;

use super::file::{Cells, PolyData, scalars, vectors};
use crate::web::surface_kind_name;

/// A `.vtp` file of the surfaces at a belt time, in seconds (`None` before the start). Each triangle has the number of its surface and the
/// velocity of its material.
pub fn surfaces(scene: &Scene, belt_time_s: Option<f64>) -> Vec<u8> {
    let (mut points, mut numbers, mut velocities) = (Vec::new(), Vec::new(), Vec::new());
    for (number, surface) in (0u32..).zip(&scene.surfaces) {
        let pose = surface.motion.pose(belt_time_s);
        let pivot = match surface.motion {
            Motion::Moving { pivot, .. } => pivot,
            Motion::Fixed | Motion::Belt { .. } => DVec3::ZERO,
        };
        for triangle in surface.triangles_at(belt_time_s) {
            let corners = triangle.map(|corner| posed(&pose, pivot, corner));
            let arm = corners.iter().sum::<DVec3>() / 3.0 - (pivot + pose.shift);
            numbers.push(number);
            velocities.extend((pose.velocity + pose.spin.cross(arm)).as_vec3().to_array());
            points.extend(corners.iter().flat_map(|corner| corner.as_vec3().to_array()));
        }
    }
    let cells = Cells::Triangles((0..points.len() as u64 / 3).collect());
    let cell_data = vec![scalars("surface", numbers), vectors("velocity_m_s", velocities)];
    PolyData { points, point_data: Vec::new(), cells, cell_data }.into_file()
}

/// The position of a point of a surface: x = pivot + shift + turn · (x₀ − pivot).
fn posed(pose: &Pose, pivot: DVec3, point: DVec3) -> DVec3 {
    pivot + pose.shift + pose.turn * (point - pivot)
}

/// Names and kinds of the surfaces by number, as JSON: VTK files have no text.
pub fn legend(scene: &Scene) -> String {
    let entry = |(number, surface): (usize, &Surface)| json!({"surface": number, "name": surface.name, "kind": surface_kind_name(surface.kind)});
    let all: Vec<_> = scene.surfaces.iter().enumerate().map(entry).collect();
    format!("{:#}\n", json!(all))
}
