//! The ParaView files, read back.

use std::f64::consts::FRAC_PI_2;

use glam::DVec3;
use roost_solver::engine::scene::Scene;
use roost_solver::equipment::{Motion, Surface, SurfaceKind};

use super::file::{Cells, PolyData as Written, scalars};
use super::reading::{PolyData, read};
use super::*;
use crate::testing::{bonds, disturb, hopper_with_fillets, snapshot_at};

fn points(data: &PolyData) -> Vec<DVec3> {
    data.points.chunks_exact(3).map(DVec3::from_slice).collect()
}

#[test]
fn particles_match_the_state() {
    let (_, scene, mut state) = hopper_with_fillets(3);
    disturb(&mut state);
    let all = bonds(&scene);
    // Without the first fillet: serials and indices differ.
    let first = scene.kinds[scene.bodies[0].kind].meta.points.len() as u32;
    state.remove(&(0..first).collect::<Vec<_>>());
    let held: Vec<[u32; 2]> = all.into_iter().filter(|bond| bond[0] >= first).skip(1).collect();
    let piece = read(&particles(&snapshot_at(&scene, &state, &held, 0.0, None), 4));

    let count = state.particles.len();
    assert_eq!(points(&piece).len(), count);
    for (i, x) in points(&piece).into_iter().enumerate() {
        assert!((x - state.position(i)).length() < 1e-7, "{i} {x}");
    }
    let at = |name: &str| PolyData::numbers(&piece.of_points, name);
    let of = |value: &dyn Fn(usize) -> f64| (0..count).map(value).collect::<Vec<f64>>();
    assert_eq!(at("speed_m_s"), of(&|i| state.particles[i].velocity.length().into()));
    assert_eq!(at("velocity_m_s")[3 * 7..][..3], state.particles[7].velocity.as_dvec3().to_array());
    assert_eq!(at("spin_rad_s")[3 * 7..][..3], state.particles[7].spin.as_dvec3().to_array());
    assert_eq!(at("body"), of(&|i| state.bodies[i].into()));
    assert_eq!(at("shape"), of(&|i| f64::from(4 + state.bodies[i])), "the first kind is shape 4");
    assert_eq!(at("radius_m"), of(&|_| state.radius_m.into()));
    assert_eq!(at("bonds_broken"), of(&|i| state.broken[i].into()));

    assert!(held.len() > 100, "{} bonds", held.len());
    assert_eq!(
        piece.lines,
        held.iter().map(|bond| bond.map(|serial| u64::from(serial - first))).collect::<Vec<_>>()
    );
    for (pair, stretch) in piece.lines.iter().zip(PolyData::numbers(&piece.of_cells, "stretch")) {
        let [a, b] = [pair[0], pair[1]].map(|i| state.position(i as usize));
        assert!((stretch - a.distance(b) / (2.0 * scene.radius_m)).abs() < 1e-6, "{pair:?} {stretch}");
    }
}

#[test]
fn bonds_across_the_periodic_boundary_are_left_out() {
    let (_, mut scene, _) = hopper_with_fillets(1);
    scene.periodic_y = true;
    // A period whose boundary is the middle of the fillet, below.
    let middle = scene.bodies[0].position.y;
    (scene.low.y, scene.high.y) = (middle - 0.5, middle - 0.5 + 1.0);
    let bonds = bonds(&scene);
    let drawn = |scene: &Scene| {
        let state = roost_solver::engine::state::State::new(scene);
        let piece = read(&particles(&snapshot_at(scene, &state, &bonds, 0.0, None), 0));
        let at = points(&piece);
        assert!(
            PolyData::numbers(&piece.of_cells, "stretch").iter().all(|stretch| (stretch - 1.0).abs() < 1e-4)
        );
        assert!(piece.lines.iter().all(|b| (at[b[0] as usize].y - at[b[1] as usize].y).abs() < 0.02));
        piece.lines.len()
    };
    assert_eq!(drawn(&scene), bonds.len(), "the boundary is elsewhere");
    (scene.low.y, scene.high.y) = (middle, middle + 1.0);
    let left = drawn(&scene);
    assert!(left < bonds.len() && left > bonds.len() / 2, "{left} of {}", bonds.len());
}

/// A plate that turns about its lower edge and rises, a belt, and a shutter.
fn equipment() -> Scene {
    let (_, mut scene, _) = hopper_with_fillets(1);
    let plate = |name: &str, kind, corner| Surface::parallelogram(name, kind, corner, DVec3::Y, DVec3::Z);
    let pivot = DVec3::new(1.0, 0.0, 2.0);
    let motion = Motion::Moving { velocity: DVec3::Z * 0.5, pivot, spin: DVec3::Y * FRAC_PI_2 };
    scene.surfaces = vec![
        plate("flap", SurfaceKind::Equipment, pivot).moving(motion),
        plate("belt", SurfaceKind::Belt, DVec3::ZERO).moving(Motion::Belt { velocity: DVec3::Y * 0.25 }),
        plate("shutter", SurfaceKind::Equipment, DVec3::NEG_X).until_start(),
    ];
    scene
}

#[test]
fn surfaces_are_at_their_moved_position() {
    let scene = equipment();
    let before = read(&surfaces(&scene, None));
    assert_eq!(PolyData::numbers(&before.of_cells, "surface"), [0.0, 0.0, 1.0, 1.0, 2.0, 2.0]);
    assert_eq!(before.polygons.concat(), (0..18).collect::<Vec<_>>());
    assert!(before.polygons.iter().all(|corners| corners.len() == 3) && before.lines.is_empty());
    assert!(PolyData::numbers(&before.of_cells, "velocity_m_s").iter().all(|&v| v == 0.0));
    let at = points(&before);
    assert_eq!(at[2], DVec3::new(1.0, 1.0, 3.0), "the plate's upper corner");

    // A second later: a quarter turn about y takes z to x; the shutter is gone.
    let after = read(&surfaces(&scene, Some(1.0)));
    assert_eq!(PolyData::numbers(&after.of_cells, "surface"), [0.0, 0.0, 1.0, 1.0]);
    let at = points(&after);
    assert!((at[2] - DVec3::new(2.0, 1.0, 2.5)).length() < 1e-6, "{}", at[2]);
    assert!((at[0] - DVec3::new(1.0, 0.0, 2.5)).length() < 1e-6, "the pivot only rises: {}", at[0]);
    assert_eq!(at[6..9], points(&before)[6..9], "a belt stays");
    let velocities = PolyData::numbers(&after.of_cells, "velocity_m_s");
    // The centroid of the first triangle is (0 + 0 + 1)/3 from the axis, now along x.
    let expected = [0.0, 0.0, 0.5 - FRAC_PI_2 / 3.0];
    assert!(velocities[..3].iter().zip(expected).all(|(v, e)| (v - e).abs() < 1e-6), "{velocities:?}");
    assert_eq!(velocities[6..9], [0.0, 0.25, 0.0]);
    let legend: serde_json::Value = serde_json::from_str(&legend(&scene)).expect("JSON");
    assert_eq!(legend[1], serde_json::json!({"surface": 1, "name": "belt", "kind": "belt"}));
}

#[test]
fn an_empty_scene_has_no_points() {
    let (_, mut scene, mut state) = hopper_with_fillets(1);
    state.remove(&state.serials.clone());
    scene.surfaces.clear();
    let files = [particles(&snapshot_at(&scene, &state, &[], 0.0, None), 0), surfaces(&scene, None)];
    for bytes in files {
        assert!(String::from_utf8_lossy(&bytes).contains("NumberOfPoints=\"0\""));
        assert!(points(&read(&bytes)).is_empty());
    }
}

#[test]
fn arrays_are_complete_at_block_boundaries() {
    const NUMBERS_PER_BLOCK: u32 = (1 << 15) / 4;
    for count in
        [0, 1, NUMBERS_PER_BLOCK - 1, NUMBERS_PER_BLOCK, NUMBERS_PER_BLOCK + 1, 2 * NUMBERS_PER_BLOCK]
    {
        let numbers: Vec<u32> = (0..count).map(|k| k.wrapping_mul(2_654_435_761)).collect();
        let written = Written {
            points: vec![0.5; 3 * count as usize],
            point_data: vec![scalars("hash", numbers.clone())],
            cells: Cells::Lines(Vec::new()),
            cell_data: Vec::new(),
        };
        let data = read(&written.into_file());
        assert_eq!(
            PolyData::numbers(&data.of_points, "hash"),
            numbers.iter().map(|k| f64::from(*k)).collect::<Vec<_>>()
        );
        assert_eq!(data.of_points["hash"].kind, "UInt32");
    }
}
