//! Documents of an earlier schema, brought to the present one without a change of meaning.

use std::borrow::Cow;

use serde_json::{Map, Value, json};

use super::SCHEMA;
use super::fields::find;

/// The first schema. Its bonds have the same stiffness per area at any sub-particle radius.
const SCHEMA_1: &str = "roost.scenario/1";
/// The second schema. Its lattice has the points inside the shape, whatever their volume.
const SCHEMA_2: &str = "roost.scenario/2";

/// The document in the present schema. A value that the document states stays.
pub(super) fn upgraded(document: &Value) -> Cow<'_, Value> {
    let schema = document.get("schema").and_then(Value::as_str);
    if !matches!(schema, Some(SCHEMA_1 | SCHEMA_2)) {
        return Cow::Borrowed(document);
    }
    let is_first = schema == Some(SCHEMA_1);
    let mut document = document.clone();
    if is_first {
        if let Some(bonds) = section(&mut document, "bonds") {
            bonds.entry("reference_radius_m").or_insert(Value::Null);
        }
        declare_opening(&mut document);
    }
    fill_centres(&mut document);
    document["schema"] = json!(SCHEMA);
    Cow::Owned(document)
}

/// A section of the document, which is added if it is missing. A section that is no object is reported by the walk over the field table.
fn section<'a>(document: &'a mut Value, name: &str) -> Option<&'a mut Map<String, Value>> {
    document.as_object_mut()?.entry(name).or_insert_with(|| json!({})).as_object_mut()
}

/// The lattice had the points inside the shape. Where there is no shape, the field may only have its default: it follows the new one.
fn fill_centres(document: &mut Value) {
    let is = |pointer, value: Value| document.pointer(pointer) == Some(&value);
    let has_shape = !is("/product/spheres", json!(true)) && !is("/experiment", json!("compress"));
    let stated = is("/product/fill", json!("centres"));
    let Some(product) = section(document, "product") else { return };
    if has_shape {
        product.entry("fill").or_insert(json!("centres"));
    } else if stated {
        product.remove("fill");
    }
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
