//! Access tokens and their scopes.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::time::Timestamp;
use crate::words::words;

words!(
    /// A scope of a token.
    Scope {
        /// Everything.
        Admin = "admin",
        /// Submit, cancel, retry and read.
        Submit = "submit",
        /// Read.
        Read = "read",
        /// Register, claim, send heartbeats, deliver results, fetch meshes.
        Worker = "worker",
    }
);

impl Scope {
    /// Whether this scope allows requests that need the scope `needed`.
    pub fn covers(self, needed: Self) -> bool {
        self == needed || self == Self::Admin || (self == Self::Submit && needed == Self::Read)
    }
}

/// A token as the list shows it. The secret is shown once, when the token is created.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct TokenView {
    /// Its identifier, for revoking.
    pub id: String,
    /// A name for people.
    pub name: String,
    /// Its user; empty if unknown.
    #[serde(default)]
    pub user: String,
    /// Its project.
    #[serde(default)]
    pub project: String,
    /// Its scopes.
    pub scopes: Vec<Scope>,
    /// When it was created.
    #[schema(value_type = String, format = DateTime)]
    pub created_at: Timestamp,
    /// When it expires; null for never.
    #[serde(default)]
    #[schema(value_type = Option<String>, format = DateTime)]
    pub expires_at: Option<Timestamp>,
    /// When it was revoked.
    #[schema(value_type = Option<String>, format = DateTime)]
    pub revoked_at: Option<Timestamp>,
}

#[cfg(test)]
mod tests {
    use super::Scope::{Admin, Read, Submit, Worker};

    #[test]
    fn scopes_cover_narrower_scopes() {
        let all = [Admin, Submit, Read, Worker];
        let covered = |scope: super::Scope| all.map(|needed| scope.covers(needed));
        assert_eq!(covered(Admin), [true; 4]);
        assert_eq!(covered(Submit), [false, true, true, false]);
        assert_eq!(covered(Read), [false, false, true, false]);
        assert_eq!(covered(Worker), [false, false, false, true]);
    }
}
