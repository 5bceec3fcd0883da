//! Problem details (RFC 9457): every error answer of the API.

use roost_solver::scenario::Fault;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// The media type of [`Problem`].
pub const MEDIA_TYPE: &str = "application/problem+json";

/// An error answer.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Problem {
    /// Stable name of the problem type, such as `/problems/invalid-scenario`.
    #[serde(rename = "type")]
    pub kind: String,
    /// The problem type in words.
    pub title: String,
    /// The HTTP status.
    pub status: u16,
    /// The cause, and what to do.
    pub detail: String,
    /// Every fault of the document, if it is invalid.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schema(value_type = Vec<Object>)]
    pub errors: Vec<Fault>,
}
