//! The statement of a client about a stream of frames when it uploads one.

use serde::{Deserialize, Serialize};

/// The stream of frames beside a delivery.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct RecordedFrames {
    /// Number of frames.
    pub count: u64,
    /// Why recording stopped before the run ended.
    pub stopped: Option<String>,
}
