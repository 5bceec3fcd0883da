//! The point of a triangle that is nearest to another point.

use glam::Vec3;

/// The point of a triangle nearest to `p`, by the Voronoi region of `p` (Ericson 2005, section 5.1.5).
pub fn nearest_on_triangle(p: Vec3, &[a, b, c]: &[Vec3; 3]) -> Vec3 {
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
    // Inside: by the plane, which loses less than barycentric coordinates do on a long triangle.
    let n = ab.cross(ac);
    p - n * (n.dot(ap) / n.dot(n))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_point_agrees_with_a_search() {
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
