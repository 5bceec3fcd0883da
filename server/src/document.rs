//! Reading documents: giving JSON its shape, with every fault found at once. Pure.
//!
//! serde stops at the first fault. Here the value at fault is taken out and the rest is tried again, until
//! what is left has no more to say.

use roost_api::Fault;
use roost_api::job::JobEnvelope;
use roost_solver::Limits;
use roost_solver::scenario::{self, Scenario, escape};
use serde::de::DeserializeOwned;
use serde_json::{Value, json};
use serde_path_to_error::{Path, Segment};

/// A document with more faults than this is another kind of document.
const MAX_FAULTS: usize = 50;

/// What can stand where a required field is missing, so that the rest can be looked at.
const STAND_INS: [&str; 5] = ["null", "\"\"", "0", "[]", "\"00000000-0000-0000-0000-000000000000\""];

/// Reads a document, or lists its faults.
pub(crate) fn read_document<T: DeserializeOwned>(mut value: Value) -> Result<T, Vec<Fault>> {
    let mut faults: Vec<Fault> = Vec::new();
    loop {
        let found = match serde_path_to_error::deserialize::<_, T>(&value) {
            Ok(document) if faults.is_empty() => return Ok(document),
            Ok(_) => return Err(faults),
            Err(error) => Found::new(&error),
        };
        let told = faults.iter().any(|fault| fault.pointer == found.pointer);
        let goes_on = if found.missing {
            stand_in::<T>(&mut value, &found.pointer)
        } else {
            let there = value.pointer(&found.pointer).cloned().unwrap_or(Value::Null);
            faults.push(Fault { value: there, ..found.fault() });
            remove(&mut value, &found.pointer)
        };
        // A field that was taken out is missing from then on, which is no news.
        if found.missing && !told {
            faults.push(found.fault());
        }
        if !goes_on || faults.len() >= MAX_FAULTS {
            return Err(faults);
        }
    }
}

/// The one fault that serde names.
struct Found {
    pointer: String,
    message: String,
    missing: bool,
    unknown: Option<String>,
}

impl Found {
    fn new(error: &serde_path_to_error::Error<serde_json::Error>) -> Self {
        let message = plain(&error.inner().to_string());
        let mut pointer = pointer(error.path());
        let unknown = quoted(&message, "unknown field `").map(str::to_owned);
        let missing = quoted(&message, "missing field `").map(str::to_owned);
        if let Some(name) = unknown.as_ref().or(missing.as_ref()) {
            let inner = format!("/{}", escape(name));
            if !pointer.ends_with(&inner) {
                pointer.push_str(&inner);
            }
        }
        Self { pointer, message, missing: missing.is_some(), unknown }
    }

    fn fault(&self) -> Fault {
        let detail = match (&self.unknown, self.missing) {
            (Some(_), _) => "there is no such field".to_owned(),
            (None, true) => "this field is required".to_owned(),
            (None, false) => self.message.clone(),
        };
        let allowed = self.unknown.as_ref().and_then(|name| nearest(name, &self.message));
        Fault { pointer: self.pointer.clone(), value: Value::Null, detail, allowed }
    }
}

/// Puts something acceptable where a field is missing, if there is such a thing.
fn stand_in<T: DeserializeOwned>(value: &mut Value, pointer: &str) -> bool {
    for text in STAND_INS {
        let Some((parent, last)) = pointer.rsplit_once('/') else { return false };
        let Some(Value::Object(fields)) = value.pointer_mut(parent) else { return false };
        fields.insert(last.to_owned(), serde_json::from_str(text).unwrap_or_default());
        match serde_path_to_error::deserialize::<_, T>(&*value) {
            Err(error) if Found::new(&error).pointer.starts_with(pointer) => {}
            Ok(_) | Err(_) => return true,
        }
    }
    false
}

/// Reads an envelope and the scenario in it: the faults of both, at once.
pub(crate) fn read_envelope(limits: &Limits, document: Value) -> Result<(JobEnvelope, Scenario), Vec<Fault>> {
    let scenario = document.get("scenario").map(|submitted| {
        scenario::from_value(submitted)
            .and_then(|scenario| roost_solver::check(&scenario, limits).map(|_| scenario))
            .map_err(|faults| prefixed("/scenario", faults))
    });
    let envelope = read_document::<JobEnvelope>(document).and_then(|envelope| {
        match wall_time_fault(envelope.max_wall_s) {
            Some(fault) => Err(vec![fault]),
            None => Ok(envelope),
        }
    });
    match (envelope, scenario) {
        (Ok(envelope), Some(Ok(scenario))) => Ok((envelope, scenario)),
        (envelope, scenario) => {
            let mut faults = envelope.err().unwrap_or_default();
            faults.extend(scenario.and_then(Result::err).unwrap_or_default());
            Err(faults)
        }
    }
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

/// The message without the place that serde_json appends: it counts within a value, not within the body.
fn plain(message: &str) -> String {
    message.split(" at line ").next().unwrap_or(message).to_owned()
}

fn quoted<'a>(message: &'a str, prefix: &str) -> Option<&'a str> {
    message.strip_prefix(prefix)?.split('`').next()
}

/// The field names that the message lists, nearest first in a hint.
fn nearest(name: &str, message: &str) -> Option<String> {
    let known: Vec<&str> = message.split('`').skip(3).step_by(2).collect();
    let best = known
        .iter()
        .max_by(|one, other| strsim::jaro_winkler(name, one).total_cmp(&strsim::jaro_winkler(name, other)))?;
    match strsim::jaro_winkler(name, best) > 0.75 {
        true => Some(format!("did you mean `{best}`? known: {}", known.join(", "))),
        false => Some(format!("known: {}", known.join(", "))),
    }
}

/// Takes the value at a pointer out of the document, so that the rest can be looked at.
fn remove(value: &mut Value, pointer: &str) -> bool {
    let Some((parent, last)) = pointer.rsplit_once('/') else { return false };
    match value.pointer_mut(parent) {
        Some(Value::Object(fields)) => {
            let name = last.replace("~1", "/").replace("~0", "~");
            fields.remove(&name).is_some()
        }
        // Taking it out would renumber those after it.
        Some(Value::Array(_)) | Some(_) | None => false,
    }
}

/// Puts a prefix before the pointer of each fault.
pub(crate) fn prefixed(prefix: &str, faults: Vec<Fault>) -> Vec<Fault> {
    let within = |fault: Fault| Fault { pointer: format!("{prefix}{}", fault.pointer), ..fault };
    faults.into_iter().map(within).collect()
}

/// A fault of our own finding.
pub(crate) fn fault(pointer: &str, value: Value, detail: &str, allowed: &str) -> Fault {
    let allowed = Some(allowed.to_owned()).filter(|allowed| !allowed.is_empty());
    Fault { pointer: pointer.to_owned(), value, detail: detail.to_owned(), allowed }
}

/// Faults of what jobs and sweeps share.
pub(crate) fn wall_time_fault(max_wall_s: Option<f64>) -> Option<Fault> {
    let seconds = max_wall_s.filter(|seconds| *seconds <= 0.0)?;
    Some(fault("/max_wall_s", json!(seconds), "not a time to run for", "more than 0 s, or null"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn faults(document: Value) -> Vec<Fault> {
        read_document::<JobEnvelope>(document).expect_err("a faulty document")
    }

    #[test]
    fn every_fault_of_an_envelope_is_told_with_its_pointer() {
        let found = faults(json!({"scenario": {}, "priority": "high", "lables": {}, "needs": {"gpu": 1}}));
        let mut pointers: Vec<_> = found.iter().map(|fault| fault.pointer.as_str()).collect();
        pointers.sort_unstable();
        assert_eq!(pointers, ["/lables", "/needs/gpu", "/priority"]);
        let label = found.iter().find(|fault| fault.pointer == "/lables").unwrap();
        assert!(label.allowed.as_ref().unwrap().contains("did you mean `labels`"), "{label:?}");
        let priority = found.iter().find(|fault| fault.pointer == "/priority").unwrap();
        assert_eq!(priority.value, json!("high"));
    }

    #[test]
    fn a_missing_field_is_told_and_not_invented() {
        let found = faults(json!({"priority": 1}));
        assert_eq!(found.len(), 1);
        assert_eq!(found[0].pointer, "/scenario");
        let found = faults(json!({"priority": "high", "needs": 3}));
        let mut pointers: Vec<_> = found.iter().map(|fault| fault.pointer.as_str()).collect();
        pointers.sort_unstable();
        assert_eq!(pointers, ["/needs", "/priority", "/scenario"]);
        let found = faults(json!([]));
        assert_eq!(found.len(), 1, "{found:?}");
    }

    #[test]
    fn a_sound_envelope_is_read() {
        let envelope: JobEnvelope = read_document(json!({"scenario": {"seed": 3}})).unwrap();
        assert_eq!(envelope.scenario, json!({"seed": 3}));
    }
}
