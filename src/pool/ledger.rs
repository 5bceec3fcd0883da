//! The memory of a pool: its allocations and failures, in a file of the folder `--state`. A restart reads it and continues.

use std::fs::{File, TryLockError};
use std::io::{Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};
use std::thread::sleep;
use std::time::Duration;

use anyhow::{Context, Result};
use roost_api::time::Timestamp;
use roost_solver::files::write_atomically;
use roost_terminal::BadInput;
use serde::{Deserialize, Serialize};

use super::rule::{Failures, WorkerKind};

/// The version of the file.
const SCHEMA: &str = "roost.pool/1";
/// Ended allocations that the file keeps.
const MAX_ENDED: usize = 200;
/// Time after the first worker of an allocation, from which on the pool waits for no other worker of it.
const ALL_REGISTER_WITHIN_MS: i64 = 120_000;
/// A view of the server may lack a worker that registered this long before it.
const VIEW_DELAY_MS: i64 = 1000;
/// `pool list` holds the lock for a moment: a pool tries again so often, with a pause after each try. Tests may run on a busy machine.
const LOCK_TRIES: u32 = if cfg!(test) { 50 } else { 10 };
const LOCK_PAUSE: Duration = Duration::from_millis(100);
/// Part of a log that is read: the end.
const LOG_END_BYTES: u64 = 4096;

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
    /// Whether the pool found it in Slurm, and does not know when it was submitted.
    #[serde(default)]
    pub(super) adopted: bool,
    /// When its workers registered, by the server's clock.
    #[serde(default)]
    pub(super) workers: Vec<Timestamp>,
    /// When the pool first saw one of its workers.
    #[serde(default)]
    pub(super) working_since: Option<Timestamp>,
    /// Whether its workers have shown that they work. Each allocation ends the failures once at most.
    #[serde(default)]
    pub(super) proven: bool,
    /// Whether the pool has asked Slurm to cancel it.
    #[serde(default)]
    pub(super) cancelled_by_pool: bool,
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
            adopted: false,
            workers: Vec::new(),
            working_since: None,
            proven: false,
            cancelled_by_pool: false,
            submitted_at: now,
            started_at: None,
            ended_at: None,
        }
    }

    /// Whether workers of it may register that the pool has not seen yet.
    pub(super) fn may_have_new_workers(&self, workers_per_alloc: u32, now: Timestamp) -> bool {
        let is_late = self.working_since.is_some_and(|since| now.0 - since.0 > ALL_REGISTER_WITHIN_MS);
        !is_late && self.workers.len() < workers_per_alloc as usize
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
    /// The binary that the user named for compute nodes.
    #[serde(default)]
    pub(super) roost: Option<PathBuf>,
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
            roost: None,
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

    /// Number of working allocations that have not shown that they work.
    pub(super) fn unproven(&self) -> u32 {
        let working = self.held().filter(|one| one.state == AllocationState::Running && one.registered);
        working.filter(|one| !one.proven).count() as u32
    }

    /// Number of workers in working allocations that a view of the server lacks: those that register after the view was made.
    pub(super) fn unseen_workers(&self, workers_per_alloc: u32, view: Timestamp, now: Timestamp) -> u32 {
        let unseen = |one: &Allocation| {
            let is_in_view = |at: &&Timestamp| at.plus_ms(VIEW_DELAY_MS) <= view;
            let seen = one.workers.iter().filter(is_in_view).count() as u32;
            let known = one.workers.len() as u32;
            let all =
                if one.may_have_new_workers(workers_per_alloc, now) { workers_per_alloc } else { known };
            all.saturating_sub(seen)
        };
        let working = self.held().filter(|one| one.state == AllocationState::Running && one.registered);
        working.map(unseen).sum()
    }

    /// Notes that the pool asks Slurm to cancel allocations.
    pub(super) fn note_cancelled(&mut self, ids: &[u64]) {
        for one in self.allocations.iter_mut().filter(|one| ids.contains(&one.id)) {
            one.cancelled_by_pool = true;
        }
    }

    /// The end of the pause after failures, if there is one.
    pub(super) fn paused_until(&self) -> Option<Timestamp> {
        self.failures.paused_until(Duration::from_secs(self.retry_pause_s))
    }

    /// Removes the oldest ended allocations beyond the number to keep. Returns their ids.
    pub(super) fn forget_old(&mut self) -> Vec<u64> {
        let ended = self.allocations.len() - self.held().count();
        let mut excess = ended.saturating_sub(MAX_ENDED);
        let mut removed = Vec::new();
        self.allocations.retain(|one| {
            let is_removed = excess > 0 && !one.state.is_held();
            if is_removed {
                excess -= 1;
                removed.push(one.id);
            }
            !is_removed
        });
        removed
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
        let mut taken = lock.try_lock();
        for _ in 1..LOCK_TRIES {
            if matches!(taken, Err(TryLockError::WouldBlock)) {
                sleep(LOCK_PAUSE);
                taken = lock.try_lock();
            }
        }
        match taken {
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

    /// The last line with text in the log of an allocation.
    pub(super) fn last_log_line(&self, id: u64) -> Option<String> {
        let mut file = File::open(log_file(&self.path, &id.to_string())).ok()?;
        let length = file.metadata().ok()?.len();
        file.seek(SeekFrom::Start(length.saturating_sub(LOG_END_BYTES))).ok()?;
        let mut end = Vec::new();
        file.take(LOG_END_BYTES).read_to_end(&mut end).ok()?;
        let line = last_line(&String::from_utf8_lossy(&end)).to_owned();
        Some(line).filter(|line| !line.is_empty())
    }

    /// Removes the logs of allocations that the ledger has forgotten. Logs that are not there, or stay, do no harm.
    pub(super) fn remove_logs(&self, ids: &[u64]) {
        for id in ids {
            let _ = std::fs::remove_file(log_file(&self.path, &id.to_string()));
        }
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
fn logs(folder: &Path) -> PathBuf {
    folder.join("logs")
}

/// The log of an allocation.
pub(super) fn log_file(folder: &Path, id: &str) -> PathBuf {
    logs(folder).join(format!("{id}.log"))
}

/// The last line with text.
pub(super) fn last_line(text: &str) -> &str {
    text.lines().map(str::trim).rfind(|line| !line.is_empty()).unwrap_or_default()
}

fn ledger_file(folder: &Path) -> PathBuf {
    folder.join("pool.json")
}

fn lock_file(folder: &Path) -> PathBuf {
    folder.join("lock")
}

#[cfg(test)]
#[path = "ledger_tests.rs"]
mod tests;
