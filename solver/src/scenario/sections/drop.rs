//! Fillets that hit a plate.

use serde::{Deserialize, Serialize};

use super::declaration::{Declaration, ExperimentSection};
use crate::scenario::field::{Field, Preset, from_to};
use crate::scenario::row::{ANGLE, SCATTER, number, section};

/// Fillets that hit a plate: orientation, and speed at the plate.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Drop {
    /// Downward speed at which fillets reach the plate, in m/s.
    pub speed_m_s: f64,
    /// First turn, about the vertical, in degrees.
    pub yaw_deg: f64,
    /// Second turn, about the fillet's width, in degrees.
    pub pitch_deg: f64,
    /// Third turn, about the fillet's length, in degrees.
    pub roll_deg: f64,
    /// Maximum random deviation of each of the three, in degrees.
    pub scatter_deg: f64,
}

/// Its fields in the table.
#[rustfmt::skip]
pub(in crate::scenario) const FIELDS: &[Field] = &[
    number("/drop/speed_m_s", "m/s", 2.0, from_to(0.0, 30.0), "Fig. 11",
        "Downward speed of the fillets when they reach the plate. For example, a free fall of 0.2 m gives 2 m/s."),
    number("/drop/yaw_deg", "°", 0.0, ANGLE, "Fig. 10",
        "Yaw: rotation about the vertical axis. If yaw, pitch and roll are 0, the fillet lies flat with its length along x."),
    number("/drop/pitch_deg", "°", 0.0, ANGLE, "Fig. 10",
        "Pitch: rotation about the axis along the fillet's width. Roost applies the pitch after the yaw. At 90°, the fillet falls with \
         its tail first."),
    number("/drop/roll_deg", "°", 0.0, ANGLE, "Fig. 10",
        "Roll: rotation about the axis along the fillet's length. Roost applies the roll after the pitch. At 90°, the fillet falls on \
         its side."),
    number("/drop/scatter_deg", "°", 0.0, SCATTER, "assumed",
        "Maximum random deviation of each fillet's yaw, pitch and roll from the angles `yaw_deg`, `pitch_deg` and `roll_deg`. The random \
         numbers depend on `/seed`."),
];

/// The experiment in documents.
#[rustfmt::skip]
pub(in crate::scenario) const DECLARATION: Declaration = Declaration {
    name: "drop",
    question: "Do bonds of a fillet break in an impact, and how long does the fillet move?",
    sections: &[
        section("/drop", Some("drop"), "Fillets hit plates. Each fillet has a plate of its own."),
    ],
    fields: FIELDS,
    takes: &[
        "/product/count", "/product/sizes_m", "/product/shape", "/product/mesh", "/product/fill",
        "/numerics/duration_s", "/numerics/stop/when_done",
    ],
    defaults: &[
        ("/product/count", Preset::Integer(90)),
        ("/numerics/duration_s", Preset::Number(2.0)),
        ("/numerics/output_interval_s", Preset::Number(0.002)),
    ],
    order: &[],
};

impl ExperimentSection for Drop {}
