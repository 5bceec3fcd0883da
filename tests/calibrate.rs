//! A calibration with a server and a worker, from measurements in files to a sweep that draws its parameters.

mod support;

use serde_json::{Value, json};
use support::{Sandbox, roost, stdout, transcript};

const FRICTION: &str = "/contact/fillet_equipment/static_friction";
const MODULUS: &str = "/material/youngs_modulus_pa";

/// A coarse fillet, so that a run takes a tenth of a second.
fn scenario(experiment: &str) -> Value {
    json!({"experiment": experiment, "product": {"subparticle_radius_m": 0.008}, "numerics": {"timestep_s": "auto"}})
}

/// Measurements of a plate and a block; the curve of the block is a CSV file.
fn measurements() -> Value {
    let angles = json!({"response": "critical_angle_deg", "unit": "deg", "values": [26.0, 27.5, 25.0, 26.5]});
    let curve = json!({"x": "strain", "y": "stress", "y_unit": "kPa", "file": "block.csv"});
    json!({"name": "plate and block", "tests": [
        {"name": "plate", "scenario": scenario("slide"), "measured": {"responses": [angles]}},
        {"name": "block", "scenario": scenario("compress"), "measured": {"curves": [curve]}}]})
}

fn calibration(measurements: Value) -> Value {
    json!({"name": "coarse fillet", "budget": {"max_runs": 60},
           "factors": [{"pointer": FRICTION, "low": 0.2, "high": 0.8},
                       {"pointer": MODULUS, "low": 2e4, "high": 2e5, "scale": "log"}],
           "goal": {"calibrate": {"measurements": measurements}}})
}

#[test]
fn measurements_become_parameters_that_a_sweep_draws() {
    let sandbox = Sandbox::new();
    let _server = sandbox.start_server();
    let _worker = sandbox.start_worker("worker");
    std::fs::write(sandbox.path("block.csv"), "x,mean,deviation,n\n0.01,0.1,0.01,3\n0.03,0.35,0.03,3\n")
        .unwrap();
    sandbox.file("lab.json", &measurements());
    let file = sandbox.file("calibration.json", &calibration(json!("lab.json")));
    let study = sandbox.json_output(&["study", "submit", &file, "--wait"]);
    let id = study["id"].as_str().unwrap();
    let answer = sandbox.get(&format!("/v1/studies/{id}/answer"));
    let finding = &answer["answer"]["finding"]["calibrate"];
    let friction = &finding["parameters"][0]["estimate"];
    let end = |name: &str| friction[name].as_f64().unwrap();
    // The friction whose angle was measured: tan 26.25° is 0.49, and the fillet slides somewhat earlier than an ideal block.
    assert!(end("low") > 0.4 && end("high") < 0.7 && end("low") < end("high"), "{finding:#}");
    let targets = finding["targets"].as_array().unwrap();
    assert_eq!(targets.len(), 3);
    assert_eq!(targets[2]["target"]["of"]["mean"], "stress_pa@strain=0.03");
    assert!(targets.iter().all(|target| target["distance"].as_f64().unwrap().abs() < 3.0), "{targets:#?}");
    let words = study["answer"].to_string();
    assert!(words.contains("Fillet equipment static friction is 0."), "{words}");

    // Friction alone decides the angle: what varies between samples is input, and little is chance.
    let sweep = json!({"name": "with uncertainty", "base": scenario("slide"), "design": {"kind": "grid"}, "factors": [],
                       "replicates": 16, "posterior": {"study": id}});
    let file = sandbox.file("sweep.json", &sweep);
    let done = sandbox.json_output(&["submit", &file, "--wait"]);
    let id = done["id"].as_str().unwrap();
    let row = sandbox.get(&format!("/v1/sweeps/{id}/results?by=point"))["points"][0]["responses"]["critical_angle_deg"].clone();
    let number = |name: &str| row[name].as_f64().unwrap_or_else(|| panic!("{name}: {row:#}"));
    assert!(
        number("input_deviation") > 0.2 && number("chance_deviation") < 0.3 * number("input_deviation"),
        "{row:#}"
    );
    assert!(number("high_95") - number("low_95") > 3.0 * number("input_deviation"), "{row:#}");
    let table = stdout(&sandbox.roost(&["results", id, "--by", "point", "--format", "csv"]));
    assert!(table.lines().next().unwrap().contains("critical_angle_deg.input_deviation"), "{table}");
    // Two replicates in a row have the same friction, and a trial says with which.
    let trials = sandbox.get(&format!("/v1/sweeps/{id}/results"))["trials"].clone();
    let drawn: Vec<f64> =
        (0..4).map(|trial| trials[trial]["parameters"][FRICTION].as_f64().unwrap()).collect();
    assert!(drawn[0] == drawn[1] && drawn[2] == drawn[3] && drawn[0] != drawn[2], "{drawn:?}");
    let table = stdout(&sandbox.roost(&["results", id, "--format", "csv"]));
    assert!(table.lines().next().unwrap().contains(FRICTION), "{table}");
    assert!(table.contains(&drawn[2].to_string()), "{table}");
}

#[test]
fn unusable_files_of_a_calibration_are_refused_by_name() {
    let sandbox = Sandbox::new();
    let mut lab = measurements();
    lab["tests"][1]["measured"]["curves"][0]["file"] = json!("none.csv");
    sandbox.file("lab.json", &lab);
    let refused = |name: &str, document: Value| {
        let file = sandbox.file(name, &document);
        let output = roost().args(["validate", &file]).output().unwrap();
        assert_eq!(output.status.code(), Some(2));
        transcript(&output)
    };
    let words = refused("missing.json", calibration(json!("other.json")));
    assert!(words.contains("/goal/calibrate/measurements") && words.contains("other.json"), "{words}");
    let words = refused("curve.json", calibration(json!("lab.json")));
    assert!(words.contains("/goal/calibrate/measurements/tests/1/measured/curves/0/file"), "{words}");
    let posterior = json!({"name": "s", "base": scenario("slide"), "design": {"kind": "grid"}, "factors": [],
                           "posterior": {"file": "lab.json"}});
    let words = refused("sweep.json", posterior);
    assert!(words.contains("/posterior/file") && words.contains("no answer of a calibration"), "{words}");
}

#[test]
fn example_of_the_paper_is_valid_and_shown_as_it_is() {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/docs");
    let example = format!("{folder}/examples/studies/paper-calibration.json");
    let report = roost().args(["validate", "--json", &example]).output().unwrap();
    assert!(report.status.success(), "{}", transcript(&report));
    let text = std::fs::read_to_string(&example).unwrap();
    let page = std::fs::read_to_string(format!("{folder}/howto/calibrate.md")).unwrap();
    assert!(page.contains(text.trim_end()));
}
