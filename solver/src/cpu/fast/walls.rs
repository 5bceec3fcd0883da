//! The facets near the sub-particles of a body, and contacts with them. Where several facets are near, which are contacts is decided one sub-particle
//! after the other, and the law worked out many at a time; the others are for [`super::single`].

use glam::Vec3;

use super::body::{MotionScratch, StepContext};
use super::body_pair::SAFETY_FACTOR;
use super::bounds::BodyBounds;
use super::facets::SmallFacet;
use super::instructions::{LaneOps, SimdTask, run_outlined};
use super::kernel::{self, ContactHistories, PairKinematics, PairLoads};
use super::memory::{Lanes3, WIDTH, transposed_lane};
use super::points::{BodyMotion, BodyParticles, slot_of};
use super::single::{SingleFacet, SingleFacetContacts};
use crate::cpu::load::Load;
use crate::engine::frame::Frame;
use crate::physics::contact::ContactHistory;
use crate::walls::contact::WallPair;
use crate::walls::contact::for_each_contact;
use crate::walls::{NearestPoint, Walls};

/// Facets near the sub-particles of a body.
#[derive(Debug, Default)]
pub(super) struct WallList {
    rows: Vec<WallListRow>,
    pub(super) pairs: Vec<WallPair>,
    /// Where the body was when they were looked up.
    searched_at: BodyMotion,
    /// How far surfaces had moved by then at most, in metres.
    searched_travel_m: f64,
    known: bool,
}

/// A sub-particle that has facets near it.
#[derive(Clone, Copy, Debug)]
pub(super) struct WallListRow {
    /// Its number in the body.
    pub(super) of: u32,
    /// Where its facets end among all.
    end: u32,
    /// What body and surfaces must have travelled before it can touch any, in metres.
    due_at_m: f64,
}

/// What a body's sub-particles feel of facets in a step.
#[derive(Debug, Default)]
pub(super) struct WallScratch {
    single: Vec<SingleFacet>,
    touches: Vec<(u32, NearestPoint)>,
    contacts: Vec<WallContact>,
    /// Surfaces and numbers of as_range contacts, surface by surface.
    order: Vec<(u32, u32)>,
}

/// A facet that a sub-particle feels, and what comes of it.
#[derive(Clone, Copy, Debug)]
struct WallContact {
    /// Its slot among the pairs.
    pair: usize,
    /// The sub-particle's number in the body.
    of: u32,
    surface: u32,
    /// From the centre to the nearest point, in metres.
    to_wall: Vec3,
    /// Of the surface there against the sub-particle, in m/s.
    velocity: Vec3,
    /// Twice the surface's, in rad/s.
    spin: Vec3,
    load: Load,
}

impl WallScratch {
    /// Works out the loads, as many at a time as lanes have room, of one surface at a time.
    #[inline(always)]
    fn work_out<S: LaneOps>(
        &mut self,
        simd: S,
        context: &StepContext<'_>,
        mass: f32,
        pairs: &mut [WallPair],
    ) {
        let Self { contacts, order, .. } = self;
        order.clear();
        order.extend((0u32..).zip(&*contacts).map(|(number, contact)| (contact.surface, number)));
        order.sort_unstable();
        let sqrt_m_star = mass.sqrt();
        for of_surface in order.chunk_by(|a, b| a.0 == b.0) {
            let law = &context.wall_laws[of_surface[0].0 as usize];
            for some in of_surface.chunks(2 * WIDTH) {
                let mut kinematics = [PairKinematics::ZERO; 2];
                let mut memory = [ContactHistories::new(), ContactHistories::new()];
                let mut loads = [PairLoads::ZERO; 2];
                for (k, &(_, number)) in some.iter().enumerate() {
                    let (half, lane) = (k / WIDTH, transposed_lane(k % WIDTH));
                    let WallContact { pair, to_wall, velocity, spin, .. } = &contacts[number as usize];
                    let ContactHistory { in_contact, xi } = pairs[*pair].contact;
                    memory[half].in_contact |= u16::from(in_contact) << lane;
                    set(&mut memory[half].xi, lane, xi);
                    set(&mut kinematics[half].offset, lane, *to_wall);
                    set(&mut kinematics[half].velocity, lane, *velocity);
                    set(&mut kinematics[half].spin, lane, *spin);
                }
                let counts = [some.len().min(WIDTH), some.len().saturating_sub(WIDTH)];
                kernel::surfaces(
                    simd,
                    law,
                    context.laws,
                    sqrt_m_star,
                    counts,
                    &kinematics,
                    &mut memory,
                    &mut loads,
                );
                for (k, &(_, number)) in some.iter().enumerate() {
                    let (half, lane) = (k / WIDTH, transposed_lane(k % WIDTH));
                    let contact = &mut contacts[number as usize];
                    contact.load =
                        Load { force: get(&loads[half].force, lane), torque: get(&loads[half].torque, lane) };
                    let in_contact = memory[half].in_contact >> lane & 1 == 1;
                    pairs[contact.pair].contact =
                        ContactHistory { in_contact, xi: get(&memory[half].xi, lane) };
                }
            }
        }
    }
}

impl WallListRow {
    /// DistanceScratch again once the gap to the nearest facet may have closed.
    #[inline(always)]
    pub(super) fn postpone(&mut self, travelled: f64, nearest: f32, context: &StepContext<'_>) {
        self.due_at_m = travelled + SAFETY_FACTOR * f64::from((nearest - context.wall_reach).max(0.0));
    }
}

#[inline(always)]
fn set(lanes: &mut Lanes3, lane: usize, value: Vec3) {
    for axis in 0..3 {
        lanes[axis].0[lane] = value[axis];
    }
}

#[inline(always)]
fn get(lanes: &Lanes3, lane: usize) -> Vec3 {
    Vec3::new(lanes[0].0[lane], lanes[1].0[lane], lanes[2].0[lane])
}

/// A search for the facets near a body.
pub(super) struct WallSearch<'a> {
    pub(super) walls: &'a mut WallList,
    pub(super) motion: &'a BodyMotion,
    pub(super) context: &'a StepContext<'a>,
    pub(super) points: &'a BodyParticles,
    pub(super) at: &'a BodyBounds,
}

impl SimdTask for WallSearch<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: LaneOps>(self, simd: S) {
        let Self { walls, motion, context, points, at } = self;
        walls.search(simd, motion, context, points, at);
    }
}

/// Which sub-particles of two blocks come within `reach` metres of a facet, as bits.
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
    pub(super) fn is_due(&self, motion: &BodyMotion, context: &StepContext<'_>) -> bool {
        let moved =
            motion.since(&self.searched_at) + (context.walls.total_travel_m() - self.searched_travel_m);
        !(self.known && moved <= SAFETY_FACTOR * f64::from(context.wall_skin))
    }

    /// DistanceScratch up the facets near each sub-particle. What in_contact pairs remember stays.
    #[inline(always)]
    fn search<S: LaneOps>(
        &mut self,
        simd: S,
        motion: &BodyMotion,
        context: &StepContext<'_>,
        points: &BodyParticles,
        at: &BodyBounds,
    ) {
        let StepContext { walls, frame, .. } = context;
        let reach = context.wall_reach + context.wall_skin;
        let (centre, half) = at.middle_of_all(frame.unit_m);
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
            // Of two blocks only what either's box is near; then which of their sub-particles are.
            let two = [first, (first + 1).min(points.blocks() - 1)];
            let middles = two.map(|block| at.middle_of(block, frame.unit_m));
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

    /// Adds what facets do to a body's sub-particles; `travelled` is what these and the surfaces have moved at most, in metres.
    #[inline(always)]
    pub(super) fn forces<S: LaneOps>(
        &mut self,
        simd: S,
        travelled: f64,
        context: &StepContext<'_>,
        points: &BodyParticles,
        mass: f32,
        MotionScratch { sums, wall_scratch, .. }: &mut MotionScratch,
    ) {
        let StepContext { walls, frame, radius, .. } = context;
        wall_scratch.contacts.clear();
        wall_scratch.single.clear();
        let mut from = 0;
        for (number, row) in (0u32..).zip(&mut self.rows) {
            let first = std::mem::replace(&mut from, row.end as usize);
            if travelled < row.due_at_m {
                continue;
            }
            let facet = self.pairs[first].facet;
            if from == first + 1 && SmallFacet::of(walls, facet).is_some() {
                wall_scratch.single.push(SingleFacet { facet, row: number, pair: first as u32 });
                continue;
            }
            let me = points.particle(row.of as usize);
            let near = &mut self.pairs[first..from];
            let contacts = &mut wall_scratch.contacts;
            let nearest = for_each_contact(
                *radius,
                frame,
                walls,
                me.position,
                near,
                &mut wall_scratch.touches,
                |k, wall, touch| {
                    contacts.push(WallContact {
                        pair: first + k,
                        of: row.of,
                        surface: walls.surface_of(wall.facet) as u32,
                        to_wall: touch.to_wall,
                        velocity: touch.velocity - me.velocity - me.spin.cross(touch.to_wall),
                        spin: touch.spin * 2.0,
                        load: Load::default(),
                    });
                },
            );
            row.postpone(travelled, nearest, context);
        }
        wall_scratch.work_out(simd, context, mass, &mut self.pairs);
        // In the order of rows, whatever was worked out together.
        for WallContact { pair, of, load, .. } in &wall_scratch.contacts {
            self.pairs[*pair].force = load.force;
            sums.add(slot_of(*of), load);
        }
        wall_scratch.single.sort_unstable_by_key(|single| (single.facet, single.row));
        for single in wall_scratch.single.chunk_by(|a, b| a.facet == b.facet) {
            let facet = SmallFacet::of(walls, single[0].facet).expect("as before");
            for single in single.chunks(2 * WIDTH) {
                let (rows, pairs) = (&mut self.rows[..], &mut self.pairs[..]);
                run_outlined(
                    simd,
                    SingleFacetContacts {
                        rows,
                        pairs,
                        single,
                        facet,
                        travelled,
                        context,
                        points,
                        mass,
                        sums,
                    },
                );
            }
        }
    }

    /// Renumbers sub-particles; as_range that map to `u32::MAX` are gone.
    pub(super) fn renumber(&mut self, locals: &[u32]) {
        let old = std::mem::take(self);
        let mut from = 0;
        for row in old.rows {
            let of = locals[row.of as usize];
            if of != u32::MAX {
                self.pairs.extend_from_slice(&old.pairs[from as usize..row.end as usize]);
                self.rows.push(WallListRow { of, end: self.pairs.len() as u32, ..row });
            }
            from = row.end;
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;
    use serde_json::json;

    use super::super::instructions::InstructionSet;
    use super::super::points::random_bodies;
    use super::*;
    use crate::engine::scene::Scene;
    use crate::equipment::{Surface, SurfaceKind};
    use crate::experiments::prepare;
    use crate::mesh::Meshes;
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
    fn sub_particles_near_a_facet_are_those_that_touch_says() {
        let plate = |u: DVec3, v: DVec3| {
            Surface::parallelogram("plate", SurfaceKind::Equipment, (u + v) * -0.5, u, v)
        };
        // SearchSides triangles; twenty in one plane; two that are long for their width.
        let mut cut = plate(DVec3::X * 0.1, DVec3::Z * 0.1);
        let strips = (0..10).map(|k| DVec3::X * 0.1 * f64::from(k));
        let strip = |shift: DVec3| {
            let triangles = plate(DVec3::X * 0.1, DVec3::Z * 0.1).triangles;
            triangles.into_iter().map(move |corners| corners.map(|corner| corner + shift))
        };
        cut.triangles = strips.flat_map(strip).collect();
        let surfaces = vec![plate(DVec3::X * 0.1, DVec3::Y * 0.1), cut, plate(DVec3::X, DVec3::Y * 1e-4)];
        let drop = from_value(&json!({"experiment": "drop"})).expect("a scenario");
        let scene = Scene { surfaces, ..prepare(&drop, &Meshes::default()).scene };
        let frame = Frame::new(DVec3::splat(-1.0), DVec3::splat(1.0), false);
        let walls = Walls::new(&scene, &frame);
        let few: Vec<bool> = (0..3).map(|facet| SmallFacet::of(&walls, facet).is_some()).collect();
        assert_eq!(few, [true, false, false]);
        // Three blocks, the last of 5: single it is both of two.
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
