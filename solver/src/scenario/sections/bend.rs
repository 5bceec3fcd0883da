//! A fillet that bends under its own weight.

use serde::{Deserialize, Serialize};

use super::declaration::{Declaration, ExperimentSection};
use crate::scenario::field::{Field, Preset, between, from_to};
use crate::scenario::row::{choice, number, section};

/// A fillet that bends under its own weight.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Bend {
    /// Its support.
    pub support: Support,
    /// Radius of the bar or of the roller at the conveyor's end, in metres.
    pub bar_radius_m: f64,
    /// Speed of the conveyor, in m/s.
    pub belt_speed_m_s: f64,
    /// Share of the fillet's length that is held.
    pub clamped_share: f64,
    /// Maximum random deviation of the yaw, in degrees.
    pub scatter_deg: f64,
}

/// The support of a bending fillet.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Support {
    /// Laid across a bar, both ends hanging.
    OverBar,
    /// Carried off the end of a conveyor.
    OffLedge,
    /// Held at its blunt end.
    Clamped,
}

/// Its fields in the table.
#[rustfmt::skip]
pub(in crate::scenario) const FIELDS: &[Field] = &[
    choice("/bend/support", &["over_bar", "off_ledge", "clamped"], "section 2.3.2",
        "Support of the fillet. `over_bar`: the fillet hangs over a bar. `off_ledge`: a conveyor carries the fillet over the conveyor's \
         end. `clamped`: a clamp holds the blunt end of the fillet."),
    number("/bend/bar_radius_m", "m", 0.02, from_to(0.002, 1.0), "assumed",
        "Radius of the bar. For `off_ledge`: radius of the roller at the conveyor's end."),
    number("/bend/belt_speed_m_s", "m/s", 0.25, from_to(0.0, 10.0), "section 2.4",
        "Speed of the conveyor. Only the support `off_ledge` uses this field."),
    number("/bend/clamped_share", "", 0.25, between(0.0, 1.0), "assumed",
        "Share of the fillet's length that the clamp holds. Only the support `clamped` uses this field."),
    number("/bend/scatter_deg", "°", 0.0, from_to(0.0, 45.0), "assumed",
        "Maximum random deviation of the fillet's yaw, the rotation about the vertical axis. The random numbers depend on `/seed`."),
];

/// The experiment in documents.
#[rustfmt::skip]
pub(in crate::scenario) const DECLARATION: Declaration = Declaration {
    name: "bend",
    question: "How far does a fillet bend over a bar, or over the end of a conveyor?",
    sections: &[
        section("/bend", Some("bend"), "A fillet bends under its own weight."),
    ],
    fields: FIELDS,
    takes: &[
        "/product/sizes_m", "/product/shape", "/product/mesh", "/product/fill", "/numerics/duration_s",
        "/numerics/stop/when_done", "/numerics/max_fill_s",
    ],
    defaults: &[
        ("/product/shape", Preset::Integer(2)),
        ("/numerics/duration_s", Preset::Number(5.0)),
        ("/numerics/rest_speed_m_s", Preset::Number(0.02)),
    ],
    order: &[],
};

impl ExperimentSection for Bend {}
