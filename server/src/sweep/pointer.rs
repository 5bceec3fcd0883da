//! JSON pointers of factors: their segments, and setting a level at a pointer.
//!
//! Levels go into the scenario *as submitted*, before defaults are filled in: `/contact/condition` chooses
//! defaults, and must do so at every level. Objects and lists on the way that the submitted document leaves out are
//! made as they are in the complete scenario.

use serde_json::{Map, Value};

pub(super) use crate::document::is_within;

/// The segments of a JSON pointer, unescaped; `None` unless it starts with `/`.
pub(super) fn segments(pointer: &str) -> Option<Vec<String>> {
    let rest = pointer.strip_prefix('/')?;
    Some(rest.split('/').map(|segment| segment.replace("~1", "/").replace("~0", "~")).collect())
}

/// Whether two pointers name the same field or one lies inside the other.
pub(super) fn overlap(one: &str, other: &str) -> bool {
    is_within(one, other) || is_within(other, one)
}

/// Sets the field at `pointer` of `submitted`, which exists in `complete`, to `level`.
pub(super) fn set(submitted: &mut Value, complete: &Value, pointer: &str, level: &Value) {
    let Some(segments) = segments(pointer) else { return };
    let mut target = submitted;
    let mut model = Some(complete);
    for segment in &segments {
        // An object left out is made empty, so that its other defaults still follow the rest of the document; an
        // array has no such defaults and is made whole.
        if target.is_null() {
            *target = match model {
                Some(Value::Array(_)) => model.cloned().unwrap_or_default(),
                _ => Value::Object(Map::new()),
            };
        }
        model = model.and_then(|model| child(model, segment));
        target = match target {
            Value::Object(fields) => fields.entry(segment.clone()).or_insert(Value::Null),
            Value::Array(items) => match segment.parse::<usize>().ok().and_then(|i| items.get_mut(i)) {
                Some(item) => item,
                None => return,
            },
            _ => return,
        };
    }
    *target = level.clone();
}

fn child<'a>(value: &'a Value, segment: &str) -> Option<&'a Value> {
    match value {
        Value::Object(fields) => fields.get(segment),
        Value::Array(items) => items.get(segment.parse::<usize>().ok()?),
        _ => None,
    }
}
