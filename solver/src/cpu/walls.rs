//! Surfaces as the CPU backend sees them: facets, posed anew every step.

use glam::{DVec3, IVec3, Mat3, Vec3};

use crate::engine::frame::Frame;
use crate::engine::scene::Scene;
use crate::equipment::facet::{Facet, facets};
use crate::equipment::{Motion, Presence};
use crate::mesh::bvh::{Aabb, Bvh};
use crate::physics::contact::ContactLaw;

/// All surfaces of a run.
#[derive(Debug)]
pub struct Walls {
    surfaces: Vec<WallSurface>,
    facets: Vec<WallFacet>,
    /// Belt time of the last pose, in seconds.
    posed_at: f64,
    /// How far any point of a surface may have moved since the lists were built, in metres.
    moved_m: f64,
    /// The same since the run began, in metres.
    moved_in_all_m: f64,
}

#[derive(Debug)]
pub(crate) struct WallSurface {
    motion: Motion,
    pub(crate) law: ContactLaw,
    presence: Presence,
    /// Point that its facets are relative to, in metres, at t = 0.
    anchor: DVec3,
    /// Farthest corner from the anchor, in metres.
    reach: f64,
    pub(crate) pose: Pose,
    /// Its first facet; the bvh numbers them from there.
    pub(crate) first: u32,
    /// Finds its facets near a point relative to the anchor.
    pub(crate) bvh: Bvh,
}

/// Where a surface is in this step, in the numbers of the run.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Pose {
    pub(crate) anchor: IVec3,
    pub(crate) turn: Mat3,
    pub(crate) velocity: Vec3,
    pub(crate) spin: Vec3,
}

#[derive(Debug)]
pub(crate) struct WallFacet {
    pub(crate) surface: usize,
    pub(crate) facet: Facet,
    /// Its box relative to the anchor, in metres: far sub-particles are passed over by it.
    pub(crate) aabb: Aabb,
}

/// The nearest point of a facet, seen from a sub-particle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Touch {
    /// From the sub-particle's centre to the nearest point, in metres.
    pub to_wall: Vec3,
    /// Its length, in metres.
    pub distance: f32,
    /// Velocity of the wall's material there, in m/s.
    pub velocity: Vec3,
    /// Spin of the wall, in rad/s.
    pub spin: Vec3,
    /// The nearest point relative to the anchor, in the surface's own axes.
    local: Vec3,
    /// Whether the point lies on the rim of the facet and not under the sphere.
    on_rim: bool,
}

/// Points nearer than this are one, in metres: some roundings of `f32`, a metre from the anchor.
pub(crate) const SAME: f32 = 1e-6;

/// A point lies on a facet when it is nearer than this share of its distance from the sphere's centre: in `f32` the
/// nearest point of a triangle can be off by more than [`SAME`] (see [`crate::mesh::nearest`]).
pub(crate) const AT_THE_EDGE: f32 = 0.01;

/// Cosine of the angle, some 26°, within which two facets push the same way: more than neighbours turn on curves that
/// CAD programs cut into facets, less than at creases that are meant.
pub(crate) const SAME_WAY: f32 = 0.9;

impl Touch {
    /// Whether two touches of one sub-particle are on the same side of it.
    fn pushes_like(&self, other: &Self) -> bool {
        self.to_wall.dot(other.to_wall) > SAME_WAY * self.distance * other.distance
    }
}

impl Pose {
    /// A position relative to the anchor, in the surface's own axes, in metres.
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
            moved_m: 0.0,
            moved_in_all_m: 0.0,
        };
        for (k, surface) in scene.surfaces.iter().enumerate() {
            let corners = || surface.triangles.iter().flatten();
            // Facets relative to a point in their midst keep more digits; what turns must be relative to its pivot.
            let anchor = match surface.motion {
                Motion::Moving { pivot, .. } => pivot,
                _ => corners().sum::<DVec3>() / corners().count().max(1) as f64,
            };
            let anchor = frame.decode(frame.encode(anchor));
            let first = walls.facets.len();
            let facets = facets(&surface.triangles, anchor).into_iter();
            walls.facets.extend(facets.map(|facet| WallFacet { surface: k, aabb: facet.aabb(), facet }));
            let aabbs: Vec<Aabb> = walls.facets[first..].iter().map(|facet| facet.aabb).collect();
            walls.surfaces.push(WallSurface {
                motion: surface.motion,
                law: scene.laws.for_surface(surface),
                presence: surface.presence,
                anchor,
                reach: corners().map(|c| c.distance(anchor)).fold(0.0, f64::max),
                pose: Pose {
                    anchor: frame.encode(anchor),
                    turn: Mat3::IDENTITY,
                    velocity: Vec3::ZERO,
                    spin: Vec3::ZERO,
                },
                first: first as u32,
                bvh: Bvh::new(&aabbs),
            });
        }
        walls
    }

    /// Brings every surface to where it is at belt time `t` in seconds (`None` before the start).
    pub fn pose(&mut self, t: Option<f64>, frame: &Frame) {
        let Some(now) = t else { return };
        let elapsed = if self.posed_at.is_finite() { now - self.posed_at } else { now };
        self.posed_at = now;
        let mut fastest = 0.0f64;
        for surface in &mut self.surfaces {
            let pose = surface.motion.pose(t);
            surface.pose = Pose {
                anchor: frame.encode(surface.anchor + pose.shift),
                turn: pose.turn.as_mat3(),
                velocity: pose.velocity.as_vec3(),
                spin: pose.spin.as_vec3(),
            };
            fastest = fastest.max(surface.motion.max_speed(surface.reach));
        }
        self.moved_m += fastest * elapsed;
        self.moved_in_all_m += fastest * elapsed;
    }

    /// t = 0 is now: what was there only until the start goes.
    pub fn drop_what_goes_at_start(&mut self) {
        let surfaces = &self.surfaces;
        let gone = |facet: &WallFacet| surfaces[facet.surface].presence == Presence::UntilStart;
        // Its facets stay in the list, so that the numbers of the others do not change, but without triangles.
        self.facets.iter_mut().filter(|facet| gone(facet)).for_each(|facet| facet.facet = Facet::default());
    }

    /// How far any point of a surface may have moved since the lists were built, in metres.
    pub fn moved_m(&self) -> f32 {
        self.moved_m as f32
    }

    /// How far any point of a surface may have moved since the run began, in metres.
    pub fn moved_in_all_m(&self) -> f64 {
        self.moved_in_all_m
    }

    /// The lists were built for where the surfaces are now.
    pub fn restart_moved(&mut self) {
        self.moved_m = 0.0;
    }

    /// The facets that come within `reach` metres of a position, ascending.
    pub fn within(&self, x: IVec3, reach: f32, frame: &Frame) -> impl Iterator<Item = u32> {
        self.surfaces.iter().flat_map(move |surface| {
            let p = surface.pose.local(x, frame);
            let mut near = Vec::new();
            surface.bvh.within(p, reach, |k| {
                let facet = surface.first + k;
                let boxed = self.facets[facet as usize].aabb.distance2(p) <= reach * reach;
                if boxed && self.touch(facet, x, frame).distance <= reach {
                    near.push(facet);
                }
            });
            near.sort_unstable();
            near
        })
    }

    /// The nearest point of a facet, seen from a position. Without triangles it is infinitely far.
    pub fn touch(&self, facet: u32, x: IVec3, frame: &Frame) -> Touch {
        let WallFacet { surface, facet, .. } = &self.facets[facet as usize];
        let pose = &self.surfaces[*surface].pose;
        let p = pose.local(x, frame);
        let Some(local) = facet.nearest(p) else {
            let (zero, distance) = (Vec3::ZERO, f32::INFINITY);
            return Touch { to_wall: zero, distance, velocity: zero, spin: zero, local: p, on_rim: false };
        };
        let d = local - p;
        let n = facet.normal;
        let across = d - n * n.dot(d);
        let distance2 = d.dot(d);
        Touch {
            to_wall: pose.turn * d,
            distance: distance2.sqrt(),
            velocity: pose.velocity + pose.spin.cross(pose.turn * local),
            spin: pose.spin,
            local,
            on_rim: across.dot(across) > 1e-6 * distance2,
        }
    }

    /// The facet that a touch gives way to, if it is no contact of its own: another facet of the same surface that comes
    /// before it and either pushes nearly the same way, or has its point too, where the two meet at an edge. The first
    /// rule makes one contact of a surface that many facets round off, hollow ones included, and of the two faces of
    /// a thin sheet. `others` are the other touches of the same sub-particle.
    ///
    /// The nearer facet comes first, and of those that touch in one point the one with the lowest number, so that a
    /// sphere on an edge does not hop between its sides by rounding. This orders all facets of a surface, so the first
    /// of them gives way to none.
    pub fn gives_way_to(
        &self,
        facet: u32,
        touch: &Touch,
        others: impl Iterator<Item = (u32, Touch)> + Clone,
    ) -> Option<u32> {
        let surface = |facet: u32| self.facets[facet as usize].surface;
        let others = others.filter(|&(other, _)| surface(other) == surface(facet));
        // The least distance of all that touch in the point of this one: no more than SAME from its own.
        let rank = |of: &Touch| {
            let touches = others.clone().map(|(_, theirs)| theirs).chain([*touch]);
            let here = touches.filter(|theirs| theirs.local.distance(of.local) < SAME);
            here.map(|theirs| theirs.distance).fold(of.distance, f32::min)
        };
        let comes_before = |other: u32, theirs: &Touch| {
            let further = theirs.distance - touch.distance;
            further < -SAME || further <= SAME && (rank(theirs), other) < (rank(touch), facet)
        };
        let before = || others.clone().filter(|(other, theirs)| comes_before(*other, theirs));
        let has_the_point = |other: u32| {
            let q = self.facets[other as usize].facet.nearest(touch.local);
            q.is_some_and(|q| q.distance(touch.local) < SAME.max(AT_THE_EDGE * touch.distance))
        };
        let alike = before().find(|(_, theirs)| theirs.pushes_like(touch));
        let at_the_edge = || before().find(|&(other, _)| touch.on_rim && has_the_point(other));
        alike.or_else(at_the_edge).map(|(other, _)| other)
    }

    /// The surfaces.
    pub(crate) fn surfaces(&self) -> &[WallSurface] {
        &self.surfaces
    }

    /// Greatest speed of any point of a surface from the start on, in m/s.
    #[cfg(feature = "gpu")]
    pub(crate) fn fastest(&self) -> f64 {
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

    /// The surface that a facet is part of.
    pub fn surface_of(&self, facet: u32) -> usize {
        self.facets[facet as usize].surface
    }

    /// The law of the contacts of a surface.
    pub fn law_of_surface(&self, surface: usize) -> &ContactLaw {
        &self.surfaces[surface].law
    }

    /// The law of a facet's contacts.
    pub fn law(&self, facet: u32) -> &ContactLaw {
        &self.surfaces[self.facets[facet as usize].surface].law
    }
}
