//! Where a body and its blocks are: what searches ask for.

use glam::IVec3;

use super::fetch::{self, PARTS, part};
use super::instructions::Wide;
use super::load::ints;
use super::memory::{Lanes3, Quads, WIDTH, in_metres};
use super::points::Points;
use crate::engine::frame::Frame;

/// A box around positions, both corners inside.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Extent {
    pub(super) low: IVec3,
    pub(super) high: IVec3,
}

/// Lowest and highest corner of a box, in metres.
pub(super) type Span = [[f32; 3]; 2];

/// The boxes of a body and of its blocks.
#[derive(Debug, Default)]
pub(super) struct Whereabouts {
    pub(super) whole: Extent,
    blocks: usize,
    /// The blocks' lowest and highest corners, up to whole rows; the fourth numbers mean nothing.
    corners: [Vec<[i32; 4]>; 2],
}

/// More than positions lose as they are rounded, in metres.
const ROUNDING_M: f32 = 1e-6;

impl Whereabouts {
    pub(super) fn of(points: &Points) -> Self {
        let mut whereabouts = Self::default();
        whereabouts.update(points);
        whereabouts
    }

    /// Follows the sub-particles.
    #[inline(always)]
    pub(super) fn update(&mut self, points: &Points) {
        self.blocks = points.blocks();
        let [lows, highs] = &mut self.corners;
        lows.resize(self.blocks.next_multiple_of(WIDTH), [0; 4]);
        highs.resize(self.blocks.next_multiple_of(WIDTH), [0; 4]);
        let (mut low, mut high) = ([i32::MAX; 4], [i32::MIN; 4]);
        for (b, (lowest, highest)) in lows.iter_mut().zip(highs).enumerate().take(self.blocks) {
            [*lowest, *highest] = points.corners(b);
            for c in 0..4 {
                low[c] = low[c].min(lowest[c]);
                high[c] = high[c].max(highest[c]);
            }
        }
        self.whole = Extent { low: corner(low), high: corner(high) };
    }

    /// Fetches the `k`th of [`PARTS`] parts from memory.
    #[inline(always)]
    pub(super) fn fetch_part(&self, k: usize) {
        let [lows, highs] = &self.corners;
        fetch::later(part(&lows[..self.blocks], k, PARTS));
        fetch::later(part(&highs[..self.blocks], k, PARTS));
    }

    /// How many rows of [`WIDTH`] blocks there are.
    pub(super) fn rows(&self) -> usize {
        self.blocks.div_ceil(WIDTH)
    }

    /// The boxes of a row in lanes (see [`super::memory::quad_of`]), in metres from a position, and how many there are.
    #[inline(always)]
    pub(super) fn row<S: Wide>(&self, simd: S, g: usize, from: IVec3, unit_m: f32) -> ([Lanes3; 2], usize) {
        let [lows, highs] = &self.corners;
        let [x, y, z, _] = ints(simd, &Quads::of(lows, g));
        let [u, v, w, _] = ints(simd, &Quads::of(highs, g));
        let lows = in_metres(&[x, y, z], from, unit_m);
        let highs = in_metres(&[u, v, w], from, unit_m);
        ([lows, highs], (self.blocks - g * WIDTH).min(WIDTH))
    }

    /// A block's box, in metres from a position.
    #[inline(always)]
    pub(super) fn span(&self, block: usize, from: IVec3, unit_m: f32) -> Span {
        let Extent { low, high } = self.extent(block);
        [low, high].map(|corner| (corner.wrapping_sub(from).as_vec3() * unit_m).to_array())
    }

    #[inline(always)]
    fn extent(&self, block: usize) -> Extent {
        let [lows, highs] = &self.corners;
        Extent { low: corner(lows[block]), high: corner(highs[block]) }
    }

    /// The middle of the body's box, and how far its corners are from there in metres, at most.
    pub(super) fn middle_of_all(&self, unit_m: f32) -> (IVec3, f32) {
        self.whole.middle(unit_m)
    }

    /// The same of a block's box.
    pub(super) fn middle_of(&self, block: usize, unit_m: f32) -> (IVec3, f32) {
        self.extent(block).middle(unit_m)
    }
}

#[inline(always)]
fn corner([x, y, z, _]: [i32; 4]) -> IVec3 {
    IVec3::new(x, y, z)
}

impl Extent {
    /// The middle, and how far corners are from there in metres, at most.
    fn middle(&self, unit_m: f32) -> (IVec3, f32) {
        let size = self.high.wrapping_sub(self.low);
        (self.low.wrapping_add(size / 2), 0.5 * size.as_vec3().length() * unit_m + ROUNDING_M)
    }

    /// Larger by `by` metres on all sides; without bounds in a direction that is periodic.
    pub(super) fn grown(&self, by: f32, frame: &Frame) -> Self {
        let by = IVec3::splat((by / frame.unit_m) as i32 + 2);
        let (mut low, mut high) = (self.low.saturating_sub(by), self.high.saturating_add(by));
        if frame.period_y != 0 {
            (low.y, high.y) = (i32::MIN, i32::MAX);
        }
        Self { low, high }
    }

    /// Distance to another box in metres, at least; 0 where they overlap. A periodic direction counts nothing.
    #[inline(always)]
    pub(super) fn gap(&self, other: &Self, frame: &Frame) -> f32 {
        let (low, high) = (self.low.max(other.low), self.high.min(other.high));
        let mut between = low.saturating_sub(high).max(IVec3::ZERO).as_vec3() * frame.unit_m;
        if frame.period_y != 0 {
            between.y = 0.0;
        }
        between.length()
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::super::instructions::{Instructions, Job};
    use super::super::memory::quad_of;
    use super::super::points::{place_of, scattered};
    use super::*;

    struct Rows<'a>(&'a Whereabouts, IVec3);

    impl Job for Rows<'_> {
        type Output = Vec<([Lanes3; 2], usize)>;

        #[inline(always)]
        fn run<S: Wide>(self, simd: S) -> Self::Output {
            let Self(at, from) = self;
            (0..at.rows()).map(|g| at.row(simd, g, from, 1.0)).collect()
        }
    }

    #[test]
    fn boxes_follow_what_moves_and_nothing_else() {
        let frame = Frame::new(DVec3::splat(-0.1), DVec3::splat(0.1), false);
        // What fills up the last block, of 8 in both, stays where it began.
        for count in [40, 300] {
            let mut points = scattered(frame, &[(count, DVec3::ZERO, 0.05)]).remove(0);
            let mut at = Whereabouts::of(&points);
            for k in 0..count {
                let position = &mut points.positions[place_of(k as u32) as usize];
                position[..3].iter_mut().for_each(|x| *x += 1 << 28);
            }
            at.update(&points);
            let positions: Vec<IVec3> = (0..count).map(|k| points.particle(k).position).collect();
            let around = |some: &[IVec3]| Extent {
                low: some.iter().copied().fold(IVec3::MAX, IVec3::min),
                high: some.iter().copied().fold(IVec3::MIN, IVec3::max),
            };
            assert_eq!(at.whole, around(&positions));
            let blocks: Vec<Extent> = positions.chunks(WIDTH).map(around).collect();
            let from = at.whole.low;
            let of = |extent: &Extent| [extent.low, extent.high].map(|x| (x - from).as_vec3().to_array());
            for (b, block) in blocks.iter().enumerate() {
                assert_eq!(at.extent(b), *block);
                assert_eq!(at.span(b, from, 1.0), of(block));
            }
            for instructions in Instructions::available() {
                let rows = instructions.run(Rows(&at, from));
                assert_eq!(rows.iter().map(|(_, count)| count).sum::<usize>(), blocks.len());
                for (b, block) in blocks.iter().enumerate() {
                    let (corners, lane) = (&rows[b / WIDTH].0, quad_of(b % WIDTH));
                    let found = corners.map(|corner| corner.map(|along| along.0[lane]));
                    assert_eq!(found, of(block), "{}", instructions.name());
                }
            }
        }
    }
}
