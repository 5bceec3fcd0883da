//! Batches on the GPU: each run has the bits that it has alone, whatever else is in the batch and wherever it is cut.

mod common;
#[path = "common/cut.rs"]
mod cut;
#[path = "common/parity.rs"]
mod parity;
#[path = "common/stl.rs"]
mod stl;

use std::f64::consts::TAU;
use std::panic::{AssertUnwindSafe, catch_unwind};

use common::{RADIUS, at, block, blocks, onto, plate, scene, scene_of, small_hopper, with_moments};
use cut::{pipe, surface};
use glam::DVec3;
use parity::{Both, difference, gpu};
use roost_solver::cpu::Cpu;
use roost_solver::engine::Backend;
use roost_solver::engine::scene::{Placement, Scene};
use roost_solver::equipment::{Motion, SurfaceKind};
use roost_solver::gpu::layout::NearestPoint;
use roost_solver::gpu::source::Source;
use roost_solver::gpu::{Device, Gpu, catch_out_of_memory, typical_run_bytes};

#[test]
fn batch_gives_the_same_bits_as_single_runs() {
    let Some(gpu) = gpu() else { return };
    // Eight hoppers with gates from 3 to 6.5 cm, each for another number of steps, half of them on the move.
    let scenes: Vec<Scene> = (0..8).map(|k| scene_of(&small_hopper(0.03 + 0.005 * f64::from(k)))).collect();
    let lengths: [u64; 8] = [700, 350, 520, 90, 256, 257, 1, 600];
    let mut runs: Vec<_> = scenes.iter().map(|scene| gpu.prepare(scene)).collect();
    runs.iter_mut().step_by(2).for_each(|run| gpu.start(run));
    let mut batch: Vec<_> = runs.iter_mut().zip(lengths).collect();
    let together = gpu.advance(&mut batch);
    for (k, (scene, run)) in scenes.iter().zip(&mut runs).enumerate() {
        let cpu = Cpu::plain(1);
        let mut alone = cpu.prepare(scene);
        if k % 2 == 0 {
            cpu.start(&mut alone);
        }
        assert_eq!(together[k], cpu.advance(&mut [(&mut alone, lengths[k])])[0], "run {k}");
        assert_eq!(difference(cpu.state(&mut alone), gpu.state(run)), None, "run {k}");
    }
}

#[test]
fn runs_that_exceed_one_batch_are_advanced_in_several() {
    let Some(gpu) = gpu() else { return };
    // Single spheres in flight: three times 150,000 are more than lavapipe takes in one buffer.
    let place = |k: u32| DVec3::new(f64::from(k % 60), f64::from(k / 60 % 60), f64::from(k / 3600)) * 0.012;
    let speed = |k: u32| DVec3::new(f64::from(k % 7), f64::from(k % 5), f64::from(k % 3)) * 0.1;
    let bodies = (0..150_000).map(|k| at(place(k), speed(k))).collect();
    let mut scene = scene(block([1, 1, 1]), bodies, 1e-4);
    (scene.low, scene.high) = (DVec3::splat(-0.1), DVec3::splat(1.0));
    let mut runs: Vec<_> = (0..3).map(|_| gpu.prepare(&scene)).collect();
    let mut batch: Vec<_> = runs.iter_mut().zip([3, 2, 4]).collect();
    let steps: Vec<u64> = gpu.advance(&mut batch).iter().map(|done| done.steps).collect();
    assert_eq!(steps, [3, 2, 4]);
    let cpu = Cpu::plain(1);
    for (run, steps) in runs.iter_mut().zip(steps) {
        let mut alone = cpu.prepare(&scene);
        cpu.advance(&mut [(&mut alone, steps)]);
        assert_eq!(difference(cpu.state(&mut alone), gpu.state(run)), None);
    }
}

#[test]
fn run_with_too_many_neighbours_ends_alone_with_the_reason() {
    let Some(gpu) = gpu() else { return };
    // 150 spheres in a cube of half a radius.
    let place = |k: u32| DVec3::new(f64::from(k % 6), f64::from(k / 6 % 5), f64::from(k / 30)) * 0.1 * RADIUS;
    let crowd = (0..150).map(|k| at(place(k), DVec3::ZERO)).collect();
    let scenes = [scene(block([1, 1, 1]), crowd, 1e-5), blocks()];
    let mut runs = scenes.each_ref().map(|scene| gpu.prepare(scene));
    let done = gpu.advance(&mut runs.iter_mut().map(|run| (run, 100)).collect::<Vec<_>>());
    let reason = done[0].fault.as_deref().unwrap_or_default();
    let limit =
        "a sub-particle has more than 128 neighbours, the limit of the GPU backend; use the CPU backend";
    assert_eq!(reason, limit);
    assert_eq!((done[0].steps, done[1].steps, &done[1].fault), (0, 100, &None));
    let (cpu, [_, other]) = (Cpu::plain(1), &mut runs);
    let mut alone = cpu.prepare(&scenes[1]);
    cpu.advance(&mut [(&mut alone, 100)]);
    assert_eq!(difference(cpu.state(&mut alone), gpu.state(other)), None);
}

#[test]
fn run_that_ends_within_a_chunk_keeps_contacts_with_moving_surfaces() {
    let Some(gpu) = gpu() else { return };
    let moving = |bodies: Option<Placement>, velocity| {
        let lifts = Motion::Moving { velocity, pivot: DVec3::ZERO, spin: DVec3::X * 0.3 };
        let mut scene = blocks();
        scene.surfaces = vec![plate(SurfaceKind::Equipment).moving(lifts)];
        scene.bodies = bodies.map_or(scene.bodies, |body| vec![body]);
        scene
    };
    // The plate of the second is soon far from where that of the first, which ends before it, is.
    let scenes = [
        moving(None, DVec3::new(0.05, 0.0, 0.1)),
        moving(Some(at(DVec3::Z * 0.5, DVec3::ZERO)), DVec3::NEG_Z * 5.0),
    ];
    let mut both: Vec<Both<'_>> = scenes.iter().map(|scene| Both::new(&gpu, scene)).collect();
    for both in &mut both {
        both.plain.start(&mut both.plain_run);
        both.gpu.start(&mut both.gpu_run);
    }
    for lengths in [[700, 1100], [20, 300], [300, 20]] {
        let mut batch: Vec<_> = both.iter_mut().map(|both| &mut both.gpu_run).zip(lengths).collect();
        gpu.advance(&mut batch);
        for (both, steps) in both.iter_mut().zip(lengths) {
            both.plain.advance(&mut [(&mut both.plain_run, steps)]);
            both.assert_same();
        }
        let force = gpu.surface_forces(&mut both[0].gpu_run)[0].length();
        assert!(force > 0.0, "nothing touches it");
    }
}

fn open(device: Device) -> Gpu {
    Gpu::with(device, &Source::kernels()).expect("kernels that compile")
}

/// The message of a failed allocation.
fn words<T: std::fmt::Debug>(run: impl FnOnce() -> T) -> String {
    catch_out_of_memory(run).expect_err("there is room").to_string()
}

#[test]
fn run_too_large_for_the_device_fails_alone_with_the_reason() {
    let Some(device) = parity::device() else { return };
    // Two runs of three blocks are one too many; five blocks are too many for one.
    let gpu = open(device.limited(60_000));
    let mut large = blocks();
    large.bodies.extend([0.5, 0.6].map(|z| at(DVec3::Z * z, DVec3::ZERO)));
    let words = words(|| gpu.prepare(&large));
    assert!(words.contains("the device allows 60000"), "{words}");
    let mut both: Vec<Both<'_>> = (0..2).map(|_| Both::new(&gpu, &blocks())).collect();
    let mut batch: Vec<_> = both.iter_mut().map(|both| (&mut both.gpu_run, 300)).collect();
    gpu.advance(&mut batch);
    for both in &mut both {
        both.plain.advance(&mut [(&mut both.plain_run, 300)]);
        both.assert_same();
    }
}

/// Steps in which what is near each other hardly changes.
const STEPS: u64 = 120;

#[test]
fn batch_size_is_limited_by_device_memory() {
    let Some(device) = parity::device() else { return };
    let scenes: Vec<Scene> = [0.03, 0.04, 0.05, 0.06].map(|gate| scene_of(&small_hopper(gate))).into();
    let first = open(device.clone());
    let usage = |scene: &Scene| {
        let mut run = first.prepare(scene);
        let own = first.used_bytes();
        first.advance(&mut [(&mut run, STEPS)]);
        let advancing = first.used_bytes() - own;
        let (particles, triangles) = (first.state(&mut run).particles.len() as u64, 20);
        let usual = typical_run_bytes(particles, triangles, scene.laws.moment.is_some());
        assert!(
            (own + advancing..2 * (own + advancing)).contains(&usual),
            "{usual}, not {own} + {advancing}"
        );
        (own, advancing, usual)
    };
    let (own, advancing, usual) = usage(&scenes[0]);
    let (more_own, more_advancing, more) = usage(&with_moments(scenes[0].clone(), 1.0));
    let ratio = (more - usual) as f64 / (more_own + more_advancing - own - advancing) as f64;
    assert!((1.0..2.0).contains(&ratio), "memory of moments, {ratio} of what they take");
    // All at once; two and two; one after the other.
    for (at_once, room) in [(4, 4.0), (2, 2.5), (1, 1.2)] {
        let gpu = open(device.clone().with_memory(4 * own + (room * advancing as f64) as u64));
        let mut both: Vec<Both<'_>> = scenes.iter().map(|scene| Both::new(&gpu, scene)).collect();
        let mut batch: Vec<_> = both.iter_mut().map(|both| (&mut both.gpu_run, STEPS)).collect();
        gpu.advance(&mut batch);
        assert_eq!(gpu.refusals(), 0, "more was wanted than there is");
        let batch = (gpu.used_bytes() - 4 * own) as f64 / advancing as f64;
        assert_eq!(batch.round() as u32, at_once, "{batch}");
        for both in &mut both {
            both.plain.advance(&mut [(&mut both.plain_run, STEPS)]);
            both.assert_same();
        }
    }
    // A run that does not fit by itself is refused, and so is a fifth; the others never hear of it.
    let gpu = open(device.with_memory(4 * own + advancing * 9 / 10));
    let mut runs: Vec<_> = scenes.iter().map(|scene| gpu.prepare(scene)).collect();
    let words_of_run = words(|| gpu.advance(&mut [(&mut runs[0], STEPS)]));
    assert!(words_of_run.contains("bytes of its memory are needed"), "{words_of_run}");
    runs.remove(0);
    assert_eq!(gpu.used_bytes(), 3 * own, "what was refused takes nothing");
    let done = gpu.advance(&mut [(&mut runs[0], STEPS)]);
    assert_eq!(done[0].steps, STEPS);
    let more: Vec<_> = (0..2).map(|_| gpu.prepare(&scenes[0])).collect();
    assert_eq!(more.len(), 2, "the last batch makes way");
}

#[test]
fn batch_is_split_when_its_rows_exceed_device_memory() {
    let Some(device) = parity::device() else { return };
    let scene = onto(surface(pipe(0.05, 300, 0.0, TAU / 300.0)), |x| x * 0.5 - DVec3::Z * 0.03);
    let first = open(device.clone());
    let mut alone = first.prepare(&scene);
    first.advance(&mut [(&mut alone, 300)]);
    let slots = u64::from(alone.wall_capacity());
    let particles = first.state(&mut alone).particles.len() as u64;
    assert!(slots > 12, "{slots} facets are no more than rows have room for at first");
    // Rows of nearest points are the largest; at first those of both runs fit.
    let limit = particles * slots * size_of::<NearestPoint>() as u64 * 3 / 2;
    let gpu = open(device.limited(limit));
    let mut runs: Vec<_> = (0..2).map(|_| gpu.prepare(&scene)).collect();
    let mut batch: Vec<_> = runs.iter_mut().map(|run| (run, 300)).collect();
    gpu.advance(&mut batch);
    for run in &mut runs {
        assert_eq!(difference(first.state(&mut alone), gpu.state(run)), None);
    }
}

#[test]
fn run_whose_rows_exceed_device_memory_fails_and_others_continue() {
    let Some(device) = parity::device() else { return };
    // Within a pipe of narrow facets rows become far longer than at first; of the blocks they do not.
    let scene = onto(surface(pipe(0.05, 1200, 0.0, TAU / 1200.0)), |x| x * 0.5 - DVec3::Z * 0.03);
    let first = open(device.clone());
    let mut other = Both::new(&first, &blocks());
    let mut grows = first.prepare(&scene);
    let own = first.used_bytes();
    first.advance(&mut [(&mut other.gpu_run, 1), (&mut grows, 1)]);
    let at_first = first.used_bytes();
    first.advance(&mut [(&mut grows, 300)]);
    let (grown, slots) = (first.used_bytes(), grows.wall_capacity());
    println!("{own} bytes and {} to advance at first, {grown} with rows of {slots} facets", at_first - own);
    assert!(slots > 32, "{slots} facets are not many more than rows have room for at first");
    drop(grows);
    first.advance(&mut [(&mut other.gpu_run, 1)]);
    // Where its longer rows have room and what advances it has not; where not even they have.
    for memory in [grown - 1000, at_first + 1000] {
        let gpu = open(device.clone().with_memory(memory));
        let mut other = Both::new(&gpu, &blocks());
        let mut grows = gpu.prepare(&scene);
        let words = words(|| gpu.advance(&mut [(&mut grows, 300), (&mut other.gpu_run, 300)]));
        println!("{words}");
        assert!(words.contains("bytes of its memory are needed"), "{words}");
        other.plain.advance(&mut [(&mut other.plain_run, 300)]);
        other.assert_same();
        other.assert_equal_for(300, 100);
        assert!(!gpu.has_failed());
    }
}

#[test]
fn lost_device_fails_every_run_with_the_reason() {
    let Some(device) = parity::device() else { return };
    let gpu = open(device.clone());
    let mut runs: Vec<_> = (0..3).map(|_| gpu.prepare(&blocks())).collect();
    let [one, two, later] = &mut runs[..] else { panic!("three") };
    gpu.advance(&mut [(&mut *one, 10), (&mut *two, 10), (&mut *later, 10)]);
    device.wgpu().0.destroy();
    let fails = |batch: &mut [_]| {
        let panic = catch_unwind(AssertUnwindSafe(|| gpu.advance(batch))).expect_err("there is no device");
        panic.downcast_ref::<String>().cloned().unwrap_or_default()
    };
    let reason = fails(&mut [(one, 10), (two, 10)]);
    assert!(reason.contains("the GPU failed"), "{reason}");
    let reason = fails(&mut [(later, 10)]);
    assert!(reason.contains("the GPU has failed before"), "{reason}");
}
