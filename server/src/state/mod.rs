//! The state of a running server, which every request handler shares.
//!
//! These modules know no HTTP: `http` imports `state`, never the reverse.

mod access;
pub(crate) mod audit;
pub(crate) mod connections;
mod curve_points;
mod farm_view;
mod forecasts;
mod mesh_cache;
mod metrics;
mod partial_uploads;
mod progress;
mod project_counts;
mod queue_depth;
mod samples;
mod slots;
mod submission_turns;
mod sweep_cache;
mod waits;

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};

use roost_api::forecast::Forecast;
use roost_api::prune::Pruning;
use roost_api::sweep::SweepView;
use roost_api::time::Timestamp;
use tokio::sync::{Notify, RwLock, Semaphore};
use tokio_util::sync::CancellationToken;

use crate::clock::Clock;
use crate::config::ServerConfig;
use crate::sign_in::SignIn;
use crate::store::{ProjectValues, Store, StoreError};
use crate::sweep::SweepResponse;
pub(crate) use access::{Access, AccessError, Caller};
pub(crate) use connections::Connections;
use curve_points::CurvePoints;
pub(crate) use farm_view::FarmViews;
pub(crate) use mesh_cache::{MeshCache, MeshCacheError};
pub(crate) use metrics::{AnsweredRequest, MachineUsage, Metrics, RequestKind};
pub(crate) use partial_uploads::{PartialUploads, UploadKey};
pub(crate) use progress::ProgressBoard;
pub(crate) use project_counts::RecentCounts;
pub(crate) use samples::Received;
use slots::WorkerSlots;
use submission_turns::SubmissionTurns;
pub(crate) use sweep_cache::SweepCache;

/// A handle to the state.
pub(crate) type App = Arc<AppState>;

/// The state of a running server.
pub(crate) struct AppState {
    pub(crate) config: ServerConfig,
    pub(crate) store: Store,
    pub(crate) clock: Clock,
    /// The newest time in the database when the server started.
    pub(crate) newest_at_start: Option<Timestamp>,
    /// Wakes claims that wait for work.
    pub(crate) work: Notify,
    /// Memory budget of deliveries that are being recorded, in KiB of their bodies.
    pub(crate) delivery_budget: Arc<Semaphore>,
    /// STL files that are read and stored at once.
    pub(crate) upload_slots: Arc<Semaphore>,
    /// Views of sweeps.
    pub(crate) sweep_views: SweepCache<SweepView>,
    /// Names and types of the responses of sweeps.
    pub(crate) sweep_responses: SweepCache<Arc<Vec<SweepResponse>>>,
    /// Meshes for the checks of submissions.
    pub(crate) mesh_cache: MeshCache,
    /// Submissions that may name a mesh hold this for reading; pruning holds it for writing while it deletes
    /// meshes.
    pub(crate) mesh_gate: RwLock<()>,
    /// Submissions of one sweep by repeats of a request.
    pub(crate) submission_turns: SubmissionTurns,
    pub(crate) connections: Arc<Connections>,
    pub(crate) metrics: Metrics,
    pub(crate) access: Access,
    /// Sign-in with an identity provider, if there is one.
    pub(crate) sign_in: Option<SignIn>,
    /// Held while changes are taken over.
    pub(crate) following: tokio::sync::Mutex<()>,
    /// The values of projects at the last check.
    pub(crate) projects: Mutex<BTreeMap<String, ProjectValues>>,
    /// Numbers of the jobs of projects.
    pub(crate) recent_counts: RecentCounts,
    /// Limits the audit lines about refused requests.
    pub(crate) refusal_limit: audit::RefusalLimit,
    /// Ends everything that waits.
    pub(crate) shutdown: CancellationToken,
    /// Parts of checkpoints whose upload is not complete.
    pub(crate) checkpoint_uploads: PartialUploads,
    /// Parts of fills whose upload is not complete.
    pub(crate) fill_uploads: PartialUploads,
    /// Progress and samples of running jobs.
    pub(crate) progress: ProgressBoard,
    /// Slots of workers.
    pub(crate) slots: WorkerSlots,
    /// Views of the farm for forecasts.
    pub(crate) farm_views: FarmViews,
    /// Forecasts of sweeps.
    pub(crate) forecasts: SweepCache<Forecast>,
    /// Forecasts of studies.
    pub(crate) study_forecasts: SweepCache<Forecast>,
    /// Points of curves in results, which calibrations need.
    pub(crate) curve_points: CurvePoints,
}

impl AppState {
    /// Takes over changes that `roost token` and `roost project` made, and logs them. Claims wake when a project has more budget.
    pub(crate) async fn follow_changes(&self) -> Result<(), StoreError> {
        // An older view of the tokens shall not replace a newer one.
        let _turn = self.following.lock().await;
        self.access.update(self.store.tokens().await?);
        let projects = self.store.project_values().await?;
        let before = {
            let mut known = self.projects.lock().unwrap_or_else(PoisonError::into_inner);
            std::mem::replace(&mut *known, projects.clone())
        };
        let mut has_more = false;
        for (name, values) in &projects {
            let before = before.get(name);
            audit::log_project(name, before, values);
            has_more |= before.is_some_and(|before| values.has_more_than(before));
        }
        if has_more {
            self.work.notify_waiters();
        }
        Ok(())
    }

    /// Deletes what ended before `then`, and returns what was deleted.
    pub(crate) async fn prune(&self, then: Timestamp) -> Result<Pruning, StoreError> {
        self.store.prune(then, self.clock.now(), &self.mesh_gate).await
    }
}
