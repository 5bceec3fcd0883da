//! The graphics adapter: which one, what it must be able to do, and what goes wrong.

use std::fmt;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::time::Instant;

use thiserror::Error;
use wgpu::{
    Adapter, Backends, DeviceType, Features, Instance, InstanceDescriptor, InstanceFlags, Limits,
    MemoryBudgetThresholds, MemoryHints,
};

use super::memory_budget::{MemoryBudget, buffers};
use super::pipelines::STORAGE_BUFFERS;
use crate::engine::OutOfDeviceMemory;

/// Why there is no GPU to compute on.
#[derive(Debug, Error)]
pub enum GpuError {
    /// No adapter that may be used.
    #[error("no GPU: {0}")]
    NoAdapter(String),
    /// The adapter cannot do what the kernels need.
    #[error("{adapter} cannot be used: it has no {what}")]
    Unable {
        /// The adapter.
        adapter: String,
        /// What it is short of.
        what: String,
    },
    /// The driver refuses.
    #[error("the driver of {adapter} refuses: {reason}")]
    Refused {
        /// The adapter.
        adapter: String,
        /// In the driver's words.
        reason: String,
    },
}

/// Which adapter to take.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct GpuOptions {
    /// RunBuffer of the name of the adapter, in any case; none takes the first that can, discrete ones before integrated ones.
    pub device: Option<String>,
    /// Whether none but a discrete adapter will do.
    pub only_discrete: bool,
    /// Whether a software adapter will do, as for tests. It computes on the CPU, slower than the CPU backend.
    pub allow_software: bool,
    /// DampingCap bytes of its memory that buffers may take; none takes what the driver gives.
    pub memory_bytes: Option<u64>,
}

/// An adapter, as far as a user may want to know it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AdapterName {
    /// Its own name.
    pub name: String,
    /// The driver, with its version.
    pub driver: String,
    /// Whether it is software on the CPU.
    pub is_software: bool,
}

impl fmt::Display for AdapterName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let software = if self.is_software { ", software" } else { "" };
        write!(f, "{} ({}{software})", self.name, self.driver)
    }
}

/// An open device.
#[derive(Clone, Debug)]
pub struct Device {
    pub(super) name: AdapterName,
    pub(super) device: wgpu::Device,
    pub(super) queue: wgpu::Queue,
    /// Bytes of the largest buffer that kernels can bind.
    pub(super) largest_buffer: u64,
    /// What buffers of all clones take.
    pub(super) memory: Arc<MemoryBudget>,
    /// Whether it was lost.
    failed: Arc<AtomicBool>,
}

/// What the kernels use beyond WebGPU: constants with each dispatch, and, for triangles that are long for their width, `f64`.
const REQUIRED_FEATURES: Features = Features::IMMEDIATES.union(Features::SHADER_F64);

/// Bytes that are copied to see how fast that goes: more than caches hold.
const COPIED_BYTES: u64 = 256 << 20;

/// Percent of the memory that the driver says a process may take beyond which it gives none, where it says so: on Windows it would
/// go on in main memory, ever slower.
const MAX_BUDGET_PERCENT: u8 = 95;

/// The adapters of this machine.
fn ranked_adapters() -> Vec<Adapter> {
    let instance = Instance::new(InstanceDescriptor {
        backends: Backends::PRIMARY,
        // Debug builds would have the validation layers of the driver; checks of indirect calls cost 20 µs each.
        flags: InstanceFlags::empty(),
        memory_budget_thresholds: MemoryBudgetThresholds {
            for_resource_creation: Some(MAX_BUDGET_PERCENT),
            for_device_loss: None,
        },
        ..InstanceDescriptor::new_without_display_handle()
    });
    let mut adapters = pollster::block_on(instance.enumerate_adapters(Backends::PRIMARY));
    let rank = |adapter: &Adapter| match adapter.get_info().device_type {
        DeviceType::DiscreteGpu => 0,
        DeviceType::VirtualGpu => 1,
        DeviceType::IntegratedGpu => 2,
        DeviceType::Other => 3,
        DeviceType::Cpu => 4,
    };
    adapters.sort_by_key(rank);
    adapters
}

fn name(adapter: &Adapter) -> AdapterName {
    let info = adapter.get_info();
    AdapterName {
        name: info.name,
        driver: format!("{} {}", info.driver, info.driver_info).trim().to_owned(),
        is_software: info.device_type == DeviceType::Cpu,
    }
}

impl Device {
    /// Opens the adapter that the options ask for.
    pub fn open(options: &GpuOptions) -> Result<Self, GpuError> {
        let adapters = ranked_adapters();
        let names: Vec<AdapterName> = adapters.iter().map(name).collect();
        let wanted = options.device.as_deref().unwrap_or_default().to_lowercase();
        let may = |(adapter, name): &(&Adapter, &AdapterName)| {
            let is_discrete = adapter.get_info().device_type == DeviceType::DiscreteGpu;
            (options.allow_software || !name.is_software)
                && (is_discrete || !options.only_discrete)
                && name.name.to_lowercase().contains(&wanted)
        };
        // The first that opens; if none does, what was wrong with the first.
        let mut refused = None;
        for (adapter, name) in adapters.iter().zip(&names).filter(may) {
            match Self::of(adapter, name.clone()) {
                Ok(device) => return Ok(device.with_memory(options.memory_bytes.unwrap_or(u64::MAX))),
                Err(error) => refused = refused.or(Some(error)),
            }
        }
        Err(refused.unwrap_or_else(|| {
            GpuError::NoAdapter(match names.as_slice() {
                [] => "there is no graphics driver".to_owned(),
                names => {
                    let names: Vec<String> = names.iter().map(AdapterName::to_string).collect();
                    format!("none of the adapters will do: {}", names.join(", "))
                }
            })
        }))
    }

    fn of(adapter: &Adapter, name: AdapterName) -> Result<Self, GpuError> {
        let unable = |what: String| GpuError::Unable { adapter: name.to_string(), what };
        let lacks = REQUIRED_FEATURES - adapter.features();
        if !lacks.is_empty() {
            return Err(unable(lacks.iter_names().map(|(name, _)| name).collect::<Vec<_>>().join(", ")));
        }
        let limits: Limits = adapter.limits();
        if limits.max_storage_buffers_per_shader_stage < STORAGE_BUFFERS {
            return Err(unable(format!("{STORAGE_BUFFERS} storage buffers for one kernel")));
        }
        let largest_buffer = limits.max_storage_buffer_binding_size.min(limits.max_buffer_size);
        let request = adapter.request_device(&wgpu::DeviceDescriptor {
            label: Some("roost"),
            required_features: REQUIRED_FEATURES,
            required_limits: limits,
            memory_hints: MemoryHints::Performance,
            ..wgpu::DeviceDescriptor::default()
        });
        let (device, queue) = pollster::block_on(request)
            .map_err(|error| GpuError::Refused { adapter: name.to_string(), reason: error.to_string() })?;
        let failed = Arc::new(AtomicBool::new(false));
        let lost = failed.clone();
        device.set_device_lost_callback(move |_, _| lost.store(true, Relaxed));
        let memory = Arc::new(MemoryBudget::new(u64::MAX));
        Ok(Self { name, device, queue, largest_buffer, memory, failed })
    }

    /// The same with smaller buffers, for tests of what does not fit.
    pub fn limited(self, largest_buffer: u64) -> Self {
        Self { largest_buffer, ..self }
    }

    /// The same, of whose memory so many bytes may be taken; what was made before does not count.
    pub fn with_memory(self, bytes: u64) -> Self {
        Self { memory: Arc::new(MemoryBudget::new(bytes)), ..self }
    }

    /// Whether it was lost.
    pub(super) fn has_failed(&self) -> bool {
        self.failed.load(Relaxed)
    }

    /// It is of no use any more.
    pub(super) fn mark_failed(&self) {
        self.failed.store(true, Relaxed);
    }

    /// Waits until all that was submitted is done, and what it used is free.
    pub(super) fn wait(&self) {
        self.device.poll(wgpu::PollType::wait_indefinitely()).expect("the device answers");
    }

    /// Its adapter.
    pub fn name(&self) -> &AdapterName {
        &self.name
    }

    /// The device itself, for tests of single kernels.
    pub fn wgpu(&self) -> (&wgpu::Device, &wgpu::Queue) {
        (&self.device, &self.queue)
    }

    /// Reads a part of a buffer, in bytes, once what was submitted before is done.
    pub fn read(&self, buffer: &wgpu::Buffer, from: u64, bytes: u64) -> Vec<u8> {
        let [read] = self.read_all([(buffer, from, bytes)]);
        read
    }

    /// Reads parts of several buffers, each from a place on, in bytes, and waits once for all of them: others may keep the device busy.
    pub(super) fn read_all<const N: usize>(&self, parts: [(&wgpu::Buffer, u64, u64); N]) -> [Vec<u8>; N] {
        let sum: u64 = parts.iter().map(|(_, _, bytes)| bytes).sum();
        if sum == 0 {
            return parts.map(|_| Vec::new());
        }
        let staging = self.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("read back"),
            size: sum,
            usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        let mut encoder = self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        let mut at = 0;
        for (buffer, from, bytes) in parts.into_iter().filter(|(_, _, bytes)| *bytes > 0) {
            encoder.copy_buffer_to_buffer(buffer, from, &staging, at, bytes);
            at += bytes;
        }
        let submitted = self.queue.submit([encoder.finish()]);
        staging.map_async(wgpu::MapMode::Read, .., |_| {});
        let wait = wgpu::PollType::Wait { submission_index: Some(submitted), timeout: None };
        self.device.poll(wait).expect("the device answers");
        let mapped = staging.get_mapped_range(..).expect("mapped");
        let mut rest = &mapped[..];
        parts.map(|(_, _, bytes)| rest.split_off(..bytes as usize).expect("it was copied").to_vec())
    }

    /// How many bytes it reads and writes in a second when it copies within its memory.
    pub(super) fn copied_bytes_per_s(&self) -> Result<f64, OutOfDeviceMemory> {
        let bytes = COPIED_BYTES.min(self.largest_buffer);
        let [from, to] = buffers(self, [("from", bytes), ("to", bytes)])?;
        let copy = |times: u32| {
            let mut encoder = self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
            (0..times).for_each(|_| encoder.copy_buffer_to_buffer(&from, 0, &to, 0, bytes));
            let clock = Instant::now();
            self.queue.submit([encoder.finish()]);
            self.wait();
            clock.elapsed().as_secs_f64()
        };
        // The first nearest_points the memory; the difference of the others is free of what a submission takes.
        let [_, few, many] = [1, 4, 20].map(copy);
        Ok(2.0 * 16.0 * bytes as f64 / (many - few).max(1e-9))
    }
}
