//! The graphics adapter: which one, what it must be able to do, and what goes wrong.

use std::fmt;
use std::time::Instant;

use thiserror::Error;
use wgpu::{
    Adapter, Backends, DeviceType, Features, Instance, InstanceDescriptor, InstanceFlags, Limits, MemoryHints,
};

use super::pipelines::STORAGE_BUFFERS;
use super::store::buffer;

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
    /// Part of the name of the adapter, in any case; none takes the first that can, discrete ones before integrated ones.
    pub device: Option<String>,
    /// Whether none but a discrete adapter will do.
    pub only_discrete: bool,
    /// Whether a software adapter will do, as for tests. It computes on the CPU, slower than the CPU backend.
    pub allow_software: bool,
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
}

/// What the kernels use beyond WebGPU: constants with each dispatch, and, for triangles that are long for their width, `f64`.
const NEEDED: Features = Features::IMMEDIATES.union(Features::SHADER_F64);

/// Bytes that are copied to see how fast that goes: more than caches hold.
const COPIED_BYTES: u64 = 256 << 20;

/// The adapters of this machine.
fn found() -> Vec<Adapter> {
    let instance = Instance::new(InstanceDescriptor {
        backends: Backends::PRIMARY,
        // Debug builds would have the validation layers of the driver; checks of indirect calls cost 20 µs each.
        flags: InstanceFlags::empty(),
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
        let adapters = found();
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
                Ok(device) => return Ok(device),
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
        let lacks = NEEDED - adapter.features();
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
            required_features: NEEDED,
            required_limits: limits,
            memory_hints: MemoryHints::Performance,
            ..wgpu::DeviceDescriptor::default()
        });
        let (device, queue) = pollster::block_on(request)
            .map_err(|error| GpuError::Refused { adapter: name.to_string(), reason: error.to_string() })?;
        Ok(Self { name, device, queue, largest_buffer })
    }

    /// The same with smaller buffers, for tests of what does not fit.
    pub fn limited(self, largest_buffer: u64) -> Self {
        Self { largest_buffer, ..self }
    }

    /// Its adapter.
    pub fn name(&self) -> &AdapterName {
        &self.name
    }

    /// The device itself, for tests of single kernels.
    pub fn wgpu(&self) -> (&wgpu::Device, &wgpu::Queue) {
        (&self.device, &self.queue)
    }

    /// Reads a part of a buffer, in bytes, once all that was submitted is done.
    pub fn read(&self, buffer: &wgpu::Buffer, from: u64, bytes: u64) -> Vec<u8> {
        if bytes == 0 {
            return Vec::new();
        }
        let staging = self.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("read back"),
            size: bytes,
            usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        let mut encoder = self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        encoder.copy_buffer_to_buffer(buffer, from, &staging, 0, bytes);
        self.queue.submit([encoder.finish()]);
        staging.map_async(wgpu::MapMode::Read, .., |_| {});
        self.device.poll(wgpu::PollType::wait_indefinitely()).expect("the device answers");
        staging.get_mapped_range(..).expect("mapped").to_vec()
    }

    /// How many bytes it reads and writes in a second when it copies within its memory.
    pub(super) fn copied_bytes_per_s(&self) -> f64 {
        let bytes = COPIED_BYTES.min(self.device.limits().max_buffer_size);
        let [from, to] = ["from", "to"].map(|label| buffer(self, label, bytes));
        let copy = |times: u32| {
            let mut encoder = self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
            (0..times).for_each(|_| encoder.copy_buffer_to_buffer(&from, 0, &to, 0, bytes));
            let clock = Instant::now();
            self.queue.submit([encoder.finish()]);
            self.device.poll(wgpu::PollType::wait_indefinitely()).expect("the device answers");
            clock.elapsed().as_secs_f64()
        };
        // The first touches the memory; the difference of the others is free of what a submission takes.
        let [_, few, many] = [1, 4, 20].map(copy);
        2.0 * 16.0 * bytes as f64 / (many - few).max(1e-9)
    }
}
