//! `roost serve`: the server.

use std::net::SocketAddr;
use std::path::PathBuf;
use std::time::Duration;

use anyhow::Result;
use roost_server::{Bucket, Limits, RetryLimit, RetryPolicy, Server, ServerConfig};

use crate::exit::Exit;
use crate::signals;
use crate::ui;

/// Run the server: the queue, the sweeps and the HTTP API
///
/// Everything it keeps is in the data folder. On SIGTERM or Ctrl-C it finishes what it answers and exits; running
/// jobs go on at their workers and are delivered once it is back.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    #[command(flatten)]
    server: ServerArgs,
}

/// What every server can be told, alone or inside `roost up`.
#[derive(Debug, clap::Args)]
pub(crate) struct ServerArgs {
    /// Where to listen; port 0 lets the system choose
    #[arg(long, default_value = "127.0.0.1:7373", value_name = "ADDR", value_parser = address)]
    listen: SocketAddr,
    /// Folder for everything the server keeps
    #[arg(long, default_value = "roost-data", value_name = "DIR")]
    pub(crate) data: PathBuf,
    /// Keep frames in a bucket of S3 in place of the data folder, with credentials from the environment; needs a build with the
    /// feature `s3`
    #[arg(long, value_name = "s3://BUCKET/PREFIX")]
    objects: Option<Bucket>,
    /// Workers are told to give a sign of life this often
    #[arg(long, default_value_t = 2.0, value_name = "SECONDS", value_parser = positive)]
    heartbeat_s: f64,
    /// A job goes back to the queue when its worker has been silent for this long
    #[arg(long, default_value_t = 15.0, value_name = "SECONDS", value_parser = positive)]
    lease_s: f64,
    /// Largest scenario accepted, in sub-particles
    #[arg(long, default_value_t = Limits::default().max_subparticles, value_name = "N")]
    max_subparticles: u64,
    /// Longest scenario accepted, in time steps
    #[arg(long, default_value_t = Limits::default().max_steps, value_name = "N")]
    max_steps: u64,
    /// Largest sweep accepted, in jobs
    #[arg(long, default_value_t = ServerConfig::default().max_jobs_per_sweep, value_name = "N")]
    max_jobs: u64,
    /// Largest request body accepted, in bytes
    #[arg(long, default_value_t = ServerConfig::default().max_body_bytes, value_name = "BYTES")]
    max_body_bytes: usize,
    /// What the frames of one job may weigh, in millions of bytes; a run that would pass it goes on without more of them
    #[arg(long, default_value_t = ServerConfig::default().max_frames_bytes / 1_000_000, value_name = "MB", value_parser = clap::value_parser!(u64).range(1..=1_000_000))]
    max_frames_mb: u64,
    /// Requests a second with one token, or of all without tokens; 0 is no limit
    #[arg(long, default_value_t = 0, value_name = "N")]
    max_requests_per_s: u32,
    /// Connections at once. Past it, those close that wait longest for a request. Each worker takes up to three; the server
    /// keeps to fewer where the system lets it open fewer files
    #[arg(long, default_value_t = ServerConfig::default().max_connections, value_name = "N", value_parser = connections)]
    max_connections: usize,
    /// Delete sweeps and single jobs this long after their end, such as 30d; without it they stay for ever
    #[arg(long, value_name = "AGE", value_parser = crate::prune::age)]
    prune_after: Option<Duration>,
    /// Attempts of a job that may fail because of their worker; 0 is no limit
    #[arg(long, default_value_t = RetryPolicy::default().worker.attempts, value_name = "N")]
    worker_attempts: u32,
    /// Attempts of a job that may be lost with their worker; 0 is no limit
    #[arg(long, default_value_t = RetryPolicy::default().lost.attempts, value_name = "N")]
    lost_attempts: u32,
    /// Pause before another attempt, which doubles each time up to a minute, less a random half
    #[arg(long, default_value_t = 2.0, value_name = "SECONDS", value_parser = pause)]
    retry_pause_s: f64,
}

impl ServerArgs {
    pub(crate) fn config(self) -> ServerConfig {
        let mut retry = RetryPolicy::default();
        let first_pause = Duration::from_secs_f64(self.retry_pause_s);
        retry.worker = RetryLimit { attempts: self.worker_attempts, first_pause, ..retry.worker };
        retry.lost = RetryLimit { attempts: self.lost_attempts, first_pause: first_pause / 2, ..retry.lost };
        ServerConfig {
            listen: self.listen,
            data: self.data,
            objects: self.objects,
            heartbeat: Duration::from_secs_f64(self.heartbeat_s),
            lease: Duration::from_secs_f64(self.lease_s),
            limits: Limits { max_subparticles: self.max_subparticles, max_steps: self.max_steps },
            max_jobs_per_sweep: self.max_jobs,
            max_body_bytes: self.max_body_bytes,
            max_frames_bytes: self.max_frames_mb * 1_000_000,
            max_requests_per_s: self.max_requests_per_s,
            max_connections: self.max_connections,
            prune_after: self.prune_after,
            retry,
            ..ServerConfig::default()
        }
    }
}

pub(crate) async fn execute(args: Args) -> Result<Exit> {
    let shutdown = signals::shutdown()?;
    let server = Server::bind(args.server.config()).await?;
    ui::println(format_args!("listening on http://{}", server.local_addr()))?;
    server.run(shutdown).await?;
    Ok(Exit::Done)
}

fn connections(text: &str) -> Result<usize, String> {
    match text.parse() {
        Ok(count) if (16..=1_000_000).contains(&count) => Ok(count),
        _ => Err("give a number of connections from 16 to 1000000".to_owned()),
    }
}

fn pause(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(seconds) if (0.0..=3600.0).contains(&seconds) => Ok(seconds),
        _ => Err("give a number of seconds from 0 to 3600".to_owned()),
    }
}

fn address(text: &str) -> Result<SocketAddr, String> {
    text.parse().map_err(|_| "write an IP address and a port, such as 127.0.0.1:7373".to_owned())
}

fn positive(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(seconds) if (0.05..=86_400.0).contains(&seconds) => Ok(seconds),
        _ => Err("give a number of seconds from 0.05 to 86400".to_owned()),
    }
}
