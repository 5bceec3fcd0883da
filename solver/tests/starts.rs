//! Bodies may not start in each other or in surfaces: checks against a search through all sub-particles. The costs of scenes and
//! drops follow.

mod common;
#[path = "common/stl.rs"]
mod stl;

use std::time::{Duration, Instant};

use common::{assert_close, document};
use glam::{DQuat, DVec3};
use roost_solver::engine::scene::Scene;
use roost_solver::engine::state::State;
use roost_solver::experiments::Setup;
use roost_solver::mesh::Meshes;
use roost_solver::scenario::{self, Fault, Scenario};
use roost_solver::{Limits, check};
use serde_json::{Value, json};

const RADIUS_M: f64 = 0.008;

fn scene(fields: &[(&str, Value)]) -> Scenario {
    let own = [("/experiment", json!("scene")), ("/product/subparticle_radius_m", json!(RADIUS_M))];
    scenario::from_value(&document(&[&own[..], fields].concat())).expect("a sound scenario")
}

fn faults(scenario: &Scenario) -> Vec<Fault> {
    check(scenario, &Meshes::default(), &Limits::default()).err().unwrap_or_default()
}

fn pointers(scenario: &Scenario) -> Vec<String> {
    faults(scenario).into_iter().map(|fault| fault.pointer).collect()
}

/// Numbers that look drawn at random, from 0 to 1.
struct Draw(u64);

impl Draw {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }

    fn within(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.next()
    }

    fn angles(&mut self) -> Value {
        json!([self.within(-180.0, 180.0), self.within(-180.0, 180.0), self.within(-180.0, 180.0)])
    }
}

/// The scene of a scenario, which the check may refuse.
fn built(scenario: &Scenario) -> Scene {
    let setup = Setup::new(scenario, &Meshes::default()).expect("bodies that a lattice fills");
    setup.scene().clone()
}

/// Positions of the sub-particles of each body at the start.
fn points(scene: &Scene) -> Vec<Vec<DVec3>> {
    let state = State::new(scene);
    state.body_ranges().map(|(_, range)| range.map(|i| state.position(i)).collect()).collect()
}

#[test]
fn bodies_overlap_if_and_only_if_their_sub_particles_do() {
    let mut draw = Draw(1);
    let (mut inside, mut apart) = (0, 0);
    for _ in 0..300 {
        let place = json!([draw.within(-0.1, 0.1), draw.within(-0.1, 0.1), draw.within(0.0, 0.08)]);
        let bodies = json!([
            {"position_m": [0, 0, 0], "orientation_deg": draw.angles()},
            {"shape": (draw.next() * 6.0) as u32, "position_m": place, "orientation_deg": draw.angles()},
        ]);
        let scenario = scene(&[("/scene/bodies", bodies)]);
        let [a, b] = &points(&built(&scenario))[..] else { panic!("two bodies") };
        let least = a.iter().flat_map(|a| b.iter().map(|b| a.distance(*b))).fold(f64::INFINITY, f64::min);
        let found = faults(&scenario);
        if (least / RADIUS_M - 1.9).abs() < 1e-4 {
            continue;
        }
        assert_eq!(!found.is_empty(), least < 1.9 * RADIUS_M, "{} R apart: {found:?}", least / RADIUS_M);
        if let [fault] = &found[..] {
            assert_eq!(fault.pointer, "/scene/bodies/1/position_m");
            assert!(fault.detail.contains("/scene/bodies/0"), "{}", fault.detail);
            inside += 1;
        } else {
            apart += 1;
        }
    }
    assert!(inside > 50 && apart > 50, "{inside} inside, {apart} apart");
}

#[test]
fn body_intersects_a_surface_if_and_only_if_a_sub_particle_or_bond_does() {
    let mut draw = Draw(2);
    let (mut inside, mut apart, mut between) = (0, 0, 0);
    for k in 0..400 {
        // A plate larger than the body, or one that fits between its sub-particles' rows.
        let half = if k % 2 == 0 { 0.3 } else { 0.03 };
        // Now and then right between two layers of the lattice, where nothing but bonds can tell.
        let height = if k % 8 < 2 { RADIUS_M + draw.within(-7e-4, 7e-4) } else { draw.within(-0.1, 0.1) };
        let place = json!([draw.within(-0.05, 0.05), draw.within(-0.05, 0.05), height]);
        let turned = if k % 4 < 2 { json!([0, 0, 0]) } else { draw.angles() };
        let scenario = scene(&[
            ("/scene/bodies", json!([{"position_m": place, "orientation_deg": turned}])),
            (
                "/scene/surfaces",
                json!([
                    {"name": "far", "plate_m": [[0, 0, 5], [1, 0, 0], [0, 1, 0]]},
                    {"name": "near", "plate_m": [[-half, -half, 0], [2.0 * half, 0, 0], [0, 2.0 * half, 0]]},
                ]),
            ),
        ]);
        let scene = built(&scenario);
        let points = &points(&scene)[0];
        let off = |p: DVec3| p.distance(DVec3::new(p.x.clamp(-half, half), p.y.clamp(-half, half), 0.0));
        let least = points.iter().map(|&p| off(p)).fold(f64::INFINITY, f64::min);
        let crosses = scene.kinds[0].meta.bonds.iter().any(|bond| {
            let (p, q) = (points[bond.i as usize], points[bond.j as usize]);
            p.z * q.z < 0.0 && off(p.lerp(q, p.z / (p.z - q.z))) < 1e-9
        });
        if (least / RADIUS_M - 0.9).abs() < 1e-4 {
            continue;
        }
        between += u32::from(crosses && least > 0.9 * RADIUS_M);
        let found = faults(&scenario);
        assert_eq!(!found.is_empty(), least < 0.9 * RADIUS_M || crosses, "{} R: {found:?}", least / RADIUS_M);
        if let [fault] = &found[..] {
            assert_eq!(fault.pointer, "/scene/bodies/0/position_m");
            assert!(fault.detail.contains("\"near\" at /scene/surfaces/1"), "{}", fault.detail);
            inside += 1;
        } else {
            apart += 1;
        }
    }
    assert!(
        inside > 50 && apart > 50 && between > 3,
        "{inside} inside, {apart} apart, {between} between layers"
    );
}

#[test]
fn body_within_a_solid_is_refused_and_within_a_container_accepted() {
    let half = |size: f64, n: usize| stl::cuboid(DVec3::splat(-size), DVec3::splat(size), n);
    let (solid, hollow) = (half(0.4, 3), stl::turned(&half(0.4, 3)));
    let drum = [half(0.5, 3), hollow.clone()].concat();
    let open = solid[1..].to_vec();
    for (name, triangles, refused) in [
        ("solid", solid, true),
        ("container", hollow, false),
        ("drum", drum, false),
        ("open box", open, false),
    ] {
        let mut meshes = Meshes::default();
        let digest = meshes.insert(&stl::binary(&triangles)).expect("a sound file");
        // Surfaces turned and moved, so that nothing lies along the axes; the second body is outside of all.
        let surface = json!({"name": name, "mesh": {"digest": digest, "units": "m"}, "position_m": [5, 0, 0],
            "orientation_deg": [20, 30, 40]});
        let scenario = scene(&[
            ("/scene/bodies", json!([{"position_m": [5.05, 0.1, -0.1]}, {"position_m": [3, 0, 0]}])),
            ("/scene/surfaces", json!([surface])),
        ]);
        let found = check(&scenario, &meshes, &Limits::default()).err().unwrap_or_default();
        assert_eq!(found.len(), usize::from(refused), "{name}: {found:?}");
        if let [fault] = &found[..] {
            assert_eq!(fault.pointer, "/scene/bodies/0/position_m");
            assert!(fault.detail.contains("\"solid\" at /scene/surfaces/0"), "{}", fault.detail);
        }
    }
}

#[test]
fn every_misplaced_body_is_one_fault_that_names_its_obstacle() {
    let scenario = scene(&[
        (
            "/scene/bodies",
            json!([
                {"position_m": [0, 0, 0]},
                {"position_m": [0.1, 0, 0]},
                {"position_m": [0.2, 0, 0]},
                {"position_m": [0, 0, 1]},
            ]),
        ),
        (
            "/scene/surfaces",
            json!([
                {"name": "table", "plate_m": [[-1, -1, 1], [2, 0, 0], [0, 2, 0]], "presence": "until_start"},
            ]),
        ),
        ("/numerics/timestep_s", json!(0.01)),
    ]);
    let found = faults(&scenario);
    let told: Vec<(&str, bool, bool)> = found
        .iter()
        .map(|fault| {
            let names = |body: &str| fault.detail.contains(body);
            (fault.pointer.as_str(), names("/scene/bodies/0"), names("/scene/bodies/1"))
        })
        .collect();
    assert_eq!(
        told,
        [
            ("/numerics/timestep_s", false, false),
            ("/scene/bodies/1/position_m", true, false),
            ("/scene/bodies/2/position_m", false, true),
            ("/scene/bodies/3/position_m", false, false),
            ("/scene/surfaces/0/presence", false, false),
        ]
    );
    assert_eq!(found[3].value, json!([0.0, 0.0, 1.0]));
    assert!(found.iter().all(|fault| fault.allowed.is_some()));
}

#[test]
fn overlap_check_of_1000_adjacent_bodies_takes_under_3_s() {
    // 1000 fillets side by side, a hair apart, in five layers.
    let bodies: Vec<Value> = (0..1000)
        .map(|k| json!({"position_m": [0.16 * f64::from(k % 20), 0.08 * f64::from(k / 20 % 10), 0.05 * f64::from(k / 200)]}))
        .collect();
    let scenario =
        scene(&[("/scene/bodies", json!(bodies)), ("/product/subparticle_radius_m", json!(0.004))]);
    let clock = Instant::now();
    assert_eq!(faults(&scenario), []);
    assert!(clock.elapsed() < Duration::from_secs(3), "{:?}", clock.elapsed());
}

#[test]
fn scene_with_too_many_force_samples_is_refused() {
    let surfaces: Vec<Value> = (0..1000)
        .map(|k| json!({"name": format!("plate {k}"), "plate_m": [[0, 0, -1], [1, 0, 0], [0, 1, 0]]}))
        .collect();
    let of = |interval: f64| {
        scene(&[
            ("/scene/bodies", json!([{"position_m": [0, 0, 0]}])),
            ("/scene/surfaces", json!(surfaces)),
            ("/numerics/output_interval_s", json!(interval)),
        ])
    };
    // 6 components · 1000 surfaces · 2 s at 0.028 s are 4.3e5 numbers.
    assert_eq!(pointers(&of(0.028)), ["/numerics/output_interval_s"]);
    assert_eq!(faults(&of(0.032)), []);
}

#[test]
fn cost_estimate_matches_the_built_scene_and_its_plan() {
    let drop = |fields: &[(&str, Value)]| {
        let own = [("/experiment", json!("drop")), ("/product/count", json!(7))];
        scenario::from_value(&document(&[&own[..], fields].concat())).expect("a sound scenario")
    };
    let free = scene(&[(
        "/scene/bodies",
        json!([{"shape": 4, "position_m": [0, 0, 0]}, {"position_m": [0, 0, 1]}]),
    )]);
    for (scenario, bodies) in [(drop(&[]), 7), (drop(&[("/product/shape", json!(3))]), 7), (free, 2)] {
        let checked = check(&scenario, &Meshes::default(), &Limits::default()).expect("accepted");
        let (estimate, setup) = (checked.estimate(), checked.setup());
        let state = State::new(setup.scene());
        assert_eq!((estimate.fillets, setup.scene().bodies.len()), (bodies, bodies as usize));
        assert_eq!(estimate.subparticles, state.particles.len() as u64);
        assert_eq!(estimate.bonds, state.bonds_at_start);
        assert_close(estimate.mass_kg, state.masses.iter().map(|&mass| f64::from(mass)).sum(), 1e-6);
        // Nothing is filled before: two seconds at the paper's step.
        assert_eq!(estimate.steps, (2.0f64 / 5.75e-5).ceil() as u64);
        assert_eq!((setup.plan().longest_fill_s, setup.plan().duration_s), (0.0, 2.0));
    }
    // A limit that is exceeded is reported at the field that exceeds it.
    let few = Limits { max_subparticles: 80, max_steps: 100 };
    let told = |scenario: &Scenario| -> Vec<String> {
        let faults = check(scenario, &Meshes::default(), &few).expect_err("refused");
        faults.into_iter().map(|fault| fault.pointer).collect()
    };
    assert_eq!(told(&drop(&[])), ["/product/count", "/numerics/duration_s"]);
    let two = scene(&[("/scene/bodies", json!([{"position_m": [0, 0, 0]}, {"position_m": [0, 0, 0]}]))]);
    assert_eq!(told(&two), ["/scene/bodies", "/numerics/duration_s"]);
    let slide = scenario::from_value(&json!({"experiment": "slide"})).expect("a sound scenario");
    assert_eq!(told(&slide), ["/product/subparticle_radius_m", "/slide/tilt_rate_deg_s"]);
}

#[test]
fn hopper_of_custom_surfaces_is_checked_for_obstacles() {
    let hopper = |fields: &[(&str, Value)]| {
        let few = [("/product/count", json!(20)), ("/product/subparticle_radius_m", json!(0.009))];
        scenario::from_value(&document(&[&few[..], fields].concat())).expect("a sound scenario")
    };
    let plate = |name: &str, corner: [f64; 3], u: [f64; 3], v: [f64; 3]| json!({"name": name, "plate_m": [corner, u, v]});
    let nothing = hopper(&[("/equipment/parametric", json!(false))]);
    assert_eq!(pointers(&nothing), ["/equipment/surfaces"]);
    // One beside the hopper, one across the fill: only that is in the way, and it is told once.
    let beside = plate("table", [0.3, -0.3, -0.05], [0.5, 0.0, 0.0], [0.0, 0.6, 0.0]);
    let across = plate("baffle", [-0.3, -0.3, 0.05], [0.3, 0.0, 0.0], [0.0, 0.6, 0.0]);
    assert_eq!(faults(&hopper(&[("/equipment/surfaces", json!([beside]))])), []);
    let found = faults(&hopper(&[("/equipment/surfaces", json!([beside, across]))]));
    assert_eq!(found.len(), 1, "{found:?}");
    assert_eq!(found[0].pointer, "/equipment/surfaces/1");
    assert!(found[0].detail.contains("\"baffle\""), "{}", found[0].detail);
}

#[test]
fn surface_at_a_periodic_boundary_must_extend_beyond_both_sides() {
    // 0.4 m wide: bars under the fillets' way out, from one y to another.
    let refused = |sides: &str, from: f64, to: f64| {
        let bar = json!({"name": "bar", "plate_m": [[0.3, from, -0.05], [0.1, 0, 0], [0, to - from, 0]]});
        let fields = [
            ("/product/count", json!(4)),
            ("/product/subparticle_radius_m", json!(0.009)),
            ("/equipment/hopper_width_m", json!(0.4)),
            ("/equipment/side_walls", json!(sides)),
            ("/equipment/surfaces", json!([bar])),
        ];
        let found = faults(&scenario::from_value(&document(&fields)).expect("a sound scenario"));
        assert!(found.iter().all(|fault| fault.pointer == "/equipment/surfaces/0"), "{found:?}");
        !found.is_empty()
    };
    for (from, to, seam) in
        [(-0.1, 0.1, false), (-0.1, 0.195, true), (-0.1, 0.3, true), (-0.2, 0.2, true), (-0.22, 0.22, false)]
    {
        assert_eq!(refused("periodic", from, to), seam, "from {from} to {to}");
        assert!(!refused("frictionless", from, to), "from {from} to {to} without a seam");
    }
}

#[test]
fn only_shapes_in_use_must_fit_the_hopper() {
    let of = |shape: Value| {
        scenario::from_value(&document(&[
            ("/product/count", json!(2)),
            ("/product/shape", shape),
            ("/product/sizes_m", json!([[0.1, 0.05, 0.03], [0.3, 0.2, 0.1]])),
            ("/equipment/hopper_length_m", json!(0.12)),
        ]))
        .expect("a sound scenario")
    };
    assert_eq!(faults(&of(json!(1))), []);
    assert_eq!(pointers(&of(Value::Null)), ["/equipment/hopper_length_m"]);
}

#[test]
fn orientation_is_yaw_then_pitch_then_roll() {
    let turn = roost_solver::experiments::placement::orientation([90.0, 90.0, 0.0]);
    assert!((turn * DVec3::X).distance(DVec3::NEG_Z) < 1e-12, "pitch 90 points the tail down");
    let turn = roost_solver::experiments::placement::orientation([90.0, 0.0, 90.0]);
    assert!((turn * DVec3::X).distance(DVec3::Y) < 1e-12 && (turn * DVec3::Y).distance(DVec3::Z) < 1e-12);
    assert_eq!(roost_solver::experiments::placement::orientation([0.0; 3]), DQuat::IDENTITY);
}
