//! Writes a stream of frames.

use std::io::Write;

use flate2::Compression;
use flate2::write::ZlibEncoder;
use glam::DVec3;
use roost_solver::engine::run::Snapshot;
use roost_solver::engine::state::State;

use super::pack::{pack_places, pack_speeds, quantise, quantise_speed};
use super::{
    CHUNK_HEAD, ENTRY, Error, FRAME, FRAME_HEAD, HEADER, Header, INDEX, IndexEntry, LAST, LAST_CHUNK, MAGIC,
    MAX_HEADER_BYTES,
};

/// Writer of a stream. It flushes after every frame: the stream of a killed process is readable up to its last complete frame.
#[derive(Debug)]
pub struct Writer<W> {
    out: W,
    written: u64,
    low: DVec3,
    high: DVec3,
    first_serials: Vec<u32>,
    index: Vec<IndexEntry>,
}

/// An encoded frame.
#[derive(Debug)]
pub struct PackedFrame {
    bytes: Vec<u8>,
    simulated_s: f64,
    belt_time_s: Option<f64>,
}

impl PackedFrame {
    /// Bytes that it adds to the stream, with its entry in the index.
    pub fn size(&self) -> u64 {
        (self.bytes.len() + ENTRY) as u64
    }
}

impl<W: Write> Writer<W> {
    /// Starts a stream with its header.
    ///
    /// # Errors
    /// When the header is too long or `out` cannot be written.
    pub fn new(out: W, header: &Header) -> Result<Self, Error> {
        let mut writer = Self {
            out,
            written: 0,
            low: DVec3::from_array(header.low_m),
            high: DVec3::from_array(header.high_m),
            first_serials: header.first_serials()?,
            index: Vec::new(),
        };
        let text = serde_json::to_vec(header)?;
        if text.len() > MAX_HEADER_BYTES as usize {
            return Err(Error::HeaderTooLong(text.len()));
        }
        let mut bytes = MAGIC.to_vec();
        bytes.extend(chunk(HEADER, &text));
        writer.put(&bytes)?;
        Ok(writer)
    }

    /// Bytes of the stream if it ends now.
    pub fn size(&self) -> u64 {
        self.written + CHUNK_HEAD + (self.index.len() * ENTRY) as u64 + LAST_CHUNK
    }

    /// Encodes a snapshot.
    ///
    /// # Errors
    /// None in practice: the encoding happens in memory.
    pub fn pack(&self, snapshot: &Snapshot<'_>) -> Result<PackedFrame, Error> {
        let state = snapshot.state;
        let body = self.body(state);
        let mut content = Vec::new();
        content.extend(snapshot.simulated_s.to_le_bytes());
        content.extend(snapshot.belt_time_s.unwrap_or(f64::NAN).to_le_bytes());
        content.extend((state.particles.len() as u32).to_le_bytes());
        content.extend((body.len() as u32).to_le_bytes());
        debug_assert_eq!(content.len(), FRAME_HEAD);
        let mut zlib = ZlibEncoder::new(content, Compression::default());
        zlib.write_all(&body)?;
        let bytes = chunk(FRAME, &zlib.finish()?);
        Ok(PackedFrame { bytes, simulated_s: snapshot.simulated_s, belt_time_s: snapshot.belt_time_s })
    }

    /// Appends a frame.
    ///
    /// # Errors
    /// When the stream cannot be written.
    pub fn append(&mut self, frame: &PackedFrame) -> Result<(), Error> {
        let PackedFrame { simulated_s, belt_time_s, .. } = *frame;
        let offset = self.written;
        self.put(&frame.bytes)?;
        self.index.push(IndexEntry { offset, simulated_s, belt_time_s });
        Ok(())
    }

    /// Ends the stream with its index; returns the underlying writer.
    ///
    /// # Errors
    /// When the stream cannot be written.
    pub fn finish(mut self) -> Result<W, Error> {
        let at = self.written;
        let mut entries = Vec::with_capacity(self.index.len() * ENTRY);
        for entry in &self.index {
            entries.extend(entry.offset.to_le_bytes());
            entries.extend(entry.simulated_s.to_le_bytes());
            entries.extend(entry.belt_time_s.unwrap_or(f64::NAN).to_le_bytes());
        }
        let mut bytes = chunk(INDEX, &entries);
        bytes.extend(chunk(LAST, &at.to_le_bytes()));
        self.put(&bytes)?;
        Ok(self.out)
    }

    fn put(&mut self, bytes: &[u8]) -> Result<(), Error> {
        self.out.write_all(bytes)?;
        self.out.flush()?;
        self.written += bytes.len() as u64;
        Ok(())
    }

    /// The body of a frame before compression.
    fn body(&self, state: &State) -> Vec<u8> {
        let positions: Vec<DVec3> = (0..state.particles.len()).map(|i| state.position(i)).collect();
        // The box of the domain, so that sub-particles at rest keep their quantised position; enlarged where one is outside.
        let low = positions.iter().copied().fold(self.low, DVec3::min);
        let high = positions.iter().copied().fold(self.high, DVec3::max);
        let top = state.particles.iter().map(|p| p.velocity.length()).fold(0.0, f32::max);

        let (mut bodies, mut broken, mut missing) = (Vec::new(), Vec::new(), Vec::new());
        for (number, range) in state.body_ranges() {
            let mut here = state.serials[range.clone()].iter().peekable();
            let [first, end] = [number, number + 1].map(|k| self.first_serials[k as usize]);
            missing.extend((first..end).filter(|serial| here.next_if_eq(&serial).is_none()));
            bodies.push(number);
            broken.push(state.broken[range].iter().sum::<u32>());
        }

        let mut body = Vec::with_capacity(64 + 8 * bodies.len() + 4 * missing.len() + 7 * positions.len());
        for corner in [low, high] {
            body.extend(corner.to_array().iter().flat_map(|x| x.to_le_bytes()));
        }
        body.extend(top.to_le_bytes());
        for count in [bodies.len(), missing.len(), positions.len()] {
            body.extend((count as u32).to_le_bytes());
        }
        for list in [&bodies, &broken, &missing] {
            body.extend(list.iter().flat_map(|x| x.to_le_bytes()));
        }
        for axis in 0..3 {
            let place = |x: &DVec3| quantise(x[axis], low[axis], high[axis]);
            pack_places(&positions.iter().map(place).collect::<Vec<_>>(), &mut body);
        }
        let speed = |p: &roost_solver::engine::state::Particle| quantise_speed(p.velocity.length(), top);
        pack_speeds(&state.particles.iter().map(speed).collect::<Vec<_>>(), &mut body);
        body
    }
}

/// A chunk: tag, length of the content, content.
fn chunk(tag: [u8; 4], content: &[u8]) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(CHUNK_HEAD as usize + content.len());
    bytes.extend(tag);
    bytes.extend((content.len() as u32).to_le_bytes());
    bytes.extend(content);
    bytes
}
