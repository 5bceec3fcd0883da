//! Fillets and blocks that fall onto each other.
#![allow(unreachable_pub, reason = "shared with what includes it")]

use glam::{DQuat, DVec3};
use roost_solver::engine::scene::{BodyKind, Placement, Scene};
use roost_solver::equipment::{Motion, Surface, SurfaceKind};
use roost_solver::scenario::Fill;
use roost_solver::shape::lattice::MetaParticle;
use roost_solver::shape::teardrop::Teardrop;

use crate::common::{G, RADIUS, at, block, law, plate, scene};

/// A fillet of 12 mm spheres.
pub fn fillet() -> BodyKind {
    let shape = Teardrop { size_m: [0.172, 0.072, 0.032], mirrored: false };
    let meta = MetaParticle::fill(&shape, RADIUS, Fill::Centres, 1);
    BodyKind { subparticle_mass_kg: meta.volume_m3 * 940.0 / meta.points.len() as f64, meta: meta.into() }
}

/// Three fillets that fall onto each other and into a corner of a plate and a wall.
pub fn drop() -> Scene {
    let body = |x, z, angle, speed| Placement {
        kind: 0,
        position: DVec3::new(x, 0.01 * z / 0.05, z),
        orientation: DQuat::from_rotation_y(angle) * DQuat::from_rotation_z(0.4 * angle),
        velocity: DVec3::NEG_Z * speed,
    };
    let bodies = vec![body(0.0, 0.025, 0.1, 1.0), body(0.03, 0.07, 0.5, 2.0), body(-0.02, 0.10, -0.2, 3.0)];
    let mut scene = scene(fillet(), bodies, 1e-4);
    let wall = DVec3::new(-0.07, -0.3, 0.0);
    scene.surfaces = vec![
        plate(SurfaceKind::Belt).moving(Motion::Belt { velocity: DVec3::X * 0.25 }),
        Surface::parallelogram("wall", SurfaceKind::Equipment, wall, DVec3::Y * 0.6, DVec3::Z * 0.3),
    ];
    scene.gravity = DVec3::NEG_Z * G;
    scene.laws.tissue = law(false, 0.01, 0.3, 0.055);
    scene.laws.equipment = law(true, 0.01, 0.5, 0.055);
    scene.laws.belt = law(true, 0.01, 0.4, 0.055);
    scene.laws.contact_between_bonded = true;
    scene
}

/// Blocks dropped in a heap.
pub fn heap() -> Scene {
    let bodies = (0..8).map(|k| {
        let k = f64::from(k);
        let position = DVec3::new(0.012 * (k * 2.4).sin(), 0.012 * (k * 1.7).cos(), 0.03 + 0.035 * k);
        Placement { orientation: DQuat::from_rotation_x(k), ..at(position, DVec3::NEG_Z * (1.0 + 0.2 * k)) }
    });
    let mut scene = scene(block([4, 4, 3]), bodies.collect(), 5e-5);
    scene.surfaces = vec![plate(SurfaceKind::Equipment)];
    scene.gravity = DVec3::NEG_Z * G;
    scene.laws.tissue = law(false, 0.1, 0.3, 0.055);
    scene.laws.equipment = law(true, 0.1, 0.5, 0.055);
    scene.laws.contact_between_bonded = true;
    scene
}

/// 600 small bodies, close together: each thread takes more than two at once.
pub fn many() -> Scene {
    let bodies = (0..600).map(|k| {
        let [x, y, z] = [k % 12, k / 12 % 10, k / 120].map(|k| 0.0165 * f64::from(k));
        at(DVec3::new(x, y, 0.02 + z), DVec3::NEG_Z * 0.3 * f64::from(k % 7))
    });
    let mut scene = scene(block([2, 2, 1]), bodies.collect(), 5e-5);
    scene.surfaces = vec![plate(SurfaceKind::Equipment)];
    scene.gravity = DVec3::NEG_Z * G;
    scene.laws.tissue = law(true, 0.1, 0.3, 0.055);
    scene
}

/// Single spheres, pressed together, and enough for several bodies. They have three contacts each, and lose them as they fly apart.
pub fn spheres() -> Scene {
    let bodies = (0..700).map(|k| {
        let cell = DVec3::new(f64::from(k % 9), f64::from(k / 9 % 9), f64::from(k / 81));
        // Off the lattice, so that no sum is exact.
        let off = DVec3::new(f64::from(k * 37 % 17), f64::from(k * 53 % 19), f64::from(k * 29 % 13)) * 5e-3;
        let position = (cell * 1.9 + off) * RADIUS;
        at(position, position * 20.0 + DVec3::new(0.3, -0.2, -1.0) * (f64::from(k % 5) - 2.0) * 0.05)
    });
    let mut scene = scene(block([1, 1, 1]), bodies.collect(), 5e-5);
    scene.laws.tissue = law(true, 0.1, 0.3, 0.055);
    scene
}
