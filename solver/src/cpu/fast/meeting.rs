//! Two bodies that are near each other: which of their sub-particles may touch, and the contacts between them.
//!
//! A pair of sub-particles stands here once, with its memory and the load that phase one works out; both bodies
//! then add the loads of their meetings in a fixed order. A meeting is looked at afresh when its two bodies
//! may have moved against each other by the skin, whatever the others do: fillets that fall together keep theirs.

use glam::{DVec3, IVec3};

use super::body::{Body, Extent, root_of_equivalent};
use super::instructions::Wide;
use super::kernel::{self, Contacts, PairLaws};
use super::lanes::{Lanes, Lanes3, WIDTH, places_of, quad_of};
use super::load::{BATCH, Batch, PairLoads};
use super::points::{folded, place_of};
use crate::engine::frame::Frame;

/// Share of a margin that may be used up: the rest covers rounding.
pub(super) const SAFE: f64 = 0.99;

/// Blocks within this many skins beyond reach are kept an eye on one by one.
const NEAR: f32 = 4.0;

/// Share of a margin that must be left for pairs to go on unsearched.
const WORTH: f64 = 0.2;

/// Two bodies, or one and itself.
#[derive(Debug)]
pub(super) struct Meeting {
    /// Indices of the bodies, a ≤ b.
    pub(super) bodies: [u32; 2],
    /// Whether the pairs must be looked up before the next step.
    pub(super) due: bool,
    /// Pairs that may touch, sorted.
    pub(super) chunks: Vec<PairChunk>,
    /// Where the bodies were against each other when they were last looked at, in metres.
    seen_apart: DVec3,
    seen_path: f64,
    /// How far they may move from there until they must be looked at again, in metres.
    allowed: f64,
    /// Blocks whose sub-particles may touch soon, as they were when the pairs were looked up.
    near: Vec<NearBlocks>,
    /// How far those may move against each other from there, in metres; and all others.
    margin: f64,
    far_margin: f64,
    /// How far the bodies have moved from there to when they were last looked at, in metres.
    spent: f64,
}

/// Two blocks of sub-particles that are near each other.
#[derive(Clone, Copy, Debug)]
struct NearBlocks {
    blocks: [u32; 2],
    apart: DVec3,
    from: f64,
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

/// What a search for pairs needs to know.
#[derive(Clone, Copy, Debug)]
pub(super) struct Search {
    /// Distance of centres within which a contact can hold, in metres.
    pub(super) reach: f32,
    /// What lists cover beyond, in metres: between bodies, and within one.
    pub(super) skins: [f32; 2],
}

/// Blocks of a body that are near another, relative to some origin.
#[derive(Debug, Default)]
struct Cloud {
    index: Vec<u32>,
    boxes: Vec<Extent>,
    /// Lowest and highest corners of the boxes, in metres.
    spans: Vec<[[f32; 3]; 2]>,
    x: Vec<Lanes3>,
}

/// Room for searches.
#[derive(Debug, Default)]
pub(super) struct Scratch {
    first: Cloud,
    second: Cloud,
    /// Blocks of the second cloud to be searched, and the lanes of the first's block that are near each.
    beside: Vec<(usize, u16)>,
    /// Pairs of blocks that are near each other.
    near: Vec<[u32; 2]>,
    found: Vec<[u32; 2]>,
    pub(super) batch: Batch,
}

/// Where there is no sub-particle, in metres.
const NOWHERE: f32 = 1e9;

impl Cloud {
    /// The blocks of a body within `reach` metres of a box. Returns the least distance of those that are not.
    #[inline(always)]
    fn fill(&mut self, body: &Body, near: &Extent, reach: f32, origin: IVec3, frame: &Frame) -> f32 {
        self.index.clear();
        self.boxes.clear();
        self.spans.clear();
        self.x.clear();
        let mut left_out = f32::INFINITY;
        for (b, (block, extent)) in body.points.blocks.iter().zip(&body.boxes).enumerate() {
            let gap = extent.gap(near, frame);
            if gap > reach {
                left_out = left_out.min(gap);
                continue;
            }
            let count = body.points.count - b * WIDTH;
            let mut x = [Lanes::ZERO; 3];
            for axis in 0..3 {
                for k in 0..WIDTH {
                    let d = block.position[axis].0[k].wrapping_sub(origin[axis]);
                    x[axis].0[k] = if k < count { d as f32 * frame.unit_m } else { NOWHERE };
                }
            }
            self.index.push(b as u32);
            self.boxes.push(*extent);
            let corner = |x: IVec3| (x.wrapping_sub(origin).as_vec3() * frame.unit_m).to_array();
            self.spans.push([corner(extent.low), corner(extent.high)]);
            self.x.push(x);
        }
        left_out
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
            near: Vec::new(),
            margin: f64::NEG_INFINITY,
            far_margin: f64::NEG_INFINITY,
            spent: 0.0,
        }
    }

    /// How far the bodies may have moved against each other since they were last looked at, in metres.
    fn moved(&self, a: &Body, b: &Body) -> f64 {
        (b.motion.shift - a.motion.shift).distance(self.seen_apart)
            + (a.motion.path + b.motion.path - self.seen_path)
    }

    /// Decides whether the bodies must be looked at.
    pub(super) fn mark(&mut self, a: &Body, b: &Body) {
        let moved = self.moved(a, b);
        // What is not a number is not safe.
        self.due = moved > self.allowed || moved.is_nan();
    }

    /// Whether the pairs are still all that may touch. Bodies turn and bend: where they are near each other they may have moved
    /// less than as a whole. If so, they are left alone until the rest of the margin may be used up.
    pub(super) fn holds(&mut self, [a, b]: [&Body; 2]) -> bool {
        self.spent += self.moved(a, b);
        let moved = |near: &NearBlocks| {
            let [p, q] = near.blocks.map(|block| block as usize);
            let (p, q) = (&a.points.motions[p], &b.points.motions[q]);
            (q.shift - p.shift).distance(near.apart) + (p.to() + q.to() - near.from)
        };
        let most = self.near.iter().map(moved).fold(0.0, f64::max);
        let left = (self.margin - most).min(self.far_margin - self.spent);
        // To look at them every few steps would cost more than to look the pairs up.
        let holds = left > WORTH * self.margin;
        if holds {
            self.look(a, b, left);
        }
        holds
    }

    fn look(&mut self, a: &Body, b: &Body, allowed: f64) {
        self.seen_apart = b.motion.shift - a.motion.shift;
        self.seen_path = a.motion.path + b.motion.path;
        self.allowed = allowed;
    }

    /// Looks up the pairs that may touch. What touching pairs remember stays.
    #[inline(always)]
    pub(super) fn search<S: Wide>(
        &mut self,
        simd: S,
        search: &Search,
        frame: &Frame,
        [a, b]: [&Body; 2],
        scratch: &mut Scratch,
    ) {
        let alone = self.bodies[0] == self.bodies[1];
        let skin = search.skins[usize::from(alone)];
        let listed = search.reach + skin;
        let far = search.reach + NEAR * skin;
        scratch.found.clear();
        scratch.near.clear();
        let mut distances = Distances { of_near: f32::INFINITY, of_others: f32::INFINITY };
        let gap = if alone { 0.0 } else { a.extent.gap(&b.extent, frame) };
        if gap <= far {
            let origin = b.extent.low;
            let of_a = scratch.first.fill(a, &b.extent, far, origin, frame);
            let of_b = scratch.second.fill(b, &a.extent, far, origin, frame);
            distances.of_others = of_a.min(of_b);
            find(simd, listed, far, frame, alone, scratch, &mut distances);
            if alone {
                a.leave_out_joined(&mut scratch.found);
            }
        } else {
            distances.of_others = gap;
        }
        // Bodies without a pair may come nearer by what is between them.
        let none = scratch.found.is_empty();
        let margin = if none { (distances.of_near - search.reach).max(skin) } else { skin };
        self.margin = SAFE * f64::from(margin);
        self.far_margin = SAFE * f64::from(distances.of_others - search.reach);
        self.spent = 0.0;
        self.near.clear();
        self.near.extend(scratch.near.iter().map(|&blocks| {
            let (p, q) = (&a.points.motions[blocks[0] as usize], &b.points.motions[blocks[1] as usize]);
            NearBlocks { blocks, apart: q.shift - p.shift, from: p.from() + q.from() }
        }));
        self.look(a, b, self.margin.min(self.far_margin));
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
                chunk.contacts.take(quad_of(lane), contacts, quad_of(from));
            }
        }
    }

    /// Adds a pair that remembers nothing; returns its chunk and its lane.
    fn push(&mut self, pair: [u32; 2]) -> (&mut PairChunk, usize) {
        if self.chunks.last().is_none_or(|chunk| chunk.count == WIDTH) {
            self.chunks.push(PairChunk::empty());
        }
        let chunk = self.chunks.last_mut().expect("one was pushed");
        let lane = chunk.count;
        chunk.pairs[lane] = pair;
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
        Batch { looks, felt }: &mut Batch,
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
        let old = self.chunks.iter().flat_map(|chunk| {
            chunk.pairs().iter().enumerate().map(move |(lane, pair)| (*pair, &chunk.contacts, lane))
        });
        let mut renumbered: Vec<_> = old
            .filter_map(|([i, j], contacts, lane)| {
                let pair = [locals[0][place_of(i) as usize], locals[1][place_of(j) as usize]];
                (!pair.contains(&u32::MAX)).then(|| (pair.map(place_of), contacts, lane))
            })
            .map(|([i, j], contacts, lane)| {
                // Of a body and itself the lower comes first.
                let turned = a == b && i > j;
                (if turned { [j, i] } else { [i, j] }, contacts, lane, turned)
            })
            .collect();
        // Those that come before have gone: blocks are filled anew, and places have another order.
        renumbered.sort_unstable_by_key(|(pair, ..)| *pair);
        let mut kept = Self::new(self.bodies);
        for (pair, contacts, from, turned) in renumbered {
            let (new, lane) = kept.push(pair);
            new.contacts.take(quad_of(lane), contacts, quad_of(from));
            if turned {
                new.contacts.slide.iter_mut().for_each(|axis| axis.0[quad_of(lane)] *= -1.0);
            }
        }
        *self = kept;
        true
    }
}

/// Distances that sub-particles are not below, in metres: those of near blocks, as long as no pair is found; and of all others.
struct Distances {
    of_near: f32,
    of_others: f32,
}

/// Pairs of the two clouds within `reach` metres, sorted, and pairs of blocks within `far` metres.
#[inline(always)]
fn find<S: Wide>(
    simd: S,
    reach: f32,
    far: f32,
    frame: &Frame,
    alone: bool,
    scratch: &mut Scratch,
    distances: &mut Distances,
) {
    let Scratch { first, second, beside, near, found, .. } = scratch;
    let reach2 = reach * reach;
    let period = frame.period_y as f32 * frame.unit_m;
    // Without a period nothing is ever half of it away.
    let half = if period == 0.0 { f32::INFINITY } else { 0.5 * period };
    for ((&a, around_a), xa) in first.index.iter().zip(&first.boxes).zip(&first.x) {
        beside.clear();
        for (b, around_b) in second.boxes.iter().enumerate() {
            // Of a body and itself only pairs with i < j count, once.
            if alone && second.index[b] < a {
                continue;
            }
            let gap = around_a.gap(around_b, frame);
            if gap > far {
                distances.of_others = distances.of_others.min(gap);
                continue;
            }
            near.push([a, second.index[b]]);
            if gap > reach {
                distances.of_near = distances.of_near.min(gap);
                continue;
            }
            let from_box = distances2_from_box(xa, &second.spans[b], period != 0.0);
            distances.of_near = distances.of_near.min(folded(from_box.0, lesser).sqrt());
            let near_box = simd.at_most(&from_box, reach2);
            if near_box != 0 {
                beside.push((b, near_box));
            }
        }
        for place in 0..WIDTH {
            let lane = quad_of(place);
            let i = a * WIDTH as u32 + place as u32;
            let [x, y, z] = [0, 1, 2].map(|axis| xa[axis].0[lane]);
            for (b, _) in beside.iter().filter(|(_, near_box)| near_box >> lane & 1 == 1) {
                let at = &second.x[*b];
                let mut distance2 = Lanes::ZERO;
                for k in 0..WIDTH {
                    let (dx, mut dy, dz) = (at[0].0[k] - x, at[1].0[k] - y, at[2].0[k] - z);
                    dy = if dy > half { dy - period } else { dy };
                    dy = if dy < -half { dy + period } else { dy };
                    distance2.0[k] = dx * dx + dy * dy + dz * dz;
                }
                let mut hits = places_of(simd.at_most(&distance2, reach2));
                let first = second.index[*b] * WIDTH as u32;
                while hits != 0 {
                    let j = first + hits.trailing_zeros();
                    hits &= hits - 1;
                    if !alone || i < j {
                        found.push([i, j]);
                    }
                }
            }
        }
    }
}

#[inline(always)]
fn lesser(a: f32, b: f32) -> f32 {
    if b < a { b } else { a }
}

/// Squares of the distances of a block's sub-particles from a box, in m²; along a periodic y they count nothing.
#[inline(always)]
fn distances2_from_box(x: &Lanes3, [low, high]: &[[f32; 3]; 2], periodic_y: bool) -> Lanes {
    let mut distance2 = Lanes::ZERO;
    for axis in (0..3).filter(|&axis| axis != 1 || !periodic_y) {
        for k in 0..WIDTH {
            let at = x[axis].0[k];
            let (below, above) = (low[axis] - at, at - high[axis]);
            let d = if above > below { above } else { below };
            let d = if d > 0.0 { d } else { 0.0 };
            distance2.0[k] += d * d;
        }
    }
    distance2
}
