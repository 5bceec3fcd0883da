//! Elastic constants of the tissue.

use serde::{Deserialize, Serialize};

use crate::scenario::field::{Field, between, from_to};
use crate::scenario::row::number;

/// Elastic constants of the tissue (Table 2).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Material {
    /// Young's modulus, in pascal.
    pub youngs_modulus_pa: f64,
    /// Poisson's ratio.
    pub poisson_ratio: f64,
}

/// Its fields in the table.
#[rustfmt::skip]
pub(in crate::scenario) const FIELDS: &[Field] = &[
    number("/material/youngs_modulus_pa", "Pa", 48_600.0, from_to(100.0, 1e10), "Table 2",
        "Young's modulus of the tissue, which Roost uses for each sub-particle. With the default values, the stiffness of a whole fillet \
         comes mostly from its bonds."),
    number("/material/poisson_ratio", "", 0.37, between(-1.0, 0.5), "Table 2",
        "Poisson's ratio of the tissue, which Roost uses for each sub-particle."),
];
