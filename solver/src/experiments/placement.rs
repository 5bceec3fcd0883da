//! Positions and orientations at the start, and the domain's edge.
//!
//! A pile is stacked loosely and touches nothing. Each fillet gets a random orientation and is set down, at the best of several random places, on a height map of
//! the fillets below it. The stack is loose and collapses into the hopper when the run begins.

use std::f64::consts::TAU;

use glam::{DQuat, DVec2, DVec3, EulerRot};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

use crate::engine::scene::{BodyKind, Placement};
use crate::engine::state::State;

/// Positions tried for each fillet.
const PLACES: usize = 24;
/// Orientations tried until one fits between the walls; a fillet that barely fits is then stood upright.
const ORIENTATIONS: usize = 1000;
/// Clearance between fillets, and over a plate, as a share of R.
pub(super) const GAP_RATIO: f64 = 0.05;

/// The floor space that fillets are dropped over.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Floor {
    /// Lower corner in x and y, in metres.
    pub low: DVec2,
    /// Upper corner in x and y, in metres.
    pub high: DVec2,
    /// Whether y is periodic: fillets may straddle the corners in y.
    pub periodic_y: bool,
}

/// A number from 0 to 1 (excluded), from the top 53 bits of the next word: the same on every platform.
pub(super) fn uniform(rng: &mut ChaCha8Rng) -> f64 {
    (rng.next_u64() >> 11) as f64 / (1u64 << 53) as f64
}

/// The orientation of intrinsic yaw (about z), pitch (about y) and roll (about x), in degrees.
pub fn orientation([yaw, pitch, roll]: [f64; 3]) -> DQuat {
    DQuat::from_euler(EulerRot::ZYX, yaw.to_radians(), pitch.to_radians(), roll.to_radians())
}

/// Height of the centre of mass over a plate z = 0 from which the lowest sub-particle is a gap away, in metres.
pub(super) fn height_over_plate(kind: &BodyKind, orientation: DQuat, radius_m: f64) -> f64 {
    let lowest = kind.meta.points.iter().map(|&point| (orientation * point).z).fold(f64::INFINITY, f64::min);
    radius_m * (1.0 + GAP_RATIO) - lowest
}

/// Serials of the sub-particles outside a box.
pub(super) fn outside(state: &State, low: DVec3, high: DVec3) -> Vec<u32> {
    let inside = |x: DVec3| x.cmpge(low).all() && x.cmple(high).all();
    let outside = (0..state.particles.len()).filter(|&i| !inside(state.position(i)));
    outside.map(|i| state.serials[i]).collect()
}

/// A rotation drawn uniformly from all rotations (Shoemake 1992).
fn rotation(rng: &mut ChaCha8Rng) -> DQuat {
    let (u, v, w) = (uniform(rng), TAU * uniform(rng), TAU * uniform(rng));
    let (a, b) = ((1.0 - u).sqrt(), u.sqrt());
    DQuat::from_xyzw(a * v.sin(), a * v.cos(), b * w.sin(), b * w.cos())
}

/// Heights of the placed fillets over the floor.
struct HeightMap {
    floor: Floor,
    cell: f64,
    counts: [usize; 2],
    heights: Vec<f64>,
}

impl HeightMap {
    fn new(floor: Floor, radius: f64) -> Self {
        let size = floor.high - floor.low;
        let counts = [size.x, size.y].map(|s| ((s / radius).floor() as usize).max(1));
        // One cell size for both axes, so that a whole number of cells spans the period.
        let cell = size.y / counts[1] as f64;
        let counts = [(size.x / cell).ceil() as usize, counts[1]];
        Self { floor, cell, counts, heights: vec![0.0; counts[0] * counts[1]] }
    }

    /// Calls `visit` with the index of every cell under a sphere.
    fn under(&self, at: DVec2, radius: f64, mut visit: impl FnMut(usize)) {
        let low = (at - radius - self.floor.low) / self.cell;
        let high = (at + radius - self.floor.low) / self.cell;
        for y in low.y.floor() as i64..=high.y.floor() as i64 {
            let y = if self.floor.periodic_y {
                y.rem_euclid(self.counts[1] as i64)
            } else {
                y.clamp(0, self.counts[1] as i64 - 1)
            };
            for x in low.x.floor().max(0.0) as usize..=(high.x.floor() as usize).min(self.counts[0] - 1) {
                visit(x + self.counts[0] * y as usize);
            }
        }
    }
}

/// Places `count` bodies, body `i` of kind `i mod kinds`, with velocity zero. `radii` are those of a sub-particle, in metres: R, and
/// towards other bodies.
pub fn drop_in(kinds: &[BodyKind], count: usize, radii: [f64; 2], floor: Floor, seed: u64) -> Vec<Placement> {
    let [radius, outer] = radii;
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut map = HeightMap::new(floor, radius);
    (0..count)
        .map(|i| {
            let kind = i % kinds.len();
            let (orientation, points) = orient(&kinds[kind], radius, floor, &mut rng);
            let position = settle(&points, radii, &map, &mut rng);
            for &point in &points {
                let top = position + point;
                let mut cells = Vec::new();
                map.under(top.truncate(), outer, |cell| cells.push(cell));
                for cell in cells {
                    map.heights[cell] = map.heights[cell].max(top.z + outer);
                }
            }
            Placement { kind, position, orientation, velocity: DVec3::ZERO }
        })
        .collect()
}

/// A random orientation in which the body fits over the floor, and its points turned accordingly.
pub(super) fn orient(
    kind: &BodyKind,
    radius: f64,
    floor: Floor,
    rng: &mut ChaCha8Rng,
) -> (DQuat, Vec<DVec3>) {
    let room = floor.high - floor.low - 2.0 * radius * (1.0 + GAP_RATIO);
    let turned = |orientation: DQuat| -> Vec<DVec3> {
        kind.meta.points.iter().map(|&point| orientation * point).collect()
    };
    for _ in 0..ORIENTATIONS {
        let orientation = rotation(rng);
        let points = turned(orientation);
        let span = extent(&points);
        if span.x <= room.x && (floor.periodic_y || span.y <= room.y) {
            return (orientation, points);
        }
    }
    let size = extent(&kind.meta.points);
    let longest =
        [DVec3::X, DVec3::Y, DVec3::Z].into_iter().max_by(|a, b| a.dot(size).total_cmp(&b.dot(size)));
    let upright = DQuat::from_rotation_arc(longest.expect("three axes"), DVec3::Z);
    (upright, turned(upright))
}

/// Size of the box around some points.
fn extent(points: &[DVec3]) -> DVec3 {
    let low = points.iter().copied().fold(DVec3::MAX, DVec3::min);
    points.iter().copied().fold(DVec3::MIN, DVec3::max) - low
}

/// The lowest of several random places where the points clear everything placed before.
fn settle(points: &[DVec3], [radius, outer]: [f64; 2], map: &HeightMap, rng: &mut ChaCha8Rng) -> DVec3 {
    let gap = GAP_RATIO * radius;
    let low = points.iter().copied().fold(DVec3::MAX, DVec3::min).truncate();
    let high = points.iter().copied().fold(DVec3::MIN, DVec3::max).truncate();
    let (mut from, mut to) = (map.floor.low - low + radius + gap, map.floor.high - high - radius - gap);
    if map.floor.periodic_y {
        (from.y, to.y) = (map.floor.low.y, map.floor.high.y);
    }
    let place = |rng: &mut ChaCha8Rng| {
        let at = from + (to - from) * DVec2::new(uniform(rng), uniform(rng));
        let mut height = f64::NEG_INFINITY;
        for point in points {
            map.under(at + point.truncate(), outer, |cell| {
                height = height.max(map.heights[cell] + gap + outer - point.z);
            });
        }
        at.extend(height)
    };
    (0..PLACES).map(|_| place(rng)).min_by(|a, b| a.z.total_cmp(&b.z)).expect("several places were tried")
}
