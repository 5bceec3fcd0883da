//! Whole scenes on the GPU are bit-equal to the plain path.

mod common;
#[path = "common/cut.rs"]
mod cut;
#[path = "common/experiments.rs"]
mod experiments;
#[path = "common/parity.rs"]
mod parity;
#[path = "common/resuming.rs"]
mod resuming;
#[path = "common/stl.rs"]
mod stl;

use std::cell::RefCell;
use std::f64::consts::TAU;

use common::{at, blocks, bonds, checked, law, onto, plate, scene_of, small_hopper, with_moments};
use cut::{cap, cut_plate, pipe, surface, tilt, tilted_plate};
use experiments::experiments;
use glam::{DQuat, DVec3};
use parity::{Both, difference, gpu};
use resuming::{RandomSteps, bits, with_kills};
use roost_solver::cpu::Cpu;
use roost_solver::engine::Backend;
use roost_solver::engine::scene::Placement;
use roost_solver::equipment::{Motion, Surface, SurfaceKind};
use roost_solver::gpu::Gpu;
use roost_solver::gpu::source::Source;
use roost_solver::physics::bond::{BondLaw, BondModel};
use roost_solver::result::RunResult;
use roost_solver::simulate_on;
use roost_solver::{Flow, Progress};
use serde_json::json;

#[test]
fn gpu_matches_plain_path_for_falling_blocks() {
    let Some(gpu) = gpu() else { return };
    let mut both = Both::new(&gpu, &blocks());
    both.assert_equal_for(20, 1);
    both.assert_equal_for(3000, 100);
}

#[test]
fn gpu_matches_plain_path_for_every_contact_and_bond_law() {
    let Some(gpu) = gpu() else { return };
    for model in [BondModel::Corotated, BondModel::AsPublished, BondModel::FiniteExtension] {
        for (gamma, mu, between_bonded) in [(0.0, 0.3, true), (0.055, 0.0, false), (0.055, 0.6, true)] {
            let mut scene = blocks();
            scene.laws.bond = BondLaw { model, ..bonds() };
            scene.laws.tissue = law(false, 0.3, mu, gamma);
            scene.laws.equipment = law(true, 0.3, mu, gamma);
            scene.laws.contact_between_bonded = between_bonded;
            Both::new(&gpu, &scene).assert_equal_for(1000, 250);
        }
    }
}

#[test]
fn gpu_matches_plain_path_for_breaking_bonds() {
    let Some(gpu) = gpu() else { return };
    let mut scene = blocks();
    scene.laws.bond = BondLaw { normal_strength: 0.02, shear_strength: 0.02, ..bonds() };
    let mut both = Both::new(&gpu, &scene);
    both.assert_equal_for(1500, 50);
    let broken = gpu.state(&mut both.gpu_run).bonds_broken;
    assert!((10..300).contains(&broken), "{broken} bonds broken");
}

#[test]
fn gpu_matches_plain_path_for_held_sub_particles_and_moving_surfaces() {
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
    both.assert_equal_for(600, 60);
    both.plain.start(&mut both.plain_run);
    both.gpu.start(&mut both.gpu_run);
    both.assert_same();
    both.assert_equal_for(1200, 60);
}

#[test]
fn gpu_matches_plain_path_with_a_body_radius_ratio() {
    let Some(gpu) = gpu() else { return };
    for ratio in [1.225, 1.5] {
        let mut scene = blocks();
        scene.laws.body_radius_ratio = ratio;
        Both::new(&gpu, &scene).assert_equal_for(1000, 250);
        let mut hopper = scene_of(&small_hopper(0.06));
        hopper.laws.body_radius_ratio = ratio;
        Both::new(&gpu, &hopper).assert_equal_for(500, 250);
    }
}

#[test]
fn gpu_matches_plain_path_for_filling_and_discharge_of_a_hopper() {
    let Some(gpu) = gpu() else { return };
    let mut both = Both::new(&gpu, &scene_of(&small_hopper(0.06)));
    both.assert_equal_for(600, 50);
    both.plain.start(&mut both.plain_run);
    both.gpu.start(&mut both.gpu_run);
    both.assert_equal_for(600, 50);
    let leaves: Vec<u32> = {
        let state = gpu.state(&mut both.gpu_run);
        let of = |i: &usize| [2, 7].contains(&state.bodies[*i]);
        (0..state.serials.len()).filter(of).map(|i| state.serials[i]).collect()
    };
    both.plain.remove(&mut both.plain_run, &leaves);
    both.gpu.remove(&mut both.gpu_run, &leaves);
    both.assert_same();
    both.assert_equal_for(300, 50);
}

#[test]
fn gpu_matches_plain_path_for_entering_bodies() {
    let Some(gpu) = gpu() else { return };
    let mut scene = blocks();
    let later: Vec<Placement> = (0..12).map(|_| scene.bodies[0]).collect();
    scene.bodies.extend(&later);
    scene.waiting = later.len();
    let mut both = Both::new(&gpu, &scene);
    both.assert_equal_for(200, 50);
    // More and more at a time, so that the buffers of the device grow, and with one gone in between.
    for (first, count) in [(3, 1), (4, 3), (7, 8)] {
        let place = |k: usize| {
            let k = k as f64;
            let position = DVec3::new(-0.25 + 0.04 * k, 0.1, 0.03);
            Placement { position, ..scene.bodies[0] }
        };
        let bodies: Vec<Placement> = (first..first + count).map(place).collect();
        both.plain.enter(&mut both.plain_run, &scene, first, &bodies);
        both.gpu.enter(&mut both.gpu_run, &scene, first, &bodies);
        both.assert_same();
        both.assert_equal_for(200, 50);
        let gone: Vec<u32> = (48 * first as u32..48 * first as u32 + 48).collect();
        both.plain.remove(&mut both.plain_run, &gone);
        both.gpu.remove(&mut both.gpu_run, &gone);
        both.assert_equal_for(50, 50);
    }
    assert_eq!(gpu.state(&mut both.gpu_run).particles.len(), 48 * 12);
}

#[test]
fn kernels_refused_by_the_driver_are_an_error_with_the_reason() {
    let Some(device) = parity::device() else { return };
    let source = Source::kernels().with("step", "moved[i] = me;", "moved[i] = nobody;");
    let error = Gpu::with(device, &source).expect_err("there is no such name").to_string();
    assert!(error.contains("refuses") && error.contains("nobody"), "{error}");
}

#[test]
fn gpu_divergence_stops_at_the_same_step_for_the_same_reason() {
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

#[test]
fn gpu_matches_plain_path_for_surfaces_of_many_facets() {
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
        both.assert_equal_for(200, 50);
        both.plain.start(&mut both.plain_run);
        both.gpu.start(&mut both.gpu_run);
        both.assert_equal_for(400, 50);
        let force = both.gpu.surface_forces(&mut both.gpu_run)[0].length();
        let wall_slots = both.gpu_run.wall_capacity();
        println!("{force:.3} N, {wall_slots} facets");
        assert!(force > 0.1, "nothing lies on it: {force} N");
    }
}

#[test]
fn gpu_matches_plain_path_in_a_periodic_domain() {
    let Some(gpu) = gpu() else { return };
    // The blocks touch their own images across the seam; the second period is two cells of the grid wide.
    for period in [0.034, 0.0311] {
        let mut scene = blocks();
        scene.bodies.iter_mut().for_each(|body| body.position.y += 0.014);
        (scene.low.y, scene.high.y, scene.periodic_y) = (-period / 2.0, period / 2.0, true);
        Both::new(&gpu, &scene).assert_equal_for(1000, 100);
    }
}

#[test]
fn gpu_rebuilds_neighbour_lists_before_they_are_invalid() {
    let Some(gpu) = gpu() else { return };
    // At 8 m/s half the skin is crossed in two steps, and what falls is slow at first and fast in the end.
    let mut scene = blocks();
    scene.bodies.push(at(DVec3::new(-0.05, 0.0, 0.3), DVec3::new(1.0, 0.0, -8.0)));
    Both::new(&gpu, &scene).assert_equal_for(1500, 500);
}

#[test]
fn gpu_result_equals_the_plain_path_for_every_experiment() {
    let Some(gpu) = gpu() else { return };
    for scenario in experiments() {
        let mut keep_on = |_: &Progress| Flow::Continue;
        let plain = simulate_on(&Cpu::plain(1), &checked(&scenario), None, &mut keep_on).unwrap();
        let other = simulate_on(&gpu, &checked(&scenario), None, &mut keep_on).unwrap();
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
fn killed_gpu_runs_resume_with_the_bits_of_the_plain_path() {
    let Some(gpu) = gpu() else { return };
    let plain = Cpu::plain(1);
    for (number, scenario) in experiments().iter().enumerate() {
        let mut random = fastrand::Rng::with_seed(number as u64);
        let shares = [0.5 * random.f64(), 0.5 + 0.4 * random.f64()];
        let expected = simulate_on(&plain, &checked(scenario), None, &mut |_: &Progress| Flow::Continue);
        let next = || RandomSteps(&gpu, RefCell::new(random.fork()));
        let (result, kills) = with_kills(&checked(scenario), &shares, next);
        assert_eq!(bits(&result), bits(&expected.unwrap()), "scenario {number}, killed at {shares:?}");
        assert!(kills > 0, "scenario {number}");
    }
}

#[test]
#[ignore = "half a minute together: run them after a change of the kernels"]
fn planted_errors_in_every_gpu_stage_are_detected() {
    let Some(device) = parity::device() else { return };
    // File, what stands there, what is planted.
    let planted = [
        ("cell_list", "vec3(0x80000000u)) / scene.cell", "vec3(0x80000000u)) / (scene.cell / 2u)"),
        ("pair_list", "<= cutoff * cutoff", "<= 0.7 * cutoff * cutoff"),
        ("pair_list", "new_pairs[base + to] = pair;", "new_pairs[base + to].state = pair.state;"),
        ("pair_list", "found[r][k] < other", "found[r][k] > other"),
        ("pair_list", "= moments[moments_base + at];", "= moments[moments_base + to];"),
        ("wall_list", "atomicMax(&reports[run].walls, count);", ""),
        ("forces", "me.mass * other.mass / (me.mass + other.mass)", "me.mass * 0.500001"),
        ("forces", "select(0u, 1u, i < j)", "1u"),
        ("forces", "other.body != me.body", "false"),
        ("forces", "(*load).torque += torque;", "(*load).torque -= torque;"),
        ("forces", "|| point.distance < reach", ""),
        ("walls", "return k;", "return NONE;"),
        ("walls", "pose.velocity + cross3", "cross3"),
        ("step", "if me.held == 0u {", "if true {"),
        ("step", "atomicOr(&reports[run].stale, 1u);", ""),
        ("step", "private_state[i].remainder = remainder;", ""),
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
    scene.laws.body_radius_ratio = 1.1;
    scene.laws.belt = law(true, 0.3, 0.5, 0.0);
    scene.laws.bond = BondLaw { normal_strength: 0.05, ..bonds() };
    let scene = with_moments(scene, 1.0);
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

#[test]
#[ignore = "half a minute together: run them after a change of the kernels"]
fn planted_errors_in_the_removal_of_sub_particles_are_detected() {
    let Some(device) = parity::device() else { return };
    let planted = [
        ("remove", "+ count * dispatch.kept", "+ count * scene.count"),
        ("remove", "new_walls[chain[i] +", "new_walls[i +"),
        ("remove", "chain[pair.other]", "pair.other"),
        ("remove", "= moments[at];", "= moments[i];"),
    ];
    // Three blocks that bounce on a plate beside each other.
    let scene = with_moments(onto(plate(SurfaceKind::Equipment), |x| x), 1.0);
    let stays = |source: &Source| {
        let gpu = Gpu::with(device.clone(), source).expect("kernels that compile");
        let mut both = Both::new(&gpu, &scene);
        both.advance(400);
        let first: Vec<u32> = (0..48).collect();
        both.plain.remove(&mut both.plain_run, &first);
        gpu.remove(&mut both.gpu_run, &first);
        assert_eq!(both.plain.surface_loads(&mut both.plain_run), gpu.surface_loads(&mut both.gpu_run));
        both.advance(100);
        difference(both.plain.state(&mut both.plain_run), gpu.state(&mut both.gpu_run)).is_none()
    };
    assert!(stays(&Source::kernels()), "without an error");
    for (file, text, error) in planted {
        assert!(!stays(&Source::kernels().with(file, text, error)), "{file}: `{error}` was not found");
    }
}
