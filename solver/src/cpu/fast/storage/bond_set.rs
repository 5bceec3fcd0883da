//! The bonds of a body, packed into sets of [`WIDTH`] lanes.
//!
//! A set joins one block of sub-particles to at most two other blocks, so partners move into their lanes by register
//! permutation instead of a gather. A pair whose bond breaks stays in its set as a contact.

use super::laws::PairLaws;
use crate::cpu::fast::instructions::arrays::{Lanes, Lanes3, PackedIndices, WIDTH};
use crate::shape::lattice::LatticeBond;

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

    /// The bonds of a body.
    pub(crate) fn all(bonds: &[LatticeBond], laws: &PairLaws) -> Vec<Self> {
        let mut sorted: Vec<&LatticeBond> = bonds.iter().collect();
        // Bonds of one lattice direction have nearly equal index differences and go together.
        sorted.sort_by_key(|bond| (bond.i / WIDTH as u32, bond.class, bond.j - bond.i, bond.i));
        let mut sets: Vec<Self> = Vec::new();
        for of_block in sorted.chunk_by(|a, b| a.i / WIDTH as u32 == b.i / WIDTH as u32) {
            let mut of_this = Vec::new();
            for bond in of_block {
                let rest = laws.contact.distance * (bond.class as f32).sqrt();
                let (s, lane) = Self::find(&mut of_this, [bond.i, bond.j], rest);
                of_this[s].intact |= 1 << lane;
            }
            sets.append(&mut of_this);
        }
        Self::padded_to_even(sets)
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

    /// The bonds and their moments, if any, after a renumbering; `u32::MAX` marks a removed sub-particle.
    pub(crate) fn renumbered(
        sets: &[Self],
        moments: &[BondMoments],
        map: impl Fn(u32) -> u32,
    ) -> (Vec<Self>, Vec<BondMoments>) {
        let (mut kept, mut kept_moments) = (Vec::new(), Vec::new());
        for (k, old) in sets.iter().enumerate() {
            for (from, pair) in old.pairs() {
                let pair = pair.map(&map);
                if pair.contains(&u32::MAX) {
                    continue;
                }
                let (s, lane) = Self::find(&mut kept, pair, old.rest);
                if let Some(BondMoments { bending: [x, y, z], twist }) = moments.get(k) {
                    kept_moments.resize(kept.len(), BondMoments::ZERO);
                    let BondMoments { bending: [p, q, r], twist: mine } = &mut kept_moments[s];
                    for (mine, theirs) in [(p, x), (q, y), (r, z), (mine, twist)] {
                        mine.0[lane] = theirs.0[from];
                    }
                }
                let set = &mut kept[s];
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
        let kept = Self::padded_to_even(kept);
        kept_moments.resize(if moments.is_empty() { 0 } else { kept.len() }, BondMoments::ZERO);
        (kept, kept_moments)
    }
}
