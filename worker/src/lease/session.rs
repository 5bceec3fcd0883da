//! One worker process: its id, its registration, and the state that its loops share.

use std::sync::{Arc, OnceLock};
use std::time::Duration;

use roost_api::API_VERSION;
use roost_api::ids::WorkerId;
use roost_api::worker::{WorkerRegistration, WorkerWelcome};
use roost_solver::SOLVER_REVISION;
use tokio::sync::Notify;
use tokio_util::sync::CancellationToken;

use super::WorkerError;
use super::attempts::LeasedAttempts;
use super::frames::Uploads;
use crate::WorkerConfig;
use crate::backoff::Backoff;
use crate::client::{Client, ClientError};
use crate::fills::FillCache;
use crate::meshes::MeshCache;
use crate::outbox::Outbox;
use crate::slots::Slots;

/// Maximum size of the cache of filled states, in bytes.
const FILL_CACHE_BYTES: u64 = 4 << 30;

/// The state that the loops of a worker share.
#[derive(Debug)]
pub(super) struct Session {
    pub(super) client: Client,
    pub(super) config: WorkerConfig,
    pub(super) worker_id: WorkerId,
    pub(super) attempts: LeasedAttempts,
    pub(super) outbox: Outbox,
    pub(super) uploads: Uploads,
    pub(super) meshes: Arc<MeshCache>,
    pub(super) fills: FillCache,
    /// Notified of each new delivery in the outbox.
    pub(super) outbox_changed: Notify,
    /// Cancelled by a signal, by the server or by a refusal: no more jobs are claimed.
    pub(super) stop_claiming: CancellationToken,
    refusal: OnceLock<String>,
}

impl Session {
    pub(super) fn open(mut config: WorkerConfig, shutdown: &CancellationToken) -> Result<Self, WorkerError> {
        if config.slots == Slots::Auto {
            config.device.share_memory();
        }
        let key = config.outbox_key.as_ref().unwrap_or(&config.server);
        let unusable = |source| WorkerError::StateDir { path: config.state_dir.clone(), source };
        let outbox = Outbox::open(&config.state_dir, key).map_err(unusable)?;
        let client = Client::with_credentials(&config.server, &config.credentials)?;
        let fills = FillCache::open(&config.state_dir.join("fills"), FILL_CACHE_BYTES).map_err(unusable)?;
        let meshes = MeshCache::open(&config.state_dir, client.clone()).map_err(unusable)?;
        Ok(Self {
            client,
            worker_id: WorkerId::new(),
            attempts: LeasedAttempts::default(),
            outbox,
            uploads: Uploads::default(),
            meshes: Arc::new(meshes),
            fills,
            outbox_changed: Notify::new(),
            stop_claiming: shutdown.child_token(),
            refusal: OnceLock::new(),
            config,
        })
    }

    /// Registers the worker; retries while the server does not answer.
    pub(super) async fn register(&self) -> Result<WorkerWelcome, ClientError> {
        let mut backoff = Backoff::default();
        let mut has_warned = false;
        loop {
            match self.client.register(&self.registration()).await {
                Ok(welcome) => {
                    tracing::info!(worker = %self.worker_id, server = %self.client.server(), "registered");
                    return Ok(welcome);
                }
                Err(error) if error.is_transient() => {
                    if !has_warned {
                        tracing::warn!(%error, "waiting for the server");
                        has_warned = true;
                    }
                    backoff.pause().await;
                }
                Err(error) => return Err(error),
            }
        }
    }

    /// Registers the worker again, under the same id and with the same attempts, after the server has forgotten it.
    pub(super) async fn register_again(&self) {
        tracing::warn!("the server does not know this worker; registering again");
        if let Err(error) = self.register().await {
            self.refused(&error);
        }
    }

    /// Notes that the server refuses this worker: it finishes its runs and claims no more.
    pub(super) fn refused(&self, error: &ClientError) {
        tracing::error!(%error, "the server refuses this worker");
        let _ = self.refusal.set(error.to_string());
        self.stop_claiming.cancel();
    }

    /// Why the server refuses this worker, if it does.
    pub(super) fn refusal(&self) -> Option<&String> {
        self.refusal.get()
    }

    fn registration(&self) -> WorkerRegistration {
        WorkerRegistration {
            worker_id: self.worker_id,
            name: self.config.name.clone(),
            api_version: API_VERSION.to_owned(),
            solver_revision: SOLVER_REVISION,
            backend: self.config.device.backend().to_owned(),
            device: self.config.device.name(),
            memory_mib: self.config.device.memory_mib(),
            threads: u32::try_from(self.config.resolved_threads()).unwrap_or(u32::MAX),
        }
    }
}

/// Seconds of an answer as a duration of at least 20 ms; 2 s where they are invalid.
pub(super) fn seconds(value: f64) -> Duration {
    Duration::try_from_secs_f64(value).unwrap_or(Duration::from_secs(2)).max(Duration::from_millis(20))
}
