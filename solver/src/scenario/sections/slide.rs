//! A fillet on a plate that is tilted.

use serde::{Deserialize, Serialize};

use super::declaration::{Declaration, ExperimentSection};
use crate::scenario::field::{Field, Preset, from_to};
use crate::scenario::row::{ANGLE, SCATTER, number, section};

/// A fillet on a plate that is tilted.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Slide {
    /// Rate of tilting, in degrees a second.
    pub tilt_rate_deg_s: f64,
    /// Maximum tilt, in degrees.
    pub max_tilt_deg: f64,
    /// Heading of the fillet, in degrees; 0 points its length up the slope.
    pub yaw_deg: f64,
    /// Maximum random deviation of the heading, in degrees.
    pub scatter_deg: f64,
}

/// Its fields in the table.
#[rustfmt::skip]
pub(in crate::scenario) const FIELDS: &[Field] = &[
    number("/slide/tilt_rate_deg_s", "°/s", 3.0, from_to(0.1, 30.0), "section 2.3.2",
        "Angular speed at which the plate tilts. Above 6 °/s, the error of the response `critical_angle_deg` grows."),
    number("/slide/max_tilt_deg", "°", 60.0, from_to(1.0, 89.0), "assumed",
        "Maximum tilt of the plate. At this tilt, the simulation ends."),
    number("/slide/yaw_deg", "°", 0.0, ANGLE, "assumed",
        "Yaw of the fillet: its direction on the plate. At 0°, the fillet lies along the slope, with its tail (the narrow end) uphill."),
    number("/slide/scatter_deg", "°", 0.0, SCATTER, "assumed",
        "Maximum random deviation of the fillet's yaw from `yaw_deg`. The random numbers depend on `/seed`."),
];

/// The experiment in documents.
#[rustfmt::skip]
pub(in crate::scenario) const DECLARATION: Declaration = Declaration {
    name: "slide",
    question: "At which tilt does a fillet slide off a plate?",
    sections: &[
        section("/slide", Some("slide"), "A fillet lies on a plate. The plate tilts until the fillet slides."),
    ],
    fields: FIELDS,
    takes: &[
        "/product/sizes_m", "/product/shape", "/product/mesh", "/product/fill", "/numerics/stop/when_done",
        "/numerics/max_fill_s",
    ],
    defaults: &[
        ("/product/shape", Preset::Integer(2)),
        ("/numerics/rest_speed_m_s", Preset::Number(0.01)),
    ],
    order: &[],
};

impl ExperimentSection for Slide {}
