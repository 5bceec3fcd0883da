//! The scene of a bend: the fillet, its support, and the clamp.

use std::f64::consts::TAU;

use glam::{DQuat, DVec3};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use serde_json::json;

use super::SINKING_M_S;
use crate::engine::scene::{BodyKind, Placement, Scene};
use crate::equipment::{Motion, Surface, SurfaceKind};
use crate::experiments::Setup;
use crate::experiments::placement::{height_over_plate, orientation, uniform};
use crate::scenario::{Bend, Fault, Support};

/// Sides of the bar are at most this wide, as a share of R, within the limits below.
const SIDE_RATIO: f64 = 0.25;
/// Fewest and most sides of the bar.
const SIDES: (f64, f64) = (48.0, 1024.0);
/// Margin of the domain around everything, in metres.
const MARGIN_M: f64 = 0.1;

/// The scene of a bend scenario.
pub(super) fn scene(setup: &Setup, bend: &Bend) -> Scene {
    let (scenario, kind) = (&setup.scenario, &setup.kinds[0]);
    let radius_m = scenario.product.radius_m();
    let mut rng = ChaCha8Rng::seed_from_u64(scenario.seed);
    let orientation = orientation([bend.scatter_deg * (2.0 * uniform(&mut rng) - 1.0), 0.0, 0.0]);
    let bounding_radius_m = kind.meta.bounding_radius_m + radius_m;
    let body = Placement { kind: 0, ..start(kind, bend.support, orientation, radius_m, bounding_radius_m) };
    // It may lie on the conveyor, hang from it, and fall off.
    let domain = DVec3::splat(3.0 * bounding_radius_m + 2.0 * bend.bar_radius_m + MARGIN_M);
    Scene {
        surfaces: surfaces(bend, radius_m, bounding_radius_m),
        low: -domain,
        high: domain,
        bodies: vec![body],
        held: match bend.support {
            Support::Clamped => held(kind, bend.clamped_share, radius_m),
            Support::OverBar | Support::OffLedge => Vec::new(),
        },
        ..setup.empty_scene()
    }
}

/// The placement of the fillet: just above its support, whose top is z = 0, and wholly on a conveyor.
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

/// The support: a table and the bar, a table alone, or the conveyor and the roller at its end.
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
pub(super) fn clamp_fault(setup: &Setup, bend: &Bend) -> Option<Fault> {
    let kind = setup.kinds.first().filter(|_| bend.support == Support::Clamped)?;
    let held = held(kind, bend.clamped_share, setup.scenario.product.radius_m()).len();
    let all = kind.meta.points.len();
    (held == 0 || held == all).then(|| {
        let amount = if held == 0 { "none" } else { "all" };
        let detail = format!("{amount} of the {all} sub-particles would be held");
        let allowed = "a share that holds a layer of sub-particles and leaves one free";
        Fault::at("/bend/clamped_share", json!(bend.clamped_share), detail, allowed)
    })
}
