//! Warnings: conditions under which a result may mislead, each with a stable code.
//!
//! [`ALL_WARNINGS`] is the table of codes. [`scenario`] finds what is known before a run, [`responses`] what responses reveal;
//! [`ExperimentMonitor::warnings`](crate::engine::run::ExperimentMonitor::warnings) adds what only the monitor knows.

mod responses;
mod scenario;
#[cfg(test)]
mod tests;

use serde_json::Value;

use super::outputs::{Response, line, number};
use crate::result::Warning;
pub use responses::of_responses;
pub use scenario::of_scenario;

/// A kind of warning.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct WarningKind {
    /// Its code. It never changes, so that programs can test it.
    pub code: &'static str,
    /// The condition, for the table of codes.
    pub when: &'static str,
    /// What to do, in one or more sentences. The message ends with it.
    pub action: &'static str,
}

impl WarningKind {
    /// The warning with a sentence of figures.
    pub(super) fn with(&self, figures: &str) -> Warning {
        Warning { code: self.code.to_owned(), message: format!("{figures} {}", self.action) }
    }
}

const fn kind(code: &'static str, when: &'static str, action: &'static str) -> WarningKind {
    WarningKind { code, when, action }
}

const UNSTABLE_TIMESTEP: WarningKind = kind(
    "unstable_timestep",
    "`/numerics/timestep_s` is past the stability limit with damping.",
    "Set /numerics/timestep_s to \"auto\" or to a smaller step.",
);
const WHOLE_SPHERES: WarningKind = kind(
    "whole_spheres",
    "`/product/fill` is `whole_spheres`: the body is up to 2R thinner than the shape.",
    "Set /product/fill to \"centres\", or choose a smaller /product/subparticle_radius_m.",
);
const THIN_FILLET: WarningKind = kind(
    "thin_fillet",
    "A fillet has fewer than four layers of sub-particles in its thickness: its bending and the flow depend on the radius.",
    "Choose a smaller /product/subparticle_radius_m, or compare two radii.",
);
const SOFT_TISSUE: WarningKind = kind(
    "soft_tissue",
    "The weight on a sub-particle at the floor presses it in by half of R or more, by Hertz: bodies may sink through.",
    "Check the unit of /material/youngs_modulus_pa, or raise it.",
);
const SLOW_BELT: WarningKind = kind(
    "slow_belt",
    "Within `/numerics/jam_after_s`, or a shorter `when_jammed_s`, the belt moves less than three diameters of a sub-particle: steady flow \
     may count as a jam.",
    "Raise /numerics/jam_after_s, and a shorter /numerics/stop/when_jammed_s.",
);
const ESCAPED_MASS: WarningKind = kind(
    "escaped_mass",
    "`escaped_kg` is above 0.",
    "Look at frames for gaps between surfaces, for tissue that sinks through them, or for fragments. In a scene, surfaces may end \
     there by intention.",
);
const PASSED_THROUGH: WarningKind = kind(
    "passed_through",
    "`passed_through` is above 0: sub-particles came through a surface.",
    "Reduce the speed of the impact, raise /material/youngs_modulus_pa, or make the surface larger than the bodies that strike it.",
);
const BROKEN_BONDS: WarningKind = kind(
    "broken_bonds",
    "`bonds_intact_fraction` is below 0.95.",
    "Reduce /numerics/timestep_s or the speed, or set /bonds/formulation to \"finite_extension\": fillets do not tear so easily.",
);
const DEEP_OVERLAP: WarningKind = kind(
    "deep_overlap",
    "`max_overlap_ratio` is above 1: two sub-particles without a bond were closer than R.",
    "Raise /material/youngs_modulus_pa, or reduce the speed of impacts or /numerics/timestep_s, if it happens after the fill.",
);
const DENSE_BED: WarningKind = kind(
    "dense_bed",
    "`bulk_density_kg_m3` is above the density of a fillet: fillets overlap.",
    "Treat masses and rates as too high by about this ratio, or raise /material/youngs_modulus_pa.",
);
const INTERPENETRATION: WarningKind = kind(
    "interpenetration",
    "`interpenetrated_fraction` is above 0.02: fillets slipped into the lattices of others.",
    "Set /contact/fillet_fillet_radius_ratio to 1.225, which closes the holes of the lattice, and compare.",
);
/// A test whose measured event never happened.
pub(super) const TEST_NEVER_BEGAN: WarningKind = kind(
    "test_never_began",
    "The event that the test measures did not happen: no rest before t = 0, no contact, no sliding, no hanging.",
    "Its responses are null or say nothing about the material: change the duration or the range of the test.",
);

/// A hopper whose regime has no reference.
pub(super) const NO_REGIME: WarningKind = kind(
    "no_regime",
    "The belt's capacity is unknown, or the belt stands still: `regime` is null.",
    "With /equipment/parametric false, give opening_width_m and opening_height_m, and a surface with motion \"belt\" that passes the gate \
     plane x = 0 at one speed.",
);

/// A feed that did not bring its mass.
pub(super) const FEED_SHORT: WarningKind = kind(
    "feed_short",
    "`fed_kg` is below the mass due by more than a fillet and 1 %: fillets found no free place over the hopper.",
    "Reduce /equipment/feed_kg_s or /numerics/output_interval_s, or let the belt carry off more.",
);

/// All kinds, in the order of the table.
pub const ALL_WARNINGS: &[&WarningKind] = &[
    &UNSTABLE_TIMESTEP,
    &WHOLE_SPHERES,
    &THIN_FILLET,
    &SOFT_TISSUE,
    &SLOW_BELT,
    &TEST_NEVER_BEGAN,
    &NO_REGIME,
    &FEED_SHORT,
    &ESCAPED_MASS,
    &PASSED_THROUGH,
    &BROKEN_BONDS,
    &DEEP_OVERLAP,
    &DENSE_BED,
    &INTERPENETRATION,
];

/// The number of warnings, as a response of every experiment.
pub(super) const WARNING_COUNT: Response =
    number("warning_count", "", "Number of warnings; the result document has them under `warnings`.");

/// That response, by name.
pub fn warning_count(warnings: &[Warning]) -> (String, Value) {
    (WARNING_COUNT.name.to_owned(), warnings.len().into())
}

/// The warning of a bed or a body that did not come to rest in time.
pub(super) fn never_at_rest(max_fill_s: f64) -> Warning {
    TEST_NEVER_BEGAN
        .with(&format!("Nothing came to rest within max_fill_s = {max_fill_s} s, so t = 0 was not reached."))
}

/// The table of codes in Markdown.
pub fn warnings_markdown() -> String {
    let mut page = String::from("| code | when | what to do |\n|---|---|---|\n");
    for kind in ALL_WARNINGS {
        page += &line(&[&format!("`{}`", kind.code), kind.when, kind.action]);
    }
    page
}
