//! Whole scenes on the GPU are bit-equal to the plain path.

mod common;
#[path = "common/cut.rs"]
mod cut;
#[path = "common/parity.rs"]
mod parity;
#[path = "common/stl.rs"]
mod stl;

use std::f64::consts::TAU;

use common::{at, block, bonds, law, plate, prepare, scene};
use cut::{cap, cut_plate, pipe, surface, tilt, tilted_plate};
use glam::{DQuat, DVec3};
use parity::{Both, difference};
use roost_solver::cpu::Cpu;
use roost_solver::engine::Backend;
use roost_solver::engine::scene::{Placement, Scene};
use roost_solver::equipment::{Motion, Surface, SurfaceKind};
use roost_solver::experiments::simulate;
use roost_solver::gpu::Gpu;
use roost_solver::gpu::layout::Touch;
use roost_solver::gpu::source::Source;
use roost_solver::mesh::Meshes;
use roost_solver::physics::bond::{BondLaw, Form};
use roost_solver::result::RunResult;
use roost_solver::scenario::{self, Scenario};
use roost_solver::{Flow, Progress};
use serde_json::json;

fn gpu() -> Option<Gpu> {
    parity::device().map(|device| Gpu::with(device, &Source::kernels()).expect("kernels that compile"))
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
    scene.laws.belt = law(true, 0.1, 0.3, 0.0);
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
    let lifts =
        Motion::Moving { velocity: DVec3::new(0.05, 0.0, 0.1), pivot, spin: DVec3::new(0.3, 1.5, -0.2) };
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
    // Eight hoppers with gates from 3 to 6.5 cm, each for another number of steps, half of them on the move.
    let scenes: Vec<Scene> = (0..8).map(|k| prepare(&hopper(0.03 + 0.005 * f64::from(k))).scene).collect();
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
fn what_does_not_fit_in_one_batch_is_advanced_in_several() {
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
fn a_run_that_ends_within_a_chunk_keeps_what_touches_its_moving_surfaces() {
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
        let felt = gpu.surface_forces(&mut both[0].gpu_run)[0].length();
        assert!(felt > 0.0, "nothing touches it");
    }
}

#[test]
fn a_run_too_large_for_the_device_fails_alone_and_in_words() {
    let Some(device) = parity::device() else { return };
    // Two runs of three blocks are one too many; five blocks are too many for one.
    let gpu = Gpu::with(device.limited(60_000), &Source::kernels()).expect("kernels that compile");
    let mut large = blocks();
    large.bodies.extend([0.5, 0.6].map(|z| at(DVec3::Z * z, DVec3::ZERO)));
    let mut large = gpu.prepare(&large);
    let fails = std::panic::AssertUnwindSafe(|| gpu.advance(&mut [(&mut large, 10)]));
    let words =
        *std::panic::catch_unwind(fails).expect_err("it does not fit").downcast::<String>().expect("words");
    assert!(words.contains("the device allows 60000"), "{words}");
    let mut both: Vec<Both<'_>> = (0..2).map(|_| Both::new(&gpu, &blocks())).collect();
    let mut batch: Vec<_> = both.iter_mut().map(|both| (&mut both.gpu_run, 300)).collect();
    gpu.advance(&mut batch);
    for both in &mut both {
        both.plain.advance(&mut [(&mut both.plain_run, 300)]);
        both.assert_same();
    }
}

#[test]
fn a_batch_whose_rows_outgrow_the_device_is_cut() {
    let Some(device) = parity::device() else { return };
    let scene = onto(surface(pipe(0.05, 300, 0.0, TAU / 300.0)), |x| x * 0.5 - DVec3::Z * 0.03);
    let first = Gpu::with(device.clone(), &Source::kernels()).expect("kernels that compile");
    let mut alone = first.prepare(&scene);
    first.advance(&mut [(&mut alone, 300)]);
    let slots = u64::from(alone.wall_slots());
    let particles = first.state(&mut alone).particles.len() as u64;
    assert!(slots > 12, "{slots} facets are no more than rows have room for at first");
    // Rows of touches are the largest; at first those of both runs fit.
    let limit = particles * slots * size_of::<Touch>() as u64 * 3 / 2;
    let gpu = Gpu::with(device.limited(limit), &Source::kernels()).expect("kernels that compile");
    let mut runs: Vec<_> = (0..2).map(|_| gpu.prepare(&scene)).collect();
    let mut batch: Vec<_> = runs.iter_mut().map(|run| (run, 300)).collect();
    gpu.advance(&mut batch);
    for run in &mut runs {
        assert_eq!(difference(first.state(&mut alone), gpu.state(run)), None);
    }
}

#[test]
fn kernels_that_the_driver_refuses_are_an_error_in_words() {
    let Some(device) = parity::device() else { return };
    let source = Source::kernels().with("step", "moved[i] = me;", "moved[i] = nobody;");
    let error = Gpu::with(device, &source).expect_err("there is no such name").to_string();
    assert!(error.contains("refuses") && error.contains("nobody"), "{error}");
}

#[test]
fn what_diverges_stops_at_the_same_step_for_the_same_reason() {
    let Some(gpu) = gpu() else { return };
    let mut fast = blocks();
    fast.speed_limit_m_s = 2.01;
    let mut stiff = blocks();
    stiff.timestep_s = 3e-3;
    for scene in [fast, stiff] {
        let mut both = Both::new(&gpu, &scene);
        let [plain, other] = both.advance(3000);
        assert_eq!(plain, other);
        assert!(plain.fault.is_some() && plain.steps < 3000, "{plain:?}");
        both.assert_same();
        assert_eq!(both.advance(10)[1].steps, 0);
    }
}

/// Blocks and single spheres that fall onto a surface, turning it after a while.
fn onto(surface: Surface, place: impl Fn(DVec3) -> DVec3) -> Scene {
    let mut scene = blocks();
    scene.kinds.push(block([1, 1, 1]));
    for (k, body) in scene.bodies.iter_mut().enumerate() {
        body.position = place(DVec3::new(0.04 * k as f64 - 0.04, 0.01, 0.022));
        body.orientation = DQuat::from_rotation_y(0.3 * k as f64);
    }
    for k in 0..20 {
        let x = DVec3::new(0.009 * f64::from(k % 5) - 0.017, 0.009 * f64::from(k / 5) - 0.03, 0.05);
        scene.bodies.push(Placement { kind: 1, ..at(place(x), DVec3::NEG_Z) });
    }
    scene.laws.equipment = law(true, 0.3, 0.5, 0.055);
    scene.surfaces = vec![surface];
    scene
}

#[test]
fn surfaces_of_many_facets_are_felt_alike() {
    let Some(gpu) = gpu() else { return };
    let (turn, away) = tilt();
    let turning =
        |pivot| Motion::Moving { velocity: DVec3::Z * 0.02, pivot, spin: DVec3::new(0.4, 2.0, 0.1) };
    let flat = |x: DVec3| x;
    let scenes = [
        // One facet of a thousand triangles, slivers among them; facets that are nearly one.
        onto(surface(cut_plate()), flat),
        onto(surface(tilted_plate()), |x| turn * x + away),
        // Above a dome, and within a pipe of facets narrower than a sub-particle, which turn.
        onto(surface(cap(0.1, 16)).moving(turning(DVec3::ZERO)), |x| x + DVec3::Z * 0.1),
        onto(surface(pipe(0.09, 120, 0.0, TAU / 120.0)).moving(turning(DVec3::X * 0.01)), |x| {
            x * 0.5 - DVec3::Z * 0.07
        }),
    ];
    for scene in scenes {
        let mut both = Both::new(&gpu, &scene);
        both.stay_the_same(200, 50);
        both.plain.start(&mut both.plain_run);
        both.gpu.start(&mut both.gpu_run);
        both.stay_the_same(400, 50);
        let felt = both.gpu.surface_forces(&mut both.gpu_run)[0].length();
        let wall_slots = both.gpu_run.wall_slots();
        println!("{felt:.3} N, {wall_slots} facets");
        assert!(felt > 0.1, "nothing lies on it: {felt} N");
    }
}

#[test]
fn a_periodic_domain_is_alike() {
    let Some(gpu) = gpu() else { return };
    // The blocks touch their own images across the seam; the second period is two cells of the grid wide.
    for period in [0.034, 0.0311] {
        let mut scene = blocks();
        scene.bodies.iter_mut().for_each(|body| body.position.y += 0.014);
        (scene.low.y, scene.high.y, scene.periodic_y) = (-period / 2.0, period / 2.0, true);
        Both::new(&gpu, &scene).stay_the_same(1000, 100);
    }
}

#[test]
fn lists_that_no_longer_hold_are_built_anew_in_time() {
    let Some(gpu) = gpu() else { return };
    // At 8 m/s half the skin is crossed in two steps, and what falls is slow at first and fast in the end.
    let mut scene = blocks();
    scene.bodies.push(at(DVec3::new(-0.05, 0.0, 0.3), DVec3::new(1.0, 0.0, -8.0)));
    Both::new(&gpu, &scene).stay_the_same(1500, 500);
}

/// Small runs of every experiment.
fn experiments() -> Vec<Scenario> {
    let numerics = json!({"timestep_s": "auto", "duration_s": 0.1});
    let documents = [
        json!({"experiment": "drop", "product": {"count": 2, "subparticle_radius_m": 0.009}, "numerics": numerics}),
        json!({
            "experiment": "scene", "product": {"subparticle_radius_m": 0.009}, "numerics": numerics,
            "scene": {
                "bodies": [{"position_m": [0, 0, 0.03]}, {"shape": 3, "position_m": [0.05, 0.02, 0.09]}],
                "surfaces": [{"name": "plate", "plate_m": [[-0.5, -0.5, 0], [1, 0, 0], [0, 1, 0]]}],
            },
        }),
        json!({
            "experiment": "compress", "compress": {"lattice": [4, 4, 3], "strain_rate_1_s": 0.5},
            "numerics": {"timestep_s": "auto", "output_interval_s": 0.005},
        }),
        json!({
            "experiment": "slide", "product": {"subparticle_radius_m": 0.01}, "numerics": {"timestep_s": "auto"},
            "slide": {"tilt_rate_deg_s": 30.0, "max_tilt_deg": 15.0},
        }),
        json!({
            "experiment": "bend", "product": {"subparticle_radius_m": 0.01}, "bend": {"support": "clamped"},
            "numerics": numerics,
        }),
        json!({
            "experiment": "hopper", "product": {"count": 6, "subparticle_radius_m": 0.01},
            "equipment": {"hopper_width_m": 0.12, "hopper_length_m": 0.2, "side_walls": "periodic"},
            "numerics": {"timestep_s": "auto", "duration_s": 0.3, "rest_speed_m_s": 0.1},
        }),
    ];
    documents.iter().map(|document| scenario::from_value(document).expect("a sound scenario")).collect()
}

#[test]
fn every_experiment_has_the_result_of_the_plain_path() {
    let Some(gpu) = gpu() else { return };
    for scenario in experiments() {
        let mut keep_on = |_: &Progress| Flow::Continue;
        let plain = simulate(&scenario, &Meshes::default(), &Cpu::plain(1), &mut keep_on);
        let other = simulate(&scenario, &Meshes::default(), &gpu, &mut keep_on);
        let name = json!(scenario)["experiment"].to_string();
        // `==` on floats would take -0 for 0; the text has every digit and the sign.
        let text = |result: &RunResult| json!([result.responses, result.series, result.curves]).to_string();
        assert_eq!(text(&plain), text(&other), "{name}");
        assert_eq!((plain.end_reason, plain.instability), (other.end_reason, other.instability), "{name}");
        assert_eq!(plain.performance.steps, other.performance.steps);
        assert_eq!(other.solver.backend, "gpu");
        assert!(plain.performance.steps > 100, "{name}: {} steps", plain.performance.steps);
        println!("{name}: {} steps, {:?}", plain.performance.steps, plain.end_reason);
    }
}

#[test]
fn an_error_in_any_stage_is_found_in_a_whole_scene() {
    let Some(device) = parity::device() else { return };
    // File, what stands there, what is planted.
    let planted = [
        ("grid", "vec3(0x80000000u)) / scene.cell", "vec3(0x80000000u)) / (scene.cell / 2u)"),
        ("lists", "<= scene.reach * scene.reach", "<= 0.7 * scene.reach * scene.reach"),
        ("lists", "new_pairs[base + k] = pairs[at];", "new_pairs[base + k].state = pairs[at].state;"),
        ("lists", "atomicMax(&reports[run].walls, wall_count);", ""),
        ("forces", "me.mass * other.mass / (me.mass + other.mass)", "me.mass * 0.500001"),
        ("forces", "select(0u, 1u, i < j)", "1u"),
        ("walls", "return k;", "return NONE;"),
        ("walls", "pose.velocity + cross3", "cross3"),
        ("step", "if me.held == 0u {", "if true {"),
        ("step", "atomicOr(&reports[run].stale, 1u);", ""),
        ("step", "own[i].remainder = remainder;", ""),
    ];
    let mut scene = onto(surface(pipe(0.05, 300, 0.0, TAU / 300.0)), |x| x * 0.5 - DVec3::Z * 0.03);
    scene.surfaces.push(
        Surface::parallelogram(
            "belt",
            SurfaceKind::Belt,
            DVec3::new(-0.1, -0.1, -0.03),
            DVec3::X * 0.2,
            DVec3::Y * 0.2,
        )
        .moving(Motion::Belt { velocity: DVec3::X }),
    );
    scene.bodies.push(at(DVec3::new(0.0, 0.01, 0.02), DVec3::NEG_Z * 8.0));
    scene.held = (0..8).collect();
    scene.laws.belt = law(true, 0.3, 0.5, 0.0);
    scene.laws.bond = BondLaw { normal_strength: 0.05, ..bonds() };
    let stays = |source: &Source| {
        let gpu = Gpu::with(device.clone(), source).expect("kernels that compile");
        let mut both = Both::new(&gpu, &scene);
        both.plain.start(&mut both.plain_run);
        both.gpu.start(&mut both.gpu_run);
        (0..8).all(|_| {
            let [plain, other] = both.advance(100);
            plain == other
                && difference(both.plain.state(&mut both.plain_run), gpu.state(&mut both.gpu_run)).is_none()
        })
    };
    assert!(stays(&Source::kernels()), "without an error");
    for (file, text, error) in planted {
        assert!(!stays(&Source::kernels().with(file, text, error)), "{file}: `{error}` was not found");
    }
}
