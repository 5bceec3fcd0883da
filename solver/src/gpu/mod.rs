//! The GPU backend: the plain path's physics as kernels in WGSL, for any graphics adapter that wgpu drives.
//!
//! Every sub-particle gathers its forces as on the plain path of [`crate::cpu`], with the same operations in the same
//! order, so that on an adapter that rounds every operation by itself (Mesa's lavapipe does) the bits are the same. A
//! step is one dispatch. Lists are rebuilt every few steps, whether they need it or not; should something have moved too
//! far in between, the chunk of steps is done again with a shorter interval. Neither that nor what else is in the batch
//! changes a bit: what is in reach is in the lists, rows are sorted, and what does not touch adds nothing.
//!
//! | file | does |
//! |---|---|
//! | `device` | chooses and opens the adapter |
//! | `shared`, `layout` | what host and kernels share, declared once |
//! | `source`, `pipelines` | WGSL from its files, compiled |
//! | `lists`, `walls` | neighbour lists and surfaces in main memory |
//! | `store`, `run` | one run on the device |
//! | `arena`, `advance` | a batch of them, advanced |
//! | `driver` | the thread that does so, for all who ask at a time |

mod advance;
mod arena;
pub mod device;
mod driver;
pub mod layout;
mod lists;
mod pipelines;
mod run;
mod shared;
pub mod source;
mod store;
mod walls;

use glam::DVec3;

use crate::engine::scene::Scene;
use crate::engine::state::State;
use crate::engine::{Advance, Backend, BackendInfo};
pub use device::{AdapterName, Device, GpuError, GpuOptions};
use driver::Driver;
use pipelines::Pipelines;
pub use run::GpuRun;
use run::Run;
use source::Source;

/// A graphics adapter that computes. Threads may share one: what they advance at a time becomes one batch.
///
/// Its methods panic when the device is lost or out of memory: it is of no use from then on, nor are its runs.
#[derive(Debug)]
pub struct Gpu {
    device: Device,
    driver: Driver,
}

impl Gpu {
    /// Opens an adapter and compiles the kernels for it.
    pub fn new(options: &GpuOptions) -> Result<Self, GpuError> {
        Self::with(Device::open(options)?, &Source::kernels())
    }

    /// The same with other kernels, for tests of what finds faults.
    pub fn with(device: Device, source: &Source) -> Result<Self, GpuError> {
        let pipelines = Pipelines::new(&device, source)?;
        Ok(Self { driver: Driver::start(device.clone(), pipelines), device })
    }

    /// How many bytes the device reads and writes in a second when it copies within its memory.
    pub fn copied_bytes_per_s(&self) -> f64 {
        self.device.copied_bytes_per_s()
    }

    /// Its adapter.
    pub fn name(&self) -> &AdapterName {
        self.device.name()
    }
}

impl Backend for Gpu {
    type Run = GpuRun;

    fn info(&self) -> BackendInfo {
        BackendInfo { name: "gpu".into(), device: format!("{} f32", self.name()), threads: 1 }
    }

    fn prepare(&self, scene: &Scene) -> GpuRun {
        GpuRun::new(Run::new(&self.device, scene))
    }

    fn advance(&self, runs: &mut [(&mut GpuRun, u64)]) -> Vec<Advance> {
        self.driver.advance(runs)
    }

    fn state<'a>(&self, run: &'a mut GpuRun) -> &'a State {
        run.get().state(&self.device)
    }

    fn surface_forces(&self, run: &mut GpuRun) -> Vec<DVec3> {
        run.get().surface_forces(&self.device)
    }

    fn bonds(&self, run: &mut GpuRun) -> Vec<[u32; 2]> {
        run.get().bonds(&self.device)
    }

    fn start(&self, run: &mut GpuRun) {
        run.get().start(&self.device);
    }

    fn remove(&self, run: &mut GpuRun, serials: &[u32]) {
        run.get().remove(&self.device, serials);
    }
}
