//! Fillets and spheres that strike surfaces fast: no centre ends on the far side, unless it went round an edge.

mod common;
#[path = "common/cut.rs"]
mod cut;
#[path = "common/stl.rs"]
mod stl;

use common::{Bench, E, MASS, NU, RADIUS, assert_close, at, plate, scene_of, sphere};
use cut::{slot, surface, tilt, tilted_plate};
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
fn no_sub_particle_passes_through_a_tilted_plate_of_many_facets() {
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
fn no_sub_particle_passes_through_a_moving_pusher() {
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

/// A sphere that moves at that velocity, without gravity, after some seconds; and how often it passed through a surface.
fn flown(
    surfaces: Vec<Surface>,
    position: DVec3,
    velocity: DVec3,
    dt: f64,
    seconds: f64,
) -> (DVec3, DVec3, u64) {
    let mut scene = sphere(surfaces, position, dt);
    scene.bodies[0].velocity = velocity;
    let mut bench = Bench::new(&scene);
    bench.cpu.start(&mut bench.run);
    let steps = (seconds / dt).round() as u64;
    let report = bench.cpu.advance(&mut [(&mut bench.run, steps)]).swap_remove(0);
    assert_eq!(report.fault, None);
    (bench.position(0), bench.velocity(0), report.passed_through)
}

#[test]
fn elastic_sphere_whose_centre_crosses_a_plate_rebounds_at_its_speed() {
    // Its energy compresses it by 2.3 R: the law of Hertz goes on beyond the plate, on either side of it.
    for side in [1.0, -1.0] {
        let plates = vec![plate(SurfaceKind::Equipment)];
        let up = DVec3::Z * side;
        let (x, v, passed) = flown(plates, up * 0.01, up * -8.0, 2e-6, 8e-3);
        assert!(x.dot(up) > RADIUS && passed == 0, "{x}");
        assert_close(v.dot(up), 8.0, 2e-3);
    }
}

#[test]
fn time_step_of_one_sphere_diameter_does_not_tunnel_through_a_plate() {
    // Up to 30 m/s and 2 R a step: from out of range on one side to out of range on the other.
    // Either the sphere falls, or the plate rises.
    let (fast, dt) = (DVec3::Z * 28.0, 2.0 * RADIUS / 28.0);
    for (share, rise) in (0..10).flat_map(|share| [(share, DVec3::ZERO), (share, fast)]) {
        let start = DVec3::Z * 0.02 + (f64::from(share) + 0.5) / 10.0 * fast * dt;
        let rising = Motion::Moving { velocity: rise, pivot: DVec3::ZERO, spin: DVec3::ZERO };
        let mut scene = sphere(vec![plate(SurfaceKind::Equipment).moving(rising)], start, dt);
        scene.bodies[0].velocity = rise - fast;
        scene.laws.equipment = common::law(true, 0.1, 0.0, 0.0);
        (scene.high, scene.speed_limit_m_s) = (DVec3::splat(4.0), 100.0);
        let mut bench = Bench::new(&scene);
        bench.cpu.start(&mut bench.run);
        assert_eq!(bench.steps(200), None);
        let height = (bench.position(0) - rise * dt * 200.0).z;
        assert!(height > 0.0, "{height} m after a start at {start}, the plate at {rise} m/s");
    }
}

#[test]
fn both_faces_of_a_thin_sheet_push_back_to_the_same_side() {
    // A closed box of 2 mm, half as thick as the sphere's radius.
    let (low, far) = (DVec3::new(-0.1, -0.1, -0.002), DVec3::new(0.1, 0.1, 0.0));
    let size = far - low;
    let sides = [
        (DVec3::X * size.x, DVec3::Y * size.y),
        (DVec3::Y * size.y, DVec3::Z * size.z),
        (DVec3::Z * size.z, DVec3::X * size.x),
    ];
    let both = |(u, v): (DVec3, DVec3)| [stl::quad(low, u, v), stl::quad(far, -u, -v)];
    let sheet = surface(sides.into_iter().flat_map(both).flatten().collect());
    for side in [1.0, -1.0] {
        for dt in [1e-5, 1e-4, 3e-4] {
            let up = DVec3::Z * side;
            let (x, v, passed) = flown(vec![sheet.clone()], up * 0.012, up * -6.0, dt, 2e-2);
            assert!(x.dot(up) > RADIUS && v.dot(up) > 0.0 && passed == 0, "{x} at {v} m/s, {dt} s");
        }
    }
    // The nearer face acts alone, by Hertz: an overlap of R and the depth beyond it, or of R less the height over it.
    let (hertz, dt) = (4.0 / 3.0 * E / (1.0 - NU * NU) * RADIUS.sqrt(), 1e-5);
    let mut scene = sphere(vec![sheet], DVec3::Z * 0.005, dt);
    scene.bodies[0].velocity = DVec3::Z * -6.0;
    let mut bench = Bench::new(&scene);
    bench.cpu.start(&mut bench.run);
    let mut lowest = 0.0f64;
    for _ in 0..300 {
        let (z, before) = (bench.position(0).z, bench.velocity(0).z);
        assert_eq!(bench.steps(1), None);
        let push = (bench.velocity(0).z - before) * MASS / dt;
        let height = if z > -0.001 { z } else { z + 0.002 };
        let expected = hertz * (RADIUS - height).max(0.0).powf(1.5);
        assert!((push - expected).abs() < 1e-3 * expected + 1e-4, "{push} N at {z} m, not {expected} N");
        lowest = lowest.min(z);
    }
    assert!(lowest < -0.003, "{lowest} m: beyond both faces");
}

#[test]
fn sphere_can_move_around_a_free_edge() {
    // Dropped beside the rim, then pushed under the plate and up against it.
    let plates = vec![plate(SurfaceKind::Equipment)];
    let (x, v, passed) =
        flown(plates.clone(), DVec3::new(0.405, 0.0, 0.01), DVec3::new(-1.5, 0.0, -8.0), 1e-5, 4e-3);
    assert!(x.z < -0.01 && v.z < 0.0 && passed == 0, "{x} at {v} m/s");
    let (x, v, passed) = flown(plates, DVec3::new(0.39, 0.0, -0.01), DVec3::Z, 1e-5, 2e-2);
    assert!(x.z < -RADIUS && passed == 0, "{x}");
    assert_close(v.z, -1.0, 1e-2);
}

#[test]
fn sphere_that_leaves_over_the_rim_behind_a_plate_has_passed_through() {
    // It crosses the plate 4 mm from its rim and is past it before the plate has pushed it back.
    let plates = vec![plate(SurfaceKind::Equipment)];
    let (x, _, passed) =
        flown(plates, DVec3::new(0.392, 0.0, 0.0041), DVec3::new(8.0, 0.0, -8.0), 1e-5, 4e-3);
    assert_eq!(passed, 1, "{x}");
    assert!(x.x > 0.4 && x.z < 0.0, "{x}");
}

#[test]
fn removed_surface_releases_a_sphere_whose_centre_has_crossed_it() {
    for triangles in [slot(0.05, false), tilted_plate()] {
        let turned = triangles.len() > 4;
        let (turn, origin) = if turned { tilt() } else { (DQuat::from_rotation_y(1.6), DVec3::ZERO) };
        let up = turn * DVec3::Z;
        let mut scene = sphere(vec![surface(triangles).until_start()], origin + up * 0.006, 1e-5);
        scene.bodies[0].velocity = up * -8.0;
        let mut bench = Bench::new(&scene);
        while (bench.position(0) - origin).dot(up) > -0.2 * RADIUS {
            assert_eq!(bench.steps(1), None);
        }
        bench.cpu.start(&mut bench.run);
        let (from, velocity) = (bench.position(0), bench.velocity(0));
        assert_eq!(bench.steps(1000), None);
        assert_eq!(bench.velocity(0), velocity);
        let off = bench.position(0) - from - velocity * 0.01;
        assert!(off.length() < 1e-5, "off by {off} m");
    }
}

#[test]
fn sphere_in_a_narrow_slot_stays_between_its_walls() {
    for (width, speed, dt) in [0.8, 1.0, 1.35, 1.7]
        .into_iter()
        .flat_map(|width| [2.0, 4.0, 6.0, 8.0].map(|speed| (width * RADIUS, speed)))
        .flat_map(|(width, speed)| [1e-5, 1e-4].map(|dt| (width, speed, dt)))
    {
        for (is_turned, side) in [(false, 1.0), (true, 1.0), (false, -1.0), (true, -1.0)] {
            let mut scene = sphere(vec![surface(slot(width, is_turned))], DVec3::X * (0.5 * width), dt);
            scene.bodies[0].velocity = DVec3::X * speed * side;
            scene.laws.equipment = common::law(true, 0.1, 0.0, 0.0);
            let mut bench = Bench::new(&scene);
            let steps = (0.05 / dt) as u64;
            let report = bench.cpu.advance(&mut [(&mut bench.run, steps)]).swap_remove(0);
            let x = bench.position(0).x;
            let what = format!("{} R, {} m/s, {dt} s, turned {is_turned}", width / RADIUS, speed * side);
            assert_eq!((report.fault, report.passed_through), (None, 0), "{what}");
            assert!((x - 0.5 * width).abs() < 1e-3 * width, "{what}: {x} of {width} m");
        }
    }
}
