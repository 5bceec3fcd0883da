//! Bounding boxes of a body and of its blocks.

use glam::IVec3;

use super::particles::BodyParticles;
use crate::cpu::fast::instructions::arrays::{Lanes3, Quads, WIDTH, in_metres};
use crate::cpu::fast::instructions::prefetch;
use crate::cpu::fast::instructions::prefetch::{PARTS, part};
use crate::cpu::fast::instructions::set::LaneOps;
use crate::cpu::fast::instructions::transpose::ints;
use crate::engine::frame::Frame;

/// Axis-aligned bounding box in fixed-point coordinates, corners inclusive.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct FixedAabb {
    pub(crate) low: IVec3,
    pub(crate) high: IVec3,
}

/// Low and high corner of a box, in metres.
pub(crate) type LocalAabb = [[f32; 3]; 2];

/// The boxes of a body and of its blocks.
#[derive(Debug, Default)]
pub(crate) struct BodyBounds {
    pub(crate) whole: FixedAabb,
    blocks: usize,
    /// Corners of the blocks, padded to whole rows. The fourth number is unused.
    corners: [Vec<[i32; 4]>; 2],
}

/// Upper bound of the rounding error of a position, in metres.
const ROUNDING_M: f32 = 1e-6;

impl BodyBounds {
    pub(crate) fn of(points: &BodyParticles) -> Self {
        let mut bounds = Self::default();
        bounds.update(points);
        bounds
    }

    /// Updates the boxes.
    #[inline(always)]
    pub(crate) fn update(&mut self, points: &BodyParticles) {
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
        self.whole = FixedAabb { low: corner(low), high: corner(high) };
    }

    /// Prefetches the `k`th of [`PARTS`] parts.
    #[inline(always)]
    pub(crate) fn prefetch_part(&self, k: usize) {
        let [lows, highs] = &self.corners;
        prefetch::to_l2(part(&lows[..self.blocks], k, PARTS));
        prefetch::to_l2(part(&highs[..self.blocks], k, PARTS));
    }

    /// Number of rows of [`WIDTH`] blocks.
    pub(crate) fn rows(&self) -> usize {
        self.blocks.div_ceil(WIDTH)
    }

    /// The boxes of a row in transposed lanes, relative to `from` in metres, and their number.
    #[inline(always)]
    pub(crate) fn row<S: LaneOps>(
        &self,
        simd: S,
        g: usize,
        from: IVec3,
        unit_m: f32,
    ) -> ([Lanes3; 2], usize) {
        let [lows, highs] = &self.corners;
        let [x, y, z, _] = ints(simd, &Quads::of(lows, g));
        let [u, v, w, _] = ints(simd, &Quads::of(highs, g));
        let lows = in_metres(&[x, y, z], from, unit_m);
        let highs = in_metres(&[u, v, w], from, unit_m);
        ([lows, highs], (self.blocks - g * WIDTH).min(WIDTH))
    }

    /// Box of a block, relative to `from`, in metres.
    #[inline(always)]
    pub(crate) fn local_aabb(&self, block: usize, from: IVec3, unit_m: f32) -> LocalAabb {
        let FixedAabb { low, high } = self.aabb(block);
        [low, high].map(|corner| (corner.wrapping_sub(from).as_vec3() * unit_m).to_array())
    }

    #[inline(always)]
    fn aabb(&self, block: usize) -> FixedAabb {
        let [lows, highs] = &self.corners;
        FixedAabb { low: corner(lows[block]), high: corner(highs[block]) }
    }

    /// Centre of the body's box, and an upper bound of the distance of its corners in metres.
    pub(crate) fn body_centre(&self, unit_m: f32) -> (IVec3, f32) {
        self.whole.centre(unit_m)
    }

    /// The same for the box of a block.
    pub(crate) fn block_centre(&self, block: usize, unit_m: f32) -> (IVec3, f32) {
        self.aabb(block).centre(unit_m)
    }
}

#[inline(always)]
fn corner([x, y, z, _]: [i32; 4]) -> IVec3 {
    IVec3::new(x, y, z)
}

impl FixedAabb {
    /// Centre, and an upper bound of the distance of the corners in metres.
    fn centre(&self, unit_m: f32) -> (IVec3, f32) {
        let size = self.high.wrapping_sub(self.low);
        (self.low.wrapping_add(size / 2), 0.5 * size.as_vec3().length() * unit_m + ROUNDING_M)
    }

    /// The box enlarged by `by` metres on all sides, and unbounded in a periodic direction.
    pub(crate) fn grown(&self, by: f32, frame: &Frame) -> Self {
        let by = IVec3::splat((by / frame.unit_m) as i32 + 2);
        let (mut low, mut high) = (self.low.saturating_sub(by), self.high.saturating_add(by));
        if frame.period_y != 0 {
            (low.y, high.y) = (i32::MIN, i32::MAX);
        }
        Self { low, high }
    }

    /// Lower bound of the distance to another box in metres; 0 on overlap. A periodic direction is ignored.
    #[inline(always)]
    pub(crate) fn gap(&self, other: &Self, frame: &Frame) -> f32 {
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

    use super::*;
    use crate::cpu::fast::instructions::arrays::transposed_lane;
    use crate::cpu::fast::instructions::set::{InstructionSet, SimdTask};
    use crate::cpu::fast::storage::particles::{random_bodies, slot_of};

    struct Rows<'a>(&'a BodyBounds, IVec3);

    impl SimdTask for Rows<'_> {
        type Output = Vec<([Lanes3; 2], usize)>;

        #[inline(always)]
        fn run<S: LaneOps>(self, simd: S) -> Self::Output {
            let Self(at, from) = self;
            (0..at.rows()).map(|g| at.row(simd, g, from, 1.0)).collect()
        }
    }

    #[test]
    fn body_bounds_follow_moved_sub_particles_without_padding() {
        let frame = Frame::new(DVec3::splat(-0.1), DVec3::splat(0.1), false);
        // The padding of the last block, of 8 in both cases, keeps its position.
        for count in [40, 300] {
            let mut points = random_bodies(frame, &[(count, DVec3::ZERO, 0.05)]).remove(0);
            let mut at = BodyBounds::of(&points);
            for k in 0..count {
                let position = &mut points.positions[slot_of(k as u32) as usize];
                position[..3].iter_mut().for_each(|x| *x += 1 << 28);
            }
            at.update(&points);
            let positions: Vec<IVec3> = (0..count).map(|k| points.particle(k).position).collect();
            let around = |some: &[IVec3]| FixedAabb {
                low: some.iter().copied().fold(IVec3::MAX, IVec3::min),
                high: some.iter().copied().fold(IVec3::MIN, IVec3::max),
            };
            assert_eq!(at.whole, around(&positions));
            let blocks: Vec<FixedAabb> = positions.chunks(WIDTH).map(around).collect();
            let from = at.whole.low;
            let of = |aabb: &FixedAabb| [aabb.low, aabb.high].map(|x| (x - from).as_vec3().to_array());
            for (b, block) in blocks.iter().enumerate() {
                assert_eq!(at.aabb(b), *block);
                assert_eq!(at.local_aabb(b, from, 1.0), of(block));
            }
            for instructions in InstructionSet::available() {
                let rows = instructions.run(Rows(&at, from));
                assert_eq!(rows.iter().map(|(_, count)| count).sum::<usize>(), blocks.len());
                for (b, block) in blocks.iter().enumerate() {
                    let (corners, lane) = (&rows[b / WIDTH].0, transposed_lane(b % WIDTH));
                    let found = corners.map(|corner| corner.map(|along| along.0[lane]));
                    assert_eq!(found, of(block), "{}", instructions.name());
                }
            }
        }
    }
}
