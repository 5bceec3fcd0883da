//! Scenes small enough to be solved by hand: a few spheres, a block, a plate; and the force on a sphere at rest.
#![allow(dead_code, unreachable_pub, reason = "each test binary uses some of these")]

use std::sync::Arc;

use glam::{DQuat, DVec3};
use roost_solver::cpu::{Cpu, CpuRun};
use roost_solver::engine::Backend;
use roost_solver::engine::scene::{BodyKind, Laws, Placement, Scene};
use roost_solver::engine::state::State;
use roost_solver::equipment::{Surface, SurfaceKind};
use roost_solver::experiments::{Setup, laws};
use roost_solver::mesh::Meshes;
use roost_solver::physics::bond::{BondLaw, BondModel};
use roost_solver::physics::contact::ContactLaw;
use roost_solver::physics::hertz;
use roost_solver::physics::moment::MomentLaw;
use roost_solver::result::{Curve, RunResult};
use roost_solver::scenario::{self, Scenario};
use roost_solver::shape::lattice::{LatticeBond, MetaParticle};
use roost_solver::{Checked, CpuOptions, Flow, Limits, Progress, check, simulate};
use serde_json::{Value, json};

pub const RADIUS: f64 = 0.004;
pub const MASS: f64 = 4.6e-4;
pub const E: f64 = 48_600.0;
pub const NU: f64 = 0.37;
pub const G: f64 = 9.81;

/// A contact law of the tissue: against itself (R* = R/2) or against something rigid (R* = R).
pub fn law(rigid: bool, restitution: f64, mu: f64, gamma: f64) -> ContactLaw {
    if rigid {
        ContactLaw::new(hertz::tissue_on_rigid(E, NU), RADIUS, restitution, mu, gamma)
    } else {
        ContactLaw::new(hertz::tissue_on_tissue(E, NU), RADIUS / 2.0, restitution, mu, gamma)
    }
}

/// Bonds of Table 2.
pub fn bonds() -> BondLaw {
    let area = std::f64::consts::PI * RADIUS * RADIUS;
    BondLaw {
        model: BondModel::Corotated,
        k_n: (1e6 * area) as f32,
        k_t: (6e5 * area) as f32,
        break_length: (2.0 * 1.732 * RADIUS) as f32,
        normal_strength: f32::INFINITY,
        shear_strength: f32::INFINITY,
    }
}

/// The scene with moments in its bonds: `factor` times those of Potyondy and Cundall.
pub fn with_moments(mut scene: Scene, factor: f64) -> Scene {
    let Laws { bond, tissue, contact_between_bonded, .. } = scene.laws;
    let (radius, damping) = (scene.radius_m, if contact_between_bonded { tissue.damping } else { 0.0 });
    let stiffness = [bond.k_n, bond.k_t].map(f64::from);
    scene.laws.moment = Some(MomentLaw::new(stiffness, radius, factor, radius, damping));
    scene
}

/// A box of `n` bonded sub-particles.
pub fn block(n: [i32; 3]) -> BodyKind {
    let cells: Vec<[i32; 3]> =
        (0..n[2]).flat_map(|z| (0..n[1]).flat_map(move |y| (0..n[0]).map(move |x| [x, y, z]))).collect();
    let centre = DVec3::new(f64::from(n[0] - 1), f64::from(n[1] - 1), f64::from(n[2] - 1)) * RADIUS;
    let point =
        |c: &[i32; 3]| DVec3::new(f64::from(c[0]), f64::from(c[1]), f64::from(c[2])) * 2.0 * RADIUS - centre;
    let mut bonds = Vec::new();
    for (i, a) in cells.iter().enumerate() {
        for (j, b) in cells.iter().enumerate().skip(i + 1) {
            if (0..3).map(|k| (a[k] - b[k]).abs()).sum::<i32>() == 1 {
                bonds.push(LatticeBond { i: i as u32, j: j as u32, class: 1 });
            }
        }
    }
    let points: Vec<DVec3> = cells.iter().map(point).collect();
    let bounding_radius_m = points.iter().map(|p| p.length()).fold(0.0, f64::max);
    let meta = MetaParticle { points, bonds, volume_m3: cells.len() as f64 * 5.12e-7, bounding_radius_m };
    BodyKind { meta: Arc::new(meta), subparticle_mass_kg: MASS }
}

/// A body of the first kind at a place, moving.
pub fn at(position: DVec3, velocity: DVec3) -> Placement {
    Placement { kind: 0, position, orientation: DQuat::IDENTITY, velocity }
}

/// A scene without surfaces and without gravity: Table 2, without adhesion and friction, perfectly elastic.
pub fn scene(kind: BodyKind, bodies: Vec<Placement>, dt: f64) -> Scene {
    let rigid = law(true, 1.0, 0.0, 0.0);
    // From a scenario, so that a law of an option is off without a word here.
    let mut laws: Laws = laws::laws(&scenario::from_value(&json!({"experiment": "drop"})).expect("defaults"));
    (laws.tissue, laws.equipment, laws.belt) = (law(false, 1.0, 0.0, 0.0), rigid, rigid);
    (laws.bond, laws.contact_between_bonded) = (bonds(), false);
    Scene {
        radius_m: RADIUS,
        kinds: vec![kind],
        bodies,
        waiting: 0,
        held: Vec::new(),
        surfaces: Vec::new(),
        laws,
        gravity: DVec3::ZERO,
        low: DVec3::splat(-0.5),
        high: DVec3::splat(0.5),
        periodic_y: false,
        timestep_s: dt,
        speed_limit_m_s: 30.0,
    }
}

/// A plate z = 0 of 0.8 m square.
pub fn plate(kind: SurfaceKind) -> Surface {
    Surface::parallelogram("plate", kind, DVec3::new(-0.4, -0.4, 0.0), DVec3::X * 0.8, DVec3::Y * 0.8)
}

/// A small hopper with everything in it: 12 fillets, all contacts, belt, gate, shutter.
pub fn small_hopper(opening_m: f64) -> Scenario {
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

/// Every bit of positions, velocities and spins.
#[track_caller]
pub fn assert_same(a: &State, b: &State, what: &str) {
    assert_eq!(a.particles.len(), b.particles.len(), "{what}");
    // `==` on floats would take -0 for 0.
    let bits = |v: glam::Vec3| v.to_array().map(f32::to_bits);
    for (k, (p, q)) in a.particles.iter().zip(&b.particles).enumerate() {
        assert_eq!(p.position, q.position, "{what}: sub-particle {k}");
        let [p, q] = [p, q].map(|it| (bits(it.velocity), bits(it.spin)));
        assert_eq!(p, q, "{what}: sub-particle {k}");
    }
}

/// Three blocks: two that fall onto each other and a plate, and one far away.
pub fn blocks() -> Scene {
    let bodies = vec![
        at(DVec3::new(0.0, 0.0, 0.03), DVec3::NEG_Z),
        at(DVec3::new(0.01, 0.005, 0.07), DVec3::NEG_Z * 2.0),
        at(DVec3::new(0.3, 0.0, 0.02), DVec3::NEG_Z),
    ];
    let mut scene = scene(block([4, 4, 3]), bodies, 5e-5);
    scene.surfaces = vec![plate(SurfaceKind::Equipment)];
    scene.gravity = DVec3::NEG_Z * G;
    scene.laws.tissue = law(false, 0.1, 0.3, 0.055);
    scene.laws.equipment = law(true, 0.1, 0.5, 0.055);
    scene.laws.belt = law(true, 0.1, 0.3, 0.0);
    scene.laws.contact_between_bonded = true;
    scene
}

/// Blocks and single spheres that fall onto a surface, turning it after a while.
pub fn onto(surface: Surface, place: impl Fn(DVec3) -> DVec3) -> Scene {
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

/// The path that this test binary is about.
pub fn backend(threads: usize) -> Cpu {
    if env!("CARGO_CRATE_NAME") == "on_fast" { Cpu::new(threads) } else { Cpu::plain(threads) }
}

/// A run of a scene on the CPU, step by step.
///
/// The suites of closed forms are compiled twice: each by itself, on the plain path, and all together into
/// `on_fast.rs`, on the fast path.
pub struct Bench {
    pub cpu: Cpu,
    pub run: CpuRun,
}

impl Bench {
    pub fn new(scene: &Scene) -> Self {
        Self::on(scene, 1)
    }

    pub fn on(scene: &Scene, threads: usize) -> Self {
        Self::with(backend(threads), scene)
    }

    pub fn with(cpu: Cpu, scene: &Scene) -> Self {
        let run = cpu.prepare(scene);
        Self { cpu, run }
    }

    pub fn steps(&mut self, n: u64) -> Option<String> {
        self.cpu.advance(&mut [(&mut self.run, n)]).swap_remove(0).fault
    }

    pub fn state(&mut self) -> &State {
        self.cpu.state(&mut self.run)
    }

    pub fn position(&mut self, i: usize) -> DVec3 {
        self.state().position(i)
    }

    pub fn velocity(&mut self, i: usize) -> DVec3 {
        self.state().particles[i].velocity.as_dvec3()
    }
}

/// Asserts that two numbers agree within a share of the second.
#[track_caller]
pub fn assert_close(found: f64, expected: f64, share: f64) {
    assert!(
        (found - expected).abs() <= share * expected.abs(),
        "found {found:e}, expected {expected:e} within {share:e} of it"
    );
}

/// A time step so short that nothing moves in it.
pub const BLINK: f64 = 1e-9;

/// Force of a sphere pressed `overlap` metres deep into something rigid and flat.
pub fn hertz(overlap: f64) -> f64 {
    4.0 / 3.0 * E / (1.0 - NU * NU) * RADIUS.sqrt() * overlap.powf(1.5)
}

/// A sphere at rest among surfaces, without gravity and friction.
pub fn sphere(surfaces: Vec<Surface>, position: DVec3, dt: f64) -> Scene {
    Scene { surfaces, ..scene(block([1, 1, 1]), vec![at(position, DVec3::ZERO)], dt) }
}

/// The force that the surfaces exert on a sphere at rest.
pub fn push(surfaces: &[Surface], position: DVec3) -> DVec3 {
    push_in(sphere(surfaces.to_vec(), position, BLINK))
}

pub fn push_in(scene: Scene) -> DVec3 {
    let mut bench = Bench::new(&scene);
    assert_eq!(bench.steps(1), None);
    bench.velocity(0) * (MASS / BLINK)
}

#[track_caller]
pub fn assert_force(found: DVec3, expected: DVec3, share: f64) {
    let off = (found - expected).length();
    assert!(
        off <= share * expected.length(),
        "{found} is not {expected}: off by {:e}",
        off / expected.length()
    );
}

/// A sphere that weighs on the plate z = 0, pressed into it by its weight, with friction.
pub fn weighing(surfaces: Vec<Surface>, x: DVec3, velocity: DVec3, mu: f64, dt: f64) -> Scene {
    let overlap = (MASS * G / hertz(1.0)).powf(2.0 / 3.0);
    let mut scene = sphere(surfaces, x + DVec3::Z * (RADIUS - overlap), dt);
    scene.bodies[0].velocity = velocity;
    scene.gravity = DVec3::NEG_Z * G;
    scene.laws.equipment = law(true, 0.3, mu, 0.0);
    scene.laws.belt = law(true, 0.3, mu, 0.0);
    scene
}

/// A document with these fields, by pointer, in place of its own.
pub fn with(mut document: Value, fields: &[(&str, Value)]) -> Value {
    for (pointer, value) in fields {
        let mut at = &mut document;
        for name in pointer.split('/').skip(1) {
            at = &mut at[name];
        }
        *at = value.clone();
    }
    document
}

/// A hopper scenario's document with these fields, by pointer.
pub fn document(fields: &[(&str, Value)]) -> Value {
    with(json!({"experiment": "hopper"}), fields)
}

/// The scenario of a document with these fields, by pointer, in place of its own.
pub fn scenario(document: Value, fields: &[(&str, Value)]) -> Scenario {
    scenario::from_value(&with(document, fields)).expect("a sound scenario")
}

/// The result of a scenario without meshes.
pub fn run_on(threads: usize, scenario: &Scenario) -> RunResult {
    simulate(&checked(scenario), CpuOptions { threads }, &mut |_: &Progress| Flow::Continue)
}

/// A response, which must be there.
#[track_caller]
pub fn response(result: &RunResult, name: &str) -> f64 {
    result.response(name).unwrap_or_else(|| panic!("{name} in {:?}", result.responses))
}

/// A curve, which must be there.
#[track_caller]
pub fn curve<'a>(result: &'a RunResult, name: &str) -> &'a Curve {
    result.curves.iter().find(|curve| curve.name == name).unwrap_or_else(|| panic!("{name}"))
}

/// A scenario without meshes, checked without limits.
#[track_caller]
pub fn checked(scenario: &Scenario) -> Checked {
    check(scenario, &Meshes::default(), &Limits::NONE).expect("a scenario that can run")
}

/// The scene of a scenario without meshes.
#[track_caller]
pub fn scene_of(scenario: &Scenario) -> Scene {
    checked(scenario).setup().scene().clone()
}

/// The kinds of bodies of a scenario without meshes, which the check may refuse.
#[track_caller]
pub fn kinds(scenario: &Scenario) -> Vec<BodyKind> {
    Setup::new(scenario, &Meshes::default()).expect("bodies that a lattice fills").kinds
}
