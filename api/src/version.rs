//! Versions: what `GET /v1/version` answers.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// What a server is made of.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct VersionView {
    /// Version of the server.
    pub server: String,
    /// [`crate::API_VERSION`] it speaks.
    pub api_version: String,
    /// `SOLVER_REVISION` of its solver: results of another revision are never taken from its store.
    pub solver_revision: u32,
    /// Version of the SQLite library.
    pub sqlite: String,
}
