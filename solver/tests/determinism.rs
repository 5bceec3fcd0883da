//! The same scenario and seed give the same bits: on one thread and on several, in one go and in pieces, in a batch,
//! and whoever else has left the scene.

mod common;

use common::{Bench, assert_same, at, blocks, checked, law, small_hopper};
use glam::{DQuat, DVec3};
use roost_solver::cpu::Cpu;
use roost_solver::engine::Backend;
use roost_solver::engine::scene::Scene;
use roost_solver::scenario::Scenario;
use roost_solver::{CpuOptions, Flow, Progress, simulate};

fn hopper() -> Scenario {
    small_hopper(0.06)
}

#[test]
fn a_run_gives_the_same_bits_on_one_two_and_three_threads() {
    let run =
        |threads| simulate(&checked(&hopper()), CpuOptions { threads }, &mut |_: &Progress| Flow::Continue);
    let one = run(1);
    assert!(one.response("discharged_kg").is_some_and(|mass| mass > 0.1), "{:?}", one.responses);
    for threads in [2, 3] {
        let other = run(threads);
        assert_eq!(other.solver.threads, threads);
        assert_eq!(one.responses, other.responses);
        // `==` on floats would take -0 for 0; the text has every digit and the sign.
        let text = |result: &roost_solver::result::RunResult| serde_json::to_string(&result.series).unwrap();
        assert_eq!(text(&one), text(&other));
    }
}

#[test]
fn another_seed_gives_another_run() {
    let run = |seed| {
        simulate(&checked(&Scenario { seed, ..hopper() }), CpuOptions { threads: 2 }, &mut |_: &Progress| {
            Flow::Continue
        })
    };
    assert_ne!(run(1).series, run(2).series);
}

/// The serials of the sub-particles of one of the blocks.
fn block_of(body: u32) -> Vec<u32> {
    (48 * body..48 * body + 48).collect()
}

#[test]
fn splitting_and_batching_of_steps_change_no_bit() {
    let scene = blocks();
    let mut whole = Bench::new(&scene);
    whole.steps(2000);
    let mut pieces = Bench::new(&scene);
    for steps in [1, 7, 500, 1492] {
        pieces.steps(steps);
    }
    assert_same(whole.state(), pieces.state(), "pieces");

    let cpu = common::backend(2);
    let (mut a, mut b) = (cpu.prepare(&scene), cpu.prepare(&scene));
    cpu.advance(&mut [(&mut a, 2000), (&mut b, 1000)]);
    cpu.advance(&mut [(&mut b, 1000)]);
    assert_same(whole.state(), cpu.state(&mut a), "first of a batch");
    assert_same(whole.state(), cpu.state(&mut b), "second of a batch");
}

#[test]
fn state_digests_match_this_solver_revision() {
    // Every bit of every sub-particle after so many steps. If this changes, results have changed: raise
    // SOLVER_REVISION, write down why in the changelog, and only then renew the digest.
    let digest_on = |cpu: Cpu, scene: &Scene, steps: u64| {
        let mut bench = Bench::with(cpu, scene);
        assert_eq!(bench.steps(steps), None);
        let words = bench.state().particles.iter().flat_map(|p| {
            let bits = |v: glam::Vec3| v.to_array().map(f32::to_bits);
            [p.position.to_array().map(|x| x as u32), bits(p.velocity), bits(p.spin)].concat()
        });
        let bytes: Vec<u8> = words.flat_map(u32::to_le_bytes).collect();
        blake3::hash(&bytes).to_hex()
    };
    assert_eq!(roost_solver::SOLVER_REVISION, 17);
    // Steps so long that dashpots are held back.
    let mut long = blocks();
    long.laws.tissue = law(false, 1e-4, 0.3, 0.055);
    long.timestep_s = 4e-4;
    let found = [
        ("plain", digest_on(Cpu::plain(1), &blocks(), 2000)),
        ("fast", digest_on(Cpu::new(1), &blocks(), 2000)),
        ("plain, long steps", digest_on(Cpu::plain(1), &long, 500)),
        ("fast, long steps", digest_on(Cpu::new(1), &long, 500)),
        ("single spheres", digest_on(Cpu::new(1), &spheres(), 600)),
        ("single spheres, two threads", digest_on(Cpu::new(2), &spheres(), 600)),
    ];
    let expected = [
        ("plain", "3d0d5a1047f97ac9fc3b13604bfe27c241774aeb341425bff5fcb200afe1b66e"),
        ("fast", "33fc5d1e18f498a8aa190d7fb957a39f3b46cf6c8096600e28ce0f6a6223ef9d"),
        ("plain, long steps", "0756b25cd823b0a6f5ca7ffbce9b0a61a23d10c4994a890cfaf485e1be8940f1"),
        ("fast, long steps", "3cd1da36db017686f3bd64ccfe88fab8fbb8b5ac980fb9493d35c6ee1fe826a1"),
        ("single spheres", "aeba903f9edde9159d2069bd335f3524884dd12e1b1eac7105b94dc207015356"),
        ("single spheres, two threads", "aeba903f9edde9159d2069bd335f3524884dd12e1b1eac7105b94dc207015356"),
    ];
    assert_eq!(found.each_ref().map(|(name, digest)| (*name, digest.as_str())), expected);
}

/// Single spheres, pressed together, that fall onto a plate: more than the fast path works on together.
fn spheres() -> Scene {
    let mut scene = blocks();
    scene.kinds = vec![common::block([1, 1, 1])];
    // Off the lattice, so that no sum is exact.
    let place = |k: i32| {
        let cell = DVec3::new(f64::from(k % 8), f64::from(k / 8 % 8), f64::from(k / 64) + 0.6);
        cell * 0.0078 + DVec3::new(f64::from(k * 37 % 17), f64::from(k * 53 % 19), 0.0) * 3e-5
    };
    scene.bodies = (0..600).map(|k| at(place(k), DVec3::NEG_Z)).collect();
    scene
}

#[test]
fn neighbour_list_rebuilds_caused_by_a_distant_body_change_no_bit() {
    // At 8 m/s it has the neighbour lists built anew every other step: what touches remembers all the same.
    let calm = blocks();
    let mut alone = Bench::new(&calm);
    let mut hurried = blocks();
    hurried.bodies.push(at(DVec3::new(-0.4, -0.4, 0.1), DVec3::Z * 8.0));
    let mut both = Bench::new(&hurried);
    for bench in [&mut alone, &mut both] {
        assert_eq!(bench.steps(1500), None);
    }
    let mut kept = both.state().clone();
    kept.remove(&block_of(3));
    assert_same(alone.state(), &kept, "beside a stranger");
}

#[test]
fn neighbour_list_rebuilds_in_every_step_change_no_bit() {
    // Tilted blocks that fall onto another: from the edge on, one row after the other comes into reach. That nothing is taken
    // out takes out what was looked up on the plain path; on the fast path, which bodies meet, and `cpu::fast` has a test for the rest.
    for (tilt, speed) in [(0.1, 3.0), (0.3, 2.0), (0.6, 4.0), (0.8, 1.0)] {
        let mut scene = blocks();
        scene.bodies[1].orientation = DQuat::from_rotation_y(tilt);
        scene.bodies[1].position.z += 0.03;
        scene.bodies[1].velocity *= speed;
        scene.bodies[2].orientation = DQuat::from_rotation_x(tilt);
        let (mut kept, mut renewed) = (Bench::new(&scene), Bench::new(&scene));
        for _ in 0..30 {
            kept.steps(50);
            for _ in 0..50 {
                renewed.cpu.remove(&mut renewed.run, &[]);
                renewed.steps(1);
            }
            assert_same(kept.state(), renewed.state(), "renewed");
        }
    }
}

#[test]
fn removing_later_spheres_does_not_change_earlier_ones() {
    // Spheres that are removed change no bit of the others.
    let mut scene = spheres();
    let count = scene.bodies.len() as u32;
    let far = |k: i32| {
        at(DVec3::new(0.02 * f64::from(k % 20) - 0.3, 0.3, 0.5 + 0.02 * f64::from(k / 20)), DVec3::ZERO)
    };
    scene.bodies.extend((0..300).map(far));
    let (mut beside, mut fewer) = (Bench::new(&scene), Bench::new(&scene));
    let strangers: Vec<u32> = (count..count + 300).collect();
    for bench in [&mut beside, &mut fewer] {
        assert_eq!(bench.steps(20), None);
    }
    fewer.cpu.remove(&mut fewer.run, &strangers);
    for bench in [&mut beside, &mut fewer] {
        assert_eq!(bench.steps(300), None);
    }
    let mut kept = beside.state().clone();
    kept.remove(&strangers);
    assert_same(fewer.state(), &kept, "beside strangers");
}

#[test]
fn removing_a_distant_body_does_not_change_the_others() {
    // The last of three bodies, then the first.
    let mut fewer = Bench::new(&blocks());
    for (turned, gone) in [(1, 0), (0, 2)] {
        let mut scene = blocks();
        scene.bodies.rotate_right(turned);
        let mut all = Bench::new(&scene);
        all.steps(2000);
        fewer = Bench::new(&scene);
        fewer.steps(700);
        fewer.cpu.remove(&mut fewer.run, &block_of(gone));
        fewer.steps(1300);
        assert_eq!(fewer.state().particles.len(), 96);
        assert_eq!(fewer.state().serials[95], if gone == 0 { 143 } else { 95 });
        let mut kept = all.state().clone();
        kept.remove(&block_of(gone));
        assert_same(&kept, fewer.state(), "fewer");
        assert!(all.state().max_speed() > 0.0);
    }

    // One that others touch leaves: those behind it keep their memory of each other and of the plate.
    fewer.cpu.remove(&mut fewer.run, &block_of(0));
    assert_eq!(fewer.steps(2000), None);
    assert!(fewer.state().serials.iter().all(|&serial| (48..96).contains(&serial)));
    assert_eq!(fewer.state().bonds_broken, 0);

    // And at last nobody is left.
    let last = fewer.state().serials.clone();
    fewer.cpu.remove(&mut fewer.run, &last);
    assert_eq!(fewer.steps(10), None);
    assert_eq!(fewer.state().particles.len(), 0);
}

#[test]
fn a_cancelled_run_keeps_its_samples_and_has_no_responses() {
    let mut looks = 0;
    let result = simulate(&checked(&hopper()), CpuOptions { threads: 2 }, &mut |progress: &Progress| {
        looks += 1;
        assert!((0.0..=1.0).contains(&progress.fraction));
        if progress.simulated_s > 0.1 { Flow::Cancel } else { Flow::Continue }
    });
    assert_eq!(result.end_reason, roost_solver::result::EndReason::Cancelled);
    assert!(looks >= 5 && result.responses.is_empty());
    assert!(result.series("kinetic_energy").is_some_and(|series| series.values.len() >= 5));
}
