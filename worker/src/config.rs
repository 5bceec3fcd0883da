//! What a worker needs to know before it starts.

use std::path::PathBuf;
use std::time::Duration;

use crate::client::Credentials;
use crate::device::Device;

/// Threads that compute where so many are asked for; 0 means one per processor. More than there are processors would only
/// wait for each other: a thousand on two neither get anywhere nor hear that they are to stop.
pub fn threads(asked: usize) -> usize {
    let processors = std::thread::available_parallelism().map_or(1, usize::from);
    if asked == 0 { processors } else { asked.min(processors) }
}

/// What a worker needs to know before it starts.
#[derive(Clone, Debug)]
pub struct WorkerConfig {
    /// Address of the server, such as `http://127.0.0.1:7373`.
    pub server: String,
    /// What it shows to the server, and whom it trusts.
    pub credentials: Credentials,
    /// A name for people, such as the host name.
    pub name: String,
    /// Threads to use in all; 0 means one per processor.
    pub threads: usize,
    /// What runs are computed on.
    pub device: Device,
    /// Where finished results wait for the server; several workers may share it.
    pub state_dir: PathBuf,
    /// What names the server in the state directory; none means its address. For a server whose address changes
    /// from start to start, and which alone uses the directory.
    pub outbox_key: Option<String>,
    /// Jobs at once; they share the threads, or one batch on a GPU.
    pub slots: usize,
    /// How long a draining worker lets its jobs finish before it hands them back.
    pub drain_grace: Duration,
    /// How long one claim waits at the server for work to appear.
    pub claim_wait: Duration,
}

impl WorkerConfig {
    /// A worker with one slot on all processors that hands its job back at once when it is stopped.
    pub fn new(server: impl Into<String>, name: impl Into<String>, state_dir: impl Into<PathBuf>) -> Self {
        Self {
            server: server.into(),
            credentials: Credentials::default(),
            name: name.into(),
            threads: 0,
            device: Device::cpu(),
            state_dir: state_dir.into(),
            outbox_key: None,
            slots: 1,
            drain_grace: Duration::ZERO,
            claim_wait: Duration::from_secs(20),
        }
    }

    /// Threads in all, as many as there are.
    pub fn resolved_threads(&self) -> usize {
        threads(self.threads)
    }

    /// Threads for each job.
    pub fn threads_per_slot(&self) -> usize {
        (self.resolved_threads() / self.slots.max(1)).max(1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slots_share_the_threads_and_always_have_one() {
        let config = WorkerConfig { threads: 0, slots: 2, ..WorkerConfig::new("s", "n", "d") };
        let processors = config.resolved_threads();
        assert!(processors >= 1);
        assert_eq!(config.threads_per_slot(), (processors / 2).max(1));
        let config = WorkerConfig { threads: 999_999_999_999, slots: 1, ..config };
        assert_eq!((config.resolved_threads(), config.threads_per_slot()), (processors, processors));
        let config = WorkerConfig { threads: 1, slots: 3, ..config };
        assert_eq!((config.resolved_threads(), config.threads_per_slot()), (1, 1));
    }
}
