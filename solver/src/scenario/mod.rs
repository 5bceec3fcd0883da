//! What a user may ask for: the typed scenario, its defaults, limits and digest.
//!
//! A scenario arrives as JSON. [`parse`] and [`from_value`] walk the field table ([`fields::FIELDS`]), which
//! holds every name, type, unit, default, range, source and description once, list *every* fault with
//! its JSON pointer, fill the defaults in, and only then build the typed [`Scenario`]. A `Scenario`
//! therefore is complete: what it serialises to is "the scenario as run", and reading that again gives
//! the same scenario.

mod canonical;
mod complete;
mod declaration;
mod fault;
pub mod field;
pub mod fields;
mod json;
mod names;
mod own_fields;
mod relations;
mod row;
mod schema;
mod sections;
#[cfg(test)]
mod tests;
mod types;

pub use declaration::{AtMost, Declaration, ExperimentSection};
pub use fault::{Fault, ScenarioError};
pub use json::read_json;
pub use names::{escape, nearest};
pub use relations::MAX_SAMPLES;
pub use schema::{field_tables_markdown, json_schema};
pub use sections::*;
pub use types::Scenario;

/// The schema name that every scenario carries once it has been read.
pub const SCHEMA: &str = "roost.scenario/1";

/// Reads a scenario from JSON text: one syntax error, or every fault at once, or the scenario.
///
/// # Errors
/// What is not JSON, or names a field twice, is one [`ScenarioError::Syntax`]; all else are faults.
pub fn parse(text: &str) -> Result<Scenario, ScenarioError> {
    from_value(&read_json(text)?).map_err(ScenarioError::Faults)
}

/// Reads a scenario from a JSON value: every fault at once, or the scenario with all defaults filled in.
///
/// # Errors
/// Every fault found.
pub fn from_value(value: &serde_json::Value) -> Result<Scenario, Vec<Fault>> {
    let completed = complete::complete(value)?;
    // The table and the types agree (a test holds them together), so this cannot fail; were it to, the
    // author of the document gets to read why.
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
}
