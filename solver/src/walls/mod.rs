//! Surfaces during a run: facets in their pose of the current step, in fixed-point coordinates.
//!
//! Both CPU paths and the GPU backend use this geometry.

pub mod contact;
pub mod loads;
mod side;

use glam::{DVec3, IVec3, Mat3, Vec3};

use crate::engine::frame::Frame;
use crate::engine::scene::Scene;
use crate::engine::wall_pair::SideMemory;
use crate::equipment::Motion;
use crate::equipment::facet::{Facet, facets};
use crate::mesh::bvh::{Aabb, Bvh};
use crate::physics::contact::ContactLaw;

/// All surfaces of a run.
#[derive(Debug)]
pub struct Walls {
    surfaces: Vec<WallSurface>,
    facets: Vec<WallFacet>,
    /// Belt time of the last pose, in seconds.
    posed_at: f64,
    /// Upper bound on the motion of any point of a surface since the neighbour lists were built, in metres.
    travel_m: f64,
    /// The same since the run began, in metres.
    total_travel_m: f64,
    /// The same in the last step, in metres.
    step_travel_m: f64,
}

#[derive(Debug)]
pub(crate) struct WallSurface {
    motion: Motion,
    pub(crate) law: ContactLaw,
    /// Its facets from t = 0 on, where they differ: as many, without triangles if it disappears.
    from_start: Option<Vec<Facet>>,
    /// Origin of its facets' coordinates, in metres, at t = 0.
    anchor: DVec3,
    /// Maximum distance of a corner from the anchor, in metres.
    reach: f64,
    pub(crate) pose: SurfacePose,
    /// Its first facet. The tree numbers its facets from there.
    pub(crate) first: u32,
    /// Tree over the boxes of its facets, relative to the anchor.
    pub(crate) bvh: Bvh,
}

/// Pose of a surface in this step, in fixed-point coordinates.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SurfacePose {
    pub(crate) anchor: IVec3,
    pub(crate) turn: Mat3,
    pub(crate) velocity: Vec3,
    pub(crate) spin: Vec3,
    /// Whether only the material moves, and not the surface.
    pub(crate) is_belt: bool,
}

#[derive(Debug)]
pub(crate) struct WallFacet {
    pub(crate) surface: usize,
    pub(crate) facet: Facet,
    /// Bounding box relative to the anchor, in metres, to reject far sub-particles.
    pub(crate) aabb: Aabb,
}

/// The nearest point of a facet to a sub-particle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NearestPoint {
    /// Vector from the centre of the sub-particle to the nearest point, in metres.
    pub to_wall: Vec3,
    /// Length of `to_wall`, in metres.
    pub distance: f32,
    /// Velocity of the wall's material at the point, in m/s.
    pub velocity: Vec3,
    /// Spin of the wall, in rad/s.
    pub spin: Vec3,
    /// Position of the point relative to the anchor, in the axes of the surface.
    local: Vec3,
    /// Whether the point lies on the rim of the facet, not under the sphere.
    on_rim: bool,
    /// The centre in the same coordinates as `local`.
    centre: Vec3,
    /// Height of the centre over the plane of the facet, along its normal, in metres.
    pub(crate) height: f32,
    /// Memory of the side from which the sub-particle touches the facet.
    pub(crate) memory: SideMemory,
}

/// Distance below which points coincide, in metres: a few roundings of `f32`, a metre from the anchor.
pub(crate) const COINCIDENT_M: f32 = 1e-6;

/// A point lies on a facet when it is nearer than this share of its distance from the sphere's centre. In
/// `f32` the nearest point of a triangle can be off by more than [`COINCIDENT_M`] (see
/// [`crate::mesh::nearest`]).
pub(crate) const EDGE_TOLERANCE: f32 = 0.01;

/// Cosine of the angle, about 26°, within which two facets push the same way. Neighbouring facets of a curve
/// cut by a CAD program turn less; intended creases turn more.
pub(crate) const ALIGNED_COSINE: f32 = 0.9;

/// Sine of the same angle.
pub(crate) const ALIGNED_SINE: f32 = 0.435_889_9;

/// A centre is off a facet when its offset across the normal exceeds the square root of this share of its distance.
pub(crate) const OFF_FACET: f32 = 4e-6;

impl NearestPoint {
    /// Whether two points of one sub-particle push the same way.
    fn is_aligned_with(&self, other: &Self) -> bool {
        let dot = self.to_wall.dot(other.to_wall);
        let dot = if self.memory.beyond == other.memory.beyond { dot } else { -dot };
        dot > ALIGNED_COSINE * self.distance * other.distance
    }

    /// Distance of the centre, negative beyond the facet, in metres. `to_wall` divided by it points into the wall.
    pub(crate) fn signed_distance(&self) -> f32 {
        if self.memory.beyond { -self.distance } else { self.distance }
    }

    /// Whether the centre lies beside the facet, not over its inside.
    #[inline(always)]
    pub(crate) fn is_off_facet(&self) -> bool {
        let distance2 = self.distance * self.distance;
        distance2 - self.height * self.height > (OFF_FACET * distance2).max(COINCIDENT_M * COINCIDENT_M)
    }

    /// Side of the facet on which the centre lies: 1, −1, or 0 in its plane.
    #[inline(always)]
    pub(crate) fn side(&self) -> i8 {
        i8::from(self.height > 0.0) - i8::from(self.height < 0.0)
    }

    /// A point without direction and coordinates, from a distance and a height in metres.
    #[inline(always)]
    pub(crate) fn at(distance: f32, height: f32) -> Self {
        let zero = Vec3::ZERO;
        Self {
            to_wall: zero,
            distance,
            velocity: zero,
            spin: zero,
            local: zero,
            on_rim: false,
            centre: zero,
            height,
            memory: SideMemory::default(),
        }
    }
}

impl SurfacePose {
    /// A position relative to the anchor, in the axes of the surface, in metres.
    fn local(&self, x: IVec3, frame: &Frame) -> Vec3 {
        self.turn.transpose() * (x.wrapping_sub(self.anchor).as_vec3() * frame.unit_m)
    }
}

impl Walls {
    /// The surfaces of a scene.
    pub fn new(scene: &Scene, frame: &Frame) -> Self {
        let mut walls = Self {
            surfaces: Vec::new(),
            facets: Vec::new(),
            posed_at: f64::NEG_INFINITY,
            travel_m: 0.0,
            total_travel_m: 0.0,
            step_travel_m: 0.0,
        };
        for (k, surface) in scene.surfaces.iter().enumerate() {
            let before = surface.triangles_at(None);
            let corners = || before.iter().flatten();
            // Coordinates relative to a central point keep more digits. A rotating surface must be relative
            // to its pivot.
            let anchor = match surface.motion {
                Motion::Moving { pivot, .. } => pivot,
                _ => corners().sum::<DVec3>() / corners().count().max(1) as f64,
            };
            let anchor = frame.decode(frame.encode(anchor));
            let first = walls.facets.len();
            let before = facets(before, anchor);
            // The facets keep their numbers, and with them the histories of their contacts.
            let mut after = facets(surface.triangles_at(Some(0.0)), anchor);
            assert!(after.len() <= before.len(), "the form until t = 0 has as many facets");
            after.resize_with(before.len(), Facet::default);
            let from_start = (after != before).then_some(after);
            let wall_facet = |facet: Facet| WallFacet { surface: k, aabb: facet.aabb(), facet };
            walls.facets.extend(before.into_iter().map(wall_facet));
            let aabbs: Vec<Aabb> = walls.facets[first..].iter().map(|facet| facet.aabb).collect();
            walls.surfaces.push(WallSurface {
                motion: surface.motion,
                law: scene.laws.for_surface(surface),
                from_start,
                anchor,
                reach: corners().map(|c| c.distance(anchor)).fold(0.0, f64::max),
                pose: SurfacePose {
                    anchor: frame.encode(anchor),
                    turn: Mat3::IDENTITY,
                    velocity: Vec3::ZERO,
                    spin: Vec3::ZERO,
                    is_belt: matches!(surface.motion, Motion::Belt { .. }),
                },
                first: first as u32,
                bvh: Bvh::new(&aabbs),
            });
        }
        walls
    }

    /// Moves every surface to its pose at belt time `t` in seconds (`None` before the start).
    pub fn pose(&mut self, t: Option<f64>, frame: &Frame) {
        let Some(now) = t else { return };
        let elapsed = if self.posed_at.is_finite() { now - self.posed_at } else { now };
        self.posed_at = now;
        let mut max_speed = 0.0f64;
        for surface in &mut self.surfaces {
            let pose = surface.motion.pose(t);
            surface.pose = SurfacePose {
                anchor: frame.encode(surface.anchor + pose.shift),
                turn: pose.turn.as_mat3(),
                velocity: pose.velocity.as_vec3(),
                spin: pose.spin.as_vec3(),
                is_belt: surface.pose.is_belt,
            };
            max_speed = max_speed.max(surface.motion.max_speed(surface.reach));
        }
        self.step_travel_m = max_speed * elapsed;
        self.travel_m += self.step_travel_m;
        self.total_travel_m += self.step_travel_m;
    }

    /// Sets t = 0: surfaces take the form that they have from then on. It lies within the one before, so lists stay valid.
    /// Returns the first and last facet of each surface that has changed.
    pub fn start(&mut self) -> Vec<[u32; 2]> {
        let mut changed = Vec::new();
        for surface in &mut self.surfaces {
            let Some(from_start) = surface.from_start.take() else { continue };
            changed.push([surface.first, surface.first + from_start.len() as u32 - 1]);
            let facets = &mut self.facets[surface.first as usize..];
            facets.iter_mut().zip(from_start).for_each(|(facet, now)| facet.facet = now);
        }
        changed
    }

    /// Takes the form and the pose of the last of `step` steps of a run that started at `start_step`.
    pub(crate) fn restore(&mut self, start_step: Option<u64>, step: u64, dt: f64, frame: &Frame) {
        let Some(start) = start_step else { return };
        self.start();
        if step > start {
            self.pose(Some((step - 1 - start) as f64 * dt), frame);
        }
    }

    /// Upper bound on the motion of any point of a surface since the neighbour lists were built, in metres.
    pub fn travel_m(&self) -> f32 {
        self.travel_m as f32
    }

    /// Upper bound on the motion of any point of a surface since the run began, in metres.
    pub fn total_travel_m(&self) -> f64 {
        self.total_travel_m
    }

    /// Upper bound on the motion of any point of a surface in the last step, in metres.
    pub(crate) fn step_travel_m(&self) -> f32 {
        self.step_travel_m as f32
    }

    /// Resets the motion: the neighbour lists were built for the current poses.
    pub fn reset_travel(&mut self) {
        self.travel_m = 0.0;
    }

    /// Facets within `reach` metres of a position, ascending.
    pub fn facets_within(&self, x: IVec3, reach: f32, frame: &Frame) -> impl Iterator<Item = u32> {
        self.surfaces.iter().flat_map(move |surface| {
            let p = surface.pose.local(x, frame);
            let mut near = Vec::new();
            surface.bvh.within(p, reach, |k| {
                let facet = surface.first + k;
                let boxed = self.facets[facet as usize].aabb.distance2(p) <= reach * reach;
                if boxed && self.nearest_point(facet, x, frame).distance <= reach {
                    near.push(facet);
                }
            });
            near.sort_unstable();
            near
        })
    }

    /// Nearest point of a facet to a position. A facet without triangles is infinitely far.
    pub fn nearest_point(&self, facet: u32, x: IVec3, frame: &Frame) -> NearestPoint {
        let WallFacet { surface, facet, .. } = &self.facets[facet as usize];
        let pose = &self.surfaces[*surface].pose;
        let p = pose.local(x, frame);
        let Some(local) = facet.nearest(p) else {
            return NearestPoint { local: p, ..NearestPoint::at(f32::INFINITY, 0.0) };
        };
        let d = local - p;
        let n = facet.normal;
        let along = n.dot(d);
        let across = d - n * along;
        let distance2 = d.dot(d);
        NearestPoint {
            to_wall: pose.turn * d,
            distance: distance2.sqrt(),
            velocity: pose.velocity + pose.spin.cross(pose.turn * local),
            spin: pose.spin,
            local,
            on_rim: across.dot(across) > 1e-6 * distance2,
            centre: p,
            height: -along,
            memory: SideMemory::default(),
        }
    }

    /// The facet that supersedes a nearest point, if the point is no contact of its own. `others` are the
    /// other points of the same sub-particle.
    ///
    /// A superseding facet belongs to the same surface and precedes this one. Either it pushes nearly the
    /// same way, or it contains the point, where the two meet at an edge. The first rule makes one contact of
    /// a surface rounded by many facets, hollow or not. It also makes one of the two faces of a thin sheet.
    ///
    /// The nearer facet precedes. Of facets that share a point one precedes that the centre is beyond, then the one with
    /// the lowest number: a sphere on an edge does not jump between its sides by rounding. All facets of a surface are thereby
    /// ordered, and the first one is never superseded.
    pub fn superseding_facet(
        &self,
        facet: u32,
        point: &NearestPoint,
        others: impl Iterator<Item = (u32, NearestPoint)> + Clone,
    ) -> Option<u32> {
        let surface = |facet: u32| self.facets[facet as usize].surface;
        let others = others.filter(|&(other, _)| surface(other) == surface(facet));
        // Smallest distance of all points that coincide with this one: at most COINCIDENT_M below its own.
        let rank = |of: &NearestPoint| {
            let points = others.clone().map(|(_, theirs)| theirs).chain([*point]);
            let here = points.filter(|theirs| theirs.local.distance(of.local) < COINCIDENT_M);
            here.map(|theirs| theirs.distance).fold(of.distance, f32::min)
        };
        let precedes = |other: u32, theirs: &NearestPoint| {
            let further = theirs.distance - point.distance;
            let order = |facet: u32, of: &NearestPoint| (rank(of), !of.memory.beyond, facet);
            further < -COINCIDENT_M || further <= COINCIDENT_M && order(other, theirs) < order(facet, point)
        };
        let before = || others.clone().filter(|(other, theirs)| precedes(*other, theirs));
        let alike = before().find(|(_, theirs)| theirs.is_aligned_with(point));
        let at_the_edge = || before().find(|&(other, _)| point.on_rim && self.contains_point(other, point));
        alike.or_else(at_the_edge).map(|(other, _)| other)
    }

    /// Whether a facet contains a nearest point, of another facet of its surface.
    fn contains_point(&self, facet: u32, point: &NearestPoint) -> bool {
        let q = self.facets[facet as usize].facet.nearest(point.local);
        q.is_some_and(|q| q.distance(point.local) < COINCIDENT_M.max(EDGE_TOLERANCE * point.distance))
    }

    /// The surfaces, in their order.
    pub(crate) fn surfaces(&self) -> &[WallSurface] {
        &self.surfaces
    }

    /// Maximum speed of any point of a surface after the start, in m/s.
    #[cfg(feature = "gpu")]
    pub(crate) fn max_speed(&self) -> f64 {
        self.surfaces.iter().map(|surface| surface.motion.max_speed(surface.reach)).fold(0.0, f64::max)
    }

    /// The facets of all surfaces, in their order.
    pub(crate) fn facets(&self) -> &[WallFacet] {
        &self.facets
    }

    /// Number of surfaces.
    pub fn surface_count(&self) -> usize {
        self.surfaces.len()
    }

    /// The surface of a facet.
    pub fn surface_of(&self, facet: u32) -> usize {
        self.facets[facet as usize].surface
    }

    /// The contact law of a surface.
    pub fn law_of_surface(&self, surface: usize) -> &ContactLaw {
        &self.surfaces[surface].law
    }

    /// The contact law of a facet.
    pub fn law(&self, facet: u32) -> &ContactLaw {
        &self.surfaces[self.facets[facet as usize].surface].law
    }
}
