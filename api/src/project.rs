//! Projects: groups of users with a share of the workers and a budget of processor time.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// The project of tokens that name none, and of all clients of a server without tokens.
pub const DEFAULT_PROJECT: &str = "default";

/// Maximum length of the name of a project, in characters.
pub const MAX_PROJECT_NAME: usize = 64;

/// Maximum of a share.
pub const MAX_SHARE: u32 = 1000;

/// Maximum of a budget, in core-hours.
pub const MAX_BUDGET_CORE_HOURS: f64 = 1e9;

/// A project as the API shows it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct ProjectView {
    /// Its name.
    pub name: String,
    /// Jobs of the project per round of claims, while several projects have queued jobs.
    pub share: u32,
    /// Its budget, in core-hours; null without a limit.
    pub budget_core_hours: Option<f64>,
    /// Core-hours that its ended attempts have used: wall time times threads.
    pub used_core_hours: f64,
    /// Number of its queued jobs.
    pub queued: u64,
    /// Number of its running jobs.
    pub running: u64,
}

impl ProjectView {
    /// Whether its queued jobs wait because the budget is used up.
    pub fn is_used_up(&self) -> bool {
        self.budget_core_hours.is_some_and(|budget| self.used_core_hours >= budget)
    }
}
