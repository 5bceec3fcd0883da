//! The pointers of factors: fields of the scenario, each varied by only one factor.

use roost_api::Fault;
use roost_api::design::Factor;
use roost_solver::scenario;
use serde_json::{Value, json};

use super::pointer as pointers;
use crate::document::fault;

/// Checks the pointers of all factors. Whether their fields exist is checked where the complete base is known.
pub(super) fn check(factors: &[Factor], complete: Option<&Value>, faults: &mut Vec<Fault>) {
    let mut earlier: Vec<(usize, &str)> = Vec::new();
    for (index, factor) in factors.iter().enumerate() {
        let at = format!("/factors/{index}");
        match (&factor.pointer, &factor.pointers) {
            (Some(_), Some(linked)) => {
                let allowed = "`pointer` for one field, or `pointers` for several that take the same value";
                faults.push(fault(
                    &format!("{at}/pointers"),
                    json!(linked),
                    "there is a `pointer` already",
                    allowed,
                ));
            }
            (None, None) => {
                faults.push(fault(
                    &format!("{at}/pointer"),
                    Value::Null,
                    "a factor needs a field to vary",
                    EXAMPLE,
                ));
            }
            (None, Some(linked)) if linked.is_empty() => {
                faults.push(fault(
                    &format!("{at}/pointers"),
                    json!([]),
                    "a factor needs a field to vary",
                    EXAMPLE,
                ));
            }
            _ => {}
        }
        let one = factor.pointer.iter().map(|pointer| (format!("{at}/pointer"), pointer));
        let linked = factor.pointers.iter().flatten().enumerate();
        let linked = linked.map(|(place, pointer)| (format!("{at}/pointers/{place}"), pointer));
        for (at, pointer) in one.chain(linked) {
            field(&at, pointer, complete, faults);
            let same = |(_, other): &&(usize, &str)| {
                pointers::segments(other).is_some() && pointers::overlap(other, pointer)
            };
            if let Some((other, _)) = earlier.iter().find(same) {
                faults.push(fault(&at, json!(pointer), &format!("factor {other} varies the same field"), ""));
            }
            earlier.push((index, pointer));
        }
    }
}

const EXAMPLE: &str = "a JSON pointer into the scenario, such as /equipment/gate_opening_m";

fn field(at: &str, pointer: &str, complete: Option<&Value>, faults: &mut Vec<Fault>) {
    if pointers::segments(pointer).is_none() {
        faults.push(fault(at, json!(pointer), "not a JSON pointer", EXAMPLE));
    } else if pointer == "/seed" || pointer == "/schema" {
        let detail = format!("`{pointer}` cannot be a factor; use `replicates` for more seeds");
        faults.push(fault(at, json!(pointer), &detail, ""));
    } else if complete.is_some_and(|complete| complete.pointer(pointer).is_none()) {
        let hint = scenario::nearest(pointer).map(|nearest| with_indices(nearest, pointer));
        let hint = match hint {
            // Another experiment has it.
            Some(nearest) if nearest == pointer => String::new(),
            Some(nearest) => format!(": did you mean {nearest}?"),
            None => String::new(),
        };
        faults.push(fault(at, json!(pointer), &format!("the scenario has no such field{hint}"), ""));
    }
}

/// A pointer of the field table with the list indices of the pointer that was asked for.
fn with_indices(nearest: &str, asked: &str) -> String {
    let mut indices = asked.split('/').filter(|segment| segment.parse::<usize>().is_ok());
    let segments = nearest.split('/').map(|segment| match segment {
        "*" => indices.next().unwrap_or("0"),
        name => name,
    });
    segments.collect::<Vec<_>>().join("/")
}
