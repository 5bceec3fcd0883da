//! Loads on their way from pairs to sub-particles, and what pairs look like before.

use std::ops::Range;

use pulp::cast;

use super::fetch;
use super::instructions::Wide;
use super::kernel::{Contacts, Felt, Seen};
use super::memory::{Ints, Lanes, Lanes3, Quads, WIDTH, quad_of};
use super::pairs::{PairList, PairLoads};
use super::points::Points;
use crate::cpu::forces::Load;
use crate::engine::frame::Frame;

/// Pairs that go through the kernel together: two chunks, of whatever meetings, in order.
pub(super) const BATCH: usize = 2 * WIDTH;

/// Those pairs, one after the other.
#[derive(Debug)]
pub(super) struct Batch {
    /// Their numbers in the list.
    pub(super) pairs: Vec<u32>,
    /// x_j − x_i, in units of length, as bits.
    apart: [[f32; 4]; BATCH],
    /// v_j − v_i.
    velocity: [[f32; 4]; BATCH],
    /// ω_i + ω_j.
    spin: [[f32; 4]; BATCH],
    memory: [[f32; 4]; BATCH],
    /// √m* in kg^½.
    root_mass: [f32; BATCH],
}

/// The same in lanes.
#[derive(Debug)]
pub(super) struct BatchLanes {
    pub(super) counts: [usize; 2],
    pub(super) seen: [Seen; 2],
    pub(super) root_mass: [Lanes; 2],
    pub(super) memory: [Contacts; 2],
}

/// What acts on many sub-particles or pairs: force and torque, one after the other, with a 0 at the end of each.
#[derive(Debug, Default)]
pub(super) struct Loads {
    force: Vec<[f32; 4]>,
    torque: Vec<[f32; 4]>,
}

/// Loads of a block of sub-particles.
#[derive(Clone, Copy, Debug)]
pub(super) struct LoadBlock {
    pub(super) force: Lanes3,
    pub(super) torque: Lanes3,
}

/// Sums of the loads of a body's sub-particles.
#[derive(Debug, Default)]
pub(super) struct Sums {
    /// What comes one at a time, by [`super::points::place_of`].
    single: Loads,
    /// What comes in blocks.
    pub(super) blocks: Vec<LoadBlock>,
}

impl Default for Batch {
    fn default() -> Self {
        let quads = [[0.0; 4]; BATCH];
        Self {
            pairs: Vec::with_capacity(BATCH),
            apart: quads,
            velocity: quads,
            spin: quads,
            memory: quads,
            root_mass: [0.0; BATCH],
        }
    }
}

impl Batch {
    /// Takes in as many of `close`, which are pairs of these two, as there is room for; returns how many.
    // By itself the compiler would make one function of this and the kernels, which have no register to spare.
    #[inline(never)]
    pub(super) fn take(
        &mut self,
        close: &[u32],
        list: &PairList,
        apart: &[[i32; 4]],
        [first, second]: [&Points; 2],
        root_mass: f32,
    ) -> usize {
        let from = self.pairs.len();
        let close = &close[..close.len().min(BATCH - from)];
        self.pairs.extend_from_slice(close);
        self.root_mass[from..from + close.len()].fill(root_mass);
        let looks = self.apart[from..].iter_mut();
        let looks = looks.zip(&mut self.memory[from..]);
        let looks = looks.zip(&mut self.velocity[from..]);
        let looks = looks.zip(&mut self.spin[from..]);
        let (places, memories) = (&list.places[..apart.len()], &list.memory[..apart.len()]);
        for (&pair, (((between, memory), velocity), spin)) in close.iter().zip(looks) {
            let pair = pair as usize;
            *between = apart[pair].map(|d| f32::from_bits(d as u32));
            *memory = memories[pair];
            let [i, j] = places[pair];
            let (v, v_j) = (&first.velocities[i as usize], &second.velocities[j as usize]);
            let (w, w_j) = (&first.spins[i as usize], &second.spins[j as usize]);
            *velocity = std::array::from_fn(|c| v_j[c] - v[c]);
            *spin = std::array::from_fn(|c| w[c] + w_j[c]);
        }
        close.len()
    }

    /// All of them in lanes. Where there is no pair stands what was there before.
    #[inline(always)]
    pub(super) fn lanes<S: Wide>(&self, simd: S, frame: &Frame, step: u32) -> BatchLanes {
        let count = self.pairs.len();
        BatchLanes {
            counts: [count.min(WIDTH), count.saturating_sub(WIDTH)],
            seen: [self.seen(simd, 0, frame), self.seen(simd, 1, frame)],
            root_mass: [self.root_mass(0), self.root_mass(1)],
            memory: [self.contacts(simd, 0, step), self.contacts(simd, 1, step)],
        }
    }

    #[inline(always)]
    fn seen<S: Wide>(&self, simd: S, half: usize, frame: &Frame) -> Seen {
        let mut apart = three(simd, &Quads::of(&self.apart, half));
        for axis in &mut apart {
            for k in 0..WIDTH {
                axis.0[k] = axis.0[k].to_bits() as i32 as f32 * frame.unit_m;
            }
        }
        let (velocity, spin) =
            (three(simd, &Quads::of(&self.velocity, half)), three(simd, &Quads::of(&self.spin, half)));
        Seen { apart, velocity, spin }
    }

    #[inline(always)]
    fn root_mass(&self, half: usize) -> Lanes {
        Lanes(std::array::from_fn(|lane| self.root_mass[half * WIDTH + quad_of(lane)]))
    }

    #[inline(always)]
    fn contacts<S: Wide>(&self, simd: S, half: usize, step: u32) -> Contacts {
        let [mut slide @ .., last] = simd.to_lanes(&Quads::of(&self.memory, half));
        let mut let_go = Lanes::ZERO;
        for k in 0..WIDTH {
            let_go.0[k] = if last.0[k].to_bits() == step - 1 { 0.0 } else { 1.0 };
        }
        let held = simd.at_most(&let_go, 0.0);
        // What has let go has forgotten, also where nobody has looked since.
        let remembers = simd.only(f32::from_bits(u32::MAX), held);
        for axis in &mut slide {
            for k in 0..WIDTH {
                axis.0[k] = f32::from_bits(axis.0[k].to_bits() & remembers.0[k].to_bits());
            }
        }
        Contacts { held, slide }
    }
}

impl Contacts {
    /// What to remember of them: ξ, and the step where the contact holds.
    #[inline(always)]
    pub(super) fn memory<S: Wide>(&self, simd: S, step: u32) -> Quads {
        let [x, y, z] = &self.slide;
        simd.to_quads([x, y, z, &simd.only(f32::from_bits(step), self.held)])
    }
}

/// The first three numbers, in lanes.
#[inline(always)]
pub(super) fn three<S: Wide>(simd: S, quads: &Quads) -> Lanes3 {
    let [x, y, z, _] = simd.to_lanes(quads);
    [x, y, z]
}

/// Bits of whole numbers, in lanes.
#[inline(always)]
pub(super) fn ints<S: Wide>(simd: S, quads: &Quads) -> [Ints; 4] {
    let [x, y, z, r] = simd.to_lanes(quads);
    [Ints(cast(x.0)), Ints(cast(y.0)), Ints(cast(z.0)), Ints(cast(r.0))]
}

impl Loads {
    pub(super) fn clear(&mut self) {
        self.force.clear();
        self.torque.clear();
    }

    /// Fetches some from memory.
    #[inline(always)]
    pub(super) fn fetch(&self, range: Range<usize>) {
        fetch::later(&self.force[range.clone()]);
        fetch::later(&self.torque[range]);
    }

    /// Takes in [`WIDTH`] more, from lanes.
    #[inline(always)]
    pub(super) fn push<S: Wide>(&mut self, simd: S, felt: &Felt) {
        let ([x, y, z], [p, q, r]) = (&felt.force, &felt.torque);
        self.force.extend_from_slice(&simd.to_quads([x, y, z, &Lanes::ZERO]).0);
        self.torque.extend_from_slice(&simd.to_quads([p, q, r, &Lanes::ZERO]).0);
    }

    /// Adds what some pairs do to one of their two: what acts on the firsts, or else what acts on the seconds.
    #[inline(always)]
    fn add_pairs<const SIDE: usize>(&mut self, PairLoads { loads, places }: &PairLoads, pairs: Range<usize>) {
        let Self { force, torque } = self;
        let torque = &mut torque[..force.len()];
        let places = &places[pairs.clone()];
        let loads = loads.force[pairs.clone()].iter().zip(&loads.torque[pairs]);
        for (place, (f, t)) in places.iter().zip(loads) {
            let place = place[SIDE] as usize;
            force[place] = sum(force[place], if SIDE == 0 { *f } else { f.map(|x| -x) });
            torque[place] = sum(torque[place], *t);
        }
    }
}

#[inline(always)]
fn sum(a: [f32; 4], b: [f32; 4]) -> [f32; 4] {
    std::array::from_fn(|c| a[c] + b[c])
}

impl Sums {
    /// Nothing yet, for so many blocks.
    pub(super) fn begin(&mut self, blocks: usize) {
        let Loads { force, torque } = &mut self.single;
        for single in [force, torque] {
            single.clear();
            single.resize(blocks * WIDTH, [0.0; 4]);
        }
        self.blocks.clear();
        self.blocks.resize(blocks, LoadBlock { force: [Lanes::ZERO; 3], torque: [Lanes::ZERO; 3] });
    }

    /// Adds what acts on the firsts of all pairs.
    #[inline(never)]
    pub(super) fn add_to_firsts(&mut self, loads: &PairLoads) {
        self.single.add_pairs::<0>(loads, 0..loads.places.len());
    }

    /// Adds what acts on the seconds of some pairs.
    #[inline(never)]
    pub(super) fn add_to_seconds(&mut self, loads: &PairLoads, pairs: Range<usize>) {
        self.single.add_pairs::<1>(loads, pairs);
    }

    /// Adds what acts on the sub-particle at a place.
    #[inline(always)]
    pub(super) fn add(&mut self, place: u32, load: &Load) {
        let [x, y, z] = load.force.to_array();
        let [p, q, r] = load.torque.to_array();
        let (force, torque) = (&mut self.single.force, &mut self.single.torque);
        force[place as usize] = sum(force[place as usize], [x, y, z, 0.0]);
        torque[place as usize] = sum(torque[place as usize], [p, q, r, 0.0]);
    }

    /// All that acts on a block.
    #[inline(always)]
    pub(super) fn of_block<S: Wide>(&self, simd: S, b: usize) -> LoadBlock {
        let (single, mut all) = (&self.single, self.blocks[b]);
        let force = simd.to_lanes(&Quads::of(&single.force, b));
        let torque = simd.to_lanes(&Quads::of(&single.torque, b));
        for axis in 0..3 {
            for k in 0..WIDTH {
                all.force[axis].0[k] += force[axis].0[k];
                all.torque[axis].0[k] += torque[axis].0[k];
            }
        }
        all
    }
}
