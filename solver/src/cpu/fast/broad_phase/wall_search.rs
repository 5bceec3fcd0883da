//! The search for facets near the sub-particles of a body.

use super::facets::SmallFacet;
use crate::cpu::fast::instructions::arrays::WIDTH;
use crate::cpu::fast::instructions::set::{LaneOps, SimdTask};
use crate::cpu::fast::storage::bounds::BodyBounds;
use crate::cpu::fast::storage::context::StepContext;
use crate::cpu::fast::storage::motion::{BodyMotion, SAFETY_FACTOR};
use crate::cpu::fast::storage::particles::BodyParticles;
use crate::cpu::fast::storage::wall_list::{WallList, WallListRow};
use crate::engine::frame::Frame;
use crate::engine::wall_pair::WallPair;
use crate::walls::Walls;

/// A search for the facets near a body.
pub(crate) struct WallSearch<'a> {
    pub(crate) walls: &'a mut WallList,
    pub(crate) motion: &'a BodyMotion,
    pub(crate) context: &'a StepContext<'a>,
    pub(crate) points: &'a BodyParticles,
    pub(crate) at: &'a BodyBounds,
    /// Maximum motion relative to a surface in the last step, in metres.
    pub(crate) step_m: f32,
}

impl SimdTask for WallSearch<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: LaneOps>(self, simd: S) {
        let Self { walls, motion, context, points, at, step_m } = self;
        walls.search(simd, motion, context, points, at, step_m);
    }
}

/// Bits of the sub-particles of two blocks within `reach` metres of a facet.
#[inline(always)]
fn near_facet<S: LaneOps>(
    simd: S,
    walls: &Walls,
    facet: u32,
    frame: &Frame,
    points: &BodyParticles,
    two: [usize; 2],
    reach: f32,
) -> [u16; 2] {
    let Some(few) = SmallFacet::of(walls, facet) else {
        let mut near = [0; 2];
        for (near, block) in near.iter_mut().zip(two) {
            for k in block * WIDTH..points.count.min((block + 1) * WIDTH) {
                let position = points.particle(k).position;
                let is_near = walls.nearest_point(facet, position, frame).distance <= reach;
                *near |= u16::from(is_near) << (k % WIDTH);
            }
        }
        return near;
    };
    let ([x, y, z, _], [u, v, w, _]) = (points.positions_of(simd, two[0]), points.positions_of(simd, two[1]));
    let [a, b] = few.distances(simd, frame, [&[x, y, z], &[u, v, w]]);
    [simd.le_bits(&a, reach), simd.le_bits(&b, reach)]
}

impl WallList {
    pub(crate) fn is_due(&self, motion: &BodyMotion, context: &StepContext<'_>) -> bool {
        let moved =
            motion.since(&self.searched_at) + (context.walls.total_travel_m() - self.searched_travel_m);
        !(self.known && moved <= SAFETY_FACTOR * f64::from(context.wall_skin))
    }

    /// Maximum depth of a sub-particle beyond a facet, in metres.
    fn depth_beyond(&self, context: &StepContext<'_>, points: &BodyParticles) -> f32 {
        let mut depth = 0.0f32;
        let mut from = 0;
        for row in &self.rows {
            let near = &self.pairs[std::mem::replace(&mut from, row.end as usize)..row.end as usize];
            if near.iter().any(|pair| pair.side.beyond) {
                let position = points.particle(row.of as usize).position;
                depth = depth.max(context.walls.depth_beyond(near, position, context.frame));
            }
        }
        depth
    }

    /// Renews the list of facets near each sub-particle. Contact histories persist.
    #[inline(always)]
    fn search<S: LaneOps>(
        &mut self,
        simd: S,
        motion: &BodyMotion,
        context: &StepContext<'_>,
        points: &BodyParticles,
        at: &BodyBounds,
        step_m: f32,
    ) {
        let StepContext { walls, frame, .. } = context;
        let depth = self.depth_beyond(context, points);
        let reach = context.wall_cutoff.max(step_m) + depth + context.wall_skin;
        let (centre, half) = at.body_centre(frame.unit_m);
        let near: Vec<u32> = walls.facets_within(centre, reach + half, frame).collect();
        let old = std::mem::take(self);
        self.known = true;
        self.searched_at = *motion;
        self.searched_travel_m = walls.total_travel_m();
        let mut old_rows = old.rows.iter().scan(0, |from, row| {
            let pairs = (row.of, *from as usize..row.end as usize);
            *from = row.end;
            Some(pairs)
        });
        let mut known = old_rows.next();
        if near.is_empty() {
            return;
        }
        let mut close = Vec::new();
        for first in (0..points.blocks()).step_by(2) {
            // For two blocks at a time: the facets near either box, then the sub-particles near each.
            let two = [first, (first + 1).min(points.blocks() - 1)];
            let middles = two.map(|block| at.block_centre(block, frame.unit_m));
            close.clear();
            for &facet in &near {
                let reaches =
                    |(centre, half)| walls.nearest_point(facet, centre, frame).distance <= reach + half;
                if middles.into_iter().any(reaches) {
                    close.push((facet, near_facet(simd, walls, facet, frame, points, two, reach)));
                }
            }
            for k in first * WIDTH..points.count.min((first + 2) * WIDTH) {
                let (half, lane, k) = (k / WIDTH - first, k % WIDTH, k as u32);
                while known.as_ref().is_some_and(|(row, _)| *row < k) {
                    known = old_rows.next();
                }
                let remembered = known
                    .as_ref()
                    .filter(|(row, _)| *row == k)
                    .map_or(&[][..], |(_, pairs)| &old.pairs[pairs.clone()]);
                for &(facet, _) in close.iter().filter(|(_, of)| of[half] >> lane & 1 == 1) {
                    let before = remembered.iter().find(|pair| pair.facet == facet);
                    self.pairs.push(before.copied().unwrap_or(WallPair { facet, ..WallPair::default() }));
                }
                let end = self.pairs.len() as u32;
                if end > self.rows.last().map_or(0, |row| row.end) {
                    self.rows.push(WallListRow { of: k, end, due_at_m: f64::NEG_INFINITY });
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;
    use serde_json::json;

    use super::*;
    use crate::check::scene_of;
    use crate::cpu::fast::instructions::set::InstructionSet;
    use crate::cpu::fast::storage::particles::random_bodies;
    use crate::engine::scene::Scene;
    use crate::equipment::{Surface, SurfaceKind};
    use crate::scenario::from_value;

    struct Near<'a>(&'a Walls, u32, &'a Frame, &'a BodyParticles, [usize; 2]);

    impl SimdTask for Near<'_> {
        type Output = [u16; 2];

        #[inline(always)]
        fn run<S: LaneOps>(self, simd: S) -> [u16; 2] {
            let Self(walls, facet, frame, points, two) = self;
            near_facet(simd, walls, facet, frame, points, two, REACH)
        }
    }

    const REACH: f32 = 0.01;

    #[test]
    fn vectorised_wall_search_finds_the_sub_particles_within_reach() {
        let plate = |u: DVec3, v: DVec3| {
            Surface::parallelogram("plate", SurfaceKind::Equipment, (u + v) * -0.5, u, v)
        };
        // Two triangles; twenty in one plane; two slivers.
        let mut cut = plate(DVec3::X * 0.1, DVec3::Z * 0.1);
        let strips = (0..10).map(|k| DVec3::X * 0.1 * f64::from(k));
        let strip = |shift: DVec3| {
            let triangles = plate(DVec3::X * 0.1, DVec3::Z * 0.1).triangles;
            triangles.into_iter().map(move |corners| corners.map(|corner| corner + shift))
        };
        cut.triangles = strips.flat_map(strip).collect();
        let surfaces = vec![plate(DVec3::X * 0.1, DVec3::Y * 0.1), cut, plate(DVec3::X, DVec3::Y * 1e-4)];
        let drop = from_value(&json!({"experiment": "drop"})).expect("a scenario");
        let scene = Scene { surfaces, ..scene_of(&drop) };
        let frame = Frame::new(DVec3::splat(-1.0), DVec3::splat(1.0), false);
        let walls = Walls::new(&scene, &frame);
        let few: Vec<bool> = (0..3).map(|facet| SmallFacet::of(&walls, facet).is_some()).collect();
        assert_eq!(few, [true, false, false]);
        // Three blocks, the last one of 5: alone it is both of two.
        let points = &random_bodies(frame, &[(37, DVec3::ZERO, 0.05)])[0];
        for facet in 0..3 {
            let near =
                |k: usize| walls.nearest_point(facet, points.particle(k).position, &frame).distance <= REACH;
            let mut count = 0;
            for two in [[0, 1], [2, 2]] {
                for instructions in InstructionSet::available() {
                    let bits = instructions.run(Near(&walls, facet, &frame, points, two));
                    for (half, block) in two.into_iter().enumerate() {
                        for k in block * WIDTH..37.min((block + 1) * WIDTH) {
                            let found = bits[half] >> (k % WIDTH) & 1 == 1;
                            assert_eq!(found, near(k), "{} of {facet}, {}", k, instructions.name());
                            count += u32::from(found);
                        }
                    }
                }
            }
            assert!(count > 5, "{count} near {facet}");
        }
    }
}
