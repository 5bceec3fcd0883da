//! Surfaces as the CPU backend sees them: facets, posed anew every step.

use glam::{DVec3, IVec3, Mat3, Vec3};

use crate::engine::frame::Frame;
use crate::engine::scene::Scene;
use crate::equipment::facet::{Facet, facets};
use crate::equipment::{Motion, Presence};
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
struct WallSurface {
    motion: Motion,
    law: ContactLaw,
    presence: Presence,
    /// Point that its facets are relative to, in metres, at t = 0.
    anchor: DVec3,
    /// Farthest corner from the anchor, in metres.
    reach: f64,
    pose: Pose,
}

/// Where a surface is in this step, in the numbers of the run.
#[derive(Clone, Copy, Debug)]
struct Pose {
    anchor: IVec3,
    turn: Mat3,
    velocity: Vec3,
    spin: Vec3,
}

#[derive(Debug)]
struct WallFacet {
    surface: usize,
    facet: Facet,
    /// Corners of its box relative to the anchor, in metres: far sub-particles are passed over by it.
    low: Vec3,
    high: Vec3,
    /// Indices of the facets of the same surface that share a corner with it.
    meets: Vec<u32>,
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
    /// The nearest point relative to the anchor, in the surface's own axes.
    local: Vec3,
    /// Whether the point lies on the rim of the facet and not under the sphere.
    on_rim: bool,
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
            let base = walls.facets.len() as u32;
            for facet in facets(&surface.triangles, anchor) {
                let meets = facet.meets.iter().map(|m| m + base).collect();
                let corners = || facet.triangles.iter().flatten().copied();
                let low = corners().fold(Vec3::INFINITY, Vec3::min);
                let high = corners().fold(Vec3::NEG_INFINITY, Vec3::max);
                walls.facets.push(WallFacet { surface: k, low, high, facet, meets });
            }
            walls.surfaces.push(WallSurface {
                motion: surface.motion,
                law: scene.laws.of_surface(surface),
                presence: surface.presence,
                anchor,
                reach: corners().map(|c| c.distance(anchor)).fold(0.0, f64::max),
                pose: Pose {
                    anchor: frame.encode(anchor),
                    turn: Mat3::IDENTITY,
                    velocity: Vec3::ZERO,
                    spin: Vec3::ZERO,
                },
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
            fastest = fastest.max(surface.motion.top_speed(surface.reach));
        }
        self.moved_m += fastest * elapsed;
        self.moved_in_all_m += fastest * elapsed;
    }

    /// t = 0 is now: what was there only until the start goes.
    pub fn drop_what_goes_at_start(&mut self) {
        let surfaces = &self.surfaces;
        let gone = |facet: &WallFacet| surfaces[facet.surface].presence == Presence::UntilStart;
        // Its facets stay in the list, so that the numbers of the others do not change, but without triangles.
        self.facets.iter_mut().filter(|facet| gone(facet)).for_each(|facet| facet.facet.triangles.clear());
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
        (0..self.facets.len() as u32).filter(move |&facet| {
            let WallFacet { surface, low, high, .. } = &self.facets[facet as usize];
            let p = self.surfaces[*surface].pose.local(x, frame);
            let outside = (*low - p).max(p - *high).max(Vec3::ZERO);
            outside.dot(outside) <= reach * reach && self.touch(facet, x, frame).distance <= reach
        })
    }

    /// The nearest point of a facet, seen from a position. Without triangles it is infinitely far.
    pub fn touch(&self, facet: u32, x: IVec3, frame: &Frame) -> Touch {
        let WallFacet { surface, facet, .. } = &self.facets[facet as usize];
        let pose = &self.surfaces[*surface].pose;
        let p = pose.local(x, frame);
        let Some(local) = facet.nearest(p) else {
            let distance = f32::INFINITY;
            return Touch { to_wall: Vec3::ZERO, distance, velocity: Vec3::ZERO, local: p, on_rim: false };
        };
        let d = local - p;
        let [a, b, c] = facet.triangles[0];
        let n = (b - a).cross(c - a);
        let across = d - n * (n.dot(d) / n.dot(n));
        let distance2 = d.dot(d);
        Touch {
            to_wall: pose.turn * d,
            distance: distance2.sqrt(),
            velocity: pose.velocity + pose.spin.cross(pose.turn * local),
            local,
            on_rim: across.dot(across) > 1e-6 * distance2,
        }
    }

    /// Whether a touch is felt through another facet of the same surface: its point lies on a shared edge, and the
    /// other facet is nearer, or as near and comes first. `others` are the other touches of the same sub-particle.
    pub fn is_shadowed(&self, facet: u32, touch: &Touch, others: impl Iterator<Item = (u32, Touch)>) -> bool {
        const SAME: f32 = 1e-6;
        touch.on_rim
            && others.filter(|(other, _)| self.facets[facet as usize].meets.contains(other)).any(
                |(other, theirs)| {
                    let nearer = theirs.distance < touch.distance - SAME;
                    let first = theirs.distance < touch.distance + SAME && other < facet;
                    let on_theirs = self.facets[other as usize].facet.nearest(touch.local);
                    (nearer || first) && on_theirs.is_some_and(|q| q.distance(touch.local) < SAME)
                },
            )
    }

    /// Number of surfaces.
    pub fn surface_count(&self) -> usize {
        self.surfaces.len()
    }

    /// The surface that a facet is part of.
    pub fn surface_of(&self, facet: u32) -> usize {
        self.facets[facet as usize].surface
    }

    /// The law of a facet's contacts.
    pub fn law(&self, facet: u32) -> &ContactLaw {
        &self.surfaces[self.facets[facet as usize].surface].law
    }
}
