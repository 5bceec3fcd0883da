//! What an operator can set.

use std::net::SocketAddr;
use std::path::PathBuf;
use std::time::Duration;

use roost_solver::Limits;

use crate::queue::RetryPolicy;
use crate::store::Bucket;

/// The settings of a server.
#[derive(Clone, Debug)]
pub struct ServerConfig {
    /// Where to listen; port 0 lets the system choose. Without tokens, a loopback address.
    pub listen: SocketAddr,
    /// Everything the server keeps is in this directory.
    pub data: PathBuf,
    /// Except the objects, where they are in a bucket.
    pub objects: Option<Bucket>,
    /// A lease lasts this long after a heartbeat.
    pub lease: Duration,
    /// Workers are told to beat this often.
    pub heartbeat: Duration,
    /// A claim waits for work no longer than this.
    pub max_claim_wait: Duration,
    /// What a scenario may cost.
    pub limits: Limits,
    /// When a job is tried again by itself.
    pub retry: RetryPolicy,
    /// Jobs that a sweep may make.
    pub max_jobs_per_sweep: u64,
    /// Size of a request body.
    pub max_body_bytes: usize,
    /// Size of a result that a worker delivers.
    pub max_result_bytes: usize,
    /// Size of an STL file.
    pub max_mesh_bytes: usize,
    /// Triangles of all meshes that one document names.
    pub max_mesh_triangles: u64,
    /// Bytes of the frames of one job.
    pub max_frames_bytes: u64,
    /// Requests a second with one token, or of all without tokens; 0 is no limit.
    pub max_requests_per_s: u32,
    /// Connections at once; fewer where the system lets the process open fewer files.
    pub max_connections: usize,
    /// The head of a request arrives within this, and a connection that is idle for so long ends.
    pub head_timeout: Duration,
    /// The body of a request does not pause for longer than this.
    pub body_timeout: Duration,
    /// Sweeps and single jobs that ended longer ago than this are deleted; none keeps them for ever.
    pub prune_after: Option<Duration>,
    /// How long events and answers to submissions are remembered.
    pub memory: Duration,
}

impl Default for ServerConfig {
    fn default() -> Self {
        Self {
            listen: SocketAddr::from(([127, 0, 0, 1], 7373)),
            data: PathBuf::from("roost-data"),
            objects: None,
            lease: Duration::from_secs(15),
            heartbeat: Duration::from_secs(2),
            max_claim_wait: Duration::from_secs(30),
            limits: Limits::default(),
            retry: RetryPolicy::default(),
            max_jobs_per_sweep: 100_000,
            max_body_bytes: 4 * 1024 * 1024,
            max_result_bytes: 32 * 1024 * 1024,
            max_mesh_bytes: roost_api::mesh::MAX_BYTES,
            max_mesh_triangles: 1_000_000,
            max_frames_bytes: 200_000_000,
            max_requests_per_s: 0,
            max_connections: 8192,
            head_timeout: Duration::from_secs(10),
            body_timeout: Duration::from_secs(30),
            prune_after: None,
            memory: Duration::from_secs(24 * 3600),
        }
    }
}
