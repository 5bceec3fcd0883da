//! Filled states that jobs share: the first attempt that needs one computes and uploads it, and the others start from it.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// The fill of a claimed attempt.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct FillOrder {
    /// The stored fill to start from. It is from the same solver revision, backend and device as the worker. Without it the attempt
    /// fills by itself and uploads its fill, on which other jobs may wait.
    pub stored: Option<StoredFill>,
    /// Maximum size of an uploaded fill, in bytes.
    pub limit_bytes: u64,
}

/// A fill that the server has.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct StoredFill {
    /// Its size in bytes.
    pub bytes: u64,
    /// BLAKE3 hash of its bytes, in hexadecimal.
    pub digest: String,
}
