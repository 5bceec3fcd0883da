//! Two bodies that are near each other: which of their sub-particles may touch, and the contacts between them.
//!
//! A pair of sub-particles stands here once, with its memory. A body works out its meetings with itself and with those after
//! it: what acts on its own sub-particles and on the others' stays here until they add it up. Among single spheres that go together it
//! is summed up at once.
//! The pairs are listed afresh when the two bodies may have moved against each other by the skin, whatever the others do: fillets that
//! fall together keep theirs. They are sifted out of candidates, which a search among all sub-particles finds and which last several
//! times as long: so skins can be thin, and lists short.

use std::ops::Range;

use glam::DVec3;

use super::body::{Body, root_of_equivalent};
use super::fetch;
use super::instructions::{Job, Wide, by_itself};
use super::kernel::{self, Felt};
use super::laws::PairLaws;
use super::load::{AddWithin, BATCH, Batch, Loads, Take};
use super::memory::space;
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
#[repr(align(64))]
pub(super) struct Meeting {
    /// Indices of the bodies, a ≤ b.
    pub(super) bodies: [u32; 2],
    /// Where its pairs stand in the list of the first body, sorted.
    pairs: Range<u32>,
    /// For how long the pairs are good.
    leeway: Leeway,
    candidates: Box<Candidates>,
}

// There are a dozen times as many as bodies, and all are asked in every step whether they are due: a line of the cache each.
const _: () = assert!(size_of::<Meeting>() == 64);

/// Pairs that may be listed before the next search for such, and for how long they are good.
#[derive(Debug)]
struct Candidates {
    pairs: Vec<[u32; 2]>,
    leeway: Leeway,
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
        let left = self.allowed - (a.path + b.path - self.path);
        // What is not a number is not safe.
        !(left >= 0.0 && (b.shift - a.shift).distance_squared(self.apart) <= left * left)
    }
}

/// Room to work in.
#[derive(Debug, Default)]
pub(super) struct Room {
    finder: Finder,
    /// One is filled while the other waits: what was written in small connected_components cannot be read at once in large ones.
    batches: [Batch; 2],
    /// What pairs do that is summed up at once.
    loads: PairLoads,
    /// A list to be written.
    spare: PairList,
    /// Which meetings must look up their pairs.
    due: Vec<bool>,
    looks: Looks,
}

/// Room to look at pairs: at their distances, from the first to the second, and at which of them are close.
#[derive(Debug, Default)]
struct Looks {
    apart: Vec<[i32; 4]>,
    close: Vec<u32>,
}

impl Meeting {
    pub(super) fn new(bodies: [u32; 2]) -> Self {
        let candidates = Box::new(Candidates { pairs: Vec::new(), leeway: Leeway::NONE });
        Self { bodies, pairs: 0..0, leeway: Leeway::NONE, candidates }
    }

    /// Where its pairs stand in the list of the first body.
    fn pairs(&self) -> Range<usize> {
        pairs::those(&self.pairs)
    }

    /// Whether its pairs must be looked up.
    pub(super) fn is_due(&self, bodies: &[Body]) -> bool {
        self.leeway.is_used_up(self.bodies.map(|body| &bodies[body as usize].motion))
    }

    /// Looks up the pairs that may touch: numbers of candidates.
    #[inline(always)]
    fn search<'a, S: Wide>(
        &mut self,
        simd: S,
        search: &Search,
        frame: &Frame,
        [a, b]: [&Body; 2],
        finder: &mut Finder,
        Looks { apart, close }: &'a mut Looks,
    ) -> &'a [u32] {
        let alone = self.bodies[0] == self.bodies[1];
        let skin = search.skins[usize::from(alone)];
        let motions = [&a.motion, &b.motion];
        let Self { leeway, candidates, .. } = self;
        if candidates.leeway.is_used_up(motions) {
            let gap = finder.search(simd, search, frame, [a, b], alone);
            let outer_skin = search.outer_skins[usize::from(alone)];
            // Bodies without a pair may come nearer by what is between them; candidates must do for a list made at the last moment.
            let margin = match &finder.found[..] {
                [] => outer_skin.max(gap - search.reach),
                _ => outer_skin - skin,
            };
            candidates.leeway = Leeway::new(motions, margin);
            candidates.pairs.clone_from(&finder.found);
        }
        if candidates.pairs.is_empty() {
            *leeway = candidates.leeway;
            return &[];
        }
        *leeway = Leeway::new(motions, skin);
        let apart = space(apart, candidates.pairs.len());
        pairs::look(&candidates.pairs, [&a.points, &b.points], frame, apart);
        pairs::close(simd, apart, (search.reach + skin) / frame.unit_m, close)
    }

    /// Goes on where some sub-particles of its bodies were taken out: those that stay have other numbers, and are searched anew. Its pairs go to
    /// the end of the list that they are in.
    pub(super) fn renumber(&mut self, locals: [&[u32]; 2], list: &mut PairList) {
        let alone = self.bodies[0] == self.bodies[1];
        let mut renumbered: Vec<_> = list
            .all(self.pairs())
            .filter_map(|([i, j], [x, y, z, held])| {
                let pair = [locals[0][place_of(i) as usize], locals[1][place_of(j) as usize]];
                let [i, j] = (!pair.contains(&u32::MAX)).then(|| pair.map(place_of))?;
                // Of a body and itself the lower comes first.
                Some(if alone && i > j { ([j, i], [-x, -y, -z, held]) } else { ([i, j], [x, y, z, held]) })
            })
            .collect();
        // Where others have gone, blocks are filled anew, and places have another order.
        renumbered.sort_unstable_by_key(|(pair, _)| *pair);
        let first = list.len();
        renumbered.into_iter().for_each(|(pair, memory)| list.push(pair, memory));
        *self = Self { pairs: first as u32..list.len() as u32, ..Self::new(self.bodies) };
    }
}

/// The contacts of a body with itself and those after it.
pub(super) struct Contacts<'a> {
    /// All meetings of which the body is the first.
    pub(super) meetings: &'a mut [Meeting],
    /// Of each where the loads of its pairs that are close stand among all of the body's.
    pub(super) loads: &'a mut [Range<u32>],
    pub(super) bodies: &'a [Body],
    pub(super) pairs: &'a mut BodyPairs,
    pub(super) laws: &'a PairLaws,
    pub(super) frame: &'a Frame,
    /// Number of the step, from 2: so that what remembers nothing held in none.
    pub(super) step: u32,
}

impl Contacts<'_> {
    /// Looks up the pairs of those meetings that are due. What in_contact pairs remember stays.
    #[inline(always)]
    pub(super) fn search<S: Wide>(&mut self, simd: S, search: &Search, room: &mut Room) {
        let mut due = std::mem::take(&mut room.due);
        due.clear();
        due.extend(self.meetings.iter().map(|meeting| meeting.is_due(self.bodies)));
        if std::mem::take(&mut self.pairs.is_stale) || due.contains(&true) {
            self.list(simd, search, room, &due);
        }
        room.due = due;
    }

    /// Writes the list afresh.
    #[inline(always)]
    fn list<S: Wide>(
        &mut self,
        simd: S,
        search: &Search,
        Room { finder, spare, looks, .. }: &mut Room,
        due: &[bool],
    ) {
        let list = &mut self.pairs.list;
        spare.clear();
        // Pairs of meetings that are not due, one after the other: they go over together.
        let mut stay = 0..0;
        for m in 0..self.meetings.len() {
            // What the next will look at comes meanwhile, all of it: a search takes longer than that.
            if due[m]
                && let Some(next) = due[m + 1..].iter().position(|&due| due)
            {
                let Meeting { bodies, candidates, .. } = &self.meetings[m + 1 + next];
                fetch::soon(&candidates.pairs);
                fetch::soon(&self.bodies[bodies[1] as usize].points.positions);
            }
            let meeting = &mut self.meetings[m];
            let old = meeting.pairs();
            let mut found = &[][..];
            if due[m] {
                let sides = meeting.bodies.map(|body| &self.bodies[body as usize]);
                found = meeting.search(simd, search, self.frame, sides, finder, looks);
            }
            // A search that had nothing and found nothing, as half of them, leaves the list as it is.
            let is_new = due[m] && !(old.is_empty() && found.is_empty());
            if is_new || (!old.is_empty() && old.start != stay.end) {
                spare.extend(list, stay);
                stay = old.start..old.start;
            }
            let first = spare.len() + stay.len();
            let count = if is_new {
                spare.take_over(&meeting.candidates.pairs, found, list, old.clone());
                stay = old.end..old.end;
                found.len()
            } else {
                stay.end += old.len();
                old.len()
            };
            meeting.pairs = first as u32..(first + count) as u32;
        }
        if spare.len() == 0 && stay == (0..list.len()) {
            return;
        }
        spare.extend(list, stay);
        std::mem::swap(list, spare);
    }

    /// Works out the load of every pair that is close. Returns their greatest overlap, in metres.
    #[inline(always)]
    pub(super) fn forces<S: Wide>(&mut self, simd: S, room: &mut Room) -> f32 {
        let Room { batches, loads: summed, looks, .. } = room;
        let [mut batch, mut full] = batches.each_mut();
        let BodyPairs { list, loads, within, .. } = &mut *self.pairs;
        let mine = &self.bodies[self.meetings[0].bodies[0] as usize];
        loads.clear();
        within.clear();
        let apart = space(&mut looks.apart, list.len());
        // DampingCap meetings have no pair.
        for meeting in self.meetings.iter().filter(|it| !it.pairs.is_empty()) {
            let ([_, other], pairs) = (meeting.bodies, meeting.pairs());
            let sides = [&mine.points, &self.bodies[other as usize].points];
            pairs::look(&list.places[pairs.clone()], sides, self.frame, &mut apart[pairs]);
        }
        // What has touched holds a little further.
        let reach = self.laws.touch + self.laws.contact.snap.abs();
        let mut close =
            pairs::close(simd, apart, reach * (1.0 + ROUNDING) / self.frame.unit_m, &mut looks.close);
        let (mut deepest, mut done) = (0.0f32, 0);
        for m in 0..self.meetings.len() {
            let meeting = &self.meetings[m];
            if meeting.pairs.is_empty() {
                // Only where it is news: lines of the cache are shared with other threads.
                if self.loads[m] != (0..0) {
                    self.loads[m] = 0..0;
                }
                continue;
            }
            let count = close.partition_point(|&pair| pair < meeting.pairs.end);
            // Single spheres that go together have several contacts each; a fillet hardly any with itself, which are no work to keep.
            // Not by how many there are now: that goes by spheres that others know nothing of.
            let is_summed = meeting.bodies[0] == meeting.bodies[1] && mine.bonds.is_empty();
            if is_summed {
                self.pairs.within.begin(mine.points.positions.len(), &Loads::default());
            }
            let kept = if is_summed { 0 } else { count as u32 };
            self.loads[m] = done..done + kept;
            done += kept;
            let theirs = &self.bodies[meeting.bodies[1] as usize];
            let (sides, root_mass) =
                ([&mine.points, &theirs.points], root_of_equivalent(mine.mass, theirs.mass));
            let mut these;
            (these, close) = close.split_at(count);
            while !these.is_empty() {
                let list = &self.pairs.list;
                // The compiler would make one function of this and the kernels, which have no register to spare.
                let taken = by_itself(simd, Take { batch, close: these, list, apart, sides, root_mass });
                these = &these[taken..];
                if batch.pairs.len() == BATCH {
                    let summed = is_summed.then_some(&mut *summed);
                    deepest = deepest.max(by_itself(simd, WorkOut { contacts: self, batch: full, summed }));
                    std::mem::swap(&mut batch, &mut full);
                }
            }
            if is_summed {
                for batch in [&mut *full, &mut *batch] {
                    let summed = Some(&mut *summed);
                    deepest = deepest.max(by_itself(simd, WorkOut { contacts: self, batch, summed }));
                }
                by_itself(simd, AddWithin { sums: &mut self.pairs.within, loads: summed });
                summed.clear();
            }
        }
        for batch in [full, batch] {
            deepest = deepest.max(by_itself(simd, WorkOut { contacts: self, batch, summed: None }));
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
    /// Room for what pairs within a body do, if that is summed up at once.
    summed: Option<&'a mut PairLoads>,
}

impl Job for WorkOut<'_, '_> {
    type Output = f32;

    #[inline(always)]
    fn run<S: Wide>(self, simd: S) -> f32 {
        let Self { contacts: Contacts { pairs, laws, frame, step, .. }, batch, summed } = self;
        let BodyPairs { list, loads, within, .. } = &mut **pairs;
        if batch.pairs.is_empty() {
            return 0.0;
        }
        let mut felt = [Felt::NOTHING; 2];
        let mut lanes = batch.lanes(simd, frame, *step);
        let deepest = kernel::contacts(simd, laws, &mut lanes, &mut felt);
        let PairLoads { loads, places } = match summed {
            None => loads,
            Some(summed) => {
                // What the batch before does, which is there by now.
                by_itself(simd, AddWithin { sums: within, loads: summed });
                summed.clear();
                summed
            }
        };
        loads.push(simd, &felt[0]);
        loads.push(simd, &felt[1]);
        let memory = [lanes.memory[0].memory(simd, *step).0, lanes.memory[1].memory(simd, *step).0];
        list.hand_back(&batch.pairs, memory.as_flattened(), places);
        batch.pairs.clear();
        deepest
    }
}
