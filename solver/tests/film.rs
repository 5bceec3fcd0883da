//! Wet surfaces: with a radius for the surface energies, a surface pulls as hard per area with sub-particles of any size.

mod common;

use std::f64::consts::PI;

use common::{Bench, assert_close, document, scene_of};
use glam::{DQuat, DVec3};
use roost_solver::engine::Backend;
use roost_solver::engine::scene::{BodyKind, Placement, Scene};
use roost_solver::equipment::{Motion, Surface, SurfaceKind};
use roost_solver::physics::contact::ContactLaw;
use roost_solver::physics::jkr;
use roost_solver::scenario::{self, Scenario};
use roost_solver::shape::from_block;
use serde_json::{Value, json};

/// Radii of sub-particles that fill [`SIDE_M`] without a rest.
const RADII_M: [f64; 4] = [0.003, 0.004, 0.006, 0.008];
/// Side of the square block, in metres.
const SIDE_M: f64 = 0.048;
/// Radius for which γ is given, in metres.
const REFERENCE_M: f64 = 0.004;
const GAMMA: f64 = 0.0728;

fn wet(radius_m: f64, reference_m: Value) -> Scenario {
    let fields = [
        ("/product", json!({"subparticle_radius_m": radius_m, "count": 1})),
        ("/contact", json!({"condition": "wet", "surface_energy_radius_m": reference_m})),
        ("/contact/fillet_fillet", json!({"restitution": 0.5})),
    ];
    scenario::from_value(&document(&fields)).expect("a sound scenario")
}

/// Maximum pull per area on a plate that leaves a block with clamped top slowly, in pascal.
fn pull_pa(radius_m: f64, reference_m: Value) -> f64 {
    let count = (SIDE_M / (2.0 * radius_m)).round() as u32;
    let meta = from_block([count, count, 2], radius_m, 1).expect("a block");
    let per_layer = count * count;
    // The points are sorted by height.
    let held = (per_layer..2 * per_layer).collect();
    let mass = 940.0 * (2.0 * radius_m).powi(3);
    let half = SIDE_M;
    let plate = Surface::parallelogram(
        "plate",
        SurfaceKind::Equipment,
        DVec3::new(-half, -half, 0.0),
        DVec3::X * 2.0 * half,
        DVec3::Y * 2.0 * half,
    );
    let speed = 2e-4;
    let down = Motion::Moving { velocity: DVec3::NEG_Z * speed, pivot: DVec3::ZERO, spin: DVec3::ZERO };
    let position = DVec3::Z * 2.0 * radius_m;
    let body = Placement { kind: 0, position, orientation: DQuat::IDENTITY, velocity: DVec3::ZERO };
    let scene = Scene {
        kinds: vec![BodyKind { meta, subparticle_mass_kg: mass }],
        bodies: vec![body],
        held,
        surfaces: vec![plate.moving(down)],
        gravity: DVec3::ZERO,
        low: DVec3::splat(-0.2),
        high: DVec3::splat(0.2),
        timestep_s: 1e-4,
        ..scene_of(&wet(radius_m, reference_m))
    };
    let mut bench = Bench::new(&scene);
    bench.cpu.start(&mut bench.run);
    let mut most: f64 = 0.0;
    for _ in 0..2000 {
        assert_eq!(bench.steps(10), None);
        most = most.max(bench.cpu.surface_forces(&mut bench.run)[0].z);
    }
    let left = bench.cpu.surface_forces(&mut bench.run)[0].z;
    assert_eq!(left, 0.0, "the plate has left the block");
    most / (SIDE_M * SIDE_M)
}

#[test]
fn pull_off_stress_of_a_wet_block_does_not_depend_on_the_sphere_radius() {
    let expected = 3.0 * PI * GAMMA / (4.0 * REFERENCE_M);
    for radius_m in RADII_M {
        let found = pull_pa(radius_m, json!(REFERENCE_M));
        println!("R = {radius_m} m: {found:.2} Pa of {expected:.2} Pa");
        assert_close(found, expected, 0.05);
    }
    // Without a radius the pull falls as 1/R.
    assert_close(pull_pa(0.008, Value::Null), 0.5 * expected, 0.05);
}

/// Maximum pull of one contact, in newton: the least force along the branch that holds.
fn pull_off_n(law: &ContactLaw) -> f64 {
    let scale = law.jkr.expect("an adhesive law");
    let overlap = |k: u32| scale.snap_overlap * (k as f32 / 1000.0);
    (0..=1000).map(|k| f64::from(-jkr::force(&scale, overlap(k)).0)).fold(0.0, f64::max)
}

#[test]
fn pull_off_force_per_area_is_independent_of_radius_for_every_contact() {
    for radius_m in RADII_M {
        let laws = scene_of(&wet(radius_m, json!(REFERENCE_M))).laws;
        let area = 4.0 * radius_m * radius_m;
        let on_surfaces = 3.0 * PI * GAMMA / (4.0 * REFERENCE_M);
        assert_close(pull_off_n(&laws.equipment) / area, on_surfaces, 1e-3);
        assert_close(pull_off_n(&laws.belt) / area, on_surfaces, 1e-3);
        // R* of two fillets is half of that on a surface.
        assert_close(pull_off_n(&laws.tissue) / area, on_surfaces / 2.0, 1e-3);
    }
}

#[test]
fn reference_radius_equal_to_the_radius_leaves_the_laws_unchanged() {
    let plain = scene_of(&wet(0.005, Value::Null)).laws;
    assert_eq!(scene_of(&wet(0.005, json!(0.005))).laws, plain);
    assert_ne!(scene_of(&wet(0.005, json!(0.004))).laws, plain);
}
