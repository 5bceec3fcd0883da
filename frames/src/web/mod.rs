//! The stream `roost.frames/1`: one file with all frames of a run, small enough to be watched in a browser.
//!
//! A magic number, then chunks: a header in JSON, a chunk a frame, an index, and where the index is. Frames stand by
//! themselves, so that any can be shown first, and what was written before a run was killed can be read. Positions
//! are 16 bits an axis, as differences from the sub-particle before, packed with zlib, which browsers unpack
//! themselves. `docs/frames.md` has every byte.

mod bytes;
mod error;
mod header;
mod pack;
mod reader;
#[cfg(test)]
mod tests;
mod writer;

pub use error::Error;
pub use header::{Header, Kind, Motion, Surface};
pub(crate) use header::{first_shape, kind_name};
pub use reader::{Body, Entry, Frame, Reader};
pub use writer::{Packed, Writer};

/// What the file begins with: a name, and a line end that shows whether somebody has translated line ends.
pub const MAGIC: [u8; 8] = *b"ROOSTF\r\n";

/// The schema that every header names.
pub const SCHEMA: &str = "roost.frames/1";

/// Sub-particles that a file may have: what a reader makes room for is bounded by it.
pub const MOST_SUBPARTICLES: u64 = 1 << 24;

/// Bytes that a header may have.
const MOST_HEADER_BYTES: u32 = 1 << 28;

/// Tag of the chunk that is the header.
const HEADER: [u8; 4] = *b"HEAD";
/// Tag of a chunk that is a frame.
const FRAME: [u8; 4] = *b"FRAM";
/// Tag of the chunk that is the index.
const INDEX: [u8; 4] = *b"INDX";
/// Tag of the last chunk, which says where the index is.
const LAST: [u8; 4] = *b"LAST";

/// Bytes before the content of a chunk: its tag and the length of its content.
const CHUNK_HEAD: u64 = 8;
/// Bytes of a frame before what is packed: two times, sub-particles, bytes when unpacked.
const FRAME_HEAD: usize = 24;
/// Bytes of an entry of the index: two times, where the chunk begins.
const ENTRY: usize = 24;
/// Bytes of the last chunk.
const LAST_CHUNK: u64 = CHUNK_HEAD + 8;
/// Bytes of an unpacked frame before its lists: the box, the greatest speed, three counts.
const BODY_HEAD: usize = 64;
