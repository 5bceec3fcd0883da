//! STL files for tests, in millimetres as CAD programs write them.

#![allow(dead_code, reason = "each test binary uses its own part")]

use std::fmt::Write;

type Triangle = [[f32; 3]; 3];

/// A closed block at the origin; each face has `squares` × `squares` squares.
pub(crate) fn block(sides_mm: [f32; 3], squares: usize) -> Vec<Triangle> {
    let mut triangles = Vec::new();
    for (across, up, out) in [(0, 1, 2), (1, 2, 0), (2, 0, 1)] {
        let point = |i: usize, j: usize, is_far: bool| {
            let mut point = [0.0; 3];
            point[across] = sides_mm[across] * i as f32 / squares as f32;
            point[up] = sides_mm[up] * j as f32 / squares as f32;
            point[out] = if is_far { sides_mm[out] } else { 0.0 };
            point
        };
        for (i, j) in (0..squares).flat_map(|i| (0..squares).map(move |j| (i, j))) {
            for is_far in [false, true] {
                let [a, b, c, d] =
                    [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)].map(|(i, j)| point(i, j, is_far));
                // Normals point outwards, so opposite faces have opposite order.
                triangles.extend(if is_far { [[a, b, c], [a, c, d]] } else { [[a, c, b], [a, d, c]] });
            }
        }
    }
    triangles
}

/// A wall of two triangles at x = 0.
pub(crate) fn wall(width_mm: f32, height_mm: f32) -> Vec<Triangle> {
    let [a, b] = [[0.0, 0.0, 0.0], [0.0, width_mm, 0.0]];
    let [c, d] = [[0.0, width_mm, height_mm], [0.0, 0.0, height_mm]];
    vec![[a, b, c], [a, c, d]]
}

/// Walls of a hopper without top and bottom, given by length, width and height; the wall at x = 0 ends above an opening.
pub(crate) fn hopper([length, width, height]: [f32; 3], opening: f32) -> Vec<Triangle> {
    let wall = |[x, y]: [f32; 2], [to_x, to_y]: [f32; 2], low: f32| {
        let [a, b] = [[x, y, low], [to_x, to_y, low]];
        let [c, d] = [[to_x, to_y, height], [x, y, height]];
        [[a, b, c], [a, c, d]]
    };
    let side = width / 2.0;
    let walls = [
        wall([-length, -side], [-length, side], 0.0),
        wall([0.0, -side], [0.0, side], opening),
        wall([-length, -side], [0.0, -side], 0.0),
        wall([-length, side], [0.0, side], 0.0),
    ];
    walls.concat()
}

/// A binary STL file.
pub(crate) fn binary(triangles: &[Triangle]) -> Vec<u8> {
    let mut file = vec![0; 80];
    file.extend((triangles.len() as u32).to_le_bytes());
    for corners in triangles {
        file.extend([0; 12]); // the normal, which nobody reads
        corners.as_flattened().iter().for_each(|number| file.extend(number.to_le_bytes()));
        file.extend([0; 2]);
    }
    file
}

/// An ASCII STL file.
pub(crate) fn ascii(triangles: &[Triangle]) -> Vec<u8> {
    let mut file = "solid test\n".to_owned();
    for corners in triangles {
        file.push_str("facet normal 0 0 0\nouter loop\n");
        for [x, y, z] in corners {
            writeln!(file, "vertex {x} {y} {z}").expect("a string takes everything");
        }
        file.push_str("endloop\nendfacet\n");
    }
    file.push_str("endsolid test\n");
    file.into_bytes()
}
