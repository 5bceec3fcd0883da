//! A closed mesh as a shape: the volume enclosed by the triangles of a CAD file.
//!
//! A point is inside when its winding number is not zero: along a ray towards +x, crossings outwards count
//! +1, crossings inwards −1. Overlapping bodies in one file are therefore one. A body within another is a
//! hollow when it faces inwards.
//!
//! The crossing test works edge by edge, with arithmetic that gives both triangles at an edge the same
//! answer. A ray through an edge or a corner is never lost nor counted twice.

use std::cell::Cell;

use glam::{DVec3, IVec3, Vec3};

use super::{Shape, ShapeError};
use crate::mesh::Mesh;
use crate::mesh::bvh::{Aabb, Bvh};
use crate::mesh::nearest::nearest_on_sliver;

/// Distance within which a point counts as on the surface, as a share of the longest side: a few roundings of
/// `f32`.
const SURFACE_TOLERANCE: f64 = 1e-6;
/// A closed mesh with less volume than this share of its longest side cubed is a sheet.
const MIN_VOLUME_RATIO: f64 = 1e-9;

/// A closed mesh, with the origin at the centre of its box.
#[derive(Clone, Debug)]
pub struct Solid {
    triangles: Vec<[Vec3; 3]>,
    bvh: Bvh,
    size_m: DVec3,
    volume_m3: f64,
    /// See [`SURFACE_TOLERANCE`], in metres.
    tolerance: f32,
}

impl Solid {
    /// The solid enclosed by a mesh.
    ///
    /// # Errors
    /// A mesh without volume.
    pub fn new(mesh: &Mesh) -> Result<Self, ShapeError> {
        let (size_m, longest) = (mesh.size_m(), mesh.size_m().max_element());
        let volume_m3 = mesh.signed_volume_m3.abs();
        match () {
            () if !mesh.is_closed() => return Err(ShapeError::Open { edges: mesh.open_edges }),
            () if !mesh.is_oriented() => {
                return Err(ShapeError::InconsistentNormals { edges: mesh.turned_edges });
            }
            () if volume_m3 < MIN_VOLUME_RATIO * longest.powi(3) => {
                return Err(ShapeError::NoVolume { volume_m3 });
            }
            () => {}
        }
        let centre = (mesh.low + mesh.high) / 2.0;
        let triangles: Vec<[Vec3; 3]> =
            mesh.triangles.iter().map(|corners| corners.map(|p| (p - centre).as_vec3())).collect();
        let aabbs: Vec<Aabb> = triangles.iter().copied().map(Aabb::around).collect();
        Ok(Self {
            bvh: Bvh::new(&aabbs),
            triangles,
            size_m,
            volume_m3,
            tolerance: (SURFACE_TOLERANCE * longest) as f32,
        })
    }

    /// Winding number of the mesh about a point.
    fn winding(&self, p: Vec3) -> i32 {
        let (low, high) = (p - self.tolerance, p + self.tolerance);
        let ahead = |aabb: &Aabb| {
            let beside = low.cmpgt(aabb.high) | high.cmplt(aabb.low);
            !(beside.y || beside.z) && low.x <= aabb.high.x
        };
        let mut winding = 0;
        self.bvh.visit(ahead, |k| winding += crossing(&self.triangles[k as usize], p));
        winding
    }

    /// Whether the surface comes within `reach` metres of a point.
    fn is_near(&self, p: Vec3, reach: f32) -> bool {
        let near = Cell::new(false);
        self.bvh.visit(
            |aabb| !near.get() && aabb.distance2(p) <= reach * reach,
            |k| {
                let triangle = self.triangles[k as usize].map(|corner| corner.as_dvec3());
                let q = nearest_on_sliver(p.as_dvec3(), &triangle).as_vec3();
                near.set(near.get() || q.distance(p) <= reach);
            },
        );
        near.get()
    }
}

/// 1 when a ray from `p` towards +x leaves through a triangle, −1 when it enters, else 0.
fn crossing(triangle: &[Vec3; 3], p: Vec3) -> i32 {
    let [a, b, c] = triangle.map(|corner| corner.as_dvec3());
    let p = p.as_dvec3();
    let winding = around(a, b, p) + around(b, c, p) + around(c, a, p);
    if winding == 0 {
        return 0;
    }
    let n = (b - a).cross(c - a);
    let x = a.x - (n.y * (p.y - a.y) + n.z * (p.z - a.z)) / n.x;
    if x > p.x { winding } else { 0 }
}

/// Contribution of an edge to the winding number of its triangle about `p`, projected on the plane x = 0: ±1
/// when it passes `p` on the side of +y, else 0. The lower corner comes first, whatever the direction of the
/// edge. The answers of both of its triangles are therefore exact opposites.
fn around(from: DVec3, to: DVec3, p: DVec3) -> i32 {
    let up = to.z > p.z;
    if (from.z > p.z) == up {
        return 0;
    }
    let (low, high) = if up { (from, to) } else { (to, from) };
    let side = (high.y - low.y) * (p.z - low.z) - (p.y - low.y) * (high.z - low.z);
    match side > 0.0 {
        true if up => 1,
        true => -1,
        false => 0,
    }
}

impl Shape for Solid {
    fn size_m(&self) -> DVec3 {
        self.size_m
    }

    fn layers(&self, spacing_m: f64) -> IVec3 {
        // A box of whole layers must not gain one by the rounding of its corners.
        ((self.size_m - f64::from(self.tolerance)) / spacing_m).ceil().as_ivec3()
    }

    /// The surface itself counts as inside, whatever the rounding of the file's numbers.
    fn contains(&self, point: DVec3) -> bool {
        let p = point.as_vec3();
        self.winding(p) != 0 || self.is_near(p, self.tolerance)
    }

    fn contains_sphere(&self, centre: DVec3, radius_m: f64) -> bool {
        self.contains(centre) && !self.is_near(centre.as_vec3(), radius_m as f32 - self.tolerance)
    }

    fn volume_m3(&self) -> f64 {
        self.volume_m3
    }
}
