//! The memory of a pool: its allocations and failures, in a file of the folder `--state`. A restart reads it and continues.

use std::fs::{File, TryLockError};
use std::path::{Path, PathBuf};
use std::time::Duration;

use anyhow::{Context, Result};
use roost_api::time::Timestamp;
use roost_terminal::BadInput;
use roost_terminal::files::write_atomically;
use serde::{Deserialize, Serialize};

use super::rule::{Failures, WorkerKind};

/// The version of the file.
const SCHEMA: &str = "roost.pool/1";
/// Ended allocations that the file keeps.
const MAX_ENDED: usize = 200;

/// The state of an allocation.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum AllocationState {
    /// In Slurm's queue.
    Waiting,
    /// Slurm runs it. Its workers may not have registered yet.
    Running,
    /// Its script ended without an error.
    Completed,
    /// The pool or a user has cancelled it.
    Cancelled,
    /// It reached its time limit.
    TimedOut,
    /// Slurm gave its node to another job.
    Preempted,
    /// Its script or its node failed.
    Failed,
    /// Slurm does not know it any more.
    Forgotten,
}

impl AllocationState {
    /// Whether Slurm still holds it.
    pub(super) fn is_held(self) -> bool {
        matches!(self, Self::Waiting | Self::Running)
    }

    /// The state in words.
    pub(super) fn as_str(self) -> &'static str {
        match self {
            Self::Waiting => "waiting",
            Self::Running => "running",
            Self::Completed => "completed",
            Self::Cancelled => "cancelled",
            Self::TimedOut => "timed out",
            Self::Preempted => "preempted",
            Self::Failed => "failed",
            Self::Forgotten => "forgotten",
        }
    }
}

/// One allocation.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Allocation {
    /// Slurm's id of the job.
    pub(super) id: u64,
    pub(super) state: AllocationState,
    /// Slurm's reason why it waits, or why it ended.
    pub(super) reason: String,
    /// Whether one of its workers has registered.
    pub(super) registered: bool,
    /// When the pool submitted or adopted it.
    pub(super) submitted_at: Timestamp,
    /// When the pool first saw it run.
    pub(super) started_at: Option<Timestamp>,
    /// When the pool first saw it ended.
    pub(super) ended_at: Option<Timestamp>,
}

impl Allocation {
    /// A new one in Slurm's queue.
    pub(super) fn waiting(id: u64, now: Timestamp) -> Self {
        Self {
            id,
            state: AllocationState::Waiting,
            reason: String::new(),
            registered: false,
            submitted_at: now,
            started_at: None,
            ended_at: None,
        }
    }
}

/// All that a pool remembers.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Ledger {
    schema: String,
    /// Name of its jobs in Slurm, by which a restart finds those that the file lacks.
    pub(super) name: String,
    /// Address of the server.
    pub(super) server: String,
    /// Options of `sbatch` from the user.
    pub(super) sbatch: Vec<String>,
    /// Allocations in the order of submission.
    pub(super) allocations: Vec<Allocation>,
    /// Allocations submitted so far.
    pub(super) submitted: u64,
    pub(super) failures: Failures,
    /// First pause after failures, in seconds.
    pub(super) retry_pause_s: u64,
    /// The newest worker of the pool.
    pub(super) worker: Option<WorkerKind>,
    /// The last decision in words.
    pub(super) why: String,
    /// When the pool last looked.
    pub(super) updated_at: Timestamp,
}

impl Ledger {
    /// A pool without allocations.
    pub(super) fn new(name: String, now: Timestamp) -> Self {
        Self {
            schema: SCHEMA.to_owned(),
            name,
            server: String::new(),
            sbatch: Vec::new(),
            allocations: Vec::new(),
            submitted: 0,
            failures: Failures::default(),
            retry_pause_s: 60,
            worker: None,
            why: String::new(),
            updated_at: now,
        }
    }

    /// The allocations that Slurm holds.
    pub(super) fn held(&self) -> impl Iterator<Item = &Allocation> {
        self.allocations.iter().filter(|one| one.state.is_held())
    }

    /// The ids of the allocations in Slurm's queue.
    pub(super) fn waiting(&self) -> Vec<u64> {
        let waiting = self.held().filter(|one| one.state == AllocationState::Waiting);
        waiting.map(|one| one.id).collect()
    }

    /// Number of running allocations whose workers have, or have not, registered.
    pub(super) fn running(&self, registered: bool) -> u32 {
        let is_one =
            |one: &&Allocation| one.state == AllocationState::Running && one.registered == registered;
        self.held().filter(is_one).count() as u32
    }

    /// The end of the pause after failures, if there is one.
    pub(super) fn paused_until(&self) -> Option<Timestamp> {
        self.failures.paused_until(Duration::from_secs(self.retry_pause_s))
    }

    /// Removes the oldest ended allocations beyond the number to keep.
    pub(super) fn forget_old(&mut self) {
        let ended = self.allocations.len() - self.held().count();
        let mut excess = ended.saturating_sub(MAX_ENDED);
        self.allocations.retain(|one| {
            let is_removed = excess > 0 && !one.state.is_held();
            excess -= usize::from(is_removed);
            !is_removed
        });
    }
}

/// The folder of a pool.
#[derive(Debug)]
pub(super) struct Folder {
    path: PathBuf,
    /// Held while the pool runs.
    _lock: File,
}

impl Folder {
    /// Creates the folder, and keeps other pools out of it.
    pub(super) fn open(path: &Path) -> Result<Self> {
        let unusable = || format!("cannot use the folder {} (--state)", path.display());
        std::fs::create_dir_all(logs(path)).with_context(unusable)?;
        let path = path.canonicalize().with_context(unusable)?;
        let lock = File::create(lock_file(&path)).with_context(unusable)?;
        match lock.try_lock() {
            Ok(()) => Ok(Self { path, _lock: lock }),
            Err(TryLockError::WouldBlock) => Err(BadInput(format!(
                "another pool runs on the folder {}: name another one with --state",
                path.display()
            ))
            .into()),
            Err(TryLockError::Error(error)) => Err(error).with_context(unusable),
        }
    }

    /// The folder itself, as an absolute path.
    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// Stores the ledger.
    pub(super) fn save(&self, ledger: &Ledger) -> Result<()> {
        let mut text = serde_json::to_vec_pretty(ledger)?;
        text.push(b'\n');
        let path = ledger_file(&self.path);
        write_atomically(&path, &text).with_context(|| format!("cannot write {}", path.display()))
    }
}

/// Reads the ledger of a folder; none if no pool has used it.
pub(super) fn read(folder: &Path) -> Result<Option<Ledger>> {
    let path = ledger_file(folder);
    let text = match std::fs::read_to_string(&path) {
        Ok(text) => text,
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(None),
        Err(error) => return Err(error).with_context(|| format!("cannot read {}", path.display())),
    };
    let unreadable = |why: String| {
        BadInput(format!(
            "{} is no state of a pool ({why}): name another folder with --state",
            path.display()
        ))
    };
    let ledger: Ledger = serde_json::from_str(&text).map_err(|error| unreadable(error.to_string()))?;
    if ledger.schema != SCHEMA {
        return Err(unreadable(format!("its schema is {}, not {SCHEMA}", ledger.schema)).into());
    }
    Ok(Some(ledger))
}

/// Whether a pool runs on a folder.
pub(super) fn is_in_use(folder: &Path) -> bool {
    File::open(lock_file(folder))
        .is_ok_and(|lock| matches!(lock.try_lock_shared(), Err(TryLockError::WouldBlock)))
}

/// The folder of the logs of allocations.
pub(super) fn logs(folder: &Path) -> PathBuf {
    folder.join("logs")
}

fn ledger_file(folder: &Path) -> PathBuf {
    folder.join("pool.json")
}

fn lock_file(folder: &Path) -> PathBuf {
    folder.join("lock")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ledger_is_stored_whole_and_read_again() {
        let parent = tempfile::tempdir().unwrap();
        let path = parent.path().join("pool");
        assert_eq!(read(&path).unwrap(), None);
        let folder = Folder::open(&path).unwrap();
        let mut ledger = Ledger::new("roost-pool-1".to_owned(), Timestamp(1000));
        ledger.allocations.push(Allocation::waiting(17, Timestamp(2000)));
        ledger.failures.add(Timestamp(3000), "refused".to_owned());
        folder.save(&ledger).unwrap();
        assert_eq!(read(&path).unwrap(), Some(ledger));
        assert!(is_in_use(&path));
        let error = Folder::open(&path).unwrap_err();
        assert!(error.to_string().contains("another pool runs on the folder"), "{error}");
        drop(folder);
        assert!(!is_in_use(&path));
        Folder::open(&path).unwrap();
    }

    #[test]
    fn a_file_of_another_kind_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let ledger = Ledger { schema: "roost.pool/9".to_owned(), ..Ledger::new(String::new(), Timestamp(0)) };
        for text in ["{}".to_owned(), "no JSON".to_owned(), serde_json::to_string(&ledger).unwrap()] {
            std::fs::write(ledger_file(folder.path()), text).unwrap();
            let error = read(folder.path()).unwrap_err();
            assert!(error.to_string().contains("--state"), "{error}");
        }
    }

    #[test]
    fn held_allocations_are_never_removed() {
        let mut ledger = Ledger::new(String::new(), Timestamp(0));
        for id in 0..500 {
            let state = if id % 2 == 0 { AllocationState::Completed } else { AllocationState::Running };
            ledger.allocations.push(Allocation { state, ..Allocation::waiting(id, Timestamp(0)) });
        }
        ledger.forget_old();
        assert_eq!((ledger.allocations.len(), ledger.held().count()), (450, 250));
        assert_eq!(ledger.allocations[0].id, 1, "the oldest ended one is gone");
        assert_eq!(ledger.running(false), 250);
    }
}
