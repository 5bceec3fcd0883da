//! Contacts with facets.
//!
//! Where several facets are near, [`crate::walls::contact`] decides sub-particle by sub-particle which facets act; the
//! forces are then evaluated in lanes. A sub-particle with one facet near it takes the path of [`super::single_facet`].

use glam::Vec3;

use super::kernels;
use super::single_facet::{SingleFacet, SingleFacetContacts};
use crate::cpu::fast::broad_phase::facets::SmallFacet;
use crate::cpu::fast::instructions::arrays::{Lanes3, WIDTH, transposed_lane};
use crate::cpu::fast::instructions::set::{LaneOps, run_outlined};
use crate::cpu::fast::storage::context::StepContext;
use crate::cpu::fast::storage::loads::LoadSums;
use crate::cpu::fast::storage::pair_lanes::{ContactHistories, PairKinematics, PairLoads};
use crate::cpu::fast::storage::particles::{BodyParticles, slot_of};
use crate::cpu::fast::storage::wall_list::WallList;
use crate::cpu::load::Load;
use crate::physics::contact::ContactHistory;
use crate::walls::NearestPoint;
use crate::walls::contact::{WallPair, for_each_contact};

/// Scratch memory of one thread for contacts with facets.
#[derive(Debug, Default)]
pub(crate) struct WallScratch {
    single: Vec<SingleFacet>,
    points: Vec<(u32, NearestPoint)>,
    contacts: Vec<WallContact>,
    /// Surface and index of each contact, sorted by surface.
    order: Vec<(u32, u32)>,
}

/// A facet that acts on a sub-particle, and its load.
#[derive(Clone, Copy, Debug)]
struct WallContact {
    /// Index in the wall list.
    pair: usize,
    /// Index of the sub-particle in the body.
    of: u32,
    surface: u32,
    /// Vector from the centre to the nearest point, in metres.
    to_wall: Vec3,
    /// Velocity of the surface there relative to the sub-particle, in m/s.
    velocity: Vec3,
    /// Twice the spin of the surface, in rad/s.
    spin: Vec3,
    load: Load,
}

impl WallScratch {
    /// Evaluates the loads, two chunks at a time, surface by surface.
    #[inline(always)]
    fn evaluate<S: LaneOps>(
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
                let mut histories = [ContactHistories::new(), ContactHistories::new()];
                let mut loads = [PairLoads::ZERO; 2];
                for (k, &(_, number)) in some.iter().enumerate() {
                    let (half, lane) = (k / WIDTH, transposed_lane(k % WIDTH));
                    let WallContact { pair, to_wall, velocity, spin, .. } = &contacts[number as usize];
                    let ContactHistory { in_contact, xi } = pairs[*pair].contact;
                    histories[half].in_contact |= u16::from(in_contact) << lane;
                    set(&mut histories[half].xi, lane, xi);
                    set(&mut kinematics[half].offset, lane, *to_wall);
                    set(&mut kinematics[half].velocity, lane, *velocity);
                    set(&mut kinematics[half].spin, lane, *spin);
                }
                let counts = [some.len().min(WIDTH), some.len().saturating_sub(WIDTH)];
                kernels::surfaces(
                    simd,
                    law,
                    context.laws,
                    sqrt_m_star,
                    counts,
                    &kinematics,
                    &mut histories,
                    &mut loads,
                );
                for (k, &(_, number)) in some.iter().enumerate() {
                    let (half, lane) = (k / WIDTH, transposed_lane(k % WIDTH));
                    let contact = &mut contacts[number as usize];
                    contact.load =
                        Load { force: get(&loads[half].force, lane), torque: get(&loads[half].torque, lane) };
                    let in_contact = histories[half].in_contact >> lane & 1 == 1;
                    pairs[contact.pair].contact =
                        ContactHistory { in_contact, xi: get(&histories[half].xi, lane) };
                }
            }
        }
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

impl WallList {
    /// Adds the loads of facets. `travelled` bounds the travel of body and surfaces, in metres.
    #[inline(always)]
    #[expect(clippy::too_many_arguments, reason = "the data of a body and its scratch memory")]
    pub(crate) fn forces<S: LaneOps>(
        &mut self,
        simd: S,
        travelled: f64,
        context: &StepContext<'_>,
        points: &BodyParticles,
        mass: f32,
        sums: &mut LoadSums,
        wall_scratch: &mut WallScratch,
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
                &mut wall_scratch.points,
                |k, wall, point| {
                    contacts.push(WallContact {
                        pair: first + k,
                        of: row.of,
                        surface: walls.surface_of(wall.facet) as u32,
                        to_wall: point.to_wall,
                        velocity: point.velocity - me.velocity - me.spin.cross(point.to_wall),
                        spin: point.spin * 2.0,
                        load: Load::default(),
                    });
                },
            );
            row.postpone(travelled, nearest, context);
        }
        wall_scratch.evaluate(simd, context, mass, &mut self.pairs);
        // Sum in the order of rows, independent of the order of evaluation.
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
}
