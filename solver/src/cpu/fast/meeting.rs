//! Two bodies that are near each other: which of their sub-particles may touch, and the contacts between them.
//!
//! A pair of sub-particles stands here once, with its memory and the load that phase one works out; both bodies
//! then add the loads of their meetings in a fixed order. A meeting is looked at afresh when its two bodies
//! may have moved against each other by the skin, whatever the others do: fillets that fall together keep theirs.

use glam::{DVec3, IVec3};
use pulp::Simd;

use super::body::{Body, Extent, root_of_equivalent};
use super::kernel::{self, Contacts, PairLaws};
use super::lanes::{F, Lanes, WIDTH};
use super::load::{BATCH, Batch, Record};
use crate::engine::frame::Frame;
use crate::engine::state::{Particle, State};

/// Share of a margin that may be used up: the rest covers rounding.
pub(super) const SAFE: f64 = 0.99;

/// How far empty meetings look, in skins.
const FAR: f32 = 4.0;

/// Two bodies, or one and itself.
#[derive(Debug)]
pub(super) struct Meeting {
    /// Indices of the bodies, a ≤ b.
    pub(super) bodies: [u32; 2],
    /// Whether the pairs must be looked up before the next step.
    pub(super) due: bool,
    /// Pairs that may touch, sorted.
    pub(super) chunks: Vec<PairChunk>,
    /// Where the bodies were against each other when the pairs were looked up, in metres.
    seen_apart: DVec3,
    seen_path: f64,
    /// How far they may move from there, in metres.
    allowed: f64,
}

/// Pairs that may touch, side by side with all that a step reads and writes of them.
#[derive(Clone, Debug)]
pub(super) struct PairChunk {
    count: usize,
    /// Sub-particles, counted within their bodies.
    pairs: [[u32; 2]; WIDTH],
    contacts: Contacts,
    /// What acts on the first of each pair.
    pub(super) loads: [Record; WIDTH],
}

impl PairChunk {
    pub(super) fn pairs(&self) -> &[[u32; 2]] {
        &self.pairs[..self.count]
    }
}

/// What a search for pairs needs to know.
#[derive(Clone, Copy, Debug)]
pub(super) struct Search {
    /// Distance of centres within which a contact can hold, in metres.
    pub(super) reach: f32,
    /// What lists cover beyond, in metres.
    pub(super) skin: f32,
}

/// Sub-particles of a body that are near another, in blocks, relative to some origin.
#[derive(Debug, Default)]
struct Cloud {
    x: Vec<[Lanes; 3]>,
    index: Vec<u32>,
}

/// Room for searches.
#[derive(Debug, Default)]
pub(super) struct Scratch {
    first: Cloud,
    second: Cloud,
    found: Vec<[u32; 2]>,
    pub(super) batch: Batch,
}

impl Cloud {
    fn fill(&mut self, particles: &[Particle], within: &Extent, origin: IVec3, frame: &Frame) {
        const NOWHERE: Lanes = Lanes([1e9; WIDTH]);
        self.x.clear();
        self.index.clear();
        for (k, p) in particles.iter().enumerate() {
            if !within.holds(p.position) {
                continue;
            }
            let lane = self.index.len() % WIDTH;
            if lane == 0 {
                self.x.push([NOWHERE; 3]);
            }
            let block = self.x.last_mut().expect("one was pushed");
            let x = p.position.wrapping_sub(origin).as_vec3() * frame.unit_m;
            for (axis, x) in block.iter_mut().zip(x.to_array()) {
                axis.0[lane] = x;
            }
            self.index.push(k as u32);
        }
    }
}

impl Meeting {
    pub(super) fn new(bodies: [u32; 2]) -> Self {
        Self {
            bodies,
            due: true,
            chunks: Vec::new(),
            seen_apart: DVec3::ZERO,
            seen_path: 0.0,
            allowed: f64::NEG_INFINITY,
        }
    }

    /// Decides whether the pairs must be looked up.
    pub(super) fn mark(&mut self, a: &Body, b: &Body) {
        let moved = (b.motion.shift - a.motion.shift).distance(self.seen_apart)
            + (a.motion.path + b.motion.path - self.seen_path);
        // What is not a number is not safe.
        self.due = !(moved <= self.allowed);
    }

    /// Looks up the pairs that may touch. What touching pairs remember stays.
    #[inline(always)]
    pub(super) fn search<S: Simd>(
        &mut self,
        simd: S,
        search: &Search,
        state: &State,
        [a, b]: [&Body; 2],
        scratch: &mut Scratch,
    ) {
        let frame = &state.frame;
        let alone = self.bodies[0] == self.bodies[1];
        self.seen_apart = b.motion.shift - a.motion.shift;
        self.seen_path = a.motion.path + b.motion.path;
        // Bodies without a pair may come nearer by what is between them; how much that is, is known this far.
        let (listed, far) = (search.reach + search.skin, search.reach + FAR * search.skin);
        scratch.found.clear();
        let mut apart = if alone { 0.0 } else { a.extent.gap(&b.extent, frame) };
        if apart <= listed {
            let (near_a, near_b) = (a.extent.grown(far, frame), b.extent.grown(far, frame));
            let origin = b.extent.low;
            scratch.first.fill(&state.particles[a.range()], &near_b, origin, frame);
            scratch.second.fill(&state.particles[b.range()], &near_a, origin, frame);
            apart = find(simd, listed, frame, alone, scratch).min(far);
            if alone {
                scratch.found.retain(|pair| !a.is_joined(*pair));
            }
        }
        let margin =
            if scratch.found.is_empty() { (apart - search.reach).max(search.skin) } else { search.skin };
        self.allowed = SAFE * f64::from(margin);
        self.take_pairs(&scratch.found);
    }

    /// Lists these pairs, sorted. Those that were listed keep what they remember.
    fn take_pairs(&mut self, pairs: &[[u32; 2]]) {
        let old = std::mem::take(&mut self.chunks);
        let mut known = old.iter().flat_map(|chunk| {
            chunk.pairs().iter().enumerate().map(move |(lane, pair)| (*pair, &chunk.contacts, lane))
        });
        let mut next = known.next();
        for &pair in pairs {
            let (chunk, lane) = self.push(pair);
            while next.is_some_and(|(old, ..)| old < pair) {
                next = known.next();
            }
            if let Some((_, contacts, from)) = next.filter(|(old, ..)| *old == pair) {
                chunk.contacts.take(lane, contacts, from);
            }
        }
    }

    /// Adds a pair that remembers nothing; returns its chunk and its lane.
    fn push(&mut self, pair: [u32; 2]) -> (&mut PairChunk, usize) {
        if self.chunks.last().is_none_or(|chunk| chunk.count == WIDTH) {
            self.chunks.push(PairChunk {
                count: 0,
                pairs: [[0; 2]; WIDTH],
                contacts: Contacts::new(),
                loads: [Record::ZERO; WIDTH],
            });
        }
        let chunk = self.chunks.last_mut().expect("one was pushed");
        let lane = chunk.count;
        chunk.pairs[lane] = pair;
        chunk.count += 1;
        (chunk, lane)
    }

    /// Works out the load of every pair. Returns their greatest overlap, in metres.
    #[inline(always)]
    pub(super) fn forces<S: Simd>(
        &mut self,
        simd: S,
        laws: &PairLaws,
        state: &State,
        [a, b]: [&Body; 2],
        batch: &mut Batch,
    ) -> f32 {
        let mut deepest = 0.0f32;
        let sides = [&state.particles[a.range()], &state.particles[b.range()]];
        let root_mass = root_of_equivalent(a.mass, b.mass);
        for chunks in self.chunks.chunks_mut(BATCH) {
            for (chunk, seen) in chunks.iter().zip(&mut batch.seen) {
                seen.look(sides, chunk.pairs(), &state.frame);
            }
            for ((chunk, seen), felt) in chunks.iter_mut().zip(&batch.seen).zip(&mut batch.felt) {
                let PairChunk { count, contacts, .. } = chunk;
                deepest = deepest.max(kernel::contacts(simd, laws, root_mass, *count, seen, contacts, felt));
            }
            for (chunk, felt) in chunks.iter_mut().zip(&batch.felt) {
                for (lane, load) in chunk.loads.iter_mut().enumerate() {
                    *load = felt.record(lane);
                }
            }
        }
        deepest
    }

    /// Renumbers after bodies were taken out; whether there is anything left to meet.
    pub(super) fn renumber(&mut self, bodies: [Option<u32>; 2], locals: [&[u32]; 2]) -> bool {
        let [Some(a), Some(b)] = bodies else { return false };
        self.bodies = [a, b];
        let mut kept = Self::new(self.bodies);
        for chunk in &self.chunks {
            for (from, &[i, j]) in chunk.pairs().iter().enumerate() {
                let pair = [locals[0][i as usize], locals[1][j as usize]];
                if !pair.contains(&u32::MAX) {
                    let (new, lane) = kept.push(pair);
                    new.contacts.take(lane, &chunk.contacts, from);
                }
            }
        }
        *self = kept;
        true
    }
}

/// Pairs of the two clouds within `reach` metres, sorted, and the distance of the nearest of all, in metres.
#[inline(always)]
fn find<S: Simd>(simd: S, reach: f32, frame: &Frame, alone: bool, scratch: &mut Scratch) -> f32 {
    let splat = |value| F::splat(simd, value);
    let Scratch { first, second, found, .. } = scratch;
    let period = frame.period_y as f32 * frame.unit_m;
    let half = 0.5 * period;
    let mut nearest2 = splat(f32::INFINITY);
    for (k, &i) in first.index.iter().enumerate() {
        let [x, y, z] = first.x[k / WIDTH].map(|axis| splat(axis.0[k % WIDTH]));
        // Of a body and itself only pairs with i < j count, once.
        let from = if alone { k / WIDTH } else { 0 };
        for (block, at) in second.x.iter().enumerate().skip(from) {
            for part in 0..WIDTH / S::F32_LANES {
                let dx = F::load(simd, &at[0], part) - x;
                let mut dy = F::load(simd, &at[1], part) - y;
                let dz = F::load(simd, &at[2], part) - z;
                if period != 0.0 {
                    dy = splat(half).lt(dy).select(dy - splat(period), dy);
                    dy = dy.lt(splat(-half)).select(dy + splat(period), dy);
                }
                let distance2 = dx * dx + dy * dy + dz * dz;
                nearest2 = nearest2.min(distance2);
                let hit = distance2.le(splat(reach * reach));
                if hit.any() {
                    let mut near = Lanes::ZERO;
                    hit.select(splat(1.0), splat(0.0)).store(&mut near, 0);
                    for (lane, _) in near.0.iter().enumerate().filter(|(_, hit)| **hit != 0.0) {
                        let j = second.index[block * WIDTH + part * S::F32_LANES + lane];
                        if !alone || i < j {
                            found.push([i, j]);
                        }
                    }
                }
            }
        }
    }
    nearest2.least().sqrt()
}
