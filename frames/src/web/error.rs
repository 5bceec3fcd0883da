//! Errors of streams of frames.

use std::io;

/// Why a stream cannot be written or read.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The file cannot be read or written.
    #[error(transparent)]
    Io(#[from] io::Error),
    /// The file does not begin with [`super::MAGIC`].
    #[error("not a stream of Roost frames")]
    NotFrames,
    /// The stream has another schema.
    #[error("the frames have schema `{0}`; this version reads `{own}`", own = super::SCHEMA)]
    Schema(String),
    /// The header is not JSON with the expected fields.
    #[error("the header of the frames cannot be read: {0}")]
    Header(#[from] serde_json::Error),
    /// The header exceeds its maximum length.
    #[error("the header would have {0} bytes, more than {max}: use meshes with fewer triangles", max = super::MAX_HEADER_BYTES)]
    HeaderTooLong(usize),
    /// The stream exceeds the maximum of sub-particles.
    #[error("{0} sub-particles; a stream of frames has at most {max}", max = super::MAX_SUBPARTICLES)]
    TooMany(u64),
    /// The stream has no frame with this number.
    #[error("there is no frame {number}: the stream has {frames}")]
    NoFrame {
        /// The number, from 0.
        number: usize,
        /// Frames in the stream.
        frames: usize,
    },
    /// The stream is incomplete or inconsistent.
    #[error("the frames are damaged: {0}")]
    Damaged(&'static str),
}
