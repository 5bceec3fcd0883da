//! Winding number of a set of triangles about a point, by solid angles (van Oosterom & Strackee 1983).

use std::f64::consts::TAU;

use glam::DVec3;

/// Sum of solid angles over 4π. Inside a closed surface it is 1, or −1 if the triangles face inwards; outside
/// it is 0. Open or misoriented surfaces give values in between.
pub fn winding(triangles: &[[DVec3; 3]], p: DVec3) -> f64 {
    triangles.iter().map(|corners| solid_angle(corners.map(|corner| corner - p))).sum::<f64>() / (2.0 * TAU)
}

/// Solid angle of a triangle seen from the origin, in steradian; positive from behind.
fn solid_angle([a, b, c]: [DVec3; 3]) -> f64 {
    let [la, lb, lc] = [a, b, c].map(DVec3::length);
    let below = la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb;
    2.0 * a.dot(b.cross(c)).atan2(below)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn winding_number_is_1_inside_a_tetrahedron_and_0_outside() {
        let [o, x, y, z] = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
        let faces = [[o, y, x], [o, x, z], [o, z, y], [x, y, z]];
        assert!((winding(&faces, DVec3::splat(0.2)) - 1.0).abs() < 1e-12);
        assert!(winding(&faces, DVec3::splat(0.4)).abs() < 1e-12);
        assert!((winding(&faces.map(|[a, b, c]| [a, c, b]), DVec3::splat(0.01)) + 1.0).abs() < 1e-12);
        // Without one face, seen from the corner at the origin, the slanted face fills the octant.
        assert!((winding(&faces[3..], DVec3::ZERO) - 1.0 / 8.0).abs() < 1e-12);
    }
}
