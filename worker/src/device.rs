//! What runs are computed on: the CPU, or a graphics adapter, which all runs of a worker share and which is opened anew
//! after it has failed.

use std::sync::{Arc, Mutex, PoisonError};

use roost_solver::mesh::Meshes;
use roost_solver::result::RunResult;
use roost_solver::scenario::Scenario;
use roost_solver::{Computer, CpuOptions, Observer};

/// What somebody wants runs to be computed on.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct DeviceOptions {
    /// None takes a GPU if there is one, else the CPU.
    pub backend: Option<BackendKind>,
    /// Part of the adapter's name; none takes the first.
    pub adapter: Option<String>,
    /// Whether an adapter that is software counts as a GPU.
    pub allow_software: bool,
}

/// A way to compute.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BackendKind {
    /// On the processor.
    Cpu,
    /// On a graphics adapter.
    Gpu,
}

/// What runs are computed on. Clones share it.
#[derive(Clone, Debug, Default)]
pub struct Device(Option<Arc<Adapter>>);

#[derive(Debug)]
struct Adapter {
    #[cfg_attr(not(feature = "gpu"), expect(dead_code, reason = "nothing to open"))]
    options: DeviceOptions,
    name: String,
    /// None when it has failed, until it is needed again.
    open: Mutex<Option<Computer>>,
}

impl Device {
    /// The CPU.
    pub fn cpu() -> Self {
        Self::default()
    }

    /// What the options ask for.
    ///
    /// # Errors
    /// In words, when that is a GPU and none will do.
    pub fn choose(options: &DeviceOptions) -> Result<Self, String> {
        let is_asked_for =
            options.backend == Some(BackendKind::Gpu) || options.adapter.is_some() || options.allow_software;
        match options.backend {
            Some(BackendKind::Cpu) if is_asked_for => Err("an adapter is for the GPU backend".to_owned()),
            Some(BackendKind::Cpu) => Ok(Self::cpu()),
            _ => match open(options) {
                Ok(computer) => Ok(Self(Some(Arc::new(Adapter {
                    options: options.clone(),
                    name: computer.device(),
                    open: Mutex::new(Some(computer)),
                })))),
                Err(reason) if is_asked_for => Err(reason),
                Err(reason) => {
                    tracing::info!(%reason, "computing on the CPU");
                    Ok(Self::cpu())
                }
            },
        }
    }

    /// `cpu` or `gpu`.
    pub fn backend(&self) -> &'static str {
        if self.0.is_some() { "gpu" } else { "cpu" }
    }

    /// Processor and instruction set, or graphics adapter.
    pub fn name(&self) -> String {
        self.0.as_ref().map_or_else(roost_solver::cpu::device_name, |adapter| adapter.name.clone())
    }

    /// Makes ready to compute, on so many threads where that is the CPU.
    ///
    /// # Errors
    /// In words, when an adapter that had failed cannot be opened again.
    pub(crate) fn ready(&self, threads: usize) -> Result<Ready, String> {
        let Some(adapter) = &self.0 else {
            return Ok(Ready { computer: Computer::Cpu(CpuOptions { threads }), adapter: None });
        };
        let mut current = adapter.open.lock().unwrap_or_else(PoisonError::into_inner);
        if current.is_none() {
            *current = Some(open(&adapter.options)?);
        }
        let computer = current.clone().expect("it was just opened");
        Ok(Ready { computer, adapter: Some(adapter.clone()) })
    }
}

/// Ready to compute.
#[derive(Debug)]
pub(crate) struct Ready {
    computer: Computer,
    adapter: Option<Arc<Adapter>>,
}

impl Ready {
    /// Runs one scenario to its end. A panic gives the adapter up: the next run opens it anew.
    pub(crate) fn simulate(
        self,
        scenario: &Scenario,
        meshes: &Meshes,
        observer: &mut dyn Observer,
    ) -> RunResult {
        self.computer.simulate(scenario, meshes, observer)
    }
}

impl Drop for Ready {
    fn drop(&mut self) {
        if let (true, Some(adapter)) = (std::thread::panicking(), &self.adapter) {
            *adapter.open.lock().unwrap_or_else(PoisonError::into_inner) = None;
        }
    }
}

#[cfg(feature = "gpu")]
fn open(options: &DeviceOptions) -> Result<Computer, String> {
    use roost_solver::gpu::{Gpu, GpuOptions};
    let options = GpuOptions { device: options.adapter.clone(), allow_software: options.allow_software };
    let gpu = Gpu::new(&options).map_err(|error| error.to_string())?;
    Ok(Computer::Gpu(Arc::new(gpu)))
}

#[cfg(not(feature = "gpu"))]
fn open(_options: &DeviceOptions) -> Result<Computer, String> {
    Err("this program was built without the GPU backend".to_owned())
}
