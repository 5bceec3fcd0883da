//! A cell list over the sub-particles, for the neighbour search of the plain path.

use glam::IVec3;

use crate::engine::state::State;

/// Sub-particles sorted by cell, by id within a cell.
#[derive(Debug)]
pub struct CellList {
    low: IVec3,
    /// Edge of a cell, in units.
    cell: i32,
    counts: IVec3,
    starts: Vec<u32>,
    sorted: Vec<u32>,
}

impl CellList {
    /// A cell list with cells at least `reach` metres wide: 27 cells hold all neighbours within reach.
    pub fn new(state: &State, reach: f32) -> Self {
        let positions = || state.particles.iter().map(|p| p.position);
        let low = positions().reduce(IVec3::min).unwrap_or(IVec3::ZERO);
        let high = positions().reduce(IVec3::max).unwrap_or(IVec3::ZERO);
        let mut cell = (reach / state.frame.unit_m).ceil() as i32 + 1;
        // A few far fragments must not make the list larger than the number of particles warrants.
        let max_cells = 8 * state.particles.len() as i64 + 4096;
        let volume = |cell: i32| {
            let n = (high - low) / cell + 1;
            i64::from(n.x).saturating_mul(i64::from(n.y)).saturating_mul(i64::from(n.z))
        };
        while volume(cell) > max_cells {
            cell = cell.saturating_mul(2);
        }
        let counts = (high - low) / cell + 1;
        let mut cell_list = Self { low, cell, counts, starts: Vec::new(), sorted: Vec::new() };
        let cells: Vec<u32> = positions().map(|x| cell_list.index(cell_list.cell_of(x))).collect();
        cell_list.starts = vec![0; (counts.x * counts.y * counts.z) as usize + 1];
        cells.iter().for_each(|&c| cell_list.starts[c as usize + 1] += 1);
        for c in 1..cell_list.starts.len() {
            cell_list.starts[c] += cell_list.starts[c - 1];
        }
        let mut next = cell_list.starts.clone();
        cell_list.sorted = vec![0; cells.len()];
        for (i, &c) in cells.iter().enumerate() {
            cell_list.sorted[next[c as usize] as usize] = i as u32;
            next[c as usize] += 1;
        }
        cell_list
    }

    fn cell_of(&self, x: IVec3) -> IVec3 {
        (x - self.low) / self.cell
    }

    fn index(&self, c: IVec3) -> u32 {
        (c.x + self.counts.x * (c.y + self.counts.y * c.z)) as u32
    }

    /// Calls `visit` with every sub-particle in the 27 cells around `x`, and around its periodic images.
    pub fn for_each_near(&self, x: IVec3, period_y: i32, mut visit: impl FnMut(u32)) {
        self.for_each_in_27_cells(x, &mut visit);
        if period_y != 0 {
            self.for_each_in_27_cells(x + IVec3::Y * period_y, &mut visit);
            self.for_each_in_27_cells(x - IVec3::Y * period_y, &mut visit);
        }
    }

    fn for_each_in_27_cells(&self, x: IVec3, visit: &mut impl FnMut(u32)) {
        // Rounded towards zero. Below the list this is one cell too high, which only widens the search.
        let c = self.cell_of(x);
        let (from, to) = ((c - 1).max(IVec3::ZERO), (c + 1).min(self.counts - 1));
        if from.x > to.x {
            return;
        }
        for z in from.z..=to.z {
            for y in from.y..=to.y {
                // Cells adjacent in x are adjacent in the list: one range holds all three.
                let first = self.index(IVec3::new(from.x, y, z)) as usize;
                let last = self.index(IVec3::new(to.x, y, z)) as usize;
                let stretch = self.starts[first] as usize..self.starts[last + 1] as usize;
                self.sorted[stretch].iter().for_each(|&j| visit(j));
            }
        }
    }
}
