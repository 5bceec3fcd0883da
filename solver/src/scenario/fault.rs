//! Faults of a document, each with pointer, value, reason and allowed values.

use serde::{Deserialize, Serialize};
use serde_json::Value;

/// A fault of a document.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Fault {
    /// JSON pointer (RFC 6901) of the field at fault.
    pub pointer: String,
    /// The value found there; null when it is missing.
    pub value: Value,
    /// The fault, in words.
    pub detail: String,
    /// The allowed values: a range with its unit, or the choices.
    pub allowed: Option<String>,
}

impl std::fmt::Display for Fault {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}: {}", self.pointer, self.detail)?;
        // A missing field has no value, and the detail names a null.
        if !self.value.is_null() {
            write!(f, " (found {})", self.value)?;
        }
        match &self.allowed {
            Some(allowed) => write!(f, "; allowed: {allowed}"),
            None => Ok(()),
        }
    }
}

/// Maximum number of characters of JSON that a fault repeats.
const MAX_SHOWN: usize = 200;

impl Fault {
    /// A fault of the field at `pointer` with the allowed values.
    pub fn at(
        pointer: &str,
        value: impl Into<Value>,
        detail: impl Into<String>,
        allowed: impl Into<String>,
    ) -> Self {
        Self::new(pointer, &value.into(), detail.into(), Some(allowed.into()))
    }

    /// A fault of the field at `pointer`; a long value is cut short.
    pub fn new(pointer: &str, value: &Value, detail: String, allowed: Option<String>) -> Self {
        let text = value.to_string();
        let value = match text.char_indices().nth(MAX_SHOWN) {
            None => value.clone(),
            Some((end, _)) => Value::from(format!("{}…", &text[..end])),
        };
        Self { pointer: pointer.to_owned(), value, detail, allowed }
    }
}

/// The fault of a field that the schema does not have; `nearest` is the field that its author may have meant.
pub fn unknown_field(pointer: &str, value: &Value, nearest: Option<&str>, known: &[&str]) -> Fault {
    let (detail, allowed) = match nearest {
        Some(nearest) => (format!("is not a known field: did you mean {nearest}?"), None),
        None => ("is not a known field".to_owned(), Some(known.join(", "))),
    };
    Fault::new(pointer, value, detail, allowed)
}

/// The detail of a value of the wrong type.
pub fn must_be(wanted: &str, found: &Value) -> String {
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

/// The reason why a text is no scenario.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ScenarioError {
    /// Not JSON at all.
    #[error("line {line}, column {column}: {message}")]
    Syntax {
        /// Line, from 1.
        line: usize,
        /// Column, from 1.
        column: usize,
        /// The message of the parser.
        message: String,
    },
    /// JSON, but not a scenario that can run: every fault found.
    #[error("{} fault(s) in the scenario", .0.len())]
    Faults(Vec<Fault>),
}
