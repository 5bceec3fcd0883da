//! Drops: what the plate bears, what breaks, when all has settled; and that every fillet falls as if it were alone.

mod common;

use common::{assert_close, checked, document, response, run_on, scene_of};
use glam::DVec3;
use roost_solver::engine::run::{Decision, ExperimentMonitor, Sample};
use roost_solver::engine::state::State;
use roost_solver::result::{EndReason, RunResult};
use roost_solver::scenario::{self, Scenario};
use serde_json::{Value, json};

/// A drop of few coarse fillets with these fields, by pointer.
fn drop(fields: &[(&str, Value)]) -> Scenario {
    let own = [
        ("/experiment", json!("drop")),
        ("/product/count", json!(1)),
        ("/product/subparticle_radius_m", json!(0.009)),
        ("/numerics/timestep_s", json!("auto")),
    ];
    scenario::from_value(&document(&[&own[..], fields].concat())).expect("a sound scenario")
}

fn run(scenario: &Scenario) -> RunResult {
    run_on(1, scenario)
}

/// The values of a curve, one a fillet.
fn curve(result: &RunResult, name: &str) -> Vec<f64> {
    let curve = common::curve(result, name);
    assert_eq!((curve.over.as_str(), curve.x.len()), ("fillet", curve.values.len()));
    curve.values.clone()
}

fn mass_kg(scenario: &Scenario) -> f64 {
    let state = State::new(&scene_of(scenario));
    state.masses.iter().map(|&mass| f64::from(mass)).sum()
}

#[test]
fn plate_force_integrates_to_momentum_and_weight() {
    let step = json!(1e-4);
    let scenario = drop(&[
        ("/numerics/timestep_s", step.clone()),
        ("/numerics/output_interval_s", step),
        ("/numerics/stop/when_done", json!(false)),
        ("/drop/speed_m_s", json!(1.5)),
    ]);
    let result = run(&scenario);
    assert_eq!(result.end_reason, EndReason::Duration);
    let (mass, force) = (mass_kg(&scenario), result.series("plate_force").expect("there"));
    // At every step, so that the sum is the impulse and not an estimate of it.
    let impulse: f64 = force.values.iter().sum::<f64>() * 1e-4;
    assert_close(impulse, mass * (1.5 + 9.81 * 2.0), 1e-4);
    let last = &force.values[force.values.len() - 2000..];
    assert_close(last.iter().sum::<f64>() / 2000.0, mass * 9.81, 2e-3);
    // It hits within a millisecond, with the energy that it was given.
    let energy = result.series("kinetic_energy").expect("there");
    assert_close(energy.values[0], 0.5 * mass * 1.5 * 1.5, 1e-6);
    assert_eq!(force.values[0], 0.0);
    let hit = force.values.iter().position(|&f| f > 0.0).expect("it hits");
    assert!(force.t_s[hit] < 1e-3, "at {} s", force.t_s[hit]);
}

#[test]
fn fillet_falls_with_the_same_bits_for_any_number_of_others() {
    let of = |count: u32| {
        let fields = [
            ("/product/count", json!(count)),
            ("/product/shape", json!(2)),
            ("/drop/speed_m_s", json!(5.0)),
            ("/bonds/contact_radius_ratio", json!(1.15)),
            ("/drop/pitch_deg", json!(70)),
            ("/drop/roll_deg", json!(20)),
        ];
        let result = run(&drop(&fields));
        (curve(&result, "bonds_intact_fraction"), curve(&result, "settle_time"), result)
    };
    let (one, six) = (of(1), of(6));
    assert!(one.0[0] < 1.0, "some bonds break");
    assert_eq!(six.0, vec![one.0[0]; 6]);
    assert_eq!(six.1, vec![one.1[0]; 6]);
    assert_close(response(&six.2, "settle_time_s"), response(&six.2, "longest_settle_time_s"), 1e-12);
    assert_close(response(&six.2, "bonds_intact_fraction"), one.0[0], 1e-12);
    assert_eq!(response(&six.2, "max_overlap_ratio"), response(&one.2, "max_overlap_ratio"));
}

#[test]
fn mirrored_fillets_have_the_same_responses() {
    // Not to the bit: the mirror image adds up its forces in another order.
    let result = run(&drop(&[("/product/count", json!(6)), ("/drop/speed_m_s", json!(3.0))]));
    let (intact, settle) = (curve(&result, "bonds_intact_fraction"), curve(&result, "settle_time"));
    for size in 0..3 {
        assert_eq!(intact[2 * size], intact[2 * size + 1]);
        assert_close(settle[2 * size], settle[2 * size + 1], 5e-3);
    }
    assert!(settle[0] != settle[2] && settle[2] != settle[4]);
    let mean = settle.iter().sum::<f64>() / 6.0;
    assert_close(response(&result, "settle_time_s"), mean, 1e-12);
    assert_eq!(response(&result, "longest_settle_time_s"), settle.iter().copied().fold(0.0, f64::max));
}

#[test]
fn a_drop_gives_the_same_bits_on_any_number_of_threads() {
    // More than two chunks of sub-particles; scattered, so that no two fillets are alike.
    let scenario = drop(&[
        ("/product/count", json!(18)),
        ("/drop/scatter_deg", json!(90)),
        ("/numerics/duration_s", json!(0.15)),
    ]);
    let text = |result: &RunResult| {
        serde_json::to_string(&(&result.responses, &result.series, &result.curves)).expect("serialises")
    };
    let one = run_on(1, &scenario);
    assert!(one.performance.subparticles > 512);
    for threads in [2, 3] {
        assert_eq!(text(&one), text(&run_on(threads, &scenario)));
    }
    assert_ne!(text(&one), text(&run(&Scenario { seed: 2, ..scenario })));
}

#[test]
fn fillets_start_just_above_their_plates_in_the_requested_orientation() {
    let all = [
        ("/product/count", json!(40)),
        ("/drop/yaw_deg", json!(30)),
        ("/drop/pitch_deg", json!(-50)),
        ("/drop/scatter_deg", json!(5)),
        ("/drop/speed_m_s", json!(0.01)),
    ];
    let scene = scene_of(&drop(&all));
    let state = State::new(&scene);
    let mut seen = Vec::new();
    for (body, range) in state.body_ranges() {
        let (placement, surface) = (&scene.bodies[body as usize], &scene.surfaces[body as usize]);
        let points: Vec<DVec3> = range.map(|i| state.position(i)).collect();
        let lowest = points.iter().map(|point| point.z).fold(f64::INFINITY, f64::min);
        assert_close(lowest, 0.009 * 1.05, 1e-4);
        // Each over the middle of a plate that reaches at least twice as far as the fillet.
        let corners = || surface.triangles.iter().flatten();
        let middle = corners().sum::<DVec3>() / 6.0;
        assert!(middle.truncate().distance(placement.position.truncate()) < 1e-9);
        let half = corners().map(|corner| (corner.x - middle.x).abs()).fold(0.0, f64::max);
        assert!(half > 2.0 * scene.kinds[placement.kind].meta.bounding_radius_m);
        // At −50° the tail points up; yaw turns what is horizontal of it.
        let tail = placement.orientation * DVec3::X;
        let (yaw, pitch) = (tail.y.atan2(tail.x).to_degrees(), -tail.z.asin().to_degrees());
        assert!((yaw - 30.0).abs() <= 5.0 && (pitch + 50.0).abs() <= 5.0, "{yaw}, {pitch}");
        assert_eq!(placement.velocity, DVec3::NEG_Z * 0.01);
        seen.push(yaw);
    }
    // Drawn from all over the range, and never outside of it.
    assert!(seen.iter().any(|yaw| *yaw > 33.0) && seen.iter().any(|yaw| *yaw < 27.0));
    let nearest = |a: usize, b: usize| scene.bodies[a].position.distance(scene.bodies[b].position);
    let apart = (0..40).flat_map(|b| (0..b).map(move |a| nearest(a, b))).fold(f64::INFINITY, f64::min);
    let plate = scene.surfaces[0].triangles[0][1].x - scene.surfaces[0].triangles[0][0].x;
    assert!(apart > plate + 2.0 * 30.0 * 0.002, "{apart} m, plates of {plate} m");
}

/// One fillet's monitor and its state, changed by hand.
struct Stage {
    state: State,
    monitor: Box<dyn ExperimentMonitor>,
    now_s: f64,
}

impl Stage {
    fn new(fields: &[(&str, Value)]) -> Self {
        let checked = checked(&drop(fields));
        let setup = checked.setup();
        Self { state: State::new(setup.scene()), monitor: setup.monitor(), now_s: 0.0 }
    }

    /// Shows all moving at a speed, in m/s, and goes on by 10 ms.
    fn look(&mut self, speed: f32) -> Decision {
        for p in &mut self.state.particles {
            p.velocity = glam::Vec3::NEG_Z * speed;
        }
        let (now_s, state) = (self.now_s, &self.state);
        self.now_s += 0.01;
        let sample = Sample {
            simulated_s: now_s,
            belt_time_s: Some(now_s),
            state,
            max_overlap_m: 9e-4,
            passed_through: 0,
            surface_loads: &[],
        };
        self.monitor.observe(&sample)
    }

    fn response(&self, name: &str) -> Value {
        self.monitor.responses(EndReason::Duration)[name].clone()
    }
}

const GO_ON: Decision = Decision::Continue { remove: vec![] };

#[test]
fn fillet_is_settled_after_losing_99_percent_of_its_energy_for_good() {
    let mut stage = Stage::new(&[]);
    let before = Sample {
        simulated_s: 0.0,
        belt_time_s: None,
        state: &stage.state,
        max_overlap_m: 0.0,
        passed_through: 0,
        surface_loads: &[],
    };
    assert_eq!(stage.monitor.observe(&before), Decision::Start, "t = 0 is the start");
    // 1 % of the energy of 2 m/s is that of 0.2 m/s.
    for (speed, settled) in [(2.0, 0.0), (0.5, 0.0), (0.19, 1.0), (0.3, 0.0), (0.1, 1.0), (0.19, 1.0)] {
        assert_eq!(stage.look(speed), GO_ON);
        assert_eq!(stage.response("settled_fraction"), json!(settled), "at {speed} m/s");
    }
    // Between 0.03 s and 0.04 s, where v² falls from 0.09 to 0.01; contact came after a gap of 0.05 R at 2 m/s.
    let time = stage.response("settle_time_s").as_f64().expect("settled");
    assert_close(time, 0.03 + 0.01 * (0.09 - 0.04) / 0.08 - 0.05 * 0.009 / 2.0, 1e-3);
    assert_close(stage.response("max_overlap_ratio").as_f64().expect("a number"), 0.1, 1e-6);
    stage.look(1.0);
    assert_eq!(stage.response("settle_time_s"), Value::Null);
}

#[test]
fn a_drop_is_done_after_a_quarter_second_of_rest() {
    let mut stage = Stage::new(&[]);
    assert_eq!(stage.look(2.0), GO_ON);
    for _ in 0..20 {
        assert_eq!(stage.look(0.04), GO_ON);
    }
    assert_eq!(stage.look(0.06), GO_ON, "settled, and not at rest");
    for _ in 0..25 {
        assert_eq!(stage.look(0.04), GO_ON);
    }
    assert_eq!(stage.look(0.04), Decision::End(EndReason::Done));
    // Slow from the start, and yet as fast as it hit.
    let mut slow = Stage::new(&[("/drop/speed_m_s", json!(0.04))]);
    assert!((0..40).all(|_| slow.look(0.04) == GO_ON));
    assert_eq!(slow.look(0.003), Decision::End(EndReason::Done));
    let mut endless = Stage::new(&[("/numerics/stop/when_done", json!(false))]);
    assert!((0..100).all(|_| endless.look(0.0) == GO_ON));
}

#[test]
fn sub_particle_that_leaves_its_plate_escapes_without_broken_bonds() {
    let mut stage = Stage::new(&[("/product/count", json!(2)), ("/product/shape", json!(0))]);
    let bonds = stage.state.bonds_at_start as f64;
    // Three bonds of the first sub-particle break, then it leaves, and takes the rest of its bonds along unbroken.
    stage.state.broken[0] = 3;
    stage.state.bonds_broken = 3;
    stage.look(2.0);
    stage.state.particles[0].position.x += (10.0 / stage.state.frame.unit_m) as i32;
    let mass = f64::from(stage.state.masses[0]);
    assert_eq!(stage.look(2.0), Decision::Continue { remove: vec![0] });
    stage.state.remove(&[0]);
    assert_eq!(stage.look(2.0), GO_ON);
    assert_close(stage.response("escaped_kg").as_f64().expect("a number"), mass, 1e-9);
    let curves = stage.monitor.curves();
    assert_eq!(curves[0].values, [1.0 - 3.0 / (bonds / 2.0), 1.0]);
    assert_eq!(stage.response("lowest_bonds_intact_fraction"), json!(curves[0].values[0]));
    assert_close(
        stage.response("bonds_intact_fraction").as_f64().expect("a number"),
        1.0 - 3.0 / bonds,
        1e-12,
    );
    // A fillet of which nothing is left has not settled, whatever the other does.
    let first = |(&body, &serial): (&u32, &u32)| (body == 0).then_some(serial);
    let first: Vec<u32> = stage.state.bodies.iter().zip(&stage.state.serials).filter_map(first).collect();
    stage.state.remove(&first);
    stage.look(0.01);
    assert_eq!(stage.response("settled_fraction"), json!(0.5));
}

#[test]
fn ending_early_changes_no_settle_time() {
    for pitch in [0.0, -90.0] {
        let of = |done: bool| {
            run(&drop(&[
                ("/numerics/stop/when_done", json!(done)),
                ("/numerics/duration_s", json!(4.0)),
                ("/drop/pitch_deg", json!(pitch)),
            ]))
        };
        let (early, late) = (of(true), of(false));
        assert_eq!((early.end_reason, late.end_reason), (EndReason::Done, EndReason::Duration));
        assert_eq!(early.responses["settle_time_s"], late.responses["settle_time_s"]);
        assert_eq!(early.responses["bonds_intact_fraction"], late.responses["bonds_intact_fraction"]);
        assert!(early.series[0].t_s.len() < late.series[0].t_s.len());
    }
}

/// A fine fillet dropped flat at 2 m/s with other stiffnesses.
fn stiff(formulation: &str, normal: f64, shear: f64) -> RunResult {
    run(&drop(&[
        ("/product/subparticle_radius_m", json!(0.004)),
        ("/bonds/formulation", json!(formulation)),
        ("/bonds/normal_stiffness_n_m3", json!(normal)),
        ("/bonds/shear_stiffness_n_m3", json!(shear)),
        ("/numerics/duration_s", json!(0.25)),
    ]))
}

#[test]
fn diverging_drop_with_the_published_bond_keeps_its_samples() {
    let published = stiff("as_published", 1e7, 1e5);
    assert_eq!(published.end_reason, EndReason::Unstable, "{:?}", published.responses);
    let instability = published.instability.as_ref().expect("said where");
    assert!(instability.reason.contains("fillet 0") && instability.reason.contains(" J "), "{instability:?}");
    let energy = published.series("kinetic_energy").expect("there");
    assert!(energy.values.len() > 10);
    assert_eq!(energy.t_s.last(), Some(&instability.time_s));
    assert_eq!(instability.step, published.performance.steps);
    // Nothing gave it the energy, and no sub-particle is fast enough for the speed limit.
    assert!(*energy.values.last().expect("some") > 2.0 * energy.values[0]);
    assert_eq!(published.responses["settle_time_s"], Value::Null);
    let corotated = stiff("corotated", 1e7, 1e5);
    assert_eq!(corotated.end_reason, EndReason::Duration);
    assert_eq!(response(&corotated, "bonds_intact_fraction"), 1.0);
}

#[test]
fn far_too_much_shear_stiffness_breaks_bonds() {
    let [balanced, sheared] =
        [(1e6, 6e5), (1e5, 1e7)].map(|(normal, shear)| stiff("corotated", normal, shear));
    assert_eq!(response(&balanced, "bonds_intact_fraction"), 1.0);
    assert!(response(&sheared, "bonds_intact_fraction") < 0.99);
    assert_eq!(sheared.end_reason, EndReason::Duration);
}

/// Six fillets as in the paper, one of each shape, dropped at a pitch in degrees and a speed in m/s.
fn six(pitch: f64, speed: f64, formulation: &str) -> RunResult {
    run_on(
        2,
        &drop(&[
            ("/product/count", json!(6)),
            ("/product/subparticle_radius_m", json!(0.004)),
            ("/bonds/formulation", json!(formulation)),
            ("/drop/pitch_deg", json!(pitch)),
            ("/drop/speed_m_s", json!(speed)),
            ("/numerics/duration_s", json!(0.4)),
        ]),
    )
}

#[test]
fn fillets_that_fall_flat_stay_whole_and_settle_at_once() {
    for speed in [1.0, 4.0] {
        let result = six(0.0, speed, "corotated");
        let intact = response(&result, "bonds_intact_fraction");
        assert!(intact >= 0.99, "{intact} at {speed} m/s");
        let settled = response(&result, "settle_time_s");
        assert!((0.1..0.35).contains(&settled), "after {settled} s at {speed} m/s");
    }
}

#[test]
fn end_on_impact_breaks_few_bonds_and_fewest_with_finite_extension() {
    for pitch in [90.0, -90.0] {
        for (formulation, least) in [("corotated", 0.85), ("finite_extension", 0.99)] {
            let intact = response(&six(pitch, 4.0, formulation), "bonds_intact_fraction");
            assert!(intact >= least, "{intact} at {pitch}°, {formulation}");
        }
    }
}
