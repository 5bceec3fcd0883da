//! The facets near the sub-particles of a body, and contacts with them. Where several facets are near, which are felt is decided one sub-particle
//! after the other, and the law worked out many at a time; the others are for [`super::alone`].

use glam::Vec3;

use super::alone::{Alone, Touching};
use super::body::{Desk, Surroundings};
use super::facets::FewTriangles;
use super::instructions::{Job, Wide, by_itself};
use super::kernel::{self, Contacts, Felt, Seen};
use super::meeting::SAFE;
use super::memory::{Lanes3, WIDTH, quad_of};
use super::points::{Motion, Points, place_of};
use super::whereabouts::Whereabouts;
use crate::cpu::forces::{Load, feel_walls};
use crate::cpu::lists::WallPair;
use crate::cpu::walls::{Touch, Walls};
use crate::engine::frame::Frame;
use crate::physics::contact::ContactHistory;

/// Facets near the sub-particles of a body.
#[derive(Debug, Default)]
pub(super) struct NearWalls {
    rows: Vec<WallRow>,
    pub(super) pairs: Vec<WallPair>,
    /// Where the body was when they were looked up.
    seen: Motion,
    /// How far surfaces had moved by then at most, in metres.
    seen_moved: f64,
    known: bool,
}

/// A sub-particle that has facets near it.
#[derive(Clone, Copy, Debug)]
pub(super) struct WallRow {
    /// Its number in the body.
    pub(super) of: u32,
    /// Where its facets end among all.
    end: u32,
    /// What body and surfaces must have travelled before it can touch any, in metres.
    wakes: f64,
}

/// What a body's sub-particles feel of facets in a step.
#[derive(Debug, Default)]
pub(super) struct Met {
    alone: Vec<Alone>,
    touches: Vec<(u32, Touch)>,
    felt: Vec<FeltWall>,
    /// Surfaces and numbers of those felt, surface by surface.
    order: Vec<(u32, u32)>,
}

/// A facet that a sub-particle feels, and what comes of it.
#[derive(Clone, Copy, Debug)]
struct FeltWall {
    /// Its place among the pairs.
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

impl Met {
    /// Works out the loads, as many at a time as lanes have room, of one surface at a time.
    #[inline(always)]
    fn work_out<S: Wide>(&mut self, simd: S, around: &Surroundings<'_>, mass: f32, pairs: &mut [WallPair]) {
        let Self { felt, order, .. } = self;
        order.clear();
        order.extend((0u32..).zip(&*felt).map(|(number, felt)| (felt.surface, number)));
        order.sort_unstable();
        let root_mass = mass.sqrt();
        for of_surface in order.chunk_by(|a, b| a.0 == b.0) {
            let law = &around.wall_laws[of_surface[0].0 as usize];
            for some in of_surface.chunks(2 * WIDTH) {
                let mut seen = [Seen::NOTHING; 2];
                let mut memory = [Contacts::new(), Contacts::new()];
                let mut loads = [Felt::NOTHING; 2];
                for (k, &(_, number)) in some.iter().enumerate() {
                    let (half, lane) = (k / WIDTH, quad_of(k % WIDTH));
                    let FeltWall { pair, to_wall, velocity, spin, .. } = &felt[number as usize];
                    let ContactHistory { in_contact, xi } = pairs[*pair].contact;
                    memory[half].held |= u16::from(in_contact) << lane;
                    set(&mut memory[half].xi, lane, xi);
                    set(&mut seen[half].apart, lane, *to_wall);
                    set(&mut seen[half].velocity, lane, *velocity);
                    set(&mut seen[half].spin, lane, *spin);
                }
                let counts = [some.len().min(WIDTH), some.len().saturating_sub(WIDTH)];
                kernel::surfaces(simd, law, around.laws, root_mass, counts, &seen, &mut memory, &mut loads);
                for (k, &(_, number)) in some.iter().enumerate() {
                    let (half, lane) = (k / WIDTH, quad_of(k % WIDTH));
                    let felt = &mut felt[number as usize];
                    felt.load =
                        Load { force: get(&loads[half].force, lane), torque: get(&loads[half].torque, lane) };
                    let in_contact = memory[half].held >> lane & 1 == 1;
                    pairs[felt.pair].contact = ContactHistory { in_contact, xi: get(&memory[half].xi, lane) };
                }
            }
        }
    }
}

impl WallRow {
    /// Looks again once the gap to the nearest facet may have closed.
    #[inline(always)]
    pub(super) fn put_off(&mut self, travelled: f64, nearest: f32, around: &Surroundings<'_>) {
        self.wakes = travelled + SAFE * f64::from((nearest - around.wall_reach).max(0.0));
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
pub(super) struct LookUp<'a> {
    pub(super) walls: &'a mut NearWalls,
    pub(super) motion: &'a Motion,
    pub(super) around: &'a Surroundings<'a>,
    pub(super) points: &'a Points,
    pub(super) at: &'a Whereabouts,
}

impl Job for LookUp<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Wide>(self, simd: S) {
        let Self { walls, motion, around, points, at } = self;
        walls.search(simd, motion, around, points, at);
    }
}

/// Which sub-particles of two blocks come within `reach` metres of a facet, as bits.
#[inline(always)]
fn near_facet<S: Wide>(
    simd: S,
    walls: &Walls,
    facet: u32,
    frame: &Frame,
    points: &Points,
    two: [usize; 2],
    reach: f32,
) -> [u16; 2] {
    let Some(few) = FewTriangles::of(walls, facet) else {
        let mut near = [0; 2];
        for (near, block) in near.iter_mut().zip(two) {
            for k in block * WIDTH..points.count.min((block + 1) * WIDTH) {
                let position = points.particle(k).position;
                let is_near = walls.touch(facet, position, frame).distance <= reach;
                *near |= u16::from(is_near) << (k % WIDTH);
            }
        }
        return near;
    };
    let ([x, y, z, _], [u, v, w, _]) = (points.positions_of(simd, two[0]), points.positions_of(simd, two[1]));
    let [a, b] = few.distances(simd, frame, [&[x, y, z], &[u, v, w]]);
    [simd.at_most(&a, reach), simd.at_most(&b, reach)]
}

impl NearWalls {
    pub(super) fn is_due(&self, motion: &Motion, around: &Surroundings<'_>) -> bool {
        let moved = motion.since(&self.seen) + (around.walls.moved_in_all_m() - self.seen_moved);
        !(self.known && moved <= SAFE * f64::from(around.wall_skin))
    }

    /// Looks up the facets near each sub-particle. What in_contact pairs remember stays.
    #[inline(always)]
    fn search<S: Wide>(
        &mut self,
        simd: S,
        motion: &Motion,
        around: &Surroundings<'_>,
        points: &Points,
        at: &Whereabouts,
    ) {
        let Surroundings { walls, frame, .. } = around;
        let reach = around.wall_reach + around.wall_skin;
        let (centre, half) = at.middle_of_all(frame.unit_m);
        let near: Vec<u32> = walls.within(centre, reach + half, frame).collect();
        let old = std::mem::take(self);
        self.known = true;
        self.seen = *motion;
        self.seen_moved = walls.moved_in_all_m();
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
                let reaches = |(centre, half)| walls.touch(facet, centre, frame).distance <= reach + half;
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
                    self.rows.push(WallRow { of: k, end, wakes: f64::NEG_INFINITY });
                }
            }
        }
    }

    /// Adds what facets do to a body's sub-particles; `travelled` is what these and the surfaces have moved at most, in metres.
    #[inline(always)]
    pub(super) fn forces<S: Wide>(
        &mut self,
        simd: S,
        travelled: f64,
        around: &Surroundings<'_>,
        points: &Points,
        mass: f32,
        Desk { sums, met, .. }: &mut Desk,
    ) {
        let Surroundings { walls, frame, radius, .. } = around;
        met.felt.clear();
        met.alone.clear();
        let mut from = 0;
        for (number, row) in (0u32..).zip(&mut self.rows) {
            let first = std::mem::replace(&mut from, row.end as usize);
            if travelled < row.wakes {
                continue;
            }
            let facet = self.pairs[first].facet;
            if from == first + 1 && FewTriangles::of(walls, facet).is_some() {
                met.alone.push(Alone { facet, row: number, pair: first as u32 });
                continue;
            }
            let me = points.particle(row.of as usize);
            let near = &mut self.pairs[first..from];
            let felt = &mut met.felt;
            let nearest =
                feel_walls(*radius, frame, walls, me.position, near, &mut met.touches, |k, wall, touch| {
                    felt.push(FeltWall {
                        pair: first + k,
                        of: row.of,
                        surface: walls.surface_of(wall.facet) as u32,
                        to_wall: touch.to_wall,
                        velocity: touch.velocity - me.velocity - me.spin.cross(touch.to_wall),
                        spin: touch.spin * 2.0,
                        load: Load::default(),
                    });
                });
            row.put_off(travelled, nearest, around);
        }
        met.work_out(simd, around, mass, &mut self.pairs);
        // In the order of rows, whatever was worked out together.
        for FeltWall { pair, of, load, .. } in &met.felt {
            self.pairs[*pair].force = load.force;
            sums.add(place_of(*of), load);
        }
        met.alone.sort_unstable_by_key(|alone| (alone.facet, alone.row));
        for alone in met.alone.chunk_by(|a, b| a.facet == b.facet) {
            let facet = FewTriangles::of(walls, alone[0].facet).expect("as before");
            for alone in alone.chunks(2 * WIDTH) {
                let (rows, pairs) = (&mut self.rows[..], &mut self.pairs[..]);
                by_itself(
                    simd,
                    Touching { rows, pairs, alone, facet, travelled, around, points, mass, sums },
                );
            }
        }
    }

    /// Renumbers sub-particles; those that map to `u32::MAX` are gone.
    pub(super) fn renumber(&mut self, locals: &[u32]) {
        let old = std::mem::take(self);
        let mut from = 0;
        for row in old.rows {
            let of = locals[row.of as usize];
            if of != u32::MAX {
                self.pairs.extend_from_slice(&old.pairs[from as usize..row.end as usize]);
                self.rows.push(WallRow { of, end: self.pairs.len() as u32, ..row });
            }
            from = row.end;
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;
    use serde_json::json;

    use super::super::instructions::Instructions;
    use super::super::points::scattered;
    use super::*;
    use crate::engine::scene::Scene;
    use crate::equipment::{Surface, SurfaceKind};
    use crate::experiments::prepare;
    use crate::mesh::Meshes;
    use crate::scenario::from_value;

    struct Near<'a>(&'a Walls, u32, &'a Frame, &'a Points, [usize; 2]);

    impl Job for Near<'_> {
        type Output = [u16; 2];

        #[inline(always)]
        fn run<S: Wide>(self, simd: S) -> [u16; 2] {
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
        // Two triangles; twenty in one plane; two that are long for their width.
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
        let few: Vec<bool> = (0..3).map(|facet| FewTriangles::of(&walls, facet).is_some()).collect();
        assert_eq!(few, [true, false, false]);
        // Three blocks, the last of 5: alone it is both of two.
        let points = &scattered(frame, &[(37, DVec3::ZERO, 0.05)])[0];
        for facet in 0..3 {
            let near = |k: usize| walls.touch(facet, points.particle(k).position, &frame).distance <= REACH;
            let mut count = 0;
            for two in [[0, 1], [2, 2]] {
                for instructions in Instructions::available() {
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
