//! Fillets that bend under their own weight: over a bar, off a conveyor, in a clamp.

use roost_solver::experiments::prepare;
use roost_solver::mesh::Meshes;
use roost_solver::result::{EndReason, RunResult};
use roost_solver::scenario;
use roost_solver::{CpuOptions, Flow, Limits, Progress, check, simulate};
use serde_json::{Value, json};

/// A fillet of size 2 (coarser ones are single sheets towards the tail, which hinge at every bond) with these fields, by pointer, instead of the defaults.
fn run(threads: usize, fields: &[(&str, Value)]) -> RunResult {
    let mut document = json!({
        "experiment": "bend",
        "numerics": {"timestep_s": "auto", "output_interval_s": 0.01, "duration_s": 1.0},
    });
    for (pointer, value) in fields {
        let mut at = &mut document;
        for name in pointer.split('/').skip(1) {
            at = &mut at[name];
        }
        *at = value.clone();
    }
    let scenario = scenario::from_value(&document).expect("a sound scenario");
    check(&scenario, &Meshes::default(), &Limits::default()).expect("a scenario that can run");
    simulate(&scenario, &Meshes::default(), CpuOptions { threads }, &mut |_: &Progress| Flow::Continue)
}

fn response(result: &RunResult, name: &str) -> f64 {
    result.response(name).unwrap_or_else(|| panic!("{name} is null: {:?}", result.responses))
}

fn stiffness(n_m3: f64) -> [(&'static str, Value); 2] {
    [("/bonds/normal_stiffness_n_m3", json!(n_m3)), ("/bonds/shear_stiffness_n_m3", json!(0.6 * n_m3))]
}

#[test]
fn a_soft_fillet_hangs_over_the_bar_and_a_stiff_one_lies_on_it() {
    let soft = run(1, &[]);
    assert_eq!(soft.responses["fell_off"], json!(false));
    assert!(response(&soft, "bend_angle_deg") > 100.0, "{:?}", soft.responses);
    assert_eq!(response(&soft, "bonds_intact_fraction"), 1.0);
    let stiff = run(1, &stiffness(3e7));
    assert!(response(&stiff, "largest_bend_angle_deg") < 30.0, "{:?}", stiff.responses);
    let angles = &soft.series("bend_angle").expect("there").values;
    // It starts as it lies on a flat table, whose underside is round.
    assert!(angles[0] < 40.0 && angles.iter().all(|angle| (0.0..=180.0).contains(angle)), "{angles:?}");
}

#[test]
fn a_fillet_and_its_mirror_image_bend_alike() {
    let [one, other] = [2, 3].map(|shape| run(1, &[("/product/shape", json!(shape))]));
    let [one, other] = [&one, &other].map(|result| response(result, "bend_angle_deg"));
    assert!((one - other).abs() < 5.0, "{one}° and {other}°");
}

#[test]
fn a_clamped_fillet_sinks_in_proportion_to_gravity_and_to_compliance() {
    // Without contact and while small, all of it is linear: k u = m g. Rest speed and time leave room to settle.
    let still = [
        ("/bend/support", json!("clamped")),
        ("/bonds/contact_between_bonded", json!(false)),
        ("/numerics/rest_speed_m_s", json!(1e-4)),
        ("/numerics/duration_s", json!(0.5)),
    ];
    let mean_deflection = |gravity: f64, n_m3: f64| {
        let fields = [&still[..], &stiffness(n_m3), &[("/numerics/gravity_m_s2", json!(gravity))]].concat();
        let result = run(1, &fields);
        assert_eq!(response(&result, "bonds_intact_fraction"), 1.0);
        // Bonds without contact have no damping: the mean angle over whole swings is the one at rest.
        let angles = &result.series("bend_angle").expect("there").values;
        angles.iter().sum::<f64>() / angles.len() as f64
    };
    let base = mean_deflection(0.5, 1e7);
    let (heavier, stiffer) = (mean_deflection(1.0, 1e7), mean_deflection(1.0, 2e7));
    assert!(base > 0.05, "{base}° is too little to tell");
    assert!((heavier / base / 2.0 - 1.0).abs() < 0.05, "{heavier}° is not twice {base}°");
    assert!((stiffer / base - 1.0).abs() < 0.1, "{stiffer}° is not {base}°");
}

#[test]
fn what_is_clamped_does_not_move() {
    let clamped = [("/bend/support", json!("clamped")), ("/numerics/duration_s", json!(0.3))];
    let result = run(1, &clamped);
    let scene = prepare(&result.scenario, &Meshes::default()).scene;
    let points = &scene.kinds[0].meta.points;
    let low = points.iter().map(|p| p.x).fold(f64::INFINITY, f64::min);
    let high = points.iter().map(|p| p.x).fold(f64::NEG_INFINITY, f64::max);
    assert!(!scene.held.is_empty() && scene.held.len() < points.len());
    assert!(scene.held.iter().all(|&k| points[k as usize].x <= low + 0.25 * (high - low)));
    assert!(response(&result, "tip_deflection_m") > 0.02, "{:?}", result.responses);
}

#[test]
fn a_conveyor_carries_its_load_over_the_edge_at_its_speed() {
    let carried = [("/bend/support", json!("off_ledge")), ("/bend/belt_speed_m_s", json!(0.5))];
    let result = run(1, &carried);
    assert_eq!(result.end_reason, EndReason::Done);
    // Its 0.172 m have passed the edge after 0.34 s, a little sooner once most of it hangs and pulls.
    let last = *result.series("kinetic_energy").expect("there").t_s.last().expect("samples");
    assert!((0.2..0.36).contains(&last), "{last} s");
    assert!(response(&result, "largest_bend_angle_deg") > 30.0, "{:?}", result.responses);
}

#[test]
fn threads_do_not_matter_and_the_seed_turns_the_fillet() {
    let scattered = |seed: u64, threads: usize| {
        let fields =
            [("/bend/scatter_deg", json!(20)), ("/seed", json!(seed)), ("/numerics/duration_s", json!(0.2))];
        serde_json::to_string(&run(threads, &fields).series).unwrap()
    };
    assert_eq!(scattered(1, 1), scattered(1, 2));
    assert_ne!(scattered(1, 1), scattered(2, 1));
}
