//! The checkpoint file of a run. `roost run --checkpoint-every` reads and writes the same file.

use std::fs;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use roost_solver::{Checkpoint, Stamp};

/// The checkpoint file of a run.
pub(crate) struct CheckpointFile {
    path: PathBuf,
    interval: Duration,
    taken_at: Instant,
    /// Writes the last checkpoint beside the run.
    writer: Option<JoinHandle<io::Result<()>>>,
    /// Why the last checkpoint is not in the file. The one before it then still is.
    pub(crate) warning: Option<String>,
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

    /// Waits for the last file. A run at its end needs none.
    pub(crate) fn finish(&mut self, is_at_its_end: bool) {
        self.wait();
        if is_at_its_end {
            let _ = fs::remove_file(&self.path);
        }
    }

    fn wait(&mut self) {
        let Some(writer) = self.writer.take() else { return };
        let written = writer.join().unwrap_or_else(|_| Err(io::Error::other("its thread panicked")));
        self.warning = written.err().map(|error| format!("the checkpoint was not saved: {error}"));
    }
}

/// Writes a temporary file beside `path` and renames it, so that a reader sees the whole content or the old one.
fn write_atomically(path: &Path, content: &[u8]) -> io::Result<()> {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let mut builder = tempfile::Builder::new();
    // As the user's other new files: those of `tempfile` are for the user alone.
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    let mut file = builder.tempfile_in(folder)?;
    file.write_all(content)?;
    file.as_file().sync_all()?;
    file.persist(path)?;
    Ok(())
}
