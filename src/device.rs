//! `--backend`, `--device`, `--allow-software`, `--gpu-memory`: what simulations are computed on.

use anyhow::Result;
use roost_worker::device::{BackendKind, Device, DeviceOptions};

use crate::exit::BadInput;

/// What simulations are computed on.
#[derive(Clone, Debug, Default, clap::Args)]
pub(crate) struct DeviceArgs {
    /// What to compute on [default: a discrete GPU if there is one, else the CPU]
    #[arg(long, value_enum)]
    backend: Option<Backend>,
    /// Part of the name of the graphics adapter to take, where there are several
    #[arg(long, value_name = "NAME")]
    device: Option<String>,
    /// Let an adapter that is software count as a GPU: for tests, since the CPU backend is faster
    #[arg(long)]
    allow_software: bool,
    /// MiB of the GPU's memory that jobs may take, and larger ones are refused [default: they share 4096, and what is larger is tried alone]
    #[arg(long, value_name = "MIB", value_parser = clap::value_parser!(u32).range(1..=16_777_216))]
    gpu_memory: Option<u32>,
}

/// A way to compute.
#[derive(Clone, Copy, Debug, clap::ValueEnum)]
enum Backend {
    Cpu,
    Gpu,
}

impl DeviceArgs {
    /// Opens what is asked for.
    pub(crate) fn choose(&self) -> Result<Device> {
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
