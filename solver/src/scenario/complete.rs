//! From what an author wrote to the complete document: the walk over the field table that lists every fault
//! and fills the defaults in.

use serde_json::{Map, Value};

use super::Fault;
use super::field::{Field, Kind, MAX_SIZES, Preset};
use super::fields::{FIELDS, SECTIONS};
use super::names::{escape, names_in, nearest};
use super::relations;

/// Unknown names told one by one in each section; the rest is told as a number, so that an answer stays of
/// the order of the document that caused it.
const MAX_UNKNOWN: usize = 50;

/// The document with every default written out.
pub(super) fn complete(document: &Value) -> Result<Value, Vec<Fault>> {
    let mut faults = Vec::new();
    let Some(root) = document.as_object() else {
        return Err(vec![Fault::new("", document, must_be("an object", document), None)]);
    };
    check_names("", root, &mut faults);
    for (pointer, _) in SECTIONS {
        match document.pointer(pointer) {
            None => {}
            Some(Value::Object(section)) => check_names(pointer, section, &mut faults),
            Some(other) => faults.push(Fault::new(pointer, other, must_be("an object", other), None)),
        }
    }
    let completed = fill(document, &mut faults);
    relations::check(document, &completed, &mut faults);
    if faults.is_empty() { Ok(completed) } else { Err(faults) }
}

/// Finds the names that no field bears.
fn check_names(section: &str, object: &Map<String, Value>, faults: &mut Vec<Fault>) {
    let known = names_in(section);
    let mut unknown = object.iter().filter(|(name, _)| !known.contains(&name.as_str()));
    for (name, value) in unknown.by_ref().take(MAX_UNKNOWN) {
        let pointer = format!("{section}/{}", escape(name));
        let allowed = match nearest(&pointer) {
            Some(near) => format!("did you mean {near}?"),
            None => format!("known here: {}", known.join(", ")),
        };
        faults.push(Fault::new(&pointer, value, "is not a known field".to_owned(), Some(allowed)));
    }
    let rest = unknown.count();
    if rest > 0 {
        faults.push(Fault::new(section, &Value::Null, format!("has {rest} more unknown fields"), None));
    }
}

/// Every field that is sound: as written, or by its default. What is at fault stays out.
fn fill(document: &Value, faults: &mut Vec<Fault>) -> Value {
    let mut completed = Value::Object(Map::new());
    for field in FIELDS {
        match document.pointer(field.pointer) {
            Some(written) => match accept(field, written, faults) {
                Some(value) => put(&mut completed, field.pointer, value),
                None => continue,
            },
            None if field.default == Preset::Required => {
                let detail = "is missing, and is the one field that must be there".to_owned();
                faults.push(Fault::new(field.pointer, &Value::Null, detail, Some(field.allowed())));
            }
            None => {
                if let Some(value) = default(field, &completed) {
                    put(&mut completed, field.pointer, value);
                }
            }
        }
    }
    completed
}

/// What a silent author gets; none when the field it follows is at fault.
fn default(field: &Field, completed: &Value) -> Option<Value> {
    let given = |pointer: &str| completed.pointer(pointer).is_some_and(|value| !value.is_null());
    let wet = completed.pointer("/contact/condition").is_some_and(|condition| condition == "wet");
    if field.yields_to.is_some_and(given) {
        return Some(Value::Null);
    }
    match field.wet.filter(|_| wet).unwrap_or(field.default) {
        Preset::SameAs(other) => completed.pointer(other).cloned(),
        preset => preset.value(),
    }
}

/// The written value in the form the typed scenario reads, or its faults.
fn accept(field: &Field, written: &Value, faults: &mut Vec<Fault>) -> Option<Value> {
    let mut refuse = |detail: String| {
        faults.push(Fault::new(field.pointer, written, detail, Some(field.allowed())));
        None
    };
    match (field.kind, written) {
        (Kind::Nullable(_), Value::Null) => Some(Value::Null),
        (Kind::NumberOrAuto(_), Value::String(word)) if word == "auto" => Some(written.clone()),
        (
            Kind::Number(range) | Kind::Nullable(range) | Kind::NumberOrAuto(range) | Kind::Integer(range),
            Value::Number(number),
        ) => {
            let number = number.as_f64().unwrap_or(f64::NAN);
            if !range.contains(number) {
                refuse("is out of range".to_owned())
            } else if !matches!(field.kind, Kind::Integer(_)) {
                Some(Value::from(number))
            } else if number.fract() != 0.0 {
                refuse("must be a whole number".to_owned())
            } else {
                // Exact: the range of every integer field ends below 2^53.
                Some(Value::from(number as u64))
            }
        }
        (Kind::Choice(words), Value::String(word)) if words.contains(&word.as_str()) => Some(written.clone()),
        (Kind::Choice(_), Value::String(_)) => refuse("is not among the choices".to_owned()),
        (Kind::Flag, Value::Bool(_)) => Some(written.clone()),
        (Kind::Sizes(_), Value::Array(sizes)) if (1..=MAX_SIZES).contains(&sizes.len()) => {
            accept_sizes(field, sizes, faults)
        }
        (Kind::Sizes(_), Value::Array(_)) => refuse("has the wrong number of sizes".to_owned()),
        (Kind::Sizes(_), _) => refuse(must_be("a list", written)),
        (Kind::Choice(_), _) => refuse(must_be("a string", written)),
        (Kind::Flag, _) => refuse(must_be("true or false", written)),
        _ => refuse(must_be("a number", written)),
    }
}

/// Every size is three numbers in the range.
fn accept_sizes(field: &Field, sizes: &[Value], faults: &mut Vec<Fault>) -> Option<Value> {
    let before = faults.len();
    let mut refuse = |pointer: String, value: &Value, detail: String| {
        faults.push(Fault::new(&pointer, value, detail, Some(field.allowed())));
    };
    let Kind::Sizes(range) = field.kind else { return None };
    for (index, size) in sizes.iter().enumerate() {
        let pointer = format!("{}/{index}", field.pointer);
        match size.as_array().map(Vec::as_slice) {
            Some(edges @ [_, _, _]) => {
                for (axis, edge) in edges.iter().enumerate() {
                    match edge.as_f64() {
                        Some(edge) if range.contains(edge) => {}
                        Some(_) => refuse(format!("{pointer}/{axis}"), edge, "is out of range".to_owned()),
                        None => refuse(format!("{pointer}/{axis}"), edge, must_be("a number", edge)),
                    }
                }
            }
            _ => refuse(pointer, size, "must be a list of length, width and thickness".to_owned()),
        }
    }
    (faults.len() == before).then(|| Value::from(sizes.to_vec()))
}

/// Puts a value into the document, making the sections on the way.
fn put(document: &mut Value, pointer: &str, value: Value) {
    let mut place = document;
    for name in pointer.split('/').skip(1) {
        place = &mut place[name];
    }
    *place = value;
}

fn must_be(wanted: &str, found: &Value) -> String {
    let found = match found {
        Value::Null => "null",
        Value::Bool(_) => "true or false",
        Value::Number(_) => "a number",
        Value::String(_) => "a string",
        Value::Array(_) => "a list",
        Value::Object(_) => "an object",
    };
    format!("must be {wanted}, not {found}")
}
