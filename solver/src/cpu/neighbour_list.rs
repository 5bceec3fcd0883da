//! Neighbour lists with the histories of bonds and contacts.
//!
//! A pair appears in the lists of both sub-particles, each with its own copy of the history. The copies stay
//! exact opposites. A rebuild changes the candidates but never the history of a pair that acts.

use rayon::prelude::*;

use super::cell_list::CellList;
use super::{CHUNK, Params};
use crate::engine::saved::{SavedPair, SavedRun, SavedWall};
use crate::engine::scene::{Placement, Scene};
use crate::engine::state::State;
use crate::engine::wall_pair::WallPair;
use crate::physics::contact::ContactHistory;
use crate::physics::moment::MomentHistory;
use crate::walls::Walls;
use glam::Vec3;

/// A neighbour of a sub-particle, with the history of the pair.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Pair {
    /// The other sub-particle.
    pub other: u32,
    /// Class of the bond between them (see [`crate::shape::lattice::LatticeBond`]); 0 without a bond.
    pub bond_class: u32,
    /// Force history of the bond, in newton.
    pub bond: Vec3,
    /// History of the contact.
    pub contact: ContactHistory,
}

impl Pair {
    fn restore(saved: &SavedPair) -> Self {
        let SavedPair { pair: [_, other], class, bond, contact, .. } = *saved;
        Self { other, bond_class: class, bond, contact }
    }
}

/// The neighbour lists of one chunk of sub-particles.
#[derive(Clone, Debug, Default)]
pub struct ChunkNeighbours {
    pub(super) pair_ends: Vec<u32>,
    pub(super) pairs: Vec<Pair>,
    /// History of the moments of each pair's bond; empty when bonds carry no moments.
    pub(super) moments: Vec<MomentHistory>,
    pub(super) wall_ends: Vec<u32>,
    pub(super) walls: Vec<WallPair>,
}

/// Row of a compressed list: from the end of the previous row to its own end.
fn row(ends: &[u32], k: usize) -> std::ops::Range<usize> {
    let from = if k == 0 { 0 } else { ends[k - 1] as usize };
    from..ends[k] as usize
}

impl ChunkNeighbours {
    /// The neighbours of the `k`th sub-particle of the chunk, sorted by id, and their moments, if bonds carry any.
    pub fn pairs_mut(&mut self, k: usize) -> (&mut [Pair], &mut [MomentHistory]) {
        let row = row(&self.pair_ends, k);
        let moments = if self.moments.is_empty() { &mut [] } else { &mut self.moments[row.clone()] };
        (&mut self.pairs[row], moments)
    }

    /// The facets near the `k`th sub-particle of the chunk, sorted.
    pub fn walls_mut(&mut self, k: usize) -> &mut [WallPair] {
        let row = row(&self.wall_ends, k);
        &mut self.walls[row]
    }

    /// The neighbours of the `k`th sub-particle of the chunk, sorted by id.
    pub fn pairs(&self, k: usize) -> &[Pair] {
        &self.pairs[row(&self.pair_ends, k)]
    }

    fn moments(&self, k: usize) -> &[MomentHistory] {
        if self.moments.is_empty() { &[] } else { &self.moments[row(&self.pair_ends, k)] }
    }

    /// The facets near the `k`th sub-particle of the chunk, sorted.
    pub fn wall_pairs(&self, k: usize) -> &[WallPair] {
        &self.walls[row(&self.wall_ends, k)]
    }

    fn push_row(
        &mut self,
        pairs: impl IntoIterator<Item = Pair>,
        moments: impl IntoIterator<Item = MomentHistory>,
        walls: impl IntoIterator<Item = WallPair>,
    ) {
        self.pairs.extend(pairs);
        self.moments.extend(moments);
        self.pair_ends.push(self.pairs.len() as u32);
        self.walls.extend(walls);
        self.wall_ends.push(self.walls.len() as u32);
    }
}

/// A sub-particle's row of each list.
struct Row {
    pairs: Vec<Pair>,
    moments: Vec<MomentHistory>,
    walls: Vec<WallPair>,
}

/// The rows of some bodies of a scene, which hold only their bonds.
fn bond_rows(scene: &Scene, bodies: &[Placement], base: u32) -> Vec<Row> {
    let mut rows = Vec::new();
    for body in bodies {
        let meta = &scene.kinds[body.kind].meta;
        let first = base + rows.len() as u32;
        let mut own: Vec<Vec<Pair>> = vec![Vec::new(); meta.points.len()];
        for bond in &meta.bonds {
            let pair = |other| Pair { other: first + other, bond_class: bond.class, ..Pair::default() };
            own[bond.i as usize].push(pair(bond.j));
            own[bond.j as usize].push(pair(bond.i));
        }
        own.iter_mut().for_each(|row| row.sort_unstable_by_key(|pair| pair.other));
        rows.extend(own.into_iter().map(|pairs| {
            let moments = if scene.laws.moment.is_some() { pairs.len() } else { 0 };
            Row { pairs, moments: vec![MomentHistory::default(); moments], walls: Vec::new() }
        }));
    }
    rows
}

/// The neighbour lists of all sub-particles.
#[derive(Clone, Debug, Default)]
pub struct NeighbourLists {
    pub(super) chunks: Vec<ChunkNeighbours>,
}

impl NeighbourLists {
    /// Lists that hold only the bonds.
    pub fn new(scene: &Scene) -> Self {
        Self::from_rows(bond_rows(scene, scene.present(), 0).into_iter())
    }

    /// Lists that hold only what a saved run has.
    pub(super) fn restore(saved: &SavedRun, has_moments: bool) -> Self {
        let rows = saved.pairs_of_each().into_iter().zip(saved.walls_of_each()).map(|(pairs, walls)| Row {
            moments: pairs.iter().filter(|_| has_moments).map(|pair| pair.moments).collect(),
            pairs: pairs.iter().map(Pair::restore).collect(),
            walls,
        });
        Self::from_rows(rows)
    }

    /// Pairs with a bond or in contact, ascending.
    pub(super) fn save_pairs(&self) -> Vec<SavedPair> {
        let row = |(chunk, k, i): (&ChunkNeighbours, usize, u32)| {
            let mut moments = chunk.moments(k).iter().copied();
            let all = chunk.pairs(k).iter().map(move |pair| (pair, moments.next().unwrap_or_default()));
            let kept = all.filter(move |(pair, _)| {
                i < pair.other && (pair.bond_class != 0 || pair.contact != ContactHistory::default())
            });
            kept.map(move |(pair, moments)| SavedPair {
                pair: [i, pair.other],
                class: pair.bond_class,
                is_intact: pair.bond_class != 0,
                bond: pair.bond,
                contact: pair.contact,
                moments,
            })
            .collect::<Vec<_>>()
        };
        self.rows().flat_map(row).collect()
    }

    /// Clears the loads and memories of contacts with surfaces that have changed their form.
    pub(super) fn surfaces_changed(&mut self, changed: &[[u32; 2]]) {
        let walls = self.chunks.iter_mut().flat_map(|chunk| &mut chunk.walls);
        walls.for_each(|wall| wall.surface_changed(changed));
    }

    /// Facets that remember anything, by sub-particle.
    pub(super) fn save_walls(&self) -> Vec<SavedWall> {
        let row = |(chunk, k, i): (&ChunkNeighbours, usize, u32)| {
            SavedWall::of(i, chunk.wall_pairs(k)).collect::<Vec<_>>()
        };
        self.rows().flat_map(row).collect()
    }

    /// All rows: the chunk, the place within it, and the index of the sub-particle.
    fn rows(&self) -> impl Iterator<Item = (&ChunkNeighbours, usize, u32)> {
        let places = self.chunks.iter().flat_map(|chunk| (0..chunk.pair_ends.len()).map(move |k| (chunk, k)));
        (0u32..).zip(places).map(|(i, (chunk, k))| (chunk, k, i))
    }

    /// Appends the bonds of further bodies, whose first sub-particle has the index `base`.
    pub fn enter(&mut self, scene: &Scene, bodies: &[Placement], base: u32) {
        let chunks = self.chunks.iter().flat_map(|chunk| {
            let row = |k| Row {
                pairs: chunk.pairs(k).to_vec(),
                moments: chunk.moments(k).to_vec(),
                walls: chunk.wall_pairs(k).to_vec(),
            };
            (0..chunk.pair_ends.len()).map(row)
        });
        *self = Self::from_rows(chunks.chain(bond_rows(scene, bodies, base)));
    }

    fn from_rows(rows: impl Iterator<Item = Row>) -> Self {
        let mut neighbour_lists = Self::default();
        for (k, Row { pairs, moments, walls }) in rows.enumerate() {
            if k % CHUNK == 0 {
                neighbour_lists.chunks.push(ChunkNeighbours::default());
            }
            neighbour_lists.chunks.last_mut().expect("one was pushed").push_row(pairs, moments, walls);
        }
        neighbour_lists
    }

    /// Renumbers after a removal: `map` holds the new index of each sub-particle, or `u32::MAX`.
    pub fn remove(&mut self, map: &[u32]) {
        let rows = map.iter().enumerate().filter(|&(_, &new)| new != u32::MAX).map(|(old, _)| {
            let chunk = &self.chunks[old / CHUNK];
            let (k, stays) = (old % CHUNK, |pair: &&Pair| map[pair.other as usize] != u32::MAX);
            let renumbered = |pair: &Pair| Pair { other: map[pair.other as usize], ..*pair };
            let moments = chunk.pairs(k).iter().zip(chunk.moments(k)).filter(|(pair, _)| stays(pair));
            Row {
                pairs: chunk.pairs(k).iter().filter(stays).map(renumbered).collect(),
                moments: moments.map(|(_, moment)| *moment).collect(),
                walls: chunk.wall_pairs(k).to_vec(),
            }
        });
        *self = Self::from_rows(rows);
    }

    /// Rebuilds the lists. Bonds stay, and so do the histories of contacts.
    pub(crate) fn rebuild(&mut self, params: &Params, state: &State, walls: &Walls) {
        let contacts = params.laws.pair_contacts(params.radius);
        let cutoffs2 =
            contacts.map(|(law, distance)| (distance + law.adhesion_range() + params.skin).powi(2));
        let wall_range = params.radius + params.laws.adhesion_range();
        let cell_list = CellList::new(state, cutoffs2[1].sqrt());
        self.chunks.par_iter_mut().enumerate().for_each(|(c, chunk)| {
            let mut new = ChunkNeighbours::default();
            let mut near: Vec<u32> = Vec::new();
            for k in 0..chunk.pair_ends.len() {
                let i = c * CHUNK + k;
                let x = state.particles[i].position;
                near.clear();
                cell_list.for_each_near(x, state.frame.period_y, |j| {
                    let d = state.frame.between(x, state.particles[j as usize].position);
                    let is_other_body = state.bodies[i] != state.bodies[j as usize];
                    if j != i as u32 && d.dot(d) <= cutoffs2[usize::from(is_other_body)] {
                        near.push(j);
                    }
                });
                let (known, moments) = (chunk.pairs(k), chunk.moments(k));
                near.extend(known.iter().filter(|pair| pair.bond_class != 0).map(|pair| pair.other));
                near.sort_unstable();
                near.dedup();
                let find = |j: u32| known.binary_search_by_key(&j, |pair| pair.other).ok();
                let with_history = |&j: &u32| match find(j) {
                    Some(at) => known[at],
                    None => Pair { other: j, ..Pair::default() },
                };
                let moment = |&j: &u32| find(j).map_or(MomentHistory::default(), |at| moments[at]);
                let moments = near.iter().filter(|_| params.laws.moment.is_some()).map(moment);
                let wall_known = chunk.wall_pairs(k);
                let step_m = state.particles[i].velocity.length() * params.dt + walls.step_travel_m();
                let depth = walls.depth_beyond(wall_known, x, &state.frame);
                let wall_cutoff = wall_range.max(step_m) + depth + params.skin;
                let wall_with_history =
                    |facet| match wall_known.binary_search_by_key(&facet, |pair| pair.facet) {
                        Ok(at) => wall_known[at],
                        Err(_) => WallPair { facet, ..WallPair::default() },
                    };
                new.push_row(
                    near.iter().map(with_history),
                    moments,
                    walls.facets_within(x, wall_cutoff, &state.frame).map(wall_with_history),
                );
            }
            *chunk = new;
        });
    }
}
