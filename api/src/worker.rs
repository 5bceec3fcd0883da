//! Workers and their devices.

use roost_solver::result::Progress;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::ids::{JobId, WorkerId};
use crate::solver_documents::ProgressSchema;
use crate::time::Timestamp;

/// The registration of a worker.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct WorkerRegistration {
    /// Identifier of the process.
    pub worker_id: WorkerId,
    /// A name for people, such as the host name; at most 256 bytes.
    #[schema(max_length = 256)]
    pub name: String,
    /// Version of the API, such as `v1`.
    pub api_version: String,
    /// `SOLVER_REVISION` of its solver.
    pub solver_revision: u32,
    /// Its backend, such as `cpu`, as in its results.
    #[schema(max_length = 256)]
    pub backend: String,
    /// Its device in words, as in its results.
    #[schema(max_length = 256)]
    pub device: String,
    /// Threads it uses.
    pub threads: u32,
    /// Memory of its device, in MiB. Without it, the worker gets no jobs that require memory.
    #[serde(default)]
    pub memory_mib: Option<u32>,
}

/// The answer to a registration.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub struct WorkerWelcome {
    /// Interval of heartbeats, in seconds.
    pub heartbeat_s: f64,
    /// Length of a lease after a heartbeat, in seconds.
    pub lease_s: f64,
}

/// A worker as the API shows it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct WorkerView {
    /// Its identifier.
    pub id: WorkerId,
    /// Its name.
    pub name: String,
    /// Its backend.
    pub backend: String,
    /// Its device in words.
    pub device: String,
    /// Threads it uses.
    pub threads: u32,
    /// Memory of its device, in MiB.
    pub memory_mib: Option<u32>,
    /// `SOLVER_REVISION` of its solver.
    pub solver_revision: u32,
    /// Whether it was asked to finish its jobs and claim no more.
    pub draining: bool,
    /// Jobs that it holds leases of.
    pub running: Vec<JobId>,
    /// Progress of these jobs in the same order; null before the first report.
    #[serde(default)]
    #[schema(value_type = Vec<Option<ProgressSchema>>)]
    pub progress: Vec<Option<Progress>>,
    /// Sub-particle updates per second of wall time: the sum over its jobs, each averaged since its start. Null before the first report.
    #[serde(default)]
    pub particle_steps_per_s: Option<f64>,
    /// Number of its attempts with a result.
    pub succeeded: u64,
    /// Number of its attempts that failed with the class `worker`.
    pub failed: u64,
    /// When it registered.
    #[schema(value_type = String, format = DateTime)]
    pub registered_at: Timestamp,
    /// Time of its last heartbeat.
    #[schema(value_type = String, format = DateTime)]
    pub last_seen_at: Timestamp,
}
