//! Faults of mesh files, each with the values that were found.

use super::{MAX_SIZE_M, MAX_TRIANGLES, MIN_SIZE_M, Units};

/// Why a file cannot be read as a mesh.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum MeshError {
    /// The file is empty.
    #[error("the file is empty")]
    Empty,
    /// Neither binary nor ASCII STL.
    #[error("neither a binary STL ({}) nor an ASCII one (it is no text that begins with `solid`)", no_binary(*.announced, *.found))]
    NotStl {
        /// Number of triangles in the header, read as binary; `None` when the header is incomplete.
        announced: Option<u32>,
        /// Length of the file in bytes.
        found: u64,
    },
    /// A binary file shorter than its header announces.
    #[error(
        "the file is cut short: a binary STL of {triangles} triangles takes {expected} bytes, found {found}"
    )]
    Truncated {
        /// Announced triangles.
        triangles: u32,
        /// Bytes for these triangles.
        expected: u64,
        /// Bytes found.
        found: u64,
    },
    /// A binary file longer than its header announces.
    #[error(
        "the file goes on after its end: a binary STL of {triangles} triangles takes {expected} bytes, found {found}"
    )]
    Surplus {
        /// Announced triangles.
        triangles: u32,
        /// Bytes for these triangles.
        expected: u64,
        /// Bytes found.
        found: u64,
    },
    /// A syntax error of an ASCII file.
    #[error("line {line} of the ASCII STL: expected {expected}, found {found}")]
    Syntax {
        /// Line, from 1.
        line: usize,
        /// Expected token.
        expected: &'static str,
        /// Token found.
        found: String,
    },
    /// A valid file without triangles.
    #[error("the file holds no triangle")]
    NoTriangle,
    /// More triangles than any experiment needs.
    #[error("the file holds {found} triangles, at most {MAX_TRIANGLES} are taken: export it more coarsely")]
    TooMany {
        /// Triangles found.
        found: usize,
    },
    /// A coordinate is not finite.
    #[error("triangle {triangle} has a corner at ({}, {}, {})", .corner[0], .corner[1], .corner[2])]
    NotFinite {
        /// Number of the triangle, from 1.
        triangle: usize,
        /// The corner, in the file's units.
        corner: [f64; 3],
    },
    /// The size suggests other units.
    #[error(
        "read in {}, the mesh is {:.3e} × {:.3e} × {:.3e} m; its longest side must be from {MIN_SIZE_M} to {MAX_SIZE_M} m: are the units right?",
        name(*.units), .size_m[0], .size_m[1], .size_m[2]
    )]
    Size {
        /// Sides of its box, in metres.
        size_m: [f64; 3],
        /// Units that were assumed.
        units: Units,
    },
    /// All triangles are points or lines.
    #[error("none of the {triangles} triangles has an area")]
    AllDegenerate {
        /// Triangles found.
        triangles: usize,
    },
}

fn name(units: Units) -> &'static str {
    match units {
        Units::Mm => "millimetres",
        Units::M => "metres",
    }
}

fn no_binary(announced: Option<u32>, found: u64) -> String {
    match announced {
        None => format!("its header takes 84 bytes, found {found}"),
        Some(count) => format!(
            "its header announces {count} triangles, which take {} bytes, found {found}",
            super::stl::binary_length(count)
        ),
    }
}
