//! Saving and restoring a run. Lists start with what was saved, exhausted, and are renewed in the first step.

use super::FastRun;
use super::broad_phase::body_pair::BodyPair;
use super::instructions::set::InstructionSet;
use super::storage::body::Body;
use super::storage::bond_set::{Bond, BondSet};
use super::storage::pairs::BodyPairList;
use super::storage::particles::{BodyParticles, slot_of};
use super::storage::wall_list::{WallList, WallListRow};
use crate::cpu::Params;
use crate::engine::saved::{SavedPair, SavedRun, SavedWall, StoredBody};
use crate::engine::scene::Scene;
use crate::physics::contact::ContactHistory;

impl FastRun {
    pub(in crate::cpu) fn save(&mut self) -> SavedRun {
        let state = self.state().clone();
        let stored = |body: &Body| StoredBody { count: body.range().len() as u32, is_group: body.is_group };
        let mut pairs: Vec<SavedPair> = self.bodies.iter().flat_map(|body| self.saved_bonds(body)).collect();
        pairs.extend(self.saved_contacts());
        pairs.sort_unstable_by_key(|pair| pair.pair);
        SavedRun {
            step: self.step,
            start_step: self.start_step,
            state,
            stored_bodies: self.bodies.iter().map(stored).collect(),
            pairs,
            walls: self.bodies.iter().flat_map(saved_walls).collect(),
        }
    }

    fn saved_bonds(&self, body: &Body) -> impl Iterator<Item = SavedPair> {
        let first = body.range().start as u32;
        let radius2 = self.laws.contact.distance.powi(2);
        BondSet::unpack(&body.bonds, &body.moments).map(move |bond| SavedPair {
            pair: bond.pair.map(|k| first + k),
            class: (bond.rest * bond.rest / radius2).round() as u32,
            is_intact: bond.is_intact,
            bond: bond.stored,
            contact: bond.contact,
            moments: bond.moments,
        })
    }

    /// Contacts of pairs without a bond that held in the last step.
    fn saved_contacts(&self) -> Vec<SavedPair> {
        let held_at = held_in_last_step(self.step);
        let mut contacts = Vec::new();
        for body_pair in &self.body_pairs {
            let [a, b] = body_pair.bodies.map(|body| &self.bodies[body as usize]);
            let list = &self.pairs[body_pair.bodies[0] as usize].list;
            for ([i, j], [x, y, z, step]) in list.all(body_pair.pairs()) {
                if step.to_bits() == held_at {
                    let pair = [index_in(a, i), index_in(b, j)];
                    let contact = ContactHistory { in_contact: true, xi: glam::Vec3::new(x, y, z) };
                    let saved = SavedPair { pair, contact, ..SavedPair::default() };
                    // Slots and indices have different orders within a body.
                    contacts.push(if pair[0] < pair[1] { saved } else { saved.turned() });
                }
            }
        }
        contacts
    }

    pub(in crate::cpu) fn restore(
        scene: &Scene,
        params: Params,
        instructions: InstructionSet,
        saved: &SavedRun,
    ) -> Self {
        let mut run = Self::without_bodies(scene, params, instructions, saved.state.clone());
        (run.step, run.start_step) = (saved.step, saved.start_step);
        run.walls.restore(saved.start_step, saved.step, scene.timestep_s, &run.state.frame);
        let mut from = 0;
        let mut pairs = saved.pairs.iter().peekable();
        let mut contacts: Vec<SavedPair> = Vec::new();
        let mut walls = saved.walls.iter().copied().peekable();
        for stored in stored_bodies(saved) {
            let range = from..from + stored.count as usize;
            from = range.end;
            let mut bonds = Vec::new();
            while let Some(pair) = pairs.next_if(|pair| (pair.pair[0] as usize) < range.end) {
                match pair.class {
                    0 => contacts.push(*pair),
                    class => bonds.push(Bond {
                        pair: pair.pair.map(|k| k - range.start as u32),
                        rest: run.laws.rest(class),
                        is_intact: pair.is_intact,
                        stored: pair.bond,
                        contact: pair.contact,
                        moments: pair.moments,
                    }),
                }
            }
            let points = BodyParticles::of(&run.state, range.clone());
            let (mass, carry_moments) = (run.state.masses[range.start], run.laws.moment.is_some());
            let mut body = Body::new(range.clone(), points, mass, bonds, carry_moments, stored.is_group);
            body.walls = wall_list(range.start, || walls.next_if(|of| (of.particle as usize) < range.end));
            run.bodies.push(body);
        }
        run.put_contacts(&contacts);
        run
    }

    /// Puts contacts into lists, which the first step renews.
    fn put_contacts(&mut self, contacts: &[SavedPair]) {
        let held_at = f32::from_bits(held_in_last_step(self.step));
        let body_of = |k: u32| self.bodies.partition_point(|body| body.range().end <= k as usize);
        let mut placed: Vec<([u32; 2], [u32; 2], [f32; 4])> = contacts
            .iter()
            .map(|saved| {
                let bodies = saved.pair.map(body_of);
                let slot =
                    |side: usize| slot_of(saved.pair[side] - self.bodies[bodies[side]].range().start as u32);
                let slots = [slot(0), slot(1)];
                let is_turned = bodies[0] == bodies[1] && slots[0] > slots[1];
                let xi = if is_turned { saved.turned().contact.xi } else { saved.contact.xi };
                let slots = if is_turned { [slots[1], slots[0]] } else { slots };
                (bodies.map(|body| body as u32), slots, [xi.x, xi.y, xi.z, held_at])
            })
            .collect();
        placed.sort_unstable_by_key(|&(bodies, slots, _)| (bodies, slots));
        self.pairs.resize_with(self.bodies.len(), BodyPairList::default);
        for of_pair in placed.chunk_by(|a, b| a.0 == b.0) {
            let list = &mut self.pairs[of_pair[0].0[0] as usize].list;
            let first = list.len() as u32;
            of_pair.iter().for_each(|&(_, slots, histories)| list.push(slots, histories));
            let pairs = first..list.len() as u32;
            self.body_pairs.push(BodyPair { pairs, ..BodyPair::new(of_pair[0].0) });
        }
    }
}

/// The stored bodies, those of the scene where none are named.
fn stored_bodies(saved: &SavedRun) -> Vec<StoredBody> {
    if saved.stored_bodies.is_empty() {
        let own = saved.state.body_ranges();
        return own.map(|(_, range)| StoredBody { count: range.len() as u32, is_group: false }).collect();
    }
    saved.stored_bodies.clone()
}

/// Mark of a history that held in the last of `step` steps.
fn held_in_last_step(step: u64) -> u32 {
    (step + 1) as u32
}

/// Index within the run of a slot of a body.
fn index_in(body: &Body, slot: u32) -> u32 {
    // The order of slots is its own inverse.
    body.range().start as u32 + slot_of(slot)
}

fn saved_walls(body: &Body) -> Vec<SavedWall> {
    let mut from = 0;
    let of_row = |row: &WallListRow| {
        let near = &body.walls.pairs[std::mem::replace(&mut from, row.end as usize)..row.end as usize];
        SavedWall::of(body.range().start as u32 + row.of, near).collect::<Vec<_>>()
    };
    body.walls.rows.iter().flat_map(of_row).collect()
}

/// The facets of a body whose first sub-particle is `first`.
fn wall_list(first: usize, mut next: impl FnMut() -> Option<SavedWall>) -> WallList {
    let mut list = WallList::default();
    while let Some(SavedWall { particle, wall }) = next() {
        list.pairs.push(wall);
        let (of, end) = (particle - first as u32, list.pairs.len() as u32);
        match list.rows.last_mut() {
            Some(row) if row.of == of => row.end = end,
            _ => list.rows.push(WallListRow { of, end, due_at_m: 0.0 }),
        }
    }
    list
}
