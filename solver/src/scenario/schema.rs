//! The field table in two other forms: JSON Schema for programs, Markdown tables for people.

use std::fmt::Write;

use serde_json::{Map, Value, json};

use super::SCHEMA;
use super::field::{Field, FieldKind, LONGEST_TEXT, MAX_SIZES, Preset, Range, Section, plain};
use super::fields::{FIELDS, SECTIONS, declaration, experiments_of};
use super::sections::DECLARATIONS;
use super::sections::Declaration;

/// The annotation that lists the experiments of a section or a field. Without it, all experiments have it.
const EXPERIMENTS_KEY: &str = "x-experiments";

/// The annotation with the unit of a field. Fields without a unit have none.
const UNIT_KEY: &str = "x-unit";

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
        let doc = match section.experiment {
            Some(only) => format!("{} Only in `{only}`.", section.doc),
            None => section.doc.to_owned(),
        };
        let schema = match section.items {
            None => object(section.pointer, &doc),
            Some(items) => {
                let items = object(items, "");
                json!({"type": "array", "description": doc, "maxItems": section.max_items, "items": items})
            }
        };
        properties.insert(name(section.pointer), schema);
        if let Some(only) = section.experiment {
            properties[&name(section.pointer)][EXPERIMENTS_KEY] = json!([only]);
        }
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
        FieldKind::Number(range) => bounded("number", range),
        FieldKind::Integer(range) => bounded("integer", range),
        FieldKind::Nullable(range) => bounded(["number", "null"], range),
        // "auto" alone passes the pattern; bounds bind numbers only.
        FieldKind::NumberOrAuto(range) => {
            let mut property = bounded(["number", "string"], range);
            property["pattern"] = json!("^auto$");
            property
        }
        FieldKind::Choice([only]) => json!({"type": "string", "const": only}),
        FieldKind::Choice(words) => json!({"type": "string", "enum": words}),
        FieldKind::Flag => json!({"type": "boolean"}),
        FieldKind::NullableInteger(range) => bounded(["integer", "null"], range),
        FieldKind::Text => json!({"type": "string", "minLength": 1, "maxLength": LONGEST_TEXT}),
        FieldKind::Vector(range) => triple("number", range),
        FieldKind::Counts(range) => triple("integer", range),
        FieldKind::Sizes(range) => {
            let size = triple("number", range);
            json!({"type": "array", "minItems": 1, "maxItems": MAX_SIZES, "items": size})
        }
        FieldKind::Plate(range) => {
            let edge = triple("number", range);
            json!({"type": ["array", "null"], "minItems": 3, "maxItems": 3, "items": edge})
        }
        FieldKind::Mesh => json!({
            "type": ["object", "null"],
            "required": ["digest", "units"],
            "additionalProperties": false,
            "properties": {
                "digest": {"type": "string", "pattern": "^[0-9a-f]{64}$"},
                "units": {"type": "string", "enum": ["mm", "m"]},
            },
        }),
    };
    if field.by_name {
        property[EXPERIMENTS_KEY] = json!(experiments_of(field));
    }
    if !field.unit.is_empty() {
        property[UNIT_KEY] = json!(field.unit);
    }
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
    for declaration in DECLARATIONS {
        for (_, preset) in declaration.defaults.iter().filter(|(pointer, _)| *pointer == field.pointer) {
            let default = preset.value().unwrap_or_default();
            let _ = write!(text, " Default in `{}`: {default}.", declaration.name);
        }
    }
    if field.by_name {
        let _ = write!(text, " Only in {}.", quoted(&experiments_of(field)));
    }
    let _ = write!(text, " Source: {}.", field.source);
    text
}

fn quoted(words: &[&str]) -> String {
    words.iter().map(|word| format!("`{word}`")).collect::<Vec<_>>().join(", ")
}

/// The fields of one experiment as Markdown: a heading for each section, and a table of its fields with default, allowed values,
/// source and meaning.
pub fn field_tables_markdown(experiment: &str) -> String {
    let mut sections: Vec<(String, String)> = Vec::new();
    let Some(declaration) = declaration(experiment) else { return String::new() };
    for field in FIELDS.iter().filter(|field| declaration.takes(field)) {
        let Some(pointer) = pointer_in(experiment, field.pointer) else { continue };
        let (section, name) = pointer.rsplit_once('/').unwrap_or_default();
        let at = sections.iter().position(|(known, _)| known == section).unwrap_or_else(|| {
            sections.push((section.to_owned(), String::new()));
            sections.len() - 1
        });
        let _ = writeln!(sections[at].1, "{}", row(declaration, name, field));
    }
    let mut page = String::new();
    for (section, rows) in sections {
        let in_table = |known: &&Section| known.pointer == section.trim_end_matches("/*");
        let (title, doc) = match SECTIONS.iter().find(in_table) {
            Some(known) => (section.as_str(), known.doc),
            None => ("The document", "These fields are at the top level of the document."),
        };
        let head = "| field | default | allowed | source | meaning |\n|---|---|---|---|---|";
        let _ = writeln!(page, "### {title}\n\n{doc}\n\n{head}\n{rows}");
    }
    page
}

/// The row of a field in the table of its section.
fn row(declaration: &Declaration, name: &str, field: &Field) -> String {
    let default = match declaration.default_of(field) {
        Preset::Required => "(required)".to_owned(),
        Preset::SameAs(other) => format!("as `{other}`"),
        Preset::Number(number) => format!("`{}` {}", plain(number), field.unit).trim_end().to_owned(),
        preset => format!("`{}`", preset.value().unwrap_or_default()),
    };
    let wet = field.wet.and_then(|wet| wet.value()).map_or(String::new(), |wet| format!("; wet `{wet}`"));
    let cells = [
        format!("`{name}`"),
        format!("{default}{wet}"),
        field.allowed(),
        field.source.to_owned(),
        field.doc.to_owned(),
    ];
    format!("| {} |", cells.map(|cell| cell.replace('|', "\\|")).join(" | "))
}

/// The pointer under which the documents of an experiment write a field; none if the field's section belongs to another one.
fn pointer_in(experiment: &str, pointer: &str) -> Option<String> {
    let rest_after = |prefix: &str| pointer.strip_prefix(prefix).filter(|rest| rest.starts_with('/'));
    let belongs = |section: &Section| section.experiment.is_none_or(|only| only == experiment);
    let mut lists =
        SECTIONS.iter().filter_map(|section| Some((section, rest_after(section.items?)?))).peekable();
    if lists.peek().is_some() {
        return lists
            .find(|(section, _)| belongs(section))
            .map(|(section, rest)| format!("{}/*{rest}", section.pointer));
    }
    let mut sections = SECTIONS.iter().filter(|section| rest_after(section.pointer).is_some());
    sections.all(belongs).then(|| pointer.to_owned())
}
