//! From the surfaces of a scenario to the equipment of a scene: triangles, motion and material.

use glam::DVec3;

use super::placement::orientation;
use crate::equipment::{Motion, Presence, Surface, SurfaceKind};
use crate::mesh::Meshes;
use crate::scenario::{MeshRef, MotionKind, PresenceKind, Scenario, SurfaceMaterial, SurfaceSpec};

/// The surfaces of a list, in its order. Their meshes must be among `meshes`, as [`crate::check()`] makes sure.
pub fn surfaces(specs: &[SurfaceSpec], meshes: &Meshes) -> Vec<Surface> {
    specs.iter().map(|spec| surface(spec, meshes)).collect()
}

fn surface(spec: &SurfaceSpec, meshes: &Meshes) -> Surface {
    let (position, turn) = (DVec3::from(spec.position_m), orientation(spec.orientation_deg));
    let place = |corner: DVec3| position + turn * corner;
    let triangles: Vec<[DVec3; 3]> =
        own_triangles(spec, meshes).into_iter().map(|triangle| triangle.map(place)).collect();
    Surface {
        name: spec.name.clone(),
        kind: match spec.kind {
            SurfaceMaterial::Equipment => SurfaceKind::Equipment,
            SurfaceMaterial::Belt => SurfaceKind::Belt,
            SurfaceMaterial::Frictionless => SurfaceKind::Frictionless,
        },
        friction: spec.static_friction,
        motion: motion(spec, &triangles),
        closed: None,
        presence: match spec.presence {
            PresenceKind::Always => Presence::Always,
            PresenceKind::UntilStart => Presence::UntilStart,
        },
        triangles,
    }
}

/// Its triangles about their own origin, in metres.
fn own_triangles(spec: &SurfaceSpec, meshes: &Meshes) -> Vec<[DVec3; 3]> {
    if let Some(plate) = spec.plate_m {
        let [corner, u, v] = plate.map(DVec3::from);
        return Surface::parallelogram(&spec.name, SurfaceKind::Equipment, corner, u, v).triangles;
    }
    let mesh = spec.mesh.as_ref().and_then(|mesh| meshes.get(&mesh.digest)?.in_units(mesh.units).ok());
    mesh.map_or(Vec::new(), |mesh| mesh.triangles.to_vec())
}

fn motion(spec: &SurfaceSpec, triangles: &[[DVec3; 3]]) -> Motion {
    let velocity = DVec3::from(spec.velocity_m_s);
    let spin = DVec3::from(spec.spin_deg_s.map(f64::to_radians));
    match spec.motion {
        MotionKind::Fixed => Motion::Fixed,
        MotionKind::Belt => Motion::Belt { velocity },
        MotionKind::Moving if spin == DVec3::ZERO => {
            // Where nothing turns, the pivot means nothing; one in its midst keeps more digits.
            let corners = || triangles.iter().flatten();
            let pivot = corners().sum::<DVec3>() / corners().count().max(1) as f64;
            Motion::Moving { velocity, pivot, spin }
        }
        MotionKind::Moving => Motion::Moving { velocity, pivot: spec.pivot_m.into(), spin },
    }
}

/// The box around all corners and all pivots of turning surfaces; none without surfaces.
pub fn extent(surfaces: &[Surface]) -> Option<(DVec3, DVec3)> {
    let points = surfaces.iter().flat_map(|surface| {
        let pivot = match surface.motion {
            Motion::Moving { pivot, .. } => Some(pivot),
            _ => None,
        };
        surface.triangles.iter().flatten().copied().chain(pivot)
    });
    points.map(|point| (point, point)).reduce(|(low, high), (a, b)| (low.min(a), high.max(b)))
}

/// The box around the first surface that names a mesh, after its orientation and position: its lowest and highest corner in metres. None without such
/// a surface.
pub fn placed_box(scenario: &Scenario, named: &MeshRef, meshes: &Meshes) -> Option<(DVec3, DVec3)> {
    let (_, specs) = scenario.experiment.section().surfaces();
    let spec = specs.iter().find(|spec| spec.mesh.as_ref() == Some(named))?;
    // A surface that turns need not contain its pivot.
    extent(&[Surface { motion: Motion::Fixed, ..surface(spec, meshes) }])
}
