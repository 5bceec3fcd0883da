//! Warnings from the responses of a run. A rule holds for every experiment that has the response.

use serde_json::{Map, Value};

use super::{BROKEN_BONDS, DEEP_OVERLAP, DENSE_BED, ESCAPED_MASS, INTERPENETRATION, PASSED_THROUGH};
use crate::engine::scene::BodyKind;
use crate::experiments::Setup;
use crate::result::Warning;

/// Share of bonds below which a product counts as torn.
const LOW_INTACT_FRACTION: f64 = 0.95;

/// Share of the sub-particles inside another body from which fillets count as merged.
const MAX_INTERPENETRATED: f64 = 0.02;

/// The warnings that these responses give.
pub fn of_responses(setup: &Setup, responses: &Map<String, Value>) -> Vec<Warning> {
    let number = |name: &str| responses.get(name).and_then(Value::as_f64);
    let present = setup.scene().present();
    let sum =
        |of: &dyn Fn(&BodyKind) -> f64| present.iter().map(|body| of(&setup.kinds[body.kind])).sum::<f64>();
    let present_kg = sum(&BodyKind::mass_kg);
    let density_kg_m3 = present_kg / sum(&|kind| kind.meta.volume_m3);
    let mut warnings = Vec::new();
    if let Some(escaped_kg) = number("escaped_kg").filter(|kg| *kg > 0.0) {
        let entered_kg = present_kg + number("fed_kg").unwrap_or(0.0);
        let share = 100.0 * escaped_kg / entered_kg;
        warnings.push(ESCAPED_MASS.with(&format!(
            "{escaped_kg:.3} kg of {entered_kg:.3} kg ({share:.2} %) left the domain by accident."
        )));
    }
    if let Some(passed) = number("passed_through").filter(|passed| *passed > 0.0) {
        warnings.push(PASSED_THROUGH.with(&format!("Sub-particles passed through surfaces {passed} times.")));
    }
    if let Some(intact) = number("bonds_intact_fraction").filter(|intact| *intact < LOW_INTACT_FRACTION) {
        let broken = 100.0 * (1.0 - intact);
        warnings.push(BROKEN_BONDS.with(&format!("{broken:.1} % of the bonds broke.")));
    }
    if let Some(ratio) = number("max_overlap_ratio").filter(|ratio| *ratio > 1.0) {
        warnings.push(
            DEEP_OVERLAP.with(&format!("Two sub-particles without a bond overlapped by {ratio:.2} R.")),
        );
    }
    if let Some(bulk) = number("bulk_density_kg_m3").filter(|bulk| *bulk > density_kg_m3) {
        let ratio = bulk / density_kg_m3;
        warnings.push(DENSE_BED.with(&format!(
            "The bed at rest has {bulk:.0} kg/m³, {ratio:.2} times the {density_kg_m3:.0} kg/m³ of a fillet: fillets overlap."
        )));
    }
    if let Some(inside) = number("interpenetrated_fraction").filter(|inside| *inside > MAX_INTERPENETRATED) {
        let percent = 100.0 * inside;
        warnings.push(
            INTERPENETRATION.with(&format!("{percent:.1} % of the sub-particles lie inside another body.")),
        );
    }
    warnings
}
