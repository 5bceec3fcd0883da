//! Surfaces of many triangles, as CAD programs cut them: flat ones feel flat, curved ones feel round, and neither lists
//! nor contacts take for ever. The load is Hertz's on the nearest point, as in `equipment`.

mod common;
#[path = "common/stl.rs"]
mod stl;

use std::f64::consts::{PI, TAU};
use std::time::{Duration, Instant};

use common::{Bench, G, MASS, RADIUS, assert_close, assert_force, hertz, push, sphere, weighing};
use glam::{DQuat, DVec3, EulerRot, IVec3};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use roost_solver::cpu::walls::{Touch, Walls};
use roost_solver::engine::frame::Frame;
use roost_solver::engine::state::State;
use roost_solver::equipment::facet::facets;
use roost_solver::equipment::{Motion, Presence, Surface, SurfaceKind};
use stl::{Triangle, cuboid, grid, moved, quad};

fn surface(triangles: Vec<Triangle>) -> Surface {
    Surface {
        name: "from a file".into(),
        kind: SurfaceKind::Equipment,
        motion: Motion::Fixed,
        presence: Presence::Always,
        triangles,
    }
}

struct Draw(ChaCha8Rng);

impl Draw {
    fn new(seed: u64) -> Self {
        Self(ChaCha8Rng::seed_from_u64(seed))
    }

    fn share(&mut self) -> f64 {
        f64::from(self.0.next_u32()) / f64::from(u32::MAX)
    }

    fn within(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.share()
    }
}

/// The square of 20 cm about the origin in the plane z = 0, cut at random places into 1000 triangles, slivers among them.
fn cut_plate() -> Vec<Triangle> {
    let mut draw = Draw::new(1);
    let mut triangles = quad(DVec3::new(-0.1, -0.1, 0.0), DVec3::X * 0.2, DVec3::Y * 0.2).to_vec();
    while triangles.len() < 1000 {
        let area = |[a, b, c]: &Triangle| (b - a).cross(c - a).length();
        let largest =
            (0..triangles.len()).max_by(|&i, &j| area(&triangles[i]).total_cmp(&area(&triangles[j])));
        let [a, b, c] = triangles.swap_remove(largest.unwrap());
        let (u, v) = (draw.within(0.1, 0.8), draw.share());
        let p = a + (b - a) * u * (1.0 - v) + (c - a) * u * v;
        triangles.extend([[a, b, p], [b, c, p], [c, a, p]]);
    }
    triangles
}

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
fn a_plate_of_a_thousand_triangles_is_a_plate() {
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

/// How a plate lies that is nowhere along the axes.
fn tilt() -> (DQuat, DVec3) {
    (DQuat::from_euler(EulerRot::ZYX, 0.7, 0.4, -1.1), DVec3::new(0.31, -0.22, 0.17))
}

/// The cut plate, tilted, as a file has it: in millimetres rounded to `f32`. No two of its triangles lie in quite one
/// plane, and some not in nearly one.
fn tilted_plate() -> Vec<Triangle> {
    let (turn, at) = tilt();
    let plate = moved(&cut_plate(), |p| ((turn * p + at) * 1e3).as_vec3().as_dvec3() * 1e-3);
    let pieces = facets(&plate, at).len();
    assert!(pieces > 20, "{pieces} facets");
    plate
}

#[test]
fn a_tilted_plate_in_rounded_millimetres_is_a_plate_too() {
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

/// A part of a ball about the origin of radius `r`, round +z, of `n`² · 2 triangles within 12° of it.
fn cap(r: f64, n: usize) -> Vec<Triangle> {
    let side = |i: usize| (i as f64 / n as f64 - 0.5) * 0.3;
    grid(n, n, |i, j| DVec3::new(side(i), side(j), 1.0).normalize() * r)
}

#[test]
fn a_dome_and_a_bowl_feel_round() {
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

/// A pipe of that radius along y, of `n` facets, from −5 to 5 cm: from angle `from` on, `n` steps of `step`.
fn pipe(r: f64, n: usize, from: f64, step: f64) -> Vec<Triangle> {
    let at = |i: usize, j: usize| {
        let angle = from + i as f64 * step;
        DVec3::new(r * angle.cos(), 0.1 * j as f64 - 0.05, r * angle.sin())
    };
    grid(n, 1, at)
}

#[test]
fn a_pipe_of_narrow_facets_feels_round_inside_and_outside() {
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
fn a_sphere_rolls_to_and_fro_in_a_pipe_of_narrow_facets() {
    // Let go 0.5 rad from the bottom, rolling: v² = 2 g h/(1 + k), k = ⅖ (R/d)² at the lever d. Every facet begins its
    // friction anew; at 52 µm, 3000 of them, a sphere that is 0.1 mm deep still rolls.
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
fn a_sphere_on_an_edge_stays_with_one_of_its_facets() {
    // A roof of two slopes, somewhere in space. Over the ridge both are as near, but for rounding: their triangles
    // begin at opposite ends of it.
    let (turn, at) = tilt();
    let slope = |y: f64| quad(DVec3::Y * -y, DVec3::new(y, 0.0, -0.03), DVec3::Y * 2.0 * y);
    let roof = moved(&[slope(-0.1), slope(0.1)].concat(), |p| turn * p + at);
    let scene = sphere(vec![surface(roof)], DVec3::ZERO, 1e-5);
    let frame = State::new(&scene).frame;
    let walls = Walls::new(&scene, &frame);
    let mut draw = Draw::new(7);
    for _ in 0..2000 {
        // Within the normals of both slopes.
        let over = DVec3::new(draw.within(-0.2, 0.2), 0.0, 1.0).normalize() * draw.within(0.5, 0.99) * RADIUS;
        let x = frame.encode(turn * (over + DVec3::Y * draw.within(-0.09, 0.09)) + at);
        let touches = [0, 1].map(|facet| (facet, walls.touch(facet, x, &frame)));
        let shadowed = |facet: usize| {
            walls.is_shadowed(facet as u32, &touches[facet].1, [touches[1 - facet]].into_iter())
        };
        assert_eq!([shadowed(0), shadowed(1)], [false, true]);
    }
}

/// The facets that a sphere touches, and those of them that it feels.
fn felt(walls: &Walls, frame: &Frame, x: IVec3) -> (Vec<Touch>, Vec<Touch>) {
    let near = walls.within(x, RADIUS as f32, frame);
    let touches: Vec<_> = near.map(|facet| (facet, walls.touch(facet, x, frame))).collect();
    let felt = touches.iter().filter(|(facet, touch)| {
        let others = touches.iter().copied().filter(|(other, _)| other != facet);
        !walls.is_shadowed(*facet, touch, others)
    });
    let felt = felt.map(|&(_, touch)| touch).collect();
    (touches.iter().map(|&(_, touch)| touch).collect(), felt)
}

#[test]
fn of_the_facets_in_touch_the_nearest_is_always_felt() {
    // Whatever else is near: soups of triangles, and meshes whose facets are all but equally far.
    let mut draw = Draw::new(8);
    let mut any = |size: f64| DVec3::new(draw.share() - 0.5, draw.share() - 0.5, draw.share() - 0.5) * size;
    let mut triangle = |p: DVec3| [p, p + any(0.03), p + any(0.03)];
    let soup = (0..400).map(|k| triangle(DVec3::Z * f64::from(k % 20) * 0.003)).collect();
    let tip = |k: f64| DVec3::new(0.02 * k.cos(), 0.02 * k.sin(), -1e-5);
    let shallow = (0..60).map(|k| f64::from(k) * 0.1).map(|k| [any(1e-6), tip(k), tip(k + 0.1)]).collect();
    for triangles in [soup, shallow, cap(0.1, 20), pipe(0.0039, 200, 0.0, TAU / 200.0), tilted_plate()] {
        let middle = triangles.iter().flatten().sum::<DVec3>() / (3 * triangles.len()) as f64;
        let scene = sphere(vec![surface(triangles)], DVec3::ZERO, 1e-5);
        let frame = State::new(&scene).frame;
        let walls = Walls::new(&scene, &frame);
        let mut several = 0;
        for k in 0..500 {
            let x = frame.encode(middle + any([0.05, 0.008, 0.0002][k % 3]));
            let (touches, felt) = felt(&walls, &frame, x);
            let nearest = touches.iter().map(|touch| touch.distance).fold(f32::INFINITY, f32::min);
            let nearest_felt = felt.iter().map(|touch| touch.distance).fold(f32::INFINITY, f32::min);
            // Of those that touch in one point it may be another.
            assert!(nearest_felt - nearest < 1e-6 || touches.is_empty(), "{nearest_felt} and not {nearest}");
            several += usize::from(touches.len() > 1);
        }
        assert!(several > 50, "{several} places where several facets touch");
    }
}

#[test]
fn long_narrow_facets_are_not_felt_twice_however_deep() {
    // Six planks of 1 m by 11.5 mm, each turned by 4° from the one before, bent up or down, lying anywhere.
    let (mut draw, width) = (Draw::new(9), 0.0115);
    let mut several = 0;
    for k in 0..60 {
        let turn = DQuat::from_euler(EulerRot::ZYX, f64::from(k) * 0.37, f64::from(k) * 0.71, f64::from(k));
        let rise = |i: f64| 0.0004 * i * i * f64::from(k % 2 * 2 - 1);
        let at = |i: f64, y: f64| DVec3::new(i * width, y, rise(i));
        let planks = moved(&grid(6, 1, |i, j| at(i as f64, j as f64 - 0.5)), |p| turn * p);
        let mut scene = sphere(vec![surface(planks)], DVec3::ZERO, 1e-5);
        (scene.low, scene.high) = (DVec3::splat(-1.0), DVec3::ONE);
        let frame = State::new(&scene).frame;
        let walls = Walls::new(&scene, &frame);
        for _ in 0..1000 {
            let height = draw.within(0.1, 0.99) * RADIUS * if k % 3 == 0 { -1.0 } else { 1.0 };
            let over = at(draw.within(0.5, 5.5), draw.within(-0.45, 0.45)) + DVec3::Z * height;
            let (touches, felt) = felt(&walls, &frame, frame.encode(turn * over));
            assert!(felt.len() <= 1, "{height} m over {over}: {felt:?}");
            several += usize::from(touches.len() > 1);
        }
    }
    assert!(several > 10_000, "{several} places where several facets touch");
}

#[test]
fn a_slot_with_a_round_bottom_holds_from_both_sides() {
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
fn surfaces_of_their_own_are_felt_on_their_own() {
    // The same plate twice, as two surfaces and as one.
    let plate = quad(DVec3::new(-0.05, -0.05, 0.0), DVec3::X * 0.1, DVec3::Y * 0.1).to_vec();
    let centre = DVec3::new(0.01, 0.02, 0.9 * RADIUS);
    let both = [surface(plate.clone()), surface(plate.clone())];
    assert_force(push(&both, centre), DVec3::Z * 2.0 * hertz(0.1 * RADIUS), 1e-3);
    let one = [surface([plate.clone(), plate].concat())];
    assert_force(push(&one, centre), DVec3::Z * hertz(0.1 * RADIUS), 1e-3);
}

#[test]
fn a_wall_that_ends_on_a_floor_is_not_felt_from_below() {
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

#[test]
fn lists_hold_all_facets_in_reach_and_no_other_in_order() {
    let turn =
        Motion::Moving { velocity: DVec3::X * 0.1, pivot: DVec3::Y * 0.1, spin: DVec3::new(0.3, 0.5, -1.0) };
    let mut scene = sphere(vec![], DVec3::ZERO, 1e-5);
    scene.surfaces = vec![
        surface(cap(0.1, 20)),
        surface(cuboid(DVec3::splat(-0.1), DVec3::splat(0.05), 4)).moving(turn),
        surface(pipe(0.05, 300, 0.0, TAU / 300.0)),
        surface(cuboid(DVec3::ZERO, DVec3::splat(0.05), 2)).until_start(),
    ];
    let frame = State::new(&scene).frame;
    let mut walls = Walls::new(&scene, &frame);
    let count = scene.surfaces.iter().map(|s| facets(&s.triangles, DVec3::ZERO).len() as u32).sum();
    assert!(count > 600);
    let mut draw = Draw::new(5);
    let mut found = 0;
    for k in 0..600 {
        if k == 300 {
            walls.pose(Some(0.7), &frame);
            walls.drop_what_goes_at_start();
        }
        let x = frame.encode(DVec3::new(
            draw.within(-0.15, 0.15),
            draw.within(-0.15, 0.15),
            draw.within(-0.15, 0.15),
        ));
        let reach = draw.within(0.001, 0.05) as f32;
        let all: Vec<u32> =
            (0..count).filter(|&facet| walls.touch(facet, x, &frame).distance <= reach).collect();
        let listed: Vec<u32> = walls.within(x, reach, &frame).collect();
        assert_eq!(listed, all, "{k}");
        found += all.len();
    }
    assert!(found > 5000, "{found}");
}

#[test]
fn a_hundred_thousand_triangles_are_built_and_listed_in_seconds() {
    // A rolling landscape of 0.8 m square: no two triangles in one plane.
    let at = |i: usize, j: usize| {
        let (x, y) = (i as f64 / 224.0 * 0.8 - 0.4, j as f64 / 224.0 * 0.8 - 0.4);
        DVec3::new(x, y, 0.01 * (20.0 * x).sin() * (17.0 * y).cos())
    };
    let triangles = grid(224, 224, at);
    assert_eq!(triangles.len(), 100_352);
    let start = Instant::now();
    let many = facets(&triangles, DVec3::ZERO).len();
    let cut_s = start.elapsed();
    let scene = sphere(vec![surface(triangles)], DVec3::ZERO, 1e-5);
    let frame = State::new(&scene).frame;
    let start = Instant::now();
    let walls = Walls::new(&scene, &frame);
    let built_s = start.elapsed();
    let start = Instant::now();
    let mut draw = Draw::new(6);
    let spheres = 10_000;
    let mut listed = 0;
    for _ in 0..spheres {
        let x = DVec3::new(draw.within(-0.39, 0.39), draw.within(-0.39, 0.39), draw.within(0.0, 0.05));
        listed += walls.within(frame.encode(x), 1.35 * RADIUS as f32, &frame).count();
    }
    let listed_s = start.elapsed();
    println!(
        "{many} facets in {cut_s:?}, with walls {built_s:?}; {listed} entries for {spheres} spheres in {listed_s:?}"
    );
    assert!(cut_s + built_s + listed_s < Duration::from_secs(10), "{cut_s:?} {built_s:?} {listed_s:?}");

    // The same number in one plane: one facet, whose nearest point is found without looking at them all.
    let flat = grid(224, 224, |i, j| DVec3::new(i as f64, j as f64, 0.0) * 0.8 / 224.0);
    let start = Instant::now();
    let facets = facets(&flat, DVec3::ZERO);
    let cut_s = start.elapsed();
    assert_eq!(facets.len(), 1);
    let start = Instant::now();
    for _ in 0..spheres {
        let p = DVec3::new(draw.within(0.0, 0.8), draw.within(0.0, 0.8), RADIUS);
        let q = facets[0].nearest(p.as_vec3()).expect("triangles");
        // Within a micrometre two triangles are as near, in `f32`.
        assert!(q.as_dvec3().distance(p * DVec3::new(1.0, 1.0, 0.0)) < 3e-6);
    }
    println!("one facet in {cut_s:?}, {spheres} nearest points in {:?}", start.elapsed());
    assert!(cut_s + start.elapsed() < Duration::from_secs(10));
}
