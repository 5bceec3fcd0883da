//! Reads a stream of frames, complete or not, and checks all its numbers.
//!
//! Memory is bounded by the bytes of the file and by the bodies in the header.

use std::io::{Read, Seek, SeekFrom};

use flate2::read::ZlibDecoder;
use glam::DVec3;

use super::bytes::{ByteReader, chunk_head, content};
use super::pack::{error, restore, restore_speed, unpack_places, unpack_speeds};
use super::{
    BODY_HEAD, CHUNK_HEAD, ENTRY, Error, FRAME, FRAME_HEAD, HEADER, Header, INDEX, LAST, LAST_CHUNK, MAGIC,
    MAX_HEADER_BYTES, SCHEMA,
};

/// Place and time of a frame in the stream.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct IndexEntry {
    /// Offset of its chunk, in bytes.
    pub offset: u64,
    /// Simulated time since the run began, in seconds.
    pub simulated_s: f64,
    /// Belt time in seconds; `None` before the start.
    pub belt_time_s: Option<f64>,
}

/// A frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Frame {
    /// Simulated time since the run began, in seconds.
    pub simulated_s: f64,
    /// Belt time in seconds; `None` before the start.
    pub belt_time_s: Option<f64>,
    /// The bodies in the frame, ascending by number.
    pub bodies: Vec<Body>,
    /// Serials of the sub-particles in the frame: body by body, in the order of their lattice.
    pub serials: Vec<u32>,
    /// Their centres, in metres.
    pub positions: Vec<DVec3>,
    /// Their speeds, in m/s.
    pub speeds: Vec<f32>,
    /// Maximum error of a position along each axis, in metres.
    pub error_m: DVec3,
}

/// A body in a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Body {
    /// Its number.
    pub number: u32,
    /// Its broken bonds.
    pub bonds_broken: u32,
    /// Its sub-particles in the frame.
    pub subparticles: u32,
}

/// Reader of a stream.
#[derive(Debug)]
pub struct Reader<R> {
    input: R,
    length: u64,
    header: Header,
    first_serials: Vec<u32>,
    index: Vec<IndexEntry>,
    is_complete: bool,
}

impl<R: Read + Seek> Reader<R> {
    /// Opens a stream: reads its header and its index, or searches for frames where the index is missing.
    ///
    /// # Errors
    /// When it is not a stream of frames, its header is incomplete, or reading fails.
    pub fn open(mut input: R) -> Result<Self, Error> {
        let length = input.seek(SeekFrom::End(0))?;
        input.rewind()?;
        let mut magic = Vec::new();
        input.by_ref().take(8).read_to_end(&mut magic)?;
        if magic != MAGIC {
            return Err(Error::NotFrames);
        }
        let (tag, size) =
            chunk_head(&mut input, 8, length)?.ok_or(Error::Damaged("the header is incomplete"))?;
        if tag != HEADER || size > MAX_HEADER_BYTES {
            return Err(Error::Damaged("the header is missing"));
        }
        let header = read_header(&content(&mut input, size)?)?;
        let first_serials = header.first_serials()?;
        let mut reader = Self { input, length, header, first_serials, index: Vec::new(), is_complete: true };
        let first = MAGIC.len() as u64 + CHUNK_HEAD + u64::from(size);
        match reader.index_at_end(first)? {
            Some(index) => reader.index = index,
            None => {
                reader.index = reader.scan(first)?;
                reader.is_complete = false;
            }
        }
        Ok(reader)
    }

    /// The header.
    pub fn header(&self) -> &Header {
        &self.header
    }

    /// The frames in the stream.
    pub fn index(&self) -> &[IndexEntry] {
        &self.index
    }

    /// Whether the stream has an index at its end. An incomplete stream has all frames up to the last complete one.
    pub fn is_complete(&self) -> bool {
        self.is_complete
    }

    /// Simulated time at the start of the belt, in seconds; `None` if no frame is that late.
    pub fn start_s(&self) -> Option<f64> {
        self.index.iter().find_map(|entry| Some(entry.simulated_s - entry.belt_time_s?))
    }

    /// Reads a frame by its number, from 0.
    ///
    /// # Errors
    /// When the frame does not exist or is damaged, or reading fails.
    pub fn frame(&mut self, number: usize) -> Result<Frame, Error> {
        let frames = self.index.len();
        let offset = self.index.get(number).ok_or(Error::NoFrame { number, frames })?.offset;
        self.input.seek(SeekFrom::Start(offset))?;
        let head = chunk_head(&mut self.input, offset, self.length)?;
        let Some((FRAME, size)) = head.filter(|(_, size)| *size as usize >= FRAME_HEAD) else {
            return Err(Error::Damaged("the index names a place without a frame"));
        };
        let content = content(&mut self.input, size)?;
        let (mut head, packed) = ByteReader::split(&content, FRAME_HEAD)?;
        let (simulated_s, belt_time_s) = (head.f64(), belt_time(head.f64()));
        let [subparticles, unpacked] = [head.u32(), head.u32()];
        // The maximum size, with all bodies and sub-particles.
        let bodies = self.header.bodies.len() as u64;
        let most = BODY_HEAD as u64 + 8 * bodies + 11 * u64::from(*self.first_serials.last().unwrap_or(&0));
        if u64::from(unpacked) > most {
            return Err(Error::Damaged("a frame is longer than its bodies can be"));
        }
        let mut body = Vec::new();
        let read = ZlibDecoder::new(packed).take(u64::from(unpacked) + 1).read_to_end(&mut body);
        if read.is_err() || body.len() != unpacked as usize {
            return Err(Error::Damaged("a frame cannot be unpacked"));
        }
        self.unpack(simulated_s, belt_time_s, subparticles as usize, &body)
    }

    fn unpack(
        &self,
        simulated_s: f64,
        belt_time_s: Option<f64>,
        count: usize,
        body: &[u8],
    ) -> Result<Frame, Error> {
        let (mut head, lists) = ByteReader::split(body, BODY_HEAD)?;
        let low = DVec3::new(head.f64(), head.f64(), head.f64());
        let high = DVec3::new(head.f64(), head.f64(), head.f64());
        let top = head.f32();
        let [bodies, missing, here] = [(); 3].map(|()| head.u32() as usize);
        if lists.len() as u64 != 8 * bodies as u64 + 4 * missing as u64 + 7 * here as u64 || here != count {
            return Err(Error::Damaged("the parts of a frame do not make its length"));
        }
        if !(low.cmple(high).all() && (high - low).is_finite() && top.is_finite()) {
            return Err(Error::Damaged("a frame has no box"));
        }
        let (numbers, rest) = lists.split_at(4 * bodies);
        let (broken, rest) = rest.split_at(4 * bodies);
        let (gone, rest) = rest.split_at(4 * missing);
        let (bodies, serials) = self.bodies_present(words(numbers), words(broken), words(gone))?;
        if serials.len() != here {
            return Err(Error::Damaged("bodies and sub-particles of a frame do not go together"));
        }
        let axes: [Vec<u16>; 3] = std::array::from_fn(|axis| {
            let plane = |k: usize| &rest[k * here..][..here];
            unpack_places(plane(2 * axis), plane(2 * axis + 1))
        });
        let at = |i: usize| DVec3::from_array([0, 1, 2].map(|k| restore(axes[k][i], low[k], high[k])));
        Ok(Frame {
            simulated_s,
            belt_time_s,
            bodies,
            serials,
            positions: (0..here).map(at).collect(),
            speeds: unpack_speeds(&rest[6 * here..]).map(|step| restore_speed(step, top)).collect(),
            error_m: DVec3::from_array([0, 1, 2].map(|k| error(low[k], high[k]))),
        })
    }

    /// The bodies in a frame, and the serials of their sub-particles.
    fn bodies_present(
        &self,
        numbers: impl Iterator<Item = u32>,
        broken: impl Iterator<Item = u32>,
        missing: impl Iterator<Item = u32>,
    ) -> Result<(Vec<Body>, Vec<u32>), Error> {
        let (mut bodies, mut serials) = (Vec::<Body>::new(), Vec::new());
        let mut missing = missing.peekable();
        for (number, bonds_broken) in numbers.zip(broken) {
            let range =
                self.first_serials.get(number as usize).zip(self.first_serials.get(number as usize + 1));
            let (Some((&first, &end)), false) =
                (range, bodies.last().is_some_and(|last| last.number >= number))
            else {
                return Err(Error::Damaged("the bodies of a frame are not ascending bodies of the header"));
            };
            let before = serials.len();
            serials.extend((first..end).filter(|serial| missing.next_if_eq(serial).is_none()));
            bodies.push(Body { number, bonds_broken, subparticles: (serials.len() - before) as u32 });
        }
        match missing.next() {
            None => Ok((bodies, serials)),
            Some(_) => Err(Error::Damaged(
                "the missing sub-particles of a frame are not ascending ones of its bodies",
            )),
        }
    }

    /// The index at the end of the stream, if it has one.
    fn index_at_end(&mut self, first: u64) -> Result<Option<Vec<IndexEntry>>, Error> {
        let Some(last) = self.length.checked_sub(LAST_CHUNK).filter(|last| *last >= first) else {
            return Ok(None);
        };
        self.input.seek(SeekFrom::Start(last))?;
        let Some((LAST, 8)) = chunk_head(&mut self.input, last, self.length)? else { return Ok(None) };
        let at = ByteReader(&content(&mut self.input, 8)?).u64();
        if at < first || at > last {
            return Ok(None);
        }
        self.input.seek(SeekFrom::Start(at))?;
        let Some((INDEX, size)) = chunk_head(&mut self.input, at, last)? else { return Ok(None) };
        let content = content(&mut self.input, size)?;
        let entries = content.chunks_exact(ENTRY).map(|entry| {
            let mut entry = ByteReader(entry);
            let (offset, simulated_s) = (entry.u64(), entry.f64());
            IndexEntry { offset, simulated_s, belt_time_s: belt_time(entry.f64()) }
        });
        Ok(Some(entries.collect()))
    }

    /// Walks over all complete chunks.
    fn scan(&mut self, first: u64) -> Result<Vec<IndexEntry>, Error> {
        let (mut index, mut offset) = (Vec::new(), first);
        loop {
            self.input.seek(SeekFrom::Start(offset))?;
            let Some((tag, size)) = chunk_head(&mut self.input, offset, self.length)? else {
                return Ok(index);
            };
            if tag == FRAME && size as usize >= FRAME_HEAD {
                let head = content(&mut self.input, FRAME_HEAD as u32)?;
                let mut head = ByteReader(&head);
                let (simulated_s, belt_time_s) = (head.f64(), belt_time(head.f64()));
                index.push(IndexEntry { offset, simulated_s, belt_time_s });
            }
            offset += CHUNK_HEAD + u64::from(size);
        }
    }
}

fn read_header(bytes: &[u8]) -> Result<Header, Error> {
    /// The schema is read first, since another schema may have other fields.
    #[derive(serde::Deserialize)]
    struct Version {
        schema: String,
    }
    let Version { schema } = serde_json::from_slice(bytes)?;
    if schema == SCHEMA { Ok(serde_json::from_slice(bytes)?) } else { Err(Error::Schema(schema)) }
}

fn belt_time(seconds: f64) -> Option<f64> {
    (!seconds.is_nan()).then_some(seconds)
}

fn words(bytes: &[u8]) -> impl Iterator<Item = u32> + '_ {
    bytes.chunks_exact(4).map(|word| ByteReader(word).u32())
}
