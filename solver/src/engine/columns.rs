//! A [`SavedRun`] as bytes. Equal bytes of all rows lie together: the compression then finds what they have in common.

use bytemuck::{Pod, Zeroable};
use glam::{IVec3, Vec3};
use serde::{Deserialize, Serialize};

use super::saved::{SavedPair, SavedRun, SavedWall, StoredBody};
use super::scene::Scene;
use super::state::{Particle, State};
use super::wall_pair::{SideMemory, WallPair};
use crate::physics::contact::ContactHistory;
use crate::physics::moment::MomentHistory;

/// A [`SavedRun`] as it is written.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct SavedColumns {
    step: u64,
    start_step: Option<u64>,
    bonds_broken: u64,
    stored_bodies: Vec<StoredBody>,
    particles: Vec<u8>,
    pairs: Vec<u8>,
    walls: Vec<u8>,
}

/// A sub-particle. Mass, body and clamp follow from its serial.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct ParticleRow {
    serial: u32,
    broken: u32,
    position: [i32; 3],
    velocity: [f32; 3],
    spin: [f32; 3],
    remainder: [f32; 3],
}

#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct PairRow {
    pair: [u32; 2],
    /// Class of the bond, [`INTACT`] and [`IN_CONTACT`].
    state: u32,
    bond: [f32; 3],
    xi: [f32; 3],
    bending: [f32; 3],
    twist: f32,
}

#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct WallRow {
    particle: u32,
    facet: u32,
    /// [`IN_CONTACT`], and the bits of the memory of its side.
    state: u32,
    xi: [f32; 3],
    force: [f32; 3],
}

const IN_CONTACT: u32 = 1 << 31;
const INTACT: u32 = 1 << 30;

impl SavedColumns {
    /// The columns of a run.
    pub(super) fn of(run: &SavedRun) -> Self {
        let state = &run.state;
        let particle = |i: usize| ParticleRow {
            serial: state.serials[i],
            broken: state.broken[i],
            position: state.particles[i].position.to_array(),
            velocity: state.particles[i].velocity.to_array(),
            spin: state.particles[i].spin.to_array(),
            remainder: state.remainders[i].to_array(),
        };
        let pair = |pair: &SavedPair| PairRow {
            pair: pair.pair,
            state: pair.class
                | if pair.is_intact { INTACT } else { 0 }
                | if pair.contact.in_contact { IN_CONTACT } else { 0 },
            bond: pair.bond.to_array(),
            xi: pair.contact.xi.to_array(),
            bending: pair.moments.bending.to_array(),
            twist: pair.moments.twist,
        };
        let wall = |SavedWall { particle, wall }: &SavedWall| WallRow {
            particle: *particle,
            facet: wall.facet,
            state: wall.side.to_bits() | if wall.contact.in_contact { IN_CONTACT } else { 0 },
            xi: wall.contact.xi.to_array(),
            force: wall.force.to_array(),
        };
        Self {
            step: run.step,
            start_step: run.start_step,
            bonds_broken: state.bonds_broken,
            stored_bodies: run.stored_bodies.clone(),
            particles: planes((0..state.particles.len()).map(particle)),
            pairs: planes(run.pairs.iter().map(pair)),
            walls: planes(run.walls.iter().map(wall)),
        }
    }

    /// The run, in a scene of which this many bodies have entered.
    ///
    /// # Errors
    /// Names, in words, the part that does not fit the scene.
    pub(super) fn run(&self, scene: &Scene, entered: usize) -> Result<SavedRun, &'static str> {
        let pairs = rows(&self.pairs)?.into_iter().map(|row: PairRow| SavedPair {
            pair: row.pair,
            class: row.state & !(INTACT | IN_CONTACT),
            is_intact: row.state & INTACT != 0,
            bond: row.bond.into(),
            contact: ContactHistory { in_contact: row.state & IN_CONTACT != 0, xi: row.xi.into() },
            moments: MomentHistory { bending: row.bending.into(), twist: row.twist },
        });
        let walls = rows(&self.walls)?.into_iter().map(|row: WallRow| SavedWall {
            particle: row.particle,
            wall: WallPair {
                facet: row.facet,
                contact: ContactHistory { in_contact: row.state & IN_CONTACT != 0, xi: row.xi.into() },
                side: SideMemory::from_bits(row.state),
                force: row.force.into(),
            },
        });
        let run = SavedRun {
            step: self.step,
            start_step: self.start_step,
            state: self.state(scene, entered)?,
            stored_bodies: self.stored_bodies.clone(),
            pairs: pairs.collect(),
            walls: walls.collect(),
        };
        run.fault(scene).map_or(Ok(run), Err)
    }

    fn state(&self, scene: &Scene, entered: usize) -> Result<State, &'static str> {
        let rows: Vec<ParticleRow> = rows(&self.particles)?;
        let firsts = scene.first_serials();
        if entered < scene.present().len() || entered > scene.bodies.len() {
            return Err("its number of bodies is not that of the scene");
        }
        if !rows.is_sorted_by(|a, b| a.serial < b.serial)
            || rows.last().is_some_and(|row| row.serial >= firsts[entered])
        {
            return Err("its sub-particles are not those of the scene");
        }
        let mut state = State::empty(scene);
        for row in &rows {
            let body = firsts.partition_point(|first| *first <= row.serial) - 1;
            let [velocity, spin] = [row.velocity, row.spin].map(Vec3::from);
            state.particles.push(Particle { position: IVec3::from(row.position), velocity, spin });
            state.remainders.push(row.remainder.into());
            state.masses.push(scene.kinds[scene.bodies[body].kind].subparticle_mass_kg as f32);
            state.bodies.push(body as u32);
            state.serials.push(row.serial);
            state.held.push(scene.held.contains(&row.serial));
            state.broken.push(row.broken);
        }
        let bonds = scene.bodies[..entered].iter().map(|body| scene.kinds[body.kind].meta.bonds.len() as u64);
        state.bonds_at_start = bonds.sum();
        state.bonds_broken = self.bonds_broken;
        Ok(state)
    }
}

/// The bytes of rows: the first byte of all, then the second of all, and so on.
fn planes<T: Pod>(rows: impl Iterator<Item = T>) -> Vec<u8> {
    let rows: Vec<T> = rows.collect();
    let (bytes, count) = (bytemuck::cast_slice::<T, u8>(&rows), rows.len());
    let mut planes = vec![0; bytes.len()];
    for (k, row) in bytes.chunks_exact(size_of::<T>()).enumerate() {
        for (b, byte) in row.iter().enumerate() {
            planes[b * count + k] = *byte;
        }
    }
    planes
}

/// The rows of such bytes.
fn rows<T: Pod>(planes: &[u8]) -> Result<Vec<T>, &'static str> {
    let (count, rest) = (planes.len() / size_of::<T>(), planes.len() % size_of::<T>());
    if rest != 0 {
        return Err("a column ends within a row");
    }
    let mut rows = vec![T::zeroed(); count];
    let bytes: &mut [u8] = bytemuck::cast_slice_mut(&mut rows);
    for (k, row) in bytes.chunks_exact_mut(size_of::<T>()).enumerate() {
        for (b, byte) in row.iter_mut().enumerate() {
            *byte = planes[b * count + k];
        }
    }
    Ok(rows)
}
