//! The GPU backend: the physics of the plain path as WGSL kernels, for any adapter that wgpu supports.
//!
//! Every sub-particle gathers its forces as on the plain path of [`crate::cpu`], with the same operations in
//! the same order. An adapter that rounds every operation by itself, like Mesa's lavapipe, gives the same
//! bits. A step is one dispatch.
//!
//! Neighbour lists are rebuilt every few steps, needed or not. If a sub-particle moved too far in between,
//! the chunk of steps is repeated with a shorter interval. Neither this nor the rest of the batch changes a
//! bit: lists hold all pairs within range, rows are sorted, and pairs without contact add nothing.
//!
//! | file | content |
//! |---|---|
//! | `device` | selection and opening of the adapter |
//! | `shared`, `layout` | types shared by host and kernels, declared once |
//! | `laws` | the laws of a run, as kernels take them |
//! | `source`, `pipelines` | WGSL assembled from its files, and compiled |
//! | `neighbour_list`, `walls` | neighbour lists and surfaces in main memory |
//! | `memory_budget` | buffers, and the memory that they may use |
//! | `run_buffers`, `run`, `saved` | one run on the device |
//! | `arena`, `advance` | a batch of runs |
//! | `driver` | the thread that advances batches for all callers |

mod advance;
mod arena;
pub mod device;
mod driver;
mod laws;
pub mod layout;
mod memory_budget;
mod neighbour_list;
mod pipelines;
mod run;
mod run_buffers;
mod saved;
mod shared;
pub mod source;
mod walls;

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};

use crate::engine::saved::SavedRun;
use crate::engine::scene::{Placement, Scene};
use crate::engine::state::State;
use crate::engine::{AdvanceReport, Backend, BackendInfo, OutOfDeviceMemory, SurfaceLoad};
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

/// A graphics adapter that computes. Threads may share it: runs that they advance at the same time form one
/// batch.
///
/// Methods unwind with [`OutOfDeviceMemory`] when a run does not fit; only that run is lost. They panic when
/// the device is lost, with all of its runs.
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

    /// The same with other kernels, for tests of fault detection.
    pub fn with(device: Device, source: &Source) -> Result<Self, GpuError> {
        let pipelines = Pipelines::new(&device, source)?;
        Ok(Self { driver: Driver::start(device.clone(), pipelines), device })
    }

    /// Memory bandwidth of a copy on the device, in bytes read and written per second.
    ///
    /// # Errors
    /// When the buffers for the copy do not fit.
    pub fn copied_bytes_per_s(&self) -> Result<f64, OutOfDeviceMemory> {
        self.device.copied_bytes_per_s()
    }

    /// Device memory of all buffers, in bytes.
    pub fn used_bytes(&self) -> u64 {
        self.device.memory.used()
    }

    /// Number of refused memory reservations.
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
        let run = Run::new(&self.device, scene, |contents| self.driver.create_buffers(contents));
        GpuRun::new(run.unwrap_or_else(|out_of_memory| unwind(out_of_memory)))
    }

    fn advance(&self, runs: &mut [(&mut GpuRun, u64)]) -> Vec<AdvanceReport> {
        self.driver.advance(runs)
    }

    fn state<'a>(&self, run: &'a mut GpuRun) -> &'a State {
        run.get().state(&self.device)
    }

    fn surface_loads(&self, run: &mut GpuRun) -> Vec<SurfaceLoad> {
        run.get().surface_loads(&self.device)
    }

    fn bonds(&self, run: &mut GpuRun) -> Vec<[u32; 2]> {
        run.get().bonds(&self.device)
    }

    fn start(&self, run: &mut GpuRun) {
        run.get().start(&self.device);
    }

    fn enter(&self, run: &mut GpuRun, scene: &Scene, first: usize, bodies: &[Placement]) {
        let entered = run.get().enter(&self.device, scene, first, bodies);
        entered.unwrap_or_else(|out_of_memory| unwind(out_of_memory));
    }

    fn remove(&self, run: &mut GpuRun, serials: &[u32]) {
        let map = run.get().forget(&self.device, serials);
        self.driver.remove(run, map).unwrap_or_else(|out_of_memory| unwind(out_of_memory));
        run.get().write_state(&self.device);
    }

    fn save(&self, run: &mut GpuRun) -> SavedRun {
        run.get().save(&self.device)
    }

    fn restore(&self, scene: &Scene, saved: &SavedRun) -> GpuRun {
        let run = Run::restore(&self.device, scene, saved, |contents| self.driver.create_buffers(contents));
        GpuRun::new(run.unwrap_or_else(|out_of_memory| unwind(out_of_memory)))
    }
}

/// Approximate device memory of a run that is advanced alone, in bytes, with rows of typical length. In a
/// batch it needs no more. `has_moments` is true when bonds carry moments.
pub fn typical_run_bytes(subparticles: u64, triangles: u64, has_moments: bool) -> u64 {
    let count = |number: u64| u32::try_from(number).unwrap_or(u32::MAX);
    // A full hopper. The surfaces of a mesh add one or two.
    let surfaces = 16;
    let particles = count(subparticles.min(1 << 28));
    let elements = ElementCounts {
        scenes: 1,
        particles,
        moments: if has_moments { particles } else { 0 },
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

/// Unwinds from a run that does not fit. Not a panic: the program is sound, and nothing is printed.
fn unwind(out_of_memory: OutOfDeviceMemory) -> ! {
    resume_unwind(Box::new(out_of_memory))
}

/// Result of `run`, or the reason why it did not fit.
///
/// # Errors
/// When `run` unwinds with [`OutOfDeviceMemory`].
pub fn catch_out_of_memory<T>(run: impl FnOnce() -> T) -> Result<T, OutOfDeviceMemory> {
    let other = |payload: Box<dyn Any + Send>| match payload.downcast() {
        Ok(out_of_memory) => Err(*out_of_memory),
        Err(panic) => resume_unwind(panic),
    };
    catch_unwind(AssertUnwindSafe(run)).map_or_else(other, Ok)
}
