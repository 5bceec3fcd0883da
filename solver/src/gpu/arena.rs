//! The buffers in which a batch is advanced: runs are copied in, one behind the other, and out again when the chunk has
//! gone well. Until then each run's own buffers hold what the chunk began with, so that it can be done again.

use wgpu::{BindGroup, CommandEncoder};

use super::device::Device;
use super::layout::{NearestPoint, Now, Own, Pose, Report, Scene};
use super::memory::{Buffer, buffers, bytes_of};
use super::neighbour_list::Slots;
use super::pipelines::{Kernel, Pipelines};
use super::store::{Extent, Part, Store};
use crate::engine::OutOfDeviceMemory;

/// What a batch brings along for one chunk.
#[derive(Debug, Default)]
pub(super) struct Cargo {
    pub(super) scenes: Vec<Scene>,
    pub(super) scene_of: Vec<u32>,
    pub(super) poses: Vec<Pose>,
}

/// The buffers, and what they have room for.
#[derive(Debug)]
pub(super) struct Arena {
    room: Extent,
    slots: Slots,
    parts: [Buffer; Part::ALL.len()],
    moved: Buffer,
    new_counts: Buffer,
    new_pairs: Buffer,
    new_walls: Buffer,
    scene_of: Buffer,
    heads: Buffer,
    scenes: Buffer,
    poses: Buffer,
    reports: Buffer,
    /// What is bound and never named again.
    _others: [Buffer; 3],
    scene_group: BindGroup,
    /// By which of the two holds the sub-particles as they are.
    particle_groups: [BindGroup; 2],
    /// By which of the two holds the lists as they are.
    list_groups: [BindGroup; 2],
}

/// The buffers for a batch beyond those that runs have too.
fn own_sizes(extent: &Extent, slots: Slots) -> [(&'static str, u64); 12] {
    let bytes = |count: u32, each: usize| u64::from(count) * each as u64;
    let particles = |each| bytes(extent.particles, each);
    [
        ("moved", extent.bytes(Part::Particles, slots)),
        ("new counts", extent.bytes(Part::Counts, slots)),
        ("new pairs", extent.bytes(Part::Pairs, slots)),
        ("new walls", extent.bytes(Part::Walls, slots)),
        ("nearest_points", particles(size_of::<NearestPoint>()) * u64::from(slots.walls)),
        ("run of each", particles(size_of::<u32>())),
        ("reference", particles(size_of::<Own>())),
        ("heads", bytes(extent.cells, size_of::<u32>())),
        ("chain", particles(size_of::<u32>())),
        ("scenes", bytes(extent.scenes, size_of::<Scene>())),
        ("poses", bytes(extent.poses, size_of::<Pose>())),
        ("reports", bytes(extent.scenes, size_of::<Report>())),
    ]
}

/// The largest buffer that a batch of this extent needs, in bytes.
pub(super) fn largest_buffer(extent: &Extent, slots: Slots) -> u64 {
    let sizes = extent.sizes(slots).into_iter().chain(own_sizes(extent, slots));
    sizes.map(|(_, bytes)| bytes).max().unwrap_or(0)
}

/// What an arena of this extent takes, in bytes.
pub(super) fn arena_bytes(extent: &Extent, slots: Slots) -> u64 {
    bytes_of(extent.sizes(slots)) + bytes_of(own_sizes(extent, slots))
}

impl Arena {
    /// Makes the buffers, or says why the device will not.
    pub(super) fn new(
        device: &Device,
        pipelines: &Pipelines,
        room: Extent,
        slots: Slots,
    ) -> Result<Self, OutOfDeviceMemory> {
        let parts = buffers(device, room.sizes(slots))?;
        let [
            moved,
            new_counts,
            new_pairs,
            new_walls,
            nearest_points,
            scene_of,
            reference,
            heads,
            chain,
            scenes,
            poses,
            reports,
        ] = buffers(device, own_sizes(&room, slots))?;
        let [particles, own, counts, pairs, walls, surfaces, facets, corners, nodes, leaves] = &parts;
        let scene_group = [&scenes, surfaces, &poses, facets, corners, nodes, leaves, &reports];
        let particle_group = |a, b| [a, b, own, &scene_of, &reference, &heads, &chain];
        let old = [counts, pairs, walls];
        let new = [&new_counts, &new_pairs, &new_walls];
        let list_group = |[a, b, c]: [_; 3], [d, e, f]: [_; 3]| [a, b, c, d, e, f, &nearest_points];
        let bind = |group, buffers: &[&Buffer]| pipelines.bind(device, group, buffers);
        Ok(Self {
            scene_group: bind(0, &scene_group),
            particle_groups: [
                bind(1, &particle_group(particles, &moved)),
                bind(1, &particle_group(&moved, particles)),
            ],
            list_groups: [bind(2, &list_group(old, new)), bind(2, &list_group(new, old))],
            room,
            slots,
            parts,
            moved,
            new_counts,
            new_pairs,
            new_walls,
            scene_of,
            heads,
            scenes,
            poses,
            reports,
            _others: [nearest_points, reference, chain],
        })
    }

    /// Whether it has room for that much, in rows of just these slots.
    pub(super) fn holds(&self, extent: Extent, slots: Slots) -> bool {
        self.has(slots) && self.room.each(extent, u32::max) == self.room
    }

    /// Whether its rows have just these slots.
    pub(super) fn has(&self, slots: Slots) -> bool {
        self.slots == slots
    }

    /// What it takes, in bytes.
    pub(super) fn bytes(&self) -> u64 {
        arena_bytes(&self.room, self.slots)
    }

    /// What it has room for.
    pub(super) fn room(&self) -> Extent {
        self.room
    }

    /// Copies runs in, and what goes along with them.
    fn load(&self, device: &Device, encoder: &mut CommandEncoder, stores: &[&Store], cargo: &Cargo) {
        let write = |buffer: &Buffer, bytes: &[u8]| device.queue.write_buffer(buffer, 0, bytes);
        write(&self.scenes, bytemuck::cast_slice(&cargo.scenes));
        write(&self.scene_of, bytemuck::cast_slice(&cargo.scene_of));
        write(&self.poses, bytemuck::cast_slice(&cargo.poses));
        write(&self.reports, bytemuck::cast_slice(&vec![Report::fresh(); cargo.scenes.len()]));
        for part in Part::ALL {
            let mut at = 0;
            for store in stores {
                let to = &self.parts[part as usize];
                copy(encoder, store.buffer(part), 0, to, at, store.bytes(part));
                at += store.bytes(part);
            }
        }
    }

    /// Carries out steps, rebuilding lists every `interval` of them, and says how each run fared. What comes of it stays
    /// here.
    pub(super) fn advance(
        &self,
        device: &Device,
        pipelines: &Pipelines,
        stores: &[&Store],
        cargo: &Cargo,
        steps: u32,
        interval: u32,
    ) -> Vec<Report> {
        let mut encoder = device.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        self.load(device, &mut encoder, stores, cargo);
        let count = cargo.scene_of.len() as u32;
        let now = |step| Now { step, count, pair_slots: self.slots.pairs, wall_slots: self.slots.walls };
        for first in (0..steps).step_by(interval as usize) {
            encoder.clear_buffer(&self.heads, 0, None);
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
            let lists = (first / interval) as usize % 2;
            pass.set_bind_group(0, &self.scene_group, &[]);
            pass.set_bind_group(1, &self.particle_groups[first as usize % 2], &[]);
            pass.set_bind_group(2, &self.list_groups[lists], &[]);
            pipelines.run(&mut pass, Kernel::CellList, &now(first));
            pipelines.run(&mut pass, Kernel::NeighbourList, &now(first));
            pass.set_bind_group(2, &self.list_groups[1 - lists], &[]);
            for step in first..steps.min(first + interval) {
                pass.set_bind_group(1, &self.particle_groups[step as usize % 2], &[]);
                pipelines.run(&mut pass, Kernel::Step, &now(step));
            }
        }
        device.queue.submit([encoder.finish()]);
        let bytes = device.read(&self.reports, 0, (cargo.scenes.len() * size_of::<Report>()) as u64);
        bytemuck::pod_collect_to_vec(&bytes)
    }

    /// Copies what steps have changed back to the runs.
    pub(super) fn unload(&self, device: &Device, stores: &[&Store], steps: u32, interval: u32) {
        let mut encoder = device.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        let is_turned = steps.div_ceil(interval) % 2 == 1;
        for part in Part::CHANGING {
            let from = match part {
                Part::Particles if steps % 2 == 1 => &self.moved,
                Part::Counts if is_turned => &self.new_counts,
                Part::Pairs if is_turned => &self.new_pairs,
                Part::Walls if is_turned => &self.new_walls,
                _ => &self.parts[part as usize],
            };
            let mut at = 0;
            for store in stores {
                copy(&mut encoder, from, at, store.buffer(part), 0, store.bytes(part));
                at += store.bytes(part);
            }
        }
        device.queue.submit([encoder.finish()]);
    }
}

fn copy(encoder: &mut CommandEncoder, from: &Buffer, at: u64, to: &Buffer, to_at: u64, bytes: u64) {
    if bytes > 0 {
        encoder.copy_buffer_to_buffer(from, at, to, to_at, bytes);
    }
}
