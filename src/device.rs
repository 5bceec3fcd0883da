//! `--backend`, `--device`, `--allow-software`, `--gpu-memory`: the device that computes simulations.

use anyhow::Result;
use roost_terminal::BadInput;
use roost_worker::device::{BackendKind, Device, DeviceOptions};

/// Options of the device that computes simulations.
#[derive(Clone, Debug, Default, clap::Args)]
pub(crate) struct DeviceArgs {
    /// Processor that computes the simulations [default: the GPU if the machine has a discrete GPU (a graphics card); if not, the
    /// CPU]
    #[arg(long, value_enum)]
    backend: Option<Backend>,
    /// Graphics adapter (GPU) to use, if the machine has several adapters: a part of its name is enough
    #[arg(long, value_name = "NAME")]
    device: Option<String>,
    /// Accept a GPU that software emulates. Use this option only for tests, because `--backend cpu` is faster than such a GPU
    #[arg(long)]
    allow_software: bool,
    /// Maximum memory that all jobs together use on the GPU, in MiB. With this option, Roost refuses a job that needs more
    /// memory than this maximum. Without this option, the maximum is 4096 MiB, and Roost runs a job that needs more memory alone
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
