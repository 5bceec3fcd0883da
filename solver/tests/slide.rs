//! Fillets on a plate that is tilted: where they slide, what moves that angle and what does not.

mod common;

use roost_solver::result::{EndReason, RunResult};
use roost_solver::scenario::Scenario;
use serde_json::{Value, json};

fn scenario(fields: &[(&str, Value)]) -> Scenario {
    let document = json!({
        "experiment": "slide",
        "product": {"subparticle_radius_m": 0.008},
        "slide": {"tilt_rate_deg_s": 6.0},
        "numerics": {"timestep_s": "auto"},
    });
    common::scenario(document, fields)
}

fn run_on(threads: usize, fields: &[(&str, Value)]) -> RunResult {
    common::run_on(threads, &scenario(fields))
}

fn run(fields: &[(&str, Value)]) -> RunResult {
    run_on(1, fields)
}

fn critical_angle_deg(result: &RunResult) -> f64 {
    assert_eq!(result.end_reason, EndReason::Done, "{:?}", result.instability);
    assert_eq!(result.responses["slid"], true);
    assert_eq!(result.responses["rolled_over"], false);
    assert_eq!(result.response("bonds_intact_fraction"), Some(1.0));
    result.response("critical_angle_deg").expect("slid")
}

fn with_friction(mu: f64) -> (&'static str, Value) {
    ("/contact/fillet_equipment/static_friction", json!(mu))
}

#[test]
fn a_truss_slides_at_its_angle_of_friction() {
    // One type of sub-particle bonds the diagonals too: none turns against its neighbours.
    for mu in [0.2, 0.5] {
        let result = run(&[("/bonds/types", json!(1)), with_friction(mu)]);
        let friction_angle = f64::atan(mu).to_degrees();
        assert_eq!(result.response("friction_angle_deg"), Some(friction_angle));
        let found = critical_angle_deg(&result);
        assert!((found - friction_angle).abs() < 1.5, "{found} of {friction_angle}");
    }
}

#[test]
fn critical_angle_of_a_cubic_lattice_is_lower_and_nearly_linear_in_friction() {
    // Its neighbours turn like gears: `friction::bonded_pair_slides_below_its_angle_of_friction`.
    let frictions = [0.1, 0.2, 0.3, 0.4, 0.5];
    let angles = frictions.map(|mu| critical_angle_deg(&run(&[with_friction(mu)])));
    for (mu, angle) in frictions.iter().zip(angles) {
        let friction_angle = mu.atan().to_degrees();
        assert!((0.6 * friction_angle..friction_angle).contains(&angle), "{angles:?}");
    }
    let mean = |values: &[f64; 5]| values.iter().sum::<f64>() / 5.0;
    let (x, y) = (mean(&frictions), mean(&angles));
    let sum = |of: &dyn Fn(f64, f64) -> f64| -> f64 {
        frictions.iter().zip(&angles).map(|(mu, angle)| of(mu - x, angle - y)).sum()
    };
    let r2 = sum(&|a, b| a * b).powi(2) / sum(&|a, _| a * a) / sum(&|_, b| b * b);
    assert!(r2 > 0.95, "{r2}: {angles:?}");
}

#[test]
fn critical_angle_hardly_depends_on_surface_energy() {
    let with_energy = |gamma: f64| {
        let fields = [
            ("/contact/fillet_equipment/surface_energy_j_m2", json!(gamma)),
            ("/contact/fillet_fillet/surface_energy_j_m2", json!(gamma)),
            with_friction(0.3),
        ];
        critical_angle_deg(&run(&fields))
    };
    let (none, table_2) = (with_energy(0.0), with_energy(0.055));
    assert!((none - table_2).abs() < 1.0, "{none} and {table_2}");
}

#[test]
fn fillet_that_holds_up_to_the_maximum_tilt_has_no_critical_angle() {
    let result = run(&[("/slide/max_tilt_deg", json!(12.0)), with_friction(0.5)]);
    assert_eq!(result.end_reason, EndReason::Duration);
    assert_eq!(result.responses["slid"], false);
    assert!(result.responses["critical_angle_deg"].is_null());
    let tilt = &result.series("tilt_angle").expect("there").values;
    assert!(tilt[0] == 0.0 && (tilt.last().unwrap() - 12.0).abs() < 0.01, "{tilt:?}");
}

#[test]
fn fillet_without_friction_slides_at_once() {
    let angle = critical_angle_deg(&run(&[with_friction(0.0)]));
    assert!(angle < 0.5, "{angle}");
}

#[test]
fn slide_test_without_early_end_runs_until_the_fillet_leaves_the_plate() {
    let fields = [("/numerics/stop/when_done", json!(false)), with_friction(0.1)];
    let result = run(&fields);
    assert_eq!(result.end_reason, EndReason::Done);
    let way = &result.series("displacement").expect("there").values;
    assert!(way.last().unwrap() > &0.5 && way[way.len() - 2] <= 0.5);
    let early = run(&fields[1..]);
    assert_eq!(critical_angle_deg(&result), critical_angle_deg(&early), "whatever comes after");
    assert!(early.series("displacement").expect("there").values.last().unwrap() < &0.25);
}

#[test]
fn displacement_is_the_integral_of_the_sliding_speed() {
    let result = run(&[with_friction(0.2)]);
    let [speed, way] = ["sliding_speed", "displacement"].map(|name| result.series(name).expect("there"));
    let steps = speed.t_s.windows(2).zip(speed.values.windows(2));
    let summed: f64 = steps.map(|(t, v)| (t[1] - t[0]) * (v[0] + v[1]) / 2.0).sum();
    let way = way.values.last().unwrap();
    assert!((summed / way - 1.0).abs() < 0.02, "{summed} and {way}");
    // It was at rest before: what is told of the time before t = 0 says so.
    let energy = result.series("kinetic_energy").expect("there");
    assert!(energy.t_s[0] < -0.1 && energy.t_s.contains(&0.0), "{:?}", &energy.t_s[..3]);
}

#[test]
fn a_rough_plate_rolls_a_stiff_fillet_over() {
    let result = run(&[
        ("/slide/yaw_deg", json!(90.0)),
        ("/slide/max_tilt_deg", json!(89.0)),
        ("/bonds", json!({"types": 1, "normal_stiffness_n_m3": 1e7, "shear_stiffness_n_m3": 6e6})),
        ("/contact/fillet_equipment/surface_energy_j_m2", json!(0.0)),
        with_friction(3.0),
    ]);
    assert_eq!(result.responses["rolled_over"], true);
    assert!(result.response("critical_angle_deg").expect("it moved") < 3f64.atan().to_degrees() - 10.0);
}

#[test]
fn seed_changes_the_heading_of_the_fillet() {
    let angle = |seed: u64| {
        let fields = [("/slide/scatter_deg", json!(180.0)), ("/seed", json!(seed)), with_friction(0.4)];
        critical_angle_deg(&run(&fields))
    };
    let (one, two) = (angle(1), angle(2));
    assert!(one != two && (one - two).abs() < 6.0, "{one} and {two}");
}

#[test]
fn slide_test_gives_the_same_bits_on_any_number_of_threads() {
    let text = |threads| {
        let fields = [("/product/subparticle_radius_m", json!(0.006)), with_friction(0.05)];
        let result = run_on(threads, &fields);
        assert_eq!(result.solver.threads, threads);
        serde_json::to_string(&(&result.responses, &result.series)).expect("JSON")
    };
    let one = text(1);
    for threads in [2, 3] {
        assert_eq!(text(threads), one);
    }
}
