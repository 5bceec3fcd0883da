//! Welding: nearly coincident corners become one, so that triangles know their neighbours.

use std::collections::HashMap;

use glam::DVec3;

/// Distance below which corners coincide, in metres: a few roundings of `f32` coordinates a metre from the
/// origin.
pub const WELD_M: f64 = 1e-7;

/// Edge of the lookup cells, in metres. Wide enough that most lookups touch one cell; no wider, since a
/// lookup tests all corners of a cell.
const CELL_M: f64 = 4.0 * WELD_M;

/// Triangles as triples of numbered points.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Welded {
    /// Points at least [`WELD_M`] apart, in metres, in the order of their first use.
    pub points: Vec<DVec3>,
    /// Indices of the corners of each triangle. Welded corners have equal indices.
    pub triangles: Vec<[u32; 3]>,
}

/// Welds corners: each becomes the first point before it that is nearer than [`WELD_M`].
pub fn weld(triangles: &[[DVec3; 3]]) -> Welded {
    let mut points: Vec<DVec3> = Vec::new();
    // Each cell stores its last point, and each point its predecessor in the cell.
    let mut last: HashMap<[i64; 3], u32> = HashMap::new();
    let mut before: Vec<Option<u32>> = Vec::new();
    let mut number = |p: DVec3| {
        let (from, to) = (cell(p - WELD_M), cell(p + WELD_M));
        let mut found: Option<u32> = None;
        for x in from[0]..=to[0] {
            for y in from[1]..=to[1] {
                for z in from[2]..=to[2] {
                    let mut at = last.get(&[x, y, z]).copied();
                    while let Some(k) = at {
                        if points[k as usize].distance(p) < WELD_M && found.is_none_or(|least| k < least) {
                            found = Some(k);
                        }
                        at = before[k as usize];
                    }
                }
            }
        }
        found.unwrap_or_else(|| {
            let new = points.len() as u32;
            points.push(p);
            before.push(last.insert(cell(p), new));
            new
        })
    };
    let triangles = triangles.iter().map(|corners| corners.map(&mut number)).collect();
    Welded { points, triangles }
}

fn cell(p: DVec3) -> [i64; 3] {
    (p / CELL_M).to_array().map(|x| x.floor() as i64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_corners_within_the_weld_distance_are_welded_also_across_grid_cells() {
        for shift in 0..50 {
            let p = DVec3::new(0.3, -0.2, 0.1) + DVec3::splat(f64::from(shift) * 0.31 * WELD_M);
            for out in [DVec3::X, -DVec3::Y, DVec3::ONE.normalize(), DVec3::new(-0.6, 0.0, 0.8)] {
                let (near, far) = (p + out * 0.9 * WELD_M, p + out * 1.1 * WELD_M);
                let welded = weld(&[[p, near, far], [far, p, DVec3::ZERO]]);
                assert_eq!(welded.triangles, [[0, 0, 1], [1, 0, 2]]);
                assert_eq!(welded.points, [p, far, DVec3::ZERO]);
            }
        }
    }
}
