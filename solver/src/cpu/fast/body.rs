//! A body: its sub-particles, the bonds between them, the facets near it; and how it has moved.

use std::ops::Range;

use glam::{DVec3, IVec3, Vec3};
use pulp::Simd;

use super::bonds::BondChunk;
use super::kernel::{self, PairLaws};
use super::load::{BATCH, Batch, Record};
use super::meeting::{Meeting, SAFE};
use crate::cpu::forces::{Load, from_walls};
use crate::cpu::integrate::Mover;
use crate::cpu::lists::WallPair;
use crate::cpu::walls::Walls;
use crate::engine::frame::Frame;
use crate::engine::state::{Particle, State};

/// √m* of two sub-particles of masses in kg, in kg^½.
pub(super) fn root_of_equivalent(mass: f32, other: f32) -> f32 {
    (mass * other / (mass + other)).sqrt()
}

/// A box around positions, both corners inside.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Extent {
    pub(super) low: IVec3,
    pub(super) high: IVec3,
}

/// How a body has moved since the run began. Since any moment, each of its sub-particles has moved by as much as
/// `shift`, to within what `path` has grown: a bound that follows the body.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Motion {
    /// Mean velocity before the step, in m/s.
    pub(super) velocity: Vec3,
    /// Integral of the mean velocity, in metres.
    pub(super) shift: DVec3,
    /// Integral of the greatest speed against the mean, in metres.
    pub(super) path: f64,
}

/// Facets near the sub-particles of a body.
#[derive(Debug, Default)]
pub(super) struct NearWalls {
    /// Sub-particles that have any, and the end of their facets in `pairs`.
    rows: Vec<(u32, u32)>,
    pub(super) pairs: Vec<WallPair>,
    seen_shift: DVec3,
    seen_path: f64,
    seen_moved: f64,
    known: bool,
}

#[derive(Debug)]
pub(super) struct Body {
    range: Range<usize>,
    /// Mass of each of its sub-particles, in kilograms.
    pub(super) mass: f32,
    pub(super) bonds: Vec<BondChunk>,
    /// Pairs that were bonded at the start, sorted: those whose bond broke still stand among the bonds.
    joined: Vec<[u32; 2]>,
    pub(super) walls: NearWalls,
    pub(super) motion: Motion,
    /// Where it is, brought up to date before pairs are looked up.
    pub(super) extent: Extent,
    /// Its meetings, in the order of the other body.
    pub(super) meets: Vec<u32>,
}

/// What is the same for all bodies in a step.
#[derive(Debug)]
pub(super) struct Surroundings<'a> {
    pub(super) laws: &'a PairLaws,
    pub(super) mover: &'a Mover,
    pub(super) frame: &'a Frame,
    pub(super) walls: &'a Walls,
    pub(super) meetings: &'a [Meeting],
    pub(super) masses: &'a [f32],
    pub(super) held: &'a [bool],
    pub(super) radius: f32,
    /// Distance of a centre from a facet within which a contact can hold, in metres.
    pub(super) wall_reach: f32,
    /// What wall lists cover beyond, in metres.
    pub(super) wall_skin: f32,
}

/// The part of the state that is a body's own.
#[derive(Debug)]
pub(super) struct Share<'a> {
    pub(super) particles: &'a mut [Particle],
    pub(super) remainders: &'a mut [Vec3],
    pub(super) broken: &'a mut [u32],
}

/// Room to work in.
#[derive(Debug, Default)]
pub(super) struct Room {
    sums: Vec<Record>,
    batch: Batch,
}

/// What a body has noticed in a step.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Noticed {
    pub(super) max_overlap: f32,
    pub(super) bonds_broken: u32,
    /// The first sub-particle that is too fast, not a number or lost, counted in the run.
    pub(super) runaway: Option<u32>,
}

impl Noticed {
    pub(super) fn and(self, other: Self) -> Self {
        Self {
            max_overlap: self.max_overlap.max(other.max_overlap),
            bonds_broken: self.bonds_broken + other.bonds_broken,
            runaway: self.runaway.into_iter().chain(other.runaway).min(),
        }
    }
}

impl Extent {
    pub(super) fn of(particles: &[Particle]) -> Self {
        let (mut low, mut high) = (IVec3::MAX, IVec3::MIN);
        for p in particles {
            low = low.min(p.position);
            high = high.max(p.position);
        }
        Self { low, high }
    }

    /// Larger by `by` metres on all sides; without bounds in a direction that is periodic.
    pub(super) fn grown(&self, by: f32, frame: &Frame) -> Self {
        let by = IVec3::splat((by / frame.unit_m) as i32 + 2);
        let (mut low, mut high) = (self.low.saturating_sub(by), self.high.saturating_add(by));
        if frame.period_y != 0 {
            (low.y, high.y) = (i32::MIN, i32::MAX);
        }
        Self { low, high }
    }

    pub(super) fn holds(&self, x: IVec3) -> bool {
        x.cmpge(self.low).all() & x.cmple(self.high).all()
    }

    /// Distance to another box in metres, at least; 0 where they overlap. A periodic direction counts nothing.
    pub(super) fn gap(&self, other: &Self, frame: &Frame) -> f32 {
        let (low, high) = (self.low.max(other.low), self.high.min(other.high));
        let mut between = low.saturating_sub(high).max(IVec3::ZERO).as_vec3() * frame.unit_m;
        if frame.period_y != 0 {
            between.y = 0.0;
        }
        between.length()
    }
}

impl Body {
    pub(super) fn new(
        range: Range<usize>,
        mass: f32,
        bonds: Vec<BondChunk>,
        mut joined: Vec<[u32; 2]>,
    ) -> Self {
        joined.sort_unstable();
        Self {
            range,
            mass,
            bonds,
            joined,
            walls: NearWalls::default(),
            motion: Motion::default(),
            extent: Extent { low: IVec3::ZERO, high: IVec3::ZERO },
            meets: Vec::new(),
        }
    }

    /// Its sub-particles in the state.
    pub(super) fn range(&self) -> Range<usize> {
        self.range.clone()
    }

    /// Whether a pair of its sub-particles was bonded at the start.
    pub(super) fn is_joined(&self, pair: [u32; 2]) -> bool {
        self.joined.binary_search(&pair).is_ok()
    }

    pub(super) fn locate(&mut self, state: &State) {
        self.extent = Extent::of(&state.particles[self.range()]);
    }

    /// One step of this body, once its meetings have worked out their loads.
    #[inline(always)]
    pub(super) fn step<S: Simd>(
        &mut self,
        simd: S,
        me: u32,
        around: &Surroundings<'_>,
        share: Share<'_>,
        Room { sums, batch }: &mut Room,
    ) -> Noticed {
        sums.clear();
        sums.resize(self.range.len(), Record::ZERO);
        for &m in &self.meets {
            let Meeting { bodies, chunks, .. } = &around.meetings[m as usize];
            let pairs = chunks.iter().flat_map(|chunk| chunk.pairs().iter().zip(&chunk.loads));
            if bodies[0] == me {
                pairs.clone().for_each(|([i, _], load)| sums[*i as usize].add(load));
            }
            if bodies[1] == me {
                pairs.for_each(|([_, j], load)| sums[*j as usize].add_opposite(load));
            }
        }
        let mut noticed = self.add_bonds(simd, around, &share, sums, batch);
        self.add_walls(around, share.particles, sums);
        noticed.bonds_broken = 0;
        for (k, count) in self.bonds.iter_mut().flat_map(|chunk| chunk.fresh_breaks()) {
            share.broken[k as usize] += count;
            noticed.bonds_broken += count;
        }
        noticed.runaway = self.integrate(around, share.particles, share.remainders, sums);
        noticed
    }

    #[inline(always)]
    fn add_bonds<S: Simd>(
        &mut self,
        simd: S,
        around: &Surroundings<'_>,
        share: &Share<'_>,
        sums: &mut [Record],
        batch: &mut Batch,
    ) -> Noticed {
        let root_mass = root_of_equivalent(self.mass, self.mass);
        let mut noticed = Noticed::default();
        for chunks in self.bonds.chunks_mut(BATCH) {
            for (chunk, seen) in chunks.iter().zip(&mut batch.seen) {
                seen.look([share.particles, share.particles], &chunk.pairs, around.frame);
            }
            for ((chunk, seen), felt) in chunks.iter_mut().zip(&batch.seen).zip(&mut batch.felt) {
                let (count, memory) = (chunk.pairs.len(), &mut chunk.memory);
                let (deepest, broke) = kernel::bonds(simd, around.laws, root_mass, count, seen, memory, felt);
                chunk.broke = broke;
                noticed.max_overlap = noticed.max_overlap.max(deepest);
            }
            for (chunk, felt) in chunks.iter().zip(&batch.felt) {
                for (lane, &[i, j]) in chunk.pairs.iter().enumerate() {
                    let load = felt.record(lane);
                    sums[i as usize].add(&load);
                    sums[j as usize].add_opposite(&load);
                }
            }
        }
        noticed
    }

    fn add_walls(&mut self, around: &Surroundings<'_>, particles: &[Particle], sums: &mut [Record]) {
        if self.walls.is_due(&self.motion, around) {
            let extent = Extent::of(particles);
            self.walls.search(&self.motion, around, particles, &extent);
        }
        let mut from = 0;
        for &(k, end) in &self.walls.rows {
            let near = &mut self.walls.pairs[from as usize..end as usize];
            from = end;
            let mut load = Load::default();
            let mass = around.masses[self.range.start + k as usize];
            let p = &particles[k as usize];
            let Surroundings { laws, radius, frame, walls, .. } = around;
            from_walls(*radius, laws.dt, frame, walls, p, mass, near, &mut load);
            sums[k as usize].add(&Record::new(&load));
        }
    }

    #[inline(always)]
    fn integrate(
        &mut self,
        around: &Surroundings<'_>,
        particles: &mut [Particle],
        remainders: &mut [Vec3],
        sums: &[Record],
    ) -> Option<u32> {
        let mut runaway = None;
        let (mut total, mut apart2) = (Vec3::ZERO, 0.0f32);
        for (k, (p, remainder)) in particles.iter_mut().zip(remainders).enumerate() {
            let at = self.range.start + k;
            let sound = around.held[at]
                || around.mover.step(p, remainder, &sums[k].load(), around.masses[at], around.frame);
            if !sound {
                runaway = runaway.or(Some(at as u32));
            }
            total += p.velocity;
            let apart = p.velocity - self.motion.velocity;
            apart2 = apart2.max(apart.dot(apart));
        }
        let dt = f64::from(around.laws.dt);
        self.motion.shift += self.motion.velocity.as_dvec3() * dt;
        self.motion.path += f64::from(apart2.sqrt()) * dt;
        self.motion.velocity = total / particles.len() as f32;
        runaway
    }
}

impl NearWalls {
    fn is_due(&self, motion: &Motion, around: &Surroundings<'_>) -> bool {
        let moved = motion.shift.distance(self.seen_shift)
            + (motion.path - self.seen_path)
            + (around.walls.moved_in_all_m() - self.seen_moved);
        !(self.known && moved <= SAFE * f64::from(around.wall_skin))
    }

    /// Looks up the facets near each sub-particle. What touching pairs remember stays.
    fn search(
        &mut self,
        motion: &Motion,
        around: &Surroundings<'_>,
        particles: &[Particle],
        extent: &Extent,
    ) {
        let Surroundings { walls, frame, .. } = around;
        let reach = around.wall_reach + around.wall_skin;
        let centre = (extent.low >> 1) + (extent.high >> 1);
        let half = extent.high.wrapping_sub(extent.low).as_vec3().length() * frame.unit_m * 0.5 + 1e-6;
        let near: Vec<u32> = walls.within(centre, reach + half, frame).collect();
        let old = std::mem::take(self);
        self.known = true;
        self.seen_shift = motion.shift;
        self.seen_path = motion.path;
        self.seen_moved = walls.moved_in_all_m();
        let mut old_rows = old.rows.iter().copied().scan(0, |from, (k, end)| {
            let row = (k, *from as usize..end as usize);
            *from = end;
            Some(row)
        });
        let mut known = old_rows.next();
        for (k, p) in (0u32..).zip(particles) {
            while known.as_ref().is_some_and(|(row, _)| *row < k) {
                known = old_rows.next();
            }
            let remembered =
                known.as_ref().filter(|(row, _)| *row == k).map_or(&[][..], |(_, r)| &old.pairs[r.clone()]);
            for &facet in &near {
                if walls.touch(facet, p.position, frame).distance <= reach {
                    let before = remembered.iter().find(|pair| pair.facet == facet);
                    self.pairs.push(before.copied().unwrap_or(WallPair { facet, ..WallPair::default() }));
                }
            }
            let end = self.pairs.len() as u32;
            if end > self.rows.last().map_or(0, |row| row.1) {
                self.rows.push((k, end));
            }
        }
    }

    /// Renumbers sub-particles; those that map to `u32::MAX` are gone.
    pub(super) fn renumber(&mut self, locals: &[u32]) {
        let old = std::mem::take(self);
        let mut from = 0;
        for (k, end) in old.rows {
            if locals[k as usize] != u32::MAX {
                self.pairs.extend_from_slice(&old.pairs[from as usize..end as usize]);
                self.rows.push((locals[k as usize], self.pairs.len() as u32));
            }
            from = end;
        }
    }
}

impl Body {
    /// Renumbers after sub-particles were taken out.
    pub(super) fn renumber(&mut self, range: Range<usize>, locals: &[u32]) {
        self.range = range;
        let map = |[i, j]: [u32; 2]| [locals[i as usize], locals[j as usize]];
        self.joined =
            self.joined.iter().map(|&pair| map(pair)).filter(|pair| !pair.contains(&u32::MAX)).collect();
        self.bonds = BondChunk::renumbered(&self.bonds, map);
        self.walls.renumber(locals);
    }
}
