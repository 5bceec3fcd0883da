//! Momentum, energy and slow motion: what the engine must not lose.

mod common;

use common::{Bench, MASS, RADIUS, assert_close, at, block, bonds, law, scene};
use glam::DVec3;
use roost_solver::cpu::Cpu;
use roost_solver::engine::scene::Scene;
use roost_solver::scenario;
use serde_json::json;

/// Linear and angular momentum about the origin.
fn momenta(bench: &mut Bench) -> (DVec3, DVec3) {
    let inertia = 0.4 * RADIUS * RADIUS;
    let state = bench.state();
    let of = |i: usize| {
        let p = &state.particles[i];
        let (v, w) = (p.velocity.as_dvec3(), p.spin.as_dvec3());
        (v * MASS, (state.position(i).cross(v) + w * inertia) * MASS)
    };
    (0..state.particles.len()).map(of).fold((DVec3::ZERO, DVec3::ZERO), |a, b| (a.0 + b.0, a.1 + b.1))
}

/// Two blocks that meet off-centre, with everything on: adhesion, damping, friction, bonds, contact in bonds.
fn collision(dt: f64) -> Scene {
    let bodies = vec![
        at(DVec3::new(-0.03, 0.004, 0.002), DVec3::X * 0.8),
        at(DVec3::new(0.03, -0.004, 0.0), DVec3::X * -0.8),
    ];
    let mut scene = scene(block([4, 4, 3]), bodies, dt);
    scene.bodies[1].orientation = glam::DQuat::from_rotation_z(0.4);
    scene.laws.tissue = law(false, 0.3, 0.4, 0.055);
    scene.laws.contact_between_bonded = true;
    scene
}

#[test]
fn collision_conserves_linear_and_angular_momentum() {
    let mut bench = Bench::new(&collision(2e-5));
    let (_, spin_before) = momenta(&mut bench);
    let energy_before = bench.state().kinetic_energy();
    assert_eq!(bench.steps(5000), None);
    let (linear, spin) = momenta(&mut bench);
    let scale = 96.0 * MASS * 0.8;
    assert!(linear.length() < 1e-6 * scale, "{linear} of {scale:e} kg m/s");
    // The lever of a contact is taken at the middle of the centres, so that this holds but for rounding.
    assert!((spin - spin_before).length() < 1e-4 * spin_before.length(), "{spin_before} to {spin}");
    assert!(bench.state().kinetic_energy() < 0.8 * energy_before, "the blocks have met");
    assert!(bench.state().max_speed() > 0.01, "and still move");
}

#[test]
fn energy_is_lost_to_damping_and_never_gained() {
    let mut bench = Bench::new(&collision(2e-5));
    // Means over 0.05 s, much longer than a bond rings, so that energy kept in bonds for a while averages out.
    let mut mean = || {
        let looks = (0..50).map(|_| {
            bench.steps(50);
            bench.state().kinetic_energy()
        });
        looks.sum::<f64>() / 50.0
    };
    let means: Vec<f64> = (0..8).map(|_| mean()).collect();
    assert!(means[7] < 0.7 * means[0], "{means:?}");
    assert!(means.windows(2).all(|pair| pair[1] < 1.02 * pair[0]), "{means:?}");
}

#[test]
fn a_bonded_body_in_free_flight_keeps_its_energy() {
    // A twanged beam without damping: what leaves the bonds as motion comes back. The energy of its bonds is
    // worked out here from positions alone: corotated shear energy is a small part at this amplitude.
    let mut kind = block([6, 1, 1]);
    let points = &mut std::sync::Arc::make_mut(&mut kind.meta).points;
    points.iter_mut().for_each(|p| p.x *= 1.01);
    let mut bench = Bench::new(&scene(kind, vec![at(DVec3::ZERO, DVec3::ZERO)], 5e-6));
    let k_n = f64::from(bonds().k_n);
    let total = |bench: &mut Bench| {
        let stretch = |i: usize| (bench.position(i + 1) - bench.position(i)).length() - 2.0 * RADIUS;
        let energies: Vec<f64> = (0..5).map(stretch).map(|e| 0.5 * k_n * e * e).collect();
        energies.iter().sum::<f64>() + bench.state().kinetic_energy()
    };
    let start = total(&mut bench);
    let mut kinetic_share = 0.0f64;
    for _ in 0..400 {
        bench.steps(100);
        // Kinetic energy is half a step behind the positions: an error of order ω dt.
        assert_close(total(&mut bench), start, 1e-2);
        kinetic_share = kinetic_share.max(bench.state().kinetic_energy() / start);
    }
    assert!(kinetic_share > 0.5, "the energy does change hands");
}

#[test]
fn an_undamped_fillet_keeps_its_energy_at_the_automatic_step() {
    // It hits a plate askew and flies on, trembling. Means over 1.5 s stand for the energy: motion and bonds share it.
    let undamped = json!({"restitution": 1.0, "static_friction": 0.0, "surface_energy_j_m2": 0.0});
    let document = json!({
        "experiment": "scene",
        "product": {"subparticle_radius_m": 0.006},
        "contact": {"fillet_fillet": undamped, "fillet_equipment": undamped, "fillet_belt": undamped},
        "scene": {
            "bodies": [{"position_m": [0, 0, 0.12], "velocity_m_s": [0, 0, -1], "orientation_deg": [0, 20, 10]}],
            "surfaces": [{"name": "floor", "plate_m": [[-1, -1, 0], [2, 0, 0], [0, 2, 0]]}],
            "margin_m": 10.0,
        },
        "numerics": {"timestep_s": "auto", "duration_s": 8.0, "gravity_m_s2": 0.0},
    });
    let scene = common::scene_of(&scenario::from_value(&document).expect("a sound scenario"));
    for cpu in [Cpu::plain(1), Cpu::new(1)] {
        let mut bench = Bench::with(cpu, &scene);
        let mut means = [0.0; 5];
        for mean in &mut means {
            for _ in 0..400 {
                assert_eq!(bench.steps((0.004 / scene.timestep_s) as u64), None);
                *mean += bench.state().kinetic_energy() / 400.0;
            }
        }
        // The first mean holds the impact.
        assert!((means[4] / means[1] - 1.0).abs() < 0.01, "{means:?}");
    }
}

#[test]
fn slow_motion_far_from_the_origin_is_not_lost_to_rounding() {
    // At 1 µm/s a step of 57.5 µs is a hundredth of a unit: only the remainder can carry it.
    for speed in [1e-6, 1e-3] {
        let start = DVec3::new(0.4, -0.45, 0.3);
        let v = DVec3::new(speed, speed * 0.5, -speed);
        let mut bench = Bench::new(&scene(block([1, 1, 1]), vec![at(start, v)], 5.75e-5));
        let placed = bench.position(0);
        bench.steps(100_000);
        let went = bench.position(0) - placed;
        let unit = f64::from(bench.state().frame.unit_m);
        assert!((went - v * 5.75).abs().max_element() < 1e-5 * speed * 5.75 + unit, "{went} at {speed} m/s");
    }
}
