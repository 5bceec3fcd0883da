//! Meshes: STL files, each named by the digest of its bytes.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::job::words;
use crate::time::Timestamp;

/// What a file is sent as, up and down.
pub const MEDIA_TYPE: &str = "model/stl";

/// The most bytes of a file, unless an operator sets another limit: 200,000 triangles as ASCII take less.
pub const MAX_BYTES: usize = 64 * 1024 * 1024;

words!(
    /// How the triangles of a file are written.
    MeshFormat {
        /// 50 bytes a triangle.
        Binary = "binary",
        /// Words.
        Ascii = "ascii",
    }
);

/// A file as the API shows it. Its numbers have no unit: a scenario says what they mean. Lengths are in single precision, as
/// binary files have them.
///
/// What welding finds (`degenerate` and the edges) is that of the file read in millimetres, or in metres where its size cannot be
/// meant in millimetres.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct MeshView {
    /// blake3 of the file, in hexadecimal.
    pub digest: String,
    /// Its length.
    pub bytes: u64,
    /// How it is written.
    pub format: MeshFormat,
    /// Triangles in it.
    pub triangles: u64,
    /// Those without an area, which act on nothing.
    pub degenerate: u64,
    /// Whether it encloses a volume: it has no open edge.
    pub closed: bool,
    /// Edges where an odd number of triangles meet: rims and holes.
    pub open_edges: u64,
    /// Edges between triangles that face opposite ways.
    pub turned_edges: u64,
    /// The least x, y and z.
    pub low: [f32; 3],
    /// The greatest x, y and z.
    pub high: [f32; 3],
    /// Sides of its box.
    pub size: [f32; 3],
    /// When it was uploaded.
    #[schema(value_type = String, format = DateTime)]
    pub uploaded_at: Timestamp,
}

/// Letters of a digest: those of 32 bytes.
const DIGEST_LETTERS: usize = 64;

/// What a digest looks like, as a regular expression of JSON Schema.
pub fn digest_pattern() -> String {
    format!("^[0-9a-f]{{{DIGEST_LETTERS}}}$")
}

/// Whether a text could be the digest of a mesh.
pub fn is_digest(text: &str) -> bool {
    text.len() == DIGEST_LETTERS
        && text.bytes().all(|byte| byte.is_ascii_digit() || (b'a'..=b'f').contains(&byte))
}
