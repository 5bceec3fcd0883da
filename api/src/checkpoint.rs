//! Checkpoints of running jobs: recorded by a worker, stored by the server, and handed to the next worker.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// Media type of a checkpoint.
pub const MEDIA_TYPE: &str = "application/vnd.roost.checkpoint";

/// The checkpoints that a worker records.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct CheckpointOrder {
    /// Wall time between checkpoints, in seconds.
    pub interval_s: f64,
    /// Maximum size of a checkpoint, in bytes.
    pub limit_bytes: u64,
}

/// The stored checkpoint of a job.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct CheckpointView {
    /// The attempt that recorded it.
    pub attempt: u32,
    /// Simulated time since the beginning of the run, in seconds.
    pub simulated_s: f64,
    /// Its size in bytes.
    pub bytes: u64,
    /// BLAKE3 hash of its bytes, in hexadecimal.
    pub digest: String,
    /// `SOLVER_REVISION` of its solver. Only workers with the same revision, backend and device can continue from it.
    pub solver_revision: u32,
    /// Its backend.
    pub backend: String,
    /// Its device in words.
    pub device: String,
}

/// The answer to a part of an upload.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct CheckpointReceipt {
    /// Bytes that the server has: the `offset` of the next part.
    pub received: u64,
    /// Whether the checkpoint is complete and recorded.
    pub recorded: bool,
}
