//! Two bodies that are near each other: which of their sub-particles may touch, and the contacts between them.
//!
//! A pair of sub-particles stands here once, with its memory. A body works out its meetings with itself and with those after
//! it: what acts on its own sub-particles it adds up at once, what acts on the others' stays here until they do.
//! A meeting is looked at afresh when its two bodies
//! may have moved against each other by the skin, whatever the others do: fillets that fall together keep theirs.

use std::ops::Range;

use glam::DVec3;

use super::body::{Body, root_of_equivalent};
use super::instructions::{Job, Wide, by_itself};
use super::kernel::{self, Felt, PairLaws};
use super::load::{BATCH, Batch, Loads};
use super::pairs::{self, BodyPairs, PairList};
use super::points::place_of;
use super::search::{Finder, Search};
use crate::engine::frame::Frame;

/// Share of a margin that may be used up: the rest covers rounding.
pub(super) const SAFE: f64 = 0.99;

/// Pairs that are further apart than they touch by less than this share are left to the kernel, which rounds otherwise.
const ROUNDING: f32 = 1e-5;

/// Two bodies, or one and itself.
#[derive(Debug)]
pub(super) struct Meeting {
    /// Indices of the bodies, a ≤ b.
    pub(super) bodies: [u32; 2],
    /// Whether the pairs must be looked up before the next step.
    pub(super) due: bool,
    /// Where its pairs stand in the list of the first body, sorted.
    pub(super) pairs: Range<usize>,
    /// Where the loads of those that are close stand among [`BodyPairs::seconds`] of the first body.
    pub(super) loads: Range<usize>,
    /// Where the bodies were against each other when the pairs were looked up, in metres.
    seen_apart: DVec3,
    seen_path: f64,
    /// How far they may move from there, in metres.
    allowed: f64,
}

/// Room to work in.
#[derive(Debug, Default)]
pub(super) struct Room {
    finder: Finder,
    /// One is filled while the other waits: what was written in small pieces cannot be read at once in large ones.
    batches: [Batch; 2],
    /// A list to be written.
    spare: PairList,
    /// Distances of all pairs, from the first to the second, and which of them are close.
    apart: Vec<[i32; 4]>,
    close: Vec<u32>,
}

impl Meeting {
    pub(super) fn new(bodies: [u32; 2]) -> Self {
        Self {
            bodies,
            due: true,
            pairs: 0..0,
            loads: 0..0,
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

    /// Looks up the pairs that may touch.
    #[inline(always)]
    fn search<S: Wide>(
        &mut self,
        simd: S,
        search: &Search,
        frame: &Frame,
        [a, b]: [&Body; 2],
        finder: &mut Finder,
    ) {
        let alone = self.bodies[0] == self.bodies[1];
        let apart = finder.search(simd, search, frame, [a, b], alone);
        let skin = search.skins[usize::from(alone)];
        // Bodies without a pair may come nearer by what is between them.
        let margin = if finder.found.is_empty() { (apart - search.reach).max(skin) } else { skin };
        self.seen_apart = b.motion.shift - a.motion.shift;
        self.seen_path = a.motion.path + b.motion.path;
        self.allowed = SAFE * f64::from(margin);
    }

    /// Renumbers after bodies were taken out: its pairs come from one list and go to the end of another.
    pub(super) fn renumber(
        &mut self,
        bodies: [u32; 2],
        locals: [&[u32]; 2],
        from: &PairList,
        to: &mut PairList,
    ) {
        let mut renumbered: Vec<_> = from
            .all(self.pairs.clone())
            .filter_map(|([i, j], [x, y, z, held])| {
                let pair = [locals[0][place_of(i) as usize], locals[1][place_of(j) as usize]];
                let [i, j] = (!pair.contains(&u32::MAX)).then(|| pair.map(place_of))?;
                // Of a body and itself the lower comes first.
                let turned = bodies[0] == bodies[1] && i > j;
                Some(if turned { ([j, i], [-x, -y, -z, held]) } else { ([i, j], [x, y, z, held]) })
            })
            .collect();
        // Where others have gone, blocks are filled anew, and places have another order.
        renumbered.sort_unstable_by_key(|(pair, _)| *pair);
        let first = to.len();
        renumbered.into_iter().for_each(|(pair, memory)| to.push(pair, memory));
        *self = Self { pairs: first..to.len(), ..Self::new(bodies) };
    }
}

/// The contacts of a body with itself and those after it.
pub(super) struct Contacts<'a> {
    /// All meetings of which the body is the first.
    pub(super) meetings: &'a mut [Meeting],
    pub(super) bodies: &'a [Body],
    pub(super) pairs: &'a mut BodyPairs,
    /// What the pairs do to the body's own sub-particles, by [`super::points::place_of`]: nothing yet.
    pub(super) firsts: &'a mut Loads,
    pub(super) laws: &'a PairLaws,
    pub(super) frame: &'a Frame,
    /// Number of the step, from 2: so that what remembers nothing held in none.
    pub(super) step: u32,
}

impl Contacts<'_> {
    /// Looks up the pairs of those meetings that are due. What touching pairs remember stays.
    #[inline(always)]
    pub(super) fn search<S: Wide>(
        &mut self,
        simd: S,
        search: &Search,
        Room { finder, spare, .. }: &mut Room,
    ) {
        let BodyPairs { list, is_stale, .. } = &mut *self.pairs;
        if !std::mem::take(is_stale) && self.meetings.iter().all(|meeting| !meeting.due) {
            return;
        }
        spare.clear();
        for meeting in &mut *self.meetings {
            let (old, first) = (meeting.pairs.clone(), spare.len());
            if meeting.due {
                let sides = meeting.bodies.map(|body| &self.bodies[body as usize]);
                meeting.search(simd, search, self.frame, sides, finder);
                let mut known = list.all(old).peekable();
                for &pair in &finder.found {
                    while known.next_if(|(old, _)| *old < pair).is_some() {}
                    let memory = known.next_if(|(old, _)| *old == pair);
                    spare.push(pair, memory.map_or([0.0; 4], |(_, memory)| memory));
                }
            } else {
                spare.extend(list, old);
            }
            meeting.pairs = first..spare.len();
        }
        std::mem::swap(list, spare);
    }

    /// Works out the load of every pair that is close. Returns their greatest overlap, in metres.
    #[inline(always)]
    pub(super) fn forces<S: Wide>(&mut self, simd: S, Room { batches, apart, close, .. }: &mut Room) -> f32 {
        let [mut batch, mut full] = batches.each_mut();
        let BodyPairs { list, seconds, .. } = &mut *self.pairs;
        let mine = &self.bodies[self.meetings[0].bodies[0] as usize];
        seconds.loads.clear();
        seconds.places.clear();
        apart.resize(list.len(), [0; 4]);
        for Meeting { bodies: [_, other], pairs, .. } in &*self.meetings {
            let sides = [&mine.points, &self.bodies[*other as usize].points];
            pairs::look(&list.places[pairs.clone()], sides, &mut apart[pairs.clone()]);
        }
        if self.frame.period_y != 0 {
            apart.iter_mut().for_each(|apart| apart[1] = self.frame.nearest_image(apart[1]));
        }
        // What has touched holds a little further.
        let reach = self.laws.touch + self.laws.contact.snap().abs();
        PairList::close(simd, apart, reach * (1.0 + ROUNDING) / self.frame.unit_m, close);
        let mut deepest = 0.0f32;
        let (mut close, mut done) = (&close[..], 0);
        for m in 0..self.meetings.len() {
            let meeting = &mut self.meetings[m];
            let count = close.partition_point(|&pair| (pair as usize) < meeting.pairs.end);
            meeting.loads = done..done + count;
            done += count;
            let theirs = &self.bodies[meeting.bodies[1] as usize];
            let (sides, root_mass) =
                ([&mine.points, &theirs.points], root_of_equivalent(mine.mass, theirs.mass));
            let mut these;
            (these, close) = close.split_at(count);
            while !these.is_empty() {
                let taken = batch.take(these, &self.pairs.list, apart, sides, root_mass);
                these = &these[taken..];
                if batch.pairs.len() == BATCH {
                    deepest = deepest.max(by_itself(simd, WorkOut { contacts: self, batch: full }));
                    std::mem::swap(&mut batch, &mut full);
                }
            }
        }
        for batch in [full, batch] {
            deepest = deepest.max(by_itself(simd, WorkOut { contacts: self, batch }));
        }
        deepest
    }
}

/// Works out the loads of a batch, and hands them out in its order. Returns the greatest overlap, in metres.
struct WorkOut<'a, 'b> {
    contacts: &'a mut Contacts<'b>,
    batch: &'a mut Batch,
}

impl Job for WorkOut<'_, '_> {
    type Output = f32;

    #[inline(always)]
    fn run<S: Wide>(self, simd: S) -> f32 {
        let Self { contacts: Contacts { pairs, firsts, laws, frame, step, .. }, batch } = self;
        let BodyPairs { list, seconds, .. } = &mut **pairs;
        if batch.pairs.is_empty() {
            return 0.0;
        }
        let mut felt = [Felt::NOTHING; 2];
        let mut lanes = batch.lanes(simd, frame, *step, laws.contact.snap());
        let deepest = kernel::contacts(simd, laws, &mut lanes, &mut felt);
        let first = seconds.places.len();
        let mut places = [0; BATCH];
        seconds.loads.push(simd, &felt[0]);
        seconds.loads.push(simd, &felt[1]);
        let memory = [lanes.memory[0].memory(simd, *step).0, lanes.memory[1].memory(simd, *step).0];
        list.hand_back(&batch.pairs, memory.as_flattened(), &mut places, &mut seconds.places);
        firsts.add_to_firsts(&places[..batch.pairs.len()], &seconds.loads, first..seconds.places.len());
        batch.pairs.clear();
        deepest
    }
}
