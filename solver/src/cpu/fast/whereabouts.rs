//! Where a body is: what searches ask for, once in a step at most.

use glam::{IVec3, Vec3};

use super::instructions::{Job, Wide};
use super::memory::{Ints, Lanes, Lanes3, WIDTH, folded, greater, quad_of};
use super::points::Points;
use crate::engine::frame::Frame;

/// A box around positions, both corners inside.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Extent {
    pub(super) low: IVec3,
    pub(super) high: IVec3,
}

/// Lowest and highest corner of a box, in metres.
pub(super) type Span = [[f32; 3]; 2];

/// Where a body is: its box, and in metres from that one's lowest corner its sub-particles.
#[derive(Clone, Debug)]
pub(super) struct Whereabouts {
    pub(super) whole: Extent,
    /// From the lowest corner to the highest.
    pub(super) size: [f32; 3],
    /// Block by block, by [`super::points::place_of`]; those that only fill one up are [`NOWHERE`].
    pub(super) x: Vec<Lanes3>,
    /// The blocks' boxes.
    pub(super) boxes: Vec<Span>,
    /// Their lowest and highest corners once more, [`WIDTH`] by [`WIDTH`]; [`NOWHERE`] where there is no block.
    pub(super) rows: Vec<[Lanes3; 2]>,
}

/// More than positions lose as they are rounded, in metres.
const ROUNDING_M: f32 = 1e-6;

/// Where there is no sub-particle, in metres.
const NOWHERE: f32 = 1e9;

impl Whereabouts {
    #[inline(always)]
    pub(super) fn of<S: Wide>(simd: S, points: &Points, unit_m: f32) -> Self {
        let count = |b: usize| points.count - b * WIDTH;
        let (mut lows, mut highs) = ([Ints([i32::MAX; WIDTH]); 3], [Ints([i32::MIN; WIDTH]); 3]);
        for b in 0..points.blocks() {
            let positions = points.positions_of(simd, b);
            for axis in 0..3 {
                let x = real(positions[axis].0, count(b));
                for k in 0..WIDTH {
                    lows[axis].0[k] = lows[axis].0[k].min(x[k]);
                    highs[axis].0[k] = highs[axis].0[k].max(x[k]);
                }
            }
        }
        let low = IVec3::from_array(lows.map(|of| folded(of.0, i32::min)));
        let high = IVec3::from_array(highs.map(|of| folded(of.0, i32::max)));
        let (mut x, mut boxes) = (Vec::with_capacity(points.blocks()), Vec::with_capacity(points.blocks()));
        let mut rows = vec![[[Lanes([NOWHERE; WIDTH]); 3]; 2]; points.blocks().div_ceil(WIDTH)];
        for b in 0..points.blocks() {
            let positions = points.positions_of(simd, b);
            let (mut at, mut around) = ([Lanes::ZERO; 3], [[0.0; 3]; 2]);
            let [lows, highs] = &mut rows[b / WIDTH];
            for axis in 0..3 {
                for k in 0..WIDTH {
                    at[axis].0[k] = positions[axis].0[k].wrapping_sub(low[axis]) as f32 * unit_m;
                }
                let there = real(at[axis].0, count(b));
                let ends = [folded(there, |a, b| if b < a { b } else { a }), folded(there, greater)];
                [around[0][axis], around[1][axis]] = ends;
                [lows[axis].0[b % WIDTH], highs[axis].0[b % WIDTH]] = ends;
                for k in 0..WIDTH {
                    at[axis].0[k] = if k < count(b) { at[axis].0[k] } else { NOWHERE };
                }
                at[axis].0 = std::array::from_fn(|place| at[axis].0[quad_of(place)]);
            }
            x.push(at);
            boxes.push(around);
        }
        let size = (high.wrapping_sub(low).as_vec3() * unit_m).to_array();
        Self { whole: Extent { low, high }, size, x, boxes, rows }
    }

    /// The middle of the body's box, and how far its corners are from there in metres, at most.
    pub(super) fn middle_of_all(&self, unit_m: f32) -> (IVec3, f32) {
        self.middle(&[[0.0; 3], self.size], unit_m)
    }

    /// The same of a block's box.
    pub(super) fn middle_of(&self, block: usize, unit_m: f32) -> (IVec3, f32) {
        self.middle(&self.boxes[block], unit_m)
    }

    fn middle(&self, span: &Span, unit_m: f32) -> (IVec3, f32) {
        let [low, high] = span.map(Vec3::from);
        let middle = ((low + high) * (0.5 / unit_m)).as_ivec3();
        (self.whole.low.wrapping_add(middle), 0.5 * (high - low).length() + ROUNDING_M)
    }
}

/// A block's numbers, of which only the first `count` are real: the others become as the first.
#[inline(always)]
fn real<T: Copy>(mut of: [T; WIDTH], count: usize) -> [T; WIDTH] {
    let first = of[0];
    for k in 1..WIDTH {
        of[k] = if k < count { of[k] } else { first };
    }
    of
}

impl Extent {
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

/// Finds out where sub-particles are.
pub(super) struct Find<'a>(pub(super) &'a Points, pub(super) &'a Frame);

impl Job for Find<'_> {
    type Output = Whereabouts;

    #[inline(always)]
    fn run<S: Wide>(self, simd: S) -> Whereabouts {
        let Self(points, frame) = self;
        Whereabouts::of(simd, points, frame.unit_m)
    }
}
