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
use crate::engine::wall_pair::WallPair;
use crate::physics::contact::{self, ContactHistory};
use crate::physics::damping::SURFACE_CAP;
use crate::walls::NearestPoint;
use crate::walls::contact::{Seer, for_each_contact};

/// Scratch memory of one thread for contacts with facets.
#[derive(Debug, Default)]
pub(crate) struct WallScratch {
    single: Vec<SingleFacet>,
    /// Rows that are evaluated one by one.
    rows: Vec<u32>,
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
    /// Its length, negative beyond the facet.
    distance: f32,
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
        for (number, contact) in (0u32..).zip(&mut *contacts) {
            // Centres beyond a facet are rare.
            if contact.distance < 0.0 {
                contact.evaluate(context, mass, &mut pairs[contact.pair].contact);
            } else {
                order.push((contact.surface, number));
            }
        }
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

impl WallContact {
    /// Evaluates the load beyond a facet, as the plain path does.
    fn evaluate(&mut self, context: &StepContext<'_>, mass: f32, history: &mut ContactHistory) {
        let law = context.walls.law_of_surface(self.surface as usize);
        let (n, delta) = (self.to_wall / self.distance, context.radius - self.distance);
        let (v, spin, dt) = (-self.velocity, self.spin * 0.5, context.laws.dt);
        let force = contact::force(law, history, n, delta, v, spin, mass, SURFACE_CAP, dt);
        if let Some(force) = force {
            self.load.force = force.normal + force.tangential;
            self.load.torque = self.to_wall.cross(force.tangential);
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
    /// Adds the loads of facets. `travelled` bounds the travel of body and surfaces, in metres, and `step_m` its part in
    /// the last step. Returns how many surfaces were passed through.
    #[inline(always)]
    #[expect(clippy::too_many_arguments, reason = "the data of a body and its scratch memory")]
    pub(crate) fn forces<S: LaneOps>(
        &mut self,
        simd: S,
        travelled: f64,
        step_m: f32,
        context: &StepContext<'_>,
        points: &BodyParticles,
        mass: f32,
        sums: &mut LoadSums,
        wall_scratch: &mut WallScratch,
    ) -> u32 {
        let StepContext { walls, frame, radius, .. } = context;
        wall_scratch.contacts.clear();
        wall_scratch.single.clear();
        wall_scratch.rows.clear();
        let mut from = 0;
        for (number, row) in (0u32..).zip(&self.rows) {
            let first = std::mem::replace(&mut from, row.end as usize);
            if travelled < row.due_at_m {
                continue;
            }
            let facet = self.pairs[first].facet;
            if from == first + 1 && SmallFacet::of(walls, facet).is_some() {
                wall_scratch.single.push(SingleFacet { facet, row: number, pair: first as u32 });
            } else {
                wall_scratch.rows.push(number);
            }
        }
        wall_scratch.single.sort_unstable_by_key(|single| (single.facet, single.row));
        for single in wall_scratch.single.chunk_by(|a, b| a.facet == b.facet) {
            let facet = SmallFacet::of(walls, single[0].facet).expect("as before");
            for single in single.chunks(2 * WIDTH) {
                let (rows, pairs, crossing) =
                    (&mut self.rows[..], &mut self.pairs[..], &mut wall_scratch.rows);
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
                        step_m,
                        crossing,
                    },
                );
            }
        }
        let mut passed = 0;
        for number in &wall_scratch.rows {
            let first = if *number == 0 { 0 } else { self.rows[*number as usize - 1].end as usize };
            let row = &mut self.rows[*number as usize];
            let me = points.particle(row.of as usize);
            let near = &mut self.pairs[first..row.end as usize];
            let contacts = &mut wall_scratch.contacts;
            let seer =
                Seer { radius: *radius, position: me.position, velocity: me.velocity, dt: context.laws.dt };
            let stats =
                for_each_contact(&seer, frame, walls, near, &mut wall_scratch.points, |k, wall, point| {
                    contacts.push(WallContact {
                        pair: first + k,
                        of: row.of,
                        surface: walls.surface_of(wall.facet) as u32,
                        to_wall: point.to_wall,
                        distance: point.signed_distance(),
                        velocity: point.velocity - me.velocity - me.spin.cross(point.to_wall),
                        spin: point.spin * 2.0,
                        load: Load::default(),
                    });
                });
            row.postpone(travelled, stats.nearest, context);
            passed += stats.passed;
        }
        wall_scratch.evaluate(simd, context, mass, &mut self.pairs);
        // Sum in the order of rows, independent of the order of evaluation.
        for WallContact { pair, of, load, .. } in &wall_scratch.contacts {
            self.pairs[*pair].force = load.force;
            sums.add(slot_of(*of), load);
        }
        passed
    }
}
