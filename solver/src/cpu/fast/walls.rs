//! The facets near the sub-particles of a body, and contacts with them. Where several facets are near, which are felt is decided one sub-particle
//! after the other, and the law worked out many at a time; the others are for [`super::alone`].

use glam::{DVec3, Vec3};

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
use crate::physics::contact::ContactMemory;

/// Facets near the sub-particles of a body.
#[derive(Debug, Default)]
pub(super) struct NearWalls {
    rows: Vec<WallRow>,
    pub(super) pairs: Vec<WallPair>,
    seen_shift: DVec3,
    seen_path: f64,
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
                    let ContactMemory { touching, slide } = pairs[*pair].contact;
                    memory[half].held |= u16::from(touching) << lane;
                    set(&mut memory[half].slide, lane, slide);
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
                    let touching = memory[half].held >> lane & 1 == 1;
                    pairs[felt.pair].contact =
                        ContactMemory { touching, slide: get(&memory[half].slide, lane) };
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
        return two.map(|block| {
            let those = block * WIDTH..points.count.min((block + 1) * WIDTH);
            those.fold(0, |near, k| {
                let position = points.particle(k).position;
                let is_near = walls.touch(facet, position, frame).distance <= reach;
                near | u16::from(is_near) << (k % WIDTH)
            })
        });
    };
    let ([x, y, z, _], [u, v, w, _]) = (points.positions_of(simd, two[0]), points.positions_of(simd, two[1]));
    let [a, b] = few.distances(simd, frame, [&[x, y, z], &[u, v, w]]);
    [simd.at_most(&a, reach), simd.at_most(&b, reach)]
}

impl NearWalls {
    pub(super) fn is_due(&self, motion: &Motion, around: &Surroundings<'_>) -> bool {
        let moved = motion.shift.distance(self.seen_shift)
            + (motion.path - self.seen_path)
            + (around.walls.moved_in_all_m() - self.seen_moved);
        !(self.known && moved <= SAFE * f64::from(around.wall_skin))
    }

    /// Looks up the facets near each sub-particle. What touching pairs remember stays.
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
        self.seen_shift = motion.shift;
        self.seen_path = motion.path;
        self.seen_moved = walls.moved_in_all_m();
        let mut old_rows = old.rows.iter().scan(0, |from, row| {
            let pairs = (row.of, *from as usize..row.end as usize);
            *from = row.end;
            Some(pairs)
        });
        let mut known = old_rows.next();
        let mut close = Vec::new();
        for first in (0..points.blocks()).step_by(2) {
            // Of two blocks only what either's box is near; then which of their sub-particles are.
            let two = [first, (first + 1).min(points.blocks() - 1)];
            close.clear();
            for &facet in &near {
                let reaches = |block: usize| {
                    let (centre, half) = at.middle_of(block, frame.unit_m);
                    walls.touch(facet, centre, frame).distance <= reach + half
                };
                if two.into_iter().any(reaches) {
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
