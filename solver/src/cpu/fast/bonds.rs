//! The bonds of a body: up to [`WIDTH`] of one block of sub-particles, to others of at most two blocks, side by side.
//! So neighbours are moved into their lanes within registers, and not fetched one by one. A pair whose bond breaks stays here,
//! as a contact.

use super::instructions::LaneOps;
use super::kernel::{self, BondHistoryMut, ContactHistoryMut, PairKinematics, PairLoads};
use super::laws::PairLaws;
use super::load::LoadSums;
use super::memory::{Lanes, Lanes3, PackedIndices, WIDTH};
use super::points::ParticleBlock;
use crate::engine::frame::Frame;
use crate::shape::lattice::LatticeBond;

/// BondHistoryMut of one class, at most one of each sub-particle of a block to a later one, and at most one to each of as_range.
#[derive(Clone, Debug)]
pub(super) struct BondSet {
    /// The block of the lower sub-particles.
    block: u32,
    /// The blocks of the higher ones.
    window: [u32; 2],
    /// Where in the window they stand; as_range under [`WIDTH`] are in its first block.
    at: [u8; WIDTH],
    /// For each place of the window, the lane that it is bonded to, and whether there is one.
    back: [PackedIndices; 2],
    bonded: [u16; 2],
    /// What it remembers: see [`BondHistoryMut`] and [`ContactHistoryMut`].
    rest: f32,
    exists: u16,
    intact: u16,
    stored: Lanes3,
    in_contact: u16,
    xi: Lanes3,
}

// All that comes from memory for a set: what is not stored forces and slides fills one line.
const _: () = assert!(size_of::<BondSet>() == 448);

impl BondSet {
    fn new(block: u32, beyond: u32, rest: f32) -> Self {
        Self {
            block,
            window: [beyond; 2],
            at: [0; WIDTH],
            back: [PackedIndices::default(); 2],
            bonded: [0; 2],
            rest,
            exists: 0,
            intact: 0,
            stored: [Lanes::ZERO; 3],
            in_contact: 0,
            xi: [Lanes::ZERO; 3],
        }
    }

    /// The lane that a bond could take here, and its place in the window.
    fn free_lane(&self, [i, j]: [u32; 2], rest: f32) -> Option<(usize, u32)> {
        let width = WIDTH as u32;
        let [low, high] = self.window;
        let half = match j / width {
            beyond if beyond == low => 0,
            beyond if beyond == high || high == low => 1,
            _ => return None,
        };
        let lane = (i % width) as usize;
        let free = self.block == i / width
            && self.rest == rest
            && self.exists >> lane & 1 == 0
            && self.bonded[half] >> (j % width) & 1 == 0;
        free.then_some((lane, half as u32 * width + j % width))
    }

    fn put(&mut self, lane: usize, place: u32, j: u32) {
        let (half, at) = (place as usize / WIDTH, place as usize % WIDTH);
        self.window[half] = j / WIDTH as u32;
        self.at[lane] = place as u8;
        self.back[half].put(at, lane as u32);
        self.bonded[half] |= 1 << at;
        self.exists |= 1 << lane;
    }

    /// Where a bond goes among the sets, which grow where it has no room.
    fn find(sets: &mut Vec<Self>, pair: [u32; 2], rest: f32) -> (&mut Self, usize) {
        let [i, j] = pair;
        let found = sets.iter().enumerate().rev().find_map(|(s, set)| Some((s, set.free_lane(pair, rest)?)));
        let (s, (lane, place)) = found.unwrap_or_else(|| {
            sets.push(Self::new(i / WIDTH as u32, j / WIDTH as u32, rest));
            let place = sets[sets.len() - 1].free_lane(pair, rest);
            (sets.len() - 1, place.expect("it was made for it"))
        });
        sets[s].put(lane, place, j);
        (&mut sets[s], lane)
    }

    /// The bonds of a body.
    pub(super) fn all(bonds: &[LatticeBond], laws: &PairLaws) -> Vec<Self> {
        let mut sorted: Vec<&LatticeBond> = bonds.iter().collect();
        // Those of one direction on the lattice are as far apart in number, or nearly: they go together.
        sorted.sort_by_key(|bond| (bond.i / WIDTH as u32, bond.class, bond.j - bond.i, bond.i));
        let mut sets: Vec<Self> = Vec::new();
        for of_block in sorted.chunk_by(|a, b| a.i / WIDTH as u32 == b.i / WIDTH as u32) {
            let mut of_this = Vec::new();
            for bond in of_block {
                let rest = laws.touch * (bond.class as f32).sqrt();
                let (set, lane) = Self::find(&mut of_this, [bond.i, bond.j], rest);
                set.intact |= 1 << lane;
            }
            sets.append(&mut of_this);
        }
        Self::padded_to_even(sets)
    }

    /// With one that is empty where they are odd in number: they are worked on two by two.
    fn padded_to_even(mut sets: Vec<Self>) -> Vec<Self> {
        if !sets.len().is_multiple_of(2) {
            sets.push(Self::new(0, 0, 0.0));
        }
        sets
    }

    /// Pairs, by lane.
    fn pairs(&self) -> impl Iterator<Item = (usize, [u32; 2])> {
        let there = |lane: &usize| self.exists >> lane & 1 == 1;
        (0..WIDTH).filter(there).map(|lane| {
            let place = usize::from(self.at[lane]);
            let width = WIDTH as u32;
            let j = self.window[place / WIDTH] * width + (place % WIDTH) as u32;
            (lane, [self.block * width + lane as u32, j])
        })
    }

    /// The pairs whose bond holds.
    pub(super) fn intact(&self) -> impl Iterator<Item = [u32; 2]> {
        self.pairs().filter(|&(lane, _)| self.intact >> lane & 1 == 1).map(|(_, pair)| pair)
    }

    fn memory(&mut self) -> BondHistoryMut<'_> {
        let Self { rest, exists, intact, stored, in_contact, xi, .. } = self;
        BondHistoryMut {
            rest: *rest,
            exists: *exists,
            intact,
            stored,
            contacts: ContactHistoryMut { in_contact, xi },
        }
    }

    /// What is kinematics of the pairs.
    #[inline(always)]
    fn kinematics<S: LaneOps>(&self, simd: S, frame: &Frame, blocks: &[ParticleBlock]) -> PairKinematics {
        let (me, at) = (&blocks[self.block as usize], &simd.widen(&self.at));
        let others = self.window.map(|block| &blocks[block as usize]);
        let mut kinematics = PairKinematics::ZERO;
        for axis in 0..3 {
            let mut position = simd.permute_ints(others.map(|block| &block.position[axis]), at);
            let velocity = simd.permute(others.map(|block| &block.velocity[axis]), at);
            let spin = simd.permute(others.map(|block| &block.spin[axis]), at);
            for k in 0..WIDTH {
                position.0[k] = position.0[k].wrapping_sub(me.position[axis].0[k]);
            }
            if axis == 1 && frame.period_y != 0 {
                position.0.iter_mut().for_each(|y| *y = frame.nearest_image(*y));
            }
            for k in 0..WIDTH {
                kinematics.offset[axis].0[k] = position.0[k] as f32 * frame.unit_m;
                kinematics.velocity[axis].0[k] = velocity.0[k] - me.velocity[axis].0[k];
                kinematics.spin[axis].0[k] = spin.0[k] + me.spin[axis].0[k];
            }
        }
        kinematics
    }

    /// Adds what acts on either side.
    #[inline(always)]
    fn add<S: LaneOps>(&self, simd: S, loads: &PairLoads, sums: &mut LoadSums) {
        let mine = &mut sums.blocks[self.block as usize];
        for axis in 0..3 {
            for k in 0..WIDTH {
                mine.force[axis].0[k] += loads.force[axis].0[k];
                mine.torque[axis].0[k] += loads.torque[axis].0[k];
            }
        }
        for half in 0..2 {
            if self.bonded[half] == 0 {
                continue;
            }
            let theirs = &mut sums.blocks[self.window[half] as usize];
            let back = simd.unpack(self.back[half]);
            for axis in 0..3 {
                let force = simd.masked_permute(&loads.force[axis], &back, self.bonded[half]);
                let torque = simd.masked_permute(&loads.torque[axis], &back, self.bonded[half]);
                for k in 0..WIDTH {
                    theirs.force[axis].0[k] -= force.0[k];
                    theirs.torque[axis].0[k] += torque.0[k];
                }
            }
        }
    }

    /// The lower sub-particles of these lanes go into `broken`.
    #[cold]
    fn record_broken(&self, lanes: u16, broken: &mut Vec<u32>) {
        let these = (0..WIDTH as u32).filter(|lane| lanes >> lane & 1 == 1);
        broken.extend(these.map(|lane| self.block * WIDTH as u32 + lane));
    }

    /// What is left of the bonds when sub-particles are renumbered; `u32::MAX` is gone.
    pub(super) fn renumbered(sets: &[Self], map: impl Fn(u32) -> u32) -> Vec<Self> {
        let mut kept: Vec<Self> = Vec::new();
        for old in sets {
            for (from, pair) in old.pairs() {
                let pair = pair.map(&map);
                if pair.contains(&u32::MAX) {
                    continue;
                }
                let (set, lane) = Self::find(&mut kept, pair, old.rest);
                set.intact |= (old.intact >> from & 1) << lane;
                for (mine, theirs) in set.stored.iter_mut().zip(&old.stored) {
                    mine.0[lane] = theirs.0[from];
                }
                set.in_contact |= (old.in_contact >> from & 1) << lane;
                for (mine, theirs) in set.xi.iter_mut().zip(&old.xi) {
                    mine.0[lane] = theirs.0[from];
                }
            }
        }
        Self::padded_to_even(kept)
    }
}

/// Adds what the bonds of two sets do, and the contacts of their pairs. Returns the greatest overlap of as_range whose bond has broken,
/// in metres; the lower sub-particles of as_range that break now go into `broken`.
#[inline(always)]
#[expect(clippy::too_many_arguments, reason = "what a body has at hand")]
pub(super) fn forces<S: LaneOps>(
    [one, two]: [&mut BondSet; 2],
    simd: S,
    laws: &PairLaws,
    sqrt_m_star: f32,
    frame: &Frame,
    blocks: &[ParticleBlock],
    sums: &mut LoadSums,
    broken: &mut Vec<u32>,
) -> f32 {
    let kinematics = [one.kinematics(simd, frame, blocks), two.kinematics(simd, frame, blocks)];
    let mut pair_loads = [PairLoads::ZERO; 2];
    let before = [one.intact, two.intact];
    let max_overlap = kernel::bonds(
        simd,
        laws,
        sqrt_m_star,
        &kinematics,
        &mut [one.memory(), two.memory()],
        &mut pair_loads,
    );
    one.add(simd, &pair_loads[0], sums);
    two.add(simd, &pair_loads[1], sums);
    for (set, before) in [one, two].into_iter().zip(before) {
        let lanes = before & !set.intact;
        if lanes != 0 {
            set.record_broken(lanes, broken);
        }
    }
    max_overlap
}
