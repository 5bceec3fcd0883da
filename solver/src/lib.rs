//! The Roost DEM solver: a scenario goes in, responses and series come out.
//!
//! The library knows no HTTP, no database and no wall clock beyond timing itself. The layers, from the
//! top: [`scenario`] is what a user may ask for, [`experiments`] turns it into a scene of bodies and
//! surfaces, [`engine`] owns the state and the order of the stages of a step, [`cpu`] and, with the feature of that name,
//! `gpu` carry the stages out, [`observe`] reads the state into samples, and [`result`] is what comes back.

mod check;
pub mod cpu;
pub mod engine;
pub mod equipment;
pub mod experiments;
#[cfg(feature = "gpu")]
pub mod gpu;
pub mod mesh;
pub mod observe;
pub mod physics;
pub mod result;
pub mod scenario;
pub mod shape;
pub mod walls;

pub use check::{Limits, check};
pub use engine::OutOfDeviceMemory;
pub use engine::run::Observer;
use mesh::Meshes;
use result::RunResult;
pub use result::{Flow, Progress, SOLVER_REVISION, VERSION};
use scenario::Scenario;

/// Where a run is computed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct CpuOptions {
    /// Threads; 0 means one per processor.
    pub threads: usize,
}

/// What computes runs. Clones share it.
#[derive(Clone, Debug)]
pub enum Computer {
    /// The CPU.
    Cpu(CpuOptions),
    /// A graphics adapter; what threads simulate on it at a time is advanced together.
    #[cfg(feature = "gpu")]
    Gpu(std::sync::Arc<gpu::Gpu>),
}

impl Computer {
    /// As [`simulate`], on this.
    ///
    /// # Errors
    /// When the device has no room for it.
    ///
    /// # Panics
    /// When the device fails: see [`Self::has_failed`].
    pub fn simulate(
        &self,
        scenario: &Scenario,
        meshes: &Meshes,
        observer: &mut dyn Observer,
    ) -> Result<RunResult, OutOfDeviceMemory> {
        match self {
            Self::Cpu(options) => Ok(simulate(scenario, meshes, *options, observer)),
            #[cfg(feature = "gpu")]
            Self::Gpu(gpu) => {
                gpu::catch_out_of_memory(|| experiments::simulate(scenario, meshes, &**gpu, observer))
            }
        }
    }

    /// Whether its device was lost, so that it computes nothing any more.
    pub fn has_failed(&self) -> bool {
        match self {
            Self::Cpu(_) => false,
            #[cfg(feature = "gpu")]
            Self::Gpu(gpu) => gpu.has_failed(),
        }
    }

    /// Its name: processor and instruction set, or graphics adapter.
    pub fn device(&self) -> String {
        match self {
            Self::Cpu(_) => cpu::device_name(),
            #[cfg(feature = "gpu")]
            Self::Gpu(gpu) => engine::Backend::info(&**gpu).device,
        }
    }
}

/// Runs one scenario, whose meshes must be among `meshes`, on the CPU to its end. The observer is told the progress about ten times a second of wall time and
/// at least once per output interval, and may cancel: what was sampled so far is then returned, without responses.
pub fn simulate(
    scenario: &Scenario,
    meshes: &Meshes,
    options: CpuOptions,
    observer: &mut dyn Observer,
) -> RunResult {
    experiments::simulate(scenario, meshes, &cpu::Cpu::new(options.threads), observer)
}
