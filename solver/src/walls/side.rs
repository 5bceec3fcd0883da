//! The side of a facet from which a sub-particle touches it.
//!
//! A facet has no thickness, and acts on both of its sides. A contact therefore remembers the side on which it
//! began, and pushes back to that side, also while the centre is *beyond* the facet. The overlap is then R plus
//! the distance.
//!
//! | event | memory |
//! |---|---|
//! | the centre comes within range over the inside of a facet | begins, on the side where the centre was before the step |
//! | the centre leaves the range on that side | ends |
//! | the centre passes over the rim, on that side | ends; the inside of a facet decides anew |
//! | the centre, beyond, passes the rim to another facet of the surface | goes on at that facet |
//! | the centre, beyond, passes a free rim | ends: the sub-particle has passed through |
//! | the surface disappears | ends |

use glam::{IVec3, Vec3};

use super::contact::Seer;
use super::{ALIGNED_COSINE, ALIGNED_SINE, COINCIDENT_M, EDGE_TOLERANCE, NearestPoint, Walls};
use crate::engine::frame::Frame;
use crate::engine::wall_pair::{SideMemory, WallPair};

impl SideMemory {
    /// The memory where it neither begins nor crosses: `None` if it may. `step_m` is the maximum motion in a step.
    #[inline(always)]
    pub(crate) fn next_if_usual(self, point: &NearestPoint, is_far: bool, step_m: f32) -> Option<Self> {
        if self.beyond {
            None
        } else if point.is_off_facet() || is_far && point.distance > step_m {
            Some(Self::default())
        } else if self.origin != 0 && !is_far && point.side() != -self.origin {
            Some(self)
        } else {
            None
        }
    }
}

/// Updates the memories of a sub-particle, in `near` and `points`. Returns how many ended at a free rim while the centre
/// was beyond.
pub(super) fn update(
    walls: &Walls,
    seer: &Seer,
    points: &mut [(u32, NearestPoint)],
    near: &mut [WallPair],
) -> u32 {
    let mut passed = 0;
    for k in 0..points.len() {
        let point = &points[k].1;
        let memory = if point.distance == f32::INFINITY {
            // Its surface has disappeared.
            Some(SideMemory::default())
        } else if point.is_off_facet() {
            over_rim(walls, seer, points, near, k)
        } else {
            Some(over_inside(walls, seer, points, near, k))
        };
        passed += u32::from(memory.is_none());
        points[k].1.memory = memory.unwrap_or_default();
    }
    for (wall, (_, point)) in near.iter_mut().zip(&*points) {
        wall.side = point.memory;
    }
    passed
}

/// The new memory of the `k`th facet, with the centre over its inside.
fn over_inside(
    walls: &Walls,
    seer: &Seer,
    points: &[(u32, NearestPoint)],
    near: &[WallPair],
    k: usize,
) -> SideMemory {
    let (facet, point) = &points[k];
    let side = point.side();
    if side == 0 {
        return near[k].side;
    }
    let begin = || if has_crossed(walls, seer, points, k) { -side } else { side };
    let origin = match near[k].side.origin {
        0 => inherited(walls, seer, points, near, k).unwrap_or_else(begin),
        known => known,
    };
    let beyond = side != origin;
    if !beyond && seer.is_far(walls, *facet, point) {
        SideMemory::default()
    } else {
        SideMemory { origin, beyond }
    }
}

/// The new memory of the `k`th facet, with the centre beside it: `None` if it ends at a free rim.
fn over_rim(
    walls: &Walls,
    seer: &Seer,
    points: &[(u32, NearestPoint)],
    near: &[WallPair],
    k: usize,
) -> Option<SideMemory> {
    let (facet, point) = &points[k];
    if !near[k].side.beyond {
        return Some(SideMemory::default());
    }
    let mut is_shared = false;
    for (j, (other, theirs)) in points.iter().enumerate() {
        if j == k || walls.surface_of(*other) != walls.surface_of(*facet) {
            continue;
        }
        let contains = walls.contains_point(*other, point);
        if !theirs.is_off_facet() && (contains || walls.continues(&points[k], &points[j], seer.radius)) {
            // It has inherited the memory.
            return Some(SideMemory::default());
        }
        is_shared |= contains;
    }
    is_shared.then_some(near[k].side)
}

/// Side of the `k`th facet from which a neighbour acts, beyond which the centre was before the step.
fn inherited(
    walls: &Walls,
    seer: &Seer,
    points: &[(u32, NearestPoint)],
    near: &[WallPair],
    k: usize,
) -> Option<i8> {
    let (facet, point) = &points[k];
    let beyond = |j: &usize| {
        *j != k && near[*j].side.beyond && walls.surface_of(points[*j].0) == walls.surface_of(*facet)
    };
    let from = |j: usize| {
        let (other, theirs) = &points[j];
        if walls.continues(&points[j], &points[k], seer.radius) {
            let is_turned = walls.alignment(*other, *facet) < 0.0;
            Some(if is_turned { -near[j].side.origin } else { near[j].side.origin })
        } else {
            (theirs.is_off_facet() && walls.contains_point(*facet, theirs)).then(|| -point.side())
        }
    };
    (0..points.len()).filter(beyond).find_map(from)
}

/// Whether the centre has changed sides of the `k`th facet in the last step, through its surface.
fn has_crossed(walls: &Walls, seer: &Seer, points: &[(u32, NearestPoint)], k: usize) -> bool {
    let (facet, point) = &points[k];
    let moved = walls.relative_motion(*facet, point, seer);
    let on_surface = |other: u32| walls.surface_of(other) == walls.surface_of(*facet);
    walls.share_since_crossing(*facet, point, moved).is_some()
        && points.iter().any(|(other, theirs)| on_surface(*other) && walls.crosses(*other, theirs, moved))
}

impl Walls {
    /// Depth of a centre beyond the facets that it has memories of, in metres. Lists must reach further by this, so that a
    /// memory finds the facets behind a rim.
    pub(crate) fn depth_beyond(&self, near: &[WallPair], position: IVec3, frame: &Frame) -> f32 {
        let beyond = near.iter().filter(|wall| wall.side.beyond);
        let depths = beyond.map(|wall| self.nearest_point(wall.facet, position, frame).distance);
        depths.filter(|depth| depth.is_finite()).fold(0.0, f32::max)
    }

    /// Cosine of the angle between the normals of two facets of a surface.
    fn alignment(&self, one: u32, other: u32) -> f32 {
        self.facets[one as usize].facet.normal.dot(self.facets[other as usize].facet.normal)
    }

    /// Whether facet `to` continues facet `from` of its surface, beyond which the centre is. Their normals are similar, and the
    /// line between their nearest points runs along `to` within the same angle: parallel sheets do not continue each other.
    /// `to` is within the depth plus R, where every list holds it.
    fn continues(&self, from: &(u32, NearestPoint), to: &(u32, NearestPoint), radius: f32) -> bool {
        let line = from.1.local - to.1.local;
        let height = self.facets[to.0 as usize].facet.normal.dot(line).abs();
        let tolerance = COINCIDENT_M.max(EDGE_TOLERANCE * from.1.distance);
        self.alignment(from.0, to.0).abs() > ALIGNED_COSINE
            && height < tolerance.max(ALIGNED_SINE * line.length())
            && to.1.distance <= radius + from.1.distance
    }

    /// Motion of the centre relative to a facet in the last step, in the axes of the surface, in metres. The material of
    /// a belt runs within the facet and does not count.
    fn relative_motion(&self, facet: u32, point: &NearestPoint, seer: &Seer) -> Vec3 {
        let pose = &self.surfaces[self.surface_of(facet)].pose;
        let own = if pose.is_belt { Vec3::ZERO } else { point.velocity };
        pose.turn.transpose() * ((seer.velocity - own) * seer.dt)
    }

    /// Share of the last step that has passed since the centre crossed the plane of a facet, if it did.
    fn share_since_crossing(&self, facet: u32, point: &NearestPoint, moved: Vec3) -> Option<f32> {
        let before = point.height - self.facets[facet as usize].facet.normal.dot(moved);
        (before * point.height < 0.0).then(|| point.height / (point.height - before))
    }

    /// Whether the centre crossed a facet within its rim.
    fn crosses(&self, facet: u32, point: &NearestPoint, moved: Vec3) -> bool {
        let Some(share) = self.share_since_crossing(facet, point, moved) else { return false };
        let crossing = point.centre - moved * share;
        let q = self.facets[facet as usize].facet.nearest(crossing);
        q.is_some_and(|q| q.distance(crossing) < COINCIDENT_M.max(EDGE_TOLERANCE * moved.length()))
    }
}
