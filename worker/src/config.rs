//! The settings of a worker.

use std::path::PathBuf;
use std::time::Duration;

use crate::client::Credentials;
use crate::device::Device;
use crate::slots::Slots;

/// The number of threads to use: the requested one, at most one per processor. 0 requests one per processor. With many threads per processor
/// a run makes no progress and does not notice a request to stop.
pub fn threads(requested: usize) -> usize {
    let processors = std::thread::available_parallelism().map_or(1, usize::from);
    if requested == 0 { processors } else { requested.min(processors) }
}

/// The settings of a worker.
#[derive(Clone, Debug)]
pub struct WorkerConfig {
    /// Address of the server, such as `http://127.0.0.1:7373`.
    pub server: String,
    /// Access token, and authorities to trust.
    pub credentials: Credentials,
    /// A name for people, such as the host name.
    pub name: String,
    /// Threads to use in all; 0 means one per processor.
    pub threads: usize,
    /// The device that computes runs.
    pub device: Device,
    /// Folder of the outbox and the mesh cache; several workers may share it.
    pub state_dir: PathBuf,
    /// Name of the server in the state directory; its address unless given. For a server whose address changes at each start, and which
    /// alone uses the directory.
    pub outbox_key: Option<String>,
    /// Jobs at once. They share the threads, or one batch on a GPU.
    pub slots: Slots,
    /// Time that a stopping worker gives its jobs before it releases them.
    pub drain_grace: Duration,
    /// Time without a job after which the worker ends; it waits for ever without one.
    pub idle_timeout: Option<Duration>,
    /// Time that a claim waits at the server for work.
    pub claim_wait: Duration,
}

impl WorkerConfig {
    /// A worker with automatic slots on all processors, which releases its jobs at once when it is stopped.
    pub fn new(server: impl Into<String>, name: impl Into<String>, state_dir: impl Into<PathBuf>) -> Self {
        Self {
            server: server.into(),
            credentials: Credentials::default(),
            name: name.into(),
            threads: 0,
            device: Device::cpu(),
            state_dir: state_dir.into(),
            outbox_key: None,
            slots: Slots::Auto,
            drain_grace: Duration::ZERO,
            idle_timeout: None,
            claim_wait: Duration::from_secs(20),
        }
    }

    /// Threads of all jobs together.
    pub fn resolved_threads(&self) -> usize {
        threads(self.threads)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn threads_are_at_most_one_per_processor() {
        let config = WorkerConfig::new("s", "n", "d");
        let processors = config.resolved_threads();
        assert!(processors >= 1);
        let config = WorkerConfig { threads: 999_999_999_999, ..config };
        assert_eq!(config.resolved_threads(), processors);
        let config = WorkerConfig { threads: 1, ..config };
        assert_eq!(config.resolved_threads(), 1);
    }
}
