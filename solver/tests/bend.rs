//! Fillets that bend: a clamped beam against its closed form, what a bar and a ledge do to a fillet, and what is refused.

#[path = "common/stl.rs"]
mod stl;

mod common;

use common::{RADIUS, assert_close, assert_force, hertz, push, response};
use glam::DVec3;
use roost_solver::equipment::{Surface, SurfaceKind};
use roost_solver::mesh::Meshes;
use roost_solver::result::{EndReason, RunResult};
use roost_solver::scenario::Scenario;
use roost_solver::{CpuOptions, Flow, Limits, Progress, check, simulate};
use serde_json::{Value, json};

/// At a radius of 8 mm size 2 is two layers thick all over, and none of it a single layer that folds at no cost.
fn scenario(support: &str, fields: &[(&str, Value)]) -> Scenario {
    let document = json!({
        "experiment": "bend",
        "product": {"subparticle_radius_m": 0.008},
        "bend": {"support": support},
        "numerics": {"timestep_s": "auto"},
    });
    common::scenario(document, fields)
}

fn run_on(threads: usize, support: &str, fields: &[(&str, Value)]) -> RunResult {
    common::run_on(threads, &scenario(support, fields))
}

fn run(support: &str, fields: &[(&str, Value)]) -> RunResult {
    run_on(1, support, fields)
}

/// Both stiffnesses of the bonds, as multiples of Table 2.
fn stiffness(times: f64) -> [(&'static str, Value); 2] {
    [
        ("/bonds/normal_stiffness_n_m3", json!(1e6 * times)),
        ("/bonds/shear_stiffness_n_m3", json!(6e5 * times)),
    ]
}

/// How far the tip of a cantilever of two rows hangs, in metres: `free` layers of sub-particles of weight `weight_n` beyond the
/// last that is held.
///
/// The bond from layer i to the next bears the shear S_i of all weight beyond it. The spheres of layer i are turned by R (S_{i−1} +
/// S_i), and without moments in bonds it is the one bond between the rows that holds against it, by a shear r_i = S_{i−1} + S_i. That
/// pulls the upper row and pushes the lower one: the row's own bonds bear T_i = Σ_{j>i} r_j. So the rows stretch by u, the
/// spheres turn by θ, and each layer hangs lower than the one before:
///
/// k_n (u_{i+1} − u_i) = T_i,   k_t (2R θ_i − 2 u_i) = r_i,   k_t (w_{i+1} − w_i − R (θ_i + θ_{i+1})) = S_i.
fn ladder(free: usize, weight_n: f64, k_n: f64, k_t: f64) -> f64 {
    let shear = |i: usize| weight_n * (free - i) as f64;
    let rung = |i: usize| shear(i - 1) + shear(i);
    let (mut u, mut turn, mut w) = (0.0, 0.0, 0.0);
    for i in 0..free {
        u += (i + 1..=free).map(rung).sum::<f64>() / k_n;
        let next = (rung(i + 1) / k_t + 2.0 * u) / (2.0 * RADIUS);
        w += shear(i) / k_t + RADIUS * (turn + next);
        turn = next;
    }
    w
}

#[test]
fn clamped_beam_deflects_as_its_bond_stiffness_predicts() {
    // With the second shear stiffness it is half bending and half shear.
    let (s_n, s_t) = (4e8, 2.4e8);
    let size = DVec3::new(12.0, 2.0, 2.0) * 2.0 * RADIUS;
    let mut meshes = Meshes::default();
    let digest = meshes.insert(&stl::binary(&stl::cuboid(DVec3::ZERO, size, 1))).expect("a sound file");
    for s_t in [s_t, s_t / 20.0] {
        let scenario = scenario(
            "clamped",
            &[
                ("/product/subparticle_radius_m", json!(RADIUS)),
                ("/product/mesh", json!({"digest": digest, "units": "m"})),
                ("/product/shape", Value::Null),
                ("/bonds/normal_stiffness_n_m3", json!(s_n)),
                ("/bonds/shear_stiffness_n_m3", json!(s_t)),
                ("/bonds/contact_between_bonded", json!(false)),
                ("/contact/fillet_equipment", json!({"surface_energy_j_m2": 0.0})),
                ("/numerics/output_interval_s", json!(5e-4)),
                ("/numerics/duration_s", json!(0.6)),
                ("/numerics/stop", json!({"when_done": false})),
            ],
        );
        let options = CpuOptions { threads: 1 };
        let checked = check(&scenario, &meshes, &Limits::NONE).expect("can run");
        let result = simulate(&checked, options, &mut |_: &Progress| Flow::Continue);
        assert_eq!(result.end_reason, EndReason::Duration);
        // It swings about where it would hang, undamped: the mean over many swings, faded in and out.
        let tip = result.series("tip_deflection").expect("there");
        let (from, to) = (0.1, 0.6);
        let weight = |t: f64| (std::f64::consts::PI * (t - from) / (to - from)).sin().powi(2);
        let samples = || tip.t_s.iter().zip(&tip.values).filter(|(t, _)| **t > from);
        let mean = samples().map(|(t, w)| weight(*t) * w).sum::<f64>()
            / samples().map(|(t, _)| weight(*t)).sum::<f64>();
        let area = std::f64::consts::PI * RADIUS * RADIUS;
        let weight_n = 940.0 * (2.0 * RADIUS).powi(3) * 9.81;
        let hangs = ladder(9, weight_n, s_n * area, s_t * area);
        assert_close(mean, hangs, 5e-3);
    }
}

#[test]
fn contact_force_of_a_cylinder_is_radial() {
    let bar = Surface::cylinder("bar", SurfaceKind::Equipment, DVec3::ZERO, DVec3::Y * 0.1, 0.02, 256);
    assert_eq!(bar.triangles.len(), 512);
    let deep = 2e-4;
    for k in 0..16 {
        let angle = 0.1 + f64::from(k);
        let out = DVec3::new(angle.sin(), 0.0, angle.cos());
        // A side's middle lies 1.5 µm within the cylinder.
        assert_force(push(std::slice::from_ref(&bar), out * (0.02 + RADIUS - deep)), out * hertz(deep), 2e-2);
    }
}

#[test]
fn over_a_bar_stiffer_fillets_bend_less() {
    let mut last = 180.0;
    for times in [1.0, 8.0, 64.0] {
        let result = run("over_bar", &stiffness(times));
        assert_eq!(result.responses["fell_off"], false);
        assert_eq!(response(&result, "bonds_intact_fraction"), 1.0);
        let angle = response(&result, "bend_angle_deg");
        assert!(angle < 0.9 * last, "{angle} after {last}");
        assert!(response(&result, "largest_bend_angle_deg") >= angle);
        assert!(result.responses["tip_deflection_m"].is_null());
        // Mean and half range since it rests, or over the last second.
        let series = result.series("bend_angle").expect("there");
        let end = *series.t_s.last().expect("sampled");
        let from = result.response("time_to_rest_s").unwrap_or(end - 1.0);
        let last_of: Vec<f64> = series
            .t_s
            .iter()
            .zip(&series.values)
            .filter(|(t, _)| **t >= from)
            .map(|(_, angle)| *angle)
            .collect();
        let (low, high) =
            last_of.iter().fold((f64::MAX, f64::MIN), |(low, high), a| (low.min(*a), high.max(*a)));
        assert_close(angle, last_of.iter().sum::<f64>() / last_of.len() as f64, 1e-9);
        assert_close(response(&result, "bend_swing_deg"), (high - low) / 2.0, 1e-9);
        last = angle;
    }
}

#[test]
fn fillet_bends_and_falls_off_a_ledge() {
    let result = run("off_ledge", &[]);
    assert_eq!(result.end_reason, EndReason::Done);
    assert_eq!(result.responses["fell_off"], true);
    let angle = response(&result, "bend_angle_deg");
    assert!((40.0..180.0).contains(&angle), "{angle}");
    assert_eq!(response(&result, "largest_bend_angle_deg"), angle);
    assert!(result.responses["time_to_rest_s"].is_null());
    // It lay still until the conveyor started, and was carried at its speed until it had fallen off.
    let bend = result.series("bend_angle").expect("there");
    let energy = result.series("kinetic_energy").expect("there");
    assert!(bend.t_s[0] == 0.0 && energy.t_s[0] < -0.1, "{:?}", energy.t_s);
    let carried = energy.t_s.iter().zip(&energy.values).find(|(t, _)| **t > 0.15).expect("samples").1;
    let estimate =
        check(&result.scenario, &Meshes::default(), &Limits::default()).expect("it ran").into_estimate();
    assert_close(*carried, 0.5 * estimate.mass_kg * 0.25 * 0.25, 0.1);
    let slower = run("off_ledge", &[("/bend/belt_speed_m_s", json!(0.125))]);
    let left = |result: &RunResult| *result.series("bend_angle").expect("there").t_s.last().expect("samples");
    assert!(left(&slower) > 1.5 * left(&result), "{} after {}", left(&slower), left(&result));
}

#[test]
fn stationary_conveyor_leaves_the_fillet_on_the_ledge() {
    let result = run("off_ledge", &[("/bend/belt_speed_m_s", json!(0.0))]);
    assert_eq!(result.end_reason, EndReason::Done);
    assert_eq!(result.responses["fell_off"], false);
    assert_eq!(response(&result, "time_to_rest_s"), 0.0);
}

#[test]
fn a_longer_free_end_hangs_lower() {
    let hangs = |share: f64| {
        let stiff = stiffness(8.0);
        let fields = [("/bend/clamped_share", json!(share)), stiff[0].clone(), stiff[1].clone()];
        response(&run("clamped", &fields), "tip_deflection_m")
    };
    let (long, short) = (hangs(0.2), hangs(0.5));
    assert!(long > 2.0 * short && short > 0.0, "{long} and {short}");
}

#[test]
fn bend_angle_of_a_torn_fillet_is_recorded_until_it_tears() {
    // Bonds that break when stretched by a tenth.
    let result = run("clamped", &[("/bonds/contact_radius_ratio", json!(1.1))]);
    assert_eq!(result.end_reason, EndReason::Done);
    assert_eq!((&result.responses["torn"], &result.responses["fell_off"]), (&json!(true), &json!(false)));
    assert!(response(&result, "bonds_intact_fraction") < 1.0);
    assert!(response(&result, "tip_deflection_m") < 0.172, "{:?}", result.responses);
    let (last, end) =
        (result.series("bend_angle").expect("there"), result.series("kinetic_energy").expect("there"));
    assert!(last.t_s.last() < end.t_s.last());
}

#[test]
fn clamp_that_holds_none_or_all_of_a_fillet_is_refused() {
    for (share, held) in [(0.01, "none"), (0.99, "all")] {
        let scenario = scenario("clamped", &[("/bend/clamped_share", json!(share))]);
        let faults = check(&scenario, &Meshes::default(), &Limits::default()).expect_err("refused");
        assert_eq!(faults.len(), 1, "{faults:?}");
        assert_eq!(faults[0].pointer, "/bend/clamped_share");
        assert!(faults[0].detail.starts_with(held), "{faults:?}");
    }
    let other = scenario("over_bar", &[("/bend/clamped_share", json!(0.01))]);
    assert!(check(&other, &Meshes::default(), &Limits::default()).is_ok(), "nothing is clamped");
}

#[test]
fn bend_test_gives_the_same_bits_on_any_number_of_threads() {
    let text = |threads| {
        let fields = [("/product/subparticle_radius_m", json!(0.006)), ("/numerics/duration_s", json!(0.5))];
        let result = run_on(threads, "over_bar", &fields);
        assert_eq!(result.solver.threads, threads);
        serde_json::to_string(&(&result.responses, &result.series)).expect("JSON")
    };
    let one = text(1);
    for threads in [2, 3] {
        assert_eq!(text(threads), one);
    }
}
