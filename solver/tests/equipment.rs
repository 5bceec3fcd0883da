//! Equipment against Hertz: both sides of a plate, its diagonal, rims, edges, corners, far, tilted and thin.

mod common;

use std::f64::consts::PI;

use common::{
    BLINK, Bench, G, RADIUS, assert_close, assert_force, hertz, law, plate, push, push_in, sphere, weighing,
};
use glam::{DQuat, DVec3};
use roost_solver::equipment::{Motion, Presence, Surface, SurfaceKind};

fn surface(triangles: Vec<[DVec3; 3]>) -> Surface {
    Surface {
        name: "made up".into(),
        kind: SurfaceKind::Equipment,
        friction: None,
        motion: Motion::Fixed,
        presence: Presence::Always,
        closed: None,
        triangles,
    }
}

fn quad(corner: DVec3, u: DVec3, v: DVec3) -> [[DVec3; 3]; 2] {
    [[corner, corner + u, corner + u + v], [corner, corner + u + v, corner + v]]
}

/// The cube from 0 to 0.1 m: 12 triangles in one surface.
fn cube() -> Surface {
    let (o, far) = (DVec3::ZERO, DVec3::splat(0.1));
    let sides = [(DVec3::X, DVec3::Y), (DVec3::Y, DVec3::Z), (DVec3::Z, DVec3::X)];
    let both = |(u, v): (DVec3, DVec3)| [quad(o, u * 0.1, v * 0.1), quad(far, u * -0.1, v * -0.1)];
    surface(sides.into_iter().flat_map(both).flatten().collect())
}

#[test]
fn a_plate_acts_on_both_of_its_sides() {
    let plates = [plate(SurfaceKind::Equipment)];
    for overlap in [1e-4, 1e-3, 3.5e-3] {
        let centre = DVec3::new(0.03, 0.1, RADIUS - overlap);
        assert_force(push(&plates, centre), DVec3::Z * hertz(overlap), 1e-3);
        assert_force(push(&plates, -centre), DVec3::NEG_Z * hertz(overlap), 1e-3);
    }
    assert_eq!(push(&plates, DVec3::Z * RADIUS * 1.001), DVec3::ZERO);
    // And what comes from below is thrown back down.
    let mut scene = sphere(plates.to_vec(), DVec3::Z * -0.01, 1e-5);
    scene.bodies[0].velocity = DVec3::Z;
    let mut bench = Bench::new(&scene);
    bench.steps(3000);
    assert_close(bench.velocity(0).z, -1.0, 1e-2);
}

#[test]
fn contact_force_is_continuous_across_the_diagonal_of_a_plate() {
    // The plate's two triangles meet along x = y.
    let plates = [plate(SurfaceKind::Equipment)];
    for k in -20..=20 {
        let x = f64::from(k) * RADIUS / 10.0;
        assert_force(push(&plates, DVec3::new(x, 0.0, 0.9 * RADIUS)), DVec3::Z * hertz(0.1 * RADIUS), 1e-3);
    }
    // One that rolls across goes on as it came: friction's memory is not lost either.
    let start = DVec3::new(-0.03, 0.01, 0.0);
    let mut scene = weighing(plates.to_vec(), start, DVec3::X * 0.5, 0.5, 1e-5);
    scene.gravity = DVec3::new(1.0, 0.0, -G);
    let mut bench = Bench::new(&scene);
    bench.steps(6000);
    assert!(bench.position(0).x < 0.005, "rolls by now, and has not come to the diagonal");
    // Down 1 m/s² at the lever of a sphere that has sunk in.
    let gain = DVec3::X * 1e-3 / (1.0 + 0.4 * (RADIUS / bench.position(0).z).powi(2));
    let (mut last, mut worst) = (bench.velocity(0), 0.0f64);
    for _ in 0..80 {
        bench.steps(100);
        let v = bench.velocity(0);
        worst = worst.max((v - last - gain).length());
        last = v;
    }
    assert!(bench.position(0).x > 0.015, "has crossed the diagonal");
    assert!(worst < 3e-3 * gain.x, "a jolt of {worst} m/s");
}

#[test]
fn contact_force_of_a_free_edge_points_away_from_its_nearest_point() {
    // A gate in the plane x = 0 whose lower edge is 6 cm above the belt.
    let corner = DVec3::new(0.0, -0.1, 0.06);
    let gate =
        [Surface::parallelogram("gate", SurfaceKind::Equipment, corner, DVec3::Y * 0.2, DVec3::Z * 0.3)];
    for angle in [-80f64, -40.0, 0.0, 25.0, 89.0] {
        let down = DVec3::new(angle.to_radians().sin(), 0.0, -angle.to_radians().cos());
        let centre = DVec3::Z * 0.06 + down * 0.9 * RADIUS;
        assert_force(push(&gate, centre), down * hertz(0.1 * RADIUS), 2e-3);
    }
    // Off its corner, too.
    let out = DVec3::new(1.0, 2.0, -1.0).normalize();
    let centre = DVec3::new(0.0, 0.1, 0.06) + out * 0.9 * RADIUS;
    assert_force(push(&gate, centre), out * hertz(0.1 * RADIUS), 2e-3);
    assert_eq!(push(&gate, DVec3::Z * (0.06 - 1.01 * RADIUS)), DVec3::ZERO);
}

#[test]
fn a_convex_edge_and_a_corner_are_one_contact() {
    let cube = [cube()];
    let load = hertz(0.1 * RADIUS);
    // Just beside, just over and well past the edge between the faces x = 0 and z = 0; the diagonals of the faces
    // end in its ends.
    for out in [(-1.0, -1.0), (-1.0, -0.01), (-0.01, -1.0), (-1.0, -0.3), (-1e-4, -1.0)] {
        let out = DVec3::new(out.0, 0.0, out.1).normalize();
        for y in [0.001, 0.05, 0.0999] {
            assert_force(push(&cube, DVec3::Y * y + out * 0.9 * RADIUS), out * load, 2e-3);
        }
    }
    for out in [DVec3::NEG_ONE, DVec3::new(-1.0, -0.01, -0.01), DVec3::new(-0.5, -1.0, -0.02)] {
        let out = out.normalize();
        assert_force(push(&cube, out * 0.9 * RADIUS), out * load, 2e-3);
        assert_force(push(&cube, DVec3::splat(0.1) - out * 0.9 * RADIUS), -out * load, 2e-3);
    }
    // On a face, right up to the edge.
    for x in [0.05, 0.001, 1e-5, 0.0, -1e-5] {
        let found = push(&cube, DVec3::new(x, 0.04, -0.9 * RADIUS));
        assert_force(found, DVec3::NEG_Z * load, 5e-3);
    }
}

#[test]
fn corner_shared_by_triangles_without_a_common_edge_is_one_contact() {
    // Two sails that stand on the origin.
    let sail = |x: f64| [DVec3::ZERO, DVec3::new(x, 0.05, -0.1), DVec3::new(x, -0.05, -0.1)];
    let sails = [surface(vec![sail(0.05), sail(-0.04)])];
    assert_force(push(&sails, DVec3::Z * 0.9 * RADIUS), DVec3::Z * hertz(0.1 * RADIUS), 2e-3);
}

#[test]
fn contact_force_is_continuous_across_a_convex_edge() {
    // A ridge of 30° between two slopes: the load turns from one normal to the other and never doubles.
    let slope = 15f64.to_radians();
    let (left, right) =
        (DVec3::new(-slope.cos(), 0.0, -slope.sin()) * 0.1, DVec3::new(slope.cos(), 0.0, -slope.sin()) * 0.1);
    let low = DVec3::Y * -0.1;
    let ridge = [surface([quad(low, left, DVec3::Y * 0.2), quad(low, right, DVec3::Y * 0.2)].concat())];
    for k in -30..=30 {
        let x = f64::from(k) * RADIUS / 40.0;
        // At a constant distance from the ridge: over a slope or over the edge.
        let angle = (x / (0.9 * RADIUS)).asin();
        let out = if angle.abs() <= slope {
            DVec3::new(angle.sin(), 0.0, angle.cos())
        } else {
            DVec3::new(slope.sin() * angle.signum(), 0.0, slope.cos())
        };
        let along =
            if angle.abs() <= slope { DVec3::ZERO } else { (if x > 0.0 { right } else { left }) * 0.05 };
        let centre = DVec3::Y * 0.013 + along + out * 0.9 * RADIUS;
        assert_force(push(&ridge, centre), out * hertz(0.1 * RADIUS), 2e-3);
    }
}

#[test]
fn a_concave_corner_is_two_contacts() {
    let (y, low) = (DVec3::Y * 0.2, DVec3::Y * -0.1);
    let (floor, wall) = (quad(low, DVec3::X * 0.1, y), quad(low, DVec3::Z * 0.1, y));
    let together = [surface([floor, wall].concat())];
    let apart = [surface(floor.to_vec()), surface(wall.to_vec())];
    let centre = DVec3::new(0.9, 0.0, 0.8) * RADIUS;
    let expected = DVec3::new(hertz(0.1 * RADIUS), 0.0, hertz(0.2 * RADIUS));
    assert_force(push(&together, centre), expected, 2e-3);
    assert_force(push(&apart, centre), expected, 2e-3);
    // A blunt one of 150°: the slope is felt only past its foot.
    let slope = DVec3::new(-(30f64.to_radians().cos()), 0.0, 30f64.to_radians().sin());
    let blunt = [surface([floor, quad(low, slope * 0.1, y)].concat())];
    assert_force(push(&blunt, DVec3::new(0.6, 0.0, 0.9) * RADIUS), DVec3::Z * hertz(0.1 * RADIUS), 2e-3);
    let normal = DVec3::new(-slope.z, 0.0, slope.x) * -1.0;
    let found = push(&blunt, normal * 0.9 * RADIUS);
    let floor_overlap = RADIUS * (1.0 - 0.9 * normal.z);
    let floor_felt = if normal.x > 0.0 { hertz(floor_overlap) } else { 0.0 };
    assert_force(found, normal * hertz(0.1 * RADIUS) + DVec3::Z * floor_felt, 2e-3);
}

#[test]
fn contact_force_is_the_same_for_distant_and_tilted_surfaces() {
    let overlap = 0.02 * RADIUS;
    let turns =
        [DQuat::IDENTITY, DQuat::from_euler(glam::EulerRot::ZYX, 0.7, 0.4, -1.1), DQuat::from_rotation_x(PI)];
    for centre in [DVec3::ZERO, DVec3::X * 0.9, DVec3::new(-0.9, 0.85, 0.9)] {
        for turn in turns {
            let (u, v) = (turn * DVec3::X * 0.15, turn * DVec3::Y * 0.15);
            let plates =
                Surface::parallelogram("plate", SurfaceKind::Equipment, centre - (u + v) / 2.0, u, v);
            let normal = turn * DVec3::Z;
            let position = centre + u * 0.2 - v * 0.3 + normal * (RADIUS - overlap);
            let mut scene = sphere(vec![plates], position, BLINK);
            (scene.low, scene.high) = (DVec3::splat(-1.0), DVec3::ONE);
            // 80 µm deep: a thousandth of the force is 50 nm.
            assert_force(push_in(scene), normal * hertz(overlap), 1e-3);
        }
    }
}

#[test]
fn contact_force_does_not_depend_on_triangle_size_or_shape() {
    let load = DVec3::Z * hertz(0.1 * RADIUS);
    let centre = DVec3::Z * 0.9 * RADIUS;
    let around = |r: f64, k: u32| {
        let angle = f64::from(k) * 2.0 * PI / 3.0 + 0.1;
        DVec3::new(angle.cos(), angle.sin(), 0.0) * r
    };
    for r in [1e-5, 1e-4, 1e-3, 0.3] {
        let triangle = surface(vec![[around(r, 0), around(r, 1), around(r, 2)]]);
        assert_force(push(&[triangle], centre), load, 2e-3);
    }
    // A sliver of 1 to 800, and a plate cut into 800 of 1 to 400. (At 1 to 8000 the nearest point in f32 can be one
    // on the sliver's rim: off by less than its width.)
    let sliver = surface(vec![[DVec3::new(-0.4, -5e-4, 0.0), DVec3::new(0.4, -5e-4, 0.0), DVec3::Y * 5e-4]]);
    assert_force(push(&[sliver], centre), load, 2e-3);
    let strip = |k: i32| quad(DVec3::new(-0.4, f64::from(k) * 2e-3, 0.0), DVec3::X * 0.8, DVec3::Y * 2e-3);
    let strips = surface((-200..200).flat_map(strip).collect());
    for y in [0.0, 3e-4, 1e-3] {
        assert_force(push(std::slice::from_ref(&strips), centre + DVec3::new(0.1, y, 0.0)), load, 2e-3);
    }
    // Nothing but a line is nothing.
    let line = surface(vec![[DVec3::NEG_X, DVec3::X, DVec3::X * 0.5]]);
    assert_eq!(push(&[line], centre), DVec3::ZERO);
}

#[test]
fn sphere_centre_on_a_plate_makes_no_nan() {
    let plates = [plate(SurfaceKind::Equipment), cube()];
    for position in
        [DVec3::ZERO, DVec3::new(0.1, -0.2, 0.0), DVec3::Y * 0.05, DVec3::splat(0.1), DVec3::X * -0.4]
    {
        let mut scene = sphere(plates.to_vec(), position, 1e-5);
        scene.laws.equipment = law(true, 0.1, 0.5, 0.055);
        scene.gravity = DVec3::NEG_Z * G;
        let mut bench = Bench::new(&scene);
        assert_eq!(bench.steps(2000), None);
        assert!(bench.position(0).is_finite() && bench.velocity(0).is_finite());
        assert!(bench.velocity(0).length() < 10.0, "thrown out at no more than the overlap's energy");
    }
}
