//! Limits of labels and names, in bytes: they bound the size of stored rows and of answers.

use std::collections::BTreeMap;

use roost_api::Fault;
use roost_api::job::{MAX_LABELS, MAX_NAME_BYTES};
use roost_solver::scenario::escape;
use serde_json::json;

use super::fault;

/// Maximum number of faults for long keys, and for long values.
const MAX_LISTED: usize = 20;

/// Faults of labels that are too many or too long.
pub(crate) fn label_faults(labels: &BTreeMap<String, String>) -> Vec<Fault> {
    label_faults_at("/labels", "labels", labels)
}

/// The same of texts by name at another place. The fault of a long key points at `at`.
pub(crate) fn label_faults_at(at: &str, noun: &str, labels: &BTreeMap<String, String>) -> Vec<Fault> {
    let mut faults = Vec::new();
    if labels.len() > MAX_LABELS {
        let allowed = format!("at most {MAX_LABELS}");
        faults.push(fault(at, json!(labels.len()), &format!("too many {noun}"), &allowed));
    }
    let keys = labels.keys().filter_map(|key| too_long(at, "key", key));
    let values = labels.iter().filter(|(key, _)| key.len() <= MAX_NAME_BYTES);
    let values = values.filter_map(|(key, value)| too_long(&format!("{at}/{}", escape(key)), "value", value));
    faults.extend(keys.take(MAX_LISTED));
    faults.extend(values.take(MAX_LISTED));
    faults
}

/// The fault of a name that is too long.
pub(crate) fn name_fault(pointer: &str, name: &str) -> Option<Fault> {
    too_long(pointer, "name", name)
}

fn too_long(pointer: &str, noun: &str, text: &str) -> Option<Fault> {
    let detail = || format!("the {noun} has {} bytes", text.len());
    let allowed = || format!("at most {MAX_NAME_BYTES} bytes");
    (text.len() > MAX_NAME_BYTES).then(|| fault(pointer, json!(text), &detail(), &allowed()))
}
