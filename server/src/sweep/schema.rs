//! The JSON Schema of a sweep: the schema of its types, with the schema of scenarios for the base.

use roost_api::sweep::{SCHEMA, SweepSpec};
use roost_solver::scenario;
use serde_json::{Map, Value, json};
use utoipa::{PartialSchema, ToSchema};

/// The JSON Schema (2020-12) of a sweep.
pub(crate) fn json_schema() -> Value {
    let mut parts = Vec::new();
    SweepSpec::schemas(&mut parts);
    let mut definitions: Map<String, Value> =
        parts.into_iter().map(|(name, part)| (name, json!(part))).collect();
    let mut base = scenario::json_schema();
    if let Some(fields) = base.as_object_mut() {
        fields.remove("$schema");
    }
    definitions.insert("Scenario".to_owned(), base);
    let mut root = json!(SweepSpec::schema());
    root["$schema"] = json!("https://json-schema.org/draft/2020-12/schema");
    root["title"] = json!(SCHEMA);
    root["properties"]["schema"] = json!({"const": SCHEMA, "description": "May be left out."});
    root["properties"]["base"] = json!({"$ref": "#/$defs/Scenario"});
    root["$defs"] = Value::Object(definitions);
    relocate(&mut root);
    root
}

/// Rewrites references to definitions within the document.
fn relocate(value: &mut Value) {
    match value {
        Value::Object(fields) => {
            if let Some(Value::String(reference)) = fields.get_mut("$ref") {
                *reference = reference.replace("#/components/schemas/", "#/$defs/");
            }
            fields.values_mut().for_each(relocate);
        }
        Value::Array(items) => items.iter_mut().for_each(relocate),
        _ => {}
    }
}
