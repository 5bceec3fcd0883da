//! Triangles of simple bodies, facing outwards, and the files that CAD programs would write of them.
#![allow(dead_code, unreachable_pub, reason = "each test binary uses some of these")]

use glam::DVec3;
use roost_solver::mesh::{Mesh, Meshes, Units};

pub type Triangle = [DVec3; 3];

/// A binary file with that header, coordinates rounded to `f32`.
pub fn binary_with(header: &[u8], triangles: &[Triangle]) -> Vec<u8> {
    let mut bytes = header.to_vec();
    bytes.resize(80, 0);
    bytes.extend((triangles.len() as u32).to_le_bytes());
    for triangle in triangles {
        bytes.extend([0; 12]);
        let numbers = triangle.iter().flat_map(|corner| corner.as_vec3().to_array());
        bytes.extend(numbers.flat_map(f32::to_le_bytes));
        bytes.extend([0; 2]);
    }
    bytes
}

/// A binary file.
pub fn binary(triangles: &[Triangle]) -> Vec<u8> {
    binary_with(b"written by a test", triangles)
}

/// An ASCII file.
pub fn ascii(triangles: &[Triangle]) -> String {
    let facet = |triangle: &Triangle| {
        let vertex = |p: &DVec3| format!("      vertex {} {} {}\n", p.x, p.y, p.z);
        let corners: String = triangle.iter().map(vertex).collect();
        format!("  facet normal 0 0 0\n    outer loop\n{corners}    endloop\n  endfacet\n")
    };
    let facets: String = triangles.iter().map(facet).collect();
    format!("solid made by a test\n{facets}endsolid made by a test\n")
}

/// The mesh of a file of triangles in metres.
pub fn mesh(triangles: &[Triangle]) -> Mesh {
    let mut meshes = Meshes::default();
    let digest = meshes.insert(&binary(triangles)).expect("a sound file");
    meshes.get(&digest).expect("it was put there").in_units(Units::M).expect("a sound mesh")
}

/// Two triangles that face along u × v.
pub fn quad(corner: DVec3, u: DVec3, v: DVec3) -> [Triangle; 2] {
    [[corner, corner + u, corner + u + v], [corner, corner + u + v, corner + v]]
}

/// A box between two corners, each of its sides cut into n × n squares.
pub fn cuboid(low: DVec3, high: DVec3, n: usize) -> Vec<Triangle> {
    let size = high - low;
    let (x, y, z) = (DVec3::X * size.x, DVec3::Y * size.y, DVec3::Z * size.z);
    let sides = [(low, y, x), (low, z, y), (low, x, z), (high, -x, -y), (high, -y, -z), (high, -z, -x)];
    let mut triangles = Vec::new();
    for (corner, u, v) in sides {
        for k in 0..n * n {
            let at = |i: usize, j: usize| corner + u * (i as f64 / n as f64) + v * (j as f64 / n as f64);
            let (i, j) = (k % n, k / n);
            let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    triangles
}

/// A surface over a grid of n × m cells: `at(i, j)` are its points.
pub fn grid(n: usize, m: usize, at: impl Fn(usize, usize) -> DVec3) -> Vec<Triangle> {
    let cell = |k: usize| {
        let (i, j) = (k % n, k / n);
        let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
        [[a, b, c], [a, c, d]]
    };
    (0..n * m).flat_map(cell).collect()
}

/// A ball about the origin, from an octahedron whose edges are halved `times` times: 8 · 4^times triangles.
pub fn ball(radius: f64, times: u32) -> Vec<Triangle> {
    let mut triangles: Vec<Triangle> = Vec::new();
    for k in 0..8 {
        let sign = |bit: i32| f64::from(1 - 2 * (k >> bit & 1));
        let [x, y, z] = [DVec3::X * sign(0), DVec3::Y * sign(1), DVec3::Z * sign(2)];
        triangles.push(if sign(0) * sign(1) * sign(2) > 0.0 { [x, y, z] } else { [x, z, y] });
    }
    for _ in 0..times {
        let quarters = |&[a, b, c]: &Triangle| {
            let [ab, bc, ca] = [(a + b).normalize(), (b + c).normalize(), (c + a).normalize()];
            [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
        };
        triangles = triangles.iter().flat_map(quarters).collect();
    }
    triangles.iter().map(|corners| corners.map(|p| p * radius)).collect()
}

/// The same triangles facing the other way.
pub fn turned(triangles: &[Triangle]) -> Vec<Triangle> {
    triangles.iter().map(|&[a, b, c]| [a, c, b]).collect()
}

/// The same triangles somewhere else.
pub fn moved(triangles: &[Triangle], to: impl Fn(DVec3) -> DVec3) -> Vec<Triangle> {
    triangles.iter().map(|corners| corners.map(&to)).collect()
}
