//! Memories of sides of facets on the GPU are bit-equal to the plain path.

mod common;
#[path = "common/cut.rs"]
mod cut;
#[path = "common/parity.rs"]
mod parity;
#[path = "common/stl.rs"]
mod stl;

use common::{RADIUS, at, block, law, onto, plate, scene};
use cut::{slot, surface, tilt, tilted_plate};
use glam::DVec3;
use parity::{Both, difference, gpu};
use roost_solver::engine::Backend;
use roost_solver::engine::scene::Scene;
use roost_solver::engine::state::State;
use roost_solver::equipment::{Motion, SurfaceKind};
use roost_solver::gpu::Gpu;
use roost_solver::gpu::source::Source;
use stl::quad;

/// Blocks and spheres that strike a plate at 8 m/s, a tilted plate of many facets, and a pusher; each with a point of the
/// surface and its normal.
fn strikes() -> [(Scene, DVec3, DVec3); 3] {
    let (turn, away) = tilt();
    let pushing = Motion::Moving { velocity: DVec3::Z * 6.0, pivot: DVec3::ZERO, spin: DVec3::X };
    let scenes = [
        (onto(plate(SurfaceKind::Equipment), |x| x), DVec3::ZERO, DVec3::Z, 8.0),
        (onto(surface(tilted_plate()), |x| turn * x + away), away, turn * DVec3::Z, 8.0),
        (onto(plate(SurfaceKind::Equipment).moving(pushing), |x| x), DVec3::ZERO, DVec3::Z, 2.0),
    ];
    scenes.map(|(mut scene, at, up, speed)| {
        scene.timestep_s = 3e-4;
        scene.bodies.iter_mut().for_each(|body| body.velocity = up * -speed);
        (scene, at, up)
    })
}

#[test]
fn gpu_matches_plain_path_for_fast_impacts_on_surfaces() {
    let Some(gpu) = gpu() else { return };
    let mut total = 0;
    for (scene, at, up) in strikes() {
        let mut both = Both::new(&gpu, &scene);
        both.plain.start(&mut both.plain_run);
        both.gpu.start(&mut both.gpu_run);
        let mut beyond = 0;
        for _ in 0..20 {
            both.assert_equal_for(4, 2);
            let state = gpu.state(&mut both.gpu_run);
            let below = |i: &usize| (state.position(*i) - at).dot(up) < 0.0;
            beyond = beyond.max((0..state.particles.len()).filter(below).count());
        }
        total += beyond;
    }
    assert!(total > 10, "{total} centres beyond the plates at a time");
}

#[test]
fn planted_errors_in_side_tracking_are_detected() {
    let Some(device) = parity::device() else { return };
    let ([_, (tilted, ..), _], slot) = (strikes(), in_a_slot(0.8 * RADIUS));
    let planted = [
        (&tilted, "forces", "let distance = signed_distance(point);", "let distance = point.distance;"),
        (&tilted, "side", "return origin | BEYOND;", "return origin;"),
        (&tilted, "side", "if continues(scene, nearest_points[k], nearest_points[at]) {", "if false {"),
        (&slot, "side", "height < max(", "0.0 * height < max("),
        (&into_a_box(), "side", "return side != 0u && side != origin;", "return false;"),
    ];
    for (scene, file, text, error) in planted {
        let source = Source::kernels().with(file, text, error);
        let gpu = Gpu::with(device.clone(), &source).expect("kernels that compile");
        let mut both = Both::new(&gpu, scene);
        both.plain.start(&mut both.plain_run);
        both.gpu.start(&mut both.gpu_run);
        let stays = (0..8).all(|_| {
            both.advance(50);
            difference(both.plain.state(&mut both.plain_run), gpu.state(&mut both.gpu_run)).is_none()
        });
        assert!(!stays, "{file}: `{error}` was not found");
    }
}

/// Spheres in a slot of that width, thrown at one of its sheets at different speeds.
fn in_a_slot(width: f64) -> Scene {
    let body = |k: i32| {
        let y = 0.01 * f64::from(k) - 0.04;
        at(DVec3::new(0.5 * width, y, 0.0), DVec3::new(2.0 + f64::from(k), 0.3, -0.2))
    };
    let mut scene = scene(block([1, 1, 1]), (0..8).map(body).collect(), 2e-5);
    scene.surfaces = vec![surface(slot(width, true))];
    scene.laws.equipment = law(true, 0.3, 0.3, 0.0);
    scene
}

/// Spheres close above a closed box, so fast that they come out of its middle after one step.
fn into_a_box() -> Scene {
    let body = |k: i32| {
        let place = DVec3::new(0.01 * f64::from(k) - 0.04, 0.0, 0.001);
        at(place, DVec3::NEG_Z * (8.0 + f64::from(k)))
    };
    let mut scene = scene(block([1, 1, 1]), (0..8).map(body).collect(), 7e-4);
    let (x, y, z) = (DVec3::X * 0.2, DVec3::Y * 0.2, DVec3::Z * 3.5 * RADIUS);
    let low = DVec3::new(-0.1, -0.1, -3.5 * RADIUS);
    let faces = [(low, x, y), (low + z, x, y), (low, x, z), (low + y, x, z), (low, y, z), (low + x, y, z)];
    scene.surfaces = vec![surface(faces.iter().flat_map(|&(corner, u, v)| quad(corner, u, v)).collect())];
    scene
}

#[test]
fn gpu_matches_plain_path_for_spheres_that_enter_a_box_in_one_step() {
    let Some(gpu) = gpu() else { return };
    Both::new(&gpu, &into_a_box()).assert_equal_for(12, 1);
}

#[test]
fn gpu_matches_plain_path_for_spheres_in_a_narrow_slot() {
    let Some(gpu) = gpu() else { return };
    for width in [0.8, 1.0, 1.35, 1.7].map(|width| width * RADIUS) {
        let mut both = Both::new(&gpu, &in_a_slot(width));
        both.assert_equal_for(1500, 50);
        let state = gpu.state(&mut both.gpu_run);
        assert!((0..8).all(|i| (state.position(i).x / width - 0.5).abs() < 0.5));
    }
}

#[test]
fn gpu_matches_plain_path_for_surfaces_that_disappear() {
    let Some(gpu) = gpu() else { return };
    for (mut scene, at, up) in strikes() {
        scene.surfaces = scene.surfaces.into_iter().map(|surface| surface.until_start()).collect();
        // In short steps, so that lists hold the facets beyond the start.
        scene.timestep_s = 2e-5;
        scene.bodies.iter_mut().for_each(|body| body.velocity = up * -8.0);
        let mut both = Both::new(&gpu, &scene);
        let below = |state: &State, i: &usize| (state.position(*i) - at).dot(up) < 0.0;
        let beyond = |state: &State| (0..state.particles.len()).filter(|i| below(state, i)).count();
        while beyond(gpu.state(&mut both.gpu_run)) < 3 {
            both.assert_equal_for(8, 8);
        }
        both.plain.start(&mut both.plain_run);
        both.gpu.start(&mut both.gpu_run);
        both.assert_equal_for(100, 10);
    }
}
