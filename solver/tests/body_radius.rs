//! The larger radius of sub-particles towards other bodies: its law, its reach, and the bodies that it keeps apart.

mod common;
#[path = "common/heaps.rs"]
#[expect(dead_code, reason = "other tests use the other heaps")]
mod heaps;

use std::f64::consts::PI;

use common::{Bench, E, MASS, NU, RADIUS, assert_close, assert_same, at, block, law, scene};
use glam::DVec3;
use heaps::drop;
use roost_solver::cpu::Cpu;
use roost_solver::engine::scene::Scene;
use roost_solver::engine::state::State;
use roost_solver::mesh::Meshes;
use roost_solver::physics::contact::ContactLaw;
use roost_solver::physics::hertz;
use roost_solver::scenario;
use roost_solver::{CpuOptions, Flow, Limits, Progress, check, simulate};
use serde_json::{Value, json};

const RATIO: f64 = 1.3;

/// Two single spheres whose surfaces of radius `RATIO` R approach at a speed in m/s.
fn spheres(gap: f64, approach: f64, gamma: f64, dt: f64) -> Scene {
    let x = RATIO * RADIUS + gap / 2.0;
    let v = DVec3::X * approach / 2.0;
    let mut scene = scene(block([1, 1, 1]), vec![at(DVec3::X * -x, v), at(DVec3::X * x, -v)], dt);
    scene.laws.body_radius_ratio = RATIO as f32;
    scene.laws.tissue = law(false, 1.0, 0.0, gamma);
    scene
}

fn distance(bench: &mut Bench) -> f64 {
    (bench.position(1) - bench.position(0)).length()
}

fn paths() -> [Cpu; 2] {
    [Cpu::plain(1), Cpu::new(1)]
}

#[test]
fn contact_law_with_a_radius_ratio_is_that_of_larger_spheres() {
    let moduli = hertz::tissue_on_tissue(E, NU);
    for gamma in [0.0, 0.055] {
        let [law, larger] = [1.0, RATIO].map(|k| ContactLaw::new(moduli, k * RADIUS / 2.0, 0.3, 0.4, gamma));
        assert_eq!(law.with_radius_ratio(1.0), law);
        let scaled = law.with_radius_ratio(RATIO as f32);
        assert_close(f64::from(scaled.r_star), f64::from(larger.r_star), 1e-6);
        let (Some(scaled), Some(larger)) = (scaled.jkr, larger.jkr) else { continue };
        assert_close(f64::from(scaled.force), f64::from(larger.force), 1e-6);
        assert_close(f64::from(scaled.area), f64::from(larger.area), 1e-6);
        assert_close(f64::from(scaled.inverse_overlap), f64::from(larger.inverse_overlap), 1e-6);
        assert_close(f64::from(scaled.snap_overlap), f64::from(larger.snap_overlap), 1e-6);
    }
}

#[test]
fn collision_with_a_radius_ratio_matches_hertz_at_the_larger_radius() {
    let (v, dt, gap) = (0.5, 1e-6, 1e-4);
    let (m_star, r_star) = (MASS / 2.0, RATIO * RADIUS / 2.0);
    let e_star = 1.0 / (2.0 * (1.0 - NU * NU) / E);
    for cpu in paths() {
        let mut bench = Bench::with(cpu, &spheres(gap, v, 0.0, dt));
        let (mut in_contact, mut deepest) = (0, 0.0f64);
        while in_contact == 0 || distance(&mut bench) < 2.0 * RATIO * RADIUS + gap {
            assert_eq!(bench.steps(1), None);
            let overlap = 2.0 * RATIO * RADIUS - distance(&mut bench);
            deepest = deepest.max(overlap);
            in_contact += u64::from(overlap > 0.0);
        }
        let duration = 2.8683 * (m_star * m_star / (r_star * e_star.powi(2) * v)).powf(0.2);
        assert_close(in_contact as f64 * dt, duration, 2e-3);
        let depth = (15.0 * m_star * v * v / (16.0 * e_star * r_star.sqrt())).powf(0.4);
        assert_close(deepest, depth, 2e-3);
    }
}

#[test]
fn adhesion_at_first_contact_matches_the_larger_radius() {
    let (gamma, dt) = (0.055, 1e-7);
    for cpu in paths() {
        // The spheres overlap by a nanometre: the force is −8/3 πγR*.
        let mut bench = Bench::with(cpu, &spheres(-1e-9, 0.0, gamma, dt));
        assert_eq!(bench.steps(1), None);
        let force = bench.velocity(0).x * MASS / dt;
        assert_close(force, 8.0 / 3.0 * PI * gamma * RATIO * RADIUS / 2.0, 2e-3);
    }
}

#[test]
fn collision_with_a_radius_ratio_conserves_momentum() {
    for cpu in paths() {
        let bodies = vec![
            at(DVec3::new(-0.03, 0.004, 0.002), DVec3::X * 0.8),
            at(DVec3::new(0.03, -0.004, 0.0), DVec3::X * -0.8),
        ];
        let mut scene = scene(block([4, 4, 3]), bodies, 2e-5);
        scene.bodies[1].orientation = glam::DQuat::from_rotation_z(0.4);
        scene.laws.tissue = law(false, 0.3, 0.4, 0.055);
        scene.laws.contact_between_bonded = true;
        scene.laws.body_radius_ratio = RATIO as f32;
        let mut bench = Bench::with(cpu, &scene);
        let momenta = |bench: &mut Bench| {
            let state = bench.state();
            let of = |i: usize| {
                let p = &state.particles[i];
                let (v, w) = (p.velocity.as_dvec3(), p.spin.as_dvec3());
                (v, state.position(i).cross(v) + w * 0.4 * RADIUS * RADIUS)
            };
            (0..state.particles.len()).map(of).fold((DVec3::ZERO, DVec3::ZERO), |a, b| (a.0 + b.0, a.1 + b.1))
        };
        let ((_, spin_before), energy_before) = (momenta(&mut bench), bench.state().kinetic_energy());
        assert_eq!(bench.steps(4000), None);
        let (linear, spin) = momenta(&mut bench);
        assert!(linear.length() < 1e-6 * 96.0 * 0.8, "{linear}");
        assert!((spin - spin_before).length() < 1e-4 * spin_before.length(), "{spin_before} to {spin}");
        assert!(bench.state().kinetic_energy() < 0.8 * energy_before, "the blocks have met");
    }
}

/// Number of pairs without a bond that overlap by a tenth of R, in a scene of one body.
fn touches_itself(scene: &Scene, state: &State) -> usize {
    let bonds = &scene.kinds[0].meta.bonds;
    let count = state.particles.len();
    let pairs = (0..count).flat_map(|i| (i + 1..count).map(move |j| (i, j)));
    let overlaps = pairs.filter(|&(i, j)| state.position(i).distance(state.position(j)) < 1.9 * RADIUS);
    overlaps.filter(|&(i, j)| !bonds.iter().any(|bond| (bond.i as usize, bond.j as usize) == (i, j))).count()
}

#[test]
fn radius_ratio_leaves_contacts_within_a_body_unchanged() {
    // A fillet that folds on a plate touches itself; its radius towards others must not count.
    let mut alone = drop();
    alone.bodies.truncate(1);
    (alone.bodies[0].velocity, alone.bodies[0].position.z) = (DVec3::NEG_Z * 6.0, 0.04);
    alone.laws.bond.k_n *= 0.1;
    alone.laws.bond.k_t *= 0.1;
    for k in 0..2 {
        let run = |ratio: f32| {
            let mut scene = alone.clone();
            scene.laws.body_radius_ratio = ratio;
            let [plain, fast] = paths();
            let mut bench = Bench::with(if k == 0 { plain } else { fast }, &scene);
            let mut touches = 0;
            for _ in 0..60 {
                assert_eq!(bench.steps(10), None);
                touches += touches_itself(&scene, bench.state());
            }
            (bench.state().clone(), touches)
        };
        let ((usual, touches), (larger, _)) = (run(1.0), run(1.5));
        assert!(touches > 10, "it touches itself {touches} times");
        assert_same(&usual, &larger, "a fillet by itself");
    }
}

/// A fillet dropped onto another one that lies on a floor, at 3 m/s.
fn dropped(ratio: f64, roll_deg: f64) -> Value {
    json!({
        "experiment": "scene",
        "product": {"subparticle_radius_m": 0.008},
        "contact": {"fillet_fillet_radius_ratio": ratio},
        "scene": {
            "bodies": [
                {"position_m": [0, 0, 0.025]},
                {"shape": 2, "position_m": [0.01, 0.01, 0.12], "orientation_deg": [roll_deg, 0, 0], "velocity_m_s": [0, 0, -3]},
            ],
            "surfaces": [{"name": "floor", "plate_m": [[-0.4, -0.4, 0], [0.8, 0, 0], [0, 0.8, 0]]}],
        },
        "numerics": {"timestep_s": "auto", "duration_s": 0.8},
    })
}

#[test]
fn radius_ratio_prevents_interpenetration_of_dropped_fillets() {
    let mut merged = 0.0;
    for roll_deg in [0.0, 40.0, 90.0] {
        let inside = |ratio: f64| {
            let scenario = scenario::from_value(&dropped(ratio, roll_deg)).expect("a sound scenario");
            let checked = check(&scenario, &Meshes::default(), &Limits::NONE).expect("it can run");
            let result = simulate(&checked, CpuOptions { threads: 1 }, &mut |_: &Progress| Flow::Continue);
            let warns = result.warnings.iter().any(|warning| warning.code == "interpenetration");
            let inside = result.response("interpenetrated_fraction").expect("both are there");
            assert_eq!(warns, inside > 0.02);
            inside
        };
        merged += inside(1.0) / 3.0;
        assert_eq!(inside(1.225), 0.0, "at {roll_deg}°");
    }
    assert!(merged > 0.05, "{merged} at the radius R");
}

#[test]
fn bodies_that_start_closer_than_the_larger_radius_are_refused() {
    let at_height = |ratio: f64, gap_r: f64| {
        let mut document = dropped(ratio, 0.0);
        // The same shape, of flat layers: the lowest layer of one is over the top layer of the other.
        document["scene"]["bodies"][1] = document["scene"]["bodies"][0].clone();
        let layers = [0.025, 0.025 + 0.008 * (2.0 * 1.0 + gap_r)];
        document["scene"]["bodies"][1]["position_m"] = json!([0, 0, layers[1]]);
        let scenario = scenario::from_value(&document).expect("a sound scenario");
        check(&scenario, &Meshes::default(), &Limits::NONE).is_ok()
    };
    let closest = |ratio: f64| (0..100).map(|k| 0.1 * f64::from(k)).find(|&gap| at_height(ratio, gap));
    let (plain, larger) = (closest(1.0).expect("it fits"), closest(1.4).expect("it fits"));
    assert!((larger - plain - 0.8).abs() < 0.11, "{plain} R and {larger} R");
}
