//! Checkpoints and shared fills of `roost run`.

use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;
use std::{env, fs, io};

use anyhow::Result;
use roost_solver::files::write_atomically;
use roost_solver::{Checked, Checkpoint, Stamp};
use roost_terminal::{BadInput, format, message};
use roost_worker::checkpoints::{CheckpointSlot, Resume};
use roost_worker::device::Device;
use roost_worker::fills::FillCache;
use roost_worker::runner::Extras;
use tokio::task::{JoinHandle, spawn_blocking};

use crate::interval::interval;

/// File of the checkpoint in the folder of the result.
const FILE: &str = "checkpoint.roost";

/// Maximum size of the cache of filled states, in bytes.
const FILL_CACHE_BYTES: u64 = 4 << 30;

/// Options for checkpoints.
#[derive(Debug, clap::Args)]
#[command(next_help_heading = "Checkpoints")]
pub(crate) struct CheckpointArgs {
    /// Store a checkpoint (the state of the run) after each interval of this length, such as 30s, 5m or 1h, and at Ctrl-C. If you
    /// repeat the same command, the run continues from the checkpoint
    #[arg(long, value_name = "TIME", value_parser = interval, conflicts_with = "frames")]
    checkpoint_every: Option<Duration>,
    /// Begin the run at zero, even if the folder of the result has a checkpoint
    #[arg(long, requires = "checkpoint_every")]
    from_start: bool,
    /// Folder for filled states. A filled state is the state of a hopper after its fill. Later runs with the same fill start from
    /// this state. With an empty name, the run uses and stores no filled state [default: roost/fills in the user's cache folder]
    #[arg(long, value_name = "DIR", env = "ROOST_FILLS")]
    fills: Option<OsString>,
    /// Use no filled state, and store no filled state, so that this run fills its own hopper
    #[arg(long)]
    no_shared_fill: bool,
}

/// The checkpoints of a run.
pub(crate) struct Checkpoints {
    file: PathBuf,
    /// Where the run puts them, and the task that writes them; none without checkpoints.
    writer: Option<(CheckpointSlot, JoinHandle<()>)>,
    warning: Arc<Mutex<Option<String>>>,
    saves: bool,
}

impl CheckpointArgs {
    /// Finds where the run continues from, and starts to write what it saves.
    pub(crate) fn prepare(
        &self,
        folder: &Path,
        device: &Device,
        checked: &Checked,
        has_frames: bool,
    ) -> Result<(Checkpoints, Extras)> {
        let stamp = device.stamp(checked).map_err(anyhow::Error::msg)?;
        let file = folder.join(FILE);
        let mut extras = Extras::default();
        let mut checkpoints = Checkpoints {
            file,
            writer: None,
            warning: Arc::default(),
            saves: self.checkpoint_every.is_some(),
        };
        if self.checkpoint_every.is_none() && checkpoints.file.exists() {
            let file = checkpoints.file.display();
            message!("begins at zero, and keeps {file}: --checkpoint-every continues from there");
        }
        if let Some(interval) = self.checkpoint_every.filter(|interval| !interval.is_zero()) {
            let saved = if self.from_start { None } else { read(&checkpoints.file, &stamp)? };
            if let Some(saved) = saved {
                let at = format::significant(saved.head.simulated_s);
                message!("continues from the checkpoint at {at} s of simulated time");
                extras.resume = Some(Resume { checkpoint: Box::pin(async { Some(saved) }), refused: None });
            }
            let slot = CheckpointSlot::also_at_cancel(interval);
            extras.checkpoints = Some(slot.clone());
            checkpoints.write(slot);
        }
        extras.fills = self.fill_cache(&stamp);
        // Frames show the fill as well.
        let cache = extras.fills.clone().filter(|_| extras.resume.is_none() && !has_frames);
        if let Some((cache, filled)) = cache.and_then(|cache| Some((cache.clone(), cache.load(&stamp)?))) {
            message!("starts from a hopper filled before");
            let refused = Box::new(move |reason: String| {
                message!("{reason}; the hopper is filled again");
                cache.discard(&stamp);
            });
            extras.resume =
                Some(Resume { checkpoint: Box::pin(async { Some(filled) }), refused: Some(refused) });
        }
        Ok((checkpoints, extras))
    }

    /// The cache of filled states, for runs that share their fill. A folder that cannot be used is named once.
    fn fill_cache(&self, stamp: &Stamp) -> Option<FillCache> {
        if self.no_shared_fill || stamp.fill_digest.is_none() {
            return None;
        }
        let given = self.fills.clone().map(PathBuf::from);
        let folder = given.or_else(user_folder).filter(|folder| !folder.as_os_str().is_empty())?;
        match FillCache::open(&folder, FILL_CACHE_BYTES) {
            Ok(cache) => Some(cache),
            Err(error) => {
                message!("the folder of filled hoppers {} cannot be used: {error}", folder.display());
                None
            }
        }
    }
}

/// The folder of filled states in the user's cache folder, by the XDG rules or those of Windows.
fn user_folder() -> Option<PathBuf> {
    let absolute = |name: &str| env::var_os(name).map(PathBuf::from).filter(|path| path.is_absolute());
    let home = || Some(absolute("HOME")?.join(".cache"));
    let cache = absolute("XDG_CACHE_HOME").or_else(home).or_else(|| absolute("LOCALAPPDATA"))?;
    Some(cache.join("roost/fills"))
}

/// The checkpoint in a file, if there is one.
fn read(file: &Path, stamp: &Stamp) -> Result<Option<Checkpoint>> {
    let bytes = match fs::read(file) {
        Ok(bytes) => bytes,
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
        Err(error) => return Err(BadInput(format!("cannot read {}: {error}", file.display())).into()),
    };
    let saved = Checkpoint::from_bytes(&bytes).and_then(|saved| saved.fits(stamp).map(|()| saved));
    saved
        .map(Some)
        .map_err(|error| BadInput(format!("{}: {error}; --from-start begins at zero", file.display())).into())
}

impl Checkpoints {
    /// Starts to write what is put into a slot. A failure is a warning: the run goes on, and the last file stays.
    fn write(&mut self, slot: CheckpointSlot) {
        let (file, warning) = (self.file.clone(), self.warning.clone());
        let saving = slot.clone();
        let writer = tokio::spawn(async move {
            while let Some(saved) = saving.take().await {
                let file = file.clone();
                let written = spawn_blocking(move || write_atomically(&file, &saved.to_bytes()));
                if let Err(error) = written.await.map_err(io::Error::other).flatten() {
                    let text = format!("the checkpoint was not saved: {error}");
                    *warning.lock().unwrap_or_else(PoisonError::into_inner) = Some(text);
                }
            }
        });
        self.writer = Some((slot, writer));
    }

    /// A warning that was not shown yet.
    pub(crate) fn warning(&self) -> Option<String> {
        self.warning.lock().unwrap_or_else(PoisonError::into_inner).take()
    }

    /// Waits for the last file of a run that has ended.
    pub(crate) async fn close(&mut self) {
        let Some((slot, writer)) = self.writer.take() else { return };
        slot.close();
        let _ = writer.await;
        if let Some(warning) = self.warning() {
            message!("{warning}");
        }
    }

    /// Deletes the file of a run whose result is written; says how another one continues.
    pub(crate) fn finish(&self, is_at_its_end: bool) {
        if self.saves && is_at_its_end {
            let _ = fs::remove_file(&self.file);
        } else if self.saves && self.file.exists() {
            message!("the same command continues from {}", self.file.display());
        }
    }
}
