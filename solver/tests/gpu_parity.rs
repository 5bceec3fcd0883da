//! Whole scenes on the GPU are bit-equal to the plain path.

mod common;
#[path = "common/parity.rs"]
mod parity;

use common::{at, block, law, plate, scene};
use glam::DVec3;
use parity::Both;
use roost_solver::engine::scene::Scene;
use roost_solver::equipment::SurfaceKind;
use roost_solver::gpu::Gpu;
use roost_solver::gpu::source::Source;

/// Two blocks that fall onto each other and a plate.
fn blocks() -> Scene {
    let bodies = vec![
        at(DVec3::new(0.0, 0.0, 0.03), DVec3::NEG_Z),
        at(DVec3::new(0.01, 0.005, 0.07), DVec3::NEG_Z * 2.0),
        at(DVec3::new(0.3, 0.0, 0.02), DVec3::NEG_Z),
    ];
    let mut scene = scene(block([4, 4, 3]), bodies, 5e-5);
    scene.surfaces = vec![plate(SurfaceKind::Equipment)];
    scene.gravity = DVec3::NEG_Z * common::G;
    scene.laws.tissue = law(false, 0.1, 0.3, 0.055);
    scene.laws.equipment = law(true, 0.1, 0.5, 0.055);
    scene.laws.contact_between_bonded = true;
    scene
}

#[test]
fn blocks_fall_alike() {
    let Some(device) = parity::device() else { return };
    let gpu = Gpu::with(device, &Source::kernels());
    let mut both = Both::new(&gpu, &blocks());
    both.stay_the_same(10, 1);
    both.stay_the_same(2000, 100);
}
