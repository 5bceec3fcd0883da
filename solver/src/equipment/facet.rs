//! Facets: the flat parts of a surface. A sphere has at most one contact with a facet.
//!
//! Triangles that share an edge and a plane form one facet. Contact is with the nearest point of the whole
//! facet, so its inner edges have no effect. [`crate::walls`] decides which of several facets near a sphere
//! act.

use glam::{DVec3, Vec3};

use crate::mesh::bvh::{Aabb, Bvh};
use crate::mesh::nearest::{is_sliver, nearest_on_sliver, nearest_on_triangle};
use crate::mesh::weld::{WELD_M, weld};
use crate::mesh::{NO_AREA_M2, doubled_area};

/// A flat part of a surface.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Facet {
    /// Corners of its triangles in metres, relative to the anchor of the surface.
    pub triangles: Vec<[Vec3; 3]>,
    /// Unit vector across its plane.
    pub normal: Vec3,
    /// Whether a triangle is a sliver, for which `f32` would miss the nearest point.
    sliver: bool,
    /// Bounding volume hierarchy over many triangles; empty for few.
    bvh: Bvh,
}

/// Largest number of triangles that are searched one by one.
const LINEAR_SEARCH_MAX: usize = 8;

/// An edge with more triangles joins none of them. No real surface has such edges, and a comparison of all
/// pairs could take forever.
const MAX_TRIANGLES_AT_EDGE: usize = 16;

/// Splits the triangles of a surface into facets, relative to an anchor. Degenerate triangles are dropped.
pub fn facets(triangles: &[[DVec3; 3]], anchor: DVec3) -> Vec<Facet> {
    let triangles: Vec<[DVec3; 3]> =
        triangles.iter().copied().filter(|t| doubled_area(t) > NO_AREA_M2).collect();
    let normals: Vec<DVec3> = triangles.iter().map(normal).collect();
    let joined = joined(&triangles, &normals);
    let joins = |k: usize| {
        let from = joined.partition_point(|&[a, _]| (a as usize) < k);
        joined[from..].iter().take_while(move |&&[a, _]| a as usize == k).map(|&[_, b]| b as usize)
    };
    let mut taken = vec![false; triangles.len()];
    let mut facets = Vec::new();
    for first in 0..triangles.len() {
        if taken[first] {
            continue;
        }
        taken[first] = true;
        let mut group = vec![first];
        let mut next = 0;
        while next < group.len() {
            for k in joins(group[next]) {
                if !std::mem::replace(&mut taken[k], true) {
                    group.push(k);
                }
            }
            next += 1;
        }
        let relative = |&k: &usize| triangles[k].map(|p| (p - anchor).as_vec3());
        facets.push(Facet::new(group.iter().map(relative).collect(), normals[first].as_vec3()));
    }
    facets
}

/// Pairs of triangles that share an edge and a plane, in both orders, sorted.
fn joined(triangles: &[[DVec3; 3]], normals: &[DVec3]) -> Vec<[u32; 2]> {
    let mut edges: Vec<([u32; 2], u32)> = Vec::with_capacity(3 * triangles.len());
    for (&[a, b, c], k) in weld(triangles).triangles.iter().zip(0..) {
        edges.extend([(a, b), (b, c), (c, a)].map(|(a, b)| ([a.min(b), a.max(b)], k)));
    }
    edges.sort_unstable();
    let coplanar = |a: u32, b: u32| {
        let (a, b) = (a as usize, b as usize);
        let n = normals[a];
        n.dot(normals[b]).abs() > 1.0 - 1e-9 && (triangles[b][0] - triangles[a][0]).dot(n).abs() < WELD_M
    };
    let mut joined = Vec::new();
    for edge in edges.chunk_by(|a, b| a.0 == b.0).filter(|edge| edge.len() <= MAX_TRIANGLES_AT_EDGE) {
        for &(_, a) in edge {
            joined.extend(edge.iter().filter(|&&(_, b)| a != b && coplanar(a, b)).map(|&(_, b)| [a, b]));
        }
    }
    joined.sort_unstable();
    joined.dedup();
    joined
}

fn normal([a, b, c]: &[DVec3; 3]) -> DVec3 {
    (b - a).cross(c - a).normalize()
}

impl Facet {
    /// A facet of coplanar triangles.
    fn new(triangles: Vec<[Vec3; 3]>, normal: Vec3) -> Self {
        let bvh = match triangles.len() {
            0..=LINEAR_SEARCH_MAX => Bvh::default(),
            _ => Bvh::new(&triangles.iter().copied().map(Aabb::around).collect::<Vec<_>>()),
        };
        Self { sliver: triangles.iter().any(is_sliver), triangles, normal, bvh }
    }

    /// Whether one of its triangles is a sliver.
    #[cfg(feature = "gpu")]
    pub(crate) fn is_sliver(&self) -> bool {
        self.sliver
    }

    /// Its triangles, if they are few and none is a sliver. The nearest point is then the nearest over these
    /// triangles.
    pub(crate) fn triangles_if_few(&self) -> Option<&[[Vec3; 3]]> {
        (!self.sliver && (1..=LINEAR_SEARCH_MAX).contains(&self.triangles.len())).then_some(&self.triangles)
    }

    /// Its bounding box.
    pub fn aabb(&self) -> Aabb {
        Aabb::around(self.triangles.iter().flatten().copied())
    }

    /// Point of the facet nearest to `p`, both relative to the anchor of the surface, in metres; `None`
    /// without triangles.
    pub fn nearest(&self, p: Vec3) -> Option<Vec3> {
        let on = |triangle: &[Vec3; 3]| match self.sliver {
            true => nearest_on_sliver(p.as_dvec3(), &triangle.map(|corner| corner.as_dvec3())).as_vec3(),
            false => nearest_on_triangle(p, triangle),
        };
        let distance2 = |q: Vec3| (p - q).dot(p - q);
        if self.triangles.len() > LINEAR_SEARCH_MAX {
            let k = self.bvh.nearest(p, |k| distance2(on(&self.triangles[k as usize])))?;
            return Some(on(&self.triangles[k as usize]));
        }
        let nearer = |best: Vec3, q: Vec3| if distance2(q) < distance2(best) { q } else { best };
        self.triangles.iter().map(on).reduce(nearer)
    }
}

#[cfg(test)]
mod tests {
    use rand_chacha::ChaCha8Rng;
    use rand_chacha::rand_core::{Rng, SeedableRng};

    use super::*;

    fn quad(corner: DVec3, u: DVec3, v: DVec3) -> Vec<[DVec3; 3]> {
        vec![[corner, corner + u, corner + u + v], [corner, corner + u + v, corner + v]]
    }

    #[test]
    fn a_box_has_six_facets() {
        let (o, far) = (DVec3::ZERO, DVec3::ONE);
        let mut triangles = Vec::new();
        for (u, v) in [(DVec3::X, DVec3::Y), (DVec3::Y, DVec3::Z), (DVec3::Z, DVec3::X)] {
            triangles.extend(quad(o, u, v));
            triangles.extend(quad(far, -u, -v));
        }
        let facets = facets(&triangles, DVec3::ZERO);
        assert_eq!(facets.len(), 6);
        assert!(facets.iter().all(|facet| facet.triangles.len() == 2));
    }

    #[test]
    fn triangles_without_area_are_dropped() {
        let flat = [[DVec3::ZERO, DVec3::X, DVec3::X * 2.0]];
        assert!(facets(&flat, DVec3::ZERO).is_empty());
    }

    /// Facets by comparison of all pairs of triangles: the reference for the fast way.
    fn facets_by_pairs(triangles: &[[DVec3; 3]], anchor: DVec3) -> Vec<Vec<[Vec3; 3]>> {
        let triangles: Vec<_> = triangles.iter().copied().filter(|t| doubled_area(t) > 1e-14).collect();
        let same = |a: DVec3, b: DVec3| a.distance(b) < 1e-7;
        let shared =
            |a: &[DVec3; 3], b: &[DVec3; 3]| a.iter().filter(|&&p| b.iter().any(|&q| same(p, q))).count();
        let coplanar = |a: &[DVec3; 3], b: &[DVec3; 3]| {
            let (n, m) = (normal(a), normal(b));
            n.dot(m).abs() > 1.0 - 1e-9 && (b[0] - a[0]).dot(n).abs() < 1e-7
        };
        let mut groups: Vec<Vec<usize>> = Vec::new();
        let mut free: Vec<usize> = (0..triangles.len()).collect();
        while !free.is_empty() {
            let mut group = vec![free.remove(0)];
            let mut next = 0;
            while next < group.len() {
                let a = &triangles[group[next]];
                let joins = |k: &usize| shared(a, &triangles[*k]) >= 2 && coplanar(a, &triangles[*k]);
                let (joined, rest) = free.into_iter().partition(joins);
                free = rest;
                group.extend::<Vec<usize>>(joined);
                next += 1;
            }
            groups.push(group);
        }
        let relative = |k: &usize| triangles[*k].map(|p| (p - anchor).as_vec3());
        groups.iter().map(|group| group.iter().map(relative).collect()).collect()
    }

    fn shaken(draw: &mut ChaCha8Rng, size: f64) -> DVec3 {
        let mut share = || f64::from(draw.next_u32()) / f64::from(u32::MAX) - 0.5;
        DVec3::new(share(), share(), share()) * size
    }

    #[test]
    fn facets_match_a_search_over_all_pairs_of_triangles() {
        let mut draw = ChaCha8Rng::seed_from_u64(1);
        let mut joined = 0;
        for round in 0..40 {
            // Squares of a lattice, some in one plane, some upright, each cut along one of its diagonals.
            // Corners are off by roundings; some triangles are turned, some doubled, some degenerate.
            let mut triangles = Vec::new();
            for _ in 0..60 {
                let cell = (shaken(&mut draw, 6.0) * DVec3::new(1.0, 1.0, 0.3)).round();
                let (u, v) =
                    [(DVec3::X, DVec3::Y), (DVec3::X, DVec3::Z), (DVec3::Y, DVec3::X), (DVec3::X, DVec3::X)]
                        [draw.next_u32() as usize % 4];
                let square = quad(cell * 0.01, u * 0.01, v * 0.01);
                triangles.extend(square.iter().map(|t| t.map(|p| p + shaken(&mut draw, 2e-8))));
            }
            let anchor = shaken(&mut draw, 0.1 * f64::from(round % 2));
            let quick: Vec<_> = facets(&triangles, anchor).into_iter().map(|facet| facet.triangles).collect();
            assert_eq!(quick, facets_by_pairs(&triangles, anchor), "round {round}");
            joined += quick.iter().filter(|facet| facet.len() > 2).count();
        }
        assert!(joined > 100, "{joined} facets of several squares");
    }

    #[test]
    fn thousand_triangles_on_one_edge_stay_separate_facets() {
        let page = |k: u32| {
            let angle = f64::from(k) * 1e-5;
            [DVec3::ZERO, DVec3::Z, DVec3::new(angle.cos(), angle.sin(), 0.0)]
        };
        let pages: Vec<_> = (0..1000).map(page).collect();
        assert_eq!(facets(&pages, DVec3::ZERO).len(), 1000);
    }

    #[test]
    fn nearest_point_of_a_facet_matches_a_search_over_its_triangles() {
        let at = |i: u32, j: u32| DVec3::new(f64::from(i), f64::from(j), 0.0) * 0.01;
        let cells = (0..600).map(|k| (k % 30, k / 30)).filter(|(i, j)| (i * 7 + j * 3) % 11 != 0);
        let square =
            |(i, j)| [[at(i, j), at(i + 1, j), at(i + 1, j + 1)], [at(i, j), at(i + 1, j + 1), at(i, j + 1)]];
        let facets = facets(&cells.flat_map(square).collect::<Vec<_>>(), DVec3::ZERO);
        assert_eq!(facets.len(), 1);
        let triangles = &facets[0].triangles;
        let mut draw = ChaCha8Rng::seed_from_u64(2);
        for k in 0..2000 {
            // General points, and points above corners, where six triangles are equally near.
            let p = (DVec3::new(0.15, 0.1, 0.0) + shaken(&mut draw, 0.4)).as_vec3();
            let p = if k % 2 == 0 { p } else { (p * 100.0).round() * 0.01 };
            let all = triangles.iter().map(|triangle| nearest_on_triangle(p, triangle));
            let least = all.clone().map(|q| (p - q).dot(p - q)).fold(f32::INFINITY, f32::min);
            let first = all.clone().find(|&q| (p - q).dot(p - q) == least);
            assert_eq!(facets[0].nearest(p), first, "{p}");
        }
    }
}
