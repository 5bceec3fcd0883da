//! The buffers of one run on the device: what lasts from chunk to chunk. Nothing in them depends on where the run stands
//! in a batch.

use bytemuck::{Pod, pod_collect_to_vec};

use super::device::Device;
use super::layout::{Corner, Count, Facet, Node, Own, Pair, Particle, Surface, WallPair};
use super::memory::{Buffer, buffers};
use super::neighbour_list::{Rows, Slots};
use super::walls::Geometry;
use crate::engine::OutOfDeviceMemory;

/// A buffer of a run; batches have the same, with those of all runs one behind the other.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Part {
    Particles,
    Own,
    Counts,
    Pairs,
    Walls,
    Surfaces,
    Facets,
    Corners,
    Nodes,
    Leaves,
}

impl Part {
    pub(super) const ALL: [Self; 10] = [
        Self::Particles,
        Self::Own,
        Self::Counts,
        Self::Pairs,
        Self::Walls,
        Self::Surfaces,
        Self::Facets,
        Self::Corners,
        Self::Nodes,
        Self::Leaves,
    ];

    fn name(self) -> &'static str {
        match self {
            Self::Particles => "particles",
            Self::Own => "own",
            Self::Counts => "counts",
            Self::Pairs => "pairs",
            Self::Walls => "walls",
            Self::Surfaces => "surfaces",
            Self::Facets => "facets",
            Self::Corners => "corners",
            Self::Nodes => "nodes",
            Self::Leaves => "leaves",
        }
    }

    /// Those that steps change.
    pub(super) const CHANGING: [Self; 5] =
        [Self::Particles, Self::Own, Self::Counts, Self::Pairs, Self::Walls];
}

/// How much there is of everything: in a run, or in all of a batch.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Extent {
    pub(super) scenes: u32,
    pub(super) particles: u32,
    pub(super) surfaces: u32,
    pub(super) facets: u32,
    pub(super) corners: u32,
    pub(super) nodes: u32,
    pub(super) leaves: u32,
    /// Cells of grids.
    pub(super) cells: u32,
    /// Poses for a chunk.
    pub(super) poses: u32,
}

impl Extent {
    /// Each number of the two.
    pub(super) fn each(self, other: Self, of: impl Fn(u32, u32) -> u32) -> Self {
        Self {
            scenes: of(self.scenes, other.scenes),
            particles: of(self.particles, other.particles),
            surfaces: of(self.surfaces, other.surfaces),
            facets: of(self.facets, other.facets),
            corners: of(self.corners, other.corners),
            nodes: of(self.nodes, other.nodes),
            leaves: of(self.leaves, other.leaves),
            cells: of(self.cells, other.cells),
            poses: of(self.poses, other.poses),
        }
    }

    /// The size of a part, in bytes.
    pub(super) fn bytes(&self, part: Part, slots: Slots) -> u64 {
        let bytes = |count: u32, each: usize| u64::from(count) * each as u64;
        match part {
            Part::Particles => bytes(self.particles, size_of::<Particle>()),
            Part::Own => bytes(self.particles, size_of::<Own>()),
            Part::Counts => bytes(self.particles, size_of::<Count>()),
            Part::Pairs => bytes(self.particles, size_of::<Pair>()) * u64::from(slots.pairs),
            Part::Walls => bytes(self.particles, size_of::<WallPair>()) * u64::from(slots.walls),
            Part::Surfaces => bytes(self.surfaces, size_of::<Surface>()),
            Part::Facets => bytes(self.facets, size_of::<Facet>()),
            Part::Corners => bytes(self.corners, size_of::<Corner>()),
            Part::Nodes => bytes(self.nodes, size_of::<Node>()),
            Part::Leaves => bytes(self.leaves, size_of::<u32>()),
        }
    }

    /// The buffers of a run, or of all of a batch.
    pub(super) fn sizes(&self, slots: Slots) -> [(&'static str, u64); Part::ALL.len()] {
        Part::ALL.map(|part| (part.name(), self.bytes(part, slots)))
    }
}

/// What the buffers of a new run will hold.
#[derive(Debug)]
pub(super) struct Draft {
    pub(super) extent: Extent,
    pub(super) geometry: Geometry,
    pub(super) rows: Rows,
}

/// The buffers of a run.
#[derive(Debug)]
pub(super) struct Store {
    pub(super) extent: Extent,
    pub(super) slots: Slots,
    buffers: [Buffer; Part::ALL.len()],
}

impl Store {
    /// Makes them, or says why the device will not.
    pub(super) fn new(device: &Device, draft: &Draft) -> Result<Self, OutOfDeviceMemory> {
        let Draft { extent, geometry, rows } = draft;
        let buffers = buffers(device, extent.sizes(rows.slots))?;
        let mut store = Self { extent: *extent, slots: rows.slots, buffers };
        store.write_geometry(device, geometry);
        store.write_rows(device, rows);
        Ok(store)
    }

    pub(super) fn buffer(&self, part: Part) -> &Buffer {
        &self.buffers[part as usize]
    }

    pub(super) fn bytes(&self, part: Part) -> u64 {
        self.extent.bytes(part, self.slots)
    }

    pub(super) fn write<T: Pod>(&self, device: &Device, part: Part, values: &[T]) {
        device.queue.write_buffer(self.buffer(part), 0, bytemuck::cast_slice(values));
    }

    /// Reads parts, as bytes.
    pub(super) fn read<const N: usize>(&self, device: &Device, parts: [Part; N]) -> [Vec<u8>; N] {
        device.read_all(parts.map(|part| (&**self.buffer(part), 0, self.bytes(part))))
    }

    pub(super) fn write_geometry(&self, device: &Device, geometry: &Geometry) {
        self.write(device, Part::Surfaces, &geometry.surfaces);
        self.write(device, Part::Facets, &geometry.facets);
        self.write(device, Part::Corners, &geometry.corners);
        self.write(device, Part::Nodes, &geometry.nodes);
        self.write(device, Part::Leaves, &geometry.leaves);
    }

    /// Takes rows in, which its buffers must hold.
    pub(super) fn write_rows(&mut self, device: &Device, rows: &Rows) {
        self.extent.particles = rows.counts.len() as u32;
        self.slots = rows.slots;
        self.write(device, Part::Counts, &rows.counts);
        self.write(device, Part::Pairs, &rows.pairs);
        self.write(device, Part::Walls, &rows.walls);
    }

    pub(super) fn read_rows(&self, device: &Device) -> Rows {
        let [counts, pairs, walls] = self.read(device, [Part::Counts, Part::Pairs, Part::Walls]);
        Rows {
            slots: self.slots,
            counts: pod_collect_to_vec(&counts),
            pairs: pod_collect_to_vec(&pairs),
            walls: pod_collect_to_vec(&walls),
        }
    }

    /// Lengthens its rows to these slots, unless they have them. It stays as it was where the device has no room.
    pub(super) fn lengthen(&mut self, device: &Device, slots: Slots) -> Result<(), OutOfDeviceMemory> {
        if self.slots == slots {
            return Ok(());
        }
        let longer = |part: Part| {
            let bytes = self.extent.bytes(part, slots);
            let make = || buffers(device, [(part.name(), bytes)]);
            (bytes > self.buffer(part).size()).then(make).transpose()
        };
        let longer = [(Part::Pairs, longer(Part::Pairs)?), (Part::Walls, longer(Part::Walls)?)];
        let rows = self.read_rows(device).with(slots);
        for (part, longer) in longer {
            if let Some([longer]) = longer {
                self.buffers[part as usize] = longer;
            }
        }
        self.write_rows(device, &rows);
        Ok(())
    }
}
