//! The parts that a server opens to lead: the data directory, the database and the shared state of its requests.

use std::fs::File;
use std::sync::{Arc, Mutex};

use roost_api::time::Timestamp;
use tokio::sync::Semaphore;
use tokio::task::JoinSet;
use tokio_util::sync::CancellationToken;

use super::{ServerError, Site, retry_in_use};
use crate::clock::Clock;
use crate::queue::lease_end;
use crate::sign_in::{SignIn, SignInSettings};
use crate::state::{Access, App, AppState, MeshCache, Metrics};
use crate::store::{Location, OBJECTS, Store};
use crate::{data, decider, http, reaper};

/// A server that leads.
pub(super) struct Leading {
    pub(super) app: App,
    /// Held while it leads: two servers on one directory would lease the same jobs.
    _lock: File,
}

impl Leading {
    /// Opens all of it, and gives running attempts a new lease.
    pub(super) async fn start(site: &Site) -> Result<Self, ServerError> {
        let Site { address, ref place, .. } = *site;
        let config = site.config.clone();
        let lock = retry_in_use(|| match place {
            Location::File(_) => Ok(data::lock(&config.data)?),
            Location::Postgres(database) => Ok(data::lock_for(&database.to_string(), &config.data)?),
        });
        let lock = lock.await?;
        let (edition, objects) = (config.edition(), config.data.join(OBJECTS));
        let store = Store::open_as(edition, place, &objects, config.objects.as_ref()).await?;
        let (tokens, is_loopback) = (store.tokens().await?, address.ip().is_loopback());
        let (has_sign_in, now) = (config.sign_in.is_some(), Timestamp::now());
        if !is_loopback && !has_sign_in && !tokens.iter().any(|token| token.is_valid(now)) {
            store.close().await;
            return Err(ServerError::NotLoopback(address));
        }
        let projects = store.project_values().await?;
        let (max_requests_per_s, max_result_bytes) = (config.max_requests_per_s, config.max_result_bytes);
        let access = Access::new(max_requests_per_s, is_loopback, has_sign_in, tokens);
        let sign_in = match &config.sign_in {
            Some(settings) => Some(SignIn::new(settings.clone(), store.sign_in_key().await?)),
            None => None,
        };
        for project in config.sign_in.iter().flat_map(SignInSettings::projects) {
            if !projects.contains_key(project) {
                tracing::warn!(
                    project,
                    "--oidc-allow names a project that does not exist: create it with `roost project create`"
                );
            }
        }
        let newest_at_start = store.newest_record().await?;
        let clock = Clock::start();
        let running = store.renew_all_leases(lease_end(clock.lease_now(), config.lease)).await?;
        tracing::info!(%address, data = %config.data.display(), database = %place, running, "listening");
        if access.is_open() {
            tracing::warn!("no access token exists: every user of this machine may do everything");
        }
        let connections = site.connections.clone();
        let metrics = Metrics::new(&store, &connections);
        let app = Arc::new(AppState {
            mesh_cache: MeshCache::new(config.max_mesh_triangles),
            config,
            store,
            clock,
            newest_at_start,
            work: Default::default(),
            delivery_budget: Arc::new(Semaphore::new(http::delivery_budget_kib(max_result_bytes))),
            upload_slots: Arc::new(Semaphore::new(http::MAX_UPLOADS)),
            sweep_views: Default::default(),
            sweep_responses: Default::default(),
            mesh_gate: Default::default(),
            submission_turns: Default::default(),
            connections,
            metrics,
            access,
            sign_in,
            following: Default::default(),
            projects: Mutex::new(projects),
            recent_counts: Default::default(),
            refusal_limit: Default::default(),
            shutdown: CancellationToken::new(),
            checkpoint_uploads: Default::default(),
            fill_uploads: Default::default(),
            progress: Default::default(),
            slots: Default::default(),
            farm_views: Default::default(),
            forecasts: Default::default(),
            study_forecasts: Default::default(),
            curve_points: Default::default(),
        });
        Ok(Self { app, _lock: lock })
    }

    /// Starts the background tasks. They end when the state is told to shut down.
    pub(super) fn begin(&self) -> JoinSet<()> {
        let mut tasks = JoinSet::new();
        tasks.spawn(reaper::run(self.app.clone()));
        tasks.spawn(decider::run(self.app.clone()));
        tasks
    }

    /// Waits for the background tasks and closes the database.
    pub(super) async fn end(self, mut tasks: JoinSet<()>) {
        while tasks.join_next().await.is_some() {}
        self.app.store.close().await;
    }
}
