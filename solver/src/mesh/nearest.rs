//! The point of a triangle nearest to another point, by Voronoi regions (Ericson 2005, section 5.1.5).

use glam::{DVec3, Vec3};

/// The function in one precision.
macro_rules! nearest {
    ($(#[$doc:meta])* $name:ident, $Point:ident) => {
        $(#[$doc])*
        pub fn $name(p: $Point, &[a, b, c]: &[$Point; 3]) -> $Point {
            let (ab, ac, ap) = (b - a, c - a, p - a);
            let (d1, d2) = (ab.dot(ap), ac.dot(ap));
            if d1 <= 0.0 && d2 <= 0.0 {
                return a;
            }
            let bp = p - b;
            let (d3, d4) = (ab.dot(bp), ac.dot(bp));
            if d3 >= 0.0 && d4 <= d3 {
                return b;
            }
            let vc = d1 * d4 - d3 * d2;
            if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
                return a + ab * (d1 / (d1 - d3));
            }
            let cp = p - c;
            let (d5, d6) = (ab.dot(cp), ac.dot(cp));
            if d6 >= 0.0 && d5 <= d6 {
                return c;
            }
            let vb = d5 * d2 - d1 * d6;
            if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
                return a + ac * (d2 / (d2 - d6));
            }
            let va = d3 * d6 - d5 * d4;
            if va <= 0.0 && d4 - d3 >= 0.0 && d5 - d6 >= 0.0 {
                return b + (c - b) * ((d4 - d3) / ((d4 - d3) + (d5 - d6)));
            }
            // Inside: projection on the plane loses less than barycentric coordinates do on a sliver.
            let n = ab.cross(ac);
            p - n * (n.dot(ap) / n.dot(n))
        }
    };
}

nearest! {
    /// Point of a triangle nearest to `p`. Its error is about 6e-8 of the triangle's length squared over its
    /// width: 11 µm were found on one of 300 mm by 0.5 mm.
    nearest_on_triangle, Vec3
}

nearest! {
    /// Like [`nearest_on_triangle`], also accurate for slivers.
    nearest_on_sliver, DVec3
}

/// Ratio of length to width up to which [`nearest_on_triangle`] is accurate.
const SLIVER_RATIO: f32 = 100.0;

/// Whether a triangle is a sliver, which needs [`nearest_on_sliver`].
pub fn is_sliver(&[a, b, c]: &[Vec3; 3]) -> bool {
    let longest2 = (b - a).length_squared().max((c - b).length_squared()).max((a - c).length_squared());
    longest2 > SLIVER_RATIO * (b - a).cross(c - a).length()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nearest_point_on_a_sliver_triangle_is_exact() {
        // Slivers 300 mm long and 0.5 mm to 50 µm wide, anywhere in space. Above a point of the triangle,
        // that point is the nearest.
        for k in 0..200u32 {
            let f = |m: u32| f64::from(k * m % 101) / 101.0 - 0.5;
            let along = DVec3::new(f(7), f(31), f(57)).normalize();
            let (across, up) = along.any_orthonormal_pair();
            let middle = DVec3::new(f(11), f(13), f(17)) * 0.2;
            let width = 5e-4 * 10f64.powf(f(3) - 0.5);
            let triangle =
                [middle - along * 0.15, middle + along * 0.15, middle + along * f(5) * 0.2 + across * width];
            let over = |t: f64| triangle[2] + (triangle[0] - triangle[2]) * 0.9 * t;
            let q = over(f(23) + 0.5) - across * 1e-7;
            let found = nearest_on_sliver(q + up * 0.004, &triangle);
            assert!(found.distance(q) < 1e-12, "{k}: off by {:e}", found.distance(q));
            assert!(is_sliver(&triangle.map(|p| p.as_vec3())));
        }
        assert!(!is_sliver(&[Vec3::ZERO, Vec3::X, Vec3::Y * 0.02]));
    }

    #[test]
    fn nearest_point_on_a_triangle_agrees_with_a_brute_force_search() {
        let triangle = [Vec3::ZERO, Vec3::new(1.0, 0.2, 0.0), Vec3::new(0.3, 0.9, 0.4)];
        let [a, b, c] = triangle;
        for k in 0..500u32 {
            let f = |m: u32| (k * m % 101) as f32 / 101.0 * 3.0 - 1.0;
            let p = Vec3::new(f(7), f(31), f(57));
            let mut best = f32::INFINITY;
            for i in 0..=60 {
                for j in 0..=60 - i {
                    let q = a + (b - a) * (i as f32 / 60.0) + (c - a) * (j as f32 / 60.0);
                    best = best.min(p.distance(q));
                }
            }
            let found = p.distance(nearest_on_triangle(p, &triangle));
            assert!(found <= best + 1e-6 && found > best - 0.02, "{p}: {found} against {best}");
        }
    }
}
