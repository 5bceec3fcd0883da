//! The bounds on the time step against runs: stable below, diverging above, and `auto` good for a drop.

mod common;

use common::{Bench, G, MASS, RADIUS, at, block, kinds, law, plate, scene, with_moments};
use glam::DVec3;
use roost_solver::engine::scene::{Laws, Scene};
use roost_solver::equipment::SurfaceKind;
use roost_solver::experiments::{bounds_on_timestep, laws, timestep_s};
use roost_solver::physics::bond::BondModel;
use roost_solver::physics::timestep::stability;
use roost_solver::scenario::{self, Scenario};
use serde_json::json;

fn hopper(radius_m: f64, formulation: &str) -> Scenario {
    scenario::from_value(&json!({
        "experiment": "hopper",
        "product": {"subparticle_radius_m": radius_m},
        "bonds": {"formulation": formulation},
        "numerics": {"timestep_s": "auto"},
    }))
    .expect("a sound scenario")
}

#[test]
fn automatic_time_steps_match_the_documented_table() {
    // In microseconds, at the defaults: docs/theory/numerics.md quotes these.
    let table = [
        (0.004, [527, 667, 790]),
        (0.005, [661, 837, 990]),
        (0.006, [789, 998, 1181]),
        (0.008, [1048, 1327, 1570]),
    ];
    let found = table.map(|(radius, _)| {
        let scenario = hopper(radius, "corotated");
        let bounds = bounds_on_timestep(&scenario, &kinds(&scenario));
        assert_eq!(timestep_s(&scenario, &bounds), bounds.auto_s);
        (radius, [bounds.auto_s, bounds.damped_s, bounds.undamped_s].map(|s| (s * 1e6).round() as u32))
    });
    assert_eq!(found, table);
}

#[test]
fn damped_bound_matches_that_of_an_infinite_lattice() {
    // Worked out by lattice/limits.py from eigenvalues of one step.
    let table = include_str!("lattice/limits.csv");
    for row in table.lines().skip(1) {
        let [radius, normal, shear, restitution, limit]: [f64; 5] = std::array::from_fn(|k| {
            row.split(',').nth(k).and_then(|word| word.parse().ok()).expect("a number")
        });
        let mut scenario = hopper(radius, "corotated");
        scenario.bonds.reference_radius_m = None;
        scenario.product.density_kg_m3 = None;
        scenario.product.subparticle_density_kg_m3 = Some(2200.0);
        (scenario.bonds.normal_stiffness_n_m3, scenario.bonds.shear_stiffness_n_m3) = (normal, shear);
        scenario.contact.fillet_fillet.restitution = restitution;
        let bounds = bounds_on_timestep(&scenario, &kinds(&scenario));
        let off = bounds.damped_s / limit - 1.0;
        assert!(off.abs() < 0.01, "{row}: {} s, off by {off}", bounds.damped_s);
    }
}

#[test]
fn automatic_time_step_stays_below_the_damped_bound() {
    for (stiffness, restitution, types) in
        [(1e6, 1e-4, 2), (1e6, 1.0, 2), (1e7, 1e-4, 2), (1e8, 1.0, 2), (1e9, 1e-4, 1), (1e9, 1.0, 1)]
    {
        let mut scenario = hopper(0.006, "corotated");
        (scenario.bonds.normal_stiffness_n_m3, scenario.bonds.shear_stiffness_n_m3) = (stiffness, stiffness);
        scenario.bonds.types = types;
        scenario.contact.fillet_fillet.restitution = restitution;
        let bounds = bounds_on_timestep(&scenario, &kinds(&scenario));
        let share = bounds.auto_s / bounds.damped_s;
        // Half of it where nothing damps.
        let range = if restitution < 1.0 { 0.7..0.901 } else { 0.4..0.501 };
        assert!(range.contains(&share), "{share} of the bound at {stiffness} N/m³, e = {restitution}");
    }
}

#[test]
fn contacts_with_other_bodies_count_with_the_square_of_the_radius_ratio() {
    // Nearly without bonds, and with dashpots at their cap, the step is as 1/√k: k of one contact of the lattice, and of
    // 0.75 ρ² with other bodies. This repeats the formula; `pressed.rs` compares it with whole beds.
    let step_s = |ratio: f32| {
        let mut laws = laws::laws(&hopper(0.006, "corotated"));
        (laws.bond.k_n, laws.bond.k_t, laws.body_radius_ratio) = (1e-4, 1e-4, ratio);
        stability(MASS, 0.006, &laws, false).auto_s
    };
    for ratio in [1.2f32, 1.4] {
        let expected = (1.75 / (1.0 + 0.75 * f64::from(ratio).powi(2))).sqrt();
        let found = step_s(ratio) / step_s(1.0);
        assert!((found / expected - 1.0).abs() < 1e-4, "{found} is not {expected} at ρ = {ratio}");
    }
}

/// Whether a slightly disturbed block of bonds without contacts stays intact at this share of the undamped bound.
fn is_stable(share: f64, shear_ratio: f32, moments: f64) -> bool {
    let mut scene = scene(block([8, 8, 8]), vec![at(DVec3::ZERO, DVec3::ZERO)], 1e-5);
    scene.laws.bond.model = BondModel::Corotated;
    scene.laws.bond.k_t = shear_ratio * scene.laws.bond.k_n;
    // Contact so soft that it does not count.
    let mut soft = law(false, 1.0, 0.0, 0.0);
    (soft.e_star, soft.g_star) = (1e-6, 1e-6);
    if moments > 0.0 {
        scene = with_moments(scene, moments);
    }
    let laws = Laws { tissue: soft, contact_between_bonded: false, ..scene.laws };
    scene.timestep_s = share * stability(MASS, RADIUS, &laws, false).undamped_s;
    std::sync::Arc::make_mut(&mut scene.kinds[0].meta).points[219] += DVec3::new(1e-6, 2e-6, -1e-6);
    let mut bench = Bench::new(&scene);
    let fault = bench.steps(3000);
    fault.is_none() && bench.state().bonds_broken == 0 && bench.state().max_speed() < 0.1
}

#[test]
fn a_lattice_diverges_past_the_undamped_bound_and_not_below_it() {
    // Spinning alike is the fastest mode above k_t = k_n / 3, moving against each other below. With moments it is spinning alike
    // across an axis and against each other along it, or against each other everywhere.
    for (shear_ratio, moments) in [(0.6, 0.0), (0.1, 0.0), (0.6, 1.0), (0.6, 4.0), (0.1, 4.0)] {
        assert!(is_stable(0.98, shear_ratio, moments), "below, k_t / k_n = {shear_ratio}, moments {moments}");
        assert!(!is_stable(1.1, shear_ratio, moments), "above, k_t / k_n = {shear_ratio}, moments {moments}");
    }
}

/// Releases two bonded sub-particles just before their bond breaks. Returns their maximum kinetic energy as a share of the energy
/// that the bond has stored, and the number of broken bonds.
fn release_near_break(scenario: &Scenario, dt: f64) -> (f64, u64) {
    const STRETCH: f64 = 0.96;
    let mut pair = kinds(scenario).swap_remove(0);
    pair.meta = block([2, 1, 1]).meta;
    let laws = Laws { contact_between_bonded: false, ..laws::laws(scenario) };
    let longest = f64::from(laws.bond.break_length) - 2.0 * RADIUS;
    std::sync::Arc::make_mut(&mut pair.meta).points[1].x += STRETCH * longest;
    // ∫ k e / (1 − (e/e_max)²) de
    let stored_j = -f64::from(laws.bond.k_n) * longest * longest / 2.0 * (1.0 - STRETCH * STRETCH).ln();
    let mut bench = Bench::new(&Scene { laws, ..scene(pair, vec![at(DVec3::ZERO, DVec3::ZERO)], dt) });
    let mut peak = 0.0f64;
    for _ in 0..(0.05 / dt) as u64 {
        assert_eq!(bench.steps(1), None);
        peak = peak.max(bench.state().kinetic_energy());
    }
    (peak / stored_j, bench.state().bonds_broken)
}

#[test]
fn released_bond_near_breaking_is_stable_at_the_automatic_time_step() {
    for (s_n, ratio) in [(1e6, 1.2), (1e7, 1.2), (1e7, 1.1), (1e8, 1.2)] {
        let mut scenario = hopper(RADIUS, "finite_extension");
        (scenario.bonds.normal_stiffness_n_m3, scenario.bonds.shear_stiffness_n_m3) = (s_n, 0.6 * s_n);
        scenario.bonds.contact_radius_ratio = ratio;
        let dt = bounds_on_timestep(&scenario, &kinds(&scenario)).auto_s;
        let (share, broken) = release_near_break(&scenario, dt);
        // Leapfrog's kinetic energy swings about the true one.
        assert!(share < 1.3 && broken == 0, "{s_n} N/m³, {ratio}: {share}, {broken} broken");
        let (_, broken) = release_near_break(&scenario, 3.0 * dt);
        assert!(broken > 0, "{s_n} N/m³, {ratio}: sound at three times the step too");
    }
}

#[test]
fn high_initial_speed_shortens_the_automatic_time_step() {
    let mut document =
        json!({"experiment": "drop", "drop": {"speed_m_s": 20}, "numerics": {"timestep_s": "auto"}});
    for (speed, step) in [(20.0, Some(1.0 / 30.0 * 0.004 / 20.0)), (0.2, None)] {
        document["drop"]["speed_m_s"] = json!(speed);
        let scenario = scenario::from_value(&document).expect("a sound scenario");
        let bounds = bounds_on_timestep(&scenario, &kinds(&scenario));
        assert_eq!(timestep_s(&scenario, &bounds), step.unwrap_or(bounds.auto_s), "at {speed} m/s");
    }
    let bodies = json!([{"position_m": [0, 0, 1]}, {"position_m": [0, 0, 2], "velocity_m_s": [0, 12, -16]}]);
    let document =
        json!({"experiment": "scene", "scene": {"bodies": bodies}, "numerics": {"timestep_s": "auto"}});
    let scenario = scenario::from_value(&document).expect("a sound scenario");
    let bounds = bounds_on_timestep(&scenario, &kinds(&scenario));
    assert_eq!(timestep_s(&scenario, &bounds), 1.0 / 30.0 * 0.004 / 20.0);
}

#[test]
fn dropped_fillet_settles_unbroken_at_the_automatic_time_step() {
    for formulation in ["corotated", "as_published", "finite_extension"] {
        for radius in [0.004, 0.005, 0.006, 0.008] {
            let scenario = hopper(radius, formulation);
            let kinds = kinds(&scenario);
            let dt = bounds_on_timestep(&scenario, &kinds).auto_s;
            let mut scene = Scene {
                radius_m: radius,
                laws: laws::laws(&scenario),
                gravity: DVec3::NEG_Z * G,
                surfaces: vec![plate(SurfaceKind::Equipment)],
                kinds,
                ..scene(block([1, 1, 1]), vec![at(DVec3::Z * 0.06, DVec3::NEG_Z * 2.0)], dt)
            };
            scene.bodies[0].orientation = glam::DQuat::from_rotation_x(0.4);
            let mut bench = Bench::new(&scene);
            let mut peak = 0.0f64;
            for _ in 0..10 {
                assert_eq!(bench.steps((0.06 / dt) as u64), None, "{formulation} at {radius} m");
                peak = peak.max(bench.state().kinetic_energy());
            }
            let state = bench.state();
            assert!(
                state.kinetic_energy() < 0.02 * peak,
                "{formulation} at {radius} m does not come to rest"
            );
            assert_eq!(state.bonds_broken, 0, "{formulation} at {radius} m");
        }
    }
}
