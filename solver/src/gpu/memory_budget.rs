//! The memory budget of the device. Buffers are counted when they are created, since wgpu does not report
//! free memory.

use std::ops::Deref;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

use wgpu::{BufferUsages, ErrorFilter};

use super::device::Device;
use crate::engine::OutOfDeviceMemory;

/// Minimum size of a buffer, in bytes. WGSL requires room for at least one element.
pub(super) const MIN_BUFFER_BYTES: u64 = 256;

/// Budget and use of device memory by buffers, in bytes.
#[derive(Debug)]
pub(super) struct MemoryBudget {
    allowed: u64,
    used: AtomicU64,
    refusals: AtomicU64,
}

impl MemoryBudget {
    pub(super) fn new(allowed: u64) -> Self {
        Self { allowed, used: AtomicU64::new(0), refusals: AtomicU64::new(0) }
    }

    /// Memory in use.
    pub(super) fn used(&self) -> u64 {
        self.used.load(Relaxed)
    }

    /// Memory left.
    pub(super) fn available(&self) -> u64 {
        self.allowed.saturating_sub(self.used())
    }

    /// Number of refused reservations.
    pub(super) fn refusals(&self) -> u64 {
        self.refusals.load(Relaxed)
    }

    fn reserve(&self, bytes: u64) -> Result<(), OutOfDeviceMemory> {
        let more = |taken: u64| taken.checked_add(bytes).filter(|sum| *sum <= self.allowed);
        let refused = |taken: u64| {
            let allowed = self.allowed;
            self.refusals.fetch_add(1, Relaxed);
            OutOfDeviceMemory(format!(
                "{bytes} bytes of its memory are needed; {taken} of the {allowed} allowed are taken"
            ))
        };
        self.used.fetch_update(Relaxed, Relaxed, more).map(drop).map_err(refused)
    }
}

/// A buffer for kernels. Its drop releases its memory.
#[derive(Debug)]
pub(super) struct Buffer {
    buffer: wgpu::Buffer,
    memory: Arc<MemoryBudget>,
}

impl Deref for Buffer {
    type Target = wgpu::Buffer;

    fn deref(&self) -> &wgpu::Buffer {
        &self.buffer
    }
}

impl Drop for Buffer {
    fn drop(&mut self) {
        self.memory.used.fetch_sub(self.buffer.size(), Relaxed);
    }
}

/// Memory of buffers of these sizes, in bytes.
pub(super) fn bytes_of<const N: usize>(sizes: [(&str, u64); N]) -> u64 {
    sizes.iter().map(|(_, bytes)| (*bytes).max(MIN_BUFFER_BYTES)).sum()
}

/// Creates buffers of these names and sizes: all or none.
pub(super) fn buffers<const N: usize>(
    device: &Device,
    sizes: [(&str, u64); N],
) -> Result<[Buffer; N], OutOfDeviceMemory> {
    let (needed, limit) = (sizes.iter().map(|(_, bytes)| *bytes).max().unwrap_or(0), device.largest_buffer);
    if needed > limit {
        return Err(OutOfDeviceMemory(format!(
            "a buffer of {needed} bytes is needed; the device allows {limit}"
        )));
    }
    device.memory.reserve(bytes_of(sizes))?;
    let scope = device.device.push_error_scope(ErrorFilter::OutOfMemory);
    let made = sizes.map(|(label, bytes)| Buffer {
        buffer: device.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some(label),
            size: bytes.max(MIN_BUFFER_BYTES),
            usage: BufferUsages::STORAGE | BufferUsages::COPY_SRC | BufferUsages::COPY_DST,
            mapped_at_creation: false,
        }),
        memory: device.memory.clone(),
    });
    match pollster::block_on(scope.pop()) {
        Some(error) => Err(OutOfDeviceMemory(error.to_string())),
        None => Ok(made),
    }
}
