//! Neighbour lists in main memory, to renumber, lengthen and inspect rows: the host side of
//! `kernels/neighbour_list.wgsl`.

use super::layout::{Count, IN_CONTACT, Pair, WallPair};
use crate::engine::scene::{BodyKind, Placement, Scene};

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
    pub(super) walls: Vec<WallPair>,
}

impl Rows {
    /// Rows that hold only the bonds of a scene.
    pub(super) fn new(scene: &Scene) -> Self {
        let none = Self::of(RowCapacity::default(), std::iter::empty());
        none.with_bodies(&scene.kinds, scene.present())
    }

    /// These rows and, behind them, the bonds of further bodies.
    pub(super) fn with_bodies(&self, kinds: &[BodyKind], bodies: &[Placement]) -> Self {
        let mut rows: Vec<Vec<Pair>> = Vec::new();
        for body in bodies {
            let meta = &kinds[body.kind].meta;
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
        let own = (0..self.counts.len()).map(|i| (self.pairs(i), self.walls(i)));
        Self::of(row_capacity, own.chain(rows.iter().map(|row| (row.as_slice(), [].as_slice()))))
    }

    fn of<'a>(row_capacity: RowCapacity, rows: impl Iterator<Item = (&'a [Pair], &'a [WallPair])>) -> Self {
        let mut new = Self { row_capacity, counts: Vec::new(), pairs: Vec::new(), walls: Vec::new() };
        for (pairs, walls) in rows {
            new.counts.push(Count { pairs: pairs.len() as u32, walls: walls.len() as u32 });
            let at = new.counts.len();
            new.pairs.extend_from_slice(pairs);
            new.pairs.resize(at * row_capacity.pairs as usize, Pair::default());
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

    /// The facets near a sub-particle.
    pub(super) fn walls(&self, i: usize) -> &[WallPair] {
        let from = i * self.row_capacity.walls as usize;
        &self.walls[from..from + self.counts[i].walls as usize]
    }

    /// The same rows with another capacity, which must suffice.
    pub(super) fn with(&self, row_capacity: RowCapacity) -> Self {
        Self::of(row_capacity, (0..self.counts.len()).map(|i| (self.pairs(i), self.walls(i))))
    }

    /// Renumbers after a removal: `map` holds the new index of each sub-particle, or `u32::MAX`.
    pub(super) fn remove(&self, map: &[u32]) -> Self {
        let renumber = |pair: &Pair| {
            let other = map[pair.other as usize];
            (other != u32::MAX).then_some(Pair { other, ..*pair })
        };
        let opaque = (0..map.len()).filter(|&i| map[i] != u32::MAX);
        let rows: Vec<(Vec<Pair>, &[WallPair])> =
            opaque.map(|i| (self.pairs(i).iter().filter_map(renumber).collect(), self.walls(i))).collect();
        Self::of(self.row_capacity, rows.iter().map(|(pairs, walls)| (pairs.as_slice(), *walls)))
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
