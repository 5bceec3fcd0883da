//! Contours of a function on a regular grid, by marching squares.
//!
//! Crates for contours return rings that follow the edge of the grid, for filled areas. A boundary ends at the edge.

use std::collections::BTreeMap;

/// An edge of the grid: its first node, and whether it leads along the first coordinate.
type Edge = (usize, usize, bool);

/// Lines along which the function is zero, in coordinates from 0 to 1. `values` are those on a square grid, the last coordinate
/// varying fastest.
pub(super) fn lines(values: &[f64], steps: usize) -> Vec<Vec<(f64, f64)>> {
    let value = |i: usize, j: usize| values[i * steps + j];
    let mut segments = Vec::new();
    for i in 0..steps - 1 {
        for j in 0..steps - 1 {
            // Corners and edges in turn around the cell.
            let corners = [value(i, j), value(i + 1, j), value(i + 1, j + 1), value(i, j + 1)];
            let edges: [Edge; 4] = [(i, j, true), (i + 1, j, false), (i, j + 1, true), (i, j, false)];
            let is_crossed = |edge: &usize| (corners[*edge] > 0.0) != (corners[(*edge + 1) % 4] > 0.0);
            let crossed: Vec<usize> = (0..4).filter(is_crossed).collect();
            match crossed.as_slice() {
                [one, other] => segments.push((edges[*one], edges[*other])),
                [a, b, c, d] => {
                    // A saddle: the middle decides which corners belong together.
                    let middle = corners.iter().sum::<f64>();
                    let is_like_first = (middle > 0.0) == (corners[0] > 0.0);
                    let pairs = if is_like_first { [(a, b), (c, d)] } else { [(a, d), (b, c)] };
                    segments.extend(pairs.map(|(one, other)| (edges[*one], edges[*other])));
                }
                _ => {}
            }
        }
    }
    let place = |(i, j, is_first): Edge| {
        let (from, to) = (value(i, j), if is_first { value(i + 1, j) } else { value(i, j + 1) });
        let share = from / (from - to);
        let (x, y) = if is_first { (i as f64 + share, j as f64) } else { (i as f64, j as f64 + share) };
        (x / (steps - 1) as f64, y / (steps - 1) as f64)
    };
    chains(&segments).into_iter().map(|chain| chain.into_iter().map(place).collect()).collect()
}

/// Joins segments at their common edges. Open chains come first, then rings.
fn chains(segments: &[(Edge, Edge)]) -> Vec<Vec<Edge>> {
    let mut at: BTreeMap<Edge, Vec<usize>> = BTreeMap::new();
    for (index, (one, other)) in segments.iter().enumerate() {
        at.entry(*one).or_default().push(index);
        at.entry(*other).or_default().push(index);
    }
    let mut is_used = vec![false; segments.len()];
    let mut follow = |start: Edge| {
        let mut chain = vec![start];
        let mut end = start;
        while let Some(next) = at[&end].iter().copied().find(|index| !is_used[*index]) {
            is_used[next] = true;
            let (one, other) = segments[next];
            end = if one == end { other } else { one };
            chain.push(end);
        }
        chain
    };
    let ends = at.iter().filter(|(_, around)| around.len() == 1);
    let starts: Vec<Edge> = ends.chain(at.iter()).map(|(edge, _)| *edge).collect();
    starts.into_iter().map(&mut follow).filter(|chain| chain.len() > 1).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grid(steps: usize, function: impl Fn(f64, f64) -> f64) -> Vec<f64> {
        let at = |index: usize| index as f64 / (steps - 1) as f64;
        (0..steps * steps).map(|index| function(at(index / steps), at(index % steps))).collect()
    }

    #[test]
    fn contour_of_a_plane_is_one_open_line() {
        let lines = lines(&grid(11, |x, y| x + 0.5 * y - 0.6), 11);
        assert_eq!(lines.len(), 1);
        for (x, y) in &lines[0] {
            assert!((x + 0.5 * y - 0.6).abs() < 1e-12, "{x}, {y}");
        }
        let ends = [lines[0][0], lines[0][lines[0].len() - 1]];
        assert!(ends.iter().all(|(_, y)| *y == 0.0 || *y == 1.0), "{ends:?}");
    }

    #[test]
    fn contour_of_a_hill_is_a_ring_and_of_a_saddle_two_lines() {
        let ring = lines(&grid(33, |x, y| 0.09 - (x - 0.5).powi(2) - (y - 0.5).powi(2)), 33);
        assert_eq!(ring.len(), 1);
        assert_eq!(ring[0].first(), ring[0].last());
        for (x, y) in &ring[0] {
            assert!(((x - 0.5).hypot(y - 0.5) - 0.3).abs() < 0.002, "{x}, {y}");
        }
        assert_eq!(lines(&grid(10, |x, y| (x - 0.5) * (y - 0.5) - 0.01), 10).len(), 2);
        assert_eq!(lines(&grid(2, |x, y| (x - 0.5) * (y - 0.5) - 0.01), 2).len(), 2);
        assert!(lines(&grid(5, |_, _| 1.0), 5).is_empty());
    }
}
