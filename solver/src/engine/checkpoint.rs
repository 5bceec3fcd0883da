//! Checkpoints: a run between two steps, as a file. A run that goes on from one ends with the bits of an undisturbed run.
//!
//! | bytes | content |
//! |---|---|
//! | 8 | `ROOSTCKP` |
//! | 4 | [`FORMAT`], little-endian, as all numbers |
//! | 32 | blake3 of everything that follows |
//! | 4, then as many | length of the head; the head, JSON: what the checkpoint belongs to |
//! | the rest | the state, by postcard, compressed by zstd |

use std::io::Read;

use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::columns::SavedColumns;
use super::saved::SavedRun;
use super::saved_fields::SavedFields;
use super::timeline::SoFar;
use crate::result::SOLVER_REVISION;

/// Version of the format. Another version is refused.
pub const FORMAT: u32 = 1;

const MAGIC: &[u8; 8] = b"ROOSTCKP";

/// Most bytes of a head.
const MAX_HEAD_BYTES: usize = 4096;

/// Most bytes of a state for each compressed byte, and for any state. Floating-point numbers hardly shrink: no state of a run comes
/// near, and a file cannot claim the memory of the machine.
const MAX_EXPANSION: u64 = 64;
const MIN_STATE_BYTES: u64 = 16 << 20;

/// The fastest level: floating-point numbers hardly shrink further at a higher one.
const ZSTD_LEVEL: i32 = 1;

/// The run to which a checkpoint belongs. It fits no other run.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Stamp {
    /// Revision of the solver.
    pub solver_revision: u32,
    /// Backend and device, with the instruction set.
    pub device: String,
    /// Digest of the scenario.
    pub scenario_digest: String,
    /// Digest of what acts before t = 0, for experiments that fill.
    pub fill_digest: Option<String>,
}

/// Moment of a checkpoint.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Moment {
    /// Between two steps.
    Step,
    /// At t = 0, before anything that acts from then on: a filled state.
    Start,
}

/// The head of a checkpoint.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Head {
    /// The run to which it belongs.
    pub stamp: Stamp,
    /// When it was taken.
    pub moment: Moment,
    /// Simulated time since the run began, in seconds.
    pub simulated_s: f64,
    /// Wall time of the run until then, in seconds.
    pub wall_s: f64,
}

/// A run between two steps.
#[derive(Clone, Debug, PartialEq)]
pub struct Checkpoint {
    /// The run to which it belongs, and the time when it was taken.
    pub head: Head,
    pub(super) body: Body,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Body {
    pub(super) so_far: SoFar,
    /// Bodies that have entered.
    pub(super) entered: u64,
    pub(super) columns: SavedColumns,
    pub(super) monitor: SavedFields,
}

/// Why bytes are no checkpoint, or one that does not fit a run.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum CheckpointError {
    /// Other bytes.
    #[error("this is not a checkpoint of Roost")]
    Foreign,
    /// Of a later or an earlier version of the format.
    #[error("the checkpoint has format {found}; this version of Roost reads format {FORMAT}")]
    Format {
        /// Its format.
        found: u32,
    },
    /// Damaged: truncated, changed or inconsistent.
    #[error("the checkpoint is damaged: {0}")]
    Damaged(String),
    /// Of another run.
    #[error("the checkpoint is of another {what}: {found}, not {expected}")]
    Other {
        /// The property that differs.
        what: &'static str,
        /// As the checkpoint has it.
        found: String,
        /// As the run has it.
        expected: String,
    },
}

impl CheckpointError {
    fn damaged(why: impl ToString) -> Self {
        Self::Damaged(why.to_string())
    }
}

impl Checkpoint {
    pub(super) fn new(head: Head, so_far: SoFar, entered: u64, run: &SavedRun, monitor: SavedFields) -> Self {
        Self { head, body: Body { so_far, entered, columns: SavedColumns::of(run), monitor } }
    }

    /// The bytes of its file. Takes about 0.1 s for 41,000 sub-particles: leave it to another thread than the run's.
    pub fn to_bytes(&self) -> Vec<u8> {
        let head = serde_json::to_vec(&self.head).expect("a head is text and numbers");
        let body = postcard::to_allocvec(&self.body).expect("a state is numbers and lists of them");
        let body = zstd::bulk::compress(&body, ZSTD_LEVEL).expect("memory for the compressed state");
        let mut bytes =
            [&MAGIC[..], &FORMAT.to_le_bytes(), &[0; 32], &(head.len() as u32).to_le_bytes()].concat();
        bytes.extend(head);
        bytes.extend(body);
        let digest = blake3::hash(&bytes[DIGESTED_FROM..]);
        bytes[DIGESTED_FROM - 32..DIGESTED_FROM].copy_from_slice(digest.as_bytes());
        bytes
    }

    /// Reads a file.
    ///
    /// # Errors
    /// Bytes that are no checkpoint of this format, or damaged.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, CheckpointError> {
        let (head, body) = split(bytes)?;
        if blake3::hash(&bytes[DIGESTED_FROM..]).as_bytes() != &bytes[DIGESTED_FROM - 32..DIGESTED_FROM] {
            return Err(CheckpointError::damaged("its checksum does not match"));
        }
        let mut state = Vec::new();
        let decoder = zstd::Decoder::new(body).map_err(CheckpointError::damaged)?;
        let limit = (MAX_EXPANSION * body.len() as u64).max(MIN_STATE_BYTES);
        decoder.take(limit).read_to_end(&mut state).map_err(CheckpointError::damaged)?;
        match postcard::take_from_bytes(&state) {
            Ok((body, [])) => Ok(Self { head, body }),
            Ok(_) => Err(CheckpointError::damaged("its state goes on after its end")),
            Err(error) => Err(CheckpointError::damaged(error)),
        }
    }

    /// Whether a run with this stamp can go on from it.
    ///
    /// # Errors
    /// Names the property of the run that differs.
    pub fn fits(&self, stamp: &Stamp) -> Result<(), CheckpointError> {
        let own = &self.head.stamp;
        let alike = |what, found: &str, expected: &str| {
            let (found, expected) = (found.to_owned(), expected.to_owned());
            if found == expected { Ok(()) } else { Err(CheckpointError::Other { what, found, expected }) }
        };
        alike("solver revision", &own.solver_revision.to_string(), &stamp.solver_revision.to_string())?;
        alike("device", &own.device, &stamp.device)?;
        match (self.head.moment, &own.fill_digest, &stamp.fill_digest) {
            (Moment::Start, Some(found), Some(expected)) => alike("fill", found, expected),
            _ => alike("scenario", &own.scenario_digest, &stamp.scenario_digest),
        }
    }
}

/// First byte that the checksum covers.
const DIGESTED_FROM: usize = MAGIC.len() + 4 + 32;

/// The head and the compressed state.
fn split(bytes: &[u8]) -> Result<(Head, &[u8]), CheckpointError> {
    let truncated = || CheckpointError::damaged("it ends too early");
    let rest = bytes.strip_prefix(MAGIC).ok_or(CheckpointError::Foreign)?;
    let (format, rest) = rest.split_first_chunk().ok_or_else(truncated)?;
    let found = u32::from_le_bytes(*format);
    if found != FORMAT {
        return Err(CheckpointError::Format { found });
    }
    let rest = rest.get(32..).ok_or_else(truncated)?;
    let (length, rest) = rest.split_first_chunk().ok_or_else(truncated)?;
    let length = u32::from_le_bytes(*length) as usize;
    if length > MAX_HEAD_BYTES {
        return Err(CheckpointError::damaged("its head is too long"));
    }
    let (head, body) = rest.split_at_checked(length).ok_or_else(truncated)?;
    Ok((serde_json::from_slice(head).map_err(CheckpointError::damaged)?, body))
}

impl Stamp {
    /// Digest of everything that a filled state depends on; none for runs that share no fill.
    pub fn fill_key(&self) -> Option<String> {
        let Self { solver_revision, device, fill_digest, .. } = self;
        let key = format!("{FORMAT} {solver_revision} {} {device}", fill_digest.as_ref()?);
        Some(blake3::hash(key.as_bytes()).to_hex().to_string())
    }

    /// The stamp of runs of this solver.
    pub fn new(device: String, scenario_digest: String, fill_digest: Option<String>) -> Self {
        Self { solver_revision: SOLVER_REVISION, device, scenario_digest, fill_digest }
    }
}
