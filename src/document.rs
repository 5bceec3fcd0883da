//! Kinds of JSON documents that commands accept.

use serde_json::Value;

/// The kind of a JSON document, which its fields decide.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum DocumentKind {
    /// One scenario.
    Scenario,
    /// A scenario in an envelope, as `POST /v1/jobs` takes it.
    Job,
    /// A base scenario with factors.
    Sweep,
    /// A question about a base scenario.
    Study,
    /// Results of laboratory tests.
    Measurements,
}

impl DocumentKind {
    pub(crate) fn of(document: &Value) -> Self {
        if roost_server::is_measurements(document) {
            Self::Measurements
        } else if roost_server::is_study(document) {
            Self::Study
        } else if roost_server::is_sweep(document) {
            Self::Sweep
        } else if document.get("scenario").is_some() {
            Self::Job
        } else {
            Self::Scenario
        }
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn fields_decide_the_kind_of_a_document() {
        assert_eq!(DocumentKind::of(&json!({"experiment": "hopper"})), DocumentKind::Scenario);
        assert_eq!(DocumentKind::of(&json!({"scenario": {}})), DocumentKind::Job);
        assert_eq!(DocumentKind::of(&json!({"base": {}, "factors": []})), DocumentKind::Sweep);
        assert_eq!(DocumentKind::of(&json!({"base": {}, "factors": [], "goal": {}})), DocumentKind::Study);
        assert_eq!(DocumentKind::of(&json!([])), DocumentKind::Scenario);
        for schema in ["roost.measurements/1", "roost.measurements/9"] {
            assert_eq!(DocumentKind::of(&json!({ "schema": schema })), DocumentKind::Measurements);
        }
        assert_eq!(DocumentKind::of(&json!({"name": "", "tests": []})), DocumentKind::Measurements);
    }
}
