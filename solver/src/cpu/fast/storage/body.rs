//! A body: its sub-particles, bonds, neighbouring facets and motion.

use std::ops::Range;

use super::bond_set::{Bond, BondMoments, BondSet};
use super::bounds::BodyBounds;
use super::motion::BodyMotion;
use super::pairs::sort_key;
use super::particles::{BodyParticles, slot_of};
use super::wall_list::WallList;

/// √m* of two sub-particles of masses in kg, in kg^½.
pub(crate) fn sqrt_equivalent_mass(mass: f32, other: f32) -> f32 {
    (mass * other / (mass + other)).sqrt()
}

#[derive(Debug)]
pub(crate) struct Body {
    pub(crate) range: Range<usize>,
    pub(crate) points: BodyParticles,
    /// Mass of each of its sub-particles, in kilograms.
    pub(crate) mass: f32,
    pub(crate) bonds: Vec<BondSet>,
    /// Whether it is a group of single spheres, each of them a body of the scene.
    pub(crate) is_group: bool,
    /// Moments of each bond set; empty when bonds carry none.
    pub(crate) moments: Vec<BondMoments>,
    /// Pairs that were bonded at the start, by slots, sorted. Pairs with a broken bond stay in the bond sets.
    pub(crate) bonded_pairs: Vec<[u32; 2]>,
    pub(crate) walls: WallList,
    pub(crate) motion: BodyMotion,
    /// Integral of the maximum speed, in metres.
    pub(crate) travelled: f64,
    /// Maximum speed of a sub-particle, in m/s.
    pub(crate) max_speed: f32,
    /// Bounding boxes after the last move.
    pub(crate) bounds: BodyBounds,
    /// Lower sub-particles of bonds that broke in the last step.
    pub(crate) broken: Vec<u32>,
    /// Body pairs of which it is the second body, each with its first body, in order.
    pub(crate) pairs_as_second: Vec<[u32; 2]>,
    /// Motion at the last update of the body pairs.
    pub(crate) pairing_motion: BodyMotion,
}

/// Pairs of sub-particles by slots, the lower first, sorted.
fn slot_pairs(bonds: &[Bond]) -> Vec<[u32; 2]> {
    let sorted = |[i, j]: [u32; 2]| [i.min(j), i.max(j)];
    let mut placed: Vec<_> = bonds.iter().map(|bond| sorted(bond.pair.map(slot_of))).collect();
    placed.sort_unstable();
    placed
}

impl Body {
    pub(crate) fn new(
        range: Range<usize>,
        points: BodyParticles,
        mass: f32,
        bonds: Vec<Bond>,
        carry_moments: bool,
        is_group: bool,
    ) -> Self {
        let bonded_pairs = slot_pairs(&bonds);
        let (bonds, moments) = BondSet::pack(bonds, carry_moments);
        let speeds = (0..points.count).map(|k| points.particle(k).velocity.length());
        Self {
            max_speed: speeds.fold(0.0, f32::max),
            range,
            bounds: BodyBounds::of(&points),
            points,
            mass,
            bonds,
            is_group,
            moments,
            bonded_pairs,
            walls: WallList::default(),
            motion: BodyMotion::default(),
            travelled: 0.0,
            broken: Vec::new(),
            pairs_as_second: Vec::new(),
            pairing_motion: BodyMotion::default(),
        }
    }

    /// Its sub-particles in the state.
    pub(crate) fn range(&self) -> Range<usize> {
        self.range.clone()
    }

    /// Removes pairs that were bonded at the start. Both lists are sorted by slots.
    pub(crate) fn exclude_bonded(&self, pairs: &mut Vec<[u32; 2]>) {
        let bonded_pairs = &self.bonded_pairs;
        let (mut kept, mut next) = (0, 0);
        for k in 0..pairs.len() {
            let pair = pairs[k];
            // Nearly all bonded pairs are found, so hardly any is skipped.
            while next < bonded_pairs.len() && sort_key(bonded_pairs[next]) < sort_key(pair) {
                next += 1;
            }
            let is_joined = next < bonded_pairs.len() && bonded_pairs[next] == pair;
            next += usize::from(is_joined);
            pairs[kept] = pair;
            kept += usize::from(!is_joined);
        }
        pairs.truncate(kept);
    }

    /// Renumbers after a removal.
    pub(crate) fn renumber(&mut self, range: Range<usize>, points: BodyParticles, locals: &[u32]) {
        self.range = range;
        self.points = points;
        self.bounds.update(&self.points);
        let bonds = BondSet::unpack(&self.bonds, &self.moments)
            .map(|bond| Bond { pair: bond.pair.map(|k| locals[k as usize]), ..bond })
            .filter(|bond| !bond.pair.contains(&u32::MAX));
        let bonds: Vec<Bond> = bonds.collect();
        self.bonded_pairs = slot_pairs(&bonds);
        (self.bonds, self.moments) = BondSet::pack(bonds, !self.moments.is_empty());
        self.walls.renumber(locals);
    }

    /// Moves to another range of the state, unchanged.
    pub(crate) fn set_range(&mut self, range: Range<usize>) {
        self.range = range;
    }
}
