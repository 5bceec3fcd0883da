//! Calibrations: faults of the document, and scenarios of the runs.

use roost_api::Fault;
use roost_solver::Limits;
use roost_solver::mesh::Meshes;
use serde_json::{Value, json};

use super::present;
use crate::study::{Study, read};
use crate::sweep::SweepLimits;

const FRICTION: &str = "/contact/fillet_equipment/static_friction";

fn test(name: &str, experiment: &str, response: &str, unit: &str, mean: f64) -> Value {
    json!({"name": name, "scenario": {"experiment": experiment, "seed": 9},
           "measured": {"responses": [{"response": response, "unit": unit, "mean": mean, "deviation": 1.0, "n": 5}]}})
}

fn document() -> Value {
    json!({"name": "c", "budget": {"max_runs": 60},
           "factors": [{"pointer": FRICTION, "low": 0.1, "high": 0.9},
                       {"pointer": "/material/youngs_modulus_pa", "low": 2e4, "high": 2e5, "scale": "log"}],
           "goal": {"calibrate": {"measurements": {"name": "m", "tests": [
               test("plate", "slide", "critical_angle_deg", "deg", 26.0), test("block", "compress", "modulus_pa", "kPa", 40.0)]}}}})
}

fn checked(document: Value) -> Result<Study, Vec<Fault>> {
    let limits = SweepLimits { max_jobs: 1000, scenario: Limits::NONE };
    read(document, &Meshes::default(), limits).map(|(study, _)| study)
}

#[test]
fn runs_simulate_each_test_with_the_parameters() {
    let study = checked(document()).unwrap();
    // The stored document, which has the first scenario as its base, reads the same.
    let study = Study::stored(present(&study, None)).unwrap();
    let decided = study.decide(&[], &[], 6).unwrap();
    assert_eq!(decided.trials.len(), 6);
    let mut experiments = Vec::new();
    for trial in &decided.trials {
        let scenario = json!(trial.scenario);
        let levels = trial.levels.as_ref();
        if let Some(levels) = levels {
            assert_eq!(scenario.pointer(FRICTION), levels.get(FRICTION));
            let expected = if levels["test"] == "plate" { "slide" } else { "compress" };
            assert_eq!(scenario["experiment"], expected);
            experiments.push(expected);
        }
    }
    assert!(experiments.contains(&"slide") && experiments.contains(&"compress"));
    let words = decided.sentences.join(" ");
    assert!(
        words.contains("Too few runs have ended") && words.contains("for the scenarios of the tests"),
        "{words}"
    );
    assert!(study.question_sentence().contains("agree with the measurements \"m\"?"));
}

#[test]
fn every_fault_of_a_calibration_has_its_pointer() {
    let spoilt = |pointer: &str, value: Value| {
        let mut document = document();
        let (parent, name) = pointer.rsplit_once('/').unwrap();
        let place = document.pointer_mut(parent).unwrap();
        match place {
            Value::Array(items) => items[name.parse::<usize>().unwrap()] = value,
            place => place[name] = value,
        }
        checked(document).expect_err(pointer)
    };
    let at = "/goal/calibrate/measurements";
    let cases = [
        ("/base", json!({"experiment": "hopper"}), "/base"),
        ("/driver", json!("client"), "/driver"),
        ("/posterior", json!({"parameters": [], "samples": []}), "/posterior"),
        (
            "/factors/0",
            json!({"pointer": "/bend/bar_radius_m", "low": 0.01, "high": 0.02}),
            "/factors/0/pointer",
        ),
        ("/factors/0", json!({"pointer": "/product/shape", "low": 0, "high": 3}), "/factors/0"),
        ("/factors/1/high", json!(1e12), "/factors/1/high"),
        ("/goal/calibrate/discrepancy", json!(-1), "/goal/calibrate/discrepancy"),
        (
            "/goal/calibrate/priors",
            json!([{"parameter": "/x", "normal": {"mean": 1, "deviation": 1}}]),
            "/goal/calibrate/priors/0/parameter",
        ),
        ("/goal/calibrate/prior", json!([]), "/goal/calibrate"),
        (
            "/goal/calibrate/measurements/tests/0/scenario/experiment",
            json!("no_such_experiment"),
            "/goal/calibrate/measurements/tests/0/scenario/experiment",
        ),
        (
            "/goal/calibrate/measurements/tests/1/measured/responses/0/unit",
            json!("mm"),
            "/goal/calibrate/measurements/tests/1/measured/responses/0/unit",
        ),
        ("/budget/max_runs", json!(5), "/budget/max_runs"),
    ];
    for (pointer, value, expected) in cases {
        let faults = spoilt(pointer, value);
        let pointers: Vec<&str> = faults.iter().map(|fault| fault.pointer.as_str()).collect();
        assert!(pointers.iter().any(|found| found.starts_with(expected)), "{pointer}: {faults:#?}");
    }
    let mut missing = document();
    missing["goal"]["calibrate"].as_object_mut().unwrap().remove("measurements");
    assert_eq!(checked(missing).unwrap_err()[0].pointer, at);
    let mut missing = document();
    missing["goal"] = json!({"boundary": {"of": {"probability": "jammed"}, "level": 0.05}});
    assert!(checked(missing).unwrap_err().iter().any(|fault| fault.pointer == "/base"));
}

#[test]
fn long_curve_is_compared_at_places_that_lie_evenly() {
    let points: Vec<Value> = (1..=40)
        .map(|index| json!({"x": 0.001 * f64::from(index), "mean": 1.0, "deviation": 0.1, "n": 3}))
        .collect();
    let mut document = document();
    document["goal"]["calibrate"]["measurements"]["tests"][1]["measured"] =
        json!({"curves": [{"x": "strain", "y": "stress", "y_unit": "kPa", "points": points}]});
    let study = checked(document).unwrap();
    let roost_design::Goal::Calibrate(goal) = &study.question.goal else { panic!("a calibration") };
    let places: Vec<f64> =
        goal.targets.iter().filter_map(|target| target.curve.as_ref()).map(|place| place.at).collect();
    assert_eq!(places, [0.005, 0.01, 0.015, 0.02, 0.025, 0.03, 0.035, 0.04]);
}
