//! The scenario: its document, field table, defaults, limits and digest.
//!
//! A scenario arrives as JSON. [`parse`] and [`from_value`] walk the field table ([`fields::FIELDS`]), which
//! holds every name, type, unit, default, range, source and description once, list *every* fault with
//! its JSON pointer, fill in the defaults, and only then build the typed [`Scenario`]. A `Scenario` is therefore
//! complete: it serialises to "the scenario as run", and that document gives the same scenario again.

mod cad;
mod canonical;
mod complete;
mod fault;
pub mod field;
pub mod fields;
mod json;
mod mesh_files;
mod names;
mod own_fields;
mod relations;
mod row;
mod schema;
mod sections;
#[cfg(test)]
mod tests;
mod types;
mod upgrade;

pub use fault::{Fault, ScenarioError, must_be, unknown_field};
pub use json::read_json;
pub use mesh_files::{MeshFile, MeshFiles, read_mesh_files};
pub use names::{escape, most_similar, nearest};
pub use relations::MAX_SAMPLES;
pub use schema::{field_tables_markdown, json_schema};
pub use sections::*;
pub use types::Scenario;

/// The schema name that every scenario carries once it has been read. Documents of earlier schemas are upgraded.
pub const SCHEMA: &str = "roost.scenario/3";

/// Reads a scenario from JSON text: one syntax error, or every fault at once, or the scenario.
///
/// # Errors
/// A syntax error or a repeated name is [`ScenarioError::Syntax`]; everything else is a list of faults.
pub fn parse(text: &str) -> Result<Scenario, ScenarioError> {
    from_value(&read_json(text)?).map_err(ScenarioError::Faults)
}

/// Reads a scenario from a JSON value of this schema or an earlier one: every fault at once, or the scenario with all
/// defaults filled in.
///
/// # Errors
/// Every fault found.
pub fn from_value(value: &serde_json::Value) -> Result<Scenario, Vec<Fault>> {
    let completed = complete::complete(&upgrade::upgraded(value))?;
    // This cannot fail, since a test holds the types to the table. If it did, the fault names the reason.
    serde_json::from_value(completed).map_err(|error| {
        vec![Fault {
            pointer: String::new(),
            value: serde_json::Value::Null,
            detail: error.to_string(),
            allowed: None,
        }]
    })
}

impl Scenario {
    /// blake3 of the canonical (RFC 8785) JSON of the scenario, in hex: equal physics, equal digest.
    pub fn digest(&self) -> String {
        let canonical = canonical::canonical(self).expect("a scenario serialises to JSON");
        blake3::hash(&canonical).to_hex().to_string()
    }

    /// Digest of what acts before t = 0: equal digests, equal fills. Only hoppers that close their gate, and that nothing is fed
    /// to, share fills.
    pub fn fill_digest(&self) -> Option<String> {
        let equipment = self.equipment()?;
        if equipment.feed_kg_s > 0.0 || !equipment.shutter_while_filling {
            return None;
        }
        let mut document = serde_json::to_value(self).expect("a scenario serialises to JSON");
        for field in fields::FIELDS.iter().filter(|field| field.from_start) {
            if let Some(value) = document.pointer_mut(field.pointer) {
                *value = serde_json::Value::Null;
            }
        }
        let canonical = canonical::canonical(&document).expect("a scenario serialises to JSON");
        Some(blake3::hash(&canonical).to_hex().to_string())
    }
}
