//! Walls of many facets: which of them a sphere feels, which its list holds, and that neither takes for ever.

mod common;
#[path = "common/cut.rs"]
mod cut;
#[path = "common/stl.rs"]
mod stl;

use std::f64::consts::TAU;
use std::time::{Duration, Instant};

use common::{RADIUS, sphere};
use cut::{Draw, cap, pipe, surface, tilt, tilted_plate};
use glam::{DQuat, DVec3, EulerRot, IVec3};
use roost_solver::engine::frame::Frame;
use roost_solver::engine::state::State;
use roost_solver::equipment::Motion;
use roost_solver::equipment::facet::facets;
use roost_solver::walls::{NearestPoint, Walls};
use stl::{cuboid, grid, moved, quad};

#[test]
fn sphere_on_an_edge_keeps_contact_with_the_same_facet() {
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
        let touches = [0, 1].map(|facet| (facet, walls.nearest_point(facet, x, &frame)));
        let superseding_facet = |facet: usize| {
            walls.superseding_facet(facet as u32, &touches[facet].1, [touches[1 - facet]].into_iter())
        };
        assert_eq!([superseding_facet(0), superseding_facet(1)], [None, Some(0)]);
    }
}

/// Nearest points of all facets that a sphere touches, and of those whose contacts act.
fn contacts(walls: &Walls, frame: &Frame, x: IVec3) -> (Vec<NearestPoint>, Vec<NearestPoint>) {
    let near = walls.facets_within(x, RADIUS as f32, frame);
    let touches: Vec<_> = near.map(|facet| (facet, walls.nearest_point(facet, x, frame))).collect();
    let acting = touches.iter().filter(|(facet, touch)| {
        let others = touches.iter().copied().filter(|(other, _)| other != facet);
        walls.superseding_facet(*facet, touch, others).is_none()
    });
    let acting = acting.map(|&(_, touch)| touch).collect();
    (touches.iter().map(|&(_, touch)| touch).collect(), acting)
}

#[test]
fn nearest_facet_in_contact_always_acts() {
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
            let (touches, acting) = contacts(&walls, &frame, x);
            let nearest = touches.iter().map(|touch| touch.distance).fold(f32::INFINITY, f32::min);
            let least = acting.iter().map(|touch| touch.distance).fold(f32::INFINITY, f32::min);
            // Of those that touch in one point it may be another.
            assert!(least - nearest < 1e-6 || touches.is_empty(), "{least} and not {nearest}");
            several += usize::from(touches.len() > 1);
        }
        assert!(several > 50, "{several} places where several facets touch");
    }
}

#[test]
fn long_narrow_facets_act_once_at_any_depth() {
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
            let (touches, acting) = contacts(&walls, &frame, frame.encode(turn * over));
            assert!(acting.len() <= 1, "{height} m over {over}: {acting:?}");
            several += usize::from(touches.len() > 1);
        }
    }
    assert!(several > 10_000, "{several} places where several facets touch");
}

#[test]
fn facet_lists_hold_exactly_the_facets_in_reach_in_order() {
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
            walls.start();
        }
        let x = frame.encode(DVec3::new(
            draw.within(-0.15, 0.15),
            draw.within(-0.15, 0.15),
            draw.within(-0.15, 0.15),
        ));
        let reach = draw.within(0.001, 0.05) as f32;
        let all: Vec<u32> =
            (0..count).filter(|&facet| walls.nearest_point(facet, x, &frame).distance <= reach).collect();
        let listed: Vec<u32> = walls.facets_within(x, reach, &frame).collect();
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
        listed += walls.facets_within(frame.encode(x), 1.35 * RADIUS as f32, &frame).count();
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
