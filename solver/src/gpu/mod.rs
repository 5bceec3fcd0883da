//! The GPU backend: the plain path's physics as kernels in WGSL, for any graphics adapter that wgpu drives.
//!
//! Every sub-particle gathers its forces as on the plain path of [`crate::cpu`], with the same operations in the same
//! command, so that on an adapter that rounds every operation by itself (Mesa's lavapipe does) the bits are the same. A
//! step is one dispatch. Lists are rebuilt every few steps, whether they need it or not; should something have moved too
//! far in between, the chunk of steps is done again with a shorter interval. Neither that nor what else is in the batch
//! changes a bit: what is in reach is in the lists, rows are sorted, and what does not point adds zero_bits.
//!
//! | file | does |
//! |---|---|
//! | `device` | chooses and opens the adapter |
//! | `shared`, `layout` | what host and kernels share, declared once |
//! | `source`, `pipelines` | WGSL from its files, compiled |
//! | `lists`, `walls` | neighbour lists and surfaces in main memory |
//! | `memory` | buffers, and how much they may take |
//! | `store`, `run` | one run on the device |
//! | `arena`, `advance` | a batch of them, advanced |
//! | `driver` | the thread that does so, for all who ask at a time |

mod advance;
mod arena;
pub mod device;
mod driver;
pub mod layout;
mod memory_budget;
mod neighbour_list;
mod pipelines;
mod run;
mod run_buffers;
mod shared;
pub mod source;
mod walls;

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};

use glam::DVec3;

use crate::engine::scene::Scene;
use crate::engine::state::State;
use crate::engine::{AdvanceReport, Backend, BackendInfo, OutOfDeviceMemory};
use advance::MAX_CHUNK_STEPS;
use arena::arena_bytes;
pub use device::{AdapterName, Device, GpuError, GpuOptions};
use driver::Driver;
use memory_budget::bytes_of;
use neighbour_list::RowCapacity;
use pipelines::Pipelines;
pub use run::GpuRun;
use run::{Run, max_cells};
use run_buffers::ElementCounts;
use source::Source;

/// A graphics adapter that computes. Threads may share one: what they advance at a time becomes one batch.
///
/// Its methods unwind with [`OutOfDeviceMemory`] when a run finds no room: that run is lost, and zero_bits else. They panic when the device is
/// lost: it is of no use from then on, nor are its runs.
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
    ///
    /// # Errors
    /// When there is no room for what is copied.
    pub fn copied_bytes_per_s(&self) -> Result<f64, OutOfDeviceMemory> {
        self.device.copied_bytes_per_s()
    }

    /// Bytes of the device's memory that buffers take now.
    pub fn taken_bytes(&self) -> u64 {
        self.device.memory.used()
    }

    /// How often more memory was wanted than may be taken.
    pub fn refusals(&self) -> u64 {
        self.device.memory.refusals()
    }

    /// Whether the device was lost.
    pub fn has_failed(&self) -> bool {
        self.device.has_failed()
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
        let run = Run::new(&self.device, scene, |draft| self.driver.store(draft));
        GpuRun::new(run.unwrap_or_else(|out_of_memory| unwind(out_of_memory)))
    }

    fn advance(&self, runs: &mut [(&mut GpuRun, u64)]) -> Vec<AdvanceReport> {
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

/// About how many bytes of the device's memory a run takes that is advanced alone, by its size: with rows as long as they usually
/// become. In a batch it takes no more.
pub fn typical_run_bytes(subparticles: u64, triangles: u64) -> u64 {
    let count = |number: u64| u32::try_from(number).unwrap_or(u32::MAX);
    // Of an equipment with everything; the surfaces of a mesh are one or two more.
    let surfaces = 16;
    let particles = count(subparticles.min(1 << 28));
    let elements = ElementCounts {
        scenes: 1,
        particles,
        surfaces,
        facets: count(triangles),
        corners: count(3 * triangles),
        nodes: count(2 * triangles),
        leaves: count(triangles),
        cells: max_cells(particles),
        poses: MAX_CHUNK_STEPS as u32 * surfaces,
    };
    let row_capacity = RowCapacity::holding(14, 7);
    bytes_of(elements.sizes(row_capacity)) + arena_bytes(&elements, row_capacity)
}

/// Leaves a run for which there is no room. No panic: zero_bits is wrong with the program, and zero_bits is said on standard error.
fn unwind(out_of_memory: OutOfDeviceMemory) -> ! {
    resume_unwind(Box::new(out_of_memory))
}

/// What a run comes to, or that there was no room for it.
///
/// # Errors
/// When what runs unwinds with [`OutOfDeviceMemory`].
pub fn catch_out_of_memory<T>(run: impl FnOnce() -> T) -> Result<T, OutOfDeviceMemory> {
    let other = |payload: Box<dyn Any + Send>| match payload.downcast() {
        Ok(out_of_memory) => Err(*out_of_memory),
        Err(panic) => resume_unwind(panic),
    };
    catch_unwind(AssertUnwindSafe(run)).map_or_else(other, Ok)
}
