//! The fast path is held to the plain one over a short horizon, for everything that a scene can have in it; and its
//! bits are the same on any number of threads and with every instruction set that this machine has.
//!
//! Near rest the forces on a sub-particle cancel, so differences are measured against the scale of pair forces.

mod common;
#[path = "common/cut.rs"]
mod cut;
#[path = "common/heaps.rs"]
mod heaps;
#[path = "common/stl.rs"]
mod stl;

use std::f64::consts::PI;

use common::{RADIUS, assert_same, at, block, bonds, law, onto, scene, with_moments};
use cut::{cut_plate, pipe, surface};
use glam::DVec3;
use heaps::{drop, fillet, heap, many, spheres};
use roost_solver::cpu::fast::InstructionSet;
use roost_solver::cpu::{Cpu, CpuRun};
use roost_solver::engine::Backend;
use roost_solver::engine::scene::{BodyKind, Placement, Scene};
use roost_solver::engine::state::State;
use roost_solver::equipment::{Motion, Surface, SurfaceKind};
use roost_solver::physics::bond::{BondLaw, BondModel};
use roost_solver::scenario::Fill;
use roost_solver::shape::lattice::MetaParticle;
use roost_solver::shape::teardrop::Teardrop;

/// All but a hundredth of the sub-particles may differ by this share of what pair forces do in the time, and the rest by
/// a hundred times as much: adhesion sets in with a jump, and where rounding decides that two graze in this step or
/// the next, one step's worth of it is between the paths.
const TOLERANCE: f64 = 1e-4;

/// Steps that runs are compared over. Some steps further rounding decides when two that graze let go of each other, and what that does
/// spreads.
const HORIZON: u64 = 200;

/// The changes to a run on its way.
#[derive(Clone, Debug)]
struct Course {
    steps: u64,
    /// Step at which motions start.
    start: Option<u64>,
    /// Step at which these serials are taken out.
    remove: Option<(u64, Vec<u32>)>,
}

impl Course {
    fn of(steps: u64) -> Self {
        Self { steps, start: Some(0), remove: None }
    }
}

/// Runs a scene and looks at it every 20 steps.
fn run(scene: &Scene, course: &Course, cpu: &Cpu, mut look: impl FnMut(&Cpu, &mut CpuRun)) {
    let mut run = cpu.prepare(scene);
    let mut step = 0;
    while step < course.steps {
        if course.start == Some(step) {
            cpu.start(&mut run);
        }
        if let Some((at, serials)) = &course.remove
            && *at == step
        {
            cpu.remove(&mut run, serials);
        }
        let done = cpu.advance(&mut [(&mut run, 20)]).swap_remove(0);
        assert_eq!(done.fault, None);
        step += 20;
        look(cpu, &mut run);
    }
}

fn cpu(threads: usize, fast: Option<InstructionSet>) -> Cpu {
    fast.map_or_else(|| Cpu::plain(threads), |instructions| Cpu::fast(threads, instructions))
}

fn states(scene: &Scene, course: &Course, fast: Option<InstructionSet>, threads: usize) -> Vec<State> {
    let mut states = Vec::new();
    run(scene, course, &cpu(threads, fast), |cpu, run| states.push(cpu.state(run).clone()));
    states
}

/// Differences of velocities, and of spins at the rim, between two runs at their looks, as shares of the speed that pair
/// forces of `scale` newton give in the time: that of all but a hundredth of the sub-particles, and the greatest.
fn apart(a: &[State], b: &[State], scene: &Scene, scale: f64) -> [f64; 2] {
    let mut most = [0.0f64; 2];
    for (k, (a, b)) in a.iter().zip(b).enumerate() {
        assert!(a.serials == b.serials && a.broken == b.broken, "look {k}");
        assert_eq!(a.bonds_broken, b.bonds_broken, "look {k}");
        let time = 20.0 * (k + 1) as f64 * scene.timestep_s;
        let mut shares: Vec<f64> = Vec::new();
        for (i, (p, q)) in a.particles.iter().zip(&b.particles).enumerate() {
            let speed = scale * time / f64::from(a.masses[i]);
            let dv = (p.velocity - q.velocity).as_dvec3().length();
            let dw = (p.spin - q.spin).as_dvec3().length() * scene.radius_m;
            let dx = (a.position(i) - b.position(i)).length() / time;
            let dx = if dx > 0.9 * (scene.high.y - scene.low.y) / time { 0.0 } else { dx };
            assert!(dv.is_finite() && dw.is_finite());
            shares.push(dv.max(dw).max(dx) / speed);
        }
        shares.sort_unstable_by(f64::total_cmp);
        let count = shares.len();
        most = [most[0].max(shares[count - 1 - count / 100]), most[1].max(shares[count - 1])];
    }
    most
}

/// The size of pair forces: what a tenth of R of stretch or overlap makes.
fn pair_force(scene: &Scene) -> f64 {
    let depth = 0.1 * scene.radius_m;
    let law = &scene.laws.tissue;
    let hertz = 4.0 / 3.0 * f64::from(law.e_star) * f64::from(law.r_star).sqrt() * depth.powf(1.5);
    f64::from(scene.laws.bond.k_n) * depth + hertz
}

#[track_caller]
fn assert_agrees(name: &str, scene: &Scene, course: &Course) -> Vec<State> {
    let plain = states(scene, course, None, 1);
    let fast = states(scene, course, Some(InstructionSet::widest()), 1);
    let [most, all] = apart(&plain, &fast, scene, pair_force(scene));
    println!("{name}: {most:.1e} of what pair forces do, {all:.1e} in all");
    assert!(most < TOLERANCE && all < 100.0 * TOLERANCE, "{name}: {most:e}, {all:e}");
    plain
}

#[test]
fn fast_path_matches_plain_path_for_falling_fillets_in_every_formulation() {
    for model in [BondModel::Corotated, BondModel::FiniteExtension, BondModel::AsPublished] {
        for contact_between_bonded in [true, false] {
            // Without adhesion a difference of one part in ten million grows a thousandfold within 180 steps, on the plain
            // path alone too: contacts that open and close at no force lose what they remember.
            for gamma in [0.055, 0.0] {
                let mut scene = drop();
                scene.laws.bond.model = model;
                scene.laws.contact_between_bonded = contact_between_bonded;
                scene.laws.tissue = law(false, 0.01, 0.3, gamma);
                let name = format!("{model:?}, contact in bonds {contact_between_bonded}, γ {gamma}");
                let states = assert_agrees(&name, &scene, &Course::of(if gamma > 0.0 { 180 } else { 140 }));
                assert!(states.last().is_some_and(|s| s.max_speed() > 0.1));
            }
        }
    }
}

#[test]
fn fast_path_matches_plain_path_for_broken_bonds_that_become_contacts() {
    let mut scene = drop();
    scene.laws.bond.normal_strength = 0.02;
    let without_contact = {
        let mut scene = scene.clone();
        scene.laws.contact_between_bonded = false;
        scene
    };
    for scene in [&scene, &without_contact, &with_moments(scene.clone(), 1.0)] {
        let states = assert_agrees("breaking", scene, &Course::of(HORIZON));
        let broken = states.last().map_or(0, |s| s.bonds_broken);
        assert!(broken > 20, "{broken} bonds broke");
    }
    let mut intact = Vec::new();
    for fast in [None, Some(InstructionSet::widest())] {
        run(&scene, &Course::of(HORIZON), &cpu(1, fast), |cpu, run| intact.push(cpu.bonds(run)));
    }
    let (plain, fast) = intact.split_at(intact.len() / 2);
    assert!(plain == fast);
    assert!(plain.last().is_some_and(|last| last.len() < plain[0].len()));
}

#[test]
fn fast_path_matches_plain_path_for_compressed_spheres_that_separate() {
    let states = assert_agrees("single spheres", &spheres(), &Course::of(HORIZON));
    // Contacts of the first that go together: from several a sphere to hardly any.
    let contacts = [&states[0], &states[states.len() - 1]].map(|state| {
        let touch = |i: usize, j: &usize| (state.position(i) - state.position(*j)).length() < 2.0 * RADIUS;
        (0..512).map(|i| (0..i).filter(|j| touch(i, j)).count()).sum::<usize>()
    });
    assert!(contacts[0] > 1000 && contacts[1] < 400, "{contacts:?}");
}

#[test]
fn fast_path_matches_plain_path_for_diagonal_bonds() {
    let shape = Teardrop { size_m: [0.172, 0.072, 0.032], mirrored: false };
    let meta = MetaParticle::fill(&shape, RADIUS, Fill::Centres, 2);
    let mut scene = drop();
    scene.kinds[0].meta = meta.into();
    scene.laws.bond = BondLaw { break_length: 3.2 * RADIUS as f32, ..bonds() };
    assert_agrees("diagonals", &scene, &Course::of(HORIZON));
}

#[test]
fn fast_path_matches_plain_path_for_capped_dashpots() {
    let mut scene = drop();
    scene.laws.tissue = law(false, 1e-4, 0.3, 0.055);
    scene.laws.equipment = law(true, 1e-4, 0.5, 0.055);
    scene.laws.belt = law(true, 1e-4, 0.4, 0.055);
    // Across, most contacts are held back at the first step; along, few, and more at the second.
    for (dt, steps) in [(4e-4, 60), (7e-4, 40)] {
        scene.timestep_s = dt;
        assert_agrees(&format!("dashpots held back at {dt} s"), &scene, &Course::of(steps));
    }
    // Sheared apart, neighbours go on touching, as those of different bodies do.
    scene.laws.bond.shear_strength = 0.02;
    let states = assert_agrees("broken bonds and dashpots held back", &scene, &Course::of(40));
    let broken = states.last().map_or(0, |s| s.bonds_broken);
    assert!(broken > 20, "{broken} bonds broke");
}

#[test]
fn fast_path_matches_plain_path_across_a_periodic_boundary() {
    for period in [0.4, 0.12, 0.06] {
        let mut scene = drop();
        scene.bodies.iter_mut().for_each(|body| body.position.y += period / 2.0 - 0.01);
        (scene.low.y, scene.high.y, scene.periodic_y) = (-period / 2.0, period / 2.0, true);
        assert_agrees(&format!("period {period}"), &scene, &Course::of(HORIZON));
    }
}

#[test]
fn fast_path_matches_plain_path_for_moving_surfaces_and_their_loads() {
    let mut scene = drop();
    let lid = DVec3::new(-0.2, -0.2, 0.14);
    let spin = DVec3::new(0.3, 0.5, 0.0);
    let motion = Motion::Moving { velocity: DVec3::NEG_Z * 1.5, pivot: DVec3::Z * 0.14, spin };
    let lid = Surface::parallelogram("lid", SurfaceKind::Equipment, lid, DVec3::X * 0.4, DVec3::Y * 0.4);
    scene.surfaces.push(lid.moving(motion));
    let shutter = DVec3::new(0.06, -0.2, 0.0);
    let shutter =
        Surface::parallelogram("shutter", SurfaceKind::Frictionless, shutter, DVec3::Y * 0.4, DVec3::Z * 0.1);
    scene.surfaces.push(shutter.until_start());
    let course = Course { start: Some(100), ..Course::of(HORIZON) };
    assert_agrees("moving", &scene, &course);
    let mut forces = Vec::new();
    for fast in [None, Some(InstructionSet::widest())] {
        run(&scene, &course, &cpu(1, fast), |cpu, run| forces.push(cpu.surface_forces(run)));
    }
    let (plain, fast) = forces.split_at(forces.len() / 2);
    for (a, b) in plain.iter().flatten().zip(fast.iter().flatten()) {
        assert!((*a - *b).length() < 1e-3 * pair_force(&scene), "{a} against {b}");
    }
    assert!(plain.iter().flatten().any(|force| force.length() > pair_force(&scene)));
}

#[test]
fn fast_path_matches_plain_path_for_surfaces_of_many_triangles() {
    let plate = onto(surface(cut_plate()), |x| x);
    assert_agrees("a plate of many triangles", &plate, &Course::of(HORIZON));
    let pipe = onto(surface(pipe(0.05, 300, 0.0, 2.0 * PI / 300.0)), |x| x * 0.5 - DVec3::Z * 0.03);
    assert_agrees("a pipe of many facets", &pipe, &Course::of(HORIZON));
}

#[test]
fn fast_path_matches_plain_path_for_bodies_that_start_far_apart() {
    // Too far from each other to meet at first, and each by itself goes less than all of the way between.
    let far = 0.048 + RADIUS * 6.5;
    let bodies = vec![at(DVec3::ZERO, DVec3::X * 2.0), at(DVec3::X * far, DVec3::NEG_X * 2.0)];
    let scene = scene(block([4, 4, 3]), bodies, 1e-4);
    let states = assert_agrees("strayed", &scene, &Course::of(HORIZON));
    let first = |state: &State| state.particles[..48].iter().map(|p| p.velocity.x).fold(f32::MAX, f32::min);
    assert!(states.last().is_some_and(|state| first(state) < 1.5), "they have met");
}

#[test]
fn body_that_leaves_within_one_step_removes_no_pairs_of_others() {
    // The second touches the first, and in one step is too far from it to meet; its pairs stood before those of the third.
    let beside = |x: f64, speed: f64| at(DVec3::X * x * RADIUS, DVec3::X * speed);
    let bodies = vec![beside(0.0, 0.0), beside(8.0, 29.0), beside(-7.9, 1.0)];
    let scene = scene(block([4, 4, 3]), bodies, 1e-3);
    assert_agrees("gone at once", &scene, &Course::of(20));
}

#[test]
fn fast_path_matches_plain_path_for_held_sub_particles() {
    let mut scene = drop();
    scene.held = (0..40).collect();
    // Some steps on, rounding decides when two neighbours graze; what that does spreads.
    let states = assert_agrees("held", &scene, &Course::of(80));
    assert!(states[0].particles[..40] == states[3].particles[..40]);
}

#[test]
fn fast_path_matches_plain_path_after_removal_of_sub_particles() {
    let count = fillet().meta.points.len() as u32;
    // A whole fillet, which others touch; and a part of one.
    for serials in [(count..2 * count).collect(), (count + 10..count + 60).collect::<Vec<u32>>()] {
        // Then rounding decides when two neighbours graze, as in `held`.
        let course = Course { remove: Some((100, serials)), ..Course::of(120) };
        assert_agrees("taken out", &drop(), &course);
        assert_agrees("taken out, with moments", &with_moments(drop(), 1.0), &course);
    }
}

/// Single spheres that stay together longer, of which some leave: the rest go on in other places, and pairs turn round.
fn some_spheres_leave() -> (Scene, Course) {
    let mut scene = spheres();
    scene.bodies.iter_mut().for_each(|body| body.velocity *= 0.1);
    let serials = (21..700).step_by(7).collect();
    (scene, Course { remove: Some((20, serials)), ..Course::of(80) })
}

#[test]
fn fast_path_matches_plain_path_after_removal_of_single_spheres() {
    let (mut scene, course) = some_spheres_leave();
    assert_agrees("spheres taken out", &scene, &course);
    // Of two that touch one: the other is on its own, and nothing goes on pushing it.
    scene.bodies.truncate(2);
    let states = assert_agrees("one of two", &scene, &Course { remove: Some((20, vec![1])), ..course });
    let apart = states[0].position(0).distance(states[0].position(1));
    assert!(apart < 2.0 * RADIUS, "they touch: {apart}");
    let [before, after] = [&states[1], &states[3]].map(|state| state.particles[0].velocity);
    assert!(before.distance(after) < 1e-6, "{before} and {after}");
}

/// A heap that has settled, started afresh from where its sub-particles lie: every body becomes a shape of its own.
fn settled() -> Scene {
    let mut scene = heap();
    let states = states(&scene, &Course::of(8000), Some(InstructionSet::widest()), 1);
    let state = states.last().expect("looked at");
    let kind = scene.kinds[0].clone();
    scene.kinds.clear();
    scene.bodies.clear();
    for (_, range) in state.body_ranges() {
        let points = range.map(|i| state.position(i)).collect();
        let meta = MetaParticle { points, ..(*kind.meta).clone() };
        scene.bodies.push(Placement { kind: scene.kinds.len(), ..at(DVec3::ZERO, DVec3::ZERO) });
        scene.kinds.push(BodyKind { meta: meta.into(), ..kind.clone() });
    }
    scene
}

#[test]
fn fast_path_matches_plain_path_for_a_settled_heap() {
    assert_agrees("settled", &settled(), &Course::of(500));
}

#[test]
fn comparison_detects_a_stiffness_change_of_0_1_percent() {
    let scene = settled();
    let mut other = scene.clone();
    other.laws.bond.k_n *= 1.0 + 1e-3;
    let course = Course::of(500);
    let [a, b] = [&scene, &other].map(|scene| states(scene, &course, None, 1));
    let [most, _] = apart(&a, &b, &scene, pair_force(&scene));
    assert!(most > TOLERANCE, "{most:e}");
}

fn assert_all_same(a: &[State], b: &[State], what: &str) {
    a.iter().zip(b).for_each(|(a, b)| assert_same(a, b, what));
}

#[test]
fn threads_and_instruction_sets_change_no_bit() {
    let mut breaking = drop();
    breaking.laws.bond.normal_strength = 0.02;
    let moments = with_moments(drop(), 1.0);
    let whole = [(heap(), 2000), (breaking, 400), (many(), 300), (spheres(), 300), (moments, 300)];
    let whole = whole.map(|(scene, steps)| (scene, Course::of(steps)));
    for (scene, course) in whole.into_iter().chain([some_spheres_leave()]) {
        let one = states(&scene, &course, Some(InstructionSet::widest()), 1);
        for threads in [2, 3] {
            let several = states(&scene, &course, Some(InstructionSet::widest()), threads);
            assert_all_same(&one, &several, "threads");
        }
        for set in InstructionSet::available().into_iter().skip(1) {
            assert_all_same(&one, &states(&scene, &course, Some(set), 1), set.name());
        }
    }
    let names: Vec<_> = InstructionSet::available().iter().map(InstructionSet::name).collect();
    for name in ["AVX-512", "AVX2", "scalar"].iter().filter(|name| !names.contains(name)) {
        println!("not tried, for want of it: {name}");
    }
}

#[test]
fn stretched_pair_oscillates_at_its_natural_frequency_on_the_fast_path() {
    // A pair that is stretched swings at ω² = 2 k_n / m: the fast path has its own right to the closed form.
    let mut kind = block([2, 1, 1]);
    std::sync::Arc::make_mut(&mut kind.meta).points[1].x += 1e-5;
    let scene = scene(kind, vec![at(DVec3::ZERO, DVec3::ZERO)], 1e-5);
    let omega = (2.0 * f64::from(bonds().k_n) / common::MASS).sqrt();
    let half = (PI / omega / 1e-5 / 20.0).round() as u64 * 20;
    let states = states(&scene, &Course::of(half), Some(InstructionSet::widest()), 1);
    let state = states.last().expect("looked at");
    let stretch = (state.position(1) - state.position(0)).length() - 2.0 * RADIUS;
    assert!((stretch / -1e-5 - 1.0).abs() < 1e-2, "{stretch:e}");
}

#[test]
fn fast_path_matches_plain_path_with_a_body_radius_ratio() {
    for ratio in [1.1, 1.225] {
        for (name, mut scene) in
            [("drop", drop()), ("heap", heap()), ("many", many()), ("spheres", spheres())]
        {
            scene.laws.body_radius_ratio = ratio;
            assert_agrees(&format!("{name} at ratio {ratio}"), &scene, &Course::of(HORIZON / 2));
        }
    }
}
