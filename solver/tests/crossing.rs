//! Fillets and spheres that strike surfaces fast: no centre ends on the far side, unless it went round an edge.

mod common;
#[path = "common/cut.rs"]
mod cut;
#[path = "common/stl.rs"]
mod stl;

use common::{Bench, at, plate, scene_of};
use cut::{surface, tilt, tilted_plate};
use glam::{DQuat, DVec3};
use roost_solver::engine::Backend;
use roost_solver::engine::scene::{Placement, Scene};
use roost_solver::equipment::{Motion, Surface, SurfaceKind};
use roost_solver::scenario::{self, Scenario};
use serde_json::json;

/// Time that an impact takes, in seconds.
const IMPACT_S: f64 = 0.06;

/// One default fillet of size 2, at the `auto` step of a scene in which it starts at `speed` m/s.
fn thrown(radius_m: f64, speed: f64) -> Scene {
    let document = json!({
        "experiment": "scene",
        "product": {"subparticle_radius_m": radius_m},
        "scene": {"bodies": [{"position_m": [0, 0, 0], "velocity_m_s": [0, 0, speed], "shape": 1}], "margin_m": 0.5},
        "numerics": {"timestep_s": "auto"},
    });
    let scenario: Scenario = scenario::from_value(&document).expect("a sound scenario");
    let mut scene = scene_of(&scenario);
    scene.gravity = DVec3::ZERO;
    scene
}

/// Height over the origin along `up` at which the lowest centre of the fillet is one radius and a bit above it.
fn height(scene: &Scene, orientation: DQuat, up: DVec3) -> f64 {
    let points = &scene.kinds[scene.bodies[0].kind].meta.points;
    let lowest = points.iter().map(|&point| (orientation * point).dot(up)).fold(f64::INFINITY, f64::min);
    1.05 * scene.radius_m - lowest
}

/// Flat, on its side and end-on.
fn orientations() -> [(&'static str, DQuat); 3] {
    let quarter = std::f64::consts::FRAC_PI_2;
    [
        ("flat", DQuat::IDENTITY),
        ("side", DQuat::from_rotation_x(quarter)),
        ("end-on", DQuat::from_rotation_y(quarter)),
    ]
}

/// Runs a scene and returns the number of centres that are behind a plate in the end: below the plane through `origin` with normal
/// `up`, which may move, and within `half_m` of the origin along both of its edges. Asserts that the solver counts none.
fn behind(scene: &Scene, seconds: f64, turn: DQuat, half_m: f64, origin: impl Fn(f64) -> DVec3) -> usize {
    let mut bench = Bench::new(scene);
    bench.cpu.start(&mut bench.run);
    let steps = (seconds / scene.timestep_s).ceil();
    let report = bench.cpu.advance(&mut [(&mut bench.run, steps as u64)]).swap_remove(0);
    assert_eq!((report.fault, report.passed_through), (None, 0));
    let origin = origin(steps * scene.timestep_s);
    let state = bench.state();
    let place = |i: usize| turn.inverse() * (state.position(i) - origin);
    let is_behind = |x: DVec3| x.z < 0.0 && x.truncate().abs().max_element() < half_m;
    (0..state.particles.len()).map(place).filter(|&x| is_behind(x)).count()
}

fn throw_at_plate(radius_m: f64, speed: f64, orientation: DQuat) -> usize {
    let mut scene = thrown(radius_m, speed);
    let position = DVec3::Z * height(&scene, orientation, DVec3::Z);
    scene.bodies[0] = Placement { orientation, ..at(position, DVec3::NEG_Z * speed) };
    scene.bodies[0].kind = 1;
    scene.surfaces = vec![plate(SurfaceKind::Equipment)];
    behind(&scene, IMPACT_S, DQuat::IDENTITY, 0.4, |_| DVec3::ZERO)
}

#[test]
fn no_sub_particle_passes_through_a_fixed_plate() {
    let mut found = Vec::new();
    for radius_m in [0.004, 0.008] {
        for speed in [4.0, 6.0, 8.0] {
            for (name, orientation) in orientations() {
                let count = throw_at_plate(radius_m, speed, orientation);
                println!("R {radius_m} m, {speed} m/s, {name}: {count} behind");
                if count > 0 {
                    found.push((radius_m, speed, name, count));
                }
            }
        }
    }
    assert!(found.is_empty(), "{found:?}");
}

#[test]
fn none_passes_through_a_tilted_plate_of_many_facets() {
    let (turn, away) = tilt();
    let up = turn * DVec3::Z;
    let mut found = Vec::new();
    for radius_m in [0.004, 0.008] {
        for (name, orientation) in orientations() {
            let mut scene = thrown(radius_m, 8.0);
            let orientation = turn * orientation;
            let position = away + up * height(&scene, orientation, up);
            scene.bodies[0] = Placement { orientation, ..at(position, up * -8.0) };
            scene.bodies[0].kind = 1;
            scene.surfaces = vec![surface(tilted_plate())];
            let count = behind(&scene, 0.03, turn, 0.1, |_| away);
            println!("R {radius_m} m, tilted, {name}: {count} behind");
            if count > 0 {
                found.push((radius_m, name, count));
            }
        }
    }
    assert!(found.is_empty(), "{found:?}");
}

#[test]
fn none_passes_through_a_pusher() {
    let mut found = Vec::new();
    let velocity = DVec3::X * 6.0;
    for radius_m in [0.004, 0.008] {
        for (name, orientation) in orientations() {
            // The fillet rests; `auto` knows nothing of the pusher.
            let mut scene = thrown(radius_m, 0.0);
            let position = DVec3::X * height(&scene, orientation, DVec3::X);
            scene.bodies[0] = Placement { orientation, ..at(position, DVec3::ZERO) };
            scene.bodies[0].kind = 1;
            let corner = DVec3::new(0.0, -0.4, -0.4);
            let pusher = Surface::parallelogram(
                "pusher",
                SurfaceKind::Equipment,
                corner,
                DVec3::Y * 0.8,
                DVec3::Z * 0.8,
            );
            let motion = Motion::Moving { velocity, pivot: DVec3::ZERO, spin: DVec3::ZERO };
            scene.surfaces = vec![pusher.moving(motion)];
            let count = behind(&scene, 0.03, DQuat::from_rotation_y(std::f64::consts::FRAC_PI_2), 0.4, |t| {
                velocity * t
            });
            println!("R {radius_m} m, pusher, {name}: {count} behind");
            if count > 0 {
                found.push((radius_m, name, count));
            }
        }
    }
    assert!(found.is_empty(), "{found:?}");
}
