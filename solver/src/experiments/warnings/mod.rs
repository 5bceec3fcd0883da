//! Warnings: conditions under which a result may mislead, each with a stable code.
//!
//! [`ALL_WARNINGS`] is the table of codes. [`scenario`] finds what is known before a run, [`responses`] what responses reveal;
//! [`ExperimentMonitor::warnings`](crate::engine::run::ExperimentMonitor::warnings) adds what only the monitor knows.

mod responses;
mod scenario;
#[cfg(test)]
mod tests;

use serde_json::Value;

use super::outputs::{ResponseDefinition, line, number, word};
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
    /// The advised action, in one or more sentences. The message ends with it.
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
    "The time step `/numerics/timestep_s` is above the stability limit. Above this limit, numerical errors can grow without limit, and the \
     simulation can become unstable. The damping (loss of energy) in contacts makes the limit lower than without damping. Roost takes this \
     effect into account.",
    "Set /numerics/timestep_s to \"auto\", or to a time step below the stability limit.",
);
const WHOLE_SPHERES: WarningKind = kind(
    "whole_spheres",
    "The field `/product/fill` is \"whole_spheres\": each sub-particle lies completely inside the shape of the body. A gap then remains \
     between the sub-particles and the surface of the shape. Therefore the simulated body is up to 2R thinner than the shape in the \
     scenario.",
    "Leave /product/fill out, or choose a smaller /product/subparticle_radius_m.",
);
const THIN_FILLET: WarningKind = kind(
    "thin_fillet",
    "A fillet is fewer than four layers of sub-particles thick. The bending of the fillet and the flow then depend on R.",
    "Choose a smaller /product/subparticle_radius_m, or simulate with two radii and compare the results.",
);
const SOFT_TISSUE: WarningKind = kind(
    "soft_tissue",
    "The tissue is too soft for its own weight. Roost estimates how deep the weight of the bodies presses a sub-particle into the floor. \
     The estimate uses Hertz's formula for an elastic sphere on a rigid plane. If this depth is more than half of R, bodies may sink \
     through the floor.",
    "Check that the value of /material/youngs_modulus_pa is in pascals (Pa). If the value is correct, bodies may sink through the floor: \
     simulate with a higher modulus.",
);
const OPEN_FILLING_REGION: WarningKind = kind(
    "open_filling_region",
    "The field `/equipment/parametric` is false, and the walls do not enclose the region into which the fillets drop. The region lies behind \
     the gate plane x = 0. Its length is `/equipment/hopper_length_m`, and its width is `/equipment/hopper_width_m`. Roost draws horizontal \
     lines from the middle of the region towards −x, −y and +y, in the lower half of the hopper. Some lines meet no wall nearby, or meet a wall \
     that is more than R inside the region at two of three heights. The usual reason is a part in a wrong position.",
    "With the command `roost validate`, compare the position of each part with the region. Then correct position_m or orientation_deg of \
     the part in /equipment/surfaces. If the part is in the right position, correct /equipment/hopper_length_m, /equipment/hopper_width_m \
     or /equipment/hopper_height_m. If your hopper has no wall there, or has a part inside, you can ignore the warning.",
);
const SLOW_BELT: WarningKind = kind(
    "slow_belt",
    "The jam time is the shorter one of the times `/numerics/jam_after_s` and `/numerics/stop/when_jammed_s`. If \
     `/numerics/stop/when_jammed_s` is null, the jam time is `/numerics/jam_after_s`. During the jam time, the belt moves by less than \
     three diameters of a sub-particle. Steady flow may then count as a jam.",
    "Raise /numerics/jam_after_s. If /numerics/stop/when_jammed_s is shorter than /numerics/jam_after_s, also raise \
     /numerics/stop/when_jammed_s.",
);
const ESCAPED_MASS: WarningKind = kind(
    "escaped_mass",
    "The response `escaped_kg` is above 0: mass left the simulated space (a box around all bodies and surfaces). In a hopper, mass that \
     passed the gate does not count.",
    "In the frames (the stored positions of the sub-particles), look for gaps between surfaces, for tissue that sinks through surfaces, \
     and for fragments (broken parts of fillets). In a scene, you may want bodies to leave the simulated space. You can then ignore the \
     warning.",
);
const PASSED_THROUGH: WarningKind = kind(
    "passed_through",
    "The response `passed_through` is above 0: sub-particles went through a surface.",
    "Reduce the speed of the impact, raise /material/youngs_modulus_pa, or make the surface larger than the bodies that hit the surface.",
);
const BROKEN_BONDS: WarningKind = kind(
    "broken_bonds",
    "The response `bonds_intact_fraction` is below 0.95: more than 5 % of the bonds broke.",
    "Reduce /numerics/timestep_s or the speed of impacts. You can also set /bonds/formulation to \"finite_extension\". Fillets then tear \
     less easily than with the default value.",
);
const DEEP_OVERLAP: WarningKind = kind(
    "deep_overlap",
    "The response `max_overlap_ratio` is above 1: the distance between the centres of two sub-particles was less than R, although no bond \
     joins these two sub-particles.",
    "If this overlap occurs only while a hopper fills, you can ignore the warning. In all other cases, raise /material/youngs_modulus_pa, \
     or reduce /numerics/timestep_s or the speed of impacts.",
);
const DENSE_BED: WarningKind = kind(
    "dense_bed",
    "The response `bulk_density_kg_m3` is above the density of a fillet: the fillets overlap (they share the same space).",
    "Expect that the masses and rates of this result are too high. The estimated factor of this error is the bulk density divided by the \
     density of a fillet. To reduce the overlap, raise /material/youngs_modulus_pa, and simulate again.",
);
const INTERPENETRATION: WarningKind = kind(
    "interpenetration",
    "The response `interpenetrated_fraction` is above 0.02: more than 2 % of the sub-particles lie inside other fillets.",
    "Set /contact/fillet_fillet_radius_ratio to 1.225, and simulate again. With this value, the sub-particles of a fillet are too large to \
     enter the gaps between the sub-particles of another fillet. Compare the new result with the result that has this warning.",
);
/// A test whose measured event never happened.
pub(super) const TEST_NEVER_BEGAN: WarningKind = kind(
    "test_never_began",
    "The event that the test measures did not happen. For example, the body did not come to rest before t = 0, did not touch a surface, \
     did not slide, or did not hang on its support.",
    "The responses are null, or they give no information about the material. Change the duration or the range of the test (for example, \
     /slide/max_tilt_deg), and simulate again.",
);

/// A hopper whose regime has no reference.
pub(super) const NO_REGIME: WarningKind = kind(
    "no_regime",
    "The response `regime` is null, because Roost cannot compute the belt capacity, or because the belt does not carry fillets out of the \
     hopper. The belt capacity is the mass per second that the belt carries out when fillets fill the whole opening under the gate.",
    "If /equipment/parametric is true, set /equipment/belt_speed_m_s to a value above 0. If /equipment/parametric is false, set \
     /equipment/opening_width_m and /equipment/opening_height_m. The list /equipment/surfaces must then also have a belt (a surface with \
     the motion \"belt\" and the presence \"always\") that extends through the gate plane x = 0. All belts through this plane must have \
     the same speed, and this speed along x must be above 0.",
);

/// A feed that did not bring its mass.
pub(super) const FEED_SHORT: WarningKind = kind(
    "feed_short",
    "The feed brought in less mass (`fed_kg`) than the planned mass, because some fillets found no free place above the hopper. The \
     planned mass is `/equipment/feed_kg_s` times the time since t = 0. The difference between the two masses is more than 1 % of the \
     planned mass, and more than the mass of one fillet.",
    "Reduce /equipment/feed_kg_s, or make the belt carry out more mass per second, for example with a higher belt speed. You can also \
     reduce /numerics/output_interval_s: Roost then tries more often to find a free place for the next fillet.",
);

/// All kinds, in the order of the table.
pub const ALL_WARNINGS: &[&WarningKind] = &[
    &UNSTABLE_TIMESTEP,
    &WHOLE_SPHERES,
    &THIN_FILLET,
    &SOFT_TISSUE,
    &OPEN_FILLING_REGION,
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
pub(super) const WARNING_COUNT: ResponseDefinition = number(
    "warning_count",
    "",
    "Number of warnings. The field `warnings` of the result document lists the warnings.",
);

/// The codes of the warnings, as a response of every experiment: tables of many jobs count the words of a response.
pub(super) const WARNING_CODES: ResponseDefinition = word(
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
