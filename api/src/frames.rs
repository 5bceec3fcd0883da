//! Frames of a job: the stream `roost.frames/1`, recorded by a worker and kept by the server.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// Media type of a stream of frames.
pub const MEDIA_TYPE: &str = "application/vnd.roost.frames";

/// The bytes that every stream of frames begins with.
pub const MAGIC: [u8; 8] = *b"ROOSTF\r\n";

/// What there is of frames.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct FramesView {
    /// Bytes of the stream.
    pub bytes: u64,
    /// Frames in it.
    pub count: u64,
    /// Why they end before the run did, if they do.
    pub stopped: Option<String>,
}

/// What a worker is asked to record.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct FramesOrder {
    /// Simulated time from frame to frame, in seconds.
    pub interval_s: f64,
    /// Bytes that the stream may have.
    pub limit_bytes: u64,
}
