//! Facets: the flat parts of a surface. A sphere has at most one contact with a facet.
//!
//! Triangles that share an edge and a plane form one facet, and the contact is with the nearest point of the
//! whole facet: the edges inside it cannot be felt. Two facets that meet at an edge can both be near; the
//! contact with the one whose nearest point lies on the shared edge is then no contact of its own (`meets`).

use glam::{DVec3, Vec3};

/// A flat part of a surface.
#[derive(Clone, Debug, PartialEq)]
pub struct Facet {
    /// Corners of its triangles in metres, relative to the surface's anchor.
    pub triangles: Vec<[Vec3; 3]>,
    /// Indices, within the surface, of the facets that share a corner with it.
    pub meets: Vec<u32>,
}

/// Corners nearer than this are the same, in metres.
const WELD: f64 = 1e-7;

/// Splits a surface's triangles into facets, relative to an anchor. Triangles without area are dropped.
pub fn facets(triangles: &[[DVec3; 3]], anchor: DVec3) -> Vec<Facet> {
    let triangles: Vec<[DVec3; 3]> = triangles.iter().copied().filter(|t| doubled_area(t) > 1e-14).collect();
    let same = |a: DVec3, b: DVec3| a.distance(b) < WELD;
    let shared =
        |a: &[DVec3; 3], b: &[DVec3; 3]| a.iter().filter(|&&p| b.iter().any(|&q| same(p, q))).count();
    let coplanar = |a: &[DVec3; 3], b: &[DVec3; 3]| {
        let (n, m) = (normal(a), normal(b));
        n.dot(m).abs() > 1.0 - 1e-9 && (b[0] - a[0]).dot(n).abs() < WELD
    };
    let mut groups: Vec<Vec<usize>> = Vec::new();
    let mut free: Vec<usize> = (0..triangles.len()).collect();
    while !free.is_empty() {
        let mut group = vec![free.remove(0)];
        let mut next = 0;
        while next < group.len() {
            let a = &triangles[group[next]];
            let joins = |k: &usize| shared(a, &triangles[*k]) == 2 && coplanar(a, &triangles[*k]);
            let (joined, rest) = free.into_iter().partition(joins);
            free = rest;
            group.extend::<Vec<usize>>(joined);
            next += 1;
        }
        groups.push(group);
    }
    let touching = |g: &[usize], h: &[usize]| {
        g.iter().any(|&a| h.iter().any(|&b| shared(&triangles[a], &triangles[b]) > 0))
    };
    (0..groups.len())
        .map(|g| Facet {
            triangles: groups[g].iter().map(|&k| triangles[k].map(|p| (p - anchor).as_vec3())).collect(),
            meets: (0..groups.len())
                .filter(|&h| h != g && touching(&groups[g], &groups[h]))
                .map(|h| h as u32)
                .collect(),
        })
        .collect()
}

fn normal([a, b, c]: &[DVec3; 3]) -> DVec3 {
    (b - a).cross(c - a).normalize()
}

fn doubled_area([a, b, c]: &[DVec3; 3]) -> f64 {
    (b - a).cross(c - a).length()
}

impl Facet {
    /// The point of the facet nearest to `p`, both relative to the surface's anchor, in metres; none without triangles.
    pub fn nearest(&self, p: Vec3) -> Option<Vec3> {
        let mut best: Option<(f32, Vec3)> = None;
        for triangle in &self.triangles {
            let q = nearest_on_triangle(p, triangle);
            let d = p - q;
            let distance2 = d.dot(d);
            if best.is_none_or(|(least, _)| distance2 < least) {
                best = Some((distance2, q));
            }
        }
        best.map(|(_, q)| q)
    }
}

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

    fn quad(corner: DVec3, u: DVec3, v: DVec3) -> Vec<[DVec3; 3]> {
        vec![[corner, corner + u, corner + u + v], [corner, corner + u + v, corner + v]]
    }

    #[test]
    fn a_box_has_six_facets_that_each_meet_four() {
        let (o, far) = (DVec3::ZERO, DVec3::ONE);
        let mut triangles = Vec::new();
        for (u, v) in [(DVec3::X, DVec3::Y), (DVec3::Y, DVec3::Z), (DVec3::Z, DVec3::X)] {
            triangles.extend(quad(o, u, v));
            triangles.extend(quad(far, -u, -v));
        }
        let facets = facets(&triangles, DVec3::ZERO);
        assert_eq!(facets.len(), 6);
        assert!(facets.iter().all(|facet| facet.triangles.len() == 2 && facet.meets.len() == 4));
    }

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

    #[test]
    fn triangles_without_area_are_dropped() {
        let flat = [[DVec3::ZERO, DVec3::X, DVec3::X * 2.0]];
        assert!(facets(&flat, DVec3::ZERO).is_empty());
    }
}
