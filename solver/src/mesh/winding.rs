//! How often triangles wind round a point, by the solid angles that they fill as seen from it (van Oosterom & Strackee 1983).

use std::f64::consts::TAU;

use glam::DVec3;

/// The sum of solid angles over 4π: seen from within a closed surface that faces outwards 1, or −1 if it faces inwards; from
/// outside 0; and of an open one, or of one whose triangles face this way and that, anything between.
pub fn winding(triangles: &[[DVec3; 3]], p: DVec3) -> f64 {
    triangles.iter().map(|corners| solid_angle(corners.map(|corner| corner - p))).sum::<f64>() / (2.0 * TAU)
}

/// Of a triangle seen from the origin, in steradian: positive from behind.
fn solid_angle([a, b, c]: [DVec3; 3]) -> f64 {
    let [la, lb, lc] = [a, b, c].map(DVec3::length);
    let below = la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb;
    2.0 * a.dot(b.cross(c)).atan2(below)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tetrahedron_winds_once_round_what_is_in_it() {
        let [o, x, y, z] = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
        let faces = [[o, y, x], [o, x, z], [o, z, y], [x, y, z]];
        assert!((winding(&faces, DVec3::splat(0.2)) - 1.0).abs() < 1e-12);
        assert!(winding(&faces, DVec3::splat(0.4)).abs() < 1e-12);
        assert!((winding(&faces.map(|[a, b, c]| [a, c, b]), DVec3::splat(0.01)) + 1.0).abs() < 1e-12);
        // Without one face: seen from its corner at the origin's end, the slanted one fills the octant.
        assert!((winding(&faces[3..], DVec3::ZERO) - 1.0 / 8.0).abs() < 1e-12);
    }
}
