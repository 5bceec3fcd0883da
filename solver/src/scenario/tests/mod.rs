//! What the reader of scenarios promises: defaults, every fault at once, never a panic.

mod faults;
mod mutation;
mod reading;
mod table;

use serde_json::{Value, json};

use super::{Fault, Scenario, from_value};

/// The shortest scenario, read.
fn minimal() -> Scenario {
    from_value(&json!({"experiment": "hopper"})).expect("the minimal scenario is sound")
}

/// The same, every default written out.
fn full() -> Value {
    serde_json::to_value(minimal()).unwrap()
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
