//! A bounding volume hierarchy: finds the boxes near a point or on a line without a test of every box.
//!
//! Boxes are split at the median of their centres along the longest axis until a few are left. Nodes are
//! stored in depth-first order, each with the index at which a traversal continues when it skips the node.

use glam::Vec3;

/// Maximum number of boxes in a leaf.
const LEAF: usize = 4;
/// Relative slack of distance tests: by rounding, a box may appear farther than its content.
const SLACK: f32 = 1e-5;

/// An axis-aligned bounding box.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Aabb {
    /// Corner with the smallest coordinates.
    pub low: Vec3,
    /// The opposite corner.
    pub high: Vec3,
}

impl Aabb {
    /// The smallest box around points.
    pub fn around(points: impl IntoIterator<Item = Vec3>) -> Self {
        let nothing = Self { low: Vec3::INFINITY, high: Vec3::NEG_INFINITY };
        let wider = |aabb: Self, p| Self { low: aabb.low.min(p), high: aabb.high.max(p) };
        points.into_iter().fold(nothing, wider)
    }

    /// Square of the distance from a point to the box; 0 inside.
    pub fn distance2(&self, p: Vec3) -> f32 {
        let outside = (self.low - p).max(p - self.high).max(Vec3::ZERO);
        outside.dot(outside)
    }
}

/// A bounding volume hierarchy over numbered boxes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Bvh {
    nodes: Vec<Node>,
    /// Numbers of the boxes, in the order of the leaves.
    order: Vec<u32>,
}

#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Node {
    /// Bounding box of all boxes below.
    pub(crate) aabb: Aabb,
    /// Node at which a traversal continues when it skips this one.
    pub(crate) next: u32,
    /// First box in the order, and number of boxes; 0 in an inner node.
    pub(crate) first: u32,
    pub(crate) count: u32,
}

impl Bvh {
    /// A hierarchy over boxes, which are numbered from 0.
    pub fn new(aabbs: &[Aabb]) -> Self {
        let mut bvh = Self { nodes: Vec::new(), order: (0..aabbs.len() as u32).collect() };
        if !aabbs.is_empty() {
            bvh.grow(aabbs, 0, aabbs.len());
        }
        bvh
    }

    fn grow(&mut self, aabbs: &[Aabb], from: usize, to: usize) {
        let part = &mut self.order[from..to];
        let of = |k: u32| &aabbs[k as usize];
        let corners = part.iter().flat_map(|&k| [of(k).low, of(k).high]);
        let aabb = Aabb::around(corners);
        let at = self.nodes.len();
        let halves = part.len() > LEAF;
        let count = if halves { 0 } else { part.len() as u32 };
        self.nodes.push(Node { aabb, next: 0, first: from as u32, count });
        if halves {
            let centre = |k: u32| of(k).low + of(k).high;
            let centres = Aabb::around(part.iter().map(|&k| centre(k)));
            let axis = (centres.high - centres.low).max_position();
            let middle = part.len() / 2;
            part.select_nth_unstable_by(middle, |&a, &b| {
                centre(a)[axis].total_cmp(&centre(b)[axis]).then(a.cmp(&b))
            });
            self.grow(aabbs, from, from + middle);
            self.grow(aabbs, from + middle, to);
        }
        self.nodes[at].next = self.nodes.len() as u32;
    }

    /// Its nodes, and the numbers of the boxes in the order of the leaves, for traversal in a kernel.
    #[cfg(feature = "gpu")]
    pub(crate) fn parts(&self) -> (&[Node], &[u32]) {
        (&self.nodes, &self.order)
    }

    /// Calls `visit` with the number of every box in leaves accepted by `enters`, as are all nodes above.
    /// Boxes that `enters` would refuse may be among them.
    pub fn visit(&self, enters: impl Fn(&Aabb) -> bool, visit: impl FnMut(u32)) {
        let mut visit = visit;
        let mut at = 0;
        while let Some(node) = self.nodes.get(at) {
            if enters(&node.aabb) {
                let first = node.first as usize;
                self.order[first..first + node.count as usize].iter().for_each(|&k| visit(k));
                at += 1;
            } else {
                at = node.next as usize;
            }
        }
    }

    /// Calls `visit` with the number of every box within `reach` of a point, and possibly of some beyond.
    pub fn within(&self, p: Vec3, reach: f32, visit: impl FnMut(u32)) {
        self.visit(|aabb| aabb.distance2(p) <= reach * reach * (1.0 + SLACK), visit);
    }

    /// Number of the element nearest to a point, the lowest of several. `distance2` measures the content of a
    /// box.
    pub fn nearest(&self, p: Vec3, distance2: impl Fn(u32) -> f32) -> Option<u32> {
        let mut best = (f32::INFINITY, u32::MAX);
        // Median splits give at most 32 levels.
        let (mut waiting, mut left) = ([0u32; 64], usize::from(!self.nodes.is_empty()));
        while left > 0 {
            left -= 1;
            let at = waiting[left] as usize;
            let node = &self.nodes[at];
            if node.aabb.distance2(p) > best.0 * (1.0 + SLACK) {
                continue;
            }
            if node.count > 0 {
                let first = node.first as usize;
                let measured =
                    self.order[first..first + node.count as usize].iter().map(|&k| (distance2(k), k));
                best = measured.fold(best, |best, this| if this < best { this } else { best });
            } else {
                // Push the nearer half last, so that it is popped first.
                let halves = [at + 1, self.nodes[at + 1].next as usize];
                let [a, b] = halves.map(|half| self.nodes[half].aabb.distance2(p));
                let order = if a <= b { [halves[1], halves[0]] } else { halves };
                for half in order {
                    waiting[left] = half as u32;
                    left += 1;
                }
            }
        }
        (best.1 != u32::MAX).then_some(best.1)
    }
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;

    use super::*;

    /// Boxes of a lattice of 30 × 30 × 30, each 0.6 wide.
    fn boxes() -> Vec<Aabb> {
        let low = |k: u32| Vec3::new((k % 30) as f32, (k / 30 % 30) as f32, (k / 900) as f32);
        (0..27_000).map(low).map(|low| Aabb { low, high: low + 0.6 }).collect()
    }

    #[test]
    fn bvh_finds_all_boxes_within_reach_and_visits_few() {
        let (boxes, looked) = (boxes(), Cell::new(0));
        let bvh = Bvh::new(&boxes);
        for p in [Vec3::new(3.3, 17.9, 8.2), Vec3::splat(-0.5), Vec3::new(15.0, 40.0, 15.0)] {
            let reach = 1.5f32;
            let mut found = Vec::new();
            bvh.visit(
                |aabb| {
                    looked.set(looked.get() + 1);
                    aabb.distance2(p) <= reach * reach
                },
                |k| found.push(k),
            );
            found.retain(|&k| boxes[k as usize].distance2(p) <= reach * reach);
            found.sort_unstable();
            let all: Vec<u32> =
                (0..27_000).filter(|&k| boxes[k as usize].distance2(p) <= reach * reach).collect();
            assert_eq!(found, all);
            let measured = |k: u32| {
                looked.set(looked.get() + 1);
                boxes[k as usize].distance2(p)
            };
            let nearest = bvh.nearest(p, measured).expect("27,000 boxes");
            let least = (0..27_000).min_by(|&a, &b| measured(a).total_cmp(&measured(b)).then(a.cmp(&b)));
            looked.set(looked.get() - 2 * 26_999);
            assert_eq!(Some(nearest), least);
        }
        assert!((50..1500).contains(&looked.get()), "looked at {}", looked.get());
        assert_eq!(Bvh::new(&[]).nearest(Vec3::ZERO, |_| 0.0), None);
    }
}
