//! Writes a stream of frames to anything that takes bytes.

use std::io::Write;

use flate2::Compression;
use flate2::write::ZlibEncoder;
use glam::DVec3;
use roost_solver::engine::run::Snapshot;
use roost_solver::engine::state::State;

use super::pack::{pack_places, pack_speeds, quantise, quantise_speed};
use super::{
    CHUNK_HEAD, ENTRY, Entry, Error, FRAME, FRAME_HEAD, HEADER, Header, INDEX, LAST, LAST_CHUNK, MAGIC,
    MOST_HEADER_BYTES,
};

/// A stream that is being written. After every frame all of it has been handed on, so that what is there when the
/// process is killed can be read up to the last whole frame.
#[derive(Debug)]
pub struct Writer<W> {
    out: W,
    written: u64,
    low: DVec3,
    high: DVec3,
    first_serials: Vec<u32>,
    index: Vec<Entry>,
}

/// A frame as it will stand in the stream.
#[derive(Debug)]
pub struct Packed {
    bytes: Vec<u8>,
    simulated_s: f64,
    belt_time_s: Option<f64>,
}

impl Packed {
    /// Bytes that it will add to the stream, its entry in the index included.
    pub fn size(&self) -> u64 {
        (self.bytes.len() + ENTRY) as u64
    }
}

impl<W: Write> Writer<W> {
    /// Begins a stream with its header.
    ///
    /// # Errors
    /// When `out` does not take it.
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
        if text.len() > MOST_HEADER_BYTES as usize {
            return Err(Error::HeaderTooLong(text.len()));
        }
        let mut bytes = MAGIC.to_vec();
        bytes.extend(chunk(HEADER, &text));
        writer.put(&bytes)?;
        Ok(writer)
    }

    /// Bytes that the stream will have if it ends now.
    pub fn size(&self) -> u64 {
        self.written + CHUNK_HEAD + (self.index.len() * ENTRY) as u64 + LAST_CHUNK
    }

    /// Makes a frame of a moment.
    ///
    /// # Errors
    /// None that a sound run can cause: packing happens in memory.
    pub fn pack(&self, snapshot: &Snapshot<'_>) -> Result<Packed, Error> {
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
        Ok(Packed { bytes, simulated_s: snapshot.simulated_s, belt_time_s: snapshot.belt_time_s })
    }

    /// Appends a frame.
    ///
    /// # Errors
    /// When the stream does not take it.
    pub fn append(&mut self, frame: &Packed) -> Result<(), Error> {
        let Packed { simulated_s, belt_time_s, .. } = *frame;
        let offset = self.written;
        self.put(&frame.bytes)?;
        self.index.push(Entry { offset, simulated_s, belt_time_s });
        Ok(())
    }

    /// Ends the stream with its index; returns what it was written to.
    ///
    /// # Errors
    /// When the stream does not take it.
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

    /// A frame before zlib.
    fn body(&self, state: &State) -> Vec<u8> {
        let positions: Vec<DVec3> = (0..state.particles.len()).map(|i| state.position(i)).collect();
        // The domain's box, so that what rests stays on its places from frame to frame; more where something is outside.
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

/// A chunk: its tag, the length of its content, its content.
fn chunk(tag: [u8; 4], content: &[u8]) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(CHUNK_HEAD as usize + content.len());
    bytes.extend(tag);
    bytes.extend((content.len() as u32).to_le_bytes());
    bytes.extend(content);
    bytes
}
