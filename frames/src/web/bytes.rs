//! Chunks and numbers from untrusted bytes.

use std::io::{Read, Seek};

use super::{CHUNK_HEAD, Error};

/// Tag and length of the chunk at `offset`, the position of `input`; none when the chunk is incomplete.
pub(super) fn chunk_head(
    input: &mut (impl Read + Seek),
    offset: u64,
    length: u64,
) -> Result<Option<([u8; 4], u32)>, Error> {
    if length.saturating_sub(offset) < CHUNK_HEAD {
        return Ok(None);
    }
    let (mut tag, mut size) = ([0; 4], [0; 4]);
    input.read_exact(&mut tag)?;
    input.read_exact(&mut size)?;
    let size = u32::from_le_bytes(size);
    Ok((u64::from(size) <= length - offset - CHUNK_HEAD).then_some((tag, size)))
}

/// The next `size` bytes, which exist.
pub(super) fn content(input: &mut impl Read, size: u32) -> Result<Vec<u8>, Error> {
    let mut bytes = vec![0; size as usize];
    input.read_exact(&mut bytes)?;
    Ok(bytes)
}

/// Reads little-endian numbers from a slice.
pub(super) struct ByteReader<'a>(pub(super) &'a [u8]);

impl<'a> ByteReader<'a> {
    /// A reader of the first `size` bytes, and the rest.
    pub(super) fn split(bytes: &'a [u8], size: usize) -> Result<(Self, &'a [u8]), Error> {
        let (head, rest) = bytes.split_at_checked(size).ok_or(Error::Damaged("a frame is too short"))?;
        Ok((Self(head), rest))
    }

    fn next<const N: usize>(&mut self) -> [u8; N] {
        let (number, rest) = self.0.split_first_chunk().expect("a head has the size of its numbers");
        self.0 = rest;
        *number
    }

    pub(super) fn u32(&mut self) -> u32 {
        u32::from_le_bytes(self.next())
    }

    pub(super) fn u64(&mut self) -> u64 {
        u64::from_le_bytes(self.next())
    }

    pub(super) fn f32(&mut self) -> f32 {
        f32::from_le_bytes(self.next())
    }

    pub(super) fn f64(&mut self) -> f64 {
        f64::from_le_bytes(self.next())
    }
}
