//! Two bodies that are near each other: which of their sub-particles may touch, and the contacts between them.
//!
//! A pair of sub-particles stands here once, with its memory. A body works out its meetings with itself and with those after
//! it: what acts on its own sub-particles and on the others' stays here until they add it up.
//! The pairs are listed afresh when the two bodies may have moved against each other by the skin, whatever the others do: fillets that
//! fall together keep theirs. They are sifted out of candidates, which a search among all sub-particles finds and which last several
//! times as long: so skins can be thin, and lists short.

use std::ops::Range;

use glam::DVec3;

use super::body::{Body, root_of_equivalent};
use super::instructions::{Job, Wide, by_itself};
use super::kernel::{self, Felt};
use super::laws::PairLaws;
use super::load::{BATCH, Batch};
use super::pairs::{self, BodyPairs, PairList, PairLoads};
use super::points::{Motion, place_of};
use super::search::{Finder, Search};
use crate::cpu::stages::{Stage, Stages};
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
    due: bool,
    /// Where its pairs stand in the list of the first body, sorted.
    pub(super) pairs: Range<usize>,
    /// Where the loads of those that are close stand among [`BodyPairs::loads`] of the first body.
    pub(super) loads: Range<usize>,
    /// Pairs that may be listed before the next search for such.
    candidates: Vec<[u32; 2]>,
    /// For how long the pairs are good, and for how long the candidates.
    pairs_leeway: Leeway,
    candidates_leeway: Leeway,
}

/// How two bodies may move against each other before something must be looked up again.
#[derive(Clone, Copy, Debug)]
struct Leeway {
    /// Where they were against each other when it was looked up, in metres.
    apart: DVec3,
    path: f64,
    /// How far they may move from there, in metres.
    allowed: f64,
}

impl Leeway {
    /// None.
    const NONE: Self = Self { apart: DVec3::ZERO, path: 0.0, allowed: f64::NEG_INFINITY };

    /// That of bodies that have moved so far, by a margin in metres.
    fn new([a, b]: [&Motion; 2], margin: f32) -> Self {
        Self { apart: b.shift - a.shift, path: a.path + b.path, allowed: SAFE * f64::from(margin) }
    }

    fn is_used_up(&self, [a, b]: [&Motion; 2]) -> bool {
        let moved = (b.shift - a.shift).distance(self.apart) + (a.path + b.path - self.path);
        // What is not a number is not safe.
        moved > self.allowed || moved.is_nan()
    }
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
            candidates: Vec::new(),
            pairs_leeway: Leeway::NONE,
            candidates_leeway: Leeway::NONE,
        }
    }

    /// Looks up the pairs that may touch, into `room.close`: numbers of candidates.
    #[inline(always)]
    fn search<S: Wide>(
        &mut self,
        simd: S,
        search: &Search,
        frame: &Frame,
        [a, b]: [&Body; 2],
        Room { finder, apart, close, .. }: &mut Room,
    ) {
        let alone = self.bodies[0] == self.bodies[1];
        let skin = search.skins[usize::from(alone)];
        let motions = [&a.motion, &b.motion];
        if self.candidates_leeway.is_used_up(motions) {
            let gap = finder.search(simd, search, frame, [a, b], alone);
            let outer_skin = search.outer_skins[usize::from(alone)];
            // Bodies without a pair may come nearer by what is between them; candidates must do for a list made at the last moment.
            let margin = match &finder.found[..] {
                [] => outer_skin.max(gap - search.reach),
                _ => outer_skin - skin,
            };
            self.candidates_leeway = Leeway::new(motions, margin);
            self.candidates.clone_from(&finder.found);
        }
        if self.candidates.is_empty() {
            self.pairs_leeway = self.candidates_leeway;
            close.clear();
            return;
        }
        self.pairs_leeway = Leeway::new(motions, skin);
        apart.resize(self.candidates.len(), [0; 4]);
        pairs::look(&self.candidates, [&a.points, &b.points], frame, apart);
        PairList::close(simd, apart, (search.reach + skin) / frame.unit_m, close);
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
    pub(super) laws: &'a PairLaws,
    pub(super) frame: &'a Frame,
    /// Number of the step, from 2: so that what remembers nothing held in none.
    pub(super) step: u32,
}

impl Contacts<'_> {
    /// Looks up the pairs of those meetings that are due. What touching pairs remember stays.
    #[inline(always)]
    pub(super) fn search<S: Wide>(&mut self, simd: S, search: &Search, room: &mut Room) {
        for meeting in &mut *self.meetings {
            let motions = meeting.bodies.map(|body| &self.bodies[body as usize].motion);
            meeting.due = meeting.pairs_leeway.is_used_up(motions);
        }
        let BodyPairs { list, is_stale, .. } = &mut *self.pairs;
        if !std::mem::take(is_stale) && self.meetings.iter().all(|meeting| !meeting.due) {
            return;
        }
        let mut spare = std::mem::take(&mut room.spare);
        spare.clear();
        for meeting in &mut *self.meetings {
            let (old, first) = (meeting.pairs.clone(), spare.len());
            if meeting.due {
                let sides = meeting.bodies.map(|body| &self.bodies[body as usize]);
                meeting.search(simd, search, self.frame, sides, room);
                let mut known = list.all(old).peekable();
                for &candidate in &room.close {
                    let pair = meeting.candidates[candidate as usize];
                    while known.next_if(|(old, _)| *old < pair).is_some() {}
                    let memory = known.next_if(|(old, _)| *old == pair);
                    spare.push(pair, memory.map_or([0.0; 4], |(_, memory)| memory));
                }
            } else {
                spare.extend(list, old);
            }
            meeting.pairs = first..spare.len();
        }
        std::mem::swap(list, &mut spare);
        room.spare = spare;
    }

    /// Works out the load of every pair that is close. Returns their greatest overlap, in metres.
    #[inline(always)]
    pub(super) fn forces<S: Wide>(&mut self, simd: S, Room { batches, apart, close, .. }: &mut Room) -> f32 {
        let [mut batch, mut full] = batches.each_mut();
        let BodyPairs { list, loads: PairLoads { loads, places }, .. } = &mut *self.pairs;
        let mine = &self.bodies[self.meetings[0].bodies[0] as usize];
        loads.clear();
        places.clear();
        apart.resize(list.len(), [0; 4]);
        // Most meetings have no pair.
        for Meeting { bodies: [_, other], pairs, .. } in
            self.meetings.iter().filter(|it| !it.pairs.is_empty())
        {
            let sides = [&mine.points, &self.bodies[*other as usize].points];
            pairs::look(&list.places[pairs.clone()], sides, self.frame, &mut apart[pairs.clone()]);
        }
        // What has touched holds a little further.
        let reach = self.laws.touch + self.laws.contact.snap.abs();
        PairList::close(simd, apart, reach * (1.0 + ROUNDING) / self.frame.unit_m, close);
        let mut deepest = 0.0f32;
        let (mut close, mut done) = (&close[..], 0);
        for m in 0..self.meetings.len() {
            let meeting = &mut self.meetings[m];
            if meeting.pairs.is_empty() {
                meeting.loads = 0..0;
                continue;
            }
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

/// A body's part of the first phase.
pub(super) struct Meet<'a, 'b> {
    pub(super) contacts: &'a mut Contacts<'b>,
    pub(super) search: &'a Search,
    pub(super) room: &'a mut Room,
    pub(super) stages: &'a Stages,
}

impl Job for Meet<'_, '_> {
    type Output = f32;

    #[inline(always)]
    fn run<S: Wide>(self, simd: S) -> f32 {
        let mut watch = self.stages.watch();
        self.contacts.search(simd, self.search, self.room);
        watch.lap(Stage::Search);
        let deepest = self.contacts.forces(simd, self.room);
        watch.lap(Stage::Contacts);
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
        let Self { contacts: Contacts { pairs, laws, frame, step, .. }, batch } = self;
        let BodyPairs { list, loads: PairLoads { loads, places }, .. } = &mut **pairs;
        if batch.pairs.is_empty() {
            return 0.0;
        }
        let mut felt = [Felt::NOTHING; 2];
        let mut lanes = batch.lanes(simd, frame, *step);
        let deepest = kernel::contacts(simd, laws, &mut lanes, &mut felt);
        loads.push(simd, &felt[0]);
        loads.push(simd, &felt[1]);
        let memory = [lanes.memory[0].memory(simd, *step).0, lanes.memory[1].memory(simd, *step).0];
        list.hand_back(&batch.pairs, memory.as_flattened(), places);
        batch.pairs.clear();
        deepest
    }
}
