//! What can be wrong with a stream of frames.

use std::io;

/// Why a stream cannot be written or read.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The file system, or whatever is underneath.
    #[error(transparent)]
    Io(#[from] io::Error),
    /// It does not begin as such a stream does.
    #[error("not a stream of Roost frames")]
    NotFrames,
    /// It is of another version.
    #[error("frames of schema `{0}`, and this reads `{own}`", own = super::SCHEMA)]
    Schema(String),
    /// The header is no JSON of the right fields.
    #[error("the header of the frames cannot be read: {0}")]
    Header(#[from] serde_json::Error),
    /// The header is longer than a reader would take.
    #[error("the header would have {0} bytes, more than {most}: too many triangles", most = super::MOST_HEADER_BYTES)]
    HeaderTooLong(usize),
    /// More sub-particles than a stream may have.
    #[error("{0} sub-particles; a stream of frames has at most {most}", most = super::MOST_SUBPARTICLES)]
    TooMany(u64),
    /// There is no frame of that number.
    #[error("there is no frame {number}: the stream has {frames}")]
    NoFrame {
        /// The number, from 0.
        number: usize,
        /// Frames that there are.
        frames: usize,
    },
    /// It breaks off, or contradicts itself.
    #[error("the frames are damaged: {0}")]
    Damaged(&'static str),
}
