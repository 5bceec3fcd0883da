//! The search for pairs of two bodies that may touch: first boxes of bodies, then boxes of blocks, then sub-particles.

use glam::IVec3;

use super::body::{Body, Extent};
use super::instructions::Wide;
use super::memory::{Lanes, Lanes3, WIDTH, folded, places_of, quad_of};
use crate::engine::frame::Frame;

/// Blocks that are further from a body than this many skins beyond reach are passed over.
const FAR: f32 = 4.0;

/// What a search for pairs needs to know.
#[derive(Clone, Copy, Debug)]
pub(super) struct Search {
    /// Distance of centres within which a contact can hold, in metres.
    pub(super) reach: f32,
    /// What lists cover beyond, in metres: between bodies, and within one.
    pub(super) skins: [f32; 2],
}

/// Blocks of a body that are near another, relative to some origin.
#[derive(Debug, Default)]
struct Cloud {
    index: Vec<u32>,
    boxes: Vec<Extent>,
    /// Lowest and highest corners of the boxes, in metres.
    spans: Vec<[[f32; 3]; 2]>,
    x: Vec<Lanes3>,
}

/// Finds pairs that may touch.
#[derive(Debug, Default)]
pub(super) struct Finder {
    first: Cloud,
    second: Cloud,
    /// Blocks of the second cloud to be searched, and the lanes of the first's block that are near each.
    beside: Vec<(usize, u16)>,
    /// What the last search has found: pairs of places, sorted.
    pub(super) found: Vec<[u32; 2]>,
}

/// Where there is no sub-particle, in metres.
const NOWHERE: f32 = 1e9;

impl Cloud {
    /// The blocks of a body within `reach` metres of a box. Returns the least distance of those that are not.
    #[inline(always)]
    fn fill(&mut self, body: &Body, near: &Extent, reach: f32, origin: IVec3, frame: &Frame) -> f32 {
        self.index.clear();
        self.boxes.clear();
        self.spans.clear();
        self.x.clear();
        let mut left_out = f32::INFINITY;
        for (b, (block, extent)) in body.points.blocks.iter().zip(&body.boxes).enumerate() {
            let gap = extent.gap(near, frame);
            if gap > reach {
                left_out = left_out.min(gap);
                continue;
            }
            let count = body.points.count - b * WIDTH;
            let mut x = [Lanes::ZERO; 3];
            for axis in 0..3 {
                for k in 0..WIDTH {
                    let d = block.position[axis].0[k].wrapping_sub(origin[axis]);
                    x[axis].0[k] = if k < count { d as f32 * frame.unit_m } else { NOWHERE };
                }
            }
            self.index.push(b as u32);
            self.boxes.push(*extent);
            let corner = |x: IVec3| (x.wrapping_sub(origin).as_vec3() * frame.unit_m).to_array();
            self.spans.push([corner(extent.low), corner(extent.high)]);
            self.x.push(x);
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
        let skin = search.skins[usize::from(alone)];
        let (listed, far) = (search.reach + skin, search.reach + FAR * skin);
        self.found.clear();
        let gap = if alone { 0.0 } else { a.extent.gap(&b.extent, frame) };
        if gap > far {
            return gap;
        }
        let origin = b.extent.low;
        let of_a = self.first.fill(a, &b.extent, far, origin, frame);
        let of_b = self.second.fill(b, &a.extent, far, origin, frame);
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
        // Without a period nothing is ever half of it away.
        let half = if period == 0.0 { f32::INFINITY } else { 0.5 * period };
        let mut apart = f32::INFINITY;
        for ((&a, around_a), xa) in first.index.iter().zip(&first.boxes).zip(&first.x) {
            beside.clear();
            for (b, around_b) in second.boxes.iter().enumerate() {
                // Of a body and itself only pairs with i < j count, once.
                if alone && second.index[b] < a {
                    continue;
                }
                let gap = around_a.gap(around_b, frame);
                if gap > reach {
                    apart = apart.min(gap);
                    continue;
                }
                let from_box = distances2_from_box(xa, &second.spans[b], period != 0.0);
                apart = apart.min(folded(from_box.0, |a, b| if b < a { b } else { a }).sqrt());
                let near_box = simd.at_most(&from_box, reach2);
                if near_box != 0 {
                    beside.push((b, near_box));
                }
            }
            for place in 0..WIDTH {
                let lane = quad_of(place);
                let i = a * WIDTH as u32 + place as u32;
                let [x, y, z] = [0, 1, 2].map(|axis| xa[axis].0[lane]);
                for (b, _) in beside.iter().filter(|(_, near_box)| near_box >> lane & 1 == 1) {
                    let at = &second.x[*b];
                    let mut distance2 = Lanes::ZERO;
                    for k in 0..WIDTH {
                        let (dx, mut dy, dz) = (at[0].0[k] - x, at[1].0[k] - y, at[2].0[k] - z);
                        dy = if dy > half { dy - period } else { dy };
                        dy = if dy < -half { dy + period } else { dy };
                        distance2.0[k] = dx * dx + dy * dy + dz * dz;
                    }
                    let mut hits = places_of(simd.at_most(&distance2, reach2));
                    let first = second.index[*b] * WIDTH as u32;
                    while hits != 0 {
                        let j = first + hits.trailing_zeros();
                        hits &= hits - 1;
                        if !alone || i < j {
                            found.push([i, j]);
                        }
                    }
                }
            }
        }
        apart
    }
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
