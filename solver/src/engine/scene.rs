//! A scene: bodies, surfaces and laws, as a backend takes them in.

use std::sync::Arc;

use glam::{DQuat, DVec3};

use crate::equipment::{Surface, SurfaceKind};
pub use crate::physics::Laws;
use crate::physics::contact::ContactLaw;
use crate::shape::lattice::MetaParticle;

/// Initial state and parameters of a run.
#[derive(Clone, Debug)]
pub struct Scene {
    /// Radius of every sub-particle, in metres.
    pub radius_m: f64,
    /// The kinds of body: each body is a copy of one.
    pub kinds: Vec<BodyKind>,
    /// The bodies. Their order is their numbering.
    pub bodies: Vec<Placement>,
    /// Number of the last bodies that are not there yet. They enter in their order, at places given then.
    pub waiting: usize,
    /// Clamped sub-particles, by serial (body by body, in the order of points). They do not move.
    pub held: Vec<u32>,
    /// The equipment.
    pub surfaces: Vec<Surface>,
    /// The interaction laws.
    pub laws: Laws,
    /// Acceleration of gravity, in m/s².
    pub gravity: DVec3,
    /// Low corner of the domain, in metres. Fixed-point positions cover the domain.
    pub low: DVec3,
    /// High corner of the domain, in metres.
    pub high: DVec3,
    /// Whether the domain is periodic in y.
    pub periodic_y: bool,
    /// Time step, in seconds.
    pub timestep_s: f64,
    /// Speed that no sub-particle may exceed, in m/s.
    pub speed_limit_m_s: f64,
}

impl Scene {
    /// The bodies that are there from the start.
    pub fn present(&self) -> &[Placement] {
        &self.bodies[..self.bodies.len() - self.waiting]
    }

    /// Serial of the first sub-particle of a body.
    pub fn first_serial(&self, number: usize) -> u32 {
        self.bodies[..number].iter().map(|body| self.kinds[body.kind].meta.points.len() as u32).sum()
    }

    /// Serial of the first sub-particle of each body, and the number of all sub-particles.
    pub(crate) fn first_serials(&self) -> Vec<u32> {
        let lengths = self.bodies.iter().map(|body| self.kinds[body.kind].meta.points.len() as u32);
        let mut next = 0;
        [0].into_iter()
            .chain(lengths.map(|length| {
                next += length;
                next
            }))
            .collect()
    }
}

/// A meta-particle with the mass of its sub-particles.
#[derive(Clone, Debug)]
pub struct BodyKind {
    /// Points and bonds.
    pub meta: Arc<MetaParticle>,
    /// Mass of one sub-particle, in kilograms.
    pub subparticle_mass_kg: f64,
}

impl BodyKind {
    /// Mass of a body, in kilograms.
    pub fn mass_kg(&self) -> f64 {
        self.subparticle_mass_kg * self.meta.points.len() as f64
    }
}

/// Initial placement of a body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placement {
    /// Index into [`Scene::kinds`].
    pub kind: usize,
    /// Position of its centre of mass, in metres.
    pub position: DVec3,
    /// Its orientation.
    pub orientation: DQuat,
    /// Its velocity, in m/s.
    pub velocity: DVec3,
}

impl Laws {
    /// Contact law of a surface: the law of its kind, with the friction of the surface where it has its own.
    pub fn for_surface(&self, surface: &Surface) -> ContactLaw {
        let law = match surface.kind {
            SurfaceKind::Equipment => self.equipment,
            SurfaceKind::Belt => self.belt,
            SurfaceKind::Frictionless => ContactLaw { mu: 0.0, ..self.equipment },
        };
        ContactLaw { mu: surface.friction.map_or(law.mu, |mu| mu as f32), ..law }
    }

    /// Largest gap at which an adhesive contact still holds, in metres.
    pub fn adhesion_range(&self) -> f32 {
        self.tissue.adhesion_range().max(self.equipment.adhesion_range()).max(self.belt.adhesion_range())
    }
}
