//! The versions of a server, for `GET /v1/version`.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// Versions of a server.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct VersionView {
    /// Version of the server.
    pub server: String,
    /// Version of the API, such as `v1`.
    pub api_version: String,
    /// `SOLVER_REVISION` of its solver. Cached results of another revision are never used.
    pub solver_revision: u32,
    /// Version of the SQLite library.
    pub sqlite: String,
    /// Name and version of the database: SQLite or PostgreSQL.
    #[serde(default)]
    pub database: String,
}
