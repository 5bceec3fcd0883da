//! One worker process as the server sees it: its id, its registration, and what its loops share.

use std::sync::{Arc, OnceLock};
use std::time::Duration;

use roost_api::API_VERSION;
use roost_api::ids::WorkerId;
use roost_api::worker::{WorkerRegistration, WorkerWelcome};
use roost_solver::SOLVER_REVISION;
use tokio::sync::Notify;
use tokio_util::sync::CancellationToken;

use super::WorkerError;
use super::frames::Uploads;
use super::held::Held;
use crate::WorkerConfig;
use crate::backoff::Backoff;
use crate::client::{Client, ClientError};
use crate::meshes::MeshCache;
use crate::outbox::Outbox;

/// What the loops of a worker share.
#[derive(Debug)]
pub(super) struct Session {
    pub(super) client: Client,
    pub(super) config: WorkerConfig,
    pub(super) worker_id: WorkerId,
    pub(super) held: Held,
    pub(super) outbox: Outbox,
    pub(super) uploads: Uploads,
    pub(super) meshes: Arc<MeshCache>,
    /// Rung when the outbox has something new.
    pub(super) mail: Notify,
    /// Nothing more is claimed once this is cancelled: by a signal, by the server, or by a refusal.
    pub(super) stop_claiming: CancellationToken,
    refusal: OnceLock<String>,
}

impl Session {
    pub(super) fn open(config: WorkerConfig, shutdown: &CancellationToken) -> Result<Self, WorkerError> {
        let key = config.outbox_key.as_ref().unwrap_or(&config.server);
        let unusable = |source| WorkerError::StateDir { path: config.state_dir.clone(), source };
        let outbox = Outbox::open(&config.state_dir, key).map_err(unusable)?;
        let client = Client::with(&config.server, &config.credentials)?;
        let meshes = MeshCache::open(&config.state_dir, client.clone()).map_err(unusable)?;
        Ok(Self {
            client,
            worker_id: WorkerId::new(),
            held: Held::default(),
            outbox,
            uploads: Uploads::default(),
            meshes: Arc::new(meshes),
            mail: Notify::new(),
            stop_claiming: shutdown.child_token(),
            refusal: OnceLock::new(),
            config,
        })
    }

    /// Introduces the worker, again and again while the server is away.
    pub(super) async fn register(&self) -> Result<WorkerWelcome, ClientError> {
        let mut backoff = Backoff::default();
        let mut has_complained = false;
        loop {
            match self.client.register(&self.registration()).await {
                Ok(welcome) => {
                    tracing::info!(worker = %self.worker_id, server = %self.client.server(), "registered");
                    return Ok(welcome);
                }
                Err(error) if error.is_transient() => {
                    if !has_complained {
                        tracing::warn!(%error, "waiting for the server");
                        has_complained = true;
                    }
                    backoff.pause().await;
                }
                Err(error) => return Err(error),
            }
        }
    }

    /// After a server that does not know this worker any more: introduce it again, same id, same attempts.
    pub(super) async fn register_again(&self) {
        tracing::warn!("the server does not know this worker any more: registering again");
        if let Err(error) = self.register().await {
            self.refused(&error);
        }
    }

    /// The server will not have this worker: finish what runs, claim nothing more.
    pub(super) fn refused(&self, error: &ClientError) {
        tracing::error!(%error, "the server refuses this worker");
        let _ = self.refusal.set(error.to_string());
        self.stop_claiming.cancel();
    }

    /// Why the server will not have this worker, if so.
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

/// Seconds from the wire as a duration, within sense.
pub(super) fn seconds(value: f64) -> Duration {
    Duration::try_from_secs_f64(value).unwrap_or(Duration::from_secs(2)).max(Duration::from_millis(20))
}
