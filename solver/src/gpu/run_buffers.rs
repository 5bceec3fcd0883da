//! The buffers of one run on the device, which persist from chunk to chunk. Their content does not depend on
//! the position of the run in a batch.

use bytemuck::{Pod, pod_collect_to_vec};

use super::device::Device;
use super::layout::{Corner, Count, Facet, Moment, Node, Pair, Particle, PrivateState, Surface, WallPair};
use super::memory_budget::{Buffer, buffers};
use super::neighbour_list::{RowCapacity, Rows};
use super::walls::Geometry;
use crate::engine::OutOfDeviceMemory;

/// A buffer of a run. Batches have the same buffers, with all runs one behind the other.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum RunBuffer {
    Particles,
    PrivateState,
    Counts,
    Pairs,
    Walls,
    Moments,
    Surfaces,
    Facets,
    Corners,
    Nodes,
    Leaves,
}

impl RunBuffer {
    pub(super) const ALL: [Self; 11] = [
        Self::Particles,
        Self::PrivateState,
        Self::Counts,
        Self::Pairs,
        Self::Walls,
        Self::Moments,
        Self::Surfaces,
        Self::Facets,
        Self::Corners,
        Self::Nodes,
        Self::Leaves,
    ];

    fn name(self) -> &'static str {
        match self {
            Self::Particles => "particles",
            Self::PrivateState => "private state",
            Self::Counts => "counts",
            Self::Pairs => "pairs",
            Self::Walls => "walls",
            Self::Moments => "moments",
            Self::Surfaces => "surfaces",
            Self::Facets => "facets",
            Self::Corners => "corners",
            Self::Nodes => "nodes",
            Self::Leaves => "leaves",
        }
    }

    /// Buffers that observers read, in the order in which they are read back.
    pub(super) const OBSERVED: [Self; 4] = [Self::Particles, Self::PrivateState, Self::Counts, Self::Walls];

    /// Buffers that steps change.
    pub(super) const CHANGING: [Self; 6] =
        [Self::Particles, Self::PrivateState, Self::Counts, Self::Pairs, Self::Walls, Self::Moments];
}

/// Element counts of all buffers, of a run or of a batch.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct ElementCounts {
    pub(super) scenes: u32,
    pub(super) particles: u32,
    /// Sub-particles whose bonds carry moments.
    pub(super) moments: u32,
    pub(super) surfaces: u32,
    pub(super) facets: u32,
    pub(super) corners: u32,
    pub(super) nodes: u32,
    pub(super) leaves: u32,
    /// Cells of cell lists.
    pub(super) cells: u32,
    /// Poses for a chunk.
    pub(super) poses: u32,
}

impl ElementCounts {
    /// Combines the counts of both.
    pub(super) fn each(self, other: Self, of: impl Fn(u32, u32) -> u32) -> Self {
        Self {
            scenes: of(self.scenes, other.scenes),
            particles: of(self.particles, other.particles),
            moments: of(self.moments, other.moments),
            surfaces: of(self.surfaces, other.surfaces),
            facets: of(self.facets, other.facets),
            corners: of(self.corners, other.corners),
            nodes: of(self.nodes, other.nodes),
            leaves: of(self.leaves, other.leaves),
            cells: of(self.cells, other.cells),
            poses: of(self.poses, other.poses),
        }
    }

    /// The same counts for other rows.
    fn with_rows(self, rows: &Rows) -> Self {
        let particles = rows.counts.len() as u32;
        Self { particles, moments: if rows.moments.is_empty() { 0 } else { particles }, ..self }
    }

    /// Size of a buffer, in bytes.
    pub(super) fn bytes(&self, part: RunBuffer, row_capacity: RowCapacity) -> u64 {
        let bytes = |count: u32, each: usize| u64::from(count) * each as u64;
        match part {
            RunBuffer::Particles => bytes(self.particles, size_of::<Particle>()),
            RunBuffer::PrivateState => bytes(self.particles, size_of::<PrivateState>()),
            RunBuffer::Counts => bytes(self.particles, size_of::<Count>()),
            RunBuffer::Pairs => bytes(self.particles, size_of::<Pair>()) * u64::from(row_capacity.pairs),
            RunBuffer::Walls => bytes(self.particles, size_of::<WallPair>()) * u64::from(row_capacity.walls),
            RunBuffer::Moments => bytes(self.moments, size_of::<Moment>()) * u64::from(row_capacity.pairs),
            RunBuffer::Surfaces => bytes(self.surfaces, size_of::<Surface>()),
            RunBuffer::Facets => bytes(self.facets, size_of::<Facet>()),
            RunBuffer::Corners => bytes(self.corners, size_of::<Corner>()),
            RunBuffer::Nodes => bytes(self.nodes, size_of::<Node>()),
            RunBuffer::Leaves => bytes(self.leaves, size_of::<u32>()),
        }
    }

    /// Names and sizes of all buffers, in bytes.
    pub(super) fn sizes(&self, row_capacity: RowCapacity) -> [(&'static str, u64); RunBuffer::ALL.len()] {
        RunBuffer::ALL.map(|part| (part.name(), self.bytes(part, row_capacity)))
    }
}

/// Initial content of the buffers of a run.
#[derive(Debug)]
pub(super) struct RunContents {
    pub(super) elements: ElementCounts,
    pub(super) geometry: Geometry,
    pub(super) rows: Rows,
}

/// The buffers of a run.
#[derive(Debug)]
pub(super) struct RunBuffers {
    pub(super) elements: ElementCounts,
    pub(super) row_capacity: RowCapacity,
    buffers: [Buffer; RunBuffer::ALL.len()],
}

impl RunBuffers {
    /// Creates and fills the buffers.
    pub(super) fn new(device: &Device, contents: &RunContents) -> Result<Self, OutOfDeviceMemory> {
        let RunContents { elements, geometry, rows } = contents;
        let buffers = buffers(device, elements.sizes(rows.row_capacity))?;
        let mut buffers = Self { elements: *elements, row_capacity: rows.row_capacity, buffers };
        buffers.write_geometry(device, geometry);
        buffers.write_rows(device, rows);
        Ok(buffers)
    }

    pub(super) fn buffer(&self, part: RunBuffer) -> &Buffer {
        &self.buffers[part as usize]
    }

    pub(super) fn bytes(&self, part: RunBuffer) -> u64 {
        self.elements.bytes(part, self.row_capacity)
    }

    /// Position of a buffer among those that observers read, in bytes; none for other buffers.
    pub(super) fn observed_at(&self, part: RunBuffer) -> Option<u64> {
        let before = RunBuffer::OBSERVED.iter().position(|&observed| observed == part)?;
        Some(RunBuffer::OBSERVED[..before].iter().map(|&part| self.bytes(part)).sum())
    }

    /// Size of the buffers that observers read, in bytes.
    pub(super) fn observed_bytes(&self) -> u64 {
        RunBuffer::OBSERVED.map(|part| self.bytes(part)).iter().sum()
    }

    /// Counts only this many sub-particles from now on.
    pub(super) fn keep(&mut self, particles: u32) {
        let moments = if self.elements.moments > 0 { particles } else { 0 };
        self.elements = ElementCounts { particles, moments, ..self.elements };
    }

    pub(super) fn write<T: Pod>(&self, device: &Device, part: RunBuffer, values: &[T]) {
        device.queue.write_buffer(self.buffer(part), 0, bytemuck::cast_slice(values));
    }

    /// Sends what observers read to a buffer.
    pub(super) fn read_back(&self, device: &Device, staging: &wgpu::Buffer) -> wgpu::SubmissionIndex {
        let mut encoder = device.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        for part in RunBuffer::OBSERVED {
            let (at, bytes) = (self.observed_at(part).unwrap_or(0), self.bytes(part));
            if bytes > 0 {
                encoder.copy_buffer_to_buffer(self.buffer(part), 0, staging, at, bytes);
            }
        }
        device.queue.submit([encoder.finish()])
    }

    /// Reads buffers, as bytes.
    pub(super) fn read<const N: usize>(&self, device: &Device, parts: [RunBuffer; N]) -> [Vec<u8>; N] {
        device.read_all(parts.map(|part| (&**self.buffer(part), 0, self.bytes(part))))
    }

    pub(super) fn write_geometry(&self, device: &Device, geometry: &Geometry) {
        self.write(device, RunBuffer::Surfaces, &geometry.surfaces);
        self.write(device, RunBuffer::Facets, &geometry.facets);
        self.write(device, RunBuffer::Corners, &geometry.corners);
        self.write(device, RunBuffer::Nodes, &geometry.nodes);
        self.write(device, RunBuffer::Leaves, &geometry.leaves);
    }

    /// Writes rows, which must fit.
    pub(super) fn write_rows(&mut self, device: &Device, rows: &Rows) {
        self.elements = self.elements.with_rows(rows);
        self.row_capacity = rows.row_capacity;
        self.write(device, RunBuffer::Counts, &rows.counts);
        let RowCapacity { pairs, walls } = rows.row_capacity;
        self.write(device, RunBuffer::Pairs, &transposed(&rows.pairs, pairs));
        self.write(device, RunBuffer::Moments, &transposed(&rows.moments, pairs));
        self.write(device, RunBuffer::Walls, &transposed(&rows.walls, walls));
    }

    /// Makes room for rows of more sub-particles. The content of all buffers that steps change is lost.
    pub(super) fn make_room(&mut self, device: &Device, rows: &Rows) -> Result<(), OutOfDeviceMemory> {
        let elements = self.elements.with_rows(rows);
        for part in RunBuffer::CHANGING {
            let bytes = elements.bytes(part, rows.row_capacity);
            if bytes > self.buffer(part).size() {
                // Half as much again: bodies that are fed enter a few at a time.
                let [larger] = buffers(device, [(part.name(), bytes + bytes / 2)])?;
                self.buffers[part as usize] = larger;
            }
        }
        Ok(())
    }

    pub(super) fn read_rows(&self, device: &Device) -> Rows {
        let parts = [RunBuffer::Counts, RunBuffer::Pairs, RunBuffer::Moments, RunBuffer::Walls];
        let [counts, pairs, moments, walls] = self.read(device, parts);
        let count = self.elements.particles;
        Rows {
            row_capacity: self.row_capacity,
            counts: pod_collect_to_vec(&counts),
            pairs: transposed(&pod_collect_to_vec(&pairs), count),
            moments: transposed(&pod_collect_to_vec(&moments), count),
            walls: transposed(&pod_collect_to_vec(&walls), count),
        }
    }

    /// Lengthens its rows to this capacity. Unchanged if the device has too little memory.
    pub(super) fn lengthen(
        &mut self,
        device: &Device,
        row_capacity: RowCapacity,
    ) -> Result<(), OutOfDeviceMemory> {
        if self.row_capacity == row_capacity {
            return Ok(());
        }
        let longer = |part: RunBuffer| {
            let bytes = self.elements.bytes(part, row_capacity);
            let make = || buffers(device, [(part.name(), bytes)]);
            (bytes > self.buffer(part).size()).then(make).transpose()
        };
        let lists = [RunBuffer::Pairs, RunBuffer::Moments, RunBuffer::Walls];
        let longer: Vec<_> = lists
            .map(|part| longer(part).map(|longer| (part, longer)))
            .into_iter()
            .collect::<Result<_, _>>()?;
        let mut encoder = device.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        for (part, longer) in longer {
            if let Some([longer]) = longer {
                // Longer rows begin with the columns of shorter ones.
                encoder.copy_buffer_to_buffer(self.buffer(part), 0, &longer, 0, self.bytes(part));
                self.buffers[part as usize] = longer;
            }
        }
        self.row_capacity = row_capacity;
        device.queue.submit([encoder.finish()]);
        // The memory of the shorter rows is free from here on.
        device.wait();
        Ok(())
    }
}

/// Rows of this width as columns, one behind the other. The device has columns: see `kernels/bindings.wgsl`.
fn transposed<T: Copy>(rows: &[T], width: u32) -> Vec<T> {
    let width = width as usize;
    (0..width).flat_map(|column| rows.iter().skip(column).step_by(width)).copied().collect()
}
