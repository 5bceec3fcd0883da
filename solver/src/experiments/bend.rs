//! A fillet that bends under its own weight (paper sections 2.3.2 and 3.2, Fig. 7): how far.
//!
//! Three ways to let it bend. *Over a bar*: it lies flat on a table, its centre of mass above the axis of a bar that is flush with
//! it, and from t = 0 on the table sinks, until both ends hang. *Clamped*: likewise, but a share of its length at the blunt
//! end is held. *Off a ledge*: it lies on a conveyor, which carries it over its end from t = 0 on. The table sinks slowly: let go at
//! once, a fillet whips round the bar and flings itself off, or tears at the clamp. The bend angle is the turning of its centre line from end to end
//! ([`crate::observe::BendGauge`]): 0° flat, 180° folded double.
//!
//! Expected over a bar: more than 120° for size 2 at Table 2, less with stiffer bonds wherever all of them hold.

use std::f64::consts::TAU;

use glam::{DQuat, DVec3};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use serde_json::{Value, json};

use super::bending::BendWatch;
use super::drop::height_over_plate;
use super::placement::uniform;
use super::{Prepared, bounds_on_timestep, kinds, laws, orientation, plan, timestep_s};
use crate::engine::scene::{BodyKind, Placement, Scene};
use crate::equipment::{Motion, Surface, SurfaceKind};
use crate::mesh::Meshes;
use crate::scenario::{Bend, Fault, Scenario, Support};

/// Sides of the bar are at most this wide, as a share of R, within the limits below.
const SIDE_RATIO: f64 = 0.25;
/// Fewest and most sides of the bar.
const SIDES: (f64, f64) = (48.0, 1024.0);
/// The table sinks at this speed, in m/s.
pub(super) const SINKING_M_S: f64 = 0.1;
/// Room around everything, in metres.
const MARGIN_M: f64 = 0.1;

/// The experiment of a fillet that bends.
pub(super) fn prepare(scenario: &Scenario, bend: &Bend, meshes: &Meshes) -> Prepared {
    let kinds = kinds(scenario, meshes);
    let (kind, radius_m) = (&kinds[0], scenario.product.radius_m());
    let mut rng = ChaCha8Rng::seed_from_u64(scenario.seed);
    let orientation = orientation([bend.scatter_deg * (2.0 * uniform(&mut rng) - 1.0), 0.0, 0.0]);
    let bounding_radius_m = kind.meta.bounding_radius_m + radius_m;
    let body = Placement { kind: 0, ..start(kind, bend.support, orientation, radius_m, bounding_radius_m) };
    // It may lie on the conveyor, hang from it, and fall off.
    let room = DVec3::splat(3.0 * bounding_radius_m + 2.0 * bend.bar_radius_m + MARGIN_M);
    let scene = Scene {
        radius_m,
        surfaces: surfaces(bend, radius_m, bounding_radius_m),
        laws: laws::laws(scenario),
        gravity: DVec3::NEG_Z * scenario.numerics.gravity_m_s2,
        low: -room,
        high: room,
        periodic_y: false,
        timestep_s: timestep_s(scenario, &bounds_on_timestep(scenario, &kinds)),
        speed_limit_m_s: scenario.numerics.speed_limit_m_s,
        bodies: vec![body],
        held: match bend.support {
            Support::Clamped => held(kind, bend.clamped_share, radius_m),
            Support::OverBar | Support::OffLedge => Vec::new(),
        },
        kinds,
    };
    let watch = Box::new(BendWatch::new(scenario, bend, &scene));
    Prepared { plan: plan(scenario), watch, scene }
}

/// Where the fillet starts: just above what it lies on, whose top is z = 0, and on a conveyor wholly.
fn start(
    kind: &BodyKind,
    support: Support,
    orientation: DQuat,
    radius_m: f64,
    bounding_radius_m: f64,
) -> Placement {
    let above = DVec3::Z * height_over_plate(kind, orientation, radius_m);
    let position = match support {
        Support::OffLedge => above - DVec3::X * bounding_radius_m,
        Support::OverBar | Support::Clamped => above,
    };
    Placement { kind: 0, position, orientation, velocity: DVec3::ZERO }
}

/// What the fillet lies on: a table and the bar, a table alone, or the conveyor and the roller at its end.
fn surfaces(bend: &Bend, radius_m: f64, bounding_radius_m: f64) -> Vec<Surface> {
    let (radius, half) = (bend.bar_radius_m, bounding_radius_m + MARGIN_M);
    let axis = DVec3::NEG_Z * radius;
    let sides = (TAU * radius / (SIDE_RATIO * radius_m)).ceil().clamp(SIDES.0, SIDES.1);
    let bar = |name: &str, kind| Surface::cylinder(name, kind, axis, DVec3::Y * half, radius, sides as u32);
    // From x on, `length` metres.
    let plate = |name: &str, kind, x: f64, length: f64| {
        let corner = DVec3::new(x, -half, 0.0);
        Surface::parallelogram(name, kind, corner, DVec3::X * length, DVec3::Y * 2.0 * half)
    };
    let sinking =
        Motion::Moving { velocity: DVec3::NEG_Z * SINKING_M_S, pivot: DVec3::ZERO, spin: DVec3::ZERO };
    let table = || plate("table", SurfaceKind::Equipment, -half, 2.0 * half).moving(sinking);
    match bend.support {
        Support::OverBar => vec![bar("bar", SurfaceKind::Equipment), table()],
        Support::Clamped => vec![table()],
        Support::OffLedge => {
            let velocity = DVec3::X * bend.belt_speed_m_s;
            let length = 2.0 * bounding_radius_m + MARGIN_M;
            let belt = plate("belt", SurfaceKind::Belt, -length, length).moving(Motion::Belt { velocity });
            // Its top runs with the belt.
            let spin = DVec3::Y * (bend.belt_speed_m_s / radius);
            let turning = Motion::Moving { velocity: DVec3::ZERO, pivot: axis, spin };
            vec![belt, bar("roller", SurfaceKind::Belt).moving(turning)]
        }
    }
}

/// The sub-particles in a share of the length at the blunt end, that of low x.
fn held(kind: &BodyKind, share: f64, radius_m: f64) -> Vec<u32> {
    let along = || kind.meta.points.iter().map(|point| point.x);
    let blunt = along().fold(f64::INFINITY, f64::min) - radius_m;
    let tail = along().fold(f64::NEG_INFINITY, f64::max) + radius_m;
    let inside = |(x, _): &(f64, u32)| *x <= blunt + share * (tail - blunt);
    along().zip(0..).filter(inside).map(|(_, i)| i).collect()
}

/// A clamp that holds nothing, or everything.
pub(crate) fn clamp_fault(scenario: &Scenario, bend: &Bend, kinds: &[BodyKind]) -> Option<Fault> {
    let kind = kinds.first().filter(|_| bend.support == Support::Clamped)?;
    let (held, all) =
        (held(kind, bend.clamped_share, scenario.product.radius_m()).len(), kind.meta.points.len());
    (held == 0 || held == all).then(|| {
        let what = if held == 0 { "none" } else { "all" };
        let detail = format!("{what} of the {all} sub-particles would be held");
        let allowed = "a share that holds a layer of sub-particles and leaves one free".to_owned();
        let value: Value = json!(bend.clamped_share);
        Fault::new("/bend/clamped_share", &value, detail, Some(allowed))
    })
}
