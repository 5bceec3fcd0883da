//! The state of a run between two steps, in a form that every backend writes and reads.
//!
//! It holds what later steps depend on: sub-particles, bonds, the histories of contacts with each other and with facets,
//! and the time. Neighbour lists are left out. They are built again, and no bit depends on when.

use std::collections::HashSet;

use glam::{IVec3, Vec3};
use serde::{Deserialize, Serialize};

use super::frame::DOMAIN_LIMIT;
use super::scene::Scene;
use super::state::State;
use super::wall_pair::WallPair;
use crate::equipment::Surface;
use crate::physics::contact::ContactHistory;
use crate::physics::moment::MomentHistory;

/// The state of a run between two steps.
#[derive(Clone, Debug, PartialEq)]
pub struct SavedRun {
    /// Steps done.
    pub step: u64,
    /// Step of t = 0, once the process has started.
    pub start_step: Option<u64>,
    /// The sub-particles.
    pub state: State,
    /// Bodies as the fast path stores them, in their order; empty on other paths.
    pub stored_bodies: Vec<StoredBody>,
    /// Pairs of sub-particles with a bond or in contact, ascending.
    pub pairs: Vec<SavedPair>,
    /// Contacts with facets, and memories of their sides, by sub-particle, then by facet.
    pub walls: Vec<SavedWall>,
}

/// A body of the fast path: one of the scene, or a group of single spheres.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct StoredBody {
    /// Number of its sub-particles.
    pub count: u32,
    /// Whether it is a group.
    pub is_group: bool,
}

/// A pair of sub-particles with a bond or in contact. Vectors are those of the first one; the second has their opposites.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SavedPair {
    /// Indices of the sub-particles, in order.
    pub pair: [u32; 2],
    /// Class of the bond (see [`crate::shape::lattice::LatticeBond`]); 0 without one.
    pub class: u32,
    /// Whether the bond is intact. The fast path keeps broken ones.
    pub is_intact: bool,
    /// Force history of the bond, in newton.
    pub bond: Vec3,
    /// History of the contact.
    pub contact: ContactHistory,
    /// History of the moments; zero when bonds carry none.
    pub moments: MomentHistory,
}

/// A contact of a sub-particle with a facet.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SavedWall {
    /// Index of the sub-particle.
    pub particle: u32,
    /// The facet and the histories.
    pub wall: WallPair,
}

impl SavedWall {
    /// The facets of a sub-particle that remember anything.
    pub(crate) fn of(particle: u32, near: &[WallPair]) -> impl Iterator<Item = Self> {
        let blank = |wall: &WallPair| *wall == WallPair { facet: wall.facet, ..WallPair::default() };
        near.iter().filter(move |wall| !blank(wall)).map(move |&wall| Self { particle, wall })
    }
}

impl SavedPair {
    /// The same pair from the other side.
    pub fn turned(&self) -> Self {
        let [i, j] = self.pair;
        let Self { bond, contact, moments, .. } = *self;
        // From 0, so that nothing stays +0.
        let opposite = |vector: Vec3| Vec3::ZERO - vector;
        Self {
            pair: [j, i],
            bond: opposite(bond),
            contact: ContactHistory { xi: opposite(contact.xi), ..contact },
            moments: MomentHistory { bending: opposite(moments.bending), ..moments },
            ..*self
        }
    }
}

impl SavedRun {
    /// Pairs from either side, in the order of rows.
    pub(crate) fn pairs_of_each(&self) -> Vec<Vec<SavedPair>> {
        let mut rows = vec![Vec::new(); self.state.particles.len()];
        for pair in &self.pairs {
            rows[pair.pair[0] as usize].push(*pair);
            rows[pair.pair[1] as usize].push(pair.turned());
        }
        rows.iter_mut().for_each(|row| row.sort_unstable_by_key(|pair| pair.pair[1]));
        rows
    }

    /// Facets of each sub-particle.
    pub(crate) fn walls_of_each(&self) -> Vec<Vec<WallPair>> {
        let mut rows = vec![Vec::new(); self.state.particles.len()];
        self.walls.iter().for_each(|of| rows[of.particle as usize].push(of.wall));
        rows
    }

    /// The fault, in words, that makes it unusable for a run of this scene. A run that was saved by Roost has none.
    pub(crate) fn fault(&self, scene: &Scene) -> Option<&'static str> {
        let count = self.state.particles.len();
        let positions = self.state.particles.iter().map(|particle| particle.position);
        let limit = IVec3::splat(DOMAIN_LIMIT);
        if positions.into_iter().any(|x| x.cmpgt(limit).any() || x.cmplt(-limit).any()) {
            return Some("a sub-particle lies outside the domain");
        }
        if self.start_step.is_some_and(|start| start > self.step) {
            return Some("it starts after its own time");
        }
        self.pair_fault(scene, count)
            .or_else(|| self.wall_fault(scene, count))
            .or_else(|| self.body_fault(scene, count))
    }

    fn pair_fault(&self, scene: &Scene, count: usize) -> Option<&'static str> {
        let bonds: Vec<HashSet<[u32; 3]>> = scene
            .kinds
            .iter()
            .map(|kind| kind.meta.bonds.iter().map(|bond| [bond.i, bond.j, bond.class]).collect())
            .collect();
        let firsts = scene.first_serials();
        let sorted = self.pairs.is_sorted_by(|a, b| a.pair < b.pair);
        let of_count = |pair: &SavedPair| pair.pair[0] < pair.pair[1] && (pair.pair[1] as usize) < count;
        if !sorted || !self.pairs.iter().all(of_count) {
            return Some("its pairs of sub-particles are not in order");
        }
        let exists = |pair: &SavedPair| {
            let [i, j] = pair.pair.map(|k| k as usize);
            let body = self.state.bodies[i];
            let own = |k: usize| self.state.serials[k] - firsts[body as usize];
            let bond = || [own(i), own(j), pair.class];
            body == self.state.bodies[j] && bonds[scene.bodies[body as usize].kind].contains(&bond())
        };
        let bonded = self.pairs.iter().filter(|pair| pair.class != 0);
        (!bonded.into_iter().all(exists)).then_some("it has a bond that its body does not have")
    }

    fn wall_fault(&self, scene: &Scene, count: usize) -> Option<&'static str> {
        let facets = scene.surfaces.iter().map(Surface::facet_count).sum::<usize>();
        let key = |of: &SavedWall| (of.particle, of.wall.facet);
        let sorted = self.walls.is_sorted_by(|a, b| key(a) < key(b));
        let exists = |of: &SavedWall| (of.particle as usize) < count && (of.wall.facet as usize) < facets;
        (!(sorted && self.walls.iter().all(exists))).then_some("it has a contact with an unknown surface")
    }

    fn body_fault(&self, scene: &Scene, count: usize) -> Option<&'static str> {
        if self.stored_bodies.is_empty() {
            return None;
        }
        let total = self.stored_bodies.iter().map(|body| u64::from(body.count)).sum::<u64>();
        if total != count as u64 {
            return Some("its bodies do not have all sub-particles");
        }
        let mut from = 0;
        let is_sound = |body: &StoredBody| {
            let range = from..from + body.count as usize;
            if range.is_empty() {
                return false;
            }
            from = range.end;
            let (bodies, masses) = (&self.state.bodies[range.clone()], &self.state.masses[range.clone()]);
            let single = |body: &u32| scene.kinds[scene.bodies[*body as usize].kind].meta.points.len() == 1;
            let whole = || {
                let next = self.state.bodies.get(range.end);
                bodies.iter().all(|body| *body == bodies[0]) && next != bodies.last()
            };
            let alike = if body.is_group { bodies.iter().all(single) } else { whole() };
            alike && masses.iter().all(|mass| *mass == masses[0])
        };
        (!self.stored_bodies.iter().all(is_sound)).then_some("its bodies are not those of the scene")
    }
}
