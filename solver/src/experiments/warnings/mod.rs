//! Warnings: conditions under which a result may mislead, each with a stable code.
//!
//! [`ALL_WARNINGS`] is the table of codes. [`scenario`] finds what is known before a run, [`responses`] what responses reveal;
//! [`ExperimentMonitor::warnings`](crate::engine::run::ExperimentMonitor::warnings) adds what only the monitor knows.

mod responses;
mod scenario;
#[cfg(test)]
mod tests;

use serde_json::Value;

use super::outputs::{Response, line, number, word};
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
    "`/numerics/timestep_s` is above the stability limit. Roost takes into account that damping lowers this limit.",
    "Set /numerics/timestep_s to \"auto\", or to a time step below the stability limit.",
);
const WHOLE_SPHERES: WarningKind = kind(
    "whole_spheres",
    "`/product/fill` is `whole_spheres`. A simulated body is then up to 2R thinner than its shape in the scenario.",
    "Set /product/fill to \"centres\", or choose a smaller /product/subparticle_radius_m.",
);
const THIN_FILLET: WarningKind = kind(
    "thin_fillet",
    "A fillet is fewer than four layers of sub-particles thick. The bending of the fillet and the flow then depend on R.",
    "Choose a smaller /product/subparticle_radius_m, or simulate with two radii and compare the results.",
);
const SOFT_TISSUE: WarningKind = kind(
    "soft_tissue",
    "The weight above a sub-particle at the floor compresses this sub-particle by half of R or more, according to Hertz' law. Bodies may \
     sink through the floor.",
    "Check the unit of /material/youngs_modulus_pa, or raise the modulus.",
);
const SLOW_BELT: WarningKind = kind(
    "slow_belt",
    "The jam time is `/numerics/jam_after_s`, or `/numerics/stop/when_jammed_s` if this field has a shorter time. In the jam time, the \
     belt moves by less than three diameters of a sub-particle. Steady flow may then count as a jam.",
    "Raise /numerics/jam_after_s. If /numerics/stop/when_jammed_s is shorter than /numerics/jam_after_s, also raise \
     /numerics/stop/when_jammed_s.",
);
const ESCAPED_MASS: WarningKind = kind(
    "escaped_mass",
    "`escaped_kg` is above 0: mass left the simulated space.",
    "In the frames (the stored positions of the sub-particles), look for gaps between surfaces, tissue that sinks through surfaces, and \
     fragments. In a scene, bodies may leave on purpose.",
);
const PASSED_THROUGH: WarningKind = kind(
    "passed_through",
    "`passed_through` is above 0: sub-particles went through a surface.",
    "Reduce the speed of the impact, raise /material/youngs_modulus_pa, or make the surface larger than the bodies that hit the surface.",
);
const BROKEN_BONDS: WarningKind = kind(
    "broken_bonds",
    "`bonds_intact_fraction` is below 0.95: more than 5 % of the bonds broke.",
    "Reduce /numerics/timestep_s or the speed of impacts. You can also set /bonds/formulation to \"finite_extension\". Fillets then tear \
     less easily.",
);
const DEEP_OVERLAP: WarningKind = kind(
    "deep_overlap",
    "`max_overlap_ratio` is above 1: the centres of two sub-particles without a bond were closer than R.",
    "If this overlap occurs while a hopper fills, do nothing. In all other cases, raise /material/youngs_modulus_pa, or reduce \
     /numerics/timestep_s or the speed of impacts.",
);
const DENSE_BED: WarningKind = kind(
    "dense_bed",
    "`bulk_density_kg_m3` is above the density of a fillet: the fillets overlap.",
    "Masses and rates are too high. To estimate by how much, divide the bulk density by the density of a fillet. To reduce the overlap, \
     raise /material/youngs_modulus_pa.",
);
const INTERPENETRATION: WarningKind = kind(
    "interpenetration",
    "`interpenetrated_fraction` is above 0.02: sub-particles lie inside other fillets.",
    "Set /contact/fillet_fillet_radius_ratio to 1.225, and simulate again. Sub-particles are then too large to slip into another fillet. \
     Compare the new results with the results that have this warning.",
);
/// A test whose measured event never happened.
pub(super) const TEST_NEVER_BEGAN: WarningKind = kind(
    "test_never_began",
    "The event that the test measures did not happen. For example, the body did not come to rest before t = 0, did not touch a surface, \
     did not slide, or did not hang.",
    "The responses are null or say nothing about the material. Change the duration of the test, or its range, such as \
     /slide/max_tilt_deg.",
);

/// A hopper whose regime has no reference.
pub(super) const NO_REGIME: WarningKind = kind(
    "no_regime",
    "The capacity of the belt is unknown, or the belt stands still. The response `regime` is then null.",
    "If /equipment/parametric is false, set /equipment/opening_width_m and /equipment/opening_height_m. Also add a surface with \
     the motion \"belt\" that passes the gate plane x = 0. All belts that pass this plane must have the same speed.",
);

/// A feed that did not bring its mass.
pub(super) const FEED_SHORT: WarningKind = kind(
    "feed_short",
    "The feed brought less mass (`fed_kg`) than `feed_kg_s` demands, because fillets found no free place over the hopper. The missing \
     mass is more than 1 % of the demanded mass, and more than the mass of one fillet.",
    "Reduce /equipment/feed_kg_s or /numerics/output_interval_s, or make the belt carry more mass per second.",
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
pub(super) const WARNING_COUNT: Response = number(
    "warning_count",
    "",
    "Number of warnings. The field `warnings` of the result document lists the warnings.",
);

/// The codes of the warnings, as a response of every experiment: tables of many jobs count the words of a response.
pub(super) const WARNING_CODES: Response = word(
    "warning_codes",
    "Codes of the warnings, separated by commas. If there are no warnings, the response is `none`. The field `warnings` of the result \
     document has the messages of the warnings.",
);

/// Both responses, by name.
pub fn warning_responses(warnings: &[Warning]) -> [(String, Value); 2] {
    let codes: Vec<&str> = warnings.iter().map(|warning| warning.code.as_str()).collect();
    let codes = if codes.is_empty() { "none".to_owned() } else { codes.join(", ") };
    [(WARNING_COUNT.name.to_owned(), warnings.len().into()), (WARNING_CODES.name.to_owned(), codes.into())]
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
