//! Loads on their way from pairs to sub-particles, and what pairs look like before.

use std::ops::Range;

use pulp::cast;

use super::fetch;
use super::instructions::{Job, Wide, by_itself};
use super::kernel::{Contacts, Felt, Seen};
use super::memory::{Ints, Lanes, Lanes3, Quads, WIDTH, octets, quad_of};
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
    /// v_j − v_i and ω_i + ω_j.
    velocity: [[f32; 8]; BATCH],
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

/// What acts on many sub-particles or pairs, one after the other: a force, 0, a torque, 0.
#[derive(Debug, Default)]
pub(super) struct Loads(Vec<[f32; 8]>);

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
            velocity: [[0.0; 8]; BATCH],
            memory: quads,
            root_mass: [0.0; BATCH],
        }
    }
}

impl Batch {
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
        let [velocity, spin] = simd.apart(octets(&self.velocity, half));
        Seen { apart, velocity: three(simd, &velocity), spin: three(simd, &spin) }
    }

    #[inline(always)]
    fn root_mass(&self, half: usize) -> Lanes {
        Lanes(std::array::from_fn(|lane| self.root_mass[half * WIDTH + quad_of(lane)]))
    }

    #[inline(always)]
    fn contacts<S: Wide>(&self, simd: S, half: usize, step: u32) -> Contacts {
        let [mut xi @ .., last] = simd.to_lanes(&Quads::of(&self.memory, half));
        let mut let_go = Lanes::ZERO;
        for k in 0..WIDTH {
            let_go.0[k] = if last.0[k].to_bits() == step - 1 { 0.0 } else { 1.0 };
        }
        let held = simd.at_most(&let_go, 0.0);
        // What has let go has forgotten, also where nobody has looked since.
        let remembers = simd.only(f32::from_bits(u32::MAX), held);
        for axis in &mut xi {
            for k in 0..WIDTH {
                axis.0[k] = f32::from_bits(axis.0[k].to_bits() & remembers.0[k].to_bits());
            }
        }
        Contacts { held, xi }
    }
}

impl Contacts {
    /// What to remember of them: ξ, and the step where the contact holds.
    #[inline(always)]
    pub(super) fn memory<S: Wide>(&self, simd: S, step: u32) -> Quads {
        let [x, y, z] = &self.xi;
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
        self.0.clear();
    }

    pub(super) fn count(&self) -> usize {
        self.0.len()
    }

    /// On so many: what is known of the first of them, and nothing yet on others.
    pub(super) fn begin(&mut self, count: usize, known: &Self) {
        self.0.clear();
        self.0.extend_from_slice(&known.0);
        self.0.resize(count, [0.0; 8]);
    }

    /// Fetches some from memory.
    #[inline(always)]
    pub(super) fn fetch(&self, range: Range<usize>) {
        fetch::later(&self.0[range]);
    }

    /// Takes in [`WIDTH`] more, from lanes.
    #[inline(always)]
    pub(super) fn push<S: Wide>(&mut self, simd: S, felt: &Felt) {
        let ([x, y, z], [p, q, r]) = (&felt.force, &felt.torque);
        let force = simd.to_quads([x, y, z, &Lanes::ZERO]);
        let torque = simd.to_quads([p, q, r, &Lanes::ZERO]);
        self.0.extend_from_slice(&simd.together([&force, &torque]));
    }
}

/// Puts as many of `close` into a batch, which are pairs of two bodies, as there is room for; tells how many.
pub(super) struct Take<'a> {
    pub(super) batch: &'a mut Batch,
    pub(super) close: &'a [u32],
    pub(super) list: &'a PairList,
    /// Distances of all that are listed.
    pub(super) apart: &'a [[i32; 4]],
    pub(super) sides: [&'a Points; 2],
    /// √m* in kg^½.
    pub(super) root_mass: f32,
}

impl Job for Take<'_> {
    type Output = usize;

    #[inline(always)]
    fn run<S: Wide>(self, simd: S) -> usize {
        let Self { batch, close, list, apart, sides: [first, second], root_mass } = self;
        let from = batch.pairs.len();
        let close = &close[..close.len().min(BATCH - from)];
        batch.pairs.extend_from_slice(close);
        batch.root_mass[from..from + close.len()].fill(root_mass);
        let looks = batch.apart[from..].iter_mut();
        let looks = looks.zip(&mut batch.memory[from..]);
        let looks = looks.zip(&mut batch.velocity[from..]);
        let (places, memories) = (&list.places[..apart.len()], &list.memory[..apart.len()]);
        for (&pair, ((between, memory), velocity)) in close.iter().zip(looks) {
            let pair = pair as usize;
            *between = apart[pair].map(|d| f32::from_bits(d as u32));
            *memory = memories[pair];
            let [i, j] = places[pair];
            let (mine, theirs) = (&first.velocities[i as usize], &second.velocities[j as usize]);
            *velocity = simd.difference_and_sum(theirs, mine);
        }
        close.len()
    }
}

/// Adds what pairs of a body with itself do to both of their two.
pub(super) struct AddWithin<'a> {
    pub(super) sums: &'a mut Loads,
    pub(super) loads: &'a PairLoads,
}

impl Job for AddWithin<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Wide>(self, simd: S) {
        let Self { sums: Loads(sums), loads: PairLoads { loads, places } } = self;
        for (&[i, j], load) in places.iter().zip(&loads.0) {
            let (i, j) = (i as usize, j as usize);
            sums[i] = simd.sum(&sums[i], load);
            sums[j] = simd.difference_and_sum(&sums[j], load);
        }
    }
}

/// Adds what some pairs do to one of their two: to the firsts, or else to the seconds.
struct AddPairs<'a, const SIDE: usize> {
    sums: &'a mut Loads,
    loads: &'a PairLoads,
    pairs: Range<usize>,
}

impl<const SIDE: usize> Job for AddPairs<'_, SIDE> {
    type Output = ();

    #[inline(always)]
    fn run<S: Wide>(self, simd: S) {
        let Self { sums: Loads(sums), loads: PairLoads { loads, places }, pairs } = self;
        for (place, load) in places[pairs.clone()].iter().zip(&loads.0[pairs]) {
            let sum = &mut sums[place[SIDE] as usize];
            *sum = if SIDE == 0 { simd.sum(sum, load) } else { simd.difference_and_sum(sum, load) };
        }
    }
}

impl Sums {
    /// What is known, for so many blocks, and nothing else yet.
    pub(super) fn begin(&mut self, blocks: usize, known: &Loads) {
        self.single.begin(blocks * WIDTH, known);
        self.blocks.clear();
        self.blocks.resize(blocks, LoadBlock { force: [Lanes::ZERO; 3], torque: [Lanes::ZERO; 3] });
    }

    /// Adds what acts on the firsts of all pairs.
    #[inline(always)]
    pub(super) fn add_to_firsts<S: Wide>(&mut self, simd: S, loads: &PairLoads) {
        let pairs = 0..loads.places.len();
        by_itself(simd, AddPairs::<0> { sums: &mut self.single, loads, pairs });
    }

    /// Adds what acts on the seconds of some pairs.
    #[inline(always)]
    pub(super) fn add_to_seconds<S: Wide>(&mut self, simd: S, loads: &PairLoads, pairs: Range<usize>) {
        by_itself(simd, AddPairs::<1> { sums: &mut self.single, loads, pairs });
    }

    /// Adds what acts on the sub-particle at a place.
    #[inline(always)]
    pub(super) fn add(&mut self, place: u32, load: &Load) {
        let [x, y, z] = load.force.to_array();
        let [p, q, r] = load.torque.to_array();
        for (sum, load) in self.single.0[place as usize].iter_mut().zip([x, y, z, 0.0, p, q, r, 0.0]) {
            *sum += load;
        }
    }

    /// All that acts on a block.
    #[inline(always)]
    pub(super) fn of_block<S: Wide>(&self, simd: S, b: usize) -> LoadBlock {
        let mut all = self.blocks[b];
        let [forces, torques] = simd.apart(octets(&self.single.0, b));
        let (force, torque) = (simd.to_lanes(&forces), simd.to_lanes(&torques));
        for axis in 0..3 {
            for k in 0..WIDTH {
                all.force[axis].0[k] += force[axis].0[k];
                all.torque[axis].0[k] += torque[axis].0[k];
            }
        }
        all
    }
}
