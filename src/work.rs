//! `roost work`: a worker of a server.

use std::path::PathBuf;
use std::time::Duration;

use anyhow::Result;
use clap::builder::RangedI64ValueParser;
use roost_worker::WorkerConfig;
use roost_worker::device::Device;

use crate::device::DeviceArgs;
use crate::exit::Exit;
use crate::signals;
use crate::target;
use crate::ui;

/// Run a worker: claim jobs from a server, simulate, deliver
///
/// The worker waits for a server that is away, before the first job and in the middle of one. On SIGTERM or
/// Ctrl-C it hands its jobs back and exits. Repeats of the signal within 5 s change nothing; a later one ends the
/// process at once, and the server waits for the leases of its jobs.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Address of the server
    #[arg(long, env = "ROOST_SERVER", default_value = "http://127.0.0.1:7373", value_name = "URL")]
    server: String,
    #[command(flatten)]
    access: target::Access,
    #[command(flatten)]
    worker: WorkerArgs,
    /// Folder for finished results that the server does not have yet
    #[arg(long, env = "ROOST_STATE", value_name = "DIR")]
    state: Option<PathBuf>,
}

/// What every worker can be told, alone or inside `roost up`.
#[derive(Debug, clap::Args)]
pub(crate) struct WorkerArgs {
    /// Threads to use in all; 0 means one per processor
    #[arg(long, default_value_t = 0, value_name = "N", value_parser = threads())]
    threads: u16,
    #[command(flatten)]
    device: DeviceArgs,
    /// Jobs at once; they share the threads, or make one batch on a GPU as far as its memory goes [default: 1, on a GPU 16]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    slots: Option<u16>,
    /// Seconds that running jobs get to finish after a signal, before they are handed back; keep it 10 s below the
    /// time after which a service manager kills the process
    #[arg(long, default_value_t = 0, value_name = "SECONDS")]
    grace: u64,
    /// Name shown to people
    #[arg(long, value_name = "NAME")]
    name: Option<String>,
}

/// What `--threads` takes.
pub(crate) fn threads() -> RangedI64ValueParser<u16> {
    clap::value_parser!(u16).range(0..=1024)
}

/// Says so where more threads are asked for than are going to compute.
pub(crate) fn say_threads(asked: u16, device: &Device) {
    let threads = roost_worker::threads(asked.into());
    if device.backend() == "cpu" && threads < asked.into() {
        ui::say!("warning: --threads {asked} is more than there are processors; {threads} compute");
    }
}

impl WorkerArgs {
    /// What is to compute; it is opened.
    pub(crate) fn device(&self) -> Result<Device> {
        self.device.choose()
    }

    pub(crate) fn config(self, server: String, state: PathBuf, device: Device) -> WorkerConfig {
        say_threads(self.threads, &device);
        WorkerConfig {
            threads: self.threads.into(),
            slots: self.slots.map_or_else(|| device.default_slots(), usize::from),
            device,
            drain_grace: Duration::from_secs(self.grace),
            ..WorkerConfig::new(server, self.name.unwrap_or_else(host_name), state)
        }
    }
}

pub(crate) async fn execute(args: Args) -> Result<Exit> {
    let shutdown = signals::shutdown()?;
    let state = args.state.unwrap_or_else(default_state);
    let device = args.worker.device()?;
    let config = args.worker.config(args.server, state, device);
    let config = WorkerConfig { credentials: args.access.read()?, ..config };
    roost_worker::work(config, shutdown).await?;
    Ok(Exit::Done)
}

/// Where a service manager says, else where the XDG rules put the state of a user's programs.
fn default_state() -> PathBuf {
    let folder = |name: &str| std::env::var_os(name).map(PathBuf::from).filter(|path| path.is_absolute());
    folder("STATE_DIRECTORY")
        .or_else(|| folder("XDG_STATE_HOME").map(|path| path.join("roost")))
        .or_else(|| folder("HOME").map(|path| path.join(".local/state/roost")))
        .unwrap_or_else(|| PathBuf::from("roost-state"))
}

pub(crate) fn host_name() -> String {
    let name = std::fs::read_to_string("/proc/sys/kernel/hostname").unwrap_or_default();
    if name.trim().is_empty() { "worker".to_owned() } else { name.trim().to_owned() }
}
