//! Sound measurements, and spoilt ones: each refused with pointer and reason.

use roost_solver::Limits;
use roost_solver::mesh::Meshes;
use serde_json::{Value, json};

use super::*;

/// A block that was compressed, and a fillet that slid.
fn sound() -> Value {
    let curve = json!({"x": "strain", "y": "stress", "y_unit": "kPa",
                       "table": "x,mean,deviation,n\n0.01,0.1,0.02,3\n0.03,0.4,0.05,3\n"});
    json!({"name": "fillets", "tests": [
        {"name": "block", "scenario": {"experiment": "compress"}, "conditions": {"temperature": "4 °C"},
         "measured": {"responses": [{"response": "modulus_pa", "unit": "kPa", "mean": 10.0, "deviation": 1.0, "n": 3}],
                      "curves": [curve]}},
        {"name": "plate", "scenario": {"experiment": "slide"},
         "measured": {"responses": [{"response": "critical_angle_deg", "unit": "deg", "values": [24.0, 26.0, 28.0]}]}}]})
}

fn read_all(document: Value) -> Result<Lab, Vec<Fault>> {
    read(document, &Meshes::default(), &Limits::NONE)
}

#[test]
fn numbers_are_in_the_units_of_their_observables() {
    let lab = read_all(sound()).unwrap();
    let targets = |test: usize| -> Vec<(String, f64, f64, u64)> {
        let targets = lab.tests[test].targets.iter();
        targets.map(|t| (t.observable.to_string(), t.mean, t.deviation, t.n)).collect()
    };
    let block = targets(0);
    assert_eq!(block[0], ("modulus_pa".to_owned(), 10_000.0, 1000.0, 3));
    assert_eq!(block[1], ("stress_pa@strain=0.01".to_owned(), 100.0, 20.0, 3));
    assert_eq!(block[2].0, "stress_pa@strain=0.03");
    // 24, 26, 28: squares of deviations 4 + 0 + 4, over 2.
    assert_eq!(targets(1), [("critical_angle_deg".to_owned(), 26.0, 2.0, 3)]);
}

/// Asserts that a change of the sound document has exactly one fault.
fn refused(change: &dyn Fn(&mut Value), pointer: &str, reason: &str) {
    let mut document = sound();
    change(&mut document);
    let faults = read_all(document).expect_err(pointer);
    let found: Vec<String> = faults.iter().map(ToString::to_string).collect();
    assert!(
        faults.len() == 1 && faults[0].pointer == pointer && found[0].contains(reason),
        "{pointer}: {found:#?}"
    );
}

#[test]
fn spoilt_documents_are_refused_with_pointer_and_reason() {
    const MODULUS: &str = "/tests/0/measured/responses/0";
    const CURVE: &str = "/tests/0/measured/curves/0";
    let set = |at: String, value: Value| {
        move |document: &mut Value| *document.pointer_mut(&at).unwrap() = value.clone()
    };
    let modulus = |name: &str, value: Value| set(format!("{MODULUS}/{name}"), value);
    let table = |text: &str| set(format!("{CURVE}/table"), json!(text));
    refused(&modulus("unit", json!("mm")), &format!("{MODULUS}/unit"), "Pa, kPa, MPa");
    refused(&modulus("n", json!(-3)), &format!("{MODULUS}/n"), "out of range");
    refused(&modulus("mean", json!("NaN")), &format!("{MODULUS}/mean"), "must be a number");
    refused(&modulus("deviation", json!(-1.0)), &format!("{MODULUS}/deviation"), "not negative");
    let single = |document: &mut Value| {
        document["tests"][0]["measured"]["responses"][0] =
            json!({"response": "modulus_pa", "unit": "Pa", "mean": 1.0, "n": 1});
    };
    refused(&single, &format!("{MODULUS}/deviation"), "a single value");
    refused(
        &modulus("response", json!("modulus")),
        &format!("{MODULUS}/response"),
        "did you mean modulus_pa",
    );
    refused(
        &set("/tests/1/scenario/experiment".to_owned(), json!("twist")),
        "/tests/1/scenario/experiment",
        "slide",
    );
    refused(&set("/tests/1/name".to_owned(), json!("block")), "/tests/1/name", "another test");
    let table_at = format!("{CURVE}/table");
    refused(
        &table("x,mean,deviation,n\n0.03,1,0.1,3\n0.01,2,0.1,3\n"),
        &table_at,
        "line 3, column `x`: the curve goes back",
    );
    refused(&table("x,mean,deviation,n\n0.01,much,0.1,3\n"), &table_at, "line 2, column `mean`");
    refused(&table("x,mean,deviation,n\n0.01,NaN,0.1,3\n"), &table_at, "no finite number");
    refused(&table("x,mean,deviation\n0.01,1,0.1\n"), &table_at, "no column `n`");
    refused(&table("x,mean,deviation,n\n0.09,1,0.1,3\n"), &table_at, "ends at 0.06");
    refused(&set(format!("{CURVE}/y"), json!("force")), &format!("{CURVE}/y"), "stress");
    refused(&set("/tests/1/measured".to_owned(), json!({})), "/tests/1/measured", "nothing was measured");
}

#[test]
fn contradictory_numbers_are_refused() {
    const MEASURED: &str = "/tests/1/measured";
    let angle = |more: Value| {
        move |document: &mut Value| {
            let angle = document.pointer_mut(&format!("{MEASURED}/responses/0")).unwrap();
            angle.as_object_mut().unwrap().extend(more.as_object().unwrap().clone());
        }
    };
    let at = |name: &str| format!("{MEASURED}/responses/0{name}");
    refused(&angle(json!({"mean": 26.0})), &at("/mean"), "left out beside `values`");
    refused(&angle(json!({"deviation": 2.0})), &at("/deviation"), "left out beside several");
    refused(&angle(json!({"values": []})), &at("/values"), "at least one");
    refused(&angle(json!({"values": [24.0]})), &at("/deviation"), "a single value");
    refused(&angle(json!({"values": null, "n": 3, "deviation": 1.0})), &at("/mean"), "is missing");
    let share = json!({"response": "slid", "unit": null, "values": [0.0, 4.0]});
    refused(&angle(share), &at("/mean"), "0 to 100 %");
    let twice = |document: &mut Value| {
        let responses =
            document.pointer_mut(&format!("{MEASURED}/responses")).unwrap().as_array_mut().unwrap();
        responses.push(responses[0].clone());
    };
    refused(&twice, &format!("{MEASURED}/responses/1"), "measured twice");
    let both = |document: &mut Value| {
        let point = json!({"x": 0.01, "mean": 1.0, "deviation": 0.1, "n": 3});
        document["tests"][0]["measured"]["curves"][0]["points"] = json!([point]);
    };
    refused(&both, "/tests/0/measured/curves/0", "either `points` or `table`");
    let long = |document: &mut Value| {
        document["tests"][0]["conditions"] = json!({"a".repeat(257): "dry"});
    };
    refused(&long, "/tests/0/conditions", "256");
    refused(&|document| document["schema"] = json!("roost.measurements/2"), "/schema", "unknown schema");
}
