//! The bonds of a body in chunks. A pair whose bond breaks stays here, as a contact.

use super::kernel::{Bonds, Contacts, PairLaws};
use super::lanes::{Lanes, WIDTH};
use crate::shape::lattice::LatticeBond;

/// Bonds of one class, at most [`WIDTH`] of them.
#[derive(Clone, Debug)]
pub(super) struct BondChunk {
    /// Sub-particles, counted within the body; the first is the lower.
    pub(super) pairs: Vec<[u32; 2]>,
    pub(super) memory: Bonds,
    /// Whether any broke in this step.
    pub(super) broke: bool,
    /// Lanes whose break has been counted.
    counted: [bool; WIDTH],
}

impl BondChunk {
    fn new(rest: f32) -> Self {
        let memory =
            Bonds { rest, break_length: Lanes::ZERO, stored: [Lanes::ZERO; 3], contacts: Contacts::new() };
        Self { pairs: Vec::new(), memory, broke: false, counted: [false; WIDTH] }
    }

    /// The bonds of a body.
    pub(super) fn all(bonds: &[LatticeBond], laws: &PairLaws) -> Vec<Self> {
        let mut sorted: Vec<&LatticeBond> = bonds.iter().collect();
        sorted.sort_by_key(|bond| (bond.class, bond.j - bond.i != 1));
        let mut chunks: Vec<Self> = Vec::new();
        for bond in sorted {
            let rest = laws.touch * (bond.class as f32).sqrt();
            let fits = |chunk: &Self| chunk.pairs.len() < WIDTH && chunk.memory.rest == rest;
            if !chunks.last().is_some_and(fits) {
                chunks.push(Self::new(rest));
            }
            let chunk = chunks.last_mut().expect("one was pushed");
            let lane = chunk.pairs.len();
            chunk.pairs.push([bond.i, bond.j]);
            chunk.memory.break_length.0[lane] = laws.bond.break_length;
        }
        chunks
    }

    /// The pairs whose bond holds.
    pub(super) fn intact(&self) -> impl Iterator<Item = [u32; 2]> {
        let lanes = self.pairs.iter().zip(self.memory.break_length.0);
        lanes.filter(|&(_, length)| length > 0.0).map(|(pair, _)| *pair)
    }

    /// Bonds that broke in the last step, as counts at the lower sub-particle.
    pub(super) fn fresh_breaks(&mut self) -> impl Iterator<Item = (u32, u32)> {
        let lanes = if self.broke { self.pairs.len() } else { 0 };
        (0..lanes).filter_map(|lane| {
            let fresh = self.memory.break_length.0[lane] <= 0.0 && !self.counted[lane];
            self.counted[lane] |= fresh;
            fresh.then_some((self.pairs[lane][0], 1))
        })
    }

    /// What is left of the bonds when sub-particles are renumbered; `u32::MAX` is gone.
    pub(super) fn renumbered(chunks: &[Self], map: impl Fn([u32; 2]) -> [u32; 2]) -> Vec<Self> {
        let mut kept: Vec<Self> = Vec::new();
        for old in chunks {
            for (from, &pair) in old.pairs.iter().enumerate() {
                let pair = map(pair);
                if pair.contains(&u32::MAX) {
                    continue;
                }
                let fits = |chunk: &Self| chunk.pairs.len() < WIDTH && chunk.memory.rest == old.memory.rest;
                if !kept.last().is_some_and(fits) {
                    kept.push(Self::new(old.memory.rest));
                }
                let chunk = kept.last_mut().expect("one was pushed");
                let lane = chunk.pairs.len();
                chunk.pairs.push(pair);
                chunk.counted[lane] = old.counted[from];
                chunk.memory.break_length.0[lane] = old.memory.break_length.0[from];
                for (mine, theirs) in chunk.memory.stored.iter_mut().zip(&old.memory.stored) {
                    mine.0[lane] = theirs.0[from];
                }
                let contacts = &mut chunk.memory.contacts;
                contacts.take(lane, &old.memory.contacts, from);
            }
        }
        kept
    }
}
