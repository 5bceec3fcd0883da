//! The compiled kernels and their buffer bindings.

use wgpu::{
    BindGroup, BindGroupLayout, BindGroupLayoutEntry, BindingType, BufferBindingType, ComputePass,
    ComputePipeline, ErrorFilter, ShaderStages,
};

use super::device::{Device, GpuError};
use super::layout::DispatchParams;
use super::memory_budget::Buffer;
use super::source::Source;

/// Invocations per workgroup.
pub(super) const GROUP_SIZE: u32 = 64;

/// Invocations that share a sub-particle in the kernel of neighbour lists.
pub(super) const LANES: u32 = 8;

/// Maximum number of workgroups along one dimension.
const MAX_GROUPS_PER_ROW: u32 = 65_535;

/// Whether kernels write each buffer of each bind group; see `kernels/bindings.wgsl`.
const WRITABLE: [&[bool]; 3] = [
    &[false, false, false, false, false, false, false, true],
    &[false, true, true, false, true, true, true],
    &[true, true, true, true, true, true, true, true, true],
];

/// Number of storage buffers of a kernel.
pub(super) const STORAGE_BUFFERS: u32 = (WRITABLE[0].len() + WRITABLE[1].len() + WRITABLE[2].len()) as u32;

/// Size of the constants of a dispatch, in bytes.
const IMMEDIATE_BYTES: u32 = size_of::<DispatchParams>() as u32;

/// The kernels: those of a rebuild and of a step in their order, then the others.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kernel {
    /// Build the cell list.
    CellList,
    /// Rebuild the lists of neighbours.
    PairList,
    /// Rebuild the lists of facets.
    WallList,
    /// Forces and integration.
    Step,
    /// Removal of sub-particles.
    Remove,
}

impl Kernel {
    /// Names of the entry points.
    const ALL: [&str; 5] = ["cell_list", "pair_list", "wall_list", "step", "remove"];

    /// Invocations per sub-particle.
    fn lanes(self) -> u32 {
        if self == Self::PairList { LANES } else { 1 }
    }
}

/// The kernels on a device.
#[derive(Debug)]
pub(super) struct Pipelines {
    layouts: Vec<BindGroupLayout>,
    kernels: [ComputePipeline; Kernel::ALL.len()],
}

impl Pipelines {
    /// Compiles the kernels.
    pub(super) fn new(opened: &Device, source: &Source) -> Result<Self, GpuError> {
        let device = &opened.device;
        let scopes = [ErrorFilter::Validation, ErrorFilter::Internal, ErrorFilter::OutOfMemory]
            .map(|filter| device.push_error_scope(filter));
        let layouts: Vec<BindGroupLayout> = WRITABLE
            .iter()
            .map(|written| {
                let entry = |(binding, &written): (usize, &bool)| BindGroupLayoutEntry {
                    binding: binding as u32,
                    visibility: ShaderStages::COMPUTE,
                    ty: BindingType::Buffer {
                        ty: BufferBindingType::Storage { read_only: !written },
                        has_dynamic_offset: false,
                        min_binding_size: None,
                    },
                    count: None,
                };
                let entries: Vec<_> = written.iter().enumerate().map(entry).collect();
                device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
                    label: None,
                    entries: &entries,
                })
            })
            .collect();
        let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: None,
            bind_group_layouts: &layouts.iter().map(Some).collect::<Vec<_>>(),
            immediate_size: IMMEDIATE_BYTES,
        });
        let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some("roost"),
            source: wgpu::ShaderSource::Wgsl(source.text("").into()),
        });
        let kernels = Kernel::ALL.map(|name| {
            device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
                label: Some(name),
                layout: Some(&layout),
                module: &module,
                entry_point: Some(name),
                compilation_options: wgpu::PipelineCompilationOptions {
                    zero_initialize_workgroup_memory: false,
                    ..wgpu::PipelineCompilationOptions::default()
                },
                cache: None,
            })
        });
        // Innermost scope first.
        let errors: Vec<_> =
            scopes.into_iter().rev().filter_map(|scope| pollster::block_on(scope.pop())).collect();
        match errors.first() {
            Some(error) => {
                let (adapter, reason) = (opened.name.to_string(), error.to_string());
                Err(GpuError::Refused { adapter, reason })
            }
            None => Ok(Self { layouts, kernels }),
        }
    }

    /// Binds buffers as one of the groups.
    pub(super) fn bind(&self, device: &Device, group: usize, buffers: &[&Buffer]) -> BindGroup {
        let entries = buffers.iter().enumerate().map(|(binding, buffer)| wgpu::BindGroupEntry {
            binding: binding as u32,
            resource: buffer.as_entire_binding(),
        });
        device.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: None,
            layout: &self.layouts[group],
            entries: &entries.collect::<Vec<_>>(),
        })
    }

    /// Runs a kernel for each sub-particle, on bound groups.
    pub(super) fn run(&self, pass: &mut ComputePass<'_>, kernel: Kernel, dispatch: &DispatchParams) {
        let groups = dispatch.count.div_ceil(GROUP_SIZE / kernel.lanes()).max(1);
        let (x, y) = (groups.min(MAX_GROUPS_PER_ROW), groups.div_ceil(MAX_GROUPS_PER_ROW));
        pass.set_pipeline(&self.kernels[kernel as usize]);
        pass.set_immediates(0, bytemuck::bytes_of(dispatch));
        pass.dispatch_workgroups(x, y, 1);
    }
}
