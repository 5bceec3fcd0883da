//! Entry of bodies; removal of sub-particles, and renumbering of the rest.

use super::FastRun;
use super::storage::body::Body;
use super::storage::body_groups::{BodyGroup, body_groups};
use super::storage::bond_set::Bond;
use super::storage::particles::BodyParticles;
use crate::engine::scene::{Placement, Scene};

impl FastRun {
    /// Appends bodies of the scene.
    pub(in crate::cpu) fn enter(&mut self, scene: &Scene, first: usize, bodies: &[Placement]) {
        self.state();
        let from = self.state.particles.len();
        self.state.enter(scene, first, bodies);
        self.take_in(scene, bodies, from);
        self.body_pairs_stale = true;
        self.order.clear();
    }

    /// Takes in bodies that the state has from the sub-particle `from` on.
    pub(super) fn take_in(&mut self, scene: &Scene, bodies: &[Placement], from: usize) {
        for BodyGroup { range, kind } in body_groups(&scene.kinds, bodies, from) {
            let bonds = kind.meta.bonds.iter();
            let bonds = bonds.map(|bond| Bond::new([bond.i, bond.j], self.laws.rest(bond.class))).collect();
            let points = BodyParticles::of(&self.state, range.clone());
            let (mass, is_group) = (kind.subparticle_mass_kg as f32, range.len() > kind.meta.points.len());
            self.bodies.push(Body::new(range, points, mass, bonds, self.laws.moment.is_some(), is_group));
        }
    }

    /// Removes sub-particles by serial, ascending.
    pub(in crate::cpu) fn remove(&mut self, serials: &[u32]) {
        self.state();
        let map = self.state.remove(serials);
        let mut from = 0;
        let mut locals: Vec<Vec<u32>> = Vec::new();
        let mut are_whole = Vec::new();
        let mut numbers = Vec::new();
        let mut kept = Vec::new();
        for mut body in std::mem::take(&mut self.bodies) {
            let mut next = 0;
            let local = body.range().map(|at| {
                let stays = map[at] != u32::MAX;
                next += u32::from(stays);
                if stays { next - 1 } else { u32::MAX }
            });
            let local: Vec<u32> = local.collect();
            numbers.push((next > 0).then_some(kept.len() as u32));
            if next > 0 {
                let range = from..from + next as usize;
                from = range.end;
                if range.len() == local.len() {
                    body.set_range(range);
                } else {
                    let points = BodyParticles::of(&self.state, range.clone());
                    body.renumber(range, points, &local);
                }
                kept.push(body);
            }
            are_whole.push(next as usize == local.len());
            locals.push(local);
        }
        self.bodies = kept;
        self.body_pairs.retain_mut(|meeting| {
            let [a, b] = meeting.bodies.map(|body| body as usize);
            let [Some(first), Some(second)] = [numbers[a], numbers[b]] else { return false };
            meeting.bodies = [first, second];
            if !(are_whole[a] && are_whole[b]) {
                meeting.renumber([&locals[a], &locals[b]], &mut self.pairs[a].list);
            }
            true
        });
        // The lists still hold pairs of removed body pairs. They are rebuilt before the next use.
        let mut numbers = numbers.iter();
        self.pairs.retain(|_| numbers.next().is_some_and(Option::is_some));
        self.body_pairs_stale = true;
        self.order.clear();
    }
}
