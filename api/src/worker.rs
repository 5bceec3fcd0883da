//! Workers: who is there, on what device, doing what.

use roost_solver::result::Progress;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::ids::{JobId, WorkerId};
use crate::time::Timestamp;

/// A worker introduces itself.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct WorkerRegistration {
    /// A fresh id for each process.
    pub worker_id: WorkerId,
    /// A name for people, such as the host name; at most 256 bytes.
    #[schema(max_length = 256)]
    pub name: String,
    /// [`crate::API_VERSION`] it speaks.
    pub api_version: String,
    /// `SOLVER_REVISION` of its solver.
    pub solver_revision: u32,
    /// Backend it runs, such as `cpu`; its results say the same.
    #[schema(max_length = 256)]
    pub backend: String,
    /// Device in words; its results say the same.
    #[schema(max_length = 256)]
    pub device: String,
    /// Threads it uses.
    pub threads: u32,
    /// Memory of its device, in MiB; without it, jobs that need memory go elsewhere.
    #[serde(default)]
    pub memory_mib: Option<u32>,
}

/// What a registered worker needs to know.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub struct WorkerWelcome {
    /// Beat this often, in seconds.
    pub heartbeat_s: f64,
    /// Leases last this long after a beat, in seconds.
    pub lease_s: f64,
}

/// A worker as the API shows it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct WorkerView {
    /// Its identifier.
    pub id: WorkerId,
    /// Its name.
    pub name: String,
    /// Backend it runs.
    pub backend: String,
    /// Device in words.
    pub device: String,
    /// Threads it uses.
    pub threads: u32,
    /// Memory of its device, in MiB.
    pub memory_mib: Option<u32>,
    /// `SOLVER_REVISION` of its solver.
    pub solver_revision: u32,
    /// Whether it was asked to claim nothing more.
    pub draining: bool,
    /// Jobs it holds leases for.
    pub running: Vec<JobId>,
    /// How far each has come, in the same order; null where it has not said yet.
    #[serde(default)]
    #[schema(value_type = Vec<Option<Object>>)]
    pub progress: Vec<Option<Progress>>,
    /// Sub-particle updates a second of wall time, all of them together, each averaged since it began; null while none has said.
    #[serde(default)]
    pub particle_steps_per_s: Option<f64>,
    /// Attempts it has brought to a result.
    pub succeeded: u64,
    /// Attempts of its that failed as `worker`.
    pub failed: u64,
    /// When it registered.
    #[schema(value_type = String, format = DateTime)]
    pub registered_at: Timestamp,
    /// When it was last heard of.
    #[schema(value_type = String, format = DateTime)]
    pub last_seen_at: Timestamp,
}
