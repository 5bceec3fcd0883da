//! Why a file is no mesh: each reason names what was found.

use super::{MAX_SIZE_M, MAX_TRIANGLES, MIN_SIZE_M, Units};

/// Why a file is no mesh.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum MeshError {
    /// No byte at all.
    #[error("the file is empty")]
    Empty,
    /// Not STL, as far as can be told.
    #[error("neither a binary STL ({}) nor an ASCII one (it is no text that begins with `solid`)", no_binary(*.announced, *.found))]
    NotStl {
        /// Triangles that it announces when taken for binary; none when even the header is not whole.
        announced: Option<u32>,
        /// Its length in bytes.
        found: u64,
    },
    /// Binary, and shorter than it says.
    #[error(
        "the file is cut short: a binary STL of {triangles} triangles takes {expected} bytes, found {found}"
    )]
    Truncated {
        /// Triangles that it announces.
        triangles: u32,
        /// Bytes that they take.
        expected: u64,
        /// Bytes that there are.
        found: u64,
    },
    /// Binary, and longer than it says.
    #[error(
        "the file goes on after its end: a binary STL of {triangles} triangles takes {expected} bytes, found {found}"
    )]
    Surplus {
        /// Triangles that it announces.
        triangles: u32,
        /// Bytes that they take.
        expected: u64,
        /// Bytes that there are.
        found: u64,
    },
    /// ASCII, and something else stands where a word or a number must.
    #[error("line {line} of the ASCII STL: expected {expected}, found {found}")]
    Syntax {
        /// Line, from 1.
        line: usize,
        /// What must stand there.
        expected: &'static str,
        /// What stands there.
        found: String,
    },
    /// Sound, and without any triangle.
    #[error("the file holds no triangle")]
    NoTriangle,
    /// More than any experiment needs.
    #[error("the file holds {found} triangles, at most {MAX_TRIANGLES} are taken: export it more coarsely")]
    TooMany {
        /// Triangles that there are.
        found: usize,
    },
    /// A coordinate that is not a number, or infinite.
    #[error("triangle {triangle} has a corner at ({}, {}, {})", .corner[0], .corner[1], .corner[2])]
    NotFinite {
        /// The triangle, from 1.
        triangle: usize,
        /// The corner, in the file's units.
        corner: [f64; 3],
    },
    /// So small or large that other units must be meant.
    #[error(
        "read in {}, the mesh is {:.3e} × {:.3e} × {:.3e} m; its longest side must be from {MIN_SIZE_M} to {MAX_SIZE_M} m: are the units right?",
        name(*.units), .size_m[0], .size_m[1], .size_m[2]
    )]
    Size {
        /// Sides of its box, in metres.
        size_m: [f64; 3],
        /// The units that it was read in.
        units: Units,
    },
    /// Nothing but points and lines.
    #[error("none of the {triangles} triangles has an area")]
    AllDegenerate {
        /// Triangles that there are.
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
