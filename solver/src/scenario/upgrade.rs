//! Documents of an earlier schema, brought to the present one without a change of meaning.

use std::borrow::Cow;

use serde_json::{Value, json};

use super::SCHEMA;

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
    Cow::Owned(document)
}
