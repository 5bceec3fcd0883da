//! Documents of an earlier schema, brought to the present one without a change of meaning.

use std::borrow::Cow;

use serde_json::{Value, json};

use super::SCHEMA;
use super::fields::find;

/// The earlier schema that is still read. Its bonds have the same stiffness per area at any sub-particle radius.
const SCHEMA_1: &str = "roost.scenario/1";

/// The document in the present schema. A value that the document states stays.
pub(super) fn upgraded(document: &Value) -> Cow<'_, Value> {
    if document.get("schema").is_none_or(|schema| schema != SCHEMA_1) {
        return Cow::Borrowed(document);
    }
    let mut document = document.clone();
    document["schema"] = json!(SCHEMA);
    let bonds = document.as_object_mut().map(|root| root.entry("bonds").or_insert_with(|| json!({})));
    // A section that is no object is reported by the walk over the field table.
    if let Some(bonds) = bonds.and_then(Value::as_object_mut) {
        bonds.entry("reference_radius_m").or_insert(Value::Null);
    }
    declare_opening(&mut document);
    Cow::Owned(document)
}

/// A hopper from CAD had its belt capacity from `gate_opening_m`, `hopper_width_m` and `belt_speed_m_s`. Opening and width are
/// now declared as such; the speed is that of the belt's surface.
fn declare_opening(document: &mut Value) {
    let equipment = document.get_mut("equipment").and_then(Value::as_object_mut);
    let Some(equipment) = equipment.filter(|equipment| equipment.get("parametric") == Some(&json!(false)))
    else {
        return;
    };
    let width = equipment.get("hopper_width_m").cloned();
    let width = width.or_else(|| find("/equipment/hopper_width_m")?.default.value());
    if let Some(height) = equipment.get("gate_opening_m").filter(|height| height.is_number()).cloned() {
        equipment.entry("opening_height_m").or_insert(height);
        equipment.entry("opening_width_m").or_insert(width.unwrap_or_default());
    }
    if equipment.get("belt_speed_m_s").is_some_and(Value::is_number) {
        equipment.remove("belt_speed_m_s");
    }
}
