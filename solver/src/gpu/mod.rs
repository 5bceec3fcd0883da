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
//! | `layout` | what host and kernels share, declared once |
//! | `source`, `pipelines` | WGSL from its files, compiled |
//! | `rows`, `surfaces` | lists and surfaces in main memory |
//! | `store`, `run` | one run on the device |
//! | `arena`, `advance` | a batch of them, advanced |

mod advance;
mod arena;
pub mod device;
pub mod layout;
mod pipelines;
mod rows;
mod run;
pub mod source;
mod store;
mod surfaces;

use std::sync::Mutex;

use glam::DVec3;

use crate::engine::scene::Scene;
use crate::engine::state::State;
use crate::engine::{Advance, Backend, BackendInfo};
use arena::Arena;
pub use device::{AdapterName, Device, GpuError, GpuOptions, adapters};
use pipelines::Pipelines;
pub use run::GpuRun;
use source::Source;

/// A graphics adapter that computes.
#[derive(Debug)]
pub struct Gpu {
    device: Device,
    pipelines: Pipelines,
    /// The buffers of the last batch, for the next.
    arena: Mutex<Option<Arena>>,
}

impl Gpu {
    /// Opens an adapter and compiles the kernels for it.
    pub fn new(options: &GpuOptions) -> Result<Self, GpuError> {
        Device::open(options).map(|device| Self::with(device, &Source::kernels()))
    }

    /// The same with other kernels, for tests of what finds faults.
    pub fn with(device: Device, source: &Source) -> Self {
        let pipelines = Pipelines::new(&device, source);
        Self { device, pipelines, arena: Mutex::default() }
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
        GpuRun::new(&self.device, scene)
    }

    fn advance(&self, runs: &mut [(&mut GpuRun, u64)]) -> Vec<Advance> {
        let mut arena = self.arena.lock().expect("nobody has panicked with it");
        advance::advance(&self.device, &self.pipelines, &mut arena, runs)
    }

    fn state<'a>(&self, run: &'a mut GpuRun) -> &'a State {
        run.state(&self.device)
    }

    fn surface_forces(&self, run: &mut GpuRun) -> Vec<DVec3> {
        run.surface_forces(&self.device)
    }

    fn bonds(&self, run: &mut GpuRun) -> Vec<[u32; 2]> {
        run.bonds(&self.device)
    }

    fn start(&self, run: &mut GpuRun) {
        run.start(&self.device);
    }

    fn remove(&self, run: &mut GpuRun, serials: &[u32]) {
        run.remove(&self.device, serials);
    }
}
