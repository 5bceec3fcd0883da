//! `roost work`: a worker of a server.

use std::path::PathBuf;
use std::time::Duration;

use anyhow::Result;
use roost_terminal::{Exit, signals, threads};
use roost_worker::device::Device;
use roost_worker::{Slots, WorkerConfig};

use crate::device::DeviceArgs;
use crate::interval::time;
use crate::target;

/// Run a worker, which claims jobs from a server, simulates them and delivers the results
///
/// While the server does not answer, the worker waits, and running jobs continue. On SIGTERM or Ctrl-C, the worker returns its jobs
/// to the queue and exits. Further signals within 5 s of the first signal have no effect. A signal after these 5 s ends the worker at
/// once. The server then queues the worker's jobs again as soon as their leases have ended (after 15 s by default).
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Address of the server
    #[arg(long, env = "ROOST_SERVER", default_value = "http://127.0.0.1:7373", value_name = "URL")]
    server: String,
    #[command(flatten)]
    access: target::Access,
    #[command(flatten)]
    worker: WorkerArgs,
    /// The worker exits after this time without a job, such as 30s, 5m or 1h. Without this option, the worker waits for jobs until
    /// somebody stops it
    #[arg(long, value_name = "TIME", value_parser = time)]
    idle_timeout: Option<Duration>,
    /// Folder in which the worker keeps each finished result until the server has confirmed it
    #[arg(long, env = "ROOST_STATE", value_name = "DIR")]
    state: Option<PathBuf>,
}

/// Options of every worker, in `roost work` and `roost up`.
#[derive(Debug, clap::Args)]
pub(crate) struct WorkerArgs {
    /// Number of threads for all jobs of the worker together; 0 means one thread per processor
    #[arg(long, default_value_t = 0, value_name = "N", value_parser = threads::value_parser())]
    threads: u16,
    #[command(flatten)]
    device: DeviceArgs,
    /// Maximum number of jobs that run at the same time: `auto`, or a number from 1 to 1024. On a CPU, the jobs share the threads.
    /// With `auto` on a CPU, the worker runs one job for each thread, as far as the memory allows. If the queue has fewer jobs than the worker has threads, each
    /// job gets more threads. On a GPU, the jobs advance together as one batch, as far as the memory of the GPU allows. With `auto` on
    /// a GPU, the maximum is 16 jobs
    #[arg(long, default_value = "auto", value_name = "N", value_parser = slots)]
    slots: Slots,
    /// Time that running jobs may continue after a signal (SIGTERM or Ctrl-C), before they return to the queue. A service manager
    /// such as systemd kills the worker when a certain time has passed since the signal. Choose a value that is at least 10 s less
    /// than this time
    #[arg(long, default_value_t = 0, value_name = "SECONDS")]
    grace: u64,
    /// Name of the worker in lists [default: the name of this machine]
    #[arg(long, value_name = "NAME")]
    name: Option<String>,
}

pub(crate) fn slots(text: &str) -> Result<Slots, String> {
    match text.parse() {
        Ok(slots @ 1..=1024) => Ok(Slots::Fixed(slots)),
        _ if text == "auto" => Ok(Slots::Auto),
        _ => Err("write `auto` or a number of 1 to 1024".to_owned()),
    }
}

impl WorkerArgs {
    /// Opens the device.
    pub(crate) fn device(&self) -> Result<Device> {
        self.device.open()
    }

    pub(crate) fn config(self, server: String, state: PathBuf, device: Device) -> WorkerConfig {
        if device.backend() == "cpu" {
            threads::warn_if_too_many(self.threads);
        }
        WorkerConfig {
            threads: self.threads.into(),
            slots: self.slots,
            device,
            drain_grace: Duration::from_secs(self.grace),
            ..WorkerConfig::new(server, self.name.unwrap_or_else(host_name), state)
        }
    }
}

pub(crate) async fn execute(args: Args) -> Result<Exit> {
    let shutdown = signals::shutdown_token()?;
    let state = args.state.unwrap_or_else(default_state);
    let device = args.worker.device()?;
    let config = args.worker.config(args.server, state, device);
    let config = WorkerConfig { credentials: args.access.read()?, idle_timeout: args.idle_timeout, ..config };
    roost_worker::work(config, shutdown).await?;
    Ok(Exit::Done)
}

/// The state folder of the service manager, else that of the XDG rules, or of Windows.
pub(crate) fn default_state() -> PathBuf {
    let folder = |name: &str| std::env::var_os(name).map(PathBuf::from).filter(|path| path.is_absolute());
    folder("STATE_DIRECTORY")
        .or_else(|| folder("XDG_STATE_HOME").map(|path| path.join("roost")))
        .or_else(|| folder("HOME").map(|path| path.join(".local/state/roost")))
        .or_else(|| folder("LOCALAPPDATA").map(|path| path.join("roost")))
        .unwrap_or_else(|| PathBuf::from("roost-state"))
}

/// The name of this machine: from Linux, else from the variable of Windows or of a shell.
pub(crate) fn host_name() -> String {
    let from_linux = std::fs::read_to_string("/proc/sys/kernel/hostname").ok();
    let variable = |name: &str| std::env::var(name).ok();
    let name = from_linux.or_else(|| variable("COMPUTERNAME")).or_else(|| variable("HOSTNAME"));
    let name = name.unwrap_or_default();
    if name.trim().is_empty() { "worker".to_owned() } else { name.trim().to_owned() }
}
