//! A block of tissue between plates.

use serde::{Deserialize, Serialize};

use super::declaration::{AtMost, Declaration, ExperimentSection};
use crate::scenario::field::{Field, FieldKind, Preset, above_to, from_to};
use crate::scenario::row::{choice, field, number, section};

/// A block of tissue between plates.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Compress {
    /// Sub-particles along x, y and z.
    pub lattice: [u32; 3],
    /// Rate of strain, in 1/s.
    pub strain_rate_1_s: f64,
    /// Strain at which the test ends.
    pub max_strain: f64,
    /// Start of the window of the modulus.
    pub modulus_from_strain: f64,
    /// End of the window of the modulus.
    pub modulus_to_strain: f64,
    /// Plates with friction or without.
    pub plates: Plates,
}

/// The plates of a compression test.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Plates {
    /// With the friction of the equipment.
    Rough,
    /// Without friction.
    Frictionless,
}

/// Its fields in the table.
#[rustfmt::skip]
pub(in crate::scenario) const FIELDS: &[Field] = &[
    field("/compress/lattice", FieldKind::Counts(from_to(1.0, 200.0)), "", Preset::Counts([10, 10, 3]), "section 2.3.2",
        "Numbers of sub-particles of the block along x, y and z (upwards). For example, with R = 1.75 mm, a block of 10 × 10 × 3 \
         sub-particles measures 35 × 35 × 10.5 mm."),
    number("/compress/strain_rate_1_s", "1/s", 0.05, above_to(0.0, 10.0), "assumed",
        "Strain rate: change of the strain per second. The paper compresses a block of 10 mm height at 1 mm/min. This speed is a strain \
         rate of 0.0017 1/s."),
    number("/compress/max_strain", "", 0.06, above_to(0.0, 0.5), "Fig. 6",
        "Strain at which the test ends. The strain is 0 at the moment at which the stress becomes positive."),
    number("/compress/modulus_from_strain", "", 0.0, from_to(0.0, 0.5), "section 3.1",
        "Lower end of the strain range in which Roost determines the modulus."),
    number("/compress/modulus_to_strain", "", 0.03, above_to(0.0, 0.5), "section 3.1",
        "Upper end of the strain range in which Roost determines the modulus."),
    choice("/compress/plates", &["rough", "frictionless"], "assumed",
        "Kind of the plates. `rough`: plates with the friction of the equipment. `frictionless`: plates without friction."),
];

/// The experiment in documents.
#[rustfmt::skip]
pub(in crate::scenario) const DECLARATION: Declaration = Declaration {
    name: "compress",
    question: "How stiff is a block of tissue?",
    sections: &[
        section("/compress", Some("compress"), "Two plates compress a block of tissue."),
    ],
    fields: FIELDS,
    takes: &[
        "/numerics/stop/when_done",
    ],
    defaults: &[
        ("/numerics/gravity_m_s2", Preset::Number(0.0)),
    ],
    order: &[
        AtMost {
            small: "/compress/modulus_from_strain",
            large: "/compress/modulus_to_strain",
            otherwise: "the window of strain would be empty",
        },
        AtMost {
            small: "/compress/modulus_to_strain",
            large: "/compress/max_strain",
            otherwise: "the test would end before the window of strain does",
        },
    ],
};

impl ExperimentSection for Compress {}
