//! Fig. 13: fillets on their way under the gate.

use super::{NARROW, WIDE, cells, of_what};
use crate::reproduce::picture::{Shot, View, When};
use crate::reproduce::plan::{Figure, Illustration, Part, Results, Told};
use crate::reproduce::profile::Profile;
use crate::reproduce::row::Row;
use crate::ui::format::significant;

const NAME: &str = "Fig. 13";
/// Belt times of the pictures, in seconds.
const PICTURED_S: [f64; 2] = [0.5, 2.0];
/// What stands for so long, in seconds, has jammed for a while.
const STANDSTILL_S: f64 = 1.0;

/// The figure.
pub(super) fn figure(profile: &Profile) -> Figure {
    let pictured = cells(profile)
        .filter(|run| run.name.ends_with("dry") && run.scenario["seed"] == 1)
        .map(|run| PICTURED_S.into_iter().fold(run, |run, t| run.shot(Shot::side(When::At(t)))));
    Figure {
        name: NAME,
        title: "Fig. 13: fillets pouring under the gate",
        part: Part::Hopper,
        paper: "Continuous discharge at 6 cm, a jammed state at 4.5 cm, in experiment and simulation alike; leaving \
                fillets curl and drape. (Openings as in its results; its section on the experiment says 4 and 6.5 cm.)",
        runs: pictured.collect(),
        tell: told,
    }
}

fn told(profile: &Profile, results: &Results<'_>) -> Told {
    let mut illustrations = Vec::new();
    for name in [WIDE, NARROW] {
        for t in PICTURED_S {
            let picture = results.first(name).and_then(|record| record.picture(View::Side, When::At(t)));
            let svg = picture.map(|picture| picture.svg(&format!("fillets pouring, {name}"), 620.0));
            let caption = format!(
                "{name}, {} s after the belt started, from the side: {}.",
                significant(t),
                of_what(&profile.bed)
            );
            illustrations.extend(svg.map(|svg| Illustration::new(svg, caption)));
        }
    }
    let mut rows = Vec::new();
    for name in [WIDE, NARROW] {
        for (what, response) in [
            ("curl of fillets past the gate", "curl_angle_deg"),
            ("largest curl of a fillet", "largest_curl_angle_deg"),
        ] {
            let row = Row::new(NAME, format!("{what}, {name}"), "°").paper("curling and draping");
            rows.push(
                row.seeds(&results.seeds(name, response))
                    .note("turning of the centre line, 0 flat, 180 folded"),
            );
        }
        let row = Row::new(NAME, format!("longest stoppage, {name}"), "s");
        let row = row.seeds(&results.seeds(name, "longest_stoppage_s"));
        rows.push(row.paper(if name == WIDE { "continuous" } else { "jammed" }));
    }
    Told { rows, illustrations, findings: flows_on(results).into_iter().collect() }
}

/// What is to be said when nothing comes to a standstill at 4.5 cm.
fn flows_on(results: &Results<'_>) -> Option<String> {
    let stops = results.seeds(NARROW, "longest_stoppage_s");
    let (_, longest) = stops.range().filter(|(_, longest)| *longest < STANDSTILL_S)?;
    Some(format!(
        "The jam at 4.5 cm does not reproduce: the longest stoppage with Table 2 is {} s. See Table 3 for what would stop fillets.",
        significant((longest * 100.0).round() / 100.0)
    ))
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;
    use crate::reproduce::figures::made_up;
    use crate::reproduce::profile::Name;

    #[test]
    fn a_jam_that_was_not_looked_for_is_not_missed() {
        let with = |stoppage_s: Option<f64>| {
            let profile = Name::Tiny.profile();
            made_up::told(profile, figure(profile), |run| {
                Some(made_up::responses(&run.scenario, json!({"longest_stoppage_s": stoppage_s})))
            })
        };
        assert!(with(None).findings.is_empty() && with(Some(2.0)).findings.is_empty());
        assert!(with(Some(0.3)).findings[0].contains("0.3 s"));
    }
}
