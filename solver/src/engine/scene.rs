//! A scene: bodies, surfaces and laws, ready for a backend to take in.

use std::sync::Arc;

use glam::{DQuat, DVec3};

use crate::equipment::{Surface, SurfaceKind};
use crate::physics::bond::BondLaw;
use crate::physics::contact::ContactLaw;
use crate::shape::lattice::MetaParticle;

/// Everything that a run starts from.
#[derive(Clone, Debug)]
pub struct Scene {
    /// Radius of every sub-particle, in metres.
    pub radius_m: f64,
    /// The meta-particles that bodies are copies of.
    pub kinds: Vec<BodyKind>,
    /// The bodies, in the order that numbers them.
    pub bodies: Vec<Placement>,
    /// Sub-particles that are held where they start, by serial (body by body, in the order of points).
    pub held: Vec<u32>,
    /// The equipment.
    pub surfaces: Vec<Surface>,
    /// The laws of force.
    pub laws: Laws,
    /// Acceleration of gravity, in m/s².
    pub gravity: DVec3,
    /// Corners of the domain, in metres; fixed-point positions cover it.
    pub low: DVec3,
    /// See `low`.
    pub high: DVec3,
    /// Whether the domain is periodic in y.
    pub periodic_y: bool,
    /// Time step, in seconds.
    pub timestep_s: f64,
    /// Speed that no sub-particle may exceed, in m/s.
    pub speed_limit_m_s: f64,
}

/// A meta-particle and the mass of each of its sub-particles.
#[derive(Clone, Debug)]
pub struct BodyKind {
    /// Points and bonds.
    pub meta: Arc<MetaParticle>,
    /// Mass of one sub-particle, in kilograms.
    pub subparticle_mass_kg: f64,
}

/// Where a body starts.
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

/// The laws of force of a run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Laws {
    /// Between sub-particles.
    pub tissue: ContactLaw,
    /// Against walls, gate and plates.
    pub equipment: ContactLaw,
    /// Against the belt.
    pub belt: ContactLaw,
    /// Of the bonds.
    pub bond: BondLaw,
    /// Whether bonded neighbours act on each other by contact too.
    pub contact_between_bonded: bool,
}

impl Laws {
    /// The law of a surface: that of its kind, with its own friction where it has one.
    pub fn for_surface(&self, surface: &Surface) -> ContactLaw {
        let law = match surface.kind {
            SurfaceKind::Equipment => self.equipment,
            SurfaceKind::Belt => self.belt,
            SurfaceKind::Frictionless => ContactLaw { mu: 0.0, ..self.equipment },
        };
        ContactLaw { mu: surface.friction.map_or(law.mu, |mu| mu as f32), ..law }
    }

    /// How far apart sub-particles or a surface can still hold each other, in metres.
    pub fn adhesion_range(&self) -> f32 {
        self.tissue.adhesion_range().max(self.equipment.adhesion_range()).max(self.belt.adhesion_range())
    }
}
