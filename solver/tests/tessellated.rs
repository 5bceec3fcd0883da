//! Surfaces of many triangles, as CAD programs cut them: flat ones feel flat, curved ones feel round. The load is Hertz's
//! on the nearest point, as in `equipment`.

mod common;
#[path = "common/cut.rs"]
mod cut;
#[path = "common/stl.rs"]
mod stl;

use std::f64::consts::{PI, TAU};

use common::{Bench, G, MASS, RADIUS, assert_close, assert_force, at, hertz, law, push, sphere, weighing};
use cut::{Draw, cap, cut_plate, pipe, surface, tilt, tilted_plate};
use glam::DVec3;
use roost_solver::cpu::Cpu;
use roost_solver::engine::Backend;
use roost_solver::equipment::Motion;
use roost_solver::equipment::facet::facets;
use stl::{Triangle, cuboid, moved, quad};

/// Places over the plate: at random, right over corners, right over edges.
fn places(triangles: &[Triangle]) -> Vec<DVec3> {
    let mut draw = Draw::new(2);
    let mut any = || DVec3::new(draw.within(-0.09, 0.09), draw.within(-0.09, 0.09), 0.0);
    let mut places: Vec<DVec3> = (0..40).map(|_| any()).collect();
    let inner = |p: &DVec3| p.x.abs() < 0.09 && p.y.abs() < 0.09;
    places.extend(triangles.iter().step_by(31).map(|t| t[0]).filter(inner));
    places.extend(triangles.iter().step_by(29).map(|t| t[0] * 0.3 + t[1] * 0.7).filter(inner));
    places
}

#[test]
fn plate_of_a_thousand_triangles_pushes_like_a_plain_plate() {
    let triangles = cut_plate();
    assert_eq!(facets(&triangles, DVec3::ZERO).len(), 1);
    let places = places(&triangles);
    assert!(places.len() > 90);
    let plate = [surface(triangles)];
    for overlap in [0.02 * RADIUS, 0.1 * RADIUS, 0.9 * RADIUS] {
        for place in &places {
            let centre = *place + DVec3::Z * (RADIUS - overlap);
            // A share of 1e-4 of the force is 5 nm.
            assert_force(push(&plate, centre), DVec3::Z * hertz(overlap), 1e-4);
        }
    }
}

#[test]
fn tilted_plate_with_rounded_corners_pushes_like_a_plain_plate() {
    let (turn, at) = tilt();
    let plate = [surface(tilted_plate())];
    for (overlap, share) in [(0.02 * RADIUS, 1e-3), (0.1 * RADIUS, 1e-3), (0.9 * RADIUS, 1e-2)] {
        let mut worst = 0.0f64;
        for place in places(&cut_plate()) {
            let centre = turn * (place + DVec3::Z * (RADIUS - overlap)) + at;
            let off = push(&plate, centre) / hertz(overlap) - turn * DVec3::Z;
            worst = worst.max(off.length());
        }
        println!("{overlap} m deep: off by {worst:.1e}");
        assert!(worst < share, "{overlap}: {worst}");
    }
}

#[test]
fn a_sphere_rolls_down_a_tilted_plate_of_many_triangles_as_down_a_plain_one() {
    let (turn, at) = tilt();
    let plain = quad(DVec3::new(-0.1, -0.1, 0.0), DVec3::X * 0.2, DVec3::Y * 0.2);
    let roll = |triangles: Vec<Triangle>| {
        let start = DVec3::new(-0.08, 0.013, 0.0);
        let mut scene = weighing(vec![surface(triangles)], start, DVec3::X * 0.1, 0.5, 2e-5);
        scene.gravity = turn * DVec3::new(1.0, 0.0, -G);
        let body = &mut scene.bodies[0];
        (body.position, body.velocity) = (turn * body.position + at, turn * body.velocity);
        let mut bench = Bench::new(&scene);
        bench.steps(18_000);
        (turn.inverse() * (bench.position(0) - at), bench.velocity(0).length())
    };
    let (many, plain) = (roll(tilted_plate()), roll(moved(&plain, |p| turn * p + at)));
    assert!(plain.0.x > -0.02, "it rolled 6 cm, to {}", plain.0);
    assert!((many.0 - plain.0).length() < 5e-5, "{} and not {}", many.0, plain.0);
    assert_close(many.1, plain.1, 1e-3);
}

#[test]
fn tessellated_dome_and_bowl_push_like_smooth_ones() {
    // 2048 triangles of 0.94 mm, 2.2 µm off the ball at most, under a sphere of 4 mm that is 0.4 mm deep.
    let (r, overlap) = (0.1, 0.1 * RADIUS);
    let ball = [surface(cap(r, 32))];
    let (mut worst_load, mut worst_turn) = (0.0f64, 0.0f64);
    let mut draw = Draw::new(3);
    for k in 0..200 {
        let out = DVec3::new(draw.within(-0.11, 0.11), draw.within(-0.11, 0.11), 1.0).normalize();
        let (centre, normal) = match k % 2 {
            0 => (out * (r + RADIUS - overlap), out),
            _ => (out * (r - RADIUS + overlap), -out),
        };
        let found = push(&ball, centre);
        worst_load = worst_load.max((found.length() / hertz(overlap) - 1.0).abs());
        worst_turn = worst_turn.max(found.angle_between(normal));
    }
    println!("load within {worst_load:.1e}, direction within {worst_turn:.1e}");
    assert!(worst_load < 0.01 && worst_turn < 0.01, "{worst_load} {worst_turn}");
}

#[test]
fn pipe_of_narrow_facets_pushes_like_a_smooth_pipe_inside_and_outside() {
    let overlap = 0.1 * RADIUS;
    // From facets of 31 µm, 10,000 of them, to few that turn by 20°; from wide pipes to one that the sphere just fits.
    for (r, n) in [(0.05, 10_000), (0.05, 360), (0.02, 40), (0.006, 100), (0.0045, 24), (0.0045, 18)] {
        let pipe = [surface(pipe(r, n, 0.0, TAU / n as f64))];
        // How far facets are from the round pipe, and how far they turn.
        let (sag, turn) = (r * (1.0 - (PI / n as f64).cos()), PI / n as f64);
        let mut draw = Draw::new(4);
        for k in 0..if n > 1000 { 6 } else { 40 } {
            let angle = draw.within(0.0, TAU);
            let out = DVec3::new(angle.cos(), 0.0, angle.sin());
            let (centre, normal) = match k % 2 {
                0 => (out * (r + RADIUS - overlap), out),
                _ => (out * (r - RADIUS + overlap), -out),
            };
            let found = push(&pipe, centre + DVec3::Y * 0.01);
            let (least, most) = (hertz(overlap - sag) * 0.999, hertz(overlap + sag) * 1.001);
            assert!(
                (least..=most).contains(&found.length()),
                "{n} facets: {} of {}",
                found.length(),
                hertz(overlap)
            );
            assert!(found.angle_between(normal) <= turn * 1.01 + 1e-3, "{n} facets: {found} along {normal}");
        }
    }
}

#[test]
fn sphere_in_a_pipe_of_narrow_facets_rolls_at_the_closed_form_speed() {
    // Let go 0.5 rad from the bottom, rolling: v² = 2 g h/(1 + k), k = ⅖ (R/d)² at the lever d.
    let (r, start) = (0.05, 0.5f64);
    let overlap = (MASS * G / hertz(1.0)).powf(2.0 / 3.0);
    for n in [72, 360, 3000] {
        let narrow = surface(pipe(r, n, 0.0, TAU / f64::from(n as u32)));
        let mut scene = weighing(vec![narrow], DVec3::ZERO, DVec3::ZERO, 0.5, 2e-5);
        scene.bodies[0].position = DVec3::new(start.sin(), 0.0, -start.cos()) * (r - RADIUS + overlap);
        let mut bench = Bench::new(&scene);
        let mut fastest = 0.0f64;
        while bench.position(0).x > -1e-4 {
            assert_eq!(bench.steps(20), None);
            fastest = fastest.max(bench.velocity(0).length());
        }
        let k = 0.4 * (RADIUS / (RADIUS - overlap)).powi(2);
        let ideal = (2.0 * G * (r - RADIUS + overlap) * (1.0 - start.cos()) / (1.0 + k)).sqrt();
        let mut highest = 0.0f64;
        for _ in 0..400 {
            assert_eq!(bench.steps(20), None);
            let p = bench.position(0);
            highest = highest.max((-p.x).atan2(-p.z));
        }
        println!("{n} facets: {fastest:.4} m/s, ideally {ideal:.4}; up again to {highest:.4} of {start}");
        assert_close(fastest, ideal, 0.02);
        assert_close(highest, start, 0.04);
    }
}

#[test]
fn sphere_that_slides_over_narrow_facets_has_full_coulomb_friction() {
    // A pipe turns about its axis past a sphere that is held against it, from outside or inside. Without a dashpot, which
    // would do most of it at such speeds, friction is whole once the pipe has come 0.15 mm along: it must last from
    // one facet to the next. At 25 m/s every
    // other facet is passed over. Adhesion, too, holds on.
    let (r, mu, overlap) = (0.05, 0.5, 0.1 * RADIUS);
    let facets = |size: f64| (TAU * r / size).round() as usize;
    for (size, speed, gamma) in [(1e-4, 0.05, 0.0), (1e-3, 0.05, 0.0), (1e-4, 25.0, 0.0), (1e-4, 0.05, 0.055)]
    {
        for (side, cpu) in
            [-1.0, 1.0].into_iter().flat_map(|side| [Cpu::plain(1), Cpu::new(1)].map(|cpu| (side, cpu)))
        {
            let n = facets(size);
            let mut turning = surface(pipe(r, n, 0.0, TAU / n as f64));
            turning.motion =
                Motion::Moving { velocity: DVec3::ZERO, pivot: DVec3::ZERO, spin: DVec3::Y * (speed / r) };
            let place = DVec3::new(r + side * (RADIUS - overlap), 0.01, 0.0);
            let mut scene = sphere(vec![turning], place, 1e-5);
            scene.held = vec![0];
            scene.laws.equipment = law(true, 1.0, mu, gamma);
            let mut bench = Bench::with(cpu, &scene);
            bench.cpu.start(&mut bench.run);
            // 0.5 mm to begin with, then over three facets of 1 mm, or 30 of 0.1 mm.
            let steps = |way: f64| (way / speed / 1e-5).round() as u64;
            assert_eq!(bench.steps(steps(5e-4)), None);
            let (mut normal, mut along) = (0.0, 0.0);
            for _ in 0..steps(3e-3) {
                assert_eq!(bench.steps(1), None);
                let force = bench.cpu.surface_forces(&mut bench.run)[0];
                // The pipe runs along -z past the sphere, which pulls it back.
                (normal, along) = (normal - side * force.x, along + force.z);
            }
            println!(
                "{size} m at {speed} m/s, side {side}, {gamma} J/m²: {:.4} of Coulomb",
                along / (mu * normal)
            );
            assert_close(along, mu * normal, 0.02);
        }
    }
}

#[test]
fn neighbour_list_rebuilds_do_not_change_sliding_over_narrow_facets() {
    // A stranger at 8 m/s has the lists built anew every other step.
    let mut scene =
        weighing(vec![surface(pipe(0.05, 3000, 0.0, TAU / 3000.0))], DVec3::ZERO, DVec3::X * 0.1, 0.5, 2e-5);
    scene.bodies[0].position.z -= 0.05;
    for cpu in [Cpu::plain, Cpu::new] {
        let mut alone = Bench::with(cpu(1), &scene);
        let mut hurried = scene.clone();
        hurried.bodies.push(at(DVec3::new(-0.4, -0.4, 0.1), DVec3::Z * 8.0));
        let mut both = Bench::with(cpu(1), &hurried);
        for bench in [&mut alone, &mut both] {
            assert_eq!(bench.steps(2000), None);
        }
        assert!(alone.position(0).x > 1e-3, "{}", alone.position(0));
        assert_eq!(alone.state().particles[0], both.state().particles[0]);
    }
}

#[test]
fn slot_with_a_round_bottom_pushes_from_both_walls() {
    // Walls 7.8 mm apart, joined below by a half pipe: a sphere of 8 mm sticks between the walls, 2 mm above the round.
    let (r, deep) = (0.0039, 0.002);
    let wall = |x: f64| quad(DVec3::new(x, -0.05, 0.0), DVec3::Y * 0.1, DVec3::Z * 0.02);
    let slot = [surface([pipe(r, 36, PI, PI / 36.0), wall(-r).to_vec(), wall(r).to_vec()].concat())];
    for x in [0.0, 2e-5, -5e-5] {
        let expected = DVec3::X * (hertz(RADIUS - r - x) - hertz(RADIUS - r + x));
        let found = push(&slot, DVec3::new(x, 0.0, deep));
        assert!((found - expected).length() < 2e-3 * hertz(RADIUS - r), "{found} is not {expected}");
    }
}

#[test]
fn the_two_faces_of_a_thin_sheet_are_one_contact() {
    let (low, high) = (DVec3::new(-0.05, -0.05, -0.001), DVec3::new(0.05, 0.05, 0.0));
    let sheet = [surface(cuboid(low, high, 5))];
    for (overlap, place) in
        [(0.0005, DVec3::ZERO), (0.0018, DVec3::new(0.013, 0.021, 0.0)), (0.003, DVec3::X * 0.02)]
    {
        assert_force(push(&sheet, place + DVec3::Z * (RADIUS - overlap)), DVec3::Z * hertz(overlap), 1e-3);
    }
    // Round its edge it is felt from the nearest point.
    let out = DVec3::new(1.0, 0.0, 0.6).normalize();
    assert_force(push(&sheet, DVec3::X * 0.05 + out * 0.9 * RADIUS), out * hertz(0.1 * RADIUS), 2e-3);
}

#[test]
fn coincident_plates_push_twice_only_as_separate_surfaces() {
    // The same plate twice, as two surfaces and as one.
    let plate = quad(DVec3::new(-0.05, -0.05, 0.0), DVec3::X * 0.1, DVec3::Y * 0.1).to_vec();
    let centre = DVec3::new(0.01, 0.02, 0.9 * RADIUS);
    let both = [surface(plate.clone()), surface(plate.clone())];
    assert_force(push(&both, centre), DVec3::Z * 2.0 * hertz(0.1 * RADIUS), 1e-3);
    let one = [surface([plate.clone(), plate].concat())];
    assert_force(push(&one, centre), DVec3::Z * hertz(0.1 * RADIUS), 1e-3);
}

#[test]
fn wall_that_ends_on_a_floor_has_no_contact_from_below() {
    // They share no corner.
    let floor = quad(DVec3::new(-0.05, -0.05, 0.0), DVec3::X * 0.1, DVec3::Y * 0.1);
    let wall = quad(DVec3::new(0.003, -0.03, 0.0), DVec3::Y * 0.061, DVec3::Z * 0.05);
    let tee = [surface([floor, wall].concat())];
    for x in [-0.001, 0.0, 0.0025, 0.003, 0.004] {
        let found = push(&tee, DVec3::new(x, 0.007, -0.5 * RADIUS));
        assert_force(found, DVec3::NEG_Z * hertz(0.5 * RADIUS), 1e-3);
    }
    let above = push(&tee, DVec3::new(0.003 - 0.8 * RADIUS, 0.007, 0.9 * RADIUS));
    assert_force(above, DVec3::new(-hertz(0.2 * RADIUS), 0.0, hertz(0.1 * RADIUS)), 2e-3);
}

#[test]
fn the_tip_of_a_cone_of_many_facets_is_one_contact() {
    let rim = |k: usize| {
        let angle = k as f64 / 500.0 * TAU;
        DVec3::new(0.02 * angle.cos(), 0.02 * angle.sin(), -0.03)
    };
    let cone = [surface((0..500).map(|k| [DVec3::ZERO, rim(k), rim(k + 1)]).collect())];
    for out in [DVec3::Z, DVec3::new(0.1, 0.2, 1.0).normalize(), DVec3::new(0.3, 0.0, 1.0).normalize()] {
        assert_force(push(&cone, out * 0.9 * RADIUS), out * hertz(0.1 * RADIUS), 2e-3);
    }
}
