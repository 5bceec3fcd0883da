//! Retention: what goes because it ended long ago.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::ids::SweepId;
use crate::time::Timestamp;

/// What is deleted, or would be.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Pruning {
    /// Whether nothing has been deleted yet.
    pub dry_run: bool,
    /// What ended before then goes.
    #[schema(value_type = String, format = DateTime)]
    pub ended_before: Timestamp,
    /// Sweeps all of whose jobs did, oldest first.
    pub sweeps: Vec<PrunedSweep>,
    /// Jobs of no sweep.
    pub jobs: u64,
    /// Digests of meshes uploaded before then that nothing names which stays.
    pub meshes: Vec<String>,
}

impl Pruning {
    /// Whether nothing goes.
    pub fn is_empty(&self) -> bool {
        self.sweeps.is_empty() && self.jobs == 0 && self.meshes.is_empty()
    }
}

/// A sweep that goes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct PrunedSweep {
    /// Its identifier.
    pub id: SweepId,
    /// Its name.
    pub name: String,
    /// Its jobs, which go with their attempts and results.
    pub jobs: u64,
    /// When the last of them ended.
    #[schema(value_type = String, format = DateTime)]
    pub ended_at: Timestamp,
}
