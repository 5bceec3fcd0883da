//! Meshes and blocks as products: what is inside a closed mesh, and what a lattice makes of it.

mod common;
#[path = "common/stl.rs"]
mod stl;

use std::sync::Arc;
use std::time::{Duration, Instant};

use common::{RADIUS, assert_close, block};
use glam::{DQuat, DVec3, EulerRot};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use roost_solver::mesh::{Meshes, Units};
use roost_solver::scenario::Fill;
use roost_solver::shape::lattice::{LatticeBond, MetaParticle};
use roost_solver::shape::solid::Solid;
use roost_solver::shape::{Shape, ShapeError, from_block, from_mesh};
use stl::{Triangle, ball, binary, cuboid, grid, mesh, moved, quad, turned};

fn solid(triangles: &[Triangle]) -> Solid {
    Solid::new(&mesh(triangles)).expect("closed")
}

/// An L: a box of 80 × 80 × 40 mm without its quarter x > 40 mm, y > 40 mm, each side cut into squares of 10 mm.
fn angle_iron() -> Vec<Triangle> {
    let (mut triangles, cell) = (Vec::new(), 0.01);
    let filled = |i: i32, j: i32, k: i32| {
        (0..8).contains(&i) && (0..8).contains(&j) && (0..4).contains(&k) && (i < 4 || j < 4)
    };
    for (i, j, k) in (0..256).map(|n| (n % 8, n / 8 % 8, n / 64)).filter(|&(i, j, k)| filled(i, j, k)) {
        let (low, step) = (DVec3::new(f64::from(i), f64::from(j), f64::from(k)) * cell, DVec3::splat(cell));
        let (x, y, z) = (DVec3::X * cell, DVec3::Y * cell, DVec3::Z * cell);
        let high = low + step;
        let sides = [
            (filled(i - 1, j, k), quad(low, z, y)),
            (filled(i, j - 1, k), quad(low, x, z)),
            (filled(i, j, k - 1), quad(low, y, x)),
            (filled(i + 1, j, k), quad(high, -y, -z)),
            (filled(i, j + 1, k), quad(high, -z, -x)),
            (filled(i, j, k + 1), quad(high, -x, -y)),
        ];
        triangles.extend(sides.into_iter().filter(|(hidden, _)| !hidden).flat_map(|(_, side)| side));
    }
    triangles
}

/// Whether a point is in the angle iron, its surface included, seen from the centre of its box.
fn in_angle_iron(p: DVec3) -> bool {
    let hair = 1e-9;
    let p = p + DVec3::new(0.04, 0.04, 0.02);
    let in_box = p.cmpge(DVec3::splat(-hair)).all() && p.cmple(DVec3::new(0.08, 0.08, 0.04) + hair).all();
    in_box && (p.x <= 0.04 + hair || p.y <= 0.04 + hair)
}

#[test]
fn inside_test_is_correct_for_rays_through_edges_and_corners() {
    // Every ray meets edges and corners: all points lie on the planes that the triangles' corners lie on, or midway.
    let shape = solid(&angle_iron());
    let mut inside = 0;
    for n in 0..41 * 41 * 21 {
        let cell =
            DVec3::new(f64::from(n % 41) - 20.0, f64::from(n / 41 % 41) - 20.0, f64::from(n / 1681) - 10.0);
        let p = cell * 0.0025;
        assert_eq!(shape.contains(p), in_angle_iron(p), "{p}");
        inside += usize::from(shape.contains(p));
    }
    // 33 × 33 points without the 16 × 16 beyond the notch, 17 high.
    assert_eq!(inside, (33 * 33 - 16 * 16) * 17);
    assert_close(shape.volume_m3(), 0.04 * 0.08 * 0.06, 1e-6);
}

#[test]
fn inside_test_does_not_depend_on_mesh_orientation() {
    let mut draw = ChaCha8Rng::seed_from_u64(1);
    let mut share = || f64::from(draw.next_u32()) / f64::from(u32::MAX);
    for k in 0..20 {
        let turn =
            DQuat::from_euler(EulerRot::ZYX, f64::from(k) * 0.3, f64::from(k) * 0.7, f64::from(k) * 1.1);
        let there =
            moved(&angle_iron(), |p| turn * (p - DVec3::new(0.04, 0.04, 0.02)) + DVec3::new(0.5, -0.3, 0.7));
        let mesh = mesh(&there);
        let shape = Solid::new(&mesh).expect("closed");
        let centre = (mesh.low + mesh.high) / 2.0 - DVec3::new(0.5, -0.3, 0.7);
        for _ in 0..500 {
            let p = (DVec3::new(share(), share(), share()) - 0.5) * 0.1;
            // Nearer to the surface than this the rounding of the file decides.
            let clear = |p: DVec3| {
                let shaken = (0..8)
                    .map(|k| DVec3::new(f64::from(k & 1), f64::from(k >> 1 & 1), f64::from(k >> 2)) - 0.5);
                shaken.map(|d| in_angle_iron(p + d * 1e-6)).all(|inside| inside == in_angle_iron(p))
            };
            assert!(
                !clear(p) || shape.contains(turn * p - centre) == in_angle_iron(p),
                "{p} turned {k} times"
            );
        }
    }
}

#[test]
fn inside_test_of_a_ball_matches_its_radius() {
    let shape = solid(&ball(0.05, 5));
    let mut draw = ChaCha8Rng::seed_from_u64(2);
    let mut share = || f64::from(draw.next_u32()) / f64::from(u32::MAX);
    for _ in 0..20_000 {
        let p = (DVec3::new(share(), share(), share()) - 0.5) * 0.12;
        // The triangles' middles lie at most 0.06 mm within the ball.
        if p.length() < 0.05 - 6e-5 || p.length() > 0.05 + 1e-7 {
            assert_eq!(shape.contains(p), p.length() < 0.05, "{p}");
        }
        let whole = shape.contains_sphere(p, 0.004);
        if p.length() < 0.046 - 6e-5 || p.length() > 0.046 + 1e-6 {
            assert_eq!(whole, p.length() < 0.046, "{p}");
        }
    }
}

#[test]
fn overlapping_bodies_are_merged_and_inverted_bodies_are_hollows() {
    let hollow = [ball(0.05, 4), turned(&ball(0.03, 4))].concat();
    let shape = solid(&hollow);
    for (x, inside) in [(0.0, false), (0.029, false), (0.031, true), (0.049, true), (0.051, false)] {
        assert_eq!(shape.contains(DVec3::new(x * 0.6, x * -0.8, 0.0)), inside, "{x}");
    }
    assert_close(shape.volume_m3(), 4.0 / 3.0 * std::f64::consts::PI * (1.25e-4 - 2.7e-5), 0.01);
    let two = [ball(0.05, 4), moved(&ball(0.05, 4), |p| p + DVec3::X * 0.06)].concat();
    let shape = solid(&two);
    for (x, inside) in [(-0.079, true), (-0.03, true), (0.0, true), (0.079, true), (0.081, false)] {
        assert_eq!(shape.contains(DVec3::X * x), inside, "{x}");
    }
    // What both enclose counts once: two balls less a lens of π (4 r + d)(2 r − d)² / 12.
    let lens = std::f64::consts::PI * (4.0 * 0.05 + 0.06) * (2.0f64 * 0.05 - 0.06).powi(2) / 12.0;
    let union_m3 = 2.0 * 4.0 / 3.0 * std::f64::consts::PI * 0.05f64.powi(3) - lens;
    let filled = from_mesh(&mesh(&two), 0.004, Fill::Volume, 1).expect("closed");
    assert_close(filled.points.len() as f64 * 0.008f64.powi(3), union_m3, 0.03);
    // One that faces inwards all over is as full as any.
    let inwards = solid(&turned(&ball(0.05, 4)));
    assert!(inwards.contains(DVec3::ZERO) && inwards.volume_m3() > 0.0);
}

fn same_points(a: &MetaParticle, b: &MetaParticle) -> bool {
    a.points.len() == b.points.len() && a.points.iter().zip(&b.points).all(|(p, q)| p.distance(*q) < 1e-12)
}

#[test]
fn mesh_of_a_block_has_the_same_fill_as_the_block() {
    for n in [[3, 4, 5], [9, 9, 3], [1, 1, 1], [7, 2, 6]] {
        let by_hand = block(n.map(|n| n as i32)).meta;
        let made = from_block(n, RADIUS, 1).expect("fine");
        assert!(same_points(&made, &by_hand) && made.bonds.len() == by_hand.bonds.len());
        let sorted = |bonds: &[LatticeBond]| {
            let mut bonds = bonds.to_vec();
            bonds.sort_unstable();
            bonds
        };
        // By hand, x runs fastest, then y, then z: as in a fill.
        assert_eq!(made.bonds, sorted(&by_hand.bonds));
        assert_close(made.volume_m3, by_hand.volume_m3, 1e-12);
        assert_eq!(made.bounding_radius_m, made.points[0].length());

        let size = DVec3::from(n.map(f64::from)) * 2.0 * RADIUS;
        // Somewhere in the file, and cut into more triangles.
        let there = DVec3::new(0.1, -0.2, 0.05);
        let mesh = mesh(&cuboid(there, there + size, 3));
        for fill in [Fill::Centres, Fill::WholeSpheres, Fill::Volume] {
            let filled = from_mesh(&mesh, RADIUS, fill, 1).expect("closed");
            assert!(same_points(&filled, &made), "{n:?}: {} points", filled.points.len());
            assert_eq!(filled.bonds, made.bonds);
            assert_close(filled.volume_m3, made.volume_m3, 1e-6);
        }
        // A hair too small for whole spheres.
        let smaller = stl::mesh(&cuboid(there, there + size - 1e-5, 3));
        assert!(same_points(&from_mesh(&smaller, RADIUS, Fill::Centres, 1).expect("closed"), &made));
        let whole = from_mesh(&smaller, RADIUS, Fill::WholeSpheres, 1);
        assert!(whole.is_err() || whole.unwrap().points.len() < made.points.len());
    }
    let diagonals = from_block([2, 2, 1], RADIUS, 2).expect("fine").bonds.len();
    assert_eq!(diagonals, 6, "four edges and two diagonals");
}

#[test]
fn a_lattice_plane_on_a_face_belongs_to_the_shape() {
    // 15 layers of 16/3 mm: one lies on the notch at 40 mm.
    let radius = 0.04 / 15.0;
    let notch = from_mesh(&mesh(&angle_iron()), radius, Fill::Centres, 1).expect("closed");
    assert_eq!(notch.points.len(), (15 * 15 - 7 * 7) * 8);
    // And wherever the file has it: the fill is the same.
    let elsewhere = mesh(&moved(&angle_iron(), |p| p + DVec3::new(0.123, -0.457, 0.789)));
    assert!(same_points(&from_mesh(&elsewhere, radius, Fill::Centres, 1).expect("closed"), &notch));
}

#[test]
fn a_lattice_fills_a_ball_to_its_volume() {
    let mesh = mesh(&ball(0.05, 4));
    let fine = from_mesh(&mesh, 0.0015, Fill::Centres, 1).expect("closed");
    assert_close(fine.points.len() as f64 * 0.003f64.powi(3), fine.volume_m3, 0.01);
    let whole = from_mesh(&mesh, 0.004, Fill::WholeSpheres, 1).expect("closed");
    // A sphere of 4 mm is whole within 46 mm of the middle, 0.25 mm less at the triangles' middles.
    let farthest = whole.points.iter().map(|p| p.length()).fold(0.0, f64::max);
    assert!(farthest < 0.046 && farthest > 0.043, "{farthest}");
    // At any radius, as many cells as have the volume of the ball, within half a group of equally covered cells. A ball has the largest groups.
    for radius in [0.003, 0.004, 0.0055, 0.007] {
        let filled = from_mesh(&mesh, radius, Fill::Volume, 1).expect("closed");
        assert_close(filled.points.len() as f64 * (2.0 * radius).powi(3), filled.volume_m3, 0.05);
    }
    let refused = from_mesh(&mesh, 0.001, Fill::Volume, 1).expect_err("too fine");
    assert!(refused.to_string().contains("at most 5e4 are taken by volume: a larger radius"), "{refused}");
    let centres = from_mesh(&mesh, 0.004, Fill::Centres, 1).expect("closed");
    assert!(whole.points.len() < centres.points.len());
}

#[test]
fn invalid_product_mesh_is_refused_with_the_reason() {
    let fill = |triangles: &[Triangle], radius| from_mesh(&mesh(triangles), radius, Fill::Centres, 1);
    let size = DVec3::new(0.08, 0.05, 0.02);
    let sound = cuboid(DVec3::ZERO, size, 2);
    let open = fill(&sound[1..], RADIUS).expect_err("open");
    assert_eq!(open, ShapeError::Open { edges: 3 });
    assert!(open.to_string().contains("3 of its edges"));
    let mut wrong = sound.clone();
    wrong[0].swap(1, 2);
    assert_eq!(fill(&wrong, RADIUS), Err(ShapeError::InconsistentNormals { edges: 3 }));
    let sheet = grid(4, 4, |i, j| DVec3::new(i as f64, j as f64, 0.0) * 0.02);
    let flat = [sheet.clone(), turned(&sheet)].concat();
    assert!(matches!(fill(&flat, RADIUS), Err(ShapeError::NoVolume { volume_m3 }) if volume_m3 < 1e-15));
    let start = Instant::now();
    let fine = fill(&sound, 1e-5).expect_err("too fine");
    assert!(matches!(fine, ShapeError::TooFine { cells, .. } if cells > 9e9), "{fine}");
    assert!(matches!(from_block([u32::MAX, 1, 0], RADIUS, 1), Err(ShapeError::TooFine { .. })));
    assert!(start.elapsed() < Duration::from_secs(1));
    // A ring has nothing at its middle.
    let ring =
        [cuboid(DVec3::ZERO, DVec3::ONE * 0.06, 1), turned(&cuboid(DVec3::ONE * 0.01, DVec3::ONE * 0.05, 1))];
    // Twice: what is remembered is refused as well.
    for _ in 0..2 {
        let none = fill(&ring.concat(), 0.031).expect_err("nothing fits");
        assert!(matches!(none, ShapeError::NoLatticePoint { radius_m: 0.031, .. }), "{none}");
        assert!(none.to_string().contains("0.031 m"));
        assert!(matches!(from_block([3, 0, 3], RADIUS, 1), Err(ShapeError::NoLatticePoint { .. })));
    }
}

#[test]
fn mesh_with_a_large_disconnected_part_is_refused() {
    // A ball of 10 mm beside one of 50 mm is 1 in 126, one of 25 mm 1 in 9.
    let beside =
        |radius: f64| mesh(&[ball(0.05, 4), moved(&ball(radius, 4), |p| p + DVec3::X * 0.1)].concat());
    let fill = |radius: f64| from_mesh(&beside(radius), 0.0015, Fill::Centres, 1);
    assert!(fill(0.01).is_ok());
    let Err(ShapeError::Disconnected { kept, discarded }) = fill(0.025) else { panic!("taken") };
    assert_close(kept as f64 / discarded as f64, 8.0, 0.05);
}

#[test]
fn fills_are_cached_by_file_units_radius_fill_and_bonds() {
    let mut meshes = Meshes::default();
    let digest = meshes.insert(&binary(&cuboid(DVec3::ZERO, DVec3::new(8.0, 5.0, 4.0), 1))).expect("sound");
    let in_units = |units| meshes.get(&digest).expect("here").in_units(units).expect("sound");
    let fill = |units, radius, fill, reach| from_mesh(&in_units(units), radius, fill, reach).expect("closed");
    let first = fill(Units::M, 0.5, Fill::Centres, 1);
    assert!(Arc::ptr_eq(&first, &fill(Units::M, 0.5, Fill::Centres, 1)));
    let others = [
        fill(Units::Mm, 0.0005, Fill::Centres, 1),
        fill(Units::M, 0.4, Fill::Centres, 1),
        fill(Units::M, 0.5, Fill::Centres, 2),
    ];
    assert!(others.iter().all(|other| other.points != first.points || other.bonds != first.bonds));
    assert!(!Arc::ptr_eq(&first, &fill(Units::M, 0.5, Fill::WholeSpheres, 1)));
    // 8 mm leave room for one centre, 8 m for many.
    assert_eq!(fill(Units::Mm, 0.5, Fill::Centres, 1).points.len(), 1);
    assert!(Arc::ptr_eq(&from_block([2, 3, 4], 0.01, 1).unwrap(), &from_block([2, 3, 4], 0.01, 1).unwrap()));
    assert_ne!(from_block([2, 3, 4], 0.01, 1), from_block([4, 3, 2], 0.01, 1));
}

#[test]
fn a_hundred_thousand_triangles_are_filled_in_seconds() {
    let triangles = ball(0.05, 7);
    assert_eq!(triangles.len(), 131_072);
    let start = Instant::now();
    let mesh = mesh(&triangles);
    let read_s = start.elapsed();
    for fill in [Fill::Centres, Fill::WholeSpheres, Fill::Volume] {
        let start = Instant::now();
        let filled = from_mesh(&mesh, 0.0021, fill, 1).expect("closed");
        println!("read in {read_s:?}, filled with {} in {:?}", filled.points.len(), start.elapsed());
        assert!(start.elapsed() < Duration::from_secs(10), "{:?}", start.elapsed());
    }
}
