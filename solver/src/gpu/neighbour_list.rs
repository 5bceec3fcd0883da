//! Neighbour lists in main memory, to make, save and inspect rows: the host side of `kernels/pair_list.wgsl` and
//! `kernels/wall_list.wgsl`.

use super::layout::{Count, IN_CONTACT, Moment, Pair, WallPair};
use crate::engine::saved::{SavedPair, SavedRun, SavedWall};
use crate::engine::scene::{Placement, Scene};
use crate::physics::contact::ContactHistory;

/// Initial capacity of a row of neighbours.
const INITIAL_PAIR_CAPACITY: u32 = 12;
/// Initial capacity of a row of facets.
const INITIAL_WALL_CAPACITY: u32 = 4;

/// Capacity of the rows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct RowCapacity {
    pub(super) pairs: u32,
    pub(super) walls: u32,
}

impl RowCapacity {
    /// Maximum of both.
    pub(super) fn max(self, other: Self) -> Self {
        Self { pairs: self.pairs.max(other.pairs), walls: self.walls.max(other.walls) }
    }

    /// Capacity for rows of these lengths, with some reserve.
    pub(super) fn holding(pairs: u32, walls: u32) -> Self {
        Self { pairs: (pairs + 2).next_multiple_of(4), walls: (walls + 1).next_multiple_of(4) }
    }
}

impl Default for RowCapacity {
    fn default() -> Self {
        Self { pairs: INITIAL_PAIR_CAPACITY, walls: INITIAL_WALL_CAPACITY }
    }
}

/// The rows of all sub-particles of a run, with equal capacities.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Rows {
    pub(super) row_capacity: RowCapacity,
    pub(super) counts: Vec<Count>,
    pub(super) pairs: Vec<Pair>,
    /// Moments beside the pairs; empty when bonds carry none.
    pub(super) moments: Vec<Moment>,
    pub(super) walls: Vec<WallPair>,
}

/// The rows of one sub-particle, from a saved run.
struct SavedRow {
    pairs: Vec<Pair>,
    moments: Vec<Moment>,
    walls: Vec<WallPair>,
}

/// The rows of one sub-particle.
type Row<'a> = (&'a [Pair], &'a [Moment], &'a [WallPair]);

impl Rows {
    /// Rows that hold only the bonds of a scene.
    pub(super) fn new(scene: &Scene) -> Self {
        let none = Self::of(RowCapacity::default(), false, std::iter::empty());
        none.with_bodies(scene, scene.present())
    }

    /// Rows that hold only what a saved run has.
    pub(super) fn restore(saved: &SavedRun, has_moments: bool) -> Self {
        let rows: Vec<SavedRow> = saved
            .pairs_of_each()
            .iter()
            .zip(saved.walls_of_each())
            .map(|(pairs, walls)| SavedRow {
                pairs: pairs.iter().map(Pair::restore).collect(),
                moments: pairs.iter().filter(|_| has_moments).map(Moment::restore).collect(),
                walls: walls.iter().map(WallPair::restore).collect(),
            })
            .collect();
        let longest = |length: fn(&SavedRow) -> usize| rows.iter().map(length).max().unwrap_or(0) as u32;
        let needed = RowCapacity::holding(longest(|row| row.pairs.len()), longest(|row| row.walls.len()));
        let rows = rows.iter().map(|row| (&row.pairs[..], &row.moments[..], &row.walls[..]));
        Self::of(RowCapacity::default().max(needed), has_moments, rows)
    }

    /// Pairs with a bond or in contact, ascending.
    pub(super) fn save_pairs(&self) -> Vec<SavedPair> {
        let row = |i: usize| {
            let mut moments = self.moments(i).iter();
            let all = self.pairs(i).iter().map(move |pair| pair.save(i as u32, moments.next()));
            all.filter(|saved| {
                saved.pair[0] < saved.pair[1]
                    && (saved.class != 0 || saved.contact != ContactHistory::default())
            })
        };
        (0..self.counts.len()).flat_map(row).collect()
    }

    /// Clears the loads and memories of contacts with surfaces that have changed their form.
    pub(super) fn surfaces_changed(&mut self, changed: &[[u32; 2]]) {
        for wall in &mut self.walls {
            let mut saved = wall.save();
            saved.surface_changed(changed);
            *wall = WallPair::restore(&saved);
        }
    }

    /// Facets that remember anything, by sub-particle.
    pub(super) fn save_walls(&self) -> Vec<SavedWall> {
        let row = |i: usize| {
            let near: Vec<_> = self.walls(i).iter().map(WallPair::save).collect();
            SavedWall::of(i as u32, &near).collect::<Vec<_>>()
        };
        (0..self.counts.len()).flat_map(row).collect()
    }

    /// These rows and, behind them, the bonds of further bodies of the scene.
    pub(super) fn with_bodies(&self, scene: &Scene, bodies: &[Placement]) -> Self {
        let mut rows: Vec<Vec<Pair>> = Vec::new();
        for body in bodies {
            let meta = &scene.kinds[body.kind].meta;
            let first = rows.len();
            let base = (self.counts.len() + first) as u32;
            rows.resize(first + meta.points.len(), Vec::new());
            for bond in &meta.bonds {
                let pair = |other| Pair { other: base + other, state: bond.class, ..Pair::default() };
                rows[first + bond.i as usize].push(pair(bond.j));
                rows[first + bond.j as usize].push(pair(bond.i));
            }
        }
        rows.iter_mut().for_each(|row| row.sort_unstable_by_key(|pair| pair.other));
        let longest = rows.iter().map(Vec::len).max().unwrap_or(0) as u32;
        let row_capacity = self.row_capacity.max(RowCapacity::holding(longest, 0));
        let own = (0..self.counts.len()).map(|i| (self.pairs(i), self.moments(i), self.walls(i)));
        let bonds = rows.iter().map(|row| (row.as_slice(), [].as_slice(), [].as_slice()));
        Self::of(row_capacity, scene.laws.moment.is_some(), own.chain(bonds))
    }

    fn of<'a>(row_capacity: RowCapacity, has_moments: bool, rows: impl Iterator<Item = Row<'a>>) -> Self {
        let (counts, walls) = (Vec::new(), Vec::new());
        let mut new = Self { row_capacity, counts, pairs: Vec::new(), moments: Vec::new(), walls };
        for (pairs, moments, walls) in rows {
            new.counts.push(Count { pairs: pairs.len() as u32, walls: walls.len() as u32 });
            let at = new.counts.len();
            new.pairs.extend_from_slice(pairs);
            new.pairs.resize(at * row_capacity.pairs as usize, Pair::default());
            new.moments.extend_from_slice(moments);
            if has_moments {
                new.moments.resize(at * row_capacity.pairs as usize, Moment::default());
            }
            new.walls.extend_from_slice(walls);
            new.walls.resize(at * row_capacity.walls as usize, WallPair::default());
        }
        new
    }

    /// The neighbours of a sub-particle.
    pub(super) fn pairs(&self, i: usize) -> &[Pair] {
        let from = i * self.row_capacity.pairs as usize;
        &self.pairs[from..from + self.counts[i].pairs as usize]
    }

    /// The moments beside the neighbours of a sub-particle.
    fn moments(&self, i: usize) -> &[Moment] {
        let from = i * self.row_capacity.pairs as usize;
        if self.moments.is_empty() { &[] } else { &self.moments[from..from + self.counts[i].pairs as usize] }
    }

    /// The facets near a sub-particle.
    pub(super) fn walls(&self, i: usize) -> &[WallPair] {
        let from = i * self.row_capacity.walls as usize;
        &self.walls[from..from + self.counts[i].walls as usize]
    }

    /// Intact bonds, as pairs of indices, the lower one first, ascending.
    pub(super) fn bonds(&self) -> impl Iterator<Item = [usize; 2]> {
        let row = |i: usize| self.pairs(i).iter().map(move |pair| (i, pair));
        (0..self.counts.len())
            .flat_map(row)
            .filter(|(i, pair)| pair.state & !IN_CONTACT != 0 && *i < pair.other as usize)
            .map(|(i, pair)| [i, pair.other as usize])
    }
}
