//! The search for pairs of two bodies that may touch: first boxes of bodies, then boxes of blocks, then sub-particles.

use glam::IVec3;

use super::body::Body;
use super::instructions::Wide;
use super::memory::{Lanes, Lanes3, Places, WIDTH, folded, space};
use super::points::Points;
use super::whereabouts::{Extent, Span, Whereabouts};
use crate::engine::frame::Frame;

/// Blocks that are further from a body than this many skins beyond reach are passed over.
const FAR: f32 = 1.5;

/// Pairs of bodies whose boxes come within `reach` metres, and each with itself; sorted.
pub(super) fn near_each_other(extents: &[Extent], reach: f32, frame: &Frame) -> Vec<[u32; 2]> {
    let mut order: Vec<u32> = (0..extents.len() as u32).collect();
    order.sort_by_key(|&body| (extents[body as usize].low.x, body));
    let mut pairs = Vec::new();
    for (k, &a) in order.iter().enumerate() {
        pairs.push([a, a]);
        let far = extents[a as usize].grown(reach, frame).high.x;
        let near = order[k + 1..].iter().take_while(|&&b| extents[b as usize].low.x <= far);
        let close = near.filter(|&&b| extents[a as usize].gap(&extents[b as usize], frame) <= reach);
        pairs.extend(close.map(|&b| [a.min(b), a.max(b)]));
    }
    pairs.sort_unstable();
    pairs
}

/// What a search for pairs needs to know.
#[derive(Clone, Copy, Debug)]
pub(super) struct Search {
    /// Distance of centres within which a contact can hold, in metres.
    pub(super) reach: f32,
    /// What lists cover beyond, in metres: between bodies, and within one.
    pub(super) skins: [f32; 2],
    /// How far beyond that the rarer search for candidates goes, in metres.
    pub(super) outer_skins: [f32; 2],
}

/// Two bodies, or one and itself, as they are searched: in metres from the lowest corner of the second.
#[derive(Clone, Copy, Debug)]
struct Two<'a> {
    points: [&'a Points; 2],
    at: [&'a Whereabouts; 2],
    from: IVec3,
    unit_m: f32,
    /// Square of the distance within which pairs are wanted, in m².
    reach2: f32,
    /// Half the period along y and all of it, in metres; 0 where there is none.
    period: [f32; 2],
    alone: bool,
}

impl<'a> Two<'a> {
    fn new(
        points: [&'a Points; 2],
        at: [&'a Whereabouts; 2],
        reach: f32,
        frame: &Frame,
        alone: bool,
    ) -> Self {
        let unit_m = frame.unit_m;
        let period = frame.period_y as f32 * unit_m;
        let from = at[1].whole.low;
        Self { points, at, from, unit_m, reach2: reach * reach, period: [0.5 * period, period], alone }
    }

    fn is_periodic(&self) -> bool {
        self.period[1] != 0.0
    }

    /// The box of the second.
    fn around_second(&self) -> Span {
        let size = self.at[1].whole.high.wrapping_sub(self.from).as_vec3() * self.unit_m;
        [[0.0; 3], size.to_array()]
    }

    /// A row of boxes of the first or of the second, in the order of places, and how many there are.
    #[inline(always)]
    fn row<S: Wide>(&self, simd: S, side: usize, g: usize) -> ([Lanes3; 2], usize) {
        let ([[x, y, z], [u, v, w]], count) = self.at[side].row(simd, g, self.from, self.unit_m);
        let lows = [by_place(simd, &x), by_place(simd, &y), by_place(simd, &z)];
        let highs = [by_place(simd, &u), by_place(simd, &v), by_place(simd, &w)];
        ([lows, highs], count)
    }

    /// A block of the first or of the second, in the order of places.
    #[inline(always)]
    fn block<S: Wide>(&self, simd: S, side: usize, b: usize) -> Lanes3 {
        let [x, y, z] = self.points[side].in_metres(simd, b, self.from, self.unit_m);
        [by_place(simd, &x), by_place(simd, &y), by_place(simd, &z)]
    }
}

/// Finds pairs that may touch.
#[derive(Debug, Default)]
pub(super) struct Finder {
    /// Blocks of the second body that are near one of the first, and which places of that one are near each.
    beside: Vec<(usize, u16)>,
    /// The boxes of the second body's blocks, by place, and how many there are in each row.
    rows: Vec<([Lanes3; 2], usize)>,
    /// The second body, as it is searched; empty until it is asked for.
    theirs: Vec<Lanes3>,
    /// What is found for each sub-particle of a block, with room to write whole registers.
    seconds: Vec<u32>,
    /// What the last search has found: pairs of places, sorted.
    pub(super) found: Vec<[u32; 2]>,
}

impl Finder {
    /// Finds the pairs of two bodies, or of one and itself, that come within reach and skin. Returns a distance, in metres, that
    /// those which do not are not below.
    #[inline(always)]
    pub(super) fn search<S: Wide>(
        &mut self,
        simd: S,
        search: &Search,
        frame: &Frame,
        [a, b]: [&Body; 2],
        alone: bool,
    ) -> f32 {
        let skin = search.outer_skins[usize::from(alone)];
        let (listed, far) = (search.reach + skin, search.reach + FAR * skin);
        self.found.clear();
        let at = [&a.whereabouts, &b.whereabouts];
        let gap = if alone { 0.0 } else { at[0].whole.gap(&at[1].whole, frame) };
        if gap > far {
            return gap;
        }
        let two = Two::new([&a.points, &b.points], at, listed, frame, alone);
        let apart = self.find(simd, far, &two);
        if alone {
            a.leave_out_joined(&mut self.found);
        }
        apart
    }

    /// Pairs that come within reach, among blocks within `far` metres of the other body. Returns a distance that no other pair is
    /// below; it is no more than the reach where any was looked at by itself.
    #[inline(always)]
    fn find<S: Wide>(&mut self, simd: S, far: f32, two: &Two<'_>) -> f32 {
        self.theirs.clear();
        self.rows.clear();
        let mut apart2 = Lanes([f32::INFINITY; WIDTH]);
        let around_second = two.around_second();
        for g in 0..two.at[0].rows() {
            let (row, count) = two.row(simd, 0, g);
            let gaps = gaps2(&around_second, &row, two.is_periodic(), count);
            let mut near = within(simd, &gaps, far * far, &mut apart2);
            if near != 0 && self.rows.is_empty() {
                for g in 0..two.at[1].rows() {
                    self.rows.push(two.row(simd, 1, g));
                }
            }
            while near != 0 {
                self.find_of(simd, g * WIDTH + near.trailing_zeros() as usize, two, &mut apart2);
                near &= near - 1;
            }
        }
        folded(apart2.0, |a, b| if b < a { b } else { a }).sqrt()
    }

    /// The same of one block of the first body.
    #[inline(always)]
    fn find_of<S: Wide>(&mut self, simd: S, a: usize, two: &Two<'_>, apart2: &mut Lanes) {
        let Two { at: [first, _], from, unit_m, reach2, alone, .. } = *two;
        let is_periodic = two.is_periodic();
        let (span, xa) = (first.span(a, from, unit_m), two.block(simd, 0, a));
        self.beside.clear();
        for (g, (row, count)) in self.rows.iter().enumerate() {
            let gaps = gaps2(&span, row, is_periodic, *count);
            let mut boxes = within(simd, &gaps, reach2, apart2);
            while boxes != 0 {
                let place = boxes.trailing_zeros() as usize;
                let b = g * WIDTH + place;
                boxes &= boxes - 1;
                // Of a body and itself only pairs with i < j count, once.
                if alone && b < a {
                    continue;
                }
                let [[x, y, z], [u, v, w]] = row;
                let around = [[x.0[place], y.0[place], z.0[place]], [u.0[place], v.0[place], w.0[place]]];
                let from_box = gaps2(&around, &[xa, xa], is_periodic, WIDTH);
                let near_box = within(simd, &from_box, reach2, apart2);
                if near_box != 0 {
                    self.beside.push((b, near_box));
                }
            }
        }
        let Self { beside, theirs, seconds, found, .. } = self;
        if beside.is_empty() {
            return;
        }
        if theirs.is_empty() {
            for b in 0..two.points[1].blocks() {
                theirs.push(two.block(simd, 1, b));
            }
        }
        // Of those that are looked at one by one it is not told how near they are.
        apart2.0.iter_mut().for_each(|apart2| *apart2 = apart2.min(reach2));
        let room = (beside.len() + 1) * WIDTH;
        let seconds = space(seconds, room * WIDTH);
        let mut counts = [0; WIDTH];
        for &(b, mut near) in &*beside {
            let xb = &theirs[b];
            while near != 0 {
                let place = near.trailing_zeros() as usize;
                near &= near - 1;
                let x = [xa[0].0[place], xa[1].0[place], xa[2].0[place]];
                let distances2 = distances2_from_point(xb, x, two.period);
                let later = if alone && b == a { (!1u32 << place) as u16 } else { u16::MAX };
                let hits = simd.at_most(&distances2, reach2) & later;
                let mut hit = simd.to_front(&Places::EACH, hits);
                for k in 0..WIDTH {
                    hit.0[k] += (b * WIDTH) as u32;
                }
                seconds[place * room + counts[place]..][..WIDTH].copy_from_slice(&hit.0);
                counts[place] += hits.count_ones() as usize;
            }
        }
        let mut next = found.len();
        found.resize(next + counts.iter().sum::<usize>(), [0; 2]);
        for place in 0..WIDTH {
            let (i, js) = ((a * WIDTH + place) as u32, &seconds[place * room..][..counts[place]]);
            for (pair, &j) in found[next..].iter_mut().zip(js) {
                *pair = [i, j];
            }
            next += counts[place];
        }
    }
}

/// What stands in lanes, by places.
#[inline(always)]
fn by_place<S: Wide>(simd: S, lanes: &Lanes) -> Lanes {
    simd.spread(lanes, &Places::OF_QUADS, u16::MAX)
}

/// Which of some squares of distances are no greater than `reach2`, a bit each; the least of the others goes into `apart2`.
#[inline(always)]
fn within<S: Wide>(simd: S, distances2: &Lanes, reach2: f32, apart2: &mut Lanes) -> u16 {
    for k in 0..WIDTH {
        let d = distances2.0[k];
        let beyond = if d > reach2 { d } else { f32::INFINITY };
        apart2.0[k] = if beyond < apart2.0[k] { beyond } else { apart2.0[k] };
    }
    simd.at_most(distances2, reach2)
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

/// Squares of the gaps between a box and others in m², of which there are so many: at other places stands infinity. A periodic y counts
/// nothing.
#[inline(always)]
fn gaps2([low, high]: &Span, [lows, highs]: &[Lanes3; 2], periodic_y: bool, count: usize) -> Lanes {
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

/// Adds the squares of how far the spans from `lows` to `highs` are beyond one.
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

    use super::super::instructions::{Instructions, Job};
    use super::super::points::{place_of, scattered};
    use super::*;

    struct Look<'a>(&'a mut Finder, Two<'a>);

    impl Job for Look<'_> {
        type Output = f32;

        #[inline(always)]
        fn run<S: Wide>(self, simd: S) -> f32 {
            let Self(finder, two) = self;
            finder.found.clear();
            finder.find(simd, 1.5 * two.reach2.sqrt(), &two)
        }
    }

    /// All pairs of two bodies, by their places, with their distances in metres; of one and itself once.
    fn all(frame: &Frame, [a, b]: [&Points; 2], alone: bool) -> Vec<([u32; 2], f64)> {
        let mut all = Vec::new();
        for i in 0..a.count {
            for j in 0..b.count {
                let mut d = b.particle(j).position.wrapping_sub(a.particle(i).position);
                d.y = frame.nearest_image(d.y);
                let pair = [place_of(i as u32), place_of(j as u32)];
                if !alone || pair[0] < pair[1] {
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
    fn what_comes_within_reach_is_found_in_order() {
        const REACH: f32 = 0.02;
        for periodic_y in [false, true] {
            // Every block spans all of its body, so that each is beside each of the other's: one row of them, and five.
            let bodies = [(157, DVec3::new(0.02, 0.05, 0.0), 0.1), (1100, DVec3::new(0.0, 0.06, 0.01), 0.1)];
            let frame = frame(periodic_y);
            let bodies = scattered(frame, &bodies);
            for [a, b] in [[0, 1], [1, 0], [0, 0], [1, 1]] {
                let points = [&bodies[a], &bodies[b]];
                let at = points.map(Whereabouts::of);
                let all = all(&frame, points, a == b);
                // Where rounding decides, either will do.
                let [surely, perhaps] = [-1e-6, 1e-6].map(|by| {
                    let near = all.iter().filter(|(_, d)| *d <= f64::from(REACH) + by);
                    near.map(|(pair, _)| *pair).collect::<Vec<_>>()
                });
                assert!(surely.len() > 200);
                for instructions in Instructions::available() {
                    let mut finder = Finder::default();
                    let two = Two::new(points, at.each_ref(), REACH, &frame, a == b);
                    instructions.run(Look(&mut finder, two));
                    assert!(finder.found.is_sorted(), "{}", instructions.name());
                    assert!(surely.iter().all(|pair| finder.found.binary_search(pair).is_ok()));
                    assert!(finder.found.iter().all(|pair| perhaps.binary_search(pair).is_ok()));
                }
            }
        }
    }

    #[test]
    fn what_is_not_found_is_no_nearer_than_told() {
        // Apart by less than a block, by more, and one among the other.
        let beside = |gap: f64| [(40, DVec3::ZERO, 0.04), (50, DVec3::X * (0.04 + gap), 0.04)];
        let within = [(16, DVec3::ZERO, 0.01), (16, DVec3::ZERO, 0.06)];
        for (bodies, reach) in [(beside(0.01), 0.004), (beside(0.03), 0.02), (within, 0.001)] {
            let frame = frame(false);
            let bodies = scattered(frame, &bodies);
            let points = [&bodies[0], &bodies[1]];
            let at = points.map(Whereabouts::of);
            let nearest = all(&frame, points, false).iter().map(|(_, d)| *d).fold(f64::INFINITY, f64::min);
            assert!(nearest > f64::from(reach), "nothing is to be found");
            let mut finder = Finder::default();
            let two = Two::new(points, at.each_ref(), reach, &frame, false);
            let told = Instructions::widest().run(Look(&mut finder, two));
            assert_eq!(finder.found, [[0; 2]; 0]);
            assert!(f64::from(told) <= nearest + 1e-6, "{told} m, {nearest} m");
            assert!(told >= reach, "{told} m are no use");
        }
    }
}
