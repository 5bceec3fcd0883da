//! The Roost DEM solver: from a scenario to responses and series.
//!
//! The library knows no HTTP, no database and no wall clock beyond timing itself. [`scenario`] reads and completes a
//! document, [`check()`] makes it [`Checked`], and [`simulate()`] runs it. [`experiments`] turns a scenario into a scene of
//! bodies and surfaces, [`engine`] owns the state and the order of the stages of a step, [`cpu`] and, with the feature of
//! that name, `gpu` compute the stages, [`observe`] evaluates samples, [`result`] is the result document, and [`observable`] takes
//! numbers from it that a laboratory measures as well. [`files`] writes checkpoints and other files for all crates.

mod check;
pub mod cpu;
pub mod engine;
pub mod equipment;
pub mod experiments;
pub mod files;
#[cfg(feature = "gpu")]
pub mod gpu;
pub mod mesh;
pub mod observable;
pub mod observe;
pub mod physics;
pub mod result;
pub mod scenario;
pub mod shape;
mod simulate;
pub mod walls;

pub use check::{Checked, Limits, check};
pub use engine::OutOfDeviceMemory;
pub use engine::checkpoint::{Checkpoint, CheckpointError, Moment, Stamp};
pub use engine::run::Observer;
use result::RunResult;
pub use result::{Flow, Progress, SOLVER_REVISION, VERSION};
pub use simulate::simulate_on;

/// Options of the CPU.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct CpuOptions {
    /// Threads; 0 means one per processor.
    pub threads: usize,
}

/// Why a run could not be computed.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SimulateError {
    /// The device has too little memory.
    #[error(transparent)]
    Memory(#[from] OutOfDeviceMemory),
    /// The checkpoint to go on from is damaged or of another run.
    #[error(transparent)]
    Checkpoint(#[from] CheckpointError),
}

/// A device that computes runs. Clones share it.
#[derive(Clone, Debug)]
pub enum Computer {
    /// The CPU.
    Cpu(CpuOptions),
    /// A graphics adapter. Runs of several threads advance as one batch.
    #[cfg(feature = "gpu")]
    Gpu(std::sync::Arc<gpu::Gpu>),
}

impl Computer {
    /// As [`simulate`], on this device.
    ///
    /// # Errors
    /// When the device has too little memory.
    ///
    /// # Panics
    /// When the device fails: see [`Self::has_failed`].
    pub fn simulate(
        &self,
        checked: &Checked,
        observer: &mut dyn Observer,
    ) -> Result<RunResult, OutOfDeviceMemory> {
        match self.simulate_from(checked, None, observer) {
            Ok(result) => Ok(result),
            Err(SimulateError::Memory(error)) => Err(error),
            Err(SimulateError::Checkpoint(_)) => unreachable!("there is no checkpoint"),
        }
    }

    /// The same from a checkpoint on, if there is one. The result has the bits of an undisturbed run.
    ///
    /// # Errors
    /// When the device has too little memory, or the checkpoint is damaged or of another run.
    ///
    /// # Panics
    /// When the device fails: see [`Self::has_failed`].
    pub fn simulate_from(
        &self,
        checked: &Checked,
        from: Option<&Checkpoint>,
        observer: &mut dyn Observer,
    ) -> Result<RunResult, SimulateError> {
        Ok(match self {
            Self::Cpu(options) => simulate_on(&cpu::Cpu::new(options.threads), checked, from, observer)?,
            #[cfg(feature = "gpu")]
            Self::Gpu(gpu) => gpu::catch_out_of_memory(|| simulate_on(&**gpu, checked, from, observer))??,
        })
    }

    /// The stamp of the checkpoints of a scenario's run on this device.
    pub fn stamp(&self, checked: &Checked) -> Stamp {
        let name = match self {
            Self::Cpu(_) => "cpu",
            #[cfg(feature = "gpu")]
            Self::Gpu(_) => "gpu",
        };
        simulate::stamp(name, &self.device(), checked.scenario())
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

/// Runs a checked scenario on the CPU to its end. Progress is reported about ten times a second of wall time and at least
/// once per output interval. The observer may cancel: the result then has the samples so far, and no responses.
pub fn simulate(checked: &Checked, options: CpuOptions, observer: &mut dyn Observer) -> RunResult {
    let result = simulate_on(&cpu::Cpu::new(options.threads), checked, None, observer);
    result.expect("there is no checkpoint")
}
