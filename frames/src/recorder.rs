//! The observer that writes frames during a run.
//!
//! Errors of files never stop the run: at the size limit, or when a file cannot be written, the recorder stops, leaves valid files, and reports
//! the reason.

mod paraview;
mod stream;
#[cfg(test)]
mod tests;

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use roost_solver::engine::run::Snapshot;
use roost_solver::scenario::Scenario;
use roost_solver::{Flow, Observer, Progress};

use crate::schedule::Schedule;
use crate::web::first_shape;
use paraview::{COLLECTION, FOLDER, LEGEND, ParaviewFiles};
pub use stream::STREAM;
use stream::Stream;

/// Settings of a recorder.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// Simulated time between frames, in seconds; rounded to whole samples.
    pub interval_s: f64,
    /// Whether to write files for ParaView.
    pub vtk: bool,
    /// Whether to write the stream for the web.
    pub web: bool,
    /// Maximum size of all files together, in bytes.
    pub limit_bytes: u64,
}

/// The recorded frames.
#[derive(Clone, Debug, PartialEq)]
pub struct Report {
    /// Number of frames.
    pub frames: u64,
    /// Bytes of all files.
    pub bytes: u64,
    /// Why recording stopped before the run did.
    pub stopped: Option<String>,
    /// The files to open.
    pub files: Vec<PathBuf>,
}

/// Records the frames of one run.
#[derive(Debug)]
pub struct FrameRecorder {
    folder: PathBuf,
    scenario: Scenario,
    schedule: Schedule,
    limit_bytes: u64,
    paraview: Option<ParaviewFiles>,
    stream: Option<Stream>,
    frames: u64,
    stopped: Option<String>,
}

impl FrameRecorder {
    /// A recorder that writes into a folder, which it creates if missing. It removes the frames of an earlier run.
    ///
    /// # Errors
    /// When the folder cannot be created or written.
    pub fn create(folder: &Path, scenario: &Scenario, timestep_s: f64, options: Options) -> io::Result<Self> {
        fs::create_dir_all(folder)?;
        clear(folder)?;
        let files = || ParaviewFiles::create(folder, first_shape(scenario));
        Ok(Self {
            folder: folder.to_owned(),
            scenario: scenario.clone(),
            schedule: Schedule::new(scenario, timestep_s, options.interval_s),
            limit_bytes: options.limit_bytes,
            paraview: options.vtk.then(files).transpose()?,
            stream: options.web.then(|| Stream::create(folder)).transpose()?,
            frames: 0,
            stopped: None,
        })
    }

    /// The samples that become frames.
    pub fn schedule(&self) -> &Schedule {
        &self.schedule
    }

    /// Why recording stopped before the run, if it did.
    pub fn stopped(&self) -> Option<&str> {
        self.stopped.as_deref()
    }

    /// Completes the files.
    pub fn finish(&mut self) -> Report {
        if let Some(Err(error)) = self.stream.as_mut().map(Stream::finish) {
            self.stopped.get_or_insert(format!("the index of {STREAM} cannot be written: {error}"));
        }
        let collection = self.paraview.as_ref().map(|_| self.folder.join(COLLECTION));
        let stream = self.stream.as_ref().map(|_| self.folder.join(STREAM));
        Report {
            frames: self.frames,
            bytes: self.size(),
            stopped: self.stopped.clone(),
            files: collection.into_iter().chain(stream).collect(),
        }
    }

    fn size(&self) -> u64 {
        self.paraview.as_ref().map_or(0, ParaviewFiles::size) + self.stream.as_ref().map_or(0, Stream::size)
    }

    /// Encodes a frame in memory, and writes it if it stays below the limit.
    fn record(&mut self, snapshot: &Snapshot<'_>) -> Result<(), String> {
        let no_vtk = |error: &dyn std::fmt::Display| format!("files for ParaView cannot be written: {error}");
        let no_stream = |error: &dyn std::fmt::Display| format!("{STREAM} cannot be written: {error}");
        let files = self.paraview.as_ref().map(|files| files.make(snapshot));
        let interval_s = self.schedule.interval_s();
        let packed = self.stream.as_mut().map(|stream| stream.make(&self.scenario, interval_s, snapshot));
        let packed = packed.transpose().map_err(|error| no_stream(&error))?;

        let more = files.as_ref().map_or(0, |files| files.size()) + packed.as_ref().map_or(0, |p| p.size());
        if self.size() + more > self.limit_bytes {
            return Err(format!("the next frame would exceed the limit of {} bytes", self.limit_bytes));
        }
        if let Some((stream, packed)) = self.stream.as_mut().zip(packed) {
            stream.write(&packed).map_err(|error| no_stream(&error))?;
        }
        if let Some((paraview, files)) = self.paraview.as_mut().zip(files) {
            paraview.write(snapshot, &files).map_err(|error| no_vtk(&error))?;
        }
        self.frames += 1;
        Ok(())
    }
}

impl Observer for FrameRecorder {
    fn progress(&mut self, _progress: &Progress) -> Flow {
        Flow::Continue
    }

    fn wants_snapshot(&self, simulated_s: f64) -> bool {
        self.stopped.is_none() && self.schedule.is_due(simulated_s)
    }

    fn snapshot(&mut self, snapshot: &Snapshot<'_>) {
        if let Err(why) = self.record(snapshot) {
            let at = snapshot.simulated_s;
            self.stopped.get_or_insert(format!("frames end at {at:.3} s of simulated time: {why}"));
        }
    }
}

/// Removes the files of an earlier recorder from a folder, and no others.
fn clear(folder: &Path) -> io::Result<()> {
    let is_frame = |name: &str| {
        let stem = name.strip_suffix(".vtp").unwrap_or_default();
        let number = stem.strip_prefix("particles_").or_else(|| stem.strip_prefix("surfaces_"));
        number.is_some_and(|number| number.len() >= 6 && number.bytes().all(|byte| byte.is_ascii_digit()))
    };
    let mut old = [COLLECTION, STREAM, LEGEND].map(|name| folder.join(name)).to_vec();
    let vtk = folder.join(FOLDER);
    if vtk.exists() {
        for entry in fs::read_dir(vtk)? {
            let entry = entry?;
            if entry.file_name().to_str().is_some_and(is_frame) {
                old.push(entry.path());
            }
        }
    }
    for path in old.iter().filter(|path| path.exists()) {
        fs::remove_file(path)?;
    }
    Ok(())
}
