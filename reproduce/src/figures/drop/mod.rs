//! Fig. 9 to 12: impact of fillets on a plate. Share of intact bonds, and time until the kinetic energy is lost.

mod angles;
mod scales;
mod speeds;
mod stiffness;

use roost_stats::ReplicateValues;
use roost_terminal::format::significant;
use serde_json::{Value, json};

use super::PAPER_FILL;
use crate::plan::{Figure, Results, Run, with};
use crate::profile::Profile;

/// Maximum deviation of the angles of each fillet, which the seed draws, in degrees.
const SCATTER_DEG: f64 = 5.0;
/// Maximum speed at which bonds must stay intact, in m/s.
const FAST_M_S: f64 = 4.0;
const USUAL_M_S: f64 = 2.0;

/// Orientations: name, pitch and roll in degrees.
const FLAT: (&str, f64, f64) = ("flat", 0.0, 0.0);
const ON_END: (&str, f64, f64) = ("on end, tail first", 90.0, 0.0);
const ORIENTATIONS: [(&str, f64, f64); 6] = [
    FLAT,
    ("pitched by 45°", 45.0, 0.0),
    ON_END,
    ("on end, blunt end first", -90.0, 0.0),
    ("rolled by 45°", 0.0, 45.0),
    ("on its side", 0.0, 90.0),
];

/// Multiples of Table 2's stiffnesses.
const MULTIPLES: [(&str, f64); 3] =
    [("a tenth of Table 2", 0.1), ("Table 2", 1.0), ("ten times Table 2", 10.0)];

/// All four figures.
pub(super) fn figures(profile: &Profile) -> Vec<Figure> {
    [stiffness::figure, angles::figure, speeds::figure, scales::figure].map(|figure| figure(profile)).into()
}

/// The scenario of a drop, flat at 2 m/s.
fn base(profile: &Profile) -> Value {
    json!({
        "experiment": "drop",
        "product": {
            "count": 6 * profile.of_each_shape, "subparticle_radius_m": profile.radius_m, "fill": PAPER_FILL,
        },
        "drop": {"speed_m_s": USUAL_M_S, "scatter_deg": SCATTER_DEG},
        "numerics": {"timestep_s": "auto"},
    })
}

/// One fillet of size 3.
fn alone(scenario: &Value) -> Value {
    with(scenario, json!({"product": {"count": 1, "shape": 4}}))
}

/// One fillet with exact angles, for pictures.
fn pictured(scenario: &Value) -> Value {
    with(&alone(scenario), json!({"drop": {"scatter_deg": 0.0}}))
}

/// Replicates of a drop.
fn replicates(profile: &Profile, name: &str, scenario: &Value) -> Vec<Run> {
    Run::replicates(name, scenario, profile.drop_seeds)
}

/// Scenario fields for an orientation and a speed.
fn impact((_, pitch, roll): (&str, f64, f64), speed_m_s: f64) -> Value {
    json!({"drop": {"pitch_deg": pitch, "roll_deg": roll, "speed_m_s": speed_m_s}})
}

/// Share of intact bonds of each replicate.
fn intact(results: &Results<'_>, name: &str) -> ReplicateValues {
    results.response(name, "bonds_intact_fraction")
}

/// Mean settle time of each replicate whose fillets have all settled, in seconds.
fn settle_s(results: &Results<'_>, name: &str) -> ReplicateValues {
    results.response(name, "settle_time_s")
}

/// A note on the number of fillets per simulation, and the mass of fragments that left the simulated space.
fn fillets_note(profile: &Profile, results: &Results<'_>, name: &str) -> String {
    let count = 6 * profile.of_each_shape;
    let escaped = results.response(name, "escaped_kg").mean().filter(|mass| *mass > 0.0);
    let escaped = escaped.map(|mass| {
        let grams = significant((mass * 1e5).round() / 100.0);
        format!("; on average, {grams} g of fragments per simulation left the simulated space")
    });
    format!("{count} fillets per simulation{}", escaped.unwrap_or_default())
}
