//! Records of runs: a file per run, from which a stopped report continues.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use roost_solver::result::{EndReason, RunResult};
use roost_solver::{Checkpoint, SOLVER_REVISION, files};
use roost_terminal::BadInput;
use serde::{Deserialize, Serialize};

use crate::picture::{Moment, Picture, Shot, View};

/// The result of a run and its pictures.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Record {
    pub(crate) result: RunResult,
    /// Name of the machine that computed it.
    pub(crate) machine: String,
    /// The requested pictures; a run may end before the moment of one.
    pub(crate) shots: Vec<Shot>,
    pub(crate) pictures: Vec<Picture>,
}

impl Record {
    /// Whether its numbers may enter a mean: the run neither diverged nor was stopped.
    pub(crate) fn is_sound(&self) -> bool {
        !matches!(self.result.end_reason, EndReason::Unstable | EndReason::Cancelled)
    }

    /// Names of machine, backend and device.
    pub(crate) fn computed_by(&self) -> String {
        let solver = &self.result.solver;
        format!("{}: {} ({})", self.machine, solver.backend, solver.device)
    }

    /// A response as a number, if the run has it.
    pub(crate) fn response(&self, name: &str) -> Option<f64> {
        self.result.response(name)
    }

    /// The picture of a view at a moment.
    pub(crate) fn picture(&self, view: View, when: Moment) -> Option<&Picture> {
        let shot = Shot { view, when };
        self.pictures.iter().find(|picture| picture.shot == shot)
    }
}

/// Name of this machine: processor model and number of processors.
pub(crate) fn machine_name() -> String {
    let about = fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let model = about.lines().find_map(|line| line.strip_prefix("model name")?.split_once(':'));
    let processor = model.map_or(std::env::consts::ARCH, |(_, model)| model.trim());
    let count = std::thread::available_parallelism().map_or(1, usize::from);
    format!("{processor}, {count} processor(s)")
}

/// A folder of records, named by scenario digest and solver revision.
#[derive(Clone, Debug)]
pub(crate) struct Store(PathBuf);

impl Store {
    pub(crate) fn in_folder(folder: PathBuf) -> Self {
        Self(folder)
    }

    /// Creates the folder if it does not exist.
    pub(crate) fn create_folder(&self) -> Result<(), BadInput> {
        fs::create_dir_all(&self.0)
            .map_err(|error| BadInput(format!("cannot create the folder {}: {error}", self.0.display())))
    }

    fn path(&self, digest: &str) -> PathBuf {
        self.0.join(format!("{digest}-{SOLVER_REVISION}.json"))
    }

    /// The record of a scenario, if a readable one with all requested pictures exists.
    pub(crate) fn load(&self, digest: &str, shots: &[Shot]) -> Option<Record> {
        let text = fs::read(self.path(digest)).ok()?;
        let record: Record = serde_json::from_slice(&text).ok()?;
        let has_shot = |shot: &Shot| record.shots.contains(shot);
        (record.result.scenario_digest == digest && shots.iter().all(has_shot)).then_some(record)
    }

    /// Saves a record atomically.
    pub(crate) fn save(&self, record: &Record) -> Result<()> {
        let path = self.path(&record.result.scenario_digest);
        write_atomically(&path, &serde_json::to_vec(record)?)?;
        // The files of its checkpoint have no more use.
        self.checkpoint_files(&record.result.scenario_digest).iter().for_each(|file| {
            let _ = fs::remove_file(file);
        });
        Ok(())
    }

    /// Files of a checkpoint, and of the pictures taken before it.
    fn checkpoint_files(&self, digest: &str) -> [PathBuf; 2] {
        ["checkpoint", "pictures"].map(|part| self.0.join(format!("{digest}-{SOLVER_REVISION}.{part}")))
    }

    /// Saves a run in progress, with the pictures taken so far.
    pub(crate) fn save_checkpoint(
        &self,
        digest: &str,
        saved: &Checkpoint,
        shots: &[Shot],
        pictures: &[Picture],
    ) -> Result<()> {
        let [checkpoint, beside] = self.checkpoint_files(digest);
        // In this order: pictures that are later than the checkpoint are taken again.
        write_atomically(&beside, &serde_json::to_vec(&(shots, pictures))?)?;
        write_atomically(&checkpoint, &saved.to_bytes())
    }

    /// The checkpoint of a run and the pictures taken before it, if both can be read and all requested pictures were due.
    pub(crate) fn load_checkpoint(&self, digest: &str, shots: &[Shot]) -> Option<(Checkpoint, Vec<Picture>)> {
        let [checkpoint, beside] = self.checkpoint_files(digest);
        let saved = Checkpoint::from_bytes(&fs::read(checkpoint).ok()?).ok()?;
        let (due, mut pictures): (Vec<Shot>, Vec<Picture>) =
            serde_json::from_slice(&fs::read(beside).ok()?).ok()?;
        if !shots.iter().all(|shot| due.contains(shot)) {
            return None;
        }
        pictures.retain(|picture| picture.simulated_s <= saved.head.simulated_s);
        Some((saved, pictures))
    }
}

/// Writes a file whole or not at all.
pub(crate) fn write_atomically(path: &Path, content: &[u8]) -> Result<()> {
    files::write_atomically(path, content).with_context(|| format!("cannot write {}", path.display()))
}
