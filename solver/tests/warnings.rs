//! Warnings of small runs: a sound run has none, and a test that never began says so.

mod common;

use common::{response, run_on};
use roost_solver::result::RunResult;
use roost_solver::scenario;
use serde_json::{Value, json};

fn run(document: Value) -> RunResult {
    let mut document = document;
    document["product"]["subparticle_radius_m"] = json!(0.004);
    document["numerics"]["timestep_s"] = json!("auto");
    let scenario = scenario::from_value(&document).unwrap_or_else(|faults| panic!("{faults:?}"));
    run_on(1, &scenario)
}

fn codes(result: &RunResult) -> Vec<&str> {
    assert_eq!(response(result, "warning_count"), result.warnings.len() as f64);
    let codes: Vec<_> = result.warnings.iter().map(|warning| warning.code.as_str()).collect();
    let word = if codes.is_empty() { "none".to_owned() } else { codes.join(", ") };
    assert_eq!(result.responses["warning_codes"], word);
    codes
}

#[test]
fn a_drop_that_lands_has_no_warning_and_one_cut_short_has() {
    let drop = |duration_s: f64| {
        let numerics = json!({"duration_s": duration_s, "output_interval_s": 0.001, "gravity_m_s2": 0.0});
        json!({"experiment": "drop", "product": {"count": 2}, "drop": {"speed_m_s": 0.05}, "numerics": numerics})
    };
    assert_eq!(codes(&run(drop(0.3))), [""; 0]);
    assert_eq!(codes(&run(drop(0.001))), ["test_never_began"]);
}

#[test]
fn plate_that_tilts_too_little_has_a_warning() {
    let slide = |max_tilt_deg: f64| json!({"experiment": "slide", "slide": {"max_tilt_deg": max_tilt_deg, "tilt_rate_deg_s": 30}});
    let result = run(slide(2.0));
    assert_eq!(codes(&result), ["test_never_began"]);
    assert!(result.warnings[0].message.contains("tilt of 2.0°"), "{}", result.warnings[0].message);
    assert_eq!(codes(&run(slide(60.0))), [""; 0]);
}

#[test]
fn escaped_bodies_of_a_scene_have_a_warning_with_their_share() {
    // Two bodies: one lies on the floor, the other falls past it.
    let floor = json!({"name": "floor", "plate_m": [[-0.3, -0.3, 0], [0.6, 0, 0], [0, 0.6, 0]]});
    let bodies = json!([{"position_m": [0, 0, 0.03]}, {"position_m": [0.6, 0, 0.03]}]);
    let result = run(json!({
        "experiment": "scene",
        "scene": {"bodies": bodies, "surfaces": [floor], "margin_m": 0.1},
        "numerics": {"duration_s": 0.5},
    }));
    assert_eq!(codes(&result), ["escaped_mass"]);
    assert!(result.warnings[0].message.contains("(50.00 %)"), "{}", result.warnings[0].message);
}

#[test]
fn results_without_warnings_are_still_read() {
    let result =
        run(json!({"experiment": "drop", "product": {"count": 1}, "numerics": {"duration_s": 0.01}}));
    let mut document = json!(result);
    assert!(document["warnings"].is_array());
    document.as_object_mut().unwrap().remove("warnings");
    let read: RunResult = serde_json::from_value(document).expect("a result of an older solver");
    assert_eq!(read.warnings, []);
    assert!(!read.is_of_earlier_form());
}

#[test]
fn result_with_an_earlier_scenario_schema_keeps_its_digest() {
    let mut document =
        json!(run(json!({"experiment": "drop", "product": {"count": 1}, "numerics": {"duration_s": 0.01}})));
    document["scenario"]["schema"] = json!("roost.scenario/1");
    document["scenario"]["bonds"].as_object_mut().unwrap().remove("reference_radius_m");
    document["scenario_digest"] = json!("of schema 1");
    let read = RunResult::from_value(document).expect("an earlier result");
    assert_eq!(
        (read.scenario.schema.as_str(), read.scenario_digest.as_str()),
        (scenario::SCHEMA, "of schema 1")
    );
    assert_eq!(read.scenario.bonds.reference_radius_m, None);
    assert!(read.is_of_earlier_form());
}
