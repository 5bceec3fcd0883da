//! The search for pairs: bounding boxes of bodies, then of blocks, then sub-particles.

use glam::IVec3;

use crate::cpu::fast::instructions::arrays::{LaneIndices, Lanes, Lanes3, WIDTH, grown, reduced};
use crate::cpu::fast::instructions::set::LaneOps;
use crate::cpu::fast::storage::body::Body;
use crate::cpu::fast::storage::bounds::{BodyBounds, FixedAabb, LocalAabb};
use crate::cpu::fast::storage::particles::BodyParticles;
use crate::engine::frame::Frame;

/// Blocks farther from a body than this many skins beyond the cutoff are skipped.
const FAR_SKINS: f32 = 1.5;

/// Pairs of bodies with boxes within `reach` metres, and each body with itself; sorted.
pub(crate) fn overlapping_bodies(aabbs: &[FixedAabb], reach: f32, frame: &Frame) -> Vec<[u32; 2]> {
    let mut order: Vec<u32> = (0..aabbs.len() as u32).collect();
    order.sort_by_key(|&body| (aabbs[body as usize].low.x, body));
    let mut pairs = Vec::new();
    for (k, &a) in order.iter().enumerate() {
        pairs.push([a, a]);
        let far = aabbs[a as usize].grown(reach, frame).high.x;
        let near = order[k + 1..].iter().take_while(|&&b| aabbs[b as usize].low.x <= far);
        let close = near.filter(|&&b| aabbs[a as usize].gap(&aabbs[b as usize], frame) <= reach);
        pairs.extend(close.map(|&b| [a.min(b), a.max(b)]));
    }
    pairs.sort_unstable();
    pairs
}

/// Parameters of the pair search.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SearchParams {
    /// Distances of centres up to which a contact can hold, in metres: between bodies, and within a body.
    pub(crate) cutoffs: [f32; 2],
    /// Verlet skins of the lists, in metres: the same.
    pub(crate) skins: [f32; 2],
    /// The same for candidates.
    pub(crate) outer_skins: [f32; 2],
}

/// Two bodies, or a body with itself, in metres relative to the low corner of the second.
#[derive(Clone, Copy, Debug)]
struct SearchSides<'a> {
    points: [&'a BodyParticles; 2],
    at: [&'a BodyBounds; 2],
    from: IVec3,
    unit_m: f32,
    /// Square of the search radius, in m².
    reach2: f32,
    /// Half the period along y and the period, in metres; 0 without periodicity.
    period: [f32; 2],
    is_self: bool,
}

impl<'a> SearchSides<'a> {
    fn new(
        points: [&'a BodyParticles; 2],
        at: [&'a BodyBounds; 2],
        reach: f32,
        frame: &Frame,
        is_self: bool,
    ) -> Self {
        let unit_m = frame.unit_m;
        let period = frame.period_y as f32 * unit_m;
        let from = at[1].whole.low;
        Self { points, at, from, unit_m, reach2: reach * reach, period: [0.5 * period, period], is_self }
    }

    fn is_periodic(&self) -> bool {
        self.period[1] != 0.0
    }

    /// Bounding box of the second body.
    fn second_box(&self) -> LocalAabb {
        let size = self.at[1].whole.high.wrapping_sub(self.from).as_vec3() * self.unit_m;
        [[0.0; 3], size.to_array()]
    }

    /// A row of block boxes of one side, in the order of slots, and their number.
    #[inline(always)]
    fn row<S: LaneOps>(&self, simd: S, side: usize, g: usize) -> ([Lanes3; 2], usize) {
        let ([[x, y, z], [u, v, w]], count) = self.at[side].row(simd, g, self.from, self.unit_m);
        let lows = [in_slot_order(simd, &x), in_slot_order(simd, &y), in_slot_order(simd, &z)];
        let highs = [in_slot_order(simd, &u), in_slot_order(simd, &v), in_slot_order(simd, &w)];
        ([lows, highs], count)
    }

    /// A block of one side, in the order of slots.
    #[inline(always)]
    fn block<S: LaneOps>(&self, simd: S, side: usize, b: usize) -> Lanes3 {
        let [x, y, z] = self.points[side].in_metres(simd, b, self.from, self.unit_m);
        [in_slot_order(simd, &x), in_slot_order(simd, &y), in_slot_order(simd, &z)]
    }
}

/// Searches the pairs of two bodies.
#[derive(Debug, Default)]
pub(crate) struct PairSearch {
    /// Blocks of the second body near a block of the first, each with the slots of the first block near it.
    near_blocks: Vec<(usize, u16)>,
    /// Boxes of the second body's blocks, by slot, and their number per row.
    rows: Vec<([Lanes3; 2], usize)>,
    /// Sub-particles of the second body, loaded on demand.
    theirs: Vec<Lanes3>,
    /// Partners found for each sub-particle of a block, with room for writes of whole registers.
    seconds: Vec<u32>,
    /// Result of the last search: pairs of slots, sorted.
    pub(crate) found: Vec<[u32; 2]>,
}

impl PairSearch {
    /// Finds the pairs of two bodies, or of a body with itself, within cutoff and skin. Returns a lower bound
    /// of the distance of all other pairs, in metres.
    #[inline(always)]
    pub(crate) fn search<S: LaneOps>(
        &mut self,
        simd: S,
        search: &SearchParams,
        frame: &Frame,
        [a, b]: [&Body; 2],
        is_self: bool,
    ) -> f32 {
        let skin = search.outer_skins[usize::from(is_self)];
        let cutoff = search.cutoff(a, is_self);
        let (listed, far) = (cutoff + skin, cutoff + FAR_SKINS * skin);
        self.found.clear();
        let at = [&a.bounds, &b.bounds];
        let gap = if is_self { 0.0 } else { at[0].whole.gap(&at[1].whole, frame) };
        if gap > far {
            return gap;
        }
        let sides = SearchSides::new([&a.points, &b.points], at, listed, frame, is_self);
        let min_gap = self.find(simd, far, &sides);
        if is_self {
            a.exclude_bonded(&mut self.found);
        }
        min_gap
    }

    /// Finds the pairs within the search radius, among blocks within `far` metres of the other body. Returns
    /// a lower bound of the distance of all other pairs: at most the search radius, once any pair was tested
    /// by itself.
    #[inline(always)]
    fn find<S: LaneOps>(&mut self, simd: S, far: f32, sides: &SearchSides<'_>) -> f32 {
        self.theirs.clear();
        self.rows.clear();
        let mut min_gap2 = Lanes([f32::INFINITY; WIDTH]);
        let second_box = sides.second_box();
        for g in 0..sides.at[0].rows() {
            let (row, count) = sides.row(simd, 0, g);
            let gaps = gaps2(&second_box, &row, sides.is_periodic(), count);
            let mut near = below_limit(simd, &gaps, far * far, &mut min_gap2);
            if near != 0 && self.rows.is_empty() {
                for g in 0..sides.at[1].rows() {
                    self.rows.push(sides.row(simd, 1, g));
                }
            }
            while near != 0 {
                self.search_block(simd, g * WIDTH + near.trailing_zeros() as usize, sides, &mut min_gap2);
                near &= near - 1;
            }
        }
        reduced(min_gap2.0, |a, b| if b < a { b } else { a }).sqrt()
    }

    /// The same for one block of the first body.
    #[inline(always)]
    fn search_block<S: LaneOps>(&mut self, simd: S, a: usize, sides: &SearchSides<'_>, min_gap2: &mut Lanes) {
        let SearchSides { at: [first, _], from, unit_m, reach2, is_self, .. } = *sides;
        let is_periodic = sides.is_periodic();
        let (span, xa) = (first.local_aabb(a, from, unit_m), sides.block(simd, 0, a));
        self.near_blocks.clear();
        for (g, (row, count)) in self.rows.iter().enumerate() {
            let gaps = gaps2(&span, row, is_periodic, *count);
            let mut boxes = below_limit(simd, &gaps, reach2, min_gap2);
            while boxes != 0 {
                let slot = boxes.trailing_zeros() as usize;
                let b = g * WIDTH + slot;
                boxes &= boxes - 1;
                // Within a body only pairs with i < j count.
                if is_self && b < a {
                    continue;
                }
                let [[x, y, z], [u, v, w]] = row;
                let around = [[x.0[slot], y.0[slot], z.0[slot]], [u.0[slot], v.0[slot], w.0[slot]]];
                let from_box = gaps2(&around, &[xa, xa], is_periodic, WIDTH);
                let near_box = below_limit(simd, &from_box, reach2, min_gap2);
                if near_box != 0 {
                    self.near_blocks.push((b, near_box));
                }
            }
        }
        let Self { near_blocks, theirs, seconds, found, .. } = self;
        if near_blocks.is_empty() {
            return;
        }
        if theirs.is_empty() {
            for b in 0..sides.points[1].blocks() {
                theirs.push(sides.block(simd, 1, b));
            }
        }
        // Tests of single pairs do not report their distance.
        min_gap2.0.iter_mut().for_each(|min_gap2| *min_gap2 = min_gap2.min(reach2));
        let room = (near_blocks.len() + 1) * WIDTH;
        let seconds = grown(seconds, room * WIDTH);
        let mut counts = [0; WIDTH];
        for &(b, mut near) in &*near_blocks {
            let xb = &theirs[b];
            while near != 0 {
                let slot = near.trailing_zeros() as usize;
                near &= near - 1;
                let x = [xa[0].0[slot], xa[1].0[slot], xa[2].0[slot]];
                let distances2 = distances2_from_point(xb, x, sides.period);
                let later = if is_self && b == a { (!1u32 << slot) as u16 } else { u16::MAX };
                let hits = simd.le_bits(&distances2, reach2) & later;
                let mut hit = simd.compress(&LaneIndices::IDENTITY, hits);
                for k in 0..WIDTH {
                    hit.0[k] += (b * WIDTH) as u32;
                }
                seconds[slot * room + counts[slot]..][..WIDTH].copy_from_slice(&hit.0);
                counts[slot] += hits.count_ones() as usize;
            }
        }
        let mut next = found.len();
        found.resize(next + counts.iter().sum::<usize>(), [0; 2]);
        for slot in 0..WIDTH {
            let (i, js) = ((a * WIDTH + slot) as u32, &seconds[slot * room..][..counts[slot]]);
            for (pair, &j) in found[next..].iter_mut().zip(js) {
                *pair = [i, j];
            }
            next += counts[slot];
        }
    }
}

/// Lanes in the order of slots.
#[inline(always)]
fn in_slot_order<S: LaneOps>(simd: S, lanes: &Lanes) -> Lanes {
    simd.masked_permute(lanes, &LaneIndices::TRANSPOSED, u16::MAX)
}

/// Bits of the squared distances of at most `reach2`. The minimum of the others goes into `min_gap2`.
#[inline(always)]
fn below_limit<S: LaneOps>(simd: S, distances2: &Lanes, reach2: f32, min_gap2: &mut Lanes) -> u16 {
    for k in 0..WIDTH {
        let d = distances2.0[k];
        let beyond = if d > reach2 { d } else { f32::INFINITY };
        min_gap2.0[k] = if beyond < min_gap2.0[k] { beyond } else { min_gap2.0[k] };
    }
    simd.le_bits(distances2, reach2)
}

/// Squares of the distances of a block's sub-particles from a point, in m².
#[inline(always)]
fn distances2_from_point(block: &Lanes3, [x, y, z]: [f32; 3], [half, period]: [f32; 2]) -> Lanes {
    let mut distance2 = Lanes::ZERO;
    let mut across = Lanes::ZERO;
    for k in 0..WIDTH {
        across.0[k] = block[1].0[k] - y;
    }
    if period != 0.0 {
        for dy in &mut across.0 {
            *dy = if *dy > half { *dy - period } else { *dy };
            *dy = if *dy < -half { *dy + period } else { *dy };
        }
    }
    for k in 0..WIDTH {
        let (dx, dy, dz) = (block[0].0[k] - x, across.0[k], block[2].0[k] - z);
        distance2.0[k] = dx * dx + dy * dy + dz * dz;
    }
    distance2
}

/// Squared gaps between a box and `count` others in m², infinity beyond. A periodic y is ignored.
#[inline(always)]
fn gaps2([low, high]: &LocalAabb, [lows, highs]: &[Lanes3; 2], periodic_y: bool, count: usize) -> Lanes {
    let mut gap2 = Lanes::ZERO;
    add_beyond2(&mut gap2, [low[0], high[0]], [&lows[0], &highs[0]]);
    if !periodic_y {
        add_beyond2(&mut gap2, [low[1], high[1]], [&lows[1], &highs[1]]);
    }
    add_beyond2(&mut gap2, [low[2], high[2]], [&lows[2], &highs[2]]);
    if count < WIDTH {
        for k in 0..WIDTH {
            gap2.0[k] = if k < count { gap2.0[k] } else { f32::INFINITY };
        }
    }
    gap2
}

/// Adds the squared gaps along one axis.
#[inline(always)]
fn add_beyond2(to: &mut Lanes, [low, high]: [f32; 2], [lows, highs]: [&Lanes; 2]) {
    for k in 0..WIDTH {
        let (below, above) = (lows.0[k] - high, low - highs.0[k]);
        let d = if above > below { above } else { below };
        let d = if d > 0.0 { d } else { 0.0 };
        to.0[k] += d * d;
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::cpu::fast::instructions::set::{InstructionSet, SimdTask};
    use crate::cpu::fast::storage::particles::{random_bodies, slot_of};

    struct Look<'a>(&'a mut PairSearch, SearchSides<'a>);

    impl SimdTask for Look<'_> {
        type Output = f32;

        #[inline(always)]
        fn run<S: LaneOps>(self, simd: S) -> f32 {
            let Self(pair_search, sides) = self;
            pair_search.found.clear();
            pair_search.find(simd, 1.5 * sides.reach2.sqrt(), &sides)
        }
    }

    /// All pairs of two bodies, by slots, with distances in metres; pairs within a body once.
    fn all(frame: &Frame, [a, b]: [&BodyParticles; 2], is_self: bool) -> Vec<([u32; 2], f64)> {
        let mut all = Vec::new();
        for i in 0..a.count {
            for j in 0..b.count {
                let mut d = b.particle(j).position.wrapping_sub(a.particle(i).position);
                d.y = frame.nearest_image(d.y);
                let pair = [slot_of(i as u32), slot_of(j as u32)];
                if !is_self || pair[0] < pair[1] {
                    all.push((pair, (d.as_dvec3() * f64::from(frame.unit_m)).length()));
                }
            }
        }
        all.sort_unstable_by_key(|(pair, _)| *pair);
        all
    }

    fn frame(periodic_y: bool) -> Frame {
        Frame::new(DVec3::splat(-0.1), DVec3::splat(0.1), periodic_y)
    }

    #[test]
    fn pair_search_finds_all_pairs_within_reach_in_order() {
        const REACH: f32 = 0.02;
        for periodic_y in [false, true] {
            // Every block spans its whole body, so that each is near each block of the other: one row of
            // them, and five.
            let bodies = [(157, DVec3::new(0.02, 0.05, 0.0), 0.1), (1100, DVec3::new(0.0, 0.06, 0.01), 0.1)];
            let frame = frame(periodic_y);
            let bodies = random_bodies(frame, &bodies);
            for [a, b] in [[0, 1], [1, 0], [0, 0], [1, 1]] {
                let points = [&bodies[a], &bodies[b]];
                let at = points.map(BodyBounds::of);
                let all = all(&frame, points, a == b);
                // Either result is right where rounding decides.
                let [surely, perhaps] = [-1e-6, 1e-6].map(|by| {
                    let near = all.iter().filter(|(_, d)| *d <= f64::from(REACH) + by);
                    near.map(|(pair, _)| *pair).collect::<Vec<_>>()
                });
                assert!(surely.len() > 200);
                for instructions in InstructionSet::available() {
                    let mut pair_search = PairSearch::default();
                    let sides = SearchSides::new(points, at.each_ref(), REACH, &frame, a == b);
                    instructions.run(Look(&mut pair_search, sides));
                    assert!(pair_search.found.is_sorted(), "{}", instructions.name());
                    assert!(surely.iter().all(|pair| pair_search.found.binary_search(pair).is_ok()));
                    assert!(pair_search.found.iter().all(|pair| perhaps.binary_search(pair).is_ok()));
                }
            }
        }
    }

    #[test]
    fn pair_search_without_pairs_returns_a_lower_bound_of_the_distance() {
        // Gaps below and above a block's size, and one body inside the other.
        let near_blocks = |gap: f64| [(40, DVec3::ZERO, 0.04), (50, DVec3::X * (0.04 + gap), 0.04)];
        let within = [(16, DVec3::ZERO, 0.01), (16, DVec3::ZERO, 0.06)];
        for (bodies, reach) in [(near_blocks(0.01), 0.004), (near_blocks(0.03), 0.02), (within, 0.001)] {
            let frame = frame(false);
            let bodies = random_bodies(frame, &bodies);
            let points = [&bodies[0], &bodies[1]];
            let at = points.map(BodyBounds::of);
            let nearest = all(&frame, points, false).iter().map(|(_, d)| *d).fold(f64::INFINITY, f64::min);
            assert!(nearest > f64::from(reach), "nothing is to be found");
            let mut pair_search = PairSearch::default();
            let sides = SearchSides::new(points, at.each_ref(), reach, &frame, false);
            let bound = InstructionSet::widest().run(Look(&mut pair_search, sides));
            assert_eq!(pair_search.found, [[0; 2]; 0]);
            assert!(f64::from(bound) <= nearest + 1e-6, "{bound} m, {nearest} m");
            assert!(bound >= reach, "{bound} m are no use");
        }
    }
}
