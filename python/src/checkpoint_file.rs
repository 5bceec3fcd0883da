//! The checkpoint file of a run. `roost run --checkpoint-every` reads and writes the same file.

use std::fs;
use std::io;
use std::path::PathBuf;
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use roost_solver::files::write_atomically;
use roost_solver::{Checkpoint, Stamp};

/// The checkpoint file of a run.
pub(crate) struct CheckpointFile {
    path: PathBuf,
    interval: Duration,
    taken_at: Instant,
    /// Writes the last checkpoint beside the run.
    writer: Option<JoinHandle<io::Result<()>>>,
    /// Why the last checkpoint is not in the file. The one before it then still is.
    warning: Option<String>,
}

impl CheckpointFile {
    pub(crate) fn new(path: PathBuf, interval: Duration) -> Self {
        Self { path, interval, taken_at: Instant::now(), writer: None, warning: None }
    }

    /// The checkpoint in the file, if there is one.
    ///
    /// # Errors
    /// A file that cannot be read, or that is no checkpoint of this run.
    pub(crate) fn read(&self, stamp: &Stamp) -> Result<Option<Checkpoint>, String> {
        let file = self.path.display();
        let bytes = match fs::read(&self.path) {
            Ok(bytes) => bytes,
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
            Err(error) => return Err(format!("cannot read {file}: {error}")),
        };
        let saved = Checkpoint::from_bytes(&bytes).and_then(|saved| saved.fits(stamp).map(|()| saved));
        saved.map(Some).map_err(|error| format!("{file}: {error}; from_start=True begins at zero"))
    }

    /// Whether the interval has passed, and the checkpoint before is written.
    pub(crate) fn is_due(&self) -> bool {
        self.taken_at.elapsed() >= self.interval && self.writer.as_ref().is_none_or(JoinHandle::is_finished)
    }

    /// Starts to write a checkpoint, after the one before.
    pub(crate) fn write(&mut self, checkpoint: Checkpoint) {
        self.wait();
        self.taken_at = Instant::now();
        let path = self.path.clone();
        self.writer = Some(std::thread::spawn(move || write_atomically(&path, &checkpoint.to_bytes())));
    }

    /// Waits for the last file. A run at its end needs none. Gives a warning if it could not be written.
    pub(crate) fn finish(&mut self, is_at_its_end: bool) -> Option<String> {
        self.wait();
        if is_at_its_end {
            let _ = fs::remove_file(&self.path);
        }
        self.warning.take()
    }

    fn wait(&mut self) {
        let Some(writer) = self.writer.take() else { return };
        let written = writer.join().unwrap_or_else(|_| Err(io::Error::other("its thread panicked")));
        self.warning = written.err().map(|error| format!("the checkpoint was not saved: {error}"));
    }
}
