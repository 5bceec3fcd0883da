//! Continuous feed: fillets enter above the hopper at a given mass rate, from the start of the belt on.
//!
//! The next fillet enters at the sample by which half of it is due, at the height of the walls, at a random
//! place where it touches nothing. Without such a place it waits for the next sample.

use glam::{DQuat, DVec2, DVec3};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use serde::{Deserialize, Serialize};

use crate::engine::scene::{BodyKind, Placement, Scene};
use crate::engine::state::State;
use crate::experiments::clashes::OVERLAP_RATIO;
use crate::experiments::placement::{GAP_RATIO, orient, uniform};
use crate::scenario::{Equipment, Scenario};

use super::floor;

/// Maximum number of fillets that a feed may bring, that of `/product/count`.
pub(super) const MAX_FED: usize = 100_000;
/// Places tried for a fillet at each sample.
const PLACES: usize = 24;
/// Share of the mass due that may be missing without a warning.
const SHORT_SHARE: f64 = 0.01;
/// Stream of random numbers, other than that of the first filling.
const STREAM: u64 = 1;

/// Kinds of the fillets that the feed brings until the end, in the order of the first filling, at most [`MAX_FED`].
pub(super) fn fed_kinds(scenario: &Scenario, equipment: &Equipment, kinds: &[BodyKind]) -> Vec<usize> {
    let due_kg = equipment.feed_kg_s * scenario.numerics.duration_s;
    let mut fed_kg = 0.0;
    let mut next = scenario.product.count as usize;
    let mut fed = Vec::new();
    while fed_kg < due_kg && fed.len() < MAX_FED {
        let kind = next % kinds.len();
        fed_kg += kinds[kind].mass_kg();
        fed.push(kind);
        next += 1;
    }
    fed
}

/// Corners of the space over the hopper in which fed fillets appear, in metres. A surface outside it overlaps their sub-particles by
/// no more than a start may.
pub(super) fn entry_box(equipment: &Equipment, scene: &Scene) -> (DVec3, DVec3) {
    let inset = (GAP_RATIO + OVERLAP_RATIO) * scene.radius_m;
    let floor = floor(equipment);
    let across = DVec2::new(inset, if floor.periodic_y { 0.0 } else { inset });
    let longest = scene.kinds.iter().map(|kind| 2.0 * kind.meta.bounding_radius_m).fold(0.0, f64::max);
    let (bottom, top) = (equipment.hopper_height_m + inset, longest + 2.0 * scene.radius_m);
    ((floor.low + across).extend(bottom), (floor.high - across).extend(equipment.hopper_height_m + top))
}

/// The progress of a feed so far.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct SavedFeed {
    waiting: u64,
    next: Option<(u64, DQuat, Vec<DVec3>)>,
    fed_kg: f64,
    due_kg: f64,
    /// Random numbers drawn, in words.
    drawn: u128,
}

/// The feed of a run.
#[derive(Debug)]
pub(super) struct Feed {
    equipment: Equipment,
    kinds: Vec<BodyKind>,
    radius_m: f64,
    /// Radius of a sub-particle towards other fillets, in metres.
    outer_radius_m: f64,
    /// Kinds of the fillets that wait, the next one first, with the orientation of that one.
    waiting: std::vec::IntoIter<usize>,
    next: Option<(usize, DQuat, Vec<DVec3>)>,
    fed_kg: f64,
    /// Mass that was to have entered by the last sample, in kilograms.
    due_kg: f64,
    /// Number of bodies of the run.
    bodies: usize,
    rng: ChaCha8Rng,
}

impl Feed {
    pub(super) fn new(scenario: &Scenario, equipment: &Equipment, scene: &Scene) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(scenario.seed);
        rng.set_stream(STREAM);
        let waiting: Vec<usize> =
            scene.bodies[scene.present().len()..].iter().map(|body| body.kind).collect();
        Self {
            equipment: equipment.clone(),
            kinds: scene.kinds.clone(),
            radius_m: scene.radius_m,
            outer_radius_m: scene.radius_m * scenario.contact.fillet_fillet_radius_ratio,
            waiting: waiting.into_iter(),
            next: None,
            fed_kg: 0.0,
            due_kg: 0.0,
            bodies: scene.bodies.len(),
            rng,
        }
    }

    pub(super) fn save(&self) -> SavedFeed {
        SavedFeed {
            waiting: self.waiting.len() as u64,
            next: self.next.clone().map(|(kind, turn, points)| (kind as u64, turn, points)),
            fed_kg: self.fed_kg,
            due_kg: self.due_kg,
            drawn: self.rng.get_word_pos(),
        }
    }

    /// Takes over what a feed of the same scenario has done. Returns whether it is such a feed.
    #[must_use]
    pub(super) fn restore(&mut self, saved: SavedFeed) -> bool {
        let all = self.waiting.len() as u64;
        let kinds = self.kinds.len() as u64;
        if saved.waiting > all || saved.next.as_ref().is_some_and(|(kind, ..)| *kind >= kinds) {
            return false;
        }
        self.waiting.by_ref().take((all - saved.waiting) as usize).for_each(drop);
        self.next = saved.next.map(|(kind, turn, points)| (kind as usize, turn, points));
        (self.fed_kg, self.due_kg) = (saved.fed_kg, saved.due_kg);
        self.rng.set_word_pos(saved.drawn);
        true
    }

    /// Mass that has entered, in kilograms.
    pub(super) fn fed_kg(&self) -> f64 {
        self.fed_kg
    }

    /// Mass that was due, in kilograms, if more than a fillet and [`SHORT_SHARE`] of it is missing.
    pub(super) fn missed_kg(&self) -> Option<f64> {
        let heaviest_kg = self.kinds.iter().map(BodyKind::mass_kg).fold(0.0, f64::max);
        let missing_kg = self.due_kg - self.fed_kg;
        (missing_kg > heaviest_kg.max(SHORT_SHARE * self.due_kg)).then_some(self.due_kg)
    }

    /// Number of the body that enters next.
    pub(super) fn next_body(&self) -> usize {
        self.bodies - self.waiting.len() - usize::from(self.next.is_some())
    }

    /// The fillets that enter at a belt time.
    pub(super) fn entering(&mut self, state: &State, now_s: f64) -> Vec<Placement> {
        self.due_kg = self.equipment.feed_kg_s * now_s;
        let mut entering = Vec::new();
        let mut obstacles = Vec::new();
        loop {
            if self.next.is_none() {
                let Some(kind) = self.waiting.next() else { break };
                let (turn, points) =
                    orient(&self.kinds[kind], self.radius_m, floor(&self.equipment), &mut self.rng);
                self.next = Some((kind, turn, points));
            }
            let Some((kind, orientation, points)) = self.next.take() else { break };
            let mass_kg = self.kinds[kind].mass_kg();
            let is_due = self.fed_kg + 0.5 * mass_kg <= self.due_kg;
            if is_due && entering.is_empty() {
                obstacles = self.near_entry(state);
            }
            let place = if is_due { self.place(&points, &obstacles) } else { None };
            let Some(position) = place else {
                self.next = Some((kind, orientation, points));
                break;
            };
            obstacles.extend(points.iter().map(|&point| position + point));
            self.fed_kg += mass_kg;
            entering.push(Placement { kind, position, orientation, velocity: DVec3::ZERO });
        }
        entering
    }

    /// Positions of the sub-particles that a fillet may touch where it enters.
    fn near_entry(&self, state: &State) -> Vec<DVec3> {
        let lowest = self.equipment.hopper_height_m - 2.0 * self.outer_radius_m;
        let all = (0..state.particles.len()).map(|i| state.position(i));
        all.filter(|x| x.z > lowest).collect()
    }

    /// A place where the points touch nothing.
    fn place(&mut self, points: &[DVec3], obstacles: &[DVec3]) -> Option<DVec3> {
        let (floor, room) = (floor(&self.equipment), self.radius_m * (1.0 + GAP_RATIO));
        let low = points.iter().copied().fold(DVec3::MAX, DVec3::min);
        let high = points.iter().copied().fold(DVec3::MIN, DVec3::max);
        let (mut from, mut to) = (floor.low - low.truncate() + room, floor.high - high.truncate() - room);
        if floor.periodic_y {
            (from.y, to.y) = (floor.low.y, floor.high.y);
        }
        let width = if floor.periodic_y { floor.high.y - floor.low.y } else { f64::INFINITY };
        let apart = 2.0 * self.outer_radius_m * (1.0 + GAP_RATIO);
        (0..PLACES).find_map(|_| {
            let share = DVec2::new(uniform(&mut self.rng), uniform(&mut self.rng));
            let at = (from + (to - from) * share).extend(self.equipment.hopper_height_m + room - low.z);
            let near = |x: DVec3| {
                let boxed = x.cmpgt(low - apart).all() && x.cmplt(high + apart).all();
                boxed && points.iter().any(|point| point.distance(x) < apart)
            };
            let touches = |x: &DVec3| images(*x - at, width).any(near);
            (!obstacles.iter().any(touches)).then_some(at)
        })
    }
}

/// The periodic image of a point nearest to the origin and its neighbours, within reach of a body shorter than the period; the point
/// itself if the period is infinite.
fn images(x: DVec3, period_m: f64) -> impl Iterator<Item = DVec3> {
    let nearest = (x.y / period_m).round();
    let shifts = if period_m.is_finite() { &[0.0, -1.0, 1.0][..] } else { &[] };
    let image = move |shift: &f64| x - DVec3::Y * period_m * (nearest + shift);
    let itself = period_m.is_infinite().then_some(x);
    itself.into_iter().chain(shifts.iter().map(image))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn images_of_a_point_include_every_period_within_reach_of_a_long_fillet() {
        // From −20 to 80 mm in a period of 110 mm: −35 mm is the nearest image of a point that its tail meets at 75 mm.
        let image_mm = |x: f64| -> Vec<f64> {
            let mut found: Vec<f64> = images(DVec3::Y * x / 1000.0, 0.11).map(|at| at.y * 1000.0).collect();
            found.sort_unstable_by(f64::total_cmp);
            found.into_iter().map(f64::round).collect()
        };
        assert_eq!(image_mm(75.0), [-145.0, -35.0, 75.0]);
        assert_eq!(image_mm(-255.0), [-145.0, -35.0, 75.0]);
        assert_eq!(images(DVec3::Y, f64::INFINITY).collect::<Vec<_>>(), [DVec3::Y]);
    }
}
