//! One fault as serde found it, and the same in words that know nothing of Rust.

use roost_api::Fault;
use roost_solver::scenario::escape;
use serde_json::Value;
use serde_path_to_error::{Path, Segment};

/// The one fault that serde names.
pub(super) struct Found {
    pub(super) pointer: String,
    pub(super) missing: bool,
    /// The words that may stand there, where serde lists them.
    pub(super) words: Option<Vec<String>>,
    unknown: Option<String>,
    message: String,
}

impl Found {
    pub(super) fn new(error: &serde_path_to_error::Error<serde_json::Error>) -> Self {
        let text = error.inner().to_string();
        // serde_json appends a place that counts within a value, not within the body.
        let message = text.split(" at line ").next().unwrap_or(&text).to_owned();
        let mut pointer = pointer(error.path());
        let unknown = quoted(&message, "unknown field `").map(str::to_owned);
        let missing = quoted(&message, "missing field `").map(str::to_owned);
        let words = quoted(&message, "unknown variant `").map(|_| listed(&message));
        if let Some(name) = unknown.as_ref().or(missing.as_ref()) {
            let inner = format!("/{}", escape(name));
            if !pointer.ends_with(&inner) {
                pointer.push_str(&inner);
            }
        }
        Self { pointer, missing: missing.is_some(), words, unknown, message }
    }

    /// Whether one of some words belongs here and something else stands here.
    pub(super) fn is_word(&self) -> bool {
        self.message.ends_with("expected string or map")
    }

    /// The fault in words.
    pub(super) fn fault(&self, value: Value, words: Option<Vec<String>>) -> Fault {
        let (detail, allowed) = if let Some(name) = &self.unknown {
            let known = listed(&self.message);
            let hint = nearest(name, &known).map(|near| format!(": did you mean `{near}`?"));
            let allowed = (!known.is_empty()).then(|| known.join(", "));
            (format!("there is no such field{}", hint.unwrap_or_default()), allowed)
        } else if self.missing {
            ("this field is required".to_owned(), None)
        } else if let Some(words) = words {
            let detail = match value {
                Value::String(_) => "no such choice".to_owned(),
                _ => format!("{} cannot stand here", kind(&value)),
            };
            (detail, Some(words.join(", ")))
        } else if let Some((found, expected)) = self.message.split_once(", expected ") {
            let detail = match found.starts_with("invalid value: integer") {
                true => "out of range".to_owned(),
                false => format!("{} cannot stand here", kind(&value)),
            };
            (detail, Some(in_words(expected)))
        } else if self.message.starts_with("UUID") {
            ("not an identifier".to_owned(), Some("a UUID".to_owned()))
        } else {
            (self.message.clone(), None)
        };
        Fault::new(&self.pointer, &value, detail, allowed)
    }
}

/// What a JSON value is.
pub(super) fn kind(value: &Value) -> &'static str {
    match value {
        Value::Null => "null",
        Value::Bool(_) => "true or false",
        Value::Number(number) if number.is_f64() => "a number with a fraction",
        Value::Number(_) => "a number",
        Value::String(_) => "a text",
        Value::Array(_) => "a list",
        Value::Object(_) => "an object",
    }
}

/// What serde expects, for people.
fn in_words(expected: &str) -> String {
    match expected {
        "i32" => format!("a whole number from {} to {}", i32::MIN, i32::MAX),
        "u32" => format!("a whole number from 0 to {}", u32::MAX),
        "i64" | "i128" => "a whole number".to_owned(),
        "u64" | "u128" | "usize" => "a whole number, 0 or more".to_owned(),
        "f32" | "f64" => "a number".to_owned(),
        "a string" | "string" => "a text".to_owned(),
        "a boolean" => "true or false".to_owned(),
        "a sequence" => "a list".to_owned(),
        "a formatted UUID string" => "a UUID".to_owned(),
        // Maps, structs and enums with fields.
        other if ["map", "struct", "enum"].iter().any(|word| other.contains(word)) => "an object".to_owned(),
        other => other.to_owned(),
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

fn quoted<'a>(message: &'a str, prefix: &str) -> Option<&'a str> {
    message.strip_prefix(prefix)?.split('`').next()
}

/// The names that a message lists after the one it complains of.
fn listed(message: &str) -> Vec<String> {
    message.split('`').skip(3).step_by(2).map(str::to_owned).collect()
}

/// The known name that is most like another, if one is.
fn nearest<'a>(name: &str, known: &'a [String]) -> Option<&'a String> {
    let likeness = |other: &String| strsim::jaro_winkler(name, other);
    let best = known.iter().max_by(|one, other| likeness(one).total_cmp(&likeness(other)))?;
    (likeness(best) > 0.75).then_some(best)
}
