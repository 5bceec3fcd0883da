//! Hopper, gate and belt.

use serde::{Deserialize, Serialize};

use super::declaration::{AtMost, Declaration, ExperimentSection};
use super::surface::SurfaceSpec;
use crate::scenario::field::{Field, MAX_SURFACES, from_to};
use crate::scenario::row::{choice, flag, list, nullable, number, section};

/// Hopper, gate and belt. The dimensions of the paper's Fig. 5 are derived.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Equipment {
    /// Height of the gate's lower edge above the belt, in metres.
    pub gate_opening_m: f64,
    /// Inner width of the hopper across the belt (y), in metres.
    pub hopper_width_m: f64,
    /// Inner length of the hopper along the belt (x) at the belt, in metres.
    pub hopper_length_m: f64,
    /// Height of the hopper walls above the belt, in metres.
    pub hopper_height_m: f64,
    /// Slope of the back wall from the vertical, opening upwards, in degrees.
    pub wall_slope_deg: f64,
    /// The two walls along the belt.
    pub side_walls: SideWalls,
    /// Speed of the belt from t = 0 on, in m/s.
    pub belt_speed_m_s: f64,
    /// Whether a shutter closes the opening until the belt starts.
    pub shutter_while_filling: bool,
    /// Whether belt, walls, gate and shutter are made from these fields.
    pub parametric: bool,
    /// Mass that enters from above per second from t = 0 on, in kg/s.
    pub feed_kg_s: f64,
    /// Whether the result has the series of force and torque on each surface.
    pub surface_loads: bool,
    /// Inner width of the opening that `surfaces` leave under the gate, in metres.
    pub opening_width_m: Option<f64>,
    /// Height of that opening above the belt, in metres.
    pub opening_height_m: Option<f64>,
    /// Further surfaces.
    pub surfaces: Vec<SurfaceSpec>,
}

/// The two walls along the belt.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SideWalls {
    /// With the friction of the equipment.
    Rough,
    /// Without friction: a slice of a wide hopper.
    Frictionless,
    /// No walls: fillets that leave on one side enter on the other.
    Periodic,
}

/// Its fields in the table.
#[rustfmt::skip]
pub(in crate::scenario) const FIELDS: &[Field] = &[
    number("/equipment/gate_opening_m", "m", 0.06, from_to(0.001, 5.0), "Fig. 5",
        "Height of the gate's lower edge above the belt. If `parametric` is false, `gate_opening_m` has no effect: set \
         `opening_height_m` instead. Roost then refuses a value of `gate_opening_m` that is neither the default nor equal to \
         `opening_height_m`.")
        .acts_from_start(),
    number("/equipment/hopper_width_m", "m", 0.59, from_to(0.01, 10.0), "derived",
        "Inner width of the hopper across the belt (along y). The default is derived from the paper's discharge of 33.2 kg in 4 s."),
    number("/equipment/hopper_length_m", "m", 0.30, from_to(0.01, 10.0), "derived",
        "Inner length of the hopper along the belt (along x), measured at the height of the belt."),
    number("/equipment/hopper_height_m", "m", 0.5, from_to(0.01, 10.0), "assumed",
        "Height of the hopper walls above the belt. If `parametric` is true, this height is a minimum. Roost makes the walls higher if \
         necessary: the walls end at least 0.1 m above the start positions of all fillets. Therefore fillets do not fall beside the \
         hopper."),
    number("/equipment/wall_slope_deg", "°", 0.0, from_to(0.0, 80.0), "assumed",
        "Angle between the vertical direction and the back wall (the wall at the end of the hopper opposite the gate). If the angle is \
         above 0, the hopper widens upwards."),
    choice("/equipment/side_walls", &["rough", "frictionless", "periodic"], "section 2.4",
        "Kind of the two walls along the belt. `rough`: walls with the friction of the equipment. `frictionless`: walls without \
         friction, for a slice (narrow part) of a wide hopper. `periodic`: no walls. With `periodic`, a fillet that leaves on one side \
         enters on the other side."),
    number("/equipment/belt_speed_m_s", "m/s", 0.25, from_to(0.0, 10.0), "section 2.4",
        "Speed of the belt from t = 0 on. The paper's belt runs at 15 m/min (0.25 m/s). If `parametric` is false, the velocity of the belt \
         in `surfaces` replaces this field.")
        .acts_from_start(),
    flag("/equipment/shutter_while_filling", true, "assumed",
        "Whether a shutter closes the opening under the gate until the belt starts."),
    number("/equipment/feed_kg_s", "kg/s", 0.0, from_to(0.0, 1000.0), "assumed",
        "Feed: mass per second of the fillets that enter from above after t = 0. These fillets start at the height `hopper_height_m`, at \
         random positions where they touch nothing. With the value 0, there is no feed."),
    flag("/equipment/parametric", true, "assumed",
        "True: Roost makes the belt, the walls, the gate and the shutter from the fields of this table. False: the hopper consists only \
         of the items of `surfaces`."),
    flag("/equipment/surface_loads", false, "numerics",
        "Whether the result has series of the force and the torque on each surface. Each surface adds six series to the result. Therefore \
         the size of the result grows with the number of surfaces."),
    nullable("/equipment/opening_width_m", "m", from_to(0.001, 10.0), "assumed",
        "Inner width of the opening under the gate, if `parametric` is false. If this field is then null, Roost computes neither the belt \
         capacity nor `regime`. If `parametric` is true, this field must be null.")
        .acts_from_start(),
    nullable("/equipment/opening_height_m", "m", from_to(0.001, 5.0), "assumed",
        "Height of the gate's lower edge above the belt, if `parametric` is false. If this field is then null, Roost computes neither the \
         belt capacity nor `regime`. If `parametric` is true, this field must be null.")
        .acts_from_start(),
];

/// The experiment in documents.
#[rustfmt::skip]
pub(in crate::scenario) const DECLARATION: Declaration = Declaration {
    name: "hopper",
    question: "Does the hopper discharge evenly, discharge unevenly, or jam?",
    sections: &[
        section("/equipment", Some("hopper"),
            "This section describes the hopper, the gate and the belt. The default width and length of the hopper (Fig. 5) are derived \
             from other numbers of the paper."),
        list("/equipment/surfaces", "/scene/surfaces/*", MAX_SURFACES, Some("hopper"),
            "This list has your own surfaces, such as parts from a CAD model. If `parametric` is true, Roost adds these surfaces to the \
             surfaces that it makes itself. If `parametric` is false, the hopper has only the surfaces of this list. The fields are the \
             same as in `/scene/surfaces` of the experiment `scene`."),
    ],
    fields: FIELDS,
    takes: &[
        "/product/count", "/product/sizes_m", "/product/shape", "/product/mesh", "/product/spheres", "/product/fill",
        "/contact/fillet_fillet_radius_ratio",
        "/numerics/duration_s", "/numerics/jam_after_s", "/numerics/stop/when_empty", "/numerics/stop/when_jammed_s",
        "/numerics/max_fill_s",
    ],
    defaults: &[],
    order: &[
        AtMost {
            small: "/equipment/gate_opening_m",
            large: "/equipment/hopper_height_m",
            otherwise: "the gate would open above the hopper",
        },
    ],
};

impl ExperimentSection for Equipment {
    fn surfaces(&self) -> (&'static str, &[SurfaceSpec]) {
        ("/equipment/surfaces", &self.surfaces)
    }
}
