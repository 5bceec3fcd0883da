//! Two bodies that are near each other: which of their sub-particles may touch, and the contacts between them.
//!
//! A pair of sub-particles stands here once, with its memory and the load that phase one works out; both bodies
//! then add the loads of their meetings in a fixed order. A meeting is looked at afresh when its two bodies
//! may have moved against each other by the skin, whatever the others do: fillets that fall together keep theirs.

use glam::DVec3;

use super::body::{Body, root_of_equivalent};
use super::instructions::Wide;
use super::kernel::{self, Contacts, PairLaws};
use super::load::{BATCH, Batch, PairLoads};
use super::memory::{WIDTH, quad_of};
use super::points::place_of;
use super::search::{Finder, Search};
use crate::engine::frame::Frame;

/// Share of a margin that may be used up: the rest covers rounding.
pub(super) const SAFE: f64 = 0.99;

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
    /// Places of sub-particles in their bodies (see [`super::points::place_of`]).
    pairs: [[u32; 2]; WIDTH],
    /// Lane by lane: that of a pair is [`quad_of`] its number.
    contacts: Contacts,
    /// What acts on the first of each pair.
    pub(super) loads: PairLoads,
}

impl PairChunk {
    fn empty() -> Self {
        Self { count: 0, pairs: [[0; 2]; WIDTH], contacts: Contacts::new(), loads: PairLoads::ZERO }
    }

    pub(super) fn pairs(&self) -> &[[u32; 2]] {
        &self.pairs[..self.count]
    }
}

/// Room to work in.
#[derive(Debug, Default)]
pub(super) struct Room {
    finder: Finder,
    batch: Batch,
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
        self.due = moved > self.allowed || moved.is_nan();
    }

    /// Looks up the pairs that may touch. What touching pairs remember stays.
    #[inline(always)]
    pub(super) fn search<S: Wide>(
        &mut self,
        simd: S,
        search: &Search,
        frame: &Frame,
        [a, b]: [&Body; 2],
        Room { finder, .. }: &mut Room,
    ) {
        let alone = self.bodies[0] == self.bodies[1];
        let apart = finder.search(simd, search, frame, [a, b], alone);
        let skin = search.skins[usize::from(alone)];
        // Bodies without a pair may come nearer by what is between them.
        let margin = if finder.found.is_empty() { (apart - search.reach).max(skin) } else { skin };
        self.seen_apart = b.motion.shift - a.motion.shift;
        self.seen_path = a.motion.path + b.motion.path;
        self.allowed = SAFE * f64::from(margin);
        self.take_pairs(&finder.found);
    }

    /// Lists these pairs, sorted. Those that were listed keep what they remember.
    fn take_pairs(&mut self, pairs: &[[u32; 2]]) {
        let old = std::mem::take(&mut self.chunks);
        let mut known = remembered(&old);
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
            self.chunks.push(PairChunk::empty());
        }
        let chunk = self.chunks.last_mut().expect("one was pushed");
        let lane = quad_of(chunk.count);
        chunk.pairs[chunk.count] = pair;
        chunk.count += 1;
        (chunk, lane)
    }

    /// Works out the load of every pair. Returns their greatest overlap, in metres.
    #[inline(always)]
    pub(super) fn forces<S: Wide>(
        &mut self,
        simd: S,
        laws: &PairLaws,
        frame: &Frame,
        [a, b]: [&Body; 2],
        Room { batch: Batch { looks, felt }, .. }: &mut Room,
    ) -> f32 {
        let mut deepest = 0.0f32;
        let sides = [&a.points, &b.points];
        let root_mass = root_of_equivalent(a.mass, b.mass);
        for chunks in self.chunks.chunks_mut(BATCH) {
            for (chunk, look) in chunks.iter().zip(&mut *looks) {
                look.at(sides, chunk.pairs(), frame);
            }
            // The second of an odd chunk works on what no one reads.
            let mut nothing = PairChunk::empty();
            for (chunks, looks) in chunks.chunks_mut(2).zip(looks.chunks(2)) {
                let [one, two] = match chunks {
                    [one, two] => [one, two],
                    [one] => [one, &mut nothing],
                    _ => break,
                };
                let seen = [looks[0].seen(simd), looks[1].seen(simd)];
                let counts = [one.count, two.count];
                let memory = [&mut one.contacts, &mut two.contacts];
                deepest = deepest.max(kernel::contacts(simd, laws, root_mass, counts, &seen, memory, felt));
                one.loads.set(simd, &felt[0]);
                two.loads.set(simd, &felt[1]);
            }
        }
        deepest
    }

    /// Renumbers after bodies were taken out; whether there is anything left to meet.
    pub(super) fn renumber(&mut self, bodies: [Option<u32>; 2], locals: [&[u32]; 2]) -> bool {
        let [Some(a), Some(b)] = bodies else { return false };
        self.bodies = [a, b];
        let old = remembered(&self.chunks);
        let mut renumbered: Vec<_> = old
            .filter_map(|([i, j], contacts, from)| {
                let pair = [locals[0][place_of(i) as usize], locals[1][place_of(j) as usize]];
                let [i, j] = (!pair.contains(&u32::MAX)).then(|| pair.map(place_of))?;
                // Of a body and itself the lower comes first.
                let turned = a == b && i > j;
                Some((if turned { [j, i] } else { [i, j] }, contacts, from, turned))
            })
            .collect();
        // Where others have gone, blocks are filled anew, and places have another order.
        renumbered.sort_unstable_by_key(|(pair, ..)| *pair);
        let mut kept = Self::new(self.bodies);
        for (pair, contacts, from, turned) in renumbered {
            let (new, lane) = kept.push(pair);
            new.contacts.take(lane, contacts, from);
            if turned {
                new.contacts.slide.iter_mut().for_each(|axis| axis.0[lane] *= -1.0);
            }
        }
        *self = kept;
        true
    }
}

/// Pairs, what holds their memories, and where in it.
fn remembered(chunks: &[PairChunk]) -> impl Iterator<Item = ([u32; 2], &Contacts, usize)> {
    chunks.iter().flat_map(|chunk| {
        chunk.pairs().iter().enumerate().map(move |(k, pair)| (*pair, &chunk.contacts, quad_of(k)))
    })
}
