//! Fig. 10: bonds intact over the angle of impact.

use serde_json::json;

use super::super::{TABLE_2, plotted, rounded, sampled, stiffness};
use super::{
    FAST_M_S, FLAT, MULTIPLES, ON_END, ORIENTATIONS, base, impact, intact, of_fillets, pictured, seeds,
};
use crate::reproduce::picture::{Shot, View, When};
use crate::reproduce::plan::{Figure, Illustration, Part, Results, Run, Told, with};
use crate::reproduce::profile::Profile;
use crate::reproduce::row::{Demand, Row};
use crate::reproduce::stats::welch;
use crate::ui::format::significant;
use crate::ui::plot::{Curve, Look, Mark, Scale};

const ENHANCED: &str = "finite extension";
/// Moments of the pictures of a fall on end, in seconds after the impact.
const FALLING_S: [f64; 3] = [0.02, 0.1, 0.3];

/// The figure.
pub(super) fn figure(profile: &Profile) -> Figure {
    Figure {
        name: "Fig. 10",
        title: "Fig. 10: bonds intact over the angle of impact",
        part: Part::Drop,
        paper: "Horizontal impacts distribute the load over many bonds; vertical ones break more of them. The plot's colours \
                show shares intact above 95 % only.",
        runs: runs_of_angles(profile),
        tell: told_angles,
    }
}

fn angle_name(multiple: &str, orientation: (&str, f64, f64)) -> String {
    format!("{multiple}, {}", orientation.0)
}

fn runs_of_angles(profile: &Profile) -> Vec<Run> {
    let base = base(profile);
    let mut runs = Vec::new();
    for (multiple, factor) in [MULTIPLES[1], MULTIPLES[2]] {
        let scaled = with(&base, stiffness(factor * TABLE_2.0, factor * TABLE_2.1));
        runs.extend(ORIENTATIONS.into_iter().flat_map(|orientation| {
            let at = with(&scaled, impact(orientation, FAST_M_S));
            seeds(profile, &angle_name(multiple, orientation), &at)
        }));
    }
    let enhanced = with(&base, json!({"bonds": {"formulation": "finite_extension"}}));
    runs.extend([FLAT, ON_END].into_iter().flat_map(|orientation| {
        let at = with(&enhanced, impact(orientation, FAST_M_S));
        seeds(profile, &angle_name(ENHANCED, orientation), &at)
    }));
    let falling = with(&pictured(&base), impact(ON_END, FAST_M_S));
    let pictured = Run::new("pictured", falling).shot(Shot::side(When::First)).shot(Shot::side(When::Last));
    runs.push(FALLING_S.into_iter().fold(pictured, |run, t| run.shot(Shot::side(When::At(t)))));
    runs
}

fn told_angles(profile: &Profile, results: &Results<'_>) -> Told {
    const NAME: &str = "Fig. 10";
    let table_2 = |orientation| intact(results, &angle_name(MULTIPLES[1].0, orientation));
    let (mut rows, mut findings) = (Vec::new(), Vec::new());
    for orientation in ORIENTATIONS {
        let name = angle_name(MULTIPLES[1].0, orientation);
        let row = Row::new(NAME, format!("share of bonds intact at 4 m/s, {}, Table 2", orientation.0), "");
        let row = row.seeds(&intact(results, &name)).note(of_fillets(profile, results, &name));
        rows.push(match orientation {
            FLAT => row.demand(Demand::AtLeast(0.99)),
            ON_END => row.demand(Demand::AtLeast(0.85)),
            _ => row,
        });
    }
    for other in [ON_END, ORIENTATIONS[1], ORIENTATIONS[4]] {
        let (flat, slanted) = (table_2(FLAT), table_2(other));
        let difference = flat.sample().zip(slanted.sample()).and_then(|(flat, other)| welch(&flat, &other));
        let quantity = format!("share of bonds intact at 4 m/s, flat less {}, Table 2", other.0);
        let n = flat.values.len() + slanted.values.len();
        rows.push(
            Row::new(NAME, quantity, "").paper("> 0: flat spreads the load").difference_of(difference, n),
        );
        findings.extend(flat.mean().zip(slanted.mean()).filter(|_| difference.is_some_and(|d| d.is_fall())).map(
            |(flat, slanted)| {
                format!(
                    "Flat does not spread the load better than {}: at 4 m/s and Table 2 {} % of the bonds hold, and {} %.",
                    other.0,
                    rounded(100.0 * flat, 1),
                    rounded(100.0 * slanted, 1)
                )
            },
        ));
    }
    let enhanced = |orientation| intact(results, &angle_name(ENHANCED, orientation));
    rows.push(
        Row::new(NAME, "the same on end, tail first, with finite extension", "")
            .paper("its outlook")
            .seeds(&enhanced(ON_END))
            .demand(Demand::AtLeast(0.99))
            .note("a bond that stiffens towards the length at which it breaks, as the paper's outlook wishes for"),
    );
    let curve_of = |label: &str, multiple: &str, look, is_pitch: bool| {
        let shown = ORIENTATIONS.into_iter().filter(move |(_, pitch, roll)| {
            if is_pitch { *roll == 0.0 && *pitch >= 0.0 } else { *pitch == 0.0 }
        });
        let points = shown.map(|orientation| {
            (orientation.1 + orientation.2, intact(results, &angle_name(multiple, orientation)).sample())
        });
        sampled(label, look, points)
    };
    let [_, (table_2, _), (stiff, _)] = MULTIPLES;
    let look = |colour, dash| Look { colour, dash };
    let finite =
        [FLAT, ON_END].into_iter().map(|orientation| (orientation.1, enhanced(orientation).sample()));
    let curves = vec![
        curve_of("Table 2, pitch", table_2, look(0, 0), true),
        curve_of("Table 2, roll", table_2, look(0, 1), false),
        curve_of("ten times, pitch", stiff, look(1, 0), true),
        curve_of("ten times, roll", stiff, look(1, 1), false),
        Curve { mark: Mark::Alone, ..sampled("finite extension", look(2, 0), finite) },
    ];
    let svg =
        plotted("angle of impact (°)", "share of bonds intact at 4 m/s", Scale::Linear, Some(0.8), curves);
    let mut illustrations: Vec<Illustration> = svg
        .map(|svg| {
            Illustration::new(
                svg,
                "Share of bonds intact over the angle; 0° falls flat, a pitch of 90° on its tail.",
            )
        })
        .into_iter()
        .collect();
    let whens = [When::First].into_iter().chain(FALLING_S.map(When::At)).chain([When::Last]);
    for when in whens {
        let Some(picture) = results.first("pictured").and_then(|record| record.picture(View::Side, when))
        else {
            continue;
        };
        let caption = format!("{} s", significant((picture.simulated_s * 100.0).round() / 100.0));
        illustrations.push(Illustration::new(picture.svg("a fillet that falls on end", 170.0), caption));
    }
    Told { rows, illustrations, findings }
}

#[cfg(test)]
mod tests {
    use super::super::super::made_up;
    use super::*;
    use crate::reproduce::profile::PROFILES;

    /// What is told when so much holds, give or take a thousandth with the seed.
    fn told_of(share: impl Fn(&str) -> f64) -> Told {
        made_up::told(PROFILES[0], figure(PROFILES[0]), |run| {
            let seed = run.scenario["seed"].as_f64().unwrap_or(1.0);
            let share = share(&run.name) + 1e-3 * (seed - 2.0);
            Some(made_up::responses(
                &run.scenario,
                json!({"bonds_intact_fraction": share, "escaped_kg": 0.004}),
            ))
        })
    }

    #[test]
    fn flat_that_breaks_more_is_told() {
        let papers = told_of(|name| if name.ends_with("flat") { 0.995 } else { 0.9 });
        assert!(papers.findings.is_empty(), "{:?}", papers.findings);
        let differences = |told: &Told| {
            let rows = told.rows.iter().filter(|row| row.quantity.contains("flat less"));
            rows.map(|row| rounded(row.measured.as_f64().unwrap(), 3)).collect::<Vec<_>>()
        };
        assert_eq!(differences(&papers), ["0.095", "0.095", "0.095"]);
        let ours = told_of(|name| if name.contains("45") { 0.999 } else { 0.991 });
        assert_eq!(differences(&ours), ["0.000", "−0.008", "−0.008"]);
        assert_eq!(ours.findings.len(), 2, "{:?}", ours.findings);
        assert!(ours.findings[0].contains("pitched by 45°") && ours.findings[0].contains("99.1 %"));
        assert!(ours.rows[0].note.contains("6 fillets a run, 4 g of fragments"), "{}", ours.rows[0].note);
    }
}
