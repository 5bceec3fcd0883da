//! Promises of the reader of scenarios: defaults, every fault at once, never a panic.

mod cad;
mod faults;
mod mutation;
mod reading;
mod table;

use serde_json::{Value, json};

use super::fields::{EXPERIMENTS, FIELDS, experiments_of};
use super::{Fault, Scenario, from_value};

/// The shortest scenario, read.
fn minimal() -> Scenario {
    from_value(&json!({"experiment": "hopper"})).expect("the minimal scenario is sound")
}

/// The same, every default written out.
fn full() -> Value {
    serde_json::to_value(minimal()).unwrap()
}

/// A sound document of every experiment, all written out, with an item in each list.
fn every_experiment() -> Vec<Value> {
    let document = |short: Value| {
        let scenario = from_value(&short).unwrap_or_else(|found| panic!("{short}: {found:?}"));
        serde_json::to_value(scenario).unwrap()
    };
    let surface = json!([{"name": "ramp", "plate_m": [[0, 0, 0], [1, 0, 0], [0, 1, 0]]}]);
    let mut documents = vec![
        document(json!({"experiment": "hopper", "equipment": {"surfaces": surface}})),
        document(json!({"experiment": "scene",
            "scene": {"bodies": [{"position_m": [0, 0, 1]}], "surfaces": surface}})),
    ];
    for name in EXPERIMENTS.iter().filter(|name| !["hopper", "scene"].contains(name)) {
        documents.push(document(json!({"experiment": name})));
    }
    documents
}

/// The documents of the experiments that take the field or section of this pointer, with its pointer there.
fn documents_with(pointer: &str) -> Vec<(Value, String)> {
    let lists = ["/equipment/surfaces", "/scene/surfaces"];
    let places = match pointer.strip_prefix("/scene/surfaces/*") {
        Some(rest) => lists.iter().map(|list| format!("{list}/0{rest}")).collect(),
        None => vec![pointer.replace("/*", "/0")],
    };
    let documents = every_experiment();
    let field = FIELDS.iter().find(|field| field.pointer == pointer);
    let takes = |document: &&Value| {
        field.is_none_or(|field| experiments_of(field).iter().any(|name| document["experiment"] == *name))
    };
    let found = documents.iter().filter(takes).flat_map(|document| {
        let there = places.iter().filter(|place| document.pointer(place).is_some());
        there.map(|place| {
            let mut document = document.clone();
            let of_motion = place.strip_suffix("/velocity_m_s").or(place.strip_suffix("/spin_deg_s"));
            if let Some(surface) = of_motion.filter(|item| item.contains("surfaces")) {
                // A fixed surface has neither.
                document.pointer_mut(surface).unwrap()["motion"] = json!("moving");
            }
            (document, place.clone())
        })
    });
    found.collect()
}

/// The full document with one value replaced.
fn with(pointer: &str, value: Value) -> Value {
    let mut document = full();
    *document.pointer_mut(pointer).unwrap_or_else(|| panic!("no {pointer}")) = value;
    document
}

/// The faults of a document that must have some.
fn faults(document: &Value) -> Vec<Fault> {
    from_value(document).expect_err("the document is at fault")
}

fn pointers(faults: &[Fault]) -> Vec<&str> {
    faults.iter().map(|fault| fault.pointer.as_str()).collect()
}
