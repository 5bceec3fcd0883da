//! Bodies that would start inside each other, or inside or through a surface.
//!
//! The run would blow up, or a fillet would hang through a plate. Sub-particles may overlap by a tenth of R, since
//! positions are written with few digits. A closed surface that faces outwards is solid; a closed container faces inwards.

use std::cell::OnceCell;
use std::collections::{HashMap, HashSet};

use glam::{DVec3, IVec3, Vec3};

use crate::engine::scene::{BodyKind, Placement, Scene};
use crate::equipment::Surface;
use crate::mesh::bvh::{Aabb, Bvh};
use crate::mesh::nearest::nearest_on_triangle;
use crate::mesh::winding::winding;

/// Overlap that a start may have, as a share of R.
pub(super) const OVERLAP_RATIO: f64 = 0.1;

/// Seen from within, solid angles of a closed surface add up to the whole sphere to this share of it.
const CLOSED: f64 = 1e-6;

/// The body or surface that a body starts inside, by its index in the scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Obstacle {
    Body(usize),
    Surface(usize),
}

/// Every body that starts inside another body or a surface, with the first of each.
pub(super) fn clashes(scene: &Scene) -> Vec<(usize, Obstacle)> {
    let lattices: Vec<OnceCell<Lattice>> = vec![OnceCell::new(); scene.kinds.len()];
    let ratio = f64::from(scene.laws.body_radius_ratio);
    let lattice =
        |kind: usize| lattices[kind].get_or_init(|| Lattice::new(&scene.kinds[kind], scene.radius_m, ratio));
    let sheets: Vec<Sheet<'_>> = scene.surfaces.iter().map(Sheet::new).collect();
    let mut earlier = EarlierBodies::new(scene);
    let mut found = Vec::new();
    for (number, body) in scene.present().iter().enumerate() {
        let points = points(body, &scene.kinds[body.kind]);
        let reach = |other: &Placement| reach_m(scene, other);
        let inside = |other: &Placement| {
            let near = body.position.distance(other.position) < reach(body) + reach(other);
            near && lattice(other.kind).holds_any(&points, other, reach(other))
        };
        let near = earlier.near(body.position);
        let first = near.filter(|&other| inside(&scene.bodies[other])).min();
        earlier.add(number, body.position);
        let within = |sheet: &Sheet<'_>| {
            sheet.cuts(&points, body, scene) || points.first().is_some_and(|&p| sheet.encloses(p))
        };
        let crossed = sheets.iter().position(within);
        found.extend(first.map(|other| (number, Obstacle::Body(other))));
        found.extend(crossed.map(|other| (number, Obstacle::Surface(other))));
    }
    found
}

/// Distance from a body's centre within which another body's sub-particle may be inside it, in metres.
fn reach_m(scene: &Scene, body: &Placement) -> f64 {
    scene.kinds[body.kind].meta.bounding_radius_m
        + 2.0 * f64::from(scene.laws.body_radius_ratio) * scene.radius_m
}

/// The bodies visited so far, by cells as wide as the reach of two bodies. A scene may have many thousand spheres.
struct EarlierBodies {
    cell_m: f64,
    cells: HashMap<IVec3, Vec<usize>>,
}

impl EarlierBodies {
    fn new(scene: &Scene) -> Self {
        let reach = scene.bodies.iter().map(|body| reach_m(scene, body)).fold(0.0, f64::max);
        Self { cell_m: 2.0 * reach, cells: HashMap::new() }
    }

    fn cell(&self, place: DVec3) -> IVec3 {
        (place / self.cell_m).floor().as_ivec3()
    }

    fn add(&mut self, number: usize, place: DVec3) {
        self.cells.entry(self.cell(place)).or_default().push(number);
    }

    /// Numbers of the bodies whose reach may meet that of a body at a place, in no order.
    fn near(&self, place: DVec3) -> impl Iterator<Item = usize> + '_ {
        let cell = self.cell(place);
        let around = (0..27).map(move |k| cell + IVec3::new(k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1));
        around.filter_map(|cell| self.cells.get(&cell)).flatten().copied()
    }
}

/// Positions of the sub-particles of a body at the start, in metres.
fn points(body: &Placement, kind: &BodyKind) -> Vec<DVec3> {
    kind.meta.points.iter().map(|&point| body.position + body.orientation * point).collect()
}

/// The sub-particles of a kind by their cells, to find the ones near a point.
#[derive(Clone)]
struct Lattice {
    first: DVec3,
    spacing: f64,
    cells: HashSet<IVec3>,
    /// Nearer than this is inside, in metres.
    apart: f64,
}

impl Lattice {
    fn new(kind: &BodyKind, radius: f64, ratio: f64) -> Self {
        let (first, spacing) = (kind.meta.points.first().copied().unwrap_or_default(), 2.0 * radius);
        let cell = |point: &DVec3| ((*point - first) / spacing).round().as_ivec3();
        let cells = kind.meta.points.iter().map(cell).collect();
        Self { first, spacing, cells, apart: (2.0 * ratio - OVERLAP_RATIO) * radius }
    }

    /// Whether one of some points lies inside a body of this kind, all of which is within `reach` of its place.
    fn holds_any(&self, points: &[DVec3], body: &Placement, reach: f64) -> bool {
        let turn = body.orientation.inverse();
        let near = points.iter().filter(|point| point.distance(body.position) < reach);
        near.map(|&point| turn * (point - body.position)).any(|point| self.holds(point))
    }

    /// Whether a point, in the kind's own axes, is nearer than allowed to a sub-particle. The allowed distance is less than two
    /// spacings, so it is one of the 64 lattice points around.
    fn holds(&self, point: DVec3) -> bool {
        let at = (point - self.first) / self.spacing;
        let low = at.floor().as_ivec3() - 1;
        (0..64).map(|k| low + IVec3::new(k & 3, k >> 2 & 3, k >> 4)).any(|cell| {
            (cell.as_dvec3() - at).length() * self.spacing < self.apart && self.cells.contains(&cell)
        })
    }
}

/// A surface, with a tree over its triangles.
struct Sheet<'a> {
    surface: &'a Surface,
    /// Origin of the boxes of the tree, in metres.
    anchor: DVec3,
    bvh: Bvh,
    /// Corners of its box, in metres.
    low: DVec3,
    high: DVec3,
}

impl<'a> Sheet<'a> {
    fn new(surface: &'a Surface) -> Self {
        let anchor = surface.triangles_at(None).first().map_or(DVec3::ZERO, |triangle| triangle[0]);
        let aabb = |triangle: &[DVec3; 3]| Aabb::around(triangle.map(|corner| (corner - anchor).as_vec3()));
        let aabbs: Vec<Aabb> = surface.triangles_at(None).iter().map(aabb).collect();
        let corners = || surface.triangles_at(None).iter().flatten().copied();
        let low = corners().fold(DVec3::INFINITY, DVec3::min);
        let high = corners().fold(DVec3::NEG_INFINITY, DVec3::max);
        Self { surface, anchor, bvh: Bvh::new(&aabbs), low, high }
    }

    /// Whether a point is inside a closed surface that faces outwards.
    fn encloses(&self, point: DVec3) -> bool {
        let boxed = self.low.cmple(point).all() && point.cmple(self.high).all();
        // An open surface, however small its hole, does not wind round a whole number of times; solids that overlap do so more
        // than once.
        let is_inside = |times: f64| times > 0.5 && (times - times.round()).abs() < CLOSED;
        boxed && is_inside(winding(self.surface.triangles_at(None), point))
    }

    /// Whether a body starts in it or through it.
    fn cuts(&self, points: &[DVec3], body: &Placement, scene: &Scene) -> bool {
        let reach = scene.kinds[body.kind].meta.bounding_radius_m + scene.radius_m;
        let mut cuts = false;
        self.bvh.within((body.position - self.anchor).as_vec3(), reach as f32, |k| {
            cuts =
                cuts || self.triangle_cuts(&self.surface.triangles_at(None)[k as usize], points, body, scene);
        });
        cuts
    }

    fn triangle_cuts(
        &self,
        triangle: &[DVec3; 3],
        points: &[DVec3],
        body: &Placement,
        scene: &Scene,
    ) -> bool {
        let [a, b, c] = triangle;
        let normal = (b - a).cross(c - a).normalize_or_zero();
        // Relative to the body, where single precision is enough.
        let local = |point: DVec3| (point - body.position).as_vec3();
        let corners = triangle.map(local);
        let distance = |point: Vec3| f64::from(nearest_on_triangle(point, &corners).distance(point));
        let apart = (1.0 - OVERLAP_RATIO) * scene.radius_m;
        let side: Vec<f64> = points.iter().map(|point| normal.dot(point - a)).collect();
        let mut near = points.iter().zip(&side).filter(|(_, side)| side.abs() < apart);
        if normal == DVec3::ZERO || near.any(|(&point, _)| distance(local(point)) < apart) {
            return normal != DVec3::ZERO;
        }
        // Between two layers of the lattice no sub-particle touches it, but bonds go through it.
        scene.kinds[body.kind].meta.bonds.iter().any(|bond| {
            let (i, j) = (bond.i as usize, bond.j as usize);
            let crossing = || points[i].lerp(points[j], side[i] / (side[i] - side[j]));
            side[i] * side[j] < 0.0 && distance(local(crossing())) < OVERLAP_RATIO * scene.radius_m
        })
    }
}
