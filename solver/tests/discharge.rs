//! The hopper's monitor with states made by hand: when the bed rests, what has passed, what has left, when to stop.

mod common;

use common::{assert_close, checked, document};
use glam::DVec3;
use roost_solver::engine::SurfaceLoad;
use roost_solver::engine::run::{Decision, ExperimentMonitor, Sample};
use roost_solver::engine::scene::Scene;
use roost_solver::engine::state::State;
use roost_solver::observe::BendGauge;
use roost_solver::result::EndReason;
use roost_solver::scenario::{self, Scenario};
use serde_json::{Value, json};

/// Two fillets in a hopper of 0.59 × 0.30 m, their states to be moved about.
struct Stage {
    scene: Scene,
    state: State,
    monitor: Box<dyn ExperimentMonitor>,
    loads: Vec<SurfaceLoad>,
    simulated_s: f64,
    start_s: f64,
}

impl Stage {
    fn new(fields: &[(&str, Value)]) -> Self {
        let few = [("/product/count", json!(2)), ("/product/subparticle_radius_m", json!(0.008))];
        let scenario: Scenario =
            scenario::from_value(&document(&[&few[..], fields].concat())).expect("a sound scenario");
        let checked = checked(&scenario);
        let (scene, monitor) = (checked.setup().scene().clone(), checked.setup().monitor());
        let mut state = State::new(&scene);
        state.particles.iter_mut().for_each(|p| p.position.x = state.frame.encode(DVec3::X * -0.1).x);
        // By now the highest of them would have fallen.
        let loads = vec![SurfaceLoad::default(); scene.surfaces.len()];
        Self { scene, state, monitor, loads, simulated_s: 1.0, start_s: 0.0 }
    }

    /// Started: 0.1 s at rest.
    fn started(fields: &[(&str, Value)]) -> Self {
        let mut stage = Self::new(fields);
        for _ in 0..5 {
            assert_eq!(stage.fill(), Decision::Continue { remove: vec![] });
        }
        assert_eq!(stage.fill(), Decision::Start);
        stage.simulated_s -= 0.02;
        stage.start_s = stage.simulated_s;
        stage
    }

    fn fill(&mut self) -> Decision {
        let decision = self.look(None);
        self.simulated_s += 0.02;
        decision
    }

    fn process(&mut self) -> Decision {
        let decision = self.look(Some(self.simulated_s - self.start_s));
        self.simulated_s += 0.02;
        decision
    }

    fn look(&mut self, belt_time_s: Option<f64>) -> Decision {
        let (simulated_s, state) = (self.simulated_s, &self.state);
        self.monitor.observe(&Sample {
            simulated_s,
            belt_time_s,
            state,
            max_overlap_m: 4e-4,
            passed_through: 0,
            surface_loads: &self.loads,
        })
    }

    /// Puts these sub-particles at x.
    fn put(&mut self, range: std::ops::Range<usize>, x: f64) {
        let x = self.state.frame.encode(DVec3::X * x).x;
        self.state.particles[range].iter_mut().for_each(|p| p.position.x = x);
    }

    /// Sub-particles of the first body.
    fn first(&self) -> usize {
        self.scene.kinds[0].meta.points.len()
    }

    fn mass(&self, range: std::ops::Range<usize>) -> f64 {
        self.state.masses[range].iter().map(|&m| f64::from(m)).sum()
    }
}

const GO_ON: Decision = Decision::Continue { remove: vec![] };

#[test]
fn bed_is_at_rest_after_0_1_s_below_the_rest_speed() {
    let mut stage = Stage::new(&[]);
    for speed in [0.0, 0.0, 0.0, 0.0, 0.051, 0.0, 0.049, 0.0, 0.0, 0.0] {
        stage.state.particles[3].velocity.y = speed;
        assert_eq!(stage.fill(), GO_ON);
    }
    assert_eq!(stage.fill(), Decision::Start);
}

#[test]
fn bed_at_rest_may_have_one_fast_sub_particle_in_a_thousand() {
    for (trembling, rests) in [(2, true), (3, false)] {
        let mut stage = Stage::new(&[("/product/count", json!(40))]);
        assert_eq!(stage.state.particles.len() / 1000, 2);
        stage.state.particles[..trembling].iter_mut().for_each(|p| p.velocity.z = 1.0);
        let started = (0..20).any(|_| stage.fill() == Decision::Start);
        assert_eq!(started, rests, "{trembling} tremble");
    }
}

#[test]
fn bed_is_not_at_rest_before_the_highest_fillet_can_have_fallen() {
    let mut stage = Stage::new(&[("/product/count", json!(100))]);
    let top = stage.scene.bodies.iter().map(|body| body.position.z).fold(0.0, f64::max);
    let fall_s = (2.0 * top / 9.81).sqrt();
    stage.simulated_s = 0.0;
    while stage.fill() == GO_ON {}
    let started = stage.simulated_s - 0.02;
    assert!(
        fall_s > 0.12 && (fall_s..fall_s + 0.02).contains(&started),
        "{started} s, a fall takes {fall_s} s"
    );
}

#[test]
fn mass_counts_once_when_its_centre_passes_the_gate() {
    let mut stage = Stage::started(&[]);
    let (n, all) = (stage.first(), stage.state.particles.len());
    for (count, x, passed) in
        [(n, -1e-6, 0), (5, 1e-6, 5), (5, -0.01, 5), (5, 0.01, 5), (n, 0.1, n), (all, 0.1, all)]
    {
        stage.put(0..count, x);
        let decision = stage.process();
        let out = stage.mass(0..passed);
        assert!((stage.monitor.discharged_kg() - out).abs() < 1e-12, "{count} at {x} m: {out} kg");
        assert_eq!(decision == Decision::End(EndReason::Empty), passed == all);
    }
    let responses = stage.monitor.responses(EndReason::Empty);
    assert_close(responses["filled_kg"].as_f64().unwrap(), stage.mass(0..all), 1e-9);
    assert_close(responses["max_overlap_ratio"].as_f64().unwrap(), 0.05, 1e-6);
    stage.monitor.finish();
    let series = stage.monitor.recorder().series();
    assert_eq!(series[0].t_s.len(), 6);
    assert!(series[0].t_s.iter().enumerate().all(|(k, t)| (t - 0.02 * k as f64).abs() < 1e-12));
    // Energy from the fill on: five samples before the start, which is at 0 in both.
    assert!((series[3].t_s[0] + 0.1).abs() < 1e-12 && series[3].t_s[5].abs() < 1e-12);
    assert_eq!(series[3].t_s.len(), 11);
}

#[test]
fn whole_fillets_leave_past_the_gate_and_strays_are_counted_as_escaped() {
    let mut stage = Stage::started(&[]);
    let (n, all) = (stage.first(), stage.state.particles.len());
    stage.put(0..n - 1, 0.3);
    assert_eq!(stage.process(), GO_ON, "a part of it still hangs in the hopper");
    stage.put(n - 1..n, 0.26);
    assert_eq!(stage.process(), Decision::Continue { remove: (0..n as u32).collect() });
    assert_eq!(stage.monitor.responses(EndReason::Duration)["escaped_kg"], json!(0.0));
    // One sub-particle of the second fillet far to the side: it goes alone, and counts as escaped.
    stage.put(n..n + 4, 0.01);
    stage.process();
    let beside = DVec3::new(-0.1, 0.59 / 2.0 + 0.21, 0.1);
    stage.state.particles[all - 1].position = stage.state.frame.encode(beside);
    stage.put(n..n + 4, -0.01);
    stage.put(0..n, 0.01);
    assert_eq!(stage.process(), Decision::Continue { remove: vec![all as u32 - 1] });
    let responses = stage.monitor.responses(EndReason::Duration);
    assert_close(responses["escaped_kg"].as_f64().unwrap(), stage.mass(all - 1..all), 1e-9);
    assert_close(responses["discharged_kg"].as_f64().unwrap(), stage.mass(0..n + 4), 1e-9);
}

#[test]
fn residence_times_of_two_fillets_in_plug_flow_are_distance_over_belt_speed() {
    let mut stage = Stage::started(&[]);
    let (n, all) = (stage.first(), stage.state.particles.len());
    // At 0.25 m/s from −0.1 m and −0.203 m.
    for step in 0..45 {
        let moved_m = 0.25 * 0.02 * f64::from(step);
        stage.put(0..n, moved_m - 0.1);
        stage.put(n..all, moved_m - 0.203);
        stage.process();
    }
    let responses = stage.monitor.responses(EndReason::Duration);
    for (name, expected) in [
        ("residence_mean_s", 0.606),
        ("residence_5_percent_s", 0.4),
        ("residence_median_s", 0.4),
        ("residence_95_percent_s", 0.812),
    ] {
        assert_close(responses[name].as_f64().unwrap(), expected, 1e-6);
    }
    assert_eq!(responses["fillets_remaining"], json!(0));
    assert_eq!(stage.monitor.curves()[0].values, [0.5, 1.0]);
}

#[test]
fn a_fed_fillet_is_inside_from_the_sample_at_which_it_enters() {
    let mut stage = Stage::started(&[("/equipment/feed_kg_s", json!(20.0))]);
    stage.process();
    assert_eq!(stage.monitor.responses(EndReason::Duration)["fillets_remaining"], json!(2));
    let now_s = stage.simulated_s - stage.start_s;
    stage.process();
    let entered = stage.monitor.entering(&stage.state, Some(now_s)).len();
    assert!(entered > 0);
    assert_eq!(stage.monitor.responses(EndReason::Duration)["fillets_remaining"], json!(2 + entered));
}

#[test]
fn a_jam_is_counted_from_the_last_passage() {
    let mut stage = Stage::started(&[("/numerics/stop/when_jammed_s", json!(0.09))]);
    for k in 0..12 {
        // Something passes until t = 0.12 s.
        if k <= 6 {
            stage.put(0..k + 1, 0.01);
        }
        let ended = stage.process() == Decision::End(EndReason::Jammed);
        assert_eq!(ended, k == 11, "at {} s", 0.02 * f64::from(k as u32));
        let responses = stage.monitor.responses(EndReason::Duration);
        let jammed = if k < 5 { Value::Null } else { json!(u8::from(ended)) };
        assert_eq!(responses["jammed"], jammed, "at {} s", 0.02 * f64::from(k as u32));
    }
    let responses = stage.monitor.responses(EndReason::Jammed);
    assert_close(responses["time_to_jam_s"].as_f64().unwrap(), 0.12, 1e-9);
}

#[test]
fn stoppage_with_little_mass_inside_is_no_jam() {
    for (inside, jammed) in [(0.02, 0), (0.1, 1)] {
        let mut stage = Stage::started(&[("/numerics/stop/when_jammed_s", json!(0.09))]);
        let all = stage.state.particles.len();
        stage.put(0..all - (inside * all as f64).round() as usize, 0.01);
        while stage.process() != Decision::End(EndReason::Jammed) {}
        let responses = stage.monitor.responses(EndReason::Jammed);
        assert_eq!(responses["jammed"], json!(jammed), "{inside} of it inside");
    }
}

#[test]
fn mean_loads_end_with_80_percent_out_and_the_gate_bears_nothing_at_belt_start() {
    let mut stage = Stage::started(&[]);
    let number = |name: &str| stage.scene.surfaces.iter().position(|surface| surface.name == name);
    let [belt, gate] = ["belt", "gate"].map(|name| number(name).expect("a surface"));
    // At 0.25 m/s, and all out at the last sample.
    for (k, (friction_n, gate_n)) in
        [(8.0, 90.0), (4.0, 3.0), (0.0, 6.0), (40.0, 10.0)].into_iter().enumerate()
    {
        if k == 3 {
            stage.put(0..stage.state.particles.len(), 0.1);
        }
        stage.loads[belt].force = DVec3::new(-friction_n, 0.0, -50.0);
        stage.loads[gate].force = DVec3::new(0.6, 0.0, -0.8) * gate_n;
        stage.process();
    }
    let responses = stage.monitor.responses(EndReason::Empty);
    for (name, expected) in [
        ("mean_belt_power_w", 1.0),
        ("max_belt_power_w", 10.0),
        ("mean_gate_force_n", 4.5),
        ("max_gate_force_n", 10.0),
    ] {
        assert_close(responses[name].as_f64().unwrap(), expected, 1e-9);
    }
}

#[test]
fn bed_volume_is_floor_area_times_surface_height() {
    // Both fillets flat at 0.1 m, spread so that every square of the floor has one.
    let mut stage = Stage::new(&[("/product/count", json!(40)), ("/equipment/hopper_width_m", json!(0.32))]);
    let (cells, squares) = (stage.state.particles.len(), [18, 20]);
    assert!(cells > squares[0] * squares[1]);
    for (i, p) in stage.state.particles.iter_mut().enumerate() {
        let (x, y) = (i % squares[0], i / squares[0] % squares[1]);
        let at = DVec3::new(-0.3 + (x as f64 + 0.5) * 0.3 / 18.0, -0.16 + (y as f64 + 0.5) * 0.016, 0.1);
        p.position = stage.state.frame.encode(at);
    }
    while stage.fill() == GO_ON {}
    let density = stage.monitor.responses(EndReason::Duration)["bulk_density_kg_m3"].as_f64().unwrap();
    assert_close(density, stage.mass(0..cells) / (0.3 * 0.32 * 0.108), 1e-6);
}

impl Stage {
    /// Lays a fillet out with its centre of mass at a place and its length along x: flat, or bent to an arc about y of a
    /// radius in metres. Returns its bend angle.
    fn lay(&mut self, body: u32, at: DVec3, arc: Option<f64>) -> f64 {
        let flat = &self.scene.kinds[self.scene.bodies[body as usize].kind].meta.points;
        let bend = |p: &DVec3| match arc {
            None => *p,
            Some(radius) => {
                let (sin, cos) = (p.x / radius).sin_cos();
                DVec3::new((radius - p.z) * sin, p.y, radius - (radius - p.z) * cos)
            }
        };
        let bent: Vec<DVec3> = flat.iter().map(bend).collect();
        let centre = bent.iter().sum::<DVec3>() / bent.len() as f64;
        let own = (0..self.state.bodies.len()).filter(|&i| self.state.bodies[i] == body);
        for (i, p) in own.collect::<Vec<_>>().into_iter().zip(&bent) {
            self.state.particles[i].position = self.state.frame.encode(p - centre + at);
        }
        BendGauge::new(flat).angle_deg(|i| bent[i + 1] - bent[i]).expect("it has a length")
    }

    fn curl(&self, name: &str) -> Option<f64> {
        self.monitor.responses(EndReason::Duration)[name].as_f64()
    }
}

#[test]
fn curl_angle_is_the_bend_angle_of_fillets_just_past_the_gate() {
    let mut stage = Stage::started(&[]);
    let inside = DVec3::new(-0.15, 0.0, 0.1);
    let bent = stage.lay(0, inside, Some(0.05));
    stage.lay(1, inside, None);
    stage.process();
    assert!(bent > 60.0, "{bent}");
    assert_eq!((stage.curl("curl_angle_deg"), stage.curl("largest_curl_angle_deg")), (None, None));
    // One past the gate, bent; then with it the other, flat, its centre of mass just out and so less than 80 % of all.
    stage.lay(0, DVec3::new(0.12, 0.0, 0.1), Some(0.05));
    stage.process();
    assert_close(stage.curl("curl_angle_deg").expect("one is out"), bent, 1e-5);
    stage.lay(1, DVec3::new(1e-3, 0.0, 0.1), None);
    stage.process();
    assert_close(stage.curl("curl_angle_deg").expect("two are out"), bent * 2.0 / 3.0, 1e-5);
    assert_close(stage.curl("largest_curl_angle_deg").expect("two are out"), bent, 1e-5);
    // Once 80 % were out, what is seen counts no more.
    stage.lay(1, DVec3::new(0.15, 0.0, 0.1), Some(0.03));
    stage.process();
    stage.process();
    assert_close(stage.curl("curl_angle_deg").expect("two are out"), bent * 2.0 / 3.0, 1e-5);
}

#[test]
fn curl_angle_excludes_distant_and_torn_fillets() {
    for (x, torn, counts) in
        [(0.199, false, true), (0.201, false, false), (-1e-3, false, false), (0.1, true, false)]
    {
        let mut stage = Stage::started(&[]);
        let all = stage.state.particles.len();
        stage.put(0..all, -0.1);
        stage.lay(0, DVec3::new(x, 0.0, 0.1), None);
        if torn {
            stage.state.remove(&[0]);
        }
        stage.process();
        assert_eq!(stage.curl("curl_angle_deg").is_some(), counts, "at {x} m, torn: {torn}");
    }
}
