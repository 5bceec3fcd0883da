//! `roost validate` of laboratory measurements: documents with CSV files beside them, and the examples of the documentation.

mod support;

use std::collections::BTreeSet;
use std::path::Path;

use serde_json::{Value, json};
use support::{Sandbox, run, stdout, transcript};

const CURVE: &str = "/tests/0/measured/curves/0";
const MODULUS: &str = "/tests/0/measured/responses/0";
/// As spreadsheets write it: with a byte order mark.
const SOUND_CSV: &str = "\u{feff}x,mean,deviation,n\r\n0.01,0.1,0.02,3\r\n0.03,0.4,0.05,3\r\n";

/// A block that was compressed with a curve in `curve.csv`, and a fillet that slid.
fn sound() -> Value {
    let curve = json!({"x": "strain", "y": "stress", "y_unit": "kPa", "file": "curve.csv"});
    let modulus = json!({"response": "modulus_pa", "unit": "kPa", "mean": 10.0, "deviation": 1.0, "n": 3});
    let angle = json!({"response": "critical_angle_deg", "unit": "deg", "values": [24.0, 26.0, 28.0]});
    json!({"schema": "roost.measurements/1", "name": "fillets", "tests": [
        {"name": "block", "scenario": {"experiment": "compress"},
         "measured": {"responses": [modulus], "curves": [curve]}},
        {"name": "plate", "scenario": {"experiment": "slide"}, "measured": {"responses": [angle]}}]})
}

/// A folder with the file of the curve, and the path of a document in it.
fn written(document: &Value, csv: &str) -> (Sandbox, String) {
    let sandbox = Sandbox::new();
    std::fs::write(sandbox.path("curve.csv"), csv).unwrap();
    let file = sandbox.file("lab.json", document);
    (sandbox, file)
}

/// The faults of a refused document: pointer and text.
fn faults(document: &Value, csv: &str) -> Vec<(String, String)> {
    let (_sandbox, file) = written(document, csv);
    let output = run(&["validate", "--json", &file]);
    assert_eq!(output.status.code(), Some(2), "{}", transcript(&output));
    let report: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(report["valid"], false);
    let text = |fault: &Value| {
        let words = ["value", "detail", "allowed"].map(|member| fault[member].to_string());
        (fault["pointer"].as_str().unwrap().to_owned(), words.join(" "))
    };
    report["errors"].as_array().unwrap().iter().map(text).collect()
}

/// Asserts that a change of the sound document, or of its CSV file, has exactly one fault.
fn refused(change: &dyn Fn(&mut Value), csv: &str, pointer: &str, reason: &str) {
    let mut document = sound();
    change(&mut document);
    let found = faults(&document, csv);
    assert!(
        found.len() == 1 && found[0].0 == pointer && found[0].1.contains(reason),
        "{pointer}: {found:#?}"
    );
}

/// Sets a member of an object, which need not be there, or an item of an array.
fn set(pointer: &str, value: Value) -> impl Fn(&mut Value) + use<> {
    let (parent, name) = pointer.rsplit_once('/').unwrap();
    let (parent, name) = (parent.to_owned(), name.to_owned());
    move |document| match document.pointer_mut(&parent).unwrap() {
        Value::Array(items) => items[name.parse::<usize>().unwrap()] = value.clone(),
        object => object[&name] = value.clone(),
    }
}

#[test]
fn sound_measurements_are_summarized_in_units_of_results() {
    let (_sandbox, file) = written(&sound(), SOUND_CSV);
    let text = stdout(&run(&["validate", &file]));
    let lines = [
        "valid measurements",
        "2 tests with 4 numbers in all",
        "block (compress): 3 numbers",
        "modulus_pa: mean 10000 Pa, standard deviation 1000 Pa, n = 3",
        "stress_pa@strain=0.03: mean 400 Pa, standard deviation 50 Pa, n = 3",
        "plate (slide): 1 number",
        "critical_angle_deg: mean 26 °, standard deviation 2 °, n = 3",
    ];
    for line in lines {
        assert!(text.contains(line), "no `{line}` in {text}");
    }
    let report: Value = serde_json::from_str(&stdout(&run(&["validate", "--json", &file]))).unwrap();
    assert_eq!((&report["valid"], &report["document"]), (&json!(true), &json!("measurements")));
    let first = json!({"observable": "stress_pa@strain=0.01", "unit": "Pa", "mean": 100.0, "deviation": 20.0, "n": 3});
    assert_eq!(report["tests"][0]["targets"][1], first);
}

#[test]
fn spoilt_files_are_refused_with_pointer_and_reason() {
    let none = |_: &mut Value| {};
    let csv_at = format!("{CURVE}/file");
    let modulus = |name: &str, value: Value| set(&format!("{MODULUS}/{name}"), value);
    refused(&modulus("unit", json!("mm")), SOUND_CSV, &format!("{MODULUS}/unit"), "Pa, kPa, MPa");
    refused(&modulus("n", json!(-3)), SOUND_CSV, &format!("{MODULUS}/n"), "-3");
    let single = json!({"response": "modulus_pa", "unit": "Pa", "mean": 1.0, "n": 1});
    refused(&set(MODULUS, single), SOUND_CSV, &format!("{MODULUS}/deviation"), "a single value");
    let unknown = modulus("response", json!("modulus"));
    refused(&unknown, SOUND_CSV, &format!("{MODULUS}/response"), "did you mean modulus_pa");
    let twist = "/tests/1/scenario/experiment";
    refused(&set(twist, json!("twist")), SOUND_CSV, twist, "slide");
    refused(&set("/tests/1/name", json!("block")), SOUND_CSV, "/tests/1/name", "another test");
    refused(&set("/schema", json!("roost.measurements/9")), SOUND_CSV, "/schema", "roost.measurements/1");
    for (csv, reason) in [
        ("x,mean,deviation,n\n0.01,NaN,0.1,3\n", "line 2, column `mean`: is no finite number"),
        ("x,mean,deviation,n\n0.01,much,0.1,3\n", "much"),
        ("x,mean,deviation,n\n0.03,1,0.1,3\n0.01,2,0.1,3\n", "line 3, column `x`: the curve goes back"),
        ("x,mean,deviation\n0.01,1,0.1\n", "no column `n`"),
        ("x,mean,deviation,n\n", "1 to 1000"),
    ] {
        refused(&none, csv, &csv_at, reason);
    }
}

#[test]
fn unusable_files_of_curves_are_refused_once() {
    let csv_at = format!("{CURVE}/file");
    refused(&set(&csv_at, json!("other.csv")), SOUND_CSV, &csv_at, "No such file");
    refused(&set(&csv_at, json!(7)), SOUND_CSV, &csv_at, "must be a text");
    let points = json!([{"x": 0.01, "mean": 1.0, "deviation": 0.1, "n": 3}]);
    refused(&set(&format!("{CURVE}/points"), points), SOUND_CSV, &csv_at, "excludes `points`");
    let long = format!("{SOUND_CSV}{}", " ".repeat(1 << 20));
    refused(&|_| {}, &long, &csv_at, "larger than the maximum of 1.00 MiB");
}

#[test]
fn all_faults_are_listed_at_once() {
    let mut document = sound();
    set(&format!("{MODULUS}/unit"), json!("mm"))(&mut document);
    set(&format!("{CURVE}/file"), json!("other.csv"))(&mut document);
    set("/tests/1/name", json!("block"))(&mut document);
    let found: BTreeSet<String> =
        faults(&document, SOUND_CSV).into_iter().map(|(pointer, _)| pointer).collect();
    let expected = [format!("{MODULUS}/unit"), format!("{CURVE}/file"), "/tests/1/name".to_owned()]
        .into_iter()
        .collect();
    assert_eq!(found, expected);
}

#[test]
fn other_commands_refer_to_validate() {
    let (sandbox, file) = written(&sound(), SOUND_CSV);
    let out = sandbox.path("out").display().to_string();
    for arguments in [vec!["run", &file, "-o", &out], vec!["submit", &file]] {
        let output = run(&arguments);
        assert_eq!(output.status.code(), Some(2), "{}", transcript(&output));
        assert!(
            transcript(&output).contains("`roost validate` checks measurements"),
            "{}",
            transcript(&output)
        );
    }
}

#[test]
fn templates_are_valid() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/examples/measurements");
    let report = |name: &str| -> Value {
        let file = folder.join(format!("{name}.json")).display().to_string();
        serde_json::from_str(&stdout(&run(&["validate", "--json", &file]))).unwrap()
    };
    let numbers = [("compress", 6), ("bend", 2), ("slide", 2), ("drop", 1), ("hopper", 5)];
    for (name, count) in numbers {
        let report = report(name);
        let tests = report["tests"].as_array().unwrap();
        assert!(tests.iter().all(|test| test["experiment"] == name), "{name}");
        let targets: usize = tests.iter().map(|test| test["targets"].as_array().unwrap().len()).sum();
        assert_eq!(targets, count, "{name}");
        let source = report["source"].as_str().unwrap();
        assert!(source.contains("xample") && source.contains("not a measurement"), "{name}: {source}");
    }
    let templates = std::fs::read_dir(&folder).unwrap().map(|entry| entry.unwrap().path());
    let templates = templates.filter(|file| file.extension().is_some_and(|extension| extension == "json"));
    // With the measurements of the paper, which are no template.
    assert_eq!(templates.count(), numbers.len() + 1);
    // Vink et al. 2026, section 3.1: 48.6 ± 1.64 kPa.
    let modulus = &report("compress")["tests"][0]["targets"][0];
    assert_eq!((&modulus["mean"], &modulus["n"]), (&json!(48_600.0), &json!(3)));
}
