//! Contacts of sub-particles that have one facet near them and nothing else, as nearly all that touch a plate: where they touch and the
//! law, both many at a time.

use glam::Vec3;

use super::body::Surroundings;
use super::facets::{FewTriangles, Seers};
use super::instructions::{Job, Wide};
use super::kernel::{self, Contacts, Felt};
use super::load::{Sums, three};
use super::memory::{Lanes, Quads, WIDTH, quad_of};
use super::points::{Points, place_of};
use super::walls::WallRow;
use crate::cpu::forces::Load;
use crate::cpu::lists::WallPair;
use crate::physics::contact::ContactHistory;

/// A sub-particle that has one facet near it, of few triangles.
#[derive(Clone, Copy, Debug)]
pub(super) struct Alone {
    pub(super) facet: u32,
    /// Its row, and its pair.
    pub(super) row: u32,
    pub(super) pair: u32,
}

/// Sub-particles that touch one facet and nothing else, as many as lanes have room.
pub(super) struct Touching<'a> {
    pub(super) rows: &'a mut [WallRow],
    pub(super) pairs: &'a mut [WallPair],
    pub(super) alone: &'a [Alone],
    pub(super) facet: FewTriangles<'a>,
    /// What they and the surfaces have moved at most, in metres.
    pub(super) travelled: f64,
    pub(super) around: &'a Surroundings<'a>,
    pub(super) points: &'a Points,
    /// Mass of each, in kilograms.
    pub(super) mass: f32,
    pub(super) sums: &'a mut Sums,
}

impl Job for Touching<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Wide>(self, simd: S) {
        let Self { rows, pairs, alone, facet, travelled, around, points, mass, sums } = self;
        let surface = around.walls.surface_of(alone[0].facet);
        let law = &around.wall_laws[surface];
        let [mut position, mut velocity, mut spin, mut memory] = [[Quads::ZERO; 2]; 4];
        let mut held = [0; 2];
        for (k, Alone { row, pair, .. }) in alone.iter().enumerate() {
            let (half, at) = (k / WIDTH, k % WIDTH);
            let place = place_of(rows[*row as usize].of) as usize;
            position[half].0[at] = points.positions[place].map(|x| f32::from_bits(x as u32));
            let [u, v, w, y, p, q, r, z] = points.velocities[place];
            velocity[half].0[at] = [u, v, w, y];
            spin[half].0[at] = [p, q, r, z];
            let ContactHistory { in_contact, xi } = pairs[*pair as usize].contact;
            memory[half].0[at] = xi.extend(0.0).to_array();
            held[half] |= u16::from(in_contact) << quad_of(at);
        }
        let seers = [
            Seers::of(simd, &position[0], &velocity[0], &spin[0]),
            Seers::of(simd, &position[1], &velocity[1], &spin[1]),
        ];
        let reach = around.walls.law_of_surface(surface).adhesion_range();
        let (seen, distances) = facet.seen(simd, around.frame, [around.radius, reach], &seers);
        let mut contacts = [
            Contacts { held: held[0], xi: three(simd, &memory[0]) },
            Contacts { held: held[1], xi: three(simd, &memory[1]) },
        ];
        let mut loads = [Felt::NOTHING; 2];
        let counts = [alone.len().min(WIDTH), alone.len().saturating_sub(WIDTH)];
        kernel::surfaces(simd, law, around.laws, mass.sqrt(), counts, &seen, &mut contacts, &mut loads);
        for half in 0..2 {
            let Felt { force: [x, y, z], torque: [p, q, r] } = &loads[half];
            let forces = simd.to_quads([x, y, z, &distances[half]]).0;
            let torques = simd.to_quads([p, q, r, &Lanes::ZERO]).0;
            let Contacts { held, xi: [x, y, z] } = &contacts[half];
            let memories = simd.to_quads([x, y, z, &simd.only(1.0, *held)]).0;
            let these = alone.iter().skip(half * WIDTH).take(WIDTH);
            for (((Alone { row, pair, .. }, force), torque), memory) in
                these.zip(&forces).zip(&torques).zip(&memories)
            {
                let (row, pair) = (&mut rows[*row as usize], &mut pairs[*pair as usize]);
                let [x, y, z, distance] = *force;
                let [p, q, r, _] = *torque;
                let load = Load { force: Vec3::new(x, y, z), torque: Vec3::new(p, q, r) };
                let [x, y, z, held] = *memory;
                pair.contact = ContactHistory { in_contact: held != 0.0, xi: Vec3::new(x, y, z) };
                pair.force = load.force;
                sums.add(place_of(row.of), &load);
                row.put_off(travelled, distance, around);
            }
        }
    }
}
