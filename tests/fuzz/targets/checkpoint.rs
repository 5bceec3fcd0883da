//! Checkpoints: whatever the state within a sound file says, it is refused with a sentence, or the run goes on from it.
#![no_main]

use std::sync::LazyLock;

use libfuzzer_sys::fuzz_target;
use roost_solver::cpu::Cpu;
use roost_solver::mesh::Meshes;
use roost_solver::scenario::from_value;
use roost_solver::{Checked, Checkpoint, Flow, Limits, Moment, Observer, Progress, check, simulate_on};
use serde_json::json;

/// Where the checksum begins, and what it covers.
const DIGEST: std::ops::Range<usize> = 12..44;

/// Saves a run at a share of its progress, and stops it.
struct Saving(Option<Checkpoint>);

impl Observer for Saving {
    fn progress(&mut self, progress: &Progress) -> Flow {
        if progress.fraction > 0.5 { Flow::Cancel } else { Flow::Continue }
    }

    fn wants_checkpoint(&mut self, moment: Moment) -> bool {
        moment == Moment::Step
    }

    fn checkpoint(&mut self, checkpoint: Checkpoint) {
        self.0 = Some(checkpoint);
    }
}

/// Goes on for some steps.
struct SomeSteps(u32);

impl Observer for SomeSteps {
    fn progress(&mut self, _: &Progress) -> Flow {
        self.0 += 1;
        if self.0 > 3 { Flow::Cancel } else { Flow::Continue }
    }
}

/// A small hopper, its file of a checkpoint up to the state, and the state.
static SOUND: LazyLock<(Cpu, Checked, Vec<u8>, Vec<u8>)> = LazyLock::new(|| {
    let scenario = from_value(&json!({
        "experiment": "hopper", "product": {"count": 2, "subparticle_radius_m": 0.01},
        "equipment": {"hopper_width_m": 0.2, "hopper_length_m": 0.2, "feed_kg_s": 5},
        "numerics": {"timestep_s": "auto", "duration_s": 0.1, "rest_speed_m_s": 0.2},
    }));
    let checked = check(&scenario.expect("a scenario"), &Meshes::default(), &Limits::NONE).expect("it can run");
    let (cpu, mut saving) = (Cpu::new(1), Saving(None));
    simulate_on(&cpu, &checked, None, &mut saving).expect("no checkpoint to refuse");
    let bytes = saving.0.expect("it was saved").to_bytes();
    let length = u32::from_le_bytes(bytes[DIGEST.end..DIGEST.end + 4].try_into().expect("four bytes"));
    let (head, state) = bytes.split_at(DIGEST.end + 4 + length as usize);
    (cpu, checked, head.to_vec(), zstd::decode_all(state).expect("compressed"))
});

// Each five bytes change one byte of the state: its place, and what it is combined with. A rest cuts the end off.
fuzz_target!(|edits: &[u8]| {
    let (cpu, checked, head, state) = &*SOUND;
    let mut state = state.clone();
    let edits = edits.chunks_exact(5);
    let rest = edits.remainder();
    for edit in edits {
        let at = u32::from_le_bytes(edit[..4].try_into().expect("four bytes")) as usize % state.len();
        state[at] ^= edit[4];
    }
    if let [cut, ..] = rest {
        state.truncate(state.len() * usize::from(*cut) / 256);
    }
    let mut bytes = head.clone();
    bytes.extend(zstd::bulk::compress(&state, 1).expect("it fits"));
    let digest = blake3::hash(&bytes[DIGEST.end..]);
    bytes[DIGEST].copy_from_slice(digest.as_bytes());
    match Checkpoint::from_bytes(&bytes) {
        Ok(saved) => match simulate_on(cpu, checked, Some(&saved), &mut SomeSteps(0)) {
            Ok(_) => {}
            Err(error) => assert!(!error.to_string().is_empty()),
        },
        Err(error) => assert!(!error.to_string().is_empty()),
    }
});
