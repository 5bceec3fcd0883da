//! Canonical JSON (RFC 8785): names sorted, numbers as ECMAScript writes them, no spaces.
//!
//! serde_json keeps the fields of a `Value` sorted, and writes text as the RFC wants it; numbers alone differ. A serialiser that
//! sorts as it writes (serde_json_canonicalizer, which the test holds this against) reads every name back and keeps every field
//! apart, and a server works out a digest for every job and every result.

use std::io;

use serde::Serialize;
use serde_json::Value;
use serde_json::ser::{Formatter, Serializer};

/// The canonical JSON of a value whose names are of the basic multilingual plane: others would be sorted otherwise.
///
/// # Errors
/// A value that JSON cannot hold, such as a map whose keys are no text.
pub(super) fn canonical(value: &impl Serialize) -> serde_json::Result<Vec<u8>> {
    let mut text = Vec::with_capacity(4096);
    let sorted: Value = serde_json::to_value(value)?;
    sorted.serialize(&mut Serializer::with_formatter(&mut text, Numbers))?;
    Ok(text)
}

/// Writes every number as the shortest double.
struct Numbers;

impl Formatter for Numbers {
    fn write_f64<W: ?Sized + io::Write>(&mut self, writer: &mut W, value: f64) -> io::Result<()> {
        writer.write_all(ryu_js::Buffer::new().format_finite(value).as_bytes())
    }

    fn write_u64<W: ?Sized + io::Write>(&mut self, writer: &mut W, value: u64) -> io::Result<()> {
        self.write_f64(writer, value as f64)
    }

    fn write_i64<W: ?Sized + io::Write>(&mut self, writer: &mut W, value: i64) -> io::Result<()> {
        self.write_f64(writer, value as f64)
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn canonical_json_matches_the_reference_implementation() {
        let examples = [
            json!({"b": [1, 2.0, -0.0, 1e21, 1e-7, 0.1, 333333333.3333333, 9007199254740991_u64, u64::MAX, i64::MIN], "a": null}),
            json!({"quote\"": "back\\slash \n\t\u{8}\u{1f}/\u{7f} é 中 \u{1f600}", "é": {}, "z": [], "A": true}),
            json!({"schema": 1, "schema2": 0, "sche": {"y": 1, "x": [{"d": 1, "c": 2}]}}),
        ];
        for example in &examples {
            assert_eq!(text(canonical(example)), text(serde_json_canonicalizer::to_vec(example)));
        }
        for experiment in ["hopper", "drop", "bend", "slide", "compress"] {
            let scenario =
                crate::scenario::from_value(&json!({"experiment": experiment, "seed": 9007199254740991_u64}));
            let scenario = scenario.unwrap();
            assert_eq!(text(canonical(&scenario)), text(serde_json_canonicalizer::to_vec(&scenario)));
        }
        assert_eq!(text(canonical(&json!({"b": 1.0, "a": 10_u64}))), r#"{"a":10,"b":1}"#);
    }

    fn text(bytes: serde_json::Result<Vec<u8>>) -> String {
        String::from_utf8(bytes.unwrap()).unwrap()
    }
}
