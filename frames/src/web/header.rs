//! The header, which holds for all frames.

use glam::DVec3;
use roost_solver::SOLVER_REVISION;
use roost_solver::engine::scene::Scene;
use roost_solver::equipment::{self, Presence, SurfaceKind};
use roost_solver::scenario::Scenario;
use serde::{Deserialize, Serialize};

use super::{Error, MAX_SUBPARTICLES, SCHEMA};

/// Description of the run, which holds for all frames.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Header {
    /// Always [`SCHEMA`].
    pub schema: String,
    /// BLAKE3 of the canonical JSON of the scenario in hex, as in its result.
    pub scenario_digest: String,
    /// The experiment's name, such as `hopper`.
    pub experiment: String,
    /// Revision of the solver.
    pub solver_revision: u32,
    /// Time between frames in seconds, a whole number of samples.
    pub frame_interval_s: f64,
    /// Radius of every sub-particle, in metres.
    pub radius_m: f64,
    /// Lower corner of the domain, in metres.
    pub low_m: [f64; 3],
    /// Upper corner of the domain, in metres.
    pub high_m: [f64; 3],
    /// Whether the domain is periodic in y.
    pub periodic_y: bool,
    /// The shapes of bodies.
    pub kinds: Vec<BodyKind>,
    /// The kind of each body as an index into `kinds`. The index in this list is the body's number.
    pub bodies: Vec<u32>,
    /// The equipment.
    pub surfaces: Vec<Surface>,
}

/// A shape of bodies.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct BodyKind {
    /// Number of the shape: 2 · (number of the size), plus 1 for the mirror image.
    pub shape: u32,
    /// Sub-particles of one body.
    pub subparticles: u32,
}

/// A surface of the equipment.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Surface {
    /// Its name.
    pub name: String,
    /// `equipment`, `belt` or `frictionless`.
    pub kind: String,
    /// `always`, or `until_start`: gone once t ≥ 0.
    pub presence: String,
    /// Its motion from t = 0 on.
    pub motion: Motion,
    /// Corners of its triangles at t = 0, in metres.
    pub triangles_m: Vec<[[f64; 3]; 3]>,
}

/// The motion of a surface from t = 0 on.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum Motion {
    /// No motion.
    Fixed,
    /// The surface does not move, but its material does.
    Belt {
        /// Velocity of the material, in m/s.
        velocity_m_s: [f64; 3],
    },
    /// At time t a point x is at pivot + velocity · t + turn · (x − pivot), where `turn` rotates about the axis of the spin by |spin| · t.
    Moving {
        /// Velocity of the pivot, in m/s.
        velocity_m_s: [f64; 3],
        /// The pivot at t = 0, in metres.
        pivot_m: [f64; 3],
        /// Angular velocity, in rad/s.
        spin_rad_s: [f64; 3],
    },
}

impl Header {
    /// The header of a run of a scenario and its scene.
    ///
    /// # Errors
    /// When the scene exceeds the maximum of sub-particles.
    pub fn new(scenario: &Scenario, scene: &Scene, frame_interval_s: f64) -> Result<Self, Error> {
        let first_shape = first_shape(scenario);
        let kinds = scene.kinds.iter().zip(first_shape..);
        let header = Self {
            schema: SCHEMA.to_owned(),
            scenario_digest: scenario.digest(),
            experiment: experiment(scenario),
            solver_revision: SOLVER_REVISION,
            frame_interval_s,
            radius_m: scene.radius_m,
            low_m: scene.low.to_array(),
            high_m: scene.high.to_array(),
            periodic_y: scene.periodic_y,
            kinds: kinds
                .map(|(kind, shape)| BodyKind { shape, subparticles: kind.meta.points.len() as u32 })
                .collect(),
            bodies: scene.bodies.iter().map(|body| body.kind as u32).collect(),
            surfaces: scene.surfaces.iter().flat_map(surfaces).collect(),
        };
        header.first_serials()?;
        Ok(header)
    }

    /// The serial of each body's first sub-particle, and the total of sub-particles at the end.
    pub(super) fn first_serials(&self) -> Result<Vec<u32>, Error> {
        let mut next = 0u64;
        let mut serials = vec![0];
        for &kind in &self.bodies {
            let kind = self.kinds.get(kind as usize).ok_or(Error::Damaged("a body has an unknown kind"))?;
            next += u64::from(kind.subparticles);
            if next > MAX_SUBPARTICLES {
                return Err(Error::TooMany(next));
            }
            serials.push(next as u32);
        }
        Ok(serials)
    }
}

/// The shape of the first kind of a scene. A scenario with one chosen shape has no other kind.
pub(crate) fn first_shape(scenario: &Scenario) -> u32 {
    scenario.product.shape.unwrap_or(0)
}

fn experiment(scenario: &Scenario) -> String {
    let document = serde_json::to_value(scenario).unwrap_or_default();
    document["experiment"].as_str().unwrap_or_default().to_owned()
}

/// A surface, before it its form until t = 0, which covers the later one.
fn surfaces(surface: &equipment::Surface) -> impl Iterator<Item = Surface> {
    let closed = surface.closed.iter().map(|triangles| drawn(surface, Presence::UntilStart, triangles));
    closed.chain([drawn(surface, surface.presence, &surface.triangles)])
}

fn drawn(surface: &equipment::Surface, presence: Presence, triangles: &[[DVec3; 3]]) -> Surface {
    Surface {
        name: surface.name.clone(),
        kind: surface_kind_name(surface.kind).to_owned(),
        presence: match presence {
            Presence::Always => "always".to_owned(),
            Presence::UntilStart => "until_start".to_owned(),
        },
        motion: match surface.motion {
            equipment::Motion::Fixed => Motion::Fixed,
            equipment::Motion::Belt { velocity } => Motion::Belt { velocity_m_s: velocity.to_array() },
            equipment::Motion::Moving { velocity, pivot, spin } => Motion::Moving {
                velocity_m_s: velocity.to_array(),
                pivot_m: pivot.to_array(),
                spin_rad_s: spin.to_array(),
            },
        },
        triangles_m: triangles.iter().map(|corners| corners.map(DVec3::into)).collect(),
    }
}

/// The name of a surface's kind.
pub(crate) fn surface_kind_name(kind: SurfaceKind) -> &'static str {
    match kind {
        SurfaceKind::Equipment => "equipment",
        SurfaceKind::Belt => "belt",
        SurfaceKind::Frictionless => "frictionless",
    }
}
