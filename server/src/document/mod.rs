//! Reading documents: giving JSON its shape, with every fault found at once. Pure.
//!
//! serde stops at the first fault. Here the value at fault is taken out, or something acceptable is put in its
//! place, and the rest is tried again, until what is left has no more to say. `found` says one fault in words.

mod found;
mod limits;
#[cfg(test)]
mod tests;

use roost_api::Fault;
use roost_api::job::JobEnvelope;
use roost_solver::Limits;
use roost_solver::mesh::Meshes;
use roost_solver::scenario::{self, Scenario};
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::{Value, json};

use crate::mesh;
use found::{Found, kind};
pub(crate) use limits::{label_faults, name_fault};

/// A document with more faults than this is another kind of document.
const MAX_FAULTS: usize = 50;

/// Reads a document, or lists its faults.
pub(crate) fn read_document<T: DeserializeOwned + Serialize>(value: Value) -> Result<T, Vec<Fault>> {
    match read_leniently(value) {
        (Some(document), faults) if faults.is_empty() => Ok(document),
        (_, faults) => Err(faults),
    }
}

/// Lists the faults of a document and reads it all the same, with something acceptable where they are, so that
/// what else is wrong with it can be told as well.
pub(crate) fn read_leniently<T: DeserializeOwned + Serialize>(mut value: Value) -> (Option<T>, Vec<Fault>) {
    if !value.is_object() {
        let detail = format!("{} is no document", kind(&value));
        return (None, vec![fault("", value, &detail, "an object")]);
    }
    let mut faults: Vec<Fault> = Vec::new();
    // A repair may show a fault inside itself: more turns than faults.
    for _ in 0..4 * MAX_FAULTS {
        let found = match read::<T>(&value) {
            Ok(document) => {
                let complete = serde_json::to_value(&document).unwrap_or_default();
                lists_for_objects("", &value, &complete, &mut faults);
                return (Some(document), faults);
            }
            Err(found) => found,
        };
        // What is wrong with a repair is no news.
        if !faults.iter().any(|fault| inside(&found.pointer, &fault.pointer)) {
            let there = value.pointer(&found.pointer).cloned().unwrap_or_default();
            let words =
                found.words.clone().or_else(|| found.is_word().then(|| words_at::<T>(&value, &found))?);
            faults.push(found.fault(there, words));
        }
        let repaired = if found.missing || in_list(&value, &found.pointer) {
            stand_in::<T>(&mut value, &found.pointer)
        } else {
            remove(&mut value, &found.pointer)
        };
        if !repaired || faults.len() >= MAX_FAULTS {
            break;
        }
    }
    (None, faults)
}

fn read<T: DeserializeOwned>(value: &Value) -> Result<T, Found> {
    serde_path_to_error::deserialize(value).map_err(|error| Found::new(&error))
}

/// serde takes a list for an object, its items in the order of the fields; nobody means that.
fn lists_for_objects(at: &str, submitted: &Value, complete: &Value, faults: &mut Vec<Fault>) {
    match (submitted, complete) {
        (Value::Array(_), Value::Object(_)) => {
            faults.push(fault(at, submitted.clone(), "a list cannot stand here", "an object"));
        }
        (Value::Object(fields), Value::Object(all)) => {
            for (name, value) in fields {
                let at = format!("{at}/{}", scenario::escape(name));
                lists_for_objects(&at, value, all.get(name).unwrap_or(&Value::Null), faults);
            }
        }
        (Value::Array(items), Value::Array(all)) => {
            for (index, (item, read)) in
                items.iter().zip(all).enumerate().filter(|(_, (item, _))| !item.is_number())
            {
                lists_for_objects(&format!("{at}/{index}"), item, read, faults);
            }
        }
        _ => {}
    }
}

/// Puts something acceptable at a pointer, if there is such a thing.
fn stand_in<T: DeserializeOwned>(value: &mut Value, pointer: &str) -> bool {
    let id = "00000000-0000-0000-0000-000000000000";
    // From the last to the first: an object before a list, which would pass for one.
    let mut candidates = vec![json!(id), json!([]), json!({}), json!(0), json!(""), json!(null)];
    while let Some(candidate) = candidates.pop() {
        if !put(value, pointer, candidate) {
            return false;
        }
        let Err(found) = read::<T>(value) else { return true };
        if !inside(&found.pointer, pointer) {
            return true;
        }
        if found.missing && found.pointer != pointer && stand_in::<T>(value, &found.pointer) {
            return true;
        }
        candidates.extend(found.words.and_then(|words| words.first().map(|word| json!(word))));
    }
    false
}

/// The words that may stand at the place of a fault.
fn words_at<T: DeserializeOwned>(value: &Value, found: &Found) -> Option<Vec<String>> {
    let mut value = value.clone();
    put(&mut value, &found.pointer, json!(""));
    read::<T>(&value).err()?.words
}

/// Whether `pointer` is `place` or lies inside it.
pub(crate) fn inside(pointer: &str, place: &str) -> bool {
    pointer.strip_prefix(place).is_some_and(|rest| rest.is_empty() || rest.starts_with('/'))
}

fn in_list(value: &Value, pointer: &str) -> bool {
    pointer.rsplit_once('/').and_then(|(parent, _)| value.pointer(parent)).is_some_and(Value::is_array)
}

fn put(value: &mut Value, pointer: &str, new: Value) -> bool {
    let Some((parent, last)) = pointer.rsplit_once('/') else { return false };
    match value.pointer_mut(parent) {
        Some(Value::Object(fields)) => {
            fields.insert(unescaped(last), new);
            true
        }
        Some(Value::Array(items)) => match last.parse().ok().and_then(|index: usize| items.get_mut(index)) {
            Some(item) => {
                *item = new;
                true
            }
            None => false,
        },
        _ => false,
    }
}

/// Takes the value at a pointer out of the object around it.
fn remove(value: &mut Value, pointer: &str) -> bool {
    let Some((parent, last)) = pointer.rsplit_once('/') else { return false };
    let fields = value.pointer_mut(parent).and_then(Value::as_object_mut);
    fields.is_some_and(|fields| fields.remove(&unescaped(last)).is_some())
}

fn unescaped(segment: &str) -> String {
    segment.replace("~1", "/").replace("~0", "~")
}

/// Reads an envelope and the scenario in it: the faults of both, at once.
pub(crate) fn read_envelope(
    meshes: &Meshes,
    limits: &Limits,
    document: Value,
) -> Result<(JobEnvelope, Scenario), Vec<Fault>> {
    let scenario = document.get("scenario").map(|submitted| {
        scenario::from_value(submitted)
            .and_then(|scenario| mesh::check(&scenario, meshes, limits).map(|_| scenario))
            .map_err(|faults| prefixed("/scenario", faults))
    });
    let (envelope, mut faults) = read_leniently::<JobEnvelope>(document);
    if let Some(envelope) = &envelope {
        faults.extend(running_faults(envelope.max_wall_s, envelope.frame_interval_s));
        faults.extend(label_faults(&envelope.labels));
        faults.extend(envelope.needs.backend.iter().filter_map(|name| name_fault("/needs/backend", name)));
    }
    match (envelope, scenario) {
        (Some(envelope), Some(Ok(scenario))) if faults.is_empty() => Ok((envelope, scenario)),
        (_, scenario) => {
            faults.extend(scenario.and_then(Result::err).unwrap_or_default());
            Err(faults)
        }
    }
}

/// Puts a prefix before the pointer of each fault.
pub(crate) fn prefixed(prefix: &str, faults: Vec<Fault>) -> Vec<Fault> {
    let within = |fault: Fault| Fault { pointer: format!("{prefix}{}", fault.pointer), ..fault };
    faults.into_iter().map(within).collect()
}

/// A fault of our own finding; a long value is cut short.
pub(crate) fn fault(pointer: &str, value: Value, detail: &str, allowed: &str) -> Fault {
    let allowed = Some(allowed.to_owned()).filter(|allowed| !allowed.is_empty());
    Fault::new(pointer, &value, detail.to_owned(), allowed)
}

/// Faults of what jobs and sweeps share.
pub(crate) fn running_faults(max_wall_s: Option<f64>, frame_interval_s: Option<f64>) -> Vec<Fault> {
    let times = [
        ("/max_wall_s", max_wall_s, "not a time to run for"),
        ("/frame_interval_s", frame_interval_s, "not a time from frame to frame"),
    ];
    let wrong = |(at, seconds, detail): (&str, Option<f64>, &str)| {
        let seconds = seconds.filter(|seconds| *seconds <= 0.0)?;
        Some(fault(at, json!(seconds), detail, "more than 0 s, or null"))
    };
    times.into_iter().filter_map(wrong).collect()
}
