//! Budgets: limits of the number of runs, in all and at a point.

use serde::{Deserialize, Serialize};

use crate::evidence::PointRuns;

/// Limits of the number of runs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Budget {
    /// Maximum number of runs in all, failed ones included.
    pub max_runs: usize,
    /// Maximum number of runs at one point. Confirmations of the goal `optimise` have a maximum of their own.
    #[serde(default = "default_replicates")]
    pub max_replicates: usize,
    /// A point is excluded when this many of its runs have failed, and they are at least half of its finished runs.
    #[serde(default = "default_failures")]
    pub max_failures: usize,
}

fn default_replicates() -> usize {
    1000
}

fn default_failures() -> usize {
    3
}

impl Budget {
    /// Whether a point is excluded because its runs fail, or cannot be made.
    pub fn excludes(&self, point: &PointRuns) -> bool {
        let failed = point.failed();
        let fails = failed >= self.max_failures && 2 * failed >= point.count() - point.pending();
        fails || point.impossible.is_some()
    }
}
