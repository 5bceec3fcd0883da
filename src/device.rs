//! `--backend`, `--device`, `--allow-software`, `--gpu-memory`: the device that computes simulations.

use anyhow::Result;
use roost_terminal::BadInput;
use roost_worker::device::{BackendKind, Device, DeviceOptions};

/// Options of the device that computes simulations.
#[derive(Clone, Debug, Default, clap::Args)]
pub(crate) struct DeviceArgs {
    /// Backend [default: a discrete GPU if the machine has one, otherwise the CPU]
    #[arg(long, value_enum)]
    backend: Option<Backend>,
    /// Part of the name of the graphics adapter to use, if the machine has several adapters
    #[arg(long, value_name = "NAME")]
    device: Option<String>,
    /// Accept a GPU that software emulates. Use this option only for tests, because the CPU backend is faster
    #[arg(long)]
    allow_software: bool,
    /// Maximum GPU memory of all jobs together, in MiB. With this option, Roost refuses a job that needs more memory. Without
    /// this option, the maximum is 4096 MiB, and a job that needs more memory runs alone
    #[arg(long, value_name = "MIB", value_parser = clap::value_parser!(u32).range(1..=16_777_216))]
    gpu_memory: Option<u32>,
}

/// A backend.
#[derive(Clone, Copy, Debug, clap::ValueEnum)]
enum Backend {
    Cpu,
    Gpu,
}

impl DeviceArgs {
    /// Opens the device.
    pub(crate) fn open(&self) -> Result<Device> {
        let options = DeviceOptions {
            backend: self.backend.map(|backend| match backend {
                Backend::Cpu => BackendKind::Cpu,
                Backend::Gpu => BackendKind::Gpu,
            }),
            adapter: self.device.clone(),
            allow_software: self.allow_software,
            memory_mib: self.gpu_memory,
        };
        Device::choose(&options).map_err(|reason| BadInput(reason).into())
    }
}
