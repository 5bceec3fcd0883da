//! Pruning: deletion of sweeps and jobs that ended long ago.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::ids::SweepId;
use crate::time::Timestamp;

/// The sweeps, jobs and meshes that are deleted.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Pruning {
    /// Whether this is a dry run, which deletes nothing.
    pub dry_run: bool,
    /// Sweeps and jobs that ended before this time are deleted.
    #[schema(value_type = String, format = DateTime)]
    pub ended_before: Timestamp,
    /// Sweeps whose jobs all ended before, oldest first.
    pub sweeps: Vec<PrunedSweep>,
    /// Number of jobs without a sweep.
    pub jobs: u64,
    /// Digests of meshes that were uploaded before and that no remaining job names.
    pub meshes: Vec<String>,
}

impl Pruning {
    /// Whether nothing is deleted.
    pub fn is_empty(&self) -> bool {
        self.sweeps.is_empty() && self.jobs == 0 && self.meshes.is_empty()
    }
}

/// A deleted sweep.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct PrunedSweep {
    /// Its identifier.
    pub id: SweepId,
    /// Its name.
    pub name: String,
    /// Number of its jobs, which are deleted with their attempts and results.
    pub jobs: u64,
    /// When the last job ended.
    #[schema(value_type = String, format = DateTime)]
    pub ended_at: Timestamp,
}
