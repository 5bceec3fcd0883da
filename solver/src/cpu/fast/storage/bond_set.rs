//! The bonds of a body, packed into sets of [`WIDTH`] lanes.
//!
//! A set joins one block of sub-particles to at most two other blocks, so partners move into their lanes by register
//! permutation instead of a gather. A pair whose bond breaks stays in its set as a contact.

use glam::Vec3;

use crate::cpu::fast::instructions::arrays::{Lanes, Lanes3, PackedIndices, WIDTH};
use crate::physics::contact::ContactHistory;
use crate::physics::moment::MomentHistory;

/// A bond with its history, outside of a set.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Bond {
    /// Its sub-particles within the body, in order.
    pub(crate) pair: [u32; 2],
    /// Rest length, in metres.
    pub(crate) rest: f32,
    /// Whether it has not broken.
    pub(crate) is_intact: bool,
    /// Force history of the bond on the first sub-particle, in newton.
    pub(crate) stored: Vec3,
    /// History of the contact.
    pub(crate) contact: ContactHistory,
    /// History of the moments; zero when bonds carry none.
    pub(crate) moments: MomentHistory,
}

impl Bond {
    /// A bond without history.
    pub(crate) fn new(pair: [u32; 2], rest: f32) -> Self {
        let (contact, moments) = (ContactHistory::default(), MomentHistory::default());
        Self { pair, rest, is_intact: true, stored: Vec3::ZERO, contact, moments }
    }
}

/// Bonds of one class between a block and a window of two blocks. A sub-particle has at most one bond on
/// either side.
#[derive(Clone, Debug)]
pub(crate) struct BondSet {
    /// Block of the lower sub-particles.
    pub(crate) block: u32,
    /// Window: the blocks of the higher sub-particles.
    pub(crate) window: [u32; 2],
    /// Index of each lane's partner in the window. Indices below [`WIDTH`] are in its first block.
    pub(crate) at: [u8; WIDTH],
    /// For each element of the window, the lane of its partner, and whether it has one.
    pub(crate) back: [PackedIndices; 2],
    pub(crate) bonded: [u16; 2],
    /// History: see [`super::pair_lanes::BondHistoryMut`] and [`super::pair_lanes::ContactHistoryMut`].
    pub(crate) rest: f32,
    pub(crate) exists: u16,
    pub(crate) intact: u16,
    pub(crate) stored: Lanes3,
    pub(crate) in_contact: u16,
    pub(crate) xi: Lanes3,
}

// Everything but the force and contact histories fits one cache line.
const _: () = assert!(size_of::<BondSet>() == 448);

/// History of the moments of the bonds of a set, in N m; see [`crate::physics::moment::MomentHistory`].
#[derive(Clone, Debug)]
pub(crate) struct BondMoments {
    pub(crate) bending: Lanes3,
    pub(crate) twist: Lanes,
}

impl BondMoments {
    pub(crate) const ZERO: Self = Self { bending: [Lanes::ZERO; 3], twist: Lanes::ZERO };

    fn get(&self, lane: usize) -> MomentHistory {
        MomentHistory { bending: vector(&self.bending, lane), twist: self.twist.0[lane] }
    }

    fn set(&mut self, lane: usize, moments: &MomentHistory) {
        set_vector(&mut self.bending, lane, moments.bending);
        self.twist.0[lane] = moments.twist;
    }
}

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

    /// Lane for a bond in this set, and the index of its partner in the window.
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

    /// Index of a set with a free lane for a bond, created on demand, and the lane.
    fn find(sets: &mut Vec<Self>, pair: [u32; 2], rest: f32) -> (usize, usize) {
        let [i, j] = pair;
        let found = sets.iter().enumerate().rev().find_map(|(s, set)| Some((s, set.free_lane(pair, rest)?)));
        let (s, (lane, place)) = found.unwrap_or_else(|| {
            sets.push(Self::new(i / WIDTH as u32, j / WIDTH as u32, rest));
            let place = sets[sets.len() - 1].free_lane(pair, rest);
            (sets.len() - 1, place.expect("it was made for it"))
        });
        sets[s].put(lane, place, j);
        (s, lane)
    }

    /// Packs the bonds of a body, and their moments if they carry any. The result depends on the bonds alone, not on their
    /// order: sums have the same order whenever the same bonds are packed.
    pub(crate) fn pack(mut bonds: Vec<Bond>, carry_moments: bool) -> (Vec<Self>, Vec<BondMoments>) {
        // Bonds of one lattice direction have nearly equal index differences and go together.
        let block = |bond: &Bond| bond.pair[0] / WIDTH as u32;
        bonds.sort_by_key(|bond| {
            let [i, j] = bond.pair;
            (block(bond), bond.rest.to_bits(), j - i, i)
        });
        let (mut sets, mut moments): (Vec<Self>, Vec<BondMoments>) = (Vec::new(), Vec::new());
        for of_block in bonds.chunk_by(|a, b| block(a) == block(b)) {
            let mut of_this = Vec::new();
            for bond in of_block {
                let (s, lane) = Self::find(&mut of_this, bond.pair, bond.rest);
                of_this[s].set_history(lane, bond);
                if carry_moments {
                    moments.resize(sets.len() + of_this.len(), BondMoments::ZERO);
                    moments[sets.len() + s].set(lane, &bond.moments);
                }
            }
            sets.append(&mut of_this);
        }
        let sets = Self::padded_to_even(sets);
        moments.resize(if carry_moments { sets.len() } else { 0 }, BondMoments::ZERO);
        (sets, moments)
    }

    /// All bonds of a body, also broken ones, with their histories.
    pub(crate) fn unpack(sets: &[Self], moments: &[BondMoments]) -> impl Iterator<Item = Bond> {
        sets.iter().enumerate().flat_map(move |(s, set)| {
            set.pairs().map(move |(lane, pair)| Bond {
                pair,
                rest: set.rest,
                is_intact: set.intact >> lane & 1 == 1,
                stored: vector(&set.stored, lane),
                contact: ContactHistory {
                    in_contact: set.in_contact >> lane & 1 == 1,
                    xi: vector(&set.xi, lane),
                },
                moments: moments.get(s).map(|moments| moments.get(lane)).unwrap_or_default(),
            })
        })
    }

    fn set_history(&mut self, lane: usize, bond: &Bond) {
        self.intact |= u16::from(bond.is_intact) << lane;
        set_vector(&mut self.stored, lane, bond.stored);
        self.in_contact |= u16::from(bond.contact.in_contact) << lane;
        set_vector(&mut self.xi, lane, bond.contact.xi);
    }

    /// Adds an empty set to an odd number: sets are evaluated two at a time.
    fn padded_to_even(mut sets: Vec<Self>) -> Vec<Self> {
        if !sets.len().is_multiple_of(2) {
            sets.push(Self::new(0, 0, 0.0));
        }
        sets
    }

    /// All pairs, by lane.
    pub(crate) fn pairs(&self) -> impl Iterator<Item = (usize, [u32; 2])> {
        let there = |lane: &usize| self.exists >> lane & 1 == 1;
        (0..WIDTH).filter(there).map(|lane| {
            let place = usize::from(self.at[lane]);
            let width = WIDTH as u32;
            let j = self.window[place / WIDTH] * width + (place % WIDTH) as u32;
            (lane, [self.block * width + lane as u32, j])
        })
    }

    /// Pairs with an intact bond.
    pub(crate) fn intact(&self) -> impl Iterator<Item = [u32; 2]> {
        self.pairs().filter(|&(lane, _)| self.intact >> lane & 1 == 1).map(|(_, pair)| pair)
    }
}

fn vector([x, y, z]: &Lanes3, lane: usize) -> Vec3 {
    Vec3::new(x.0[lane], y.0[lane], z.0[lane])
}

fn set_vector(lanes: &mut Lanes3, lane: usize, vector: Vec3) {
    lanes.iter_mut().zip(vector.to_array()).for_each(|(lanes, value)| lanes.0[lane] = value);
}
