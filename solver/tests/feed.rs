//! Continuous feed of a hopper: the mass that enters, its balance, and equal bits on every way to compute it.

mod common;

use common::{assert_close, assert_same, document, response, run_on, scene_of};
use glam::DVec3;
use roost_solver::cpu::Cpu;
use roost_solver::engine::Backend;
use roost_solver::engine::scene::{Placement, Scene};
use roost_solver::engine::state::State;
use roost_solver::mesh::Meshes;
use roost_solver::scenario::{self, Scenario};
use roost_solver::{Limits, check};
use serde_json::{Value, json};

/// A narrow hopper with coarse fillets; the belt carries more than the feed brings.
fn fed(feed_kg_s: f64, duration_s: f64, more: &[(&str, Value)]) -> Scenario {
    let fields = [
        ("/product", json!({"count": 8, "subparticle_radius_m": 0.009})),
        (
            "/equipment",
            json!({
                "hopper_width_m": 0.2, "hopper_length_m": 0.2, "hopper_height_m": 0.3, "gate_opening_m": 0.09,
                "belt_speed_m_s": 0.3, "feed_kg_s": feed_kg_s,
            }),
        ),
        ("/numerics", json!({"timestep_s": "auto", "duration_s": duration_s})),
    ];
    scenario::from_value(&document(&[&fields, more].concat())).expect("a sound scenario")
}

#[test]
fn feed_enters_at_its_rate_and_the_belt_discharges_the_same_rate() {
    let (rate, duration_s) = (2.0, 6.0);
    let result = run_on(2, &fed(rate, duration_s, &[]));
    let of = |name| response(&result, name);
    // A fillet enters at the sample by which half of it is due.
    let fillet_kg = of("loaded_kg") / 8.0;
    let (fed_kg, due_kg) = (of("fed_kg"), rate * duration_s);
    assert!((fed_kg - due_kg).abs() < fillet_kg, "{fed_kg} kg of {due_kg} kg");
    let accounted = of("discharged_kg") + of("inside_kg") + of("escaped_kg");
    assert_close(accounted, of("filled_kg") + fed_kg, 1e-6);
    assert_eq!(of("escaped_kg"), 0.0);
    assert!(result.warnings.iter().all(|warning| warning.code != "feed_short"));
    // The few fillets of the first filling are out in the first half.
    assert_close(of("steady_rate_kg_s"), rate, 0.15);
    let power = result.series("belt_power").expect("a series");
    let late =
        power.t_s.iter().zip(&power.values).filter(|(t, _)| **t >= 0.5 * power.t_s[power.t_s.len() - 1]);
    let late: Vec<f64> = late.map(|(_, watts)| *watts).collect();
    assert_close(of("mean_belt_power_w"), late.iter().sum::<f64>() / late.len() as f64, 1e-9);
}

#[test]
fn full_hopper_limits_the_feed_with_a_warning() {
    let more = [("/equipment/belt_speed_m_s", json!(0.0))];
    let result = run_on(2, &fed(20.0, 1.5, &more));
    let of = |name| response(&result, name);
    assert!(of("fed_kg") < 0.9 * 30.0, "{} kg fit in", of("fed_kg"));
    assert_close(of("inside_kg") + of("discharged_kg"), of("filled_kg") + of("fed_kg"), 1e-6);
    assert_eq!(of("escaped_kg"), 0.0, "nothing is fed into what is there");
    let short = result.warnings.iter().find(|warning| warning.code == "feed_short").expect("it is named");
    assert!(
        short.message.contains(&format!("brought {:.2} kg of 29.60 kg", of("fed_kg"))),
        "{}",
        short.message
    );
}

#[test]
fn a_feed_of_zero_feeds_nothing() {
    let result = run_on(1, &fed(0.0, 0.5, &[]));
    assert_eq!(response(&result, "fed_kg"), 0.0);
    assert_eq!(result.responses["steady_rate_kg_s"], Value::Null);
    let scene = scene_of(&fed(0.0, 0.5, &[]));
    assert_eq!((scene.bodies.len(), scene.waiting), (8, 0));
    let (small, long) =
        (json!({"count": 8, "subparticle_radius_m": 0.004, "sizes_m": [[0.02, 0.02, 0.02]]}), json!(600));
    let many = fed(1000.0, 6.0, &[("/product", small), ("/numerics/duration_s", long)]);
    let faults = check(&many, &Meshes::default(), &Limits::NONE).expect_err("too many fillets");
    assert_eq!(faults[0].pointer, "/equipment/feed_kg_s");
    // The estimate counts what will be fed.
    assert!(common::checked(&fed(2.0, 6.0, &[])).estimate().mass_kg > 12.0);
}

/// Pointers and values of what is wrong with a scenario.
fn refused(scenario: &Scenario, limits: &Limits) -> Vec<(String, Value)> {
    let faults = check(scenario, &Meshes::default(), limits).err().unwrap_or_default();
    faults.into_iter().map(|fault| (fault.pointer, fault.value)).collect()
}

#[test]
fn feed_of_too_many_fillets_is_refused() {
    let few = Limits { max_subparticles: 400, ..Limits::NONE };
    assert_eq!(refused(&fed(2.0, 6.0, &[]), &few), [("/equipment/feed_kg_s".to_owned(), json!(2.0))]);
}

#[test]
fn a_feed_into_a_surface_is_refused() {
    // Fillets appear from 0.3 m on over a floor of 0.2 × 0.2 m.
    let lid = |x: f64, z: f64| {
        let plate = json!([[x, -1.0, z], [0.3, 0.0, 0.0], [0.0, 2.0, 0.0]]);
        let surfaces = json!([{"name": "lid", "plate_m": plate}]);
        fed(2.0, 0.5, &[("/equipment/surfaces", surfaces), ("/product/count", json!(1))])
    };
    assert_eq!(refused(&lid(-0.25, 0.33), &Limits::NONE), [("/equipment/feed_kg_s".to_owned(), json!(2.0))]);
    for beside in [lid(-0.25, 0.9), lid(0.0, 0.33)] {
        assert_eq!(refused(&beside, &Limits::NONE), []);
    }
}

#[test]
fn surface_loads_with_too_many_samples_are_refused() {
    let many = [("/equipment/surface_loads", json!(true)), ("/numerics/output_interval_s", json!(0.0005))];
    // Five surfaces make 30 numbers in each sample, so 6.67 s at this interval are the most.
    let loads = [("/equipment/surface_loads".to_owned(), json!(true))];
    assert_eq!(refused(&fed(0.0, 6.7, &many), &Limits::NONE), loads);
    assert_eq!(refused(&fed(0.0, 6.6, &many), &Limits::NONE), []);
}

/// A scene of two blocks of which the second enters at a step, over the first.
fn entering() -> (Scene, Placement) {
    let mut scene = common::blocks();
    scene.waiting = 1;
    let late = Placement { position: DVec3::new(0.012, 0.003, 0.075), ..scene.bodies[2] };
    (scene, late)
}

fn with_entry(cpu: &Cpu, chunks: &[u64]) -> State {
    let (scene, late) = entering();
    let mut run = cpu.prepare(&scene);
    let step = |run: &mut _, steps: u64| {
        let mut left = steps;
        for chunk in chunks.iter().copied().cycle() {
            if left == 0 {
                break;
            }
            let now = chunk.min(left);
            assert_eq!(cpu.advance(&mut [(&mut *run, now)]).swap_remove(0).fault, None);
            left -= now;
        }
    };
    step(&mut run, 300);
    cpu.enter(&mut run, &scene, 2, &[late]);
    step(&mut run, 700);
    // Ids go on behind what has left.
    let first: Vec<u32> = (0..48).collect();
    cpu.remove(&mut run, &first);
    step(&mut run, 50);
    cpu.state(&mut run).clone()
}

#[test]
fn entering_body_gives_the_same_bits_for_any_chunks_and_threads() {
    for path in [Cpu::plain as fn(usize) -> Cpu, Cpu::new] {
        let whole = with_entry(&path(1), &[1000]);
        assert_eq!(whole.serials, (48..144).collect::<Vec<u32>>());
        assert_eq!(whole.bodies.last(), Some(&2));
        for (threads, chunks) in [(1, &[1u64, 7][..]), (2, &[50]), (3, &[999])] {
            assert_same(&with_entry(&path(threads), chunks), &whole, "chunks and threads");
        }
    }
}

#[test]
fn body_that_enters_at_once_equals_one_present_from_the_start() {
    let (scene, late) = entering();
    let moments = common::with_moments(scene.clone(), 1.0);
    for (cpu, scene) in [Cpu::plain(1), Cpu::new(1)].iter().flat_map(|cpu| [(cpu, &scene), (cpu, &moments)]) {
        let mut there = scene.clone();
        there.waiting = 0;
        there.bodies[2] = late;
        let (mut entered, mut present) = (cpu.prepare(scene), cpu.prepare(&there));
        cpu.enter(&mut entered, scene, 2, &[late]);
        cpu.advance(&mut [(&mut entered, 800), (&mut present, 800)]);
        let state = cpu.state(&mut present).clone();
        assert_eq!(cpu.state(&mut entered).bonds_at_start, state.bonds_at_start);
        assert_same(cpu.state(&mut entered), &state, "entered before the first step");
    }
}

#[test]
fn body_that_enters_later_moves_and_touches_alike_on_both_paths_from_its_first_step() {
    let (scene, late) = entering();
    let after = |cpu: &Cpu, steps: u64| {
        let mut run = cpu.prepare(&scene);
        cpu.advance(&mut [(&mut run, 300)]);
        let state = cpu.state(&mut run);
        // Its lowest layer, 2R below its middle, overlaps what is there by a tenth of R.
        let top = (0..state.particles.len()).map(|i| state.position(i).z).fold(0.0, f64::max);
        let position = DVec3::new(0.01, 0.005, top + 3.9 * scene.radius_m);
        let present = state.particles.len();
        cpu.enter(&mut run, &scene, 2, &[Placement { position, ..late }]);
        let state = cpu.state(&mut run).clone();
        let reaches =
            |i: usize, j: usize| (state.position(i) - state.position(j)).length() < 2.0 * scene.radius_m;
        let touches = (present..state.particles.len()).any(|i| (0..present).any(|j| reaches(i, j)));
        assert!(touches, "it enters in contact");
        assert_eq!(cpu.advance(&mut [(&mut run, steps)]).swap_remove(0).fault, None);
        cpu.state(&mut run).clone()
    };
    for steps in [1, 20, 60] {
        let [plain, fast] = [Cpu::plain(1), Cpu::new(1)].map(|cpu| after(&cpu, steps));
        let apart =
            plain.particles.iter().zip(&fast.particles).map(|(a, b)| (a.velocity - b.velocity).length());
        let (most, speed) = (apart.fold(0.0, f32::max), plain.max_speed());
        assert!(f64::from(most) < 1e-3 * speed, "{most} of {speed} m/s after {steps} steps");
    }
}

#[test]
fn bodies_keep_the_moments_of_their_bonds_when_another_enters() {
    let (scene, late) = entering();
    let scene = common::with_moments(scene, 1.0);
    let far = Placement { position: late.position - glam::DVec3::X * 0.3, ..late };
    for cpu in [Cpu::plain(1), Cpu::new(1)] {
        let (mut entered, mut alone) = (cpu.prepare(&scene), cpu.prepare(&scene));
        cpu.advance(&mut [(&mut entered, 700), (&mut alone, 700)]);
        cpu.enter(&mut entered, &scene, 2, &[far]);
        cpu.advance(&mut [(&mut entered, 100), (&mut alone, 100)]);
        let (entered, alone) = (cpu.state(&mut entered), cpu.state(&mut alone));
        assert_eq!((entered.particles.len(), alone.particles.len()), (144, 96));
        assert_eq!(entered.particles[..96], alone.particles[..]);
    }
}
