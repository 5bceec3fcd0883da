//! The graphics adapter: selection, requirements and failures.

use std::fmt;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::{Arc, OnceLock};
use std::time::Instant;

use thiserror::Error;
use wgpu::{
    Adapter, Backends, DeviceType, ErrorFilter, Features, Instance, InstanceDescriptor, InstanceFlags,
    Limits, MemoryBudgetThresholds, MemoryHints,
};

use super::memory_budget::{MemoryBudget, buffers};
use super::pipelines::STORAGE_BUFFERS;
use super::unwind;
use crate::engine::OutOfDeviceMemory;

/// Why there is no GPU to compute on.
#[derive(Debug, Error)]
pub enum GpuError {
    /// No permitted adapter.
    #[error("no GPU: {0}")]
    NoAdapter(String),
    /// The adapter lacks a requirement of the kernels.
    #[error("{adapter} cannot be used: it has no {what}")]
    Unable {
        /// Name of the adapter.
        adapter: String,
        /// Missing requirement.
        what: String,
    },
    /// The driver refused to open the adapter.
    #[error("the driver of {adapter} refuses: {reason}")]
    Refused {
        /// Name of the adapter.
        adapter: String,
        /// Message of the driver.
        reason: String,
    },
}

/// Selection of an adapter.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct GpuOptions {
    /// Part of the adapter's name, in any case. `None` takes the first suitable one, discrete before
    /// integrated.
    pub device: Option<String>,
    /// Whether to accept only discrete adapters.
    pub only_discrete: bool,
    /// Whether to accept a software adapter, for tests. It runs on the CPU, slower than the CPU backend.
    pub allow_software: bool,
    /// Memory budget for buffers, in bytes. `None` takes as much as the driver gives.
    pub memory_bytes: Option<u64>,
}

/// Identity of an adapter.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AdapterName {
    /// Name of the adapter.
    pub name: String,
    /// Name and version of the driver.
    pub driver: String,
    /// Whether it is a software adapter.
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
    /// Largest buffer that kernels can bind, in bytes.
    pub(super) largest_buffer: u64,
    /// Memory of the buffers of all clones.
    pub(super) memory: Arc<MemoryBudget>,
    /// Whether the device was lost.
    failed: Arc<AtomicBool>,
}

/// Requirements beyond WebGPU: constants per dispatch, and `f64` for sliver triangles.
const REQUIRED_FEATURES: Features = Features::IMMEDIATES.union(Features::SHADER_F64);

/// Bytes copied to measure the bandwidth: more than caches hold.
const COPIED_BYTES: u64 = 256 << 20;

/// Percentage of the driver's memory budget up to which it grants memory, on drivers with a budget. Beyond
/// it, Windows would continue in main memory, ever slower.
const MAX_BUDGET_PERCENT: u8 = 95;

/// The graphics drivers. They stay loaded until the process ends: NVIDIA's was seen to crash when it is unloaded earlier.
fn instance() -> &'static Instance {
    static INSTANCE: OnceLock<Instance> = OnceLock::new();
    let open = || {
        Instance::new(InstanceDescriptor {
            backends: Backends::PRIMARY,
            // Debug builds would enable validation layers. Checks of indirect calls cost 20 µs each.
            flags: InstanceFlags::empty(),
            memory_budget_thresholds: MemoryBudgetThresholds {
                for_resource_creation: Some(MAX_BUDGET_PERCENT),
                for_device_loss: None,
            },
            ..InstanceDescriptor::new_without_display_handle()
        })
    };
    INSTANCE.get_or_init(open)
}

/// The adapters of this machine, preferred first.
fn ranked_adapters() -> Vec<Adapter> {
    let mut adapters = pollster::block_on(instance().enumerate_adapters(Backends::PRIMARY));
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
    /// Opens the adapter selected by the options.
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
        // Take the first that opens. If none does, report the failure of the first.
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

    /// The same device with a smaller buffer limit, for tests.
    pub fn limited(self, largest_buffer: u64) -> Self {
        Self { largest_buffer, ..self }
    }

    /// The same device with a memory budget in bytes. Earlier buffers do not count.
    pub fn with_memory(self, bytes: u64) -> Self {
        Self { memory: Arc::new(MemoryBudget::new(bytes)), ..self }
    }

    /// Whether the device was lost.
    pub(super) fn has_failed(&self) -> bool {
        self.failed.load(Relaxed)
    }

    /// Marks the device as failed.
    pub(super) fn mark_failed(&self) {
        self.failed.store(true, Relaxed);
    }

    /// Waits until all submitted work is done and its memory is free.
    pub(super) fn wait(&self) {
        self.device.poll(wgpu::PollType::wait_indefinitely()).expect("the device answers");
    }

    /// Its adapter.
    pub fn name(&self) -> &AdapterName {
        &self.name
    }

    /// The wgpu device, for tests of single kernels.
    pub fn wgpu(&self) -> (&wgpu::Device, &wgpu::Queue) {
        (&self.device, &self.queue)
    }

    /// Reads a part of a buffer, in bytes, after all earlier work.
    pub fn read(&self, buffer: &wgpu::Buffer, from: u64, bytes: u64) -> Vec<u8> {
        let [read] = self.read_all([(buffer, from, bytes)]);
        read
    }

    /// Reads parts of several buffers, each from an offset in bytes, with one wait: other runs may keep the
    /// device busy.
    pub(super) fn read_all<const N: usize>(&self, parts: [(&wgpu::Buffer, u64, u64); N]) -> [Vec<u8>; N] {
        let sum: u64 = parts.iter().map(|(_, _, bytes)| bytes).sum();
        if sum == 0 {
            return parts.map(|_| Vec::new());
        }
        let staging = self.staging(sum).unwrap_or_else(|out_of_memory| unwind(out_of_memory));
        let mut encoder = self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        let mut at = 0;
        for (buffer, from, bytes) in parts.into_iter().filter(|(_, _, bytes)| *bytes > 0) {
            encoder.copy_buffer_to_buffer(buffer, from, &staging, at, bytes);
            at += bytes;
        }
        let submitted = self.queue.submit([encoder.finish()]);
        self.with_mapped(&staging, submitted, |mut rest| {
            parts.map(|(_, _, bytes)| rest.split_off(..bytes as usize).expect("it was copied").to_vec())
        })
    }

    /// Calls `read` with the content of a buffer for reading back, after this submission.
    pub(super) fn with_mapped<T>(
        &self,
        staging: &wgpu::Buffer,
        submitted: wgpu::SubmissionIndex,
        read: impl FnOnce(&[u8]) -> T,
    ) -> T {
        staging.map_async(wgpu::MapMode::Read, .., |_| {});
        let wait = wgpu::PollType::Wait { submission_index: Some(submitted), timeout: None };
        self.device.poll(wait).expect("the device answers");
        let mapped = staging.get_mapped_range(..).expect("mapped");
        let value = read(&mapped);
        drop(mapped);
        staging.unmap();
        value
    }

    /// A buffer in main memory to read back into. It does not count as memory of the device.
    pub(super) fn staging(&self, bytes: u64) -> Result<wgpu::Buffer, OutOfDeviceMemory> {
        let scope = self.device.push_error_scope(ErrorFilter::OutOfMemory);
        let staging = self.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("read back"),
            size: bytes,
            usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        match pollster::block_on(scope.pop()) {
            Some(error) => Err(OutOfDeviceMemory(error.to_string())),
            None => Ok(staging),
        }
    }

    /// Memory bandwidth of a copy on the device, in bytes read and written per second.
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
        // The first copy touches the memory. The difference of the others cancels the cost of a submission.
        let [_, few, many] = [1, 4, 20].map(copy);
        Ok(2.0 * 16.0 * bytes as f64 / (many - few).max(1e-9))
    }
}
