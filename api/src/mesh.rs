//! Meshes: STL files, each named by the digest of its bytes.

pub use roost_solver::mesh::is_digest;
use roost_solver::mesh::{DIGEST_DIGITS, MAX_FILE_BYTES};
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::time::Timestamp;
use crate::words::words;

/// Media type of an STL file.
pub const MEDIA_TYPE: &str = "model/stl";

/// Default of the maximum size of a file, in bytes.
pub const MAX_BYTES: usize = MAX_FILE_BYTES;

words!(
    /// Format of an STL file.
    MeshFormat {
        /// Binary, 50 bytes per triangle.
        Binary = "binary",
        /// Text.
        Ascii = "ascii",
    }
);

/// A mesh as the API shows it. Its lengths have the unit that a scenario states, in single precision as in binary files.
///
/// `degenerate` and the counts of edges hold after welding in millimetres, or in metres where the size is too small for millimetres.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct MeshView {
    /// BLAKE3 of the file, in hexadecimal.
    pub digest: String,
    /// Size of the file, in bytes.
    pub bytes: u64,
    /// Its format.
    pub format: MeshFormat,
    /// Number of triangles.
    pub triangles: u64,
    /// Triangles without an area, which have no effect.
    pub degenerate: u64,
    /// Whether it encloses a volume, without open edges.
    pub closed: bool,
    /// Edges of an odd number of triangles, as at holes.
    pub open_edges: u64,
    /// Edges between triangles of opposite orientation.
    pub turned_edges: u64,
    /// Minimum x, y and z.
    pub low: [f32; 3],
    /// Maximum x, y and z.
    pub high: [f32; 3],
    /// Size of its bounding box in x, y and z.
    pub size: [f32; 3],
    /// When it was uploaded.
    #[schema(value_type = String, format = DateTime)]
    pub uploaded_at: Timestamp,
}

/// The regular expression of a digest, for JSON Schema.
pub fn digest_pattern() -> String {
    format!("^[0-9a-f]{{{DIGEST_DIGITS}}}$")
}
