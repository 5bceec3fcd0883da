//! Whole scenes on the GPU are bit-equal to the plain path.

mod common;
#[path = "common/parity.rs"]
mod parity;

use common::{at, bonds, block, law, plate, prepare, scene};
use glam::{DQuat, DVec3};
use parity::{Both, difference};
use roost_solver::cpu::Cpu;
use roost_solver::engine::Backend;
use roost_solver::engine::scene::Scene;
use roost_solver::equipment::{Motion, SurfaceKind};
use roost_solver::gpu::Gpu;
use roost_solver::gpu::source::Source;
use roost_solver::physics::bond::{BondLaw, Form};
use roost_solver::scenario::{self, Scenario};
use serde_json::json;

fn gpu() -> Option<Gpu> {
    parity::device().map(|device| Gpu::with(device, &Source::kernels()))
}

/// Three blocks: two fall onto each other and a plate.
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

/// A small hopper with everything in it: 12 fillets, all contacts, belt, gate, shutter.
fn hopper(opening_m: f64) -> Scenario {
    let document = json!({
        "experiment": "hopper",
        "product": {"count": 12, "subparticle_radius_m": 0.009},
        "equipment": {
            "hopper_width_m": 0.15, "hopper_length_m": 0.2, "side_walls": "frictionless", "gate_opening_m": opening_m,
        },
        "numerics": {"timestep_s": "auto", "duration_s": 0.6},
    });
    scenario::from_value(&document).expect("a sound scenario")
}

#[test]
fn blocks_fall_alike() {
    let Some(gpu) = gpu() else { return };
    let mut both = Both::new(&gpu, &blocks());
    both.stay_the_same(20, 1);
    both.stay_the_same(3000, 100);
}

#[test]
fn every_law_gives_the_same_bits() {
    let Some(gpu) = gpu() else { return };
    for form in [Form::Corotated, Form::AsPublished, Form::FiniteExtension] {
        for (gamma, mu, between_bonded) in [(0.0, 0.3, true), (0.055, 0.0, false), (0.055, 0.6, true)] {
            let mut scene = blocks();
            scene.laws.bond = BondLaw { form, ..bonds() };
            scene.laws.tissue = law(false, 0.3, mu, gamma);
            scene.laws.equipment = law(true, 0.3, mu, gamma);
            scene.laws.contact_between_bonded = between_bonded;
            Both::new(&gpu, &scene).stay_the_same(1000, 250);
        }
    }
}

#[test]
fn bonds_break_alike() {
    let Some(gpu) = gpu() else { return };
    let mut scene = blocks();
    scene.laws.bond = BondLaw { normal_strength: 0.02, shear_strength: 0.02, ..bonds() };
    let mut both = Both::new(&gpu, &scene);
    both.stay_the_same(1500, 50);
    let broken = gpu.state(&mut both.gpu_run).bonds_broken;
    assert!((10..300).contains(&broken), "{broken} bonds broken");
}

#[test]
fn what_is_held_and_what_moves_is_alike() {
    let Some(gpu) = gpu() else { return };
    let mut scene = blocks();
    scene.held = (0..8).collect();
    scene.bodies[1].orientation = DQuat::from_rotation_x(0.4) * DQuat::from_rotation_y(0.7);
    let pivot = DVec3::new(0.0, 0.0, -0.002);
    let lifts = Motion::Moving { velocity: DVec3::new(0.05, 0.0, 0.1), pivot, spin: DVec3::new(0.3, 1.5, -0.2) };
    scene.surfaces = vec![
        plate(SurfaceKind::Equipment).moving(lifts),
        plate(SurfaceKind::Belt).moving(Motion::Belt { velocity: DVec3::X * 0.25 }),
        plate(SurfaceKind::Frictionless).until_start(),
    ];
    let mut both = Both::new(&gpu, &scene);
    both.stay_the_same(600, 60);
    both.plain.start(&mut both.plain_run);
    both.gpu.start(&mut both.gpu_run);
    both.assert_same();
    both.stay_the_same(1200, 60);
}

#[test]
fn a_hopper_fills_and_discharges_alike() {
    let Some(gpu) = gpu() else { return };
    let mut both = Both::new(&gpu, &prepare(&hopper(0.06)).scene);
    both.stay_the_same(600, 50);
    both.plain.start(&mut both.plain_run);
    both.gpu.start(&mut both.gpu_run);
    both.stay_the_same(600, 50);
    let leaves: Vec<u32> = {
        let state = gpu.state(&mut both.gpu_run);
        let of = |i: &usize| [2, 7].contains(&state.bodies[*i]);
        (0..state.serials.len()).filter(of).map(|i| state.serials[i]).collect()
    };
    both.plain.remove(&mut both.plain_run, &leaves);
    both.gpu.remove(&mut both.gpu_run, &leaves);
    both.assert_same();
    both.stay_the_same(300, 50);
}

#[test]
fn a_batch_gives_the_bits_of_each_alone() {
    let Some(gpu) = gpu() else { return };
    let scenes: Vec<Scene> = [0.03, 0.045, 0.06].map(|opening| prepare(&hopper(opening)).scene).to_vec();
    let lengths = [700, 350, 520];
    let mut runs: Vec<_> = scenes.iter().map(|scene| gpu.prepare(scene)).collect();
    let mut batch: Vec<_> = runs.iter_mut().zip(lengths).collect();
    let together = gpu.advance(&mut batch);
    for ((scene, run), (steps, advance)) in scenes.iter().zip(&mut runs).zip(lengths.iter().zip(&together)) {
        let cpu = Cpu::plain(1);
        let mut alone = cpu.prepare(scene);
        assert_eq!(*advance, cpu.advance(&mut [(&mut alone, *steps)])[0]);
        assert_eq!(difference(cpu.state(&mut alone), gpu.state(run)), None);
    }
}

#[test]
fn what_diverges_stops_at_the_same_step_for_the_same_reason() {
    let Some(gpu) = gpu() else { return };
    let mut fast = blocks();
    fast.speed_limit_m_s = 2.01;
    let mut stiff = blocks();
    stiff.laws.bond = BondLaw { form: Form::AsPublished, k_n: 5e4, k_t: 5e2, ..bonds() };
    for scene in [fast, stiff] {
        let mut both = Both::new(&gpu, &scene);
        let [plain, other] = both.advance(3000);
        assert_eq!(plain, other);
        assert!(plain.fault.is_some() && plain.steps < 3000, "{plain:?}");
        both.assert_same();
        assert_eq!(both.advance(10)[1].steps, 0);
    }
}
