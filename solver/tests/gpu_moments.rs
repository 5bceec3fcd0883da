//! Moments of bonds on the GPU are bit-equal to the plain path, also when bodies enter and sub-particles leave.

mod common;
#[path = "common/parity.rs"]
mod parity;

use common::{blocks, bonds, with_moments};
use glam::DVec3;
use parity::{Both, difference, gpu};
use roost_solver::cpu::Cpu;
use roost_solver::engine::Backend;
use roost_solver::engine::scene::Placement;
use roost_solver::physics::bond::{BondLaw, BondModel};

#[test]
fn gpu_matches_plain_path_for_bond_moments() {
    let Some(gpu) = gpu() else { return };
    for (model, strength) in [(BondModel::Corotated, f32::INFINITY), (BondModel::FiniteExtension, 0.03)] {
        let mut scene = with_moments(blocks(), 1.0);
        scene.laws.bond = BondLaw { model, normal_strength: strength, shear_strength: strength, ..bonds() };
        scene.bodies.push(scene.bodies[0]);
        scene.waiting = 1;
        let mut both = Both::new(&gpu, &scene);
        both.assert_equal_for(1000, 250);
        let broken = gpu.state(&mut both.gpu_run).bonds_broken;
        assert_eq!(broken > 10, strength < 1.0, "{broken} bonds broken");
        let late = Placement { position: DVec3::new(-0.1, 0.1, 0.03), ..scene.bodies[0] };
        both.plain.enter(&mut both.plain_run, &scene, scene.bodies.len() - 1, &[late]);
        both.gpu.enter(&mut both.gpu_run, &scene, scene.bodies.len() - 1, &[late]);
        both.assert_equal_for(500, 100);
        let some: Vec<u32> = (10..20).collect();
        both.plain.remove(&mut both.plain_run, &some);
        both.gpu.remove(&mut both.gpu_run, &some);
        both.assert_equal_for(500, 100);
    }
}

#[test]
fn runs_with_moments_and_without_share_a_batch() {
    let Some(gpu) = gpu() else { return };
    let [one, two] = [1.0, 2.0].map(|factor| with_moments(blocks(), factor));
    let scenes = [blocks(), one, blocks(), two];
    let plain = Cpu::plain(1);
    let mut runs = scenes.each_ref().map(|scene| gpu.prepare(scene));
    gpu.advance(&mut runs.each_mut().map(|run| (run, 700)));
    for (scene, run) in scenes.iter().zip(&mut runs) {
        let mut alone = plain.prepare(scene);
        plain.advance(&mut [(&mut alone, 700)]);
        assert_eq!(difference(plain.state(&mut alone), gpu.state(run)), None, "{:?}", scene.laws.moment);
    }
}
