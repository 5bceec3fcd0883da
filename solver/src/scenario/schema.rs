//! The field table in two other forms: JSON Schema for programs, a Markdown table for people.

use std::fmt::Write;

use serde_json::{Map, Value, json};

use super::SCHEMA;
use super::field::{Field, Kind, LONGEST_TEXT, MAX_ITEMS, MAX_SIZES, Preset, Range, plain};
use super::fields::{FIELDS, SECTIONS};

/// The JSON Schema (2020-12) of a scenario.
pub fn json_schema() -> Value {
    let mut root = object("", "The complete input of one simulation, in SI units; t = 0 is belt start.");
    root["$schema"] = json!("https://json-schema.org/draft/2020-12/schema");
    root["title"] = json!(SCHEMA);
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
    for section in SECTIONS.iter().filter(|section| inside(section.pointer)) {
        let doc = match section.only_in {
            Some(only) => format!("{} Only in the experiment `{only}`.", section.doc),
            None => section.doc.to_owned(),
        };
        let schema = match section.items {
            None => object(section.pointer, &doc),
            Some(items) => {
                let items = object(items, "");
                json!({"type": "array", "description": doc, "maxItems": MAX_ITEMS, "items": items})
            }
        };
        properties.insert(name(section.pointer), schema);
    }
    let required: Vec<&str> = FIELDS
        .iter()
        .filter(|field| inside(field.pointer) && field.default == Preset::Required)
        .map(Field::name)
        .collect();
    let mut object = json!({"type": "object", "description": doc, "additionalProperties": false, "properties": properties});
    if !required.is_empty() {
        object["required"] = json!(required);
    }
    object
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
        Kind::NullableInteger(range) => bounded(["integer", "null"], range),
        Kind::Text => json!({"type": "string", "minLength": 1, "maxLength": LONGEST_TEXT}),
        Kind::Vector(range) => triple("number", range),
        Kind::Counts(range) => triple("integer", range),
        Kind::Sizes(range) => {
            let size = triple("number", range);
            json!({"type": "array", "minItems": 1, "maxItems": MAX_SIZES, "items": size})
        }
        Kind::Plate(range) => {
            let edge = triple("number", range);
            json!({"type": ["array", "null"], "minItems": 3, "maxItems": 3, "items": edge})
        }
        Kind::Mesh => json!({
            "type": ["object", "null"],
            "required": ["digest", "units"],
            "additionalProperties": false,
            "properties": {
                "digest": {"type": "string", "pattern": "^[0-9a-f]{64}$"},
                "units": {"type": "string", "enum": ["mm", "m"]},
            },
        }),
    };
    property["title"] = json!(field.title());
    property["description"] = json!(description(field));
    if let Some(default) = field.default.value() {
        property["default"] = default;
    }
    property
}

/// Three of the given type within a range.
fn triple(kind: &str, range: Range) -> Value {
    json!({"type": "array", "minItems": 3, "maxItems": 3, "items": bounded(kind, range)})
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
    for (experiment, preset) in field.elsewhere {
        let _ = write!(text, " Default in `{experiment}`: {}.", preset.value().unwrap_or_default());
    }
    if !field.unused_in.is_empty() {
        let _ = write!(text, " Not in {}.", quoted(field.unused_in));
    }
    let _ = write!(text, " Source: {}.", field.source);
    text
}

fn quoted(words: &[&str]) -> String {
    words.iter().map(|word| format!("`{word}`")).collect::<Vec<_>>().join(", ")
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
        let mut other =
            field.wet.and_then(|wet| wet.value()).map_or(String::new(), |wet| format!("; wet `{wet}`"));
        for (experiment, preset) in field.elsewhere {
            let _ = write!(other, "; in {experiment} `{}`", preset.value().unwrap_or_default());
        }
        let unused = match field.unused_in {
            [] => String::new(),
            unused => format!(" Not in {}.", quoted(unused)),
        };
        let cells = [
            format!("`{}`", field.pointer),
            format!("{default}{other}"),
            field.allowed(),
            field.source.to_owned(),
            format!("{}{unused}", field.doc),
        ];
        let _ = writeln!(table, "| {} |", cells.map(|cell| cell.replace('|', "\\|")).join(" | "));
    }
    table
}
