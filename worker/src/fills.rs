//! Filled states on disk: checkpoints at t = 0, by what acted before. Runs that differ only in what acts later start from there.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::pin::Pin;
use std::sync::{Arc, Mutex, PoisonError, Weak};
use std::time::{Duration, SystemTime};
use std::{fmt, fs, io};

use roost_solver::{Checkpoint, Moment, Stamp};
use tokio::sync::{Mutex as Turn, OwnedMutexGuard, oneshot};

/// Age after which a filled state that nobody has used is deleted.
const MAX_AGE: Duration = Duration::from_secs(30 * 24 * 3600);

/// Extension of the files.
const EXTENSION: &str = "fill";

/// A folder of filled states. Processes may share it.
#[derive(Clone, Debug)]
pub struct FillCache {
    folder: PathBuf,
    limit_bytes: u64,
    /// A turn for each key, while a run of this process looks for the fill or computes it.
    turns: Arc<Mutex<HashMap<String, Weak<Turn<()>>>>>,
}

/// The turn of one run at a fill: the next one gets it when this is dropped.
pub(crate) type FillTurn = OwnedMutexGuard<()>;

impl FillCache {
    /// Opens a folder, creating it, which holds at most so many bytes.
    ///
    /// # Errors
    /// When it cannot be created.
    pub fn open(folder: &Path, limit_bytes: u64) -> io::Result<Self> {
        fs::create_dir_all(folder)?;
        Ok(Self { folder: folder.to_owned(), limit_bytes, turns: Arc::default() })
    }

    /// Waits until no other run of this process looks for the fill of this stamp or computes it; none for runs that share no fill.
    pub(crate) async fn turn(&self, stamp: &Stamp) -> Option<FillTurn> {
        let key = stamp.fill_key()?;
        let turn = {
            let mut turns = self.turns.lock().unwrap_or_else(PoisonError::into_inner);
            turns.retain(|_, turn| turn.strong_count() > 0);
            let known = turns.get(&key).and_then(Weak::upgrade);
            known.unwrap_or_else(|| {
                let turn = Arc::new(Turn::new(()));
                turns.insert(key, Arc::downgrade(&turn));
                turn
            })
        };
        Some(turn.lock_owned().await)
    }

    /// The filled state of runs with this stamp. One that is damaged is deleted.
    pub fn load(&self, stamp: &Stamp) -> Option<Checkpoint> {
        let path = self.path(stamp)?;
        let bytes = fs::read(&path).ok()?;
        match Checkpoint::from_bytes(&bytes) {
            Ok(saved) if is_fill_of(&saved, stamp) => {
                // The time of the last use. A folder that cannot be written keeps the older one.
                let _ = fs::File::options()
                    .append(true)
                    .open(&path)
                    .and_then(|file| file.set_modified(SystemTime::now()));
                Some(saved)
            }
            _ => {
                tracing::warn!(path = %path.display(), "a filled state is damaged and was deleted");
                let _ = fs::remove_file(&path);
                None
            }
        }
    }

    /// Deletes the filled state of runs with this stamp: the solver has refused it.
    pub fn discard(&self, stamp: &Stamp) {
        self.path(stamp).into_iter().for_each(|path| {
            let _ = fs::remove_file(path);
        });
    }

    /// Stores a filled state that it does not have, and deletes what is too old or too much.
    ///
    /// # Errors
    /// As the system reports them. The folder is then as before.
    pub fn store(&self, filled: &Checkpoint) -> io::Result<()> {
        let Some(path) = self.path(&filled.head.stamp).filter(|path| !path.exists()) else { return Ok(()) };
        // With the extension of the others: one that a killed process left behind is pruned like them.
        let mut file = tempfile::Builder::new().suffix(".fill").tempfile_in(&self.folder)?;
        io::Write::write_all(&mut file, &filled.to_bytes())?;
        file.as_file().sync_all()?;
        file.persist(&path)?;
        self.prune()
    }

    /// Deletes filled states: those unused for [`MAX_AGE`], and the longest unused until the rest is within the limit.
    fn prune(&self) -> io::Result<()> {
        let mut files: Vec<(SystemTime, u64, PathBuf)> = Vec::new();
        for entry in fs::read_dir(&self.folder)? {
            let path = entry?.path();
            if path.extension().is_some_and(|extension| extension == EXTENSION)
                && let Ok(about) = fs::metadata(&path)
            {
                files.push((about.modified()?, about.len(), path));
            }
        }
        files.sort_unstable();
        let mut total: u64 = files.iter().map(|(_, bytes, _)| bytes).sum();
        let now = SystemTime::now();
        for (used, bytes, path) in files {
            let is_old = now.duration_since(used).is_ok_and(|age| age > MAX_AGE);
            if is_old || total > self.limit_bytes {
                // Another process may have been faster.
                if let Err(error) = fs::remove_file(path)
                    && error.kind() != io::ErrorKind::NotFound
                {
                    return Err(error);
                }
                total -= bytes;
            }
        }
        Ok(())
    }

    fn path(&self, stamp: &Stamp) -> Option<PathBuf> {
        Some(self.folder.join(format!("{}.{EXTENSION}", stamp.fill_key()?)))
    }
}

/// Whether runs with this stamp can start from a checkpoint as their filled state.
pub(crate) fn is_fill_of(saved: &Checkpoint, stamp: &Stamp) -> bool {
    saved.head.moment == Moment::Start && saved.fits(stamp).is_ok()
}

/// The fill of a run on the server.
pub struct ServerFill {
    /// Downloads the stored one, once; none if it cannot be had. Absent if the server has none.
    pub download: Option<Pin<Box<dyn Future<Output = Option<Checkpoint>> + Send>>>,
    /// Takes the fill that the server lacks.
    pub upload: oneshot::Sender<Checkpoint>,
    /// Gets the reason when a downloaded fill cannot be used.
    pub refused: Box<dyn FnOnce(String) + Send>,
}

impl fmt::Debug for ServerFill {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("ServerFill")
    }
}

#[cfg(test)]
mod tests;
