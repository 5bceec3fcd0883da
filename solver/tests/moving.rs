//! Equipment in motion: plates that rise, turn and drag, belts, shutters, and what each kind of surface is made of.

mod common;

use common::{
    Bench, E, G, MASS, NU, RADIUS, assert_close, assert_force, block, law, plate, sphere, weighing,
};
use glam::{DMat3, DVec3};
use roost_solver::engine::Backend;
use roost_solver::engine::scene::Placement;
use roost_solver::equipment::{Motion, Surface, SurfaceKind};

#[test]
fn a_rising_plate_lifts_a_sphere() {
    let rising = Motion::Moving { velocity: DVec3::Z * 0.2, pivot: DVec3::X * 0.3, spin: DVec3::ZERO };
    let plates = vec![plate(SurfaceKind::Equipment).moving(rising)];
    let mut bench = Bench::new(&weighing(plates, DVec3::ZERO, DVec3::ZERO, 0.0, 2e-5));
    bench.steps(1000);
    let rest = bench.position(0).z;
    bench.cpu.start(&mut bench.run);
    assert_eq!(bench.steps(50_000), None);
    assert!((bench.position(0).z - rest - 0.2).abs() < 1e-5, "carried up by 0.2 m/s for 1 s");
    assert_close(bench.velocity(0).z, 0.2, 1e-3);
}

#[test]
fn approaching_plate_strikes_a_distant_sphere() {
    // Nothing moves but the plate: only its own motion can renew the neighbour lists.
    for speed in [0.5, -0.5] {
        let motion = Motion::Moving { velocity: DVec3::Z * speed, pivot: DVec3::ZERO, spin: DVec3::ZERO };
        let plates = vec![plate(SurfaceKind::Equipment).moving(motion)];
        let mut bench = Bench::new(&sphere(plates, DVec3::Z * 0.1 * speed.signum(), 1e-5));
        bench.cpu.start(&mut bench.run);
        bench.steps(30_000);
        // An elastic blow from something heavy: twice its speed.
        assert_close(bench.velocity(0).z, 2.0 * speed, 1e-2);
    }
    // A plate that turns: its tip, 0.4 m from the pivot, moves at 0.4 m/s.
    let motion = Motion::Moving { velocity: DVec3::ZERO, pivot: DVec3::ZERO, spin: DVec3::NEG_Y };
    let plates = vec![plate(SurfaceKind::Equipment).moving(motion)];
    let mut bench = Bench::new(&sphere(plates, DVec3::new(0.38, 0.0, 0.03), 1e-5));
    bench.cpu.start(&mut bench.run);
    bench.steps(12_000);
    assert_close(bench.velocity(0).length(), 2.0 * 0.38, 1e-2);
}

#[test]
fn a_plate_that_has_turned_strikes_along_its_normal() {
    // Turned by 60° when it meets the sphere 0.3 m from its pivot, with 1.2 m/s there: elastic, so twice that.
    let motion = Motion::Moving { velocity: DVec3::ZERO, pivot: DVec3::ZERO, spin: DVec3::NEG_Y * 4.0 };
    let turn = |angle: f64| DMat3::from_rotation_y(-angle);
    let (met, ahead) = (60f64.to_radians(), (RADIUS / 0.3f64).asin());
    let plates = vec![plate(SurfaceKind::Equipment).moving(motion)];
    let mut bench = Bench::new(&sphere(plates, turn(met + ahead) * DVec3::X * 0.3, 1e-5));
    bench.cpu.start(&mut bench.run);
    bench.steps(28_000);
    let expected = turn(met) * DVec3::Z * 2.4;
    let off = bench.velocity(0) - expected;
    assert!(off.length() < 0.03 * expected.length(), "{} is not {expected}", bench.velocity(0));
}

#[test]
fn rotating_plate_carries_a_resting_block() {
    // A quarter of a radian in half a second about an axis 5 cm off: the block stays where it is on the plate.
    let (pivot, rate) = (DVec3::new(0.05, 0.0, 0.0), 0.5);
    let turning = Motion::Moving { velocity: DVec3::ZERO, pivot, spin: DVec3::Y * rate };
    let mut scene = weighing(vec![], DVec3::ZERO, DVec3::ZERO, 2.0, 2e-5);
    scene.kinds = vec![block([3, 3, 1])];
    scene.surfaces = vec![plate(SurfaceKind::Equipment).moving(turning)];
    scene.laws.tissue = law(false, 0.2, 0.0, 0.0);
    scene.laws.contact_between_bonded = true;
    let mut bench = Bench::new(&scene);
    bench.steps(2000);
    let centre = |bench: &mut Bench| (0..9).map(|i| bench.position(i)).sum::<DVec3>() / 9.0;
    let before = centre(&mut bench);
    bench.cpu.start(&mut bench.run);
    assert_eq!(bench.steps(25_000), None);
    let turned = pivot + DMat3::from_rotation_y(0.25) * (before - pivot);
    let off = centre(&mut bench) - turned;
    assert!((before - turned).length() > 0.01, "it has moved");
    assert!(off.length() < 1e-4, "off by {off} m");
}

#[test]
fn turntable_friction_acts_perpendicular_to_its_radius() {
    let table =
        Motion::Moving { velocity: DVec3::ZERO, pivot: DVec3::new(0.1, 0.0, 0.0), spin: DVec3::Z * 5.0 };
    let plates = vec![plate(SurfaceKind::Equipment).moving(table)];
    let mut bench = Bench::new(&weighing(plates, DVec3::new(0.1, -0.2, 0.0), DVec3::ZERO, 0.1, 1e-5));
    bench.steps(100);
    assert_eq!(bench.velocity(0).truncate().length(), 0.0, "stands still before the start");
    bench.cpu.start(&mut bench.run);
    bench.steps(5000);
    // The plate runs along +x at 1 m/s under it: it slides, and gathers speed at μ g.
    assert_close(bench.velocity(0).x, 0.1 * G * 0.05, 1e-2);
    assert!(bench.velocity(0).y.abs() < 0.02 * bench.velocity(0).x);
}

#[test]
fn held_sphere_on_a_turntable_is_pulled_towards_its_contact_point() {
    // 5 µm from the axis, and so little that it never slips: the point of the table that it stuck to goes round, and pulls by its
    // distance, straight at it.
    let (pivot, aside) = (DVec3::new(0.1, -0.2, 0.0), DVec3::X * 5e-6);
    let table = Motion::Moving { velocity: DVec3::ZERO, pivot, spin: DVec3::Z * 5.0 };
    let plates = vec![plate(SurfaceKind::Equipment).moving(table)];
    let mut scene = weighing(plates, pivot + aside, DVec3::ZERO, 100.0, 1e-5);
    scene.held = vec![0];
    scene.laws.equipment = law(true, 1.0, 100.0, 0.0);
    let mut bench = Bench::new(&scene);
    bench.steps(1);
    let pressed = -bench.cpu.surface_forces(&mut bench.run)[0].z;
    // Hertz: k_t / k_n = 4 G*/E*, and k_n = 3/2 F_n/δ.
    let (e_star, g_star) = (E / (1.0 - NU * NU), E / (2.0 * (1.0 + NU) * (2.0 - NU)));
    let k_t = 4.0 * g_star / e_star * 1.5 * pressed / (RADIUS - bench.position(0).z);
    bench.cpu.start(&mut bench.run);
    for eighth in 1..=6 {
        // An eighth of a turn at 5 rad/s in steps of 1e-5 s.
        bench.steps(15_708);
        let angle = f64::from(eighth * 15_708) * 5e-5;
        let along = DMat3::from_rotation_z(angle) * aside - aside;
        let pull = -bench.cpu.surface_forces(&mut bench.run)[0].with_z(0.0);
        assert!(
            (pull - along * k_t).length() < 5e-3 * k_t * 5e-6,
            "{pull} is not {} at {angle}",
            along * k_t
        );
    }
}

#[test]
fn a_plate_that_moves_in_its_plane_drags_like_a_belt() {
    let moving = Motion::Moving { velocity: DVec3::X, pivot: DVec3::ZERO, spin: DVec3::ZERO };
    let belt = Motion::Belt { velocity: DVec3::X };
    let speed = |kind, motion| {
        let plates = vec![plate(kind).moving(motion)];
        let mut bench = Bench::new(&weighing(plates, DVec3::ZERO, DVec3::ZERO, 0.1, 1e-5));
        bench.steps(200);
        assert_eq!(bench.velocity(0).x, 0.0, "stands still before the start");
        bench.cpu.start(&mut bench.run);
        bench.steps(5000);
        bench.velocity(0).x
    };
    assert_close(speed(SurfaceKind::Equipment, moving), 0.1 * G * 0.05, 1e-2);
    assert_close(speed(SurfaceKind::Belt, belt), 0.1 * G * 0.05, 1e-2);
    assert_eq!(speed(SurfaceKind::Frictionless, moving), 0.0);
}

#[test]
fn each_kind_of_surface_takes_its_own_friction() {
    for (kind, mu) in
        [(SurfaceKind::Equipment, 0.3), (SurfaceKind::Belt, 0.2), (SurfaceKind::Frictionless, 0.0)]
    {
        let mut scene = weighing(vec![plate(kind)], DVec3::ZERO, DVec3::X, 0.3, 1e-5);
        scene.laws.belt = law(true, 0.3, 0.2, 0.0);
        let mut bench = Bench::new(&scene);
        bench.steps(5000);
        let lost = 1.0 - bench.velocity(0).x;
        assert!((lost - mu * G * 0.05).abs() < 2e-3, "{kind:?}: {lost}");
    }
}

#[test]
fn shutter_disappears_at_belt_start() {
    let shutter = plate(SurfaceKind::Equipment).until_start();
    let mut bench = Bench::new(&weighing(vec![shutter], DVec3::ZERO, DVec3::ZERO, 0.5, 1e-5));
    bench.steps(10_000);
    let rest = bench.position(0).z;
    assert!(bench.velocity(0).length() < 1e-4, "held");
    bench.cpu.start(&mut bench.run);
    assert_eq!(bench.steps(5000), None);
    assert_close(bench.position(0).z - rest, -0.5 * G * 0.05 * 0.05, 2e-3);
}

#[test]
fn removal_of_a_gate_keeps_the_contacts_of_other_surfaces() {
    // A floor of two halves, of which one goes at the start. On each a sphere rolls down a slope of 0.2, and friction
    // bears 2/7 of the pull along the slope.
    let across = |from: f64| {
        let corner = DVec3::new(-1.0, from, 0.0);
        Surface::parallelogram(
            "gate",
            SurfaceKind::Equipment,
            corner,
            DVec3::X * 2.0,
            DVec3::Y * (1.0 - from),
        )
    };
    let gate = across(0.0).closed_until_start(across(-1.0));
    let mut scene = weighing(vec![gate], DVec3::Y * 0.1, DVec3::ZERO, 0.5, 1e-5);
    let over_opening = Placement { position: scene.bodies[0].position.with_y(-0.1), ..scene.bodies[0] };
    scene.bodies.push(over_opening);
    scene.gravity.x = 0.2 * G;
    let mut bench = Bench::new(&scene);
    bench.steps(10_000);
    let of_one = DVec3::new(2.0 / 7.0 * 0.2, 0.0, -1.0) * MASS * G;
    assert_force(bench.cpu.surface_loads(&mut bench.run)[0].force, 2.0 * of_one, 2e-3);
    let height = bench.position(1).z;
    bench.cpu.start(&mut bench.run);
    assert_eq!(bench.cpu.surface_loads(&mut bench.run)[0].force, DVec3::ZERO, "it has only just opened");
    bench.steps(1);
    assert_force(bench.cpu.surface_loads(&mut bench.run)[0].force, of_one, 2e-3);
    bench.steps(5000);
    assert_close(bench.position(1).z - height, -0.5 * G * 0.05 * 0.05, 2e-3);
}

#[test]
fn surface_load_of_a_floor_is_weight_and_its_moment() {
    let place = DVec3::new(0.12, -0.07, 0.0);
    let mut bench = Bench::new(&weighing(vec![plate(SurfaceKind::Equipment)], place, DVec3::ZERO, 0.5, 1e-5));
    bench.steps(20_000);
    let load = bench.cpu.surface_loads(&mut bench.run)[0];
    let weight = DVec3::NEG_Z * MASS * G;
    assert_force(load.force, weight, 1e-3);
    assert_force(load.torque, place.cross(weight), 1e-3);
    assert!(load.torque_about(place).length() < 1e-6 * MASS * G, "{}", load.torque_about(place));
}

#[test]
fn power_of_a_belt_is_friction_times_its_speed() {
    let (mu, speed) = (0.2, 0.5);
    let belt = plate(SurfaceKind::Belt).moving(Motion::Belt { velocity: DVec3::X * speed });
    let mut bench = Bench::new(&weighing(vec![belt], DVec3::Y * 0.1, DVec3::ZERO, mu, 1e-5));
    bench.steps(1000);
    bench.cpu.start(&mut bench.run);
    bench.steps(1000);
    let load = bench.cpu.surface_loads(&mut bench.run)[0];
    // P = −F·v; the block slides for v/(μ g) = 0.25 s.
    assert_close(-load.force.x * speed, mu * MASS * G * speed, 1e-3);
    // Friction at 0.1 m from the x axis; the weight turns about x.
    assert_close(load.torque.z, 0.1 * mu * MASS * G, 2e-3);
    assert_close(load.torque.x, -0.1 * MASS * G, 1e-3);
}

#[test]
fn surface_load_of_a_turntable_is_the_friction_torque_about_its_pivot() {
    let (mu, radius, pivot) = (0.1, 0.2, DVec3::new(0.1, 0.05, 0.0));
    let table = Motion::Moving { velocity: DVec3::ZERO, pivot, spin: DVec3::Z * 5.0 };
    let plates = vec![plate(SurfaceKind::Equipment).moving(table)];
    let place = pivot - DVec3::Y * radius;
    let mut bench = Bench::new(&weighing(plates, place, DVec3::ZERO, mu, 1e-5));
    bench.steps(1000);
    bench.cpu.start(&mut bench.run);
    bench.steps(500);
    let load = bench.cpu.surface_loads(&mut bench.run)[0];
    assert_close(load.torque_about(pivot).z, -mu * MASS * G * radius, 2e-3);
}
