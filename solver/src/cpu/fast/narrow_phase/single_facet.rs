//! Contacts of sub-particles that have a single facet near them, as on a plate: geometry and force in lanes.

use glam::Vec3;

use super::kernels;
use crate::cpu::fast::broad_phase::facets::{ParticleLanes, SmallFacet};
use crate::cpu::fast::instructions::arrays::{Quads, WIDTH, transposed_lane};
use crate::cpu::fast::instructions::set::{LaneOps, SimdTask};
use crate::cpu::fast::instructions::transpose::three;
use crate::cpu::fast::storage::context::StepContext;
use crate::cpu::fast::storage::loads::LoadSums;
use crate::cpu::fast::storage::pair_lanes::{ContactHistories, PairLoads};
use crate::cpu::fast::storage::particles::{BodyParticles, slot_of};
use crate::cpu::fast::storage::wall_list::WallListRow;
use crate::cpu::load::Load;
use crate::engine::wall_pair::WallPair;
use crate::physics::contact::ContactHistory;
use crate::walls::NearestPoint;

/// A sub-particle with a single facet near it, of few triangles.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SingleFacet {
    pub(crate) facet: u32,
    /// Indices of its row and of its entry in the wall list.
    pub(crate) row: u32,
    pub(crate) pair: u32,
}

/// Contacts with one facet, as many as two chunks hold.
pub(crate) struct SingleFacetContacts<'a> {
    pub(crate) rows: &'a mut [WallListRow],
    pub(crate) pairs: &'a mut [WallPair],
    pub(crate) single: &'a [SingleFacet],
    pub(crate) facet: SmallFacet<'a>,
    /// Upper bound of the travel of body and surfaces, in metres.
    pub(crate) travelled: f64,
    pub(crate) context: &'a StepContext<'a>,
    pub(crate) points: &'a BodyParticles,
    /// Mass of each sub-particle, in kilograms.
    pub(crate) mass: f32,
    pub(crate) sums: &'a mut LoadSums,
    /// Maximum motion relative to a surface in a step, in metres.
    pub(crate) step_m: f32,
    /// Takes the rows whose sub-particles may be crossing the facet. They are left unchanged.
    pub(crate) crossing: &'a mut Vec<u32>,
}

impl SimdTask for SingleFacetContacts<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: LaneOps>(self, simd: S) {
        let Self { rows, pairs, single, facet, travelled, context, points, mass, sums, step_m, crossing } =
            self;
        let surface = context.walls.surface_of(single[0].facet);
        let law = &context.wall_laws[surface];
        let [mut position, mut velocity, mut spin, mut histories] = [[Quads::ZERO; 2]; 4];
        let mut contact_bits = [0; 2];
        for (k, SingleFacet { row, pair, .. }) in single.iter().enumerate() {
            let (half, at) = (k / WIDTH, k % WIDTH);
            let slot = slot_of(rows[*row as usize].of) as usize;
            position[half].0[at] = points.positions[slot].map(|x| f32::from_bits(x as u32));
            let [u, v, w, y, p, q, r, z] = points.velocities[slot];
            velocity[half].0[at] = [u, v, w, y];
            spin[half].0[at] = [p, q, r, z];
            let ContactHistory { in_contact, xi } = pairs[*pair as usize].contact;
            histories[half].0[at] = xi.extend(0.0).to_array();
            contact_bits[half] |= u16::from(in_contact) << transposed_lane(at);
        }
        let seers = [
            ParticleLanes::of(simd, &position[0], &velocity[0], &spin[0]),
            ParticleLanes::of(simd, &position[1], &velocity[1], &spin[1]),
        ];
        let reach = context.walls.law_of_surface(surface).adhesion_range();
        let (kinematics, distances) = facet.kinematics(simd, context.frame, [context.radius, reach], &seers);
        let mut contacts = [
            ContactHistories { in_contact: contact_bits[0], xi: three(simd, &histories[0]) },
            ContactHistories { in_contact: contact_bits[1], xi: three(simd, &histories[1]) },
        ];
        let mut loads = [PairLoads::ZERO; 2];
        let counts = [single.len().min(WIDTH), single.len().saturating_sub(WIDTH)];
        kernels::surfaces(
            simd,
            law,
            context.laws,
            mass.sqrt(),
            counts,
            &kinematics,
            &mut contacts,
            &mut loads,
        );
        for half in 0..2 {
            let PairLoads { force: [x, y, z], torque: [p, q, r] } = &loads[half];
            let forces = simd.to_quads([x, y, z, &distances[half].distance]).0;
            let torques = simd.to_quads([p, q, r, &distances[half].height]).0;
            let ContactHistories { in_contact, xi: [x, y, z] } = &contacts[half];
            let stored = simd.to_quads([x, y, z, &simd.splat_masked(1.0, *in_contact)]).0;
            let these = single.iter().skip(half * WIDTH).take(WIDTH);
            for (((SingleFacet { row, pair, .. }, force), torque), histories) in
                these.zip(&forces).zip(&torques).zip(&stored)
            {
                let (number, row, pair) = (*row, &mut rows[*row as usize], &mut pairs[*pair as usize]);
                let [x, y, z, distance] = *force;
                let [p, q, r, height] = *torque;
                let is_far = context.radius - distance < -reach;
                let Some(side) = pair.side.next_if_usual(&NearestPoint::at(distance, height), is_far, step_m)
                else {
                    crossing.push(number);
                    continue;
                };
                pair.side = side;
                let load = Load { force: Vec3::new(x, y, z), torque: Vec3::new(p, q, r) };
                let [x, y, z, in_contact] = *histories;
                pair.contact = ContactHistory { in_contact: in_contact != 0.0, xi: Vec3::new(x, y, z) };
                pair.force = load.force;
                sums.add(slot_of(row.of), &load);
                row.postpone(travelled, distance, context);
            }
        }
    }
}
