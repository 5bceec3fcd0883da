//! The error of serde as a fault, in the words of the other faults.

use roost_api::Fault;
use roost_solver::scenario::{escape, must_be, unknown_field};
use serde_json::Value;
use serde_path_to_error::{Path, Segment};

/// The fault of a document that serde cannot read.
pub(super) fn serde_fault(document: &Value, error: &serde_path_to_error::Error<serde_json::Error>) -> Fault {
    let message = error.inner().to_string();
    let parent = pointer(error.path());
    // serde writes names in backticks: the first is the field or the word, the others are its choices.
    let names: Vec<&str> = message.split('`').skip(1).step_by(2).collect();
    let (name, choices) = names.split_first().map_or(("", &[][..]), |(name, choices)| (*name, choices));
    let field = format!("/{}", escape(name));
    let at_field = if parent.ends_with(&field) { parent.clone() } else { format!("{parent}{field}") };
    let value = |at: &str| document.pointer(at).unwrap_or(&Value::Null);
    if message.starts_with("missing field") {
        return Fault::new(&at_field, &Value::Null, "is missing".to_owned(), None);
    }
    if message.starts_with("unknown field") {
        return unknown_field(&at_field, value(&at_field), None, choices);
    }
    let (detail, allowed) = if message.starts_with("unknown variant") {
        ("is not among the choices".to_owned(), Some(choices.join(", ")))
    } else if let Some(noun) = message.split_once("expected ").and_then(|(_, kind)| noun(kind)) {
        (must_be(noun, value(&parent)), Some(noun.to_owned()))
    } else {
        ("cannot be read".to_owned(), None)
    };
    Fault::new(&parent, value(&parent), detail, allowed)
}

/// The JSON type of a Rust type that serde expects.
fn noun(kind: &str) -> Option<&'static str> {
    Some(match kind.split([' ', ',']).next()? {
        "f64" | "f32" => "a number",
        "u8" | "u16" | "u32" | "u64" | "usize" | "i32" | "i64" => "a whole number",
        "struct" | "map" | "internally" | "adjacently" => "an object",
        "a" if kind.starts_with("a string") => "a string",
        "a" if kind.starts_with("a boolean") => "true or false",
        "a" if kind.starts_with("a sequence") => "a list",
        "a" if kind.starts_with("a map") => "an object",
        _ => return None,
    })
}

fn pointer(path: &Path) -> String {
    path.iter()
        .map(|segment| match segment {
            Segment::Seq { index } => format!("/{index}"),
            Segment::Map { key } => format!("/{}", escape(key)),
            Segment::Enum { .. } | Segment::Unknown => String::new(),
        })
        .collect()
}
