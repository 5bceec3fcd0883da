//! The buffers of a batch. Runs are copied in, one behind the other, and copied out after a valid chunk.
//! Until then the buffers of each run hold the state before the chunk, so that it can be repeated.

use wgpu::{BindGroup, CommandEncoder};

use super::device::Device;
use super::layout::{DispatchParams, NONE, NearestPoint, Pose, PrivateState, Report, Scene};
use super::memory_budget::{Buffer, buffers, bytes_of};
use super::neighbour_list::RowCapacity;
use super::pipelines::{Kernel, Pipelines};
use super::run_buffers::{ElementCounts, RunBuffer, RunBuffers};
use crate::engine::OutOfDeviceMemory;

/// Rebuilds of the lists, with the steps after each, that go to the device at once. The device computes them while the host
/// writes down the next ones.
const REBUILDS_PER_SUBMISSION: u32 = 4;

/// Inputs of a batch for one chunk.
#[derive(Debug, Default)]
pub(super) struct BatchInputs {
    pub(super) scenes: Vec<Scene>,
    pub(super) scene_of: Vec<u32>,
    pub(super) poses: Vec<Pose>,
}

/// The buffers of a batch, with their capacity.
#[derive(Debug)]
pub(super) struct Arena {
    capacity: ElementCounts,
    row_capacity: RowCapacity,
    parts: [Buffer; RunBuffer::ALL.len()],
    moved: Buffer,
    new_counts: Buffer,
    new_pairs: Buffer,
    new_walls: Buffer,
    new_moments: Buffer,
    scene_of: Buffer,
    heads: Buffer,
    chain: Buffer,
    scenes: Buffer,
    poses: Buffer,
    reports: Buffer,
    /// Buffers that are only bound.
    _others: [Buffer; 2],
    scene_group: BindGroup,
    /// By the buffer that holds the current sub-particles.
    particle_groups: [BindGroup; 2],
    /// By the buffers that hold the current lists.
    list_groups: [BindGroup; 2],
}

/// Buffers of a batch that have no counterpart in runs.
fn batch_sizes(elements: &ElementCounts, row_capacity: RowCapacity) -> [(&'static str, u64); 13] {
    let bytes = |count: u32, each: usize| u64::from(count) * each as u64;
    let particles = |each| bytes(elements.particles, each);
    [
        ("moved", elements.bytes(RunBuffer::Particles, row_capacity)),
        ("new counts", elements.bytes(RunBuffer::Counts, row_capacity)),
        ("new pairs", elements.bytes(RunBuffer::Pairs, row_capacity)),
        ("new walls", elements.bytes(RunBuffer::Walls, row_capacity)),
        ("new moments", elements.bytes(RunBuffer::Moments, row_capacity)),
        ("nearest_points", particles(size_of::<NearestPoint>()) * u64::from(row_capacity.walls)),
        ("run of each", particles(size_of::<u32>())),
        ("reference", particles(size_of::<PrivateState>())),
        ("heads", bytes(elements.cells, size_of::<u32>())),
        ("chain", particles(size_of::<u32>())),
        ("scenes", bytes(elements.scenes, size_of::<Scene>())),
        ("poses", bytes(elements.poses, size_of::<Pose>())),
        ("reports", bytes(elements.scenes, size_of::<Report>())),
    ]
}

/// Largest buffer of a batch with these counts, in bytes.
pub(super) fn largest_buffer(elements: &ElementCounts, row_capacity: RowCapacity) -> u64 {
    let sizes = elements.sizes(row_capacity).into_iter().chain(batch_sizes(elements, row_capacity));
    sizes.map(|(_, bytes)| bytes).max().unwrap_or(0)
}

/// Size of an arena for these counts, in bytes.
pub(super) fn arena_bytes(elements: &ElementCounts, row_capacity: RowCapacity) -> u64 {
    bytes_of(elements.sizes(row_capacity)) + bytes_of(batch_sizes(elements, row_capacity))
}

impl Arena {
    /// Creates the buffers.
    pub(super) fn new(
        device: &Device,
        pipelines: &Pipelines,
        capacity: ElementCounts,
        row_capacity: RowCapacity,
    ) -> Result<Self, OutOfDeviceMemory> {
        let parts = buffers(device, capacity.sizes(row_capacity))?;
        let [
            moved,
            new_counts,
            new_pairs,
            new_walls,
            new_moments,
            nearest_points,
            scene_of,
            reference,
            heads,
            chain,
            scenes,
            poses,
            reports,
        ] = buffers(device, batch_sizes(&capacity, row_capacity))?;
        let [particles, own, counts, pairs, walls, moments, surfaces, facets, corners, nodes, leaves] =
            &parts;
        let scene_group = [&scenes, surfaces, &poses, facets, corners, nodes, leaves, &reports];
        let particle_group = |a, b| [a, b, own, &scene_of, &reference, &heads, &chain];
        let old = [counts, pairs, walls, moments];
        let new = [&new_counts, &new_pairs, &new_walls, &new_moments];
        let list_group =
            |[a, b, c, m]: [_; 4], [d, e, f, n]: [_; 4]| [a, b, c, d, e, f, &nearest_points, m, n];
        let bind = |group, buffers: &[&Buffer]| pipelines.bind(device, group, buffers);
        Ok(Self {
            scene_group: bind(0, &scene_group),
            particle_groups: [
                bind(1, &particle_group(particles, &moved)),
                bind(1, &particle_group(&moved, particles)),
            ],
            list_groups: [bind(2, &list_group(old, new)), bind(2, &list_group(new, old))],
            capacity,
            row_capacity,
            parts,
            moved,
            new_counts,
            new_pairs,
            new_walls,
            new_moments,
            scene_of,
            heads,
            chain,
            scenes,
            poses,
            reports,
            _others: [nearest_points, reference],
        })
    }

    /// Whether it has the capacity, with rows of exactly this length.
    pub(super) fn holds(&self, elements: ElementCounts, row_capacity: RowCapacity) -> bool {
        self.has(row_capacity) && self.capacity.each(elements, u32::max) == self.capacity
    }

    /// Whether its rows have exactly this length.
    pub(super) fn has(&self, row_capacity: RowCapacity) -> bool {
        self.row_capacity == row_capacity
    }

    /// Length of its rows.
    pub(super) fn row_capacity(&self) -> RowCapacity {
        self.row_capacity
    }

    /// Size, in bytes.
    pub(super) fn bytes(&self) -> u64 {
        arena_bytes(&self.capacity, self.row_capacity)
    }

    /// Capacity.
    pub(super) fn capacity(&self) -> ElementCounts {
        self.capacity
    }

    /// Copies runs and inputs in.
    fn load(
        &self,
        device: &Device,
        encoder: &mut CommandEncoder,
        all_buffers: &[&RunBuffers],
        inputs: &BatchInputs,
    ) {
        let write = |buffer: &Buffer, bytes: &[u8]| device.queue.write_buffer(buffer, 0, bytes);
        write(&self.scenes, bytemuck::cast_slice(&inputs.scenes));
        write(&self.scene_of, bytemuck::cast_slice(&inputs.scene_of));
        write(&self.poses, bytemuck::cast_slice(&inputs.poses));
        write(&self.reports, bytemuck::cast_slice(&vec![Report::fresh(); inputs.scenes.len()]));
        for part in RunBuffer::ALL {
            let mut at = 0;
            for buffers in all_buffers {
                let to = &self.parts[part as usize];
                copy(encoder, buffers.buffer(part), 0, to, at, buffers.bytes(part));
                at += buffers.bytes(part);
            }
        }
    }

    /// Advances by `steps`, with a rebuild of the lists every `interval` steps. Returns the reports. Results
    /// stay in the arena.
    pub(super) fn advance(
        &self,
        device: &Device,
        pipelines: &Pipelines,
        all_buffers: &[&RunBuffers],
        inputs: &BatchInputs,
        steps: u32,
        interval: u32,
    ) -> Vec<Report> {
        let mut encoder = device.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        self.load(device, &mut encoder, all_buffers, inputs);
        let count = inputs.scene_of.len() as u32;
        let dispatch = |step| DispatchParams {
            step,
            count,
            pair_capacity: self.row_capacity.pairs,
            wall_capacity: self.row_capacity.walls,
            kept: 0,
        };
        for first in (0..steps).step_by(interval as usize) {
            let rebuilds = first / interval;
            if rebuilds > 0 && rebuilds.is_multiple_of(REBUILDS_PER_SUBMISSION) {
                let empty = device.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
                device.queue.submit([std::mem::replace(&mut encoder, empty).finish()]);
            }
            encoder.clear_buffer(&self.heads, 0, None);
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
            let lists = rebuilds as usize % 2;
            pass.set_bind_group(0, &self.scene_group, &[]);
            pass.set_bind_group(1, &self.particle_groups[first as usize % 2], &[]);
            pass.set_bind_group(2, &self.list_groups[lists], &[]);
            pipelines.run(&mut pass, Kernel::CellList, &dispatch(first));
            pipelines.run(&mut pass, Kernel::PairList, &dispatch(first));
            pipelines.run(&mut pass, Kernel::WallList, &dispatch(first));
            pass.set_bind_group(2, &self.list_groups[1 - lists], &[]);
            for step in first..steps.min(first + interval) {
                pass.set_bind_group(1, &self.particle_groups[step as usize % 2], &[]);
                pipelines.run(&mut pass, Kernel::Step, &dispatch(step));
            }
        }
        device.queue.submit([encoder.finish()]);
        let bytes = device.read(&self.reports, 0, (inputs.scenes.len() * size_of::<Report>()) as u64);
        bytemuck::pod_collect_to_vec(&bytes)
    }

    /// Removes sub-particles from the rows of a run: `map` holds the new index of each, or [`NONE`].
    pub(super) fn remove(
        &self,
        device: &Device,
        pipelines: &Pipelines,
        buffers: &mut RunBuffers,
        inputs: &BatchInputs,
        map: &[u32],
    ) {
        let mut encoder = device.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        self.load(device, &mut encoder, &[buffers], inputs);
        device.queue.write_buffer(&self.chain, 0, bytemuck::cast_slice(map));
        let kept = map.iter().filter(|&&to| to != NONE).count() as u32;
        let RowCapacity { pairs: pair_capacity, walls: wall_capacity } = self.row_capacity;
        let dispatch =
            DispatchParams { step: 0, count: map.len() as u32, pair_capacity, wall_capacity, kept };
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
        pass.set_bind_group(0, &self.scene_group, &[]);
        pass.set_bind_group(1, &self.particle_groups[0], &[]);
        pass.set_bind_group(2, &self.list_groups[0], &[]);
        pipelines.run(&mut pass, Kernel::Remove, &dispatch);
        drop(pass);
        buffers.keep(kept);
        let rows = [
            (RunBuffer::Counts, &self.new_counts),
            (RunBuffer::Pairs, &self.new_pairs),
            (RunBuffer::Moments, &self.new_moments),
            (RunBuffer::Walls, &self.new_walls),
        ];
        for (part, from) in rows {
            copy(&mut encoder, from, 0, buffers.buffer(part), 0, buffers.bytes(part));
        }
        device.queue.submit([encoder.finish()]);
    }

    /// Copies the changed data back to the runs, and what observers read of it to the buffer beside some of them.
    pub(super) fn unload(
        &self,
        device: &Device,
        runs: &[(&RunBuffers, Option<&wgpu::Buffer>)],
        steps: u32,
        interval: u32,
    ) -> wgpu::SubmissionIndex {
        let mut encoder = device.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        let is_turned = steps.div_ceil(interval) % 2 == 1;
        for part in RunBuffer::CHANGING {
            let from = match part {
                RunBuffer::Particles if steps % 2 == 1 => &self.moved,
                RunBuffer::Counts if is_turned => &self.new_counts,
                RunBuffer::Pairs if is_turned => &self.new_pairs,
                RunBuffer::Walls if is_turned => &self.new_walls,
                RunBuffer::Moments if is_turned => &self.new_moments,
                _ => &self.parts[part as usize],
            };
            let mut at = 0;
            for (buffers, read_back) in runs {
                let bytes = buffers.bytes(part);
                copy(&mut encoder, from, at, buffers.buffer(part), 0, bytes);
                if let Some((to, to_at)) = read_back.zip(buffers.observed_at(part)) {
                    copy(&mut encoder, from, at, to, to_at, bytes);
                }
                at += bytes;
            }
        }
        device.queue.submit([encoder.finish()])
    }
}

fn copy(
    encoder: &mut CommandEncoder,
    from: &wgpu::Buffer,
    at: u64,
    to: &wgpu::Buffer,
    to_at: u64,
    bytes: u64,
) {
    if bytes > 0 {
        encoder.copy_buffer_to_buffer(from, at, to, to_at, bytes);
    }
}
