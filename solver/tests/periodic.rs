//! The periodic seam in y: contacts, lists, walls and motion across it are as anywhere else.

mod common;

use common::{
    BLINK, Bench, E, MASS, NU, RADIUS, assert_force, at, block, document, hertz, law, plate, push_in, scene,
    scene_of, sphere, weighing,
};
use glam::DVec3;
use roost_solver::equipment::{Surface, SurfaceKind};
use roost_solver::scenario;
use serde_json::json;

/// Two spheres in a domain that is periodic in y, around `y`, and their velocities after a collision.
fn meet(periodic: Option<f64>, y: f64, steps: u64) -> [DVec3; 2] {
    let wrap = |y: f64| periodic.map_or(y, |period| y - period * (y / period).round());
    let place = |x: f64, y: f64| DVec3::new(x, wrap(y), 0.01);
    let bodies = vec![
        at(place(0.0, y - 0.0042), DVec3::new(0.1, 0.5, 0.0)),
        at(place(0.001, y + 0.0042), DVec3::new(0.0, -0.5, 0.1)),
    ];
    let mut scene = scene(block([1, 1, 1]), bodies, 1e-5);
    scene.laws.tissue = law(false, 0.5, 0.3, 0.055);
    if let Some(period) = periodic {
        (scene.low.y, scene.high.y, scene.periodic_y) = (-period / 2.0, period / 2.0, true);
    }
    let mut bench = Bench::new(&scene);
    assert_eq!(bench.steps(steps), None);
    [bench.velocity(0), bench.velocity(1)]
}

#[test]
fn spheres_collide_across_the_periodic_boundary_as_elsewhere() {
    let free = meet(None, 0.0, 5000);
    assert!(free[0].y < 0.0 && free[1].y > 0.0, "they have bounced: {free:?}");
    // Periods of 5 cells, 3 cells and 2 cells of the neighbour grid.
    for period in [0.5, 0.05, 0.03, 0.021] {
        for y in [0.0, 0.1 * period, period / 2.0, period / 2.0 + 0.003, -period / 2.0 + 0.001] {
            // Long enough to bounce, too short to come round.
            let steps = if period < 0.06 { 1200 } else { 5000 };
            let (met, alone) = (meet(Some(period), y, steps), meet(None, 0.0, steps));
            for (a, b) in met.into_iter().zip(alone) {
                assert!((a - b).length() < 2e-3 * b.length(), "period {period}, at {y}: {a} against {b}");
            }
        }
    }
}

#[test]
fn forces_in_a_compressed_ring_across_the_periodic_boundary_balance() {
    // A ring of spheres, each 5 % into its neighbours, fills the period: no net force anywhere.
    let period = 8.0 * 1.9 * RADIUS;
    let place = |k: usize| DVec3::Y * ((k as f64 + 0.3) * 1.9 * RADIUS - period / 2.0);
    let bodies = (0..8).map(|k| at(place(k), DVec3::ZERO)).collect();
    let mut scene = scene(block([1, 1, 1]), bodies, BLINK);
    (scene.low.y, scene.high.y, scene.periodic_y) = (-period / 2.0, period / 2.0, true);
    let mut bench = Bench::new(&scene);
    bench.steps(1);
    let one_side = 4.0 / 3.0 * E / (2.0 * (1.0 - NU * NU)) * (RADIUS / 2.0).sqrt() * (0.1 * RADIUS).powf(1.5);
    for i in 0..8 {
        let force = bench.velocity(i) * (MASS / BLINK);
        assert!(force.length() < 1e-3 * one_side, "sphere {i}: {force} of {one_side}");
    }
}

#[test]
fn sphere_slides_across_the_periodic_boundary_as_elsewhere() {
    let end = |periodic: bool| {
        let mut scene =
            weighing(vec![plate(SurfaceKind::Equipment)], DVec3::Y * 0.04, DVec3::Y * 0.8, 0.3, 1e-5);
        if periodic {
            (scene.low.y, scene.high.y, scene.periodic_y) = (-0.05, 0.05, true);
        }
        let mut bench = Bench::new(&scene);
        assert_eq!(bench.steps(20_000), None);
        (bench.position(0), bench.velocity(0), bench.state().particles[0].spin.as_dvec3())
    };
    let (free, around) = (end(false), end(true));
    assert!(free.0.y > 0.15, "past the seam at 0.05 and the next at 0.15");
    assert!((-0.05..=0.05).contains(&around.0.y), "brought back into the period");
    assert!((free.0 - around.0 - DVec3::Y * 0.1 * ((free.0.y - around.0.y) / 0.1).round()).length() < 1e-6);
    assert!((free.1 - around.1).length() < 1e-5 && (free.2 - around.2).length() < 1e-2);
}

#[test]
fn wall_force_is_continuous_across_the_periodic_boundary() {
    // The plate goes on beyond the period by little more than a sphere: positions lie within the domain's own corners.
    let (corner, across) = (DVec3::new(-0.2, -0.06, 0.0), DVec3::Y * 0.12);
    let strip = Surface::parallelogram("strip", SurfaceKind::Equipment, corner, DVec3::X * 0.4, across);
    for k in -50..=50 {
        let position = DVec3::new(0.0, f64::from(k) * 2e-3, 0.9 * RADIUS);
        let mut scene = sphere(vec![strip.clone()], position, BLINK);
        (scene.low.y, scene.high.y, scene.periodic_y) = (-0.05, 0.05, true);
        assert_force(push_in(scene), DVec3::Z * hertz(0.1 * RADIUS), 1e-3);
    }
}

#[test]
fn surfaces_of_a_periodic_hopper_extend_beyond_the_periodic_boundary() {
    let fields = [
        ("/equipment/side_walls", json!("periodic")),
        ("/product/count", json!(2)),
        ("/product/subparticle_radius_m", json!(0.02)),
    ];
    let hopper = scene_of(&scenario::from_value(&document(&fields)).expect("a sound scenario"));
    let half = 0.59 / 2.0;
    for surface in &hopper.surfaces {
        let y = || surface.triangles.iter().flatten().map(|corner| corner.y);
        let (low, high) = (y().fold(f64::MAX, f64::min), y().fold(f64::MIN, f64::max));
        // By more than the largest radius and the skin of the neighbour lists.
        assert!(low < -half - 0.07 && high > half + 0.07, "{}: {low} to {high} m", surface.name);
    }
    assert_eq!(hopper.surfaces.len(), 3, "belt, back wall, gate");
}
