//! Faults of a question.

use serde::Serialize;
use serde_json::Value;

/// A fault of a question: field, value, reason and allowed values.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Fault {
    /// JSON pointer of the field.
    pub pointer: String,
    /// The value that was given; null when it is missing.
    pub value: Value,
    /// The fault, in words.
    pub detail: String,
    /// Allowed values.
    pub allowed: String,
}

/// A fault; `value` must be representable as JSON.
pub(crate) fn fault(pointer: &str, value: impl Serialize, detail: &str, allowed: &str) -> Fault {
    Fault {
        pointer: pointer.to_owned(),
        value: serde_json::to_value(value).unwrap_or_default(),
        detail: detail.to_owned(),
        allowed: allowed.to_owned(),
    }
}
