//! Frames of a job: the stream `roost.frames/1`, recorded by a worker and stored by the server.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// Media type of a stream of frames.
pub const MEDIA_TYPE: &str = "application/vnd.roost.frames";

/// The first bytes of every stream of frames.
pub const MAGIC: [u8; 8] = *b"ROOSTF\r\n";

/// The stored frames of a job.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct FramesView {
    /// Bytes of the stream.
    pub bytes: u64,
    /// Number of frames.
    pub count: u64,
    /// Why recording stopped before the end of the job, if it did.
    pub stopped: Option<String>,
}

/// The frames that a worker records.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct FramesOrder {
    /// Simulated time between frames, in seconds.
    pub interval_s: f64,
    /// Maximum size of the stream, in bytes.
    pub limit_bytes: u64,
}
