//! The field table in two other forms: JSON Schema for programs, a Markdown table for people.

use std::fmt::Write;

use serde_json::{Map, Value, json};

use super::SCHEMA;
use super::field::{Field, Kind, MAX_SIZES, Preset, Range, plain};
use super::fields::{FIELDS, SECTIONS};

/// The JSON Schema (2020-12) of a scenario.
pub fn json_schema() -> Value {
    let mut root = object("", "The complete input of one simulation, in SI units; t = 0 is belt start.");
    root["$schema"] = json!("https://json-schema.org/draft/2020-12/schema");
    root["title"] = json!(SCHEMA);
    root["required"] = FIELDS
        .iter()
        .filter(|field| field.default == Preset::Required)
        .map(Field::name)
        .collect::<Vec<_>>()
        .into();
    root
}

/// The schema of the section at `section`, its own sections within.
fn object(section: &str, doc: &str) -> Value {
    let inside = |pointer: &str| pointer.rsplit_once('/').is_some_and(|(parent, _)| parent == section);
    let name = |pointer: &str| pointer.rsplit('/').next().unwrap_or_default().to_owned();
    let mut properties = Map::new();
    for field in FIELDS.iter().filter(|field| inside(field.pointer)) {
        properties.insert(field.name().to_owned(), property(field));
    }
    for (pointer, doc) in SECTIONS.iter().filter(|(pointer, _)| inside(pointer)) {
        properties.insert(name(pointer), object(pointer, doc));
    }
    json!({"type": "object", "description": doc, "additionalProperties": false, "properties": properties})
}

fn property(field: &Field) -> Value {
    let mut property = match field.kind {
        Kind::Number(range) => bounded("number", range),
        Kind::Integer(range) => bounded("integer", range),
        Kind::Nullable(range) => bounded(["number", "null"], range),
        // "auto" alone passes the pattern; bounds bind numbers only.
        Kind::NumberOrAuto(range) => {
            let mut property = bounded(["number", "string"], range);
            property["pattern"] = json!("^auto$");
            property
        }
        Kind::Choice([only]) => json!({"type": "string", "const": only}),
        Kind::Choice(words) => json!({"type": "string", "enum": words}),
        Kind::Flag => json!({"type": "boolean"}),
        Kind::Sizes(range) => {
            let size =
                json!({"type": "array", "minItems": 3, "maxItems": 3, "items": bounded("number", range)});
            json!({"type": "array", "minItems": 1, "maxItems": MAX_SIZES, "items": size})
        }
    };
    property["title"] = json!(field.title());
    property["description"] = json!(description(field));
    if let Some(default) = field.default.value() {
        property["default"] = default;
    }
    property
}

/// A property of the given type within a range.
fn bounded(kind: impl Into<Value>, range: Range) -> Value {
    let low = if range.low_open { "exclusiveMinimum" } else { "minimum" };
    let high = if range.high_open { "exclusiveMaximum" } else { "maximum" };
    json!({"type": kind.into(), low: exact(range.low), high: exact(range.high)})
}

/// A whole number is written as one.
fn exact(number: f64) -> Value {
    if number.fract() == 0.0 && number.abs() < 1e16 { json!(number as i64) } else { json!(number) }
}

/// Sentence, unit, source, and the defaults that are not plain values.
fn description(field: &Field) -> String {
    let mut text = field.doc.to_owned();
    if !field.unit.is_empty() {
        let _ = write!(text, " Unit: {}.", field.unit);
    }
    if let Preset::SameAs(other) = field.default {
        let _ = write!(text, " Default: that of {other}.");
    }
    if let Some(wet) = field.wet.and_then(|wet| wet.value()) {
        let _ = write!(text, " Default when wet: {wet}.");
    }
    let _ = write!(text, " Source: {}.", field.source);
    text
}

/// The field table as Markdown: pointer, default, unit, range, source, meaning.
pub fn field_table_markdown() -> String {
    let mut table = "| field | default | allowed | source | meaning |\n|---|---|---|---|---|\n".to_owned();
    for field in FIELDS {
        let default = match field.default {
            Preset::Required => "(required)".to_owned(),
            Preset::SameAs(other) => format!("as `{other}`"),
            Preset::Number(number) => format!("`{}` {}", plain(number), field.unit).trim_end().to_owned(),
            preset => format!("`{}`", preset.value().unwrap_or_default()),
        };
        let wet = field.wet.and_then(|wet| wet.value()).map_or(String::new(), |wet| format!("; wet `{wet}`"));
        let cells = [
            format!("`{}`", field.pointer),
            format!("{default}{wet}"),
            field.allowed(),
            field.source.to_owned(),
            field.doc.to_owned(),
        ];
        let _ = writeln!(table, "| {} |", cells.map(|cell| cell.replace('|', "\\|")).join(" | "));
    }
    table
}
