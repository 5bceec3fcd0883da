//! Settings of a server.

use std::net::SocketAddr;
use std::path::PathBuf;
use std::time::Duration;

use roost_solver::Limits;

use crate::data::DATABASE;
use crate::queue::RetryPolicy;
use crate::sign_in::SignInSettings;
use crate::store::{Bucket, Edition, Location};

/// The settings of a server.
#[derive(Clone, Debug)]
pub struct ServerConfig {
    /// Address to listen on; port 0 lets the system choose. Without tokens and sign-in it must be a loopback address.
    pub listen: SocketAddr,
    /// Host and port at which the other servers of a database of PostgreSQL reach this one; none for `listen`.
    pub advertise: Option<String>,
    /// The data directory.
    pub data: PathBuf,
    /// The database, if it is not a file in the data directory.
    pub database: Option<Location>,
    /// Bucket for objects; without it they are in the data directory.
    pub objects: Option<Bucket>,
    /// Sign-in with an identity provider, if there is one.
    pub sign_in: Option<SignInSettings>,
    /// Duration of a lease after a heartbeat.
    pub lease: Duration,
    /// Interval between heartbeats of a worker.
    pub heartbeat: Duration,
    /// Maximum time that a claim waits for work.
    pub max_claim_wait: Duration,
    /// Limits of the cost of a scenario.
    pub limits: Limits,
    /// When a failed job is retried automatically.
    pub retry: RetryPolicy,
    /// Maximum number of jobs of a sweep.
    pub max_jobs_per_sweep: u64,
    /// Maximum size of a request body.
    pub max_body_bytes: usize,
    /// Maximum size of a delivered result.
    pub max_result_bytes: usize,
    /// Maximum size of an STL file.
    pub max_mesh_bytes: usize,
    /// Maximum number of triangles of the meshes of one document.
    pub max_mesh_triangles: u64,
    /// Maximum size of the frames of a job.
    pub max_frames_bytes: u64,
    /// Wall time between the checkpoints of a job; zero for none.
    pub checkpoint_interval: Duration,
    /// Maximum size of a checkpoint.
    pub max_checkpoint_bytes: u64,
    /// Maximum size of all stored fills together; 0 stores none.
    pub fill_limit_bytes: u64,
    /// Age after its last use at which a fill is deleted.
    pub fill_max_age: Duration,
    /// Maximum of requests per second for each token, or in total without tokens; 0 is no limit.
    pub max_requests_per_s: u32,
    /// Maximum number of connections. The system's limit of open files may reduce it.
    pub max_connections: usize,
    /// Maximum time for a request head to arrive, and for a connection to be idle.
    pub head_timeout: Duration,
    /// Maximum pause of a request body.
    pub body_timeout: Duration,
    /// Age after its end at which a sweep or single job is deleted; none keeps them.
    pub prune_after: Option<Duration>,
    /// Age at which events and answers to submissions are deleted.
    pub memory: Duration,
    /// Schema and solver of another version of this program.
    #[cfg(test)]
    pub(crate) edition: Edition,
}

impl ServerConfig {
    /// Host and port at which the other servers reach this one, which listens on an address; none if it listens on all addresses and
    /// names none of them.
    pub(crate) fn advertised(&self, address: SocketAddr) -> Option<String> {
        let own = (!address.ip().is_unspecified()).then(|| address.to_string());
        self.advertise.clone().or(own)
    }

    /// Schema and solver of the server.
    pub(crate) fn edition(&self) -> Edition {
        #[cfg(test)]
        return self.edition;
        #[cfg(not(test))]
        Edition::default()
    }

    /// Where the database is.
    pub(crate) fn place(&self) -> Location {
        self.database.clone().unwrap_or_else(|| Location::File(self.data.join(DATABASE)))
    }
}

impl Default for ServerConfig {
    fn default() -> Self {
        Self {
            listen: SocketAddr::from(([127, 0, 0, 1], 7373)),
            advertise: None,
            data: PathBuf::from("roost-data"),
            database: None,
            objects: None,
            sign_in: None,
            lease: Duration::from_secs(15),
            heartbeat: Duration::from_secs(2),
            max_claim_wait: Duration::from_secs(30),
            limits: Limits::default(),
            retry: RetryPolicy::default(),
            max_jobs_per_sweep: 1_000_000,
            max_body_bytes: 4 * 1024 * 1024,
            max_result_bytes: 32 * 1024 * 1024,
            max_mesh_bytes: roost_api::mesh::MAX_BYTES,
            max_mesh_triangles: 1_000_000,
            max_frames_bytes: 200_000_000,
            checkpoint_interval: Duration::from_secs(300),
            max_checkpoint_bytes: 256 * 1024 * 1024,
            fill_limit_bytes: 20 * 1024 * 1024 * 1024,
            fill_max_age: Duration::from_secs(30 * 24 * 3600),
            max_requests_per_s: 0,
            max_connections: 8192,
            head_timeout: Duration::from_secs(10),
            body_timeout: Duration::from_secs(30),
            prune_after: None,
            memory: Duration::from_secs(24 * 3600),
            #[cfg(test)]
            edition: Edition::default(),
        }
    }
}
