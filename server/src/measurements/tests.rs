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
    refused(&angle(share), &at("/values/1"), "0 or 1");
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

/// The faults of the sound document with another first response, or with other members of its curve.
fn faults_with(part: &str, members: Value) -> Vec<Fault> {
    let mut document = sound();
    let measured = &mut document["tests"][0]["measured"];
    match part {
        "response" => measured["responses"][0] = members,
        _ => measured["curves"][0].as_object_mut().unwrap().extend(members.as_object().unwrap().clone()),
    }
    read_all(document).expect_err(part)
}

/// Asserts that the only fault has this place within the first test, and this value.
fn shows(faults: &[Fault], place: &str, value: Value) {
    let [fault] = faults else { panic!("{place}: {faults:#?}") };
    assert_eq!((&fault.pointer, &fault.value), (&format!("/tests/0/measured/{place}"), &value), "{fault}");
}

#[test]
fn measured_yes_or_no_responses_must_be_0_or_1() {
    let with = |members: Value| {
        let mut document = sound();
        let mut slid = json!({"response": "slid"});
        slid.as_object_mut().unwrap().extend(members.as_object().unwrap().clone());
        document["tests"][1]["measured"]["responses"][0] = slid;
        read_all(document)
    };
    let found = |members: Value| {
        let faults = with(members).expect_err("a share");
        faults.into_iter().map(|fault| (fault.pointer, fault.value)).collect::<Vec<_>>()
    };
    let at = |name: &str| format!("/tests/1/measured/responses/0/{name}");
    // The mean of both is 1.
    assert_eq!(
        found(json!({"values": [3.0, -1.0]})),
        [(at("values/0"), json!(3.0)), (at("values/1"), json!(-1.0))]
    );
    assert_eq!(
        found(json!({"unit": "%", "mean": 150.0, "deviation": 1.0, "n": 3})),
        [(at("mean"), json!(150.0))]
    );
    for members in [json!({"values": [0.0, 1.0]}), json!({"unit": "%", "values": [0.0, 100.0]})] {
        assert_eq!(with(members).unwrap().tests[1].targets[0].mean, 0.5);
    }
}

#[test]
fn numbers_that_overflow_are_refused_as_written() {
    let modulus = |more: Value| {
        let mut response = json!({"response": "modulus_pa", "unit": "kPa"});
        response.as_object_mut().unwrap().extend(more.as_object().unwrap().clone());
        faults_with("response", response)
    };
    let at = |name: &str| format!("responses/0/{name}");
    shows(&modulus(json!({"mean": 1e308, "deviation": 1.0, "n": 3})), &at("mean"), json!(1e308));
    shows(&modulus(json!({"mean": 1.0, "deviation": 1e308, "n": 3})), &at("deviation"), json!(1e308));
    shows(&modulus(json!({"values": [1.0], "deviation": 1e308})), &at("deviation"), json!(1e308));
    shows(&modulus(json!({"values": [1e308], "deviation": 1.0})), &at("values/0"), json!(1e308));
    // The sum overflows, and the square of the deviation.
    shows(&modulus(json!({"unit": "Pa", "values": [1e308, 1.1e308]})), &at("values/1"), json!(1.1e308));
    shows(&modulus(json!({"unit": "Pa", "values": [1.0, -1e200, 2.0]})), &at("values/1"), json!(-1e200));
    let point = |x: f64, mean: f64, deviation: f64| {
        let points = json!([{"x": x, "mean": mean, "deviation": deviation, "n": 3}]);
        faults_with("curve", json!({"table": null, "points": points}))
    };
    let at = |name: &str| format!("curves/0/points/0/{name}");
    shows(&point(0.01, 1e308, 1.0), &at("mean"), json!(1e308));
    shows(&point(0.01, 1.0, 1e308), &at("deviation"), json!(1e308));
    let series =
        outputs(&scenario::from_value(&json!({"experiment": "slide"})).unwrap().experiment).series[0];
    let points = json!([{"x": 1e308, "mean": 1.0, "deviation": 1.0, "n": 3}]);
    let mut document = sound();
    document["tests"][1]["measured"]["curves"] =
        json!([{"x": "time", "x_unit": "min", "y": series.name, "y_unit": series.unit, "points": points}]);
    let faults = read_all(document).expect_err("x");
    assert_eq!(faults.len(), 1, "{faults:#?}");
    assert_eq!(
        (faults[0].pointer.as_str(), &faults[0].value),
        ("/tests/1/measured/curves/0/points/0/x", &json!(1e308))
    );
}

#[test]
fn curves_lie_within_the_simulated_test() {
    let table = |text: &str| faults_with("curve", json!({"table": text}));
    let before = table("x,mean,deviation,n\n-0.01,1,0.1,3\n0.01,1,0.1,3\n");
    shows(&before, "curves/0/table", json!(-0.01));
    assert!(before[0].to_string().contains("0 to 0.06"), "{}", before[0]);
    let after = table("x,mean,deviation,n\n0,1,0.1,3\n0.09,1,0.1,3\n");
    shows(&after, "curves/0/table", json!(0.09));
    // 35 % is the end exactly.
    let mut document = sound();
    let test = &mut document["tests"][0];
    test["scenario"]["compress"] = json!({"max_strain": 0.35});
    let curve = &mut test["measured"]["curves"][0];
    curve["x_unit"] = json!("%");
    curve["table"] = json!("x,mean,deviation,n\n0,0,0,3\n35,1,0.1,3\n");
    let lab = read_all(document).unwrap();
    assert_eq!(lab.tests[0].targets[2].observable.to_string(), "stress_pa@strain=0.35");
}

#[test]
fn spoilt_tables_have_few_faults_with_their_lines() {
    let table = |text: &str| faults_with("curve", json!({"table": text}));
    let spoilt = "0.01,much,0.1,3\n".repeat(5000);
    assert_eq!(table(&format!("x,mean,deviation,n\n{spoilt}")).len(), MAX_FAULTS);
    // Each is found after reading.
    let backwards: String = (0..1000).map(|row| format!("{},1,,3\n", 0.05 - f64::from(row) * 1e-5)).collect();
    assert_eq!(table(&format!("x,mean,deviation,n\n{backwards}")).len(), MAX_FAULTS);
    let long: String = (0..5000).map(|row| format!("{},1,0.1,3\n", f64::from(row) * 1e-5)).collect();
    let long = table(&format!("x,mean,deviation,n\n{long}"));
    shows(&long, "curves/0/table", json!("more than 1000"));
    for breaks in ["\n", "\r\n", "\r"] {
        let lines = ["\u{feff}x,mean,deviation,n", "0.01,1,0.1,3", "", "0.02,1,3", "0.03,so,0.1,3"];
        let found = table(&lines.join(breaks));
        assert_eq!(found.len(), 2, "{breaks:?}: {found:#?}");
        assert_eq!(found[0].value, json!("0.02,1,3"), "{breaks:?}");
        assert!(found[0].to_string().contains("line 4: 3 cells in place of 4"), "{breaks:?}: {}", found[0]);
        assert!(found[1].to_string().contains("line 5, column `mean`"), "{breaks:?}: {}", found[1]);
    }
    for text in ["", "0.01,0.1,0.02,3\n0.03,0.4,0.05,3\n"] {
        let found = table(text);
        assert!(found.len() == 1 && found[0].to_string().contains("no headings"), "{found:#?}");
    }
}
