//! Surfaces in the form of the kernels: facets, triangles and trees as flat arrays, and poses for every step
//! of a chunk.

use glam::Vec3;

use super::layout::{Corner, Facet, Node, Pose, Surface};
use crate::walls::{SurfacePose, Walls};

/// Geometry of the surfaces of a run. It changes only at the start.
#[derive(Clone, Debug, Default)]
pub(super) struct Geometry {
    pub(super) surfaces: Vec<Surface>,
    pub(super) facets: Vec<Facet>,
    pub(super) corners: Vec<Corner>,
    pub(super) nodes: Vec<Node>,
    pub(super) leaves: Vec<u32>,
}

impl Geometry {
    pub(super) fn new(walls: &Walls) -> Self {
        let mut geometry = Self::default();
        for surface in walls.surfaces() {
            let (nodes, leaves) = surface.bvh.parts();
            let first_node = geometry.nodes.len() as u32;
            geometry.surfaces.push(Surface {
                law: (&surface.law).into(),
                first_facet: surface.first,
                first_node,
                end_node: first_node + nodes.len() as u32,
                first_leaf: geometry.leaves.len() as u32,
            });
            geometry.nodes.extend(nodes.iter().map(|node| Node {
                low: node.aabb.low.to_array(),
                next: node.next,
                high: node.aabb.high.to_array(),
                leaf: 8 * node.first + node.count,
            }));
            geometry.leaves.extend_from_slice(leaves);
        }
        for facet in walls.facets() {
            let triangles = &facet.facet.triangles;
            geometry.facets.push(Facet {
                normal: facet.facet.normal.to_array(),
                surface: facet.surface as u32,
                low: facet.aabb.low.to_array(),
                first_triangle: geometry.corners.len() as u32 / 3,
                high: facet.aabb.high.to_array(),
                triangles: triangles.len() as u32,
                sliver: u32::from(facet.facet.is_sliver()),
                ..Facet::default()
            });
            let corner = |at: &Vec3| Corner { at: at.to_array(), pad: 0 };
            geometry.corners.extend(triangles.iter().flatten().map(corner));
        }
        geometry
    }
}

/// Current poses of the surfaces.
pub(super) fn poses(walls: &Walls) -> impl Iterator<Item = Pose> {
    walls.surfaces().iter().map(|surface| {
        let SurfacePose { anchor, turn, velocity, spin, is_belt } = surface.pose;
        Pose {
            anchor: anchor.to_array(),
            is_belt: u32::from(is_belt),
            turn_x: turn.x_axis.to_array(),
            turn_y: turn.y_axis.to_array(),
            turn_z: turn.z_axis.to_array(),
            velocity: velocity.to_array(),
            spin: spin.to_array(),
            ..Pose::default()
        }
    })
}
