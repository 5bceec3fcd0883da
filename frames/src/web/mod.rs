//! The stream `roost.frames/1`: one file with all frames of a run, small enough for a browser.
//!
//! The file has a magic number and chunks: a header in JSON, the frames, an index, and the place of the index. Every frame can be decoded alone,
//! so that a stream is readable up to the point where a run was killed. Positions have 16 bits per axis; their differences from one
//! sub-particle to the next are compressed with zlib, which browsers decode themselves. `docs/frames.md` describes every byte.

mod bytes;
mod error;
mod header;
mod pack;
mod reader;
#[cfg(test)]
mod tests;
mod writer;

pub use error::Error;
pub use header::{BodyKind, Header, Motion, Surface};
pub(crate) use header::{first_shape, surface_kind_name};
pub use reader::{Body, Frame, IndexEntry, Reader};
pub use writer::{PackedFrame, Writer};

/// The first bytes of the file: a name, and a line end that reveals a translation of line ends.
pub const MAGIC: [u8; 8] = *b"ROOSTF\r\n";

/// The schema in every header.
pub const SCHEMA: &str = "roost.frames/1";

/// Maximum of sub-particles in a file, which bounds the memory of a reader.
pub const MAX_SUBPARTICLES: u64 = 1 << 24;

/// Maximum of bytes in a header.
const MAX_HEADER_BYTES: u32 = 1 << 28;

/// Tag of the header.
const HEADER: [u8; 4] = *b"HEAD";
/// Tag of a frame.
const FRAME: [u8; 4] = *b"FRAM";
/// Tag of the index.
const INDEX: [u8; 4] = *b"INDX";
/// Tag of the last chunk, which gives the place of the index.
const LAST: [u8; 4] = *b"LAST";

/// Bytes before the content of a chunk: its tag and the length of its content.
const CHUNK_HEAD: u64 = 8;
/// Bytes of a frame before its compressed body: two times, number of sub-particles, bytes of the body.
const FRAME_HEAD: usize = 24;
/// Bytes of an entry of the index: place of the chunk and two times.
const ENTRY: usize = 24;
/// Bytes of the last chunk.
const LAST_CHUNK: u64 = CHUNK_HEAD + 8;
/// Bytes of a decompressed body before its lists: the box, the maximum speed, three counts.
const BODY_HEAD: usize = 64;
