//! What is kept of each run, in a file of its own: a report that is stopped goes on from there.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use roost_solver::SOLVER_REVISION;
use roost_solver::result::{EndReason, RunResult};
use serde::{Deserialize, Serialize};

use super::picture::{Picture, Shot, View, When};
use crate::exit::BadInput;

/// A run's result and the pictures taken of it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Record {
    pub(super) result: RunResult,
    /// The machine that ran it, in words.
    pub(super) machine: String,
    /// The pictures that were asked for; a run that ended before the moment of one has none of it.
    pub(super) shots: Vec<Shot>,
    pub(super) pictures: Vec<Picture>,
}

impl Record {
    /// Whether its numbers may enter a mean: what diverged, or was stopped, tells nothing but that.
    pub(super) fn is_sound(&self) -> bool {
        !matches!(self.result.end_reason, EndReason::Unstable | EndReason::Cancelled)
    }

    /// What ran it, in words.
    pub(super) fn computed_by(&self) -> String {
        let solver = &self.result.solver;
        format!("{}: {} ({})", self.machine, solver.backend, solver.device)
    }

    /// A response as a number, if it was reached.
    pub(super) fn response(&self, name: &str) -> Option<f64> {
        self.result.response(name)
    }

    /// The picture from that side at that moment.
    pub(super) fn picture(&self, view: View, when: When) -> Option<&Picture> {
        let shot = Shot { view, when };
        self.pictures.iter().find(|picture| picture.shot == shot)
    }
}

/// This machine, in words: its processor and how many there are.
pub(super) fn this_machine() -> String {
    let about = fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let model = about.lines().find_map(|line| line.strip_prefix("model name")?.split_once(':'));
    let processor = model.map_or(std::env::consts::ARCH, |(_, model)| model.trim());
    let count = std::thread::available_parallelism().map_or(1, usize::from);
    format!("{processor}, {count} processor(s)")
}

/// A folder of records, by the digest of the scenario and the revision of the solver.
#[derive(Clone, Debug)]
pub(super) struct Store(PathBuf);

impl Store {
    pub(super) fn in_folder(folder: PathBuf) -> Self {
        Self(folder)
    }

    /// Makes the folder if need be.
    pub(super) fn prepare(&self) -> Result<(), BadInput> {
        fs::create_dir_all(&self.0)
            .map_err(|error| BadInput(format!("cannot make the folder {}: {error}", self.0.display())))
    }

    fn path(&self, digest: &str) -> PathBuf {
        self.0.join(format!("{digest}-{SOLVER_REVISION}.json"))
    }

    /// The record of a scenario, if it is there. What cannot be read, or was made for other pictures, is not.
    pub(super) fn load(&self, digest: &str, shots: &[Shot]) -> Option<Record> {
        let text = fs::read(self.path(digest)).ok()?;
        let record: Record = serde_json::from_slice(&text).ok()?;
        let is_asked = |shot: &Shot| record.shots.contains(shot);
        (record.result.scenario_digest == digest && shots.iter().all(is_asked)).then_some(record)
    }

    /// Keeps a record; a reader sees all of it or nothing.
    pub(super) fn save(&self, record: &Record) -> Result<()> {
        let path = self.path(&record.result.scenario_digest);
        write(&path, &serde_json::to_vec(record)?)
    }
}

/// Writes a file beside its place and moves it there when it is whole.
pub(super) fn write(path: &Path, content: &[u8]) -> Result<()> {
    let beside = path.with_extension("part");
    let written = fs::write(&beside, content).and_then(|()| fs::rename(&beside, path));
    written.with_context(|| format!("cannot write {}", path.display()))
}
