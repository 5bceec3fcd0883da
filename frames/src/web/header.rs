//! The header: what stays the same in all frames.

use glam::DVec3;
use roost_solver::SOLVER_REVISION;
use roost_solver::engine::scene::Scene;
use roost_solver::equipment::{self, Presence, SurfaceKind};
use roost_solver::scenario::Scenario;
use serde::{Deserialize, Serialize};

use super::{Error, MOST_SUBPARTICLES, SCHEMA};

/// What stays the same in all frames.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Header {
    /// Always [`SCHEMA`].
    pub schema: String,
    /// blake3 of the canonical JSON of the scenario, in hex: that of its result.
    pub scenario_digest: String,
    /// The experiment's name, such as `hopper`.
    pub experiment: String,
    /// Revision of the physics that made the frames.
    pub solver_revision: u32,
    /// Time between frames, in seconds: whole samples, to the nearest time step.
    pub frame_interval_s: f64,
    /// Radius of every sub-particle, in metres.
    pub radius_m: f64,
    /// Lower corner of the domain, in metres.
    pub low_m: [f64; 3],
    /// Upper corner of the domain, in metres.
    pub high_m: [f64; 3],
    /// Whether what leaves the domain in y comes in again on the other side.
    pub periodic_y: bool,
    /// The shapes that bodies have.
    pub kinds: Vec<Kind>,
    /// The kind of each body, an index into `kinds`; a body's number is its place here.
    pub bodies: Vec<u32>,
    /// The equipment.
    pub surfaces: Vec<Surface>,
}

/// A shape that bodies have.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Kind {
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
    /// How it moves from t = 0 on.
    pub motion: Motion,
    /// Corners where it is at t = 0, in metres.
    pub triangles_m: Vec<[[f64; 3]; 3]>,
}

/// How a surface moves from t = 0 on.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum Motion {
    /// Not at all.
    Fixed,
    /// The surface stays where it is and its material runs along it.
    Belt {
        /// Velocity of the material, in m/s.
        velocity_m_s: [f64; 3],
    },
    /// At t a point x is at pivot + velocity · t + turn · (x − pivot), turned about the spin's axis by |spin| · t.
    Moving {
        /// Velocity of the pivot, in m/s.
        velocity_m_s: [f64; 3],
        /// Where the pivot is at t = 0, in metres.
        pivot_m: [f64; 3],
        /// Angular velocity, in rad/s.
        spin_rad_s: [f64; 3],
    },
}

impl Header {
    /// The header of a run of a scenario, as the scene that was made of it.
    ///
    /// # Errors
    /// When it has more sub-particles than a stream may have.
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
                .map(|(kind, shape)| Kind { shape, subparticles: kind.meta.points.len() as u32 })
                .collect(),
            bodies: scene.bodies.iter().map(|body| body.kind as u32).collect(),
            surfaces: scene.surfaces.iter().map(surface).collect(),
        };
        header.first_serials()?;
        Ok(header)
    }

    /// The serial of the first sub-particle of each body, and the number of all sub-particles at the end.
    pub(super) fn first_serials(&self) -> Result<Vec<u32>, Error> {
        let mut next = 0u64;
        let mut serials = vec![0];
        for &kind in &self.bodies {
            let kind = self.kinds.get(kind as usize).ok_or(Error::Damaged("a body is of no kind"))?;
            next += u64::from(kind.subparticles);
            if next > MOST_SUBPARTICLES {
                return Err(Error::TooMany(next));
            }
            serials.push(next as u32);
        }
        Ok(serials)
    }
}

/// The shape of the first kind of a scene: where a scenario asks for one shape alone, there is no other kind.
pub(crate) fn first_shape(scenario: &Scenario) -> u32 {
    scenario.product.shape.unwrap_or(0)
}

fn experiment(scenario: &Scenario) -> String {
    let document = serde_json::to_value(scenario).unwrap_or_default();
    document["experiment"].as_str().unwrap_or_default().to_owned()
}

fn surface(surface: &equipment::Surface) -> Surface {
    Surface {
        name: surface.name.clone(),
        kind: kind_name(surface.kind).to_owned(),
        presence: match surface.presence {
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
        triangles_m: surface.triangles.iter().map(|corners| corners.map(DVec3::into)).collect(),
    }
}

/// The name of what a surface is made of.
pub(crate) fn kind_name(kind: SurfaceKind) -> &'static str {
    match kind {
        SurfaceKind::Equipment => "equipment",
        SurfaceKind::Belt => "belt",
        SurfaceKind::Frictionless => "frictionless",
    }
}
