//! Where a ray meets triangles (Möller & Trumbore 1997).

use glam::DVec3;

/// Share of a triangle by which it is taken larger, so that a ray through a common edge meets one of two neighbours.
const RIM: f64 = 1e-9;
/// Sine of the angle to its plane from which a ray counts as parallel to a triangle.
const PARALLEL: f64 = 1e-12;

/// Distance along a unit vector from a point to the nearest of some triangles, in metres; none if the ray meets none. A triangle that lies
/// along the ray does not count.
pub fn first_hit<'a>(
    triangles: impl IntoIterator<Item = &'a [DVec3; 3]>,
    from: DVec3,
    way: DVec3,
) -> Option<f64> {
    triangles.into_iter().filter_map(|triangle| hit(triangle, from, way)).min_by(f64::total_cmp)
}

/// Distance to a triangle: from + way · t = a + u (b − a) + v (c − a).
fn hit([a, b, c]: &[DVec3; 3], from: DVec3, way: DVec3) -> Option<f64> {
    let (to_b, to_c) = (b - a, c - a);
    let across = way.cross(to_c);
    let determinant = to_b.dot(across);
    if determinant.abs() <= PARALLEL * to_b.length() * to_c.length() {
        return None;
    }
    let offset = from - a;
    let turned = offset.cross(to_b);
    let [u, v, t] = [offset.dot(across), way.dot(turned), to_c.dot(turned)].map(|sum| sum / determinant);
    (u >= -RIM && v >= -RIM && u + v <= 1.0 + RIM && t >= 0.0).then_some(t)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A square of side 2 m across x.
    fn wall(x: f64) -> [[DVec3; 3]; 2] {
        let [a, b] = [[-1.0, -1.0], [1.0, -1.0]].map(|[y, z]| DVec3::new(x, y, z));
        let [c, d] = [[1.0, 1.0], [-1.0, 1.0]].map(|[y, z]| DVec3::new(x, y, z));
        [[a, b, c], [a, c, d]]
    }

    #[test]
    fn the_nearest_wall_ahead_is_met_from_both_of_its_sides() {
        let walls = [wall(3.0), wall(2.0), wall(-0.5)].concat();
        let from = DVec3::new(0.25, 0.5, -0.5);
        assert_eq!(first_hit(&walls, from, DVec3::X), Some(1.75));
        assert_eq!(first_hit(&walls, from, DVec3::NEG_X), Some(0.75));
        assert_eq!(first_hit(&walls, from, DVec3::Y), None, "along the walls");
        assert_eq!(first_hit(&walls, from.with_z(1.5), DVec3::X), None, "above the walls");
        let oblique = first_hit(&walls, from.with_y(-0.75), DVec3::new(4.0, 3.0, 0.0) / 5.0);
        assert!((oblique.unwrap() - 1.75 / 0.8).abs() < 1e-12, "{oblique:?}");
    }

    #[test]
    fn a_ray_through_the_diagonal_of_a_plate_meets_it() {
        for k in 0..1000 {
            let share = 2.0 * f64::from(k) / 999.0 - 1.0;
            assert!(first_hit(&wall(0.3), DVec3::new(0.1, share, share), DVec3::X).is_some(), "{share}");
        }
    }
}
