//! Equipment: moving surfaces of triangles, which act on both of their sides.

pub mod facet;
pub mod motion;

use std::f64::consts::TAU;

use glam::{DQuat, DVec3};

pub use motion::Motion;

/// Material of a surface. It selects the contact parameters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SurfaceKind {
    /// Walls, gate, plates: `contact.fillet_equipment`.
    Equipment,
    /// The belt: `contact.fillet_belt`.
    Belt,
    /// As equipment, without friction.
    Frictionless,
}

/// Period in which a surface is present.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Presence {
    /// Always.
    Always,
    /// Until t = 0, like a shutter that opens when the belt starts.
    UntilStart,
}

/// A named set of triangles that move together.
#[derive(Clone, Debug, PartialEq)]
pub struct Surface {
    /// Name, for pictures and messages.
    pub name: String,
    /// Material.
    pub kind: SurfaceKind,
    /// Coulomb coefficient of friction; `None` takes the one of its kind.
    pub friction: Option<f64>,
    /// Motion from t = 0 on.
    pub motion: Motion,
    /// Period in which it is present.
    pub presence: Presence,
    /// Corners in metres, in the pose at t = 0.
    pub triangles: Vec<[DVec3; 3]>,
    /// Corners until t = 0 where they differ, as of a gate that is closed while a hopper fills.
    pub closed: Option<Vec<[DVec3; 3]>>,
}

impl Surface {
    /// A parallelogram from a corner and two edges, fixed and always present.
    pub fn parallelogram(name: &str, kind: SurfaceKind, corner: DVec3, u: DVec3, v: DVec3) -> Self {
        let [a, b, c, d] = [corner, corner + u, corner + u + v, corner + v];
        Self {
            name: name.to_owned(),
            kind,
            friction: None,
            motion: Motion::Fixed,
            presence: Presence::Always,
            triangles: vec![[a, b, c], [a, c, d]],
            closed: None,
        }
    }

    /// The side of a round bar about `middle`, fixed and always present. `half` leads along its axis to one
    /// end. The flat sides have their edges on the cylinder.
    pub fn cylinder(
        name: &str,
        kind: SurfaceKind,
        middle: DVec3,
        half: DVec3,
        radius: f64,
        sides: u32,
    ) -> Self {
        let (axis, across) = (half.normalize(), half.normalize().any_orthonormal_vector() * radius);
        let edge = |k: u32| {
            let turn = DQuat::from_axis_angle(axis, TAU * f64::from(k % sides) / f64::from(sides));
            middle - half + turn * across
        };
        let side = |k| Self::parallelogram(name, kind, edge(k), edge(k + 1) - edge(k), 2.0 * half).triangles;
        let triangles = (0..sides).flat_map(side).collect();
        Self { triangles, ..Self::parallelogram(name, kind, middle, half, across) }
    }

    /// The same surface with a motion.
    pub fn moving(self, motion: Motion) -> Self {
        Self { motion, ..self }
    }

    /// The same surface with the corners of `closed` until t = 0. Each must be one facet.
    pub fn closed_until_start(self, closed: Self) -> Self {
        Self { closed: Some(closed.triangles), ..self }
    }

    /// The same surface, present until t = 0.
    pub fn until_start(self) -> Self {
        Self { presence: Presence::UntilStart, ..self }
    }

    /// Its triangles at a belt time in seconds (`None` before the start), in the pose at t = 0: none once it is gone.
    pub fn triangles_at(&self, belt_time_s: Option<f64>) -> &[[DVec3; 3]] {
        match (belt_time_s, &self.closed) {
            (None, Some(closed)) => closed,
            (Some(_), _) if self.presence == Presence::UntilStart => &[],
            _ => &self.triangles,
        }
    }

    /// Number of its facets. Those that a form lacks keep their numbers.
    pub(crate) fn facet_count(&self) -> usize {
        facet::facets(self.triangles_at(None), DVec3::ZERO).len()
    }
}
