//! `roost serve`: run the server.

use std::net::{Ipv6Addr, SocketAddr};
use std::path::PathBuf;
use std::time::Duration;

use anyhow::Result;
use roost_server::{Bucket, Limits, RetryLimit, RetryPolicy, Server, ServerConfig};
use roost_terminal::{Exit, print_line, signals};

use crate::database::Database;
use crate::interval::interval;
use crate::sign_in::SignInArgs;

/// Run the server: the queue, the sweeps and the HTTP API
///
/// By default, the server keeps all its data in the data folder. On SIGTERM or Ctrl-C, the server answers the requests that it has
/// received, and exits. While the server is stopped, workers continue their running jobs. They deliver the results when the server
/// runs again.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    #[command(flatten)]
    server: ServerArgs,
}

/// Options of every server, in `roost serve` and `roost up`.
#[derive(Debug, clap::Args)]
pub(crate) struct ServerArgs {
    /// Address and port to listen on; port 0 takes any free port
    #[arg(long, default_value = "127.0.0.1:7373", value_name = "ADDR", value_parser = address)]
    listen: SocketAddr,
    /// Host and port at which other servers reach this server, if several servers use the same PostgreSQL database; by default, the
    /// address of `--listen`
    #[arg(long, value_name = "HOST:PORT", value_parser = host_and_port)]
    advertise: Option<String>,
    /// Folder for the data of the server
    #[arg(long, default_value = "roost-data", value_name = "DIR")]
    pub(crate) data: PathBuf,
    #[command(flatten)]
    database: Database,
    /// S3 bucket for frames, checkpoints and filled states. Without this option, these files are in the data folder. The server reads
    /// the credentials of the bucket from environment variables. This option needs a build of Roost with the feature `s3`
    #[arg(long, value_name = "s3://BUCKET/PREFIX")]
    objects: Option<Bucket>,
    #[command(flatten)]
    sign_in: SignInArgs,
    /// Time between two heartbeats of a worker. A heartbeat is a message from the worker to the server; it shows that the worker and
    /// its jobs still run
    #[arg(long, default_value_t = 2.0, value_name = "SECONDS", value_parser = positive)]
    heartbeat_s: f64,
    /// Duration of a lease, which is the right of a worker to run a job. Each heartbeat renews the lease. If no heartbeat arrives for
    /// this time, the server queues the job again
    #[arg(long, default_value_t = 15.0, value_name = "SECONDS", value_parser = positive)]
    lease_s: f64,
    /// Maximum number of sub-particles of a scenario. A sub-particle is one of the spheres that form a body
    #[arg(long, default_value_t = Limits::default().max_subparticles, value_name = "N")]
    max_subparticles: u64,
    /// Maximum number of time steps of a scenario
    #[arg(long, default_value_t = Limits::default().max_steps, value_name = "N")]
    max_steps: u64,
    /// Maximum number of jobs of a sweep
    #[arg(long, default_value_t = ServerConfig::default().max_jobs_per_sweep, value_name = "N")]
    max_jobs: u64,
    /// Maximum size, in bytes, of the data that a client sends with one request. Results, STL files, frames, checkpoints and filled
    /// states have other limits
    #[arg(long, default_value_t = ServerConfig::default().max_body_bytes, value_name = "BYTES")]
    max_body_bytes: usize,
    /// Maximum size of the frames of one job. When the frames reach this size, the job continues, but records no more frames
    #[arg(long, default_value_t = ServerConfig::default().max_frames_bytes / 1_000_000, value_name = "MB", value_parser = clap::value_parser!(u64).range(1..=1_000_000))]
    max_frames_mb: u64,
    /// Time between two checkpoints of a running job, such as 30s, 5m or 1h. This time is real time, not simulated time. With 0, jobs
    /// have no checkpoints
    #[arg(long, default_value = "5m", value_name = "TIME", value_parser = interval)]
    checkpoint_interval: Duration,
    /// Maximum size of a checkpoint. The server does not store a larger checkpoint. A job without a stored checkpoint begins at zero
    /// after an interruption
    #[arg(long, default_value_t = ServerConfig::default().max_checkpoint_bytes >> 20, value_name = "MIB", value_parser = clap::value_parser!(u64).range(1..=1_000_000))]
    checkpoint_limit_mib: u64,
    /// Maximum size of all filled states together. A filled state is the state of a hopper after its fill. Jobs with the same fill
    /// start from the same filled state. Above the maximum, the server deletes the filled states that have been unused for the
    /// longest time. With 0, the server stores no filled states, and each worker uses a filled state only for its own jobs
    #[arg(long, default_value_t = ServerConfig::default().fill_limit_bytes >> 20, value_name = "MIB", value_parser = clap::value_parser!(u64).range(0..=1_000_000_000))]
    fills_limit_mib: u64,
    /// The server deletes a filled state that no job has used for this time, such as 12h or 30d
    #[arg(long, default_value = "30d", value_name = "AGE", value_parser = crate::prune::age)]
    fills_max_age: Duration,
    /// Maximum number of requests per second for each access token. If the server needs no tokens, this number is the maximum for
    /// all clients together. 0 means no limit
    #[arg(long, default_value_t = 0, value_name = "N")]
    max_requests_per_s: u32,
    /// Maximum number of open connections. At this number, the server closes an idle connection when a new client connects. Each
    /// worker uses up to three connections. While a worker sends or fetches files, it uses more connections. If the operating system
    /// allows too few open files (each connection counts as one) for this number, the server uses a smaller number
    #[arg(long, default_value_t = ServerConfig::default().max_connections, value_name = "N", value_parser = connections)]
    max_connections: usize,
    /// Time after the end of a sweep or of a single job, such as 30d. When this time has passed, the server deletes the sweep or
    /// the job. Without this option, the server never deletes sweeps or jobs by itself
    #[arg(long, value_name = "AGE", value_parser = crate::prune::age)]
    prune_after: Option<Duration>,
    /// Number of attempts of a job that may fail because of a fault of the worker. After this number of such attempts, the job fails.
    /// An attempt is one try to simulate the job. 0 means no limit
    #[arg(long, default_value_t = RetryPolicy::default().worker.attempts, value_name = "N")]
    worker_attempts: u32,
    /// Number of attempts of a job that may end because the worker was lost. A worker is lost when its heartbeats stop. After this
    /// number of such attempts, the job fails. 0 means no limit
    #[arg(long, default_value_t = RetryPolicy::default().lost.attempts, value_name = "N")]
    lost_attempts: u32,
    /// Pause before the second attempt of a job, if the first attempt failed because of a fault of the worker. If the worker was
    /// lost, this pause is half as long. The pause doubles before each further attempt, up to a minute. The server shortens each
    /// pause at random, by at most half
    #[arg(long, default_value_t = 2.0, value_name = "SECONDS", value_parser = pause)]
    retry_pause_s: f64,
}

impl ServerArgs {
    pub(crate) fn config(self) -> Result<ServerConfig> {
        let mut retry = RetryPolicy::default();
        let first_pause = Duration::from_secs_f64(self.retry_pause_s);
        retry.worker = RetryLimit { attempts: self.worker_attempts, first_pause, ..retry.worker };
        retry.lost = RetryLimit { attempts: self.lost_attempts, first_pause: first_pause / 2, ..retry.lost };
        Ok(ServerConfig {
            listen: self.listen,
            advertise: self.advertise,
            data: self.data,
            database: self.database.address,
            objects: self.objects,
            sign_in: self.sign_in.settings()?,
            heartbeat: Duration::from_secs_f64(self.heartbeat_s),
            lease: Duration::from_secs_f64(self.lease_s),
            limits: Limits { max_subparticles: self.max_subparticles, max_steps: self.max_steps },
            max_jobs_per_sweep: self.max_jobs,
            max_body_bytes: self.max_body_bytes,
            max_frames_bytes: self.max_frames_mb * 1_000_000,
            checkpoint_interval: self.checkpoint_interval,
            max_checkpoint_bytes: self.checkpoint_limit_mib << 20,
            fill_limit_bytes: self.fills_limit_mib << 20,
            fill_max_age: self.fills_max_age,
            max_requests_per_s: self.max_requests_per_s,
            max_connections: self.max_connections,
            prune_after: self.prune_after,
            retry,
            ..ServerConfig::default()
        })
    }
}

/// PostgreSQL keeps 63 bytes of the name of a session, which has the address of its server.
const MAX_HOST_BYTES: usize = 50;

pub(crate) async fn execute(args: Args) -> Result<Exit> {
    let shutdown = signals::shutdown_token()?;
    let server = Server::bind(args.server.config()?).await?;
    print_line(format_args!("listening on http://{}", server.local_addr()))?;
    server.run(shutdown).await?;
    Ok(Exit::Done)
}

fn connections(text: &str) -> Result<usize, String> {
    match text.parse() {
        Ok(count) if (16..=1_000_000).contains(&count) => Ok(count),
        _ => Err("write a number of connections from 16 to 1000000".to_owned()),
    }
}

fn pause(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(seconds) if (0.0..=3600.0).contains(&seconds) => Ok(seconds),
        _ => Err("write a number of seconds from 0 to 3600".to_owned()),
    }
}

fn address(text: &str) -> Result<SocketAddr, String> {
    text.parse().map_err(|_| "write an IP address and a port, such as 127.0.0.1:7373".to_owned())
}

fn host_and_port(text: &str) -> Result<String, String> {
    let is_port = |port: &str| port.parse::<u16>().is_ok_and(|port| port > 0);
    let is_name =
        |host: &str| !host.is_empty() && host.chars().all(|c| c.is_ascii_alphanumeric() || "-.".contains(c));
    let is_host = |host: &str| match host.strip_prefix('[').and_then(|host| host.strip_suffix(']')) {
        Some(address) => address.parse::<Ipv6Addr>().is_ok(),
        None => is_name(host),
    };
    match text.rsplit_once(':') {
        Some((host, port)) if is_host(host) && host.len() <= MAX_HOST_BYTES && is_port(port) => {
            Ok(text.to_owned())
        }
        _ => Err(format!(
            "write a host of at most {MAX_HOST_BYTES} letters, digits, dots and hyphens, and a port, such as roost-1.example:7373 or [2001:db8::5]:7373"
        )),
    }
}

fn positive(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(seconds) if (0.05..=86_400.0).contains(&seconds) => Ok(seconds),
        _ => Err("write a number of seconds from 0.05 to 86400".to_owned()),
    }
}
