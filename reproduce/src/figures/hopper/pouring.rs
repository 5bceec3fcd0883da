//! Fig. 13: fillets that pour under the gate.

use roost_terminal::format::significant;

use super::{NARROW, WIDE, bed_text, cells};
use crate::picture::{Moment, Shot, View};
use crate::plan::{Evaluation, Figure, Illustration, Part, Results};
use crate::profile::Profile;
use crate::row::Row;

const NAME: &str = "Fig. 13";
/// Belt times of the pictures, in seconds.
const PICTURED_S: [f64; 2] = [0.5, 2.0];
/// A stoppage of this duration counts as a temporary jam, in seconds.
const STANDSTILL_S: f64 = 1.0;

/// The figure.
pub(super) fn figure(profile: &Profile) -> Figure {
    let pictured = cells(profile)
        .filter(|run| run.name.ends_with("dry") && run.scenario["seed"] == 1)
        .map(|run| PICTURED_S.into_iter().fold(run, |run, t| run.shot(Shot::side(Moment::At(t)))));
    Figure {
        name: NAME,
        title: "Fig. 13: fillets pouring under the gate",
        part: Part::Hopper,
        paper: "Continuous discharge at 6 cm and a jammed state at 4.5 cm, in experiment and simulation. Leaving fillets curl and \
                drape. The openings are those of its results; its section on the experiment says 4 and 6.5 cm.",
        runs: pictured.collect(),
        evaluate,
    }
}

fn evaluate(profile: &Profile, results: &Results<'_>) -> Evaluation {
    let mut illustrations = Vec::new();
    for name in [WIDE, NARROW] {
        for t in PICTURED_S {
            let picture =
                results.first_record(name).and_then(|record| record.picture(View::Side, Moment::At(t)));
            let svg = picture.map(|picture| picture.svg(&format!("fillets pouring, {name}"), 620.0));
            let caption = format!(
                "{name}, {} s after the belt started, from the side: {}.",
                significant(t),
                bed_text(&profile.bed)
            );
            illustrations.extend(svg.map(|svg| Illustration::new(svg, caption)));
        }
    }
    let mut rows = Vec::new();
    for name in [WIDE, NARROW] {
        for (quantity, response, of) in [
            ("curl of fillets behind the gate", "curl_angle_deg", "mean over the fillets and over time"),
            ("maximum curl of a fillet", "largest_curl_angle_deg", "maximum over the fillets and over time"),
        ] {
            let row = Row::new(NAME, format!("{quantity}, {name}"), "°").paper("curling and draping");
            rows.push(
                row.replicates(&results.response(name, response)).note(format!(
                    "{of}; 0° is flat, 180° is folded; the paper gives no angle: it says that the fillets curl (bend) and drape (hang \
                     down like cloth)"
                )),
            );
        }
        let row = Row::new(NAME, format!("longest stoppage, {name}"), "s");
        let row = row.replicates(&results.response(name, "longest_stoppage_s"));
        rows.push(row.paper(if name == WIDE { "continuous" } else { "jammed" }));
    }
    Evaluation { rows, illustrations, findings: no_jam(results).into_iter().collect() }
}

/// A finding if no run jams at 4.5 cm.
fn no_jam(results: &Results<'_>) -> Option<String> {
    let stops = results.response(NARROW, "longest_stoppage_s");
    let (_, longest) = stops.range().filter(|(_, longest)| *longest < STANDSTILL_S)?;
    Some(format!(
        "Roost does not reproduce the jam at 4.5 cm. With the parameters of Table 2, the longest stoppage is {} s. The \
         list below Table 3 states how the belt friction and the surface energy change the mean rate.",
        significant((longest * 100.0).round() / 100.0)
    ))
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;
    use crate::figures::fixtures;
    use crate::profile::Name;

    #[test]
    fn finding_on_a_missing_jam_needs_measured_stoppages() {
        let with = |stoppage_s: Option<f64>| {
            let profile = Name::Tiny.profile();
            fixtures::evaluate(profile, figure(profile), |run| {
                Some(fixtures::record(&run.scenario, json!({"longest_stoppage_s": stoppage_s})))
            })
        };
        assert!(with(None).findings.is_empty() && with(Some(2.0)).findings.is_empty());
        assert!(with(Some(0.3)).findings[0].contains("0.3 s"));
    }
}
