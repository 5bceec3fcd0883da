//! The search for pairs of two bodies that may touch: first boxes of bodies, then boxes of blocks, then sub-particles.

use glam::IVec3;

use super::body::{Body, Extent};
use super::instructions::Wide;
use super::memory::{Lanes, Lanes3, WIDTH, folded, places_of, quad_of};
use super::points::Points;
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

/// Blocks of a body that are near another, relative to some origin.
#[derive(Debug, Default)]
struct Cloud {
    index: Vec<u32>,
    /// Lowest and highest corners of the blocks' boxes, in metres.
    spans: Vec<Span>,
    /// The same, [`WIDTH`] by [`WIDTH`].
    lows: Vec<Lanes3>,
    highs: Vec<Lanes3>,
    x: Vec<Lanes3>,
}

type Span = [[f32; 3]; 2];

/// Finds pairs that may touch.
#[derive(Debug, Default)]
pub(super) struct Finder {
    first: Cloud,
    second: Cloud,
    /// Blocks of the second cloud to be searched, and which of the first's block are near each.
    beside: Vec<(usize, u16)>,
    /// What the last search has found: pairs of places, sorted.
    pub(super) found: Vec<[u32; 2]>,
}

/// Blocks beside another that are kept as bits.
const FIRST: usize = u64::BITS as usize;

/// Where there is no sub-particle, in metres.
const NOWHERE: f32 = 1e9;

impl Cloud {
    /// The blocks of a body within `reach` metres of a box. Returns the least distance of those that are not.
    #[inline(always)]
    fn fill(
        &mut self,
        points: &Points,
        boxes: &[Extent],
        near: &Extent,
        reach: f32,
        origin: IVec3,
        frame: &Frame,
    ) -> f32 {
        self.index.clear();
        self.spans.clear();
        self.lows.clear();
        self.highs.clear();
        self.x.clear();
        let mut left_out = f32::INFINITY;
        for (b, (block, extent)) in points.blocks.iter().zip(boxes).enumerate() {
            let gap = extent.gap(near, frame);
            if gap > reach {
                left_out = left_out.min(gap);
                continue;
            }
            let count = points.count - b * WIDTH;
            let mut x = [Lanes::ZERO; 3];
            for axis in 0..3 {
                for k in 0..WIDTH {
                    let d = block.position[axis].0[k].wrapping_sub(origin[axis]);
                    x[axis].0[k] = if k < count { d as f32 * frame.unit_m } else { NOWHERE };
                }
            }
            self.index.push(b as u32);
            let corner = |x: IVec3| (x.wrapping_sub(origin).as_vec3() * frame.unit_m).to_array();
            self.spans.push([corner(extent.low), corner(extent.high)]);
            self.x.push(x);
        }
        for some in self.spans.chunks(WIDTH) {
            let lanes = |corner: usize| -> Lanes3 {
                std::array::from_fn(|axis| {
                    Lanes(std::array::from_fn(|k| some.get(k).map_or(NOWHERE, |span| span[corner][axis])))
                })
            };
            self.lows.push(lanes(0));
            self.highs.push(lanes(1));
        }
        left_out
    }
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
        let [at_a, at_b] = [a, b].map(|body| body.whereabouts(simd));
        let gap = if alone { 0.0 } else { at_a.whole.gap(&at_b.whole, frame) };
        if gap > far {
            return gap;
        }
        let origin = at_b.whole.low;
        let of_a = self.first.fill(&a.points, &at_a.boxes, &at_b.whole, far, origin, frame);
        let of_b = self.second.fill(&b.points, &at_b.boxes, &at_a.whole, far, origin, frame);
        let apart = self.find(simd, listed, frame, alone);
        if alone {
            a.leave_out_joined(&mut self.found);
        }
        apart.min(of_a).min(of_b)
    }

    /// Pairs of the two clouds within `reach` metres. Returns a distance that the others are not below.
    #[inline(always)]
    fn find<S: Wide>(&mut self, simd: S, reach: f32, frame: &Frame, alone: bool) -> f32 {
        let Self { first, second, beside, found } = self;
        let reach2 = reach * reach;
        let period = frame.period_y as f32 * frame.unit_m;
        let is_periodic = period != 0.0;
        // Without a period nothing is ever half of it away.
        let half = if is_periodic { 0.5 * period } else { f32::INFINITY };
        let mut apart2 = Lanes([f32::INFINITY; WIDTH]);
        for ((&a, span), xa) in first.index.iter().zip(&first.spans).zip(&first.x) {
            beside.clear();
            for (g, (lows, highs)) in second.lows.iter().zip(&second.highs).enumerate() {
                let mut boxes = within(simd, &gaps2(span, lows, highs, is_periodic), reach2, &mut apart2);
                while boxes != 0 {
                    let b = g * WIDTH + boxes.trailing_zeros() as usize;
                    boxes &= boxes - 1;
                    // Of a body and itself only pairs with i < j count, once.
                    if alone && second.index[b] < a {
                        continue;
                    }
                    let from_box = distances2_from_box(xa, &second.spans[b], is_periodic);
                    let near_box = within(simd, &from_box, reach2, &mut apart2);
                    if near_box != 0 {
                        beside.push((b, places_of(near_box)));
                    }
                }
            }
            // For each of the block's sub-particles, which of the first of those blocks it is near.
            let mut near = [0u64; WIDTH];
            for (n, &(_, near_box)) in beside.iter().enumerate().take(FIRST) {
                for place in bits(near_box) {
                    near[place] |= 1 << n;
                }
            }
            for (place, &near) in near.iter().enumerate() {
                let i = a * WIDTH as u32 + place as u32;
                let x = [0, 1, 2].map(|axis| xa[axis].0[quad_of(place)]);
                let more = beside.iter().skip(FIRST).filter(|(_, near_box)| near_box >> place & 1 == 1);
                for &(b, _) in bits(near).map(|n| &beside[n]).chain(more) {
                    let distances2 = distances2_from_point(&second.x[b], x, [half, period]);
                    let hits = within(simd, &distances2, reach2, &mut apart2);
                    if hits != 0 {
                        let first = second.index[b] * WIDTH as u32;
                        let hits = bits(places_of(hits)).map(|hit| first + hit as u32);
                        found.extend(hits.filter(|&j| !alone || i < j).map(|j| [i, j]));
                    }
                }
            }
        }
        folded(apart2.0, |a, b| if b < a { b } else { a }).sqrt()
    }
}

/// Which of some squares of distances are no greater than `reach2`, by lane; the least of the others goes into `apart2`.
#[inline(always)]
fn within<S: Wide>(simd: S, distances2: &Lanes, reach2: f32, apart2: &mut Lanes) -> u16 {
    for k in 0..WIDTH {
        let d = distances2.0[k];
        let beyond = if d > reach2 { d } else { f32::INFINITY };
        apart2.0[k] = if beyond < apart2.0[k] { beyond } else { apart2.0[k] };
    }
    simd.at_most(distances2, reach2)
}

/// The numbers of bits that are set, ascending.
#[inline(always)]
fn bits(of: impl Into<u64>) -> impl Iterator<Item = usize> {
    let mut left = of.into();
    std::iter::from_fn(move || {
        let bit = (left != 0).then(|| left.trailing_zeros() as usize);
        left &= left.wrapping_sub(1);
        bit
    })
}

/// Squares of the distances of a block's sub-particles from a point, in m².
#[inline(always)]
fn distances2_from_point(block: &Lanes3, [x, y, z]: [f32; 3], [half, period]: [f32; 2]) -> Lanes {
    let mut distance2 = Lanes::ZERO;
    for k in 0..WIDTH {
        let (dx, mut dy, dz) = (block[0].0[k] - x, block[1].0[k] - y, block[2].0[k] - z);
        dy = if dy > half { dy - period } else { dy };
        dy = if dy < -half { dy + period } else { dy };
        distance2.0[k] = dx * dx + dy * dy + dz * dz;
    }
    distance2
}

/// Squares of the gaps between a box and others, in m²; a periodic y counts nothing.
#[inline(always)]
fn gaps2([low, high]: &Span, lows: &Lanes3, highs: &Lanes3, periodic_y: bool) -> Lanes {
    let mut gap2 = Lanes::ZERO;
    for axis in (0..3).filter(|&axis| axis != 1 || !periodic_y) {
        for k in 0..WIDTH {
            let (below, above) = (lows[axis].0[k] - high[axis], low[axis] - highs[axis].0[k]);
            let d = if above > below { above } else { below };
            let d = if d > 0.0 { d } else { 0.0 };
            gap2.0[k] += d * d;
        }
    }
    gap2
}

/// Squares of the distances of a block's sub-particles from a box, in m²; along a periodic y they count nothing.
#[inline(always)]
fn distances2_from_box(x: &Lanes3, [low, high]: &[[f32; 3]; 2], periodic_y: bool) -> Lanes {
    let mut distance2 = Lanes::ZERO;
    for axis in (0..3).filter(|&axis| axis != 1 || !periodic_y) {
        for k in 0..WIDTH {
            let at = x[axis].0[k];
            let (below, above) = (low[axis] - at, at - high[axis]);
            let d = if above > below { above } else { below };
            let d = if d > 0.0 { d } else { 0.0 };
            distance2.0[k] += d * d;
        }
    }
    distance2
}
