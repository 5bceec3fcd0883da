//! Bodies and surfaces, freely placed.

use serde::{Deserialize, Serialize};

use super::declaration::{Declaration, ExperimentSection};
use super::surface::SurfaceSpec;
use crate::scenario::field::{Field, MAX_BODIES, MAX_SURFACES, Preset, above_to, from_to};
use crate::scenario::row::{ANGLE, ORIGIN, PLACE, SPEED, integer, list, number, section, vector};

/// Bodies and surfaces, freely placed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FreeScene {
    /// Direction of gravity, of any length.
    pub gravity_direction: [f64; 3],
    /// Distance beyond everything at the start at which sub-particles leave, in metres.
    pub margin_m: f64,
    /// The bodies.
    pub bodies: Vec<BodySpec>,
    /// The surfaces.
    pub surfaces: Vec<SurfaceSpec>,
}

/// A body of a scene.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BodySpec {
    /// Its shape: 2 · (number of the size), plus 1 for the mirror image.
    pub shape: u32,
    /// Where its centre of mass starts, in metres.
    pub position_m: [f64; 3],
    /// Yaw, pitch and roll, in degrees.
    pub orientation_deg: [f64; 3],
    /// Its velocity at the start, in m/s.
    pub velocity_m_s: [f64; 3],
}

/// Its fields in the table.
#[rustfmt::skip]
pub(in crate::scenario) const FIELDS: &[Field] = &[
    vector("/scene/gravity_direction", "", Preset::Vector([0.0, 0.0, -1.0]), from_to(-1.0, 1.0), "assumed",
        "Direction of gravity, as a vector. The length of the vector has no effect, because `/numerics/gravity_m_s2` sets the \
         acceleration."),
    number("/scene/margin_m", "m", 0.5, above_to(0.0, 10.0), "numerics",
        "Margin around the scene. The simulated space is the bounding box of the scene at the start, enlarged on all sides by this \
         margin. A sub-particle that goes out of the simulated space leaves the simulation."),
    integer("/scene/bodies/*/shape", 0, from_to(0.0, 63.0), "Fig. 1",
        "Number of the body's shape. Shapes 0 and 1 belong to the first size in `/product/sizes_m`, shapes 2 and 3 to the second size, \
         and so on. A shape with an odd number is a mirror image."),
    vector("/scene/bodies/*/position_m", "m", Preset::Required, PLACE, "assumed",
        "Position of the body's centre of mass at the start."),
    vector("/scene/bodies/*/orientation_deg", "°", ORIGIN, ANGLE, "assumed",
        "Rotation of the body by three angles: first yaw (about z), then pitch (about the body's width), then roll (about the body's \
         length)."),
    vector("/scene/bodies/*/velocity_m_s", "m/s", ORIGIN, SPEED, "assumed",
        "Velocity of the body at the start."),
];

/// The experiment in documents.
#[rustfmt::skip]
pub(in crate::scenario) const DECLARATION: Declaration = Declaration {
    name: "scene",
    question: "Every other question: you place bodies and surfaces freely, for example from a CAD file",
    sections: &[
        section("/scene", Some("scene"), "This section places bodies and surfaces."),
        list("/scene/bodies", "/scene/bodies/*", MAX_BODIES, Some("scene"),
            "This list has the bodies, with their shape, position, orientation and velocity."),
        list("/scene/surfaces", "/scene/surfaces/*", MAX_SURFACES, Some("scene"),
            "This list has the surfaces, with their triangles, position, contact parameters and motion. The triangles of a surface move \
             together."),
    ],
    fields: FIELDS,
    takes: &[
        "/product/sizes_m", "/product/mesh", "/product/spheres", "/product/fill", "/numerics/duration_s",
        "/contact/fillet_fillet_radius_ratio",
        "/numerics/stop/when_empty", "/numerics/stop/when_done",
    ],
    defaults: &[
        ("/numerics/duration_s", Preset::Number(2.0)),
        ("/numerics/stop/when_done", Preset::Flag(false)),
    ],
    order: &[],
};

impl ExperimentSection for FreeScene {
    fn surfaces(&self) -> (&'static str, &[SurfaceSpec]) {
        ("/scene/surfaces", &self.surfaces)
    }
}
