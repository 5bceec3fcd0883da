//! Limits of what is stored beside the scenario: labels and names.
//!
//! They are measured in bytes, since what they bound is what is kept and shown again and again.

use std::collections::BTreeMap;

use roost_api::Fault;
use roost_api::job::{MAX_LABELS, MAX_NAME_BYTES};
use roost_solver::scenario::escape;
use serde_json::json;

use super::fault;

/// Labels too long that are listed one by one: a document with more is another kind of document.
const MAX_LISTED: usize = 20;

/// Labels that are too many or too long. A key that is too long makes no pointer: it is named as a value at `/labels`.
pub(crate) fn label_faults(labels: &BTreeMap<String, String>) -> Vec<Fault> {
    let mut faults = Vec::new();
    if labels.len() > MAX_LABELS {
        let allowed = format!("at most {MAX_LABELS}");
        faults.push(fault("/labels", json!(labels.len()), "too many labels", &allowed));
    }
    let keys = labels.keys().filter_map(|key| too_long("/labels", "key", key));
    let values = labels.iter().filter(|(key, _)| key.len() <= MAX_NAME_BYTES);
    let values =
        values.filter_map(|(key, value)| too_long(&format!("/labels/{}", escape(key)), "value", value));
    faults.extend(keys.take(MAX_LISTED));
    faults.extend(values.take(MAX_LISTED));
    faults
}

/// A name that is too long.
pub(crate) fn name_fault(pointer: &str, name: &str) -> Option<Fault> {
    too_long(pointer, "name", name)
}

fn too_long(pointer: &str, what: &str, text: &str) -> Option<Fault> {
    let detail = || format!("a {what} of {} bytes", text.len());
    let allowed = || format!("at most {MAX_NAME_BYTES} bytes");
    (text.len() > MAX_NAME_BYTES).then(|| fault(pointer, json!(text), &detail(), &allowed()))
}
