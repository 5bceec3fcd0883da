//! Validation without running: what `POST /v1/validate` and `roost validate` answer.

use roost_solver::result::Estimate;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// What a valid document would cost.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct ValidationReport {
    /// `scenario` or `sweep`.
    pub document: String,
    /// Jobs it makes.
    pub jobs: u64,
    /// Cost of the scenario, or of the base scenario of the sweep.
    #[schema(value_type = Object)]
    pub estimate: Estimate,
    /// The scenario as it would run, every default written out.
    #[schema(value_type = Object)]
    pub scenario: serde_json::Value,
}
