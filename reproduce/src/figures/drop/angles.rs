//! Fig. 10: intact bonds over the angle of impact.

use roost_stats::welch;
use roost_terminal::format::significant;
use roost_terminal::plot::{Curve, Markers, Scale, Style};
use serde_json::json;

use super::super::{TABLE_2, mean_curve, plot_svg, rounded, stiffness};
use super::{
    FAST_M_S, FLAT, MULTIPLES, ON_END, ORIENTATIONS, base, fillets_note, impact, intact, pictured, replicates,
};
use crate::picture::{Moment, Shot, View};
use crate::plan::{Evaluation, Figure, Illustration, Part, Results, Run, with};
use crate::profile::Profile;
use crate::row::{Demand, Row};

const ENHANCED: &str = "finite extension";
/// Times of the pictures of an impact on end, in seconds after the impact.
const FALLING_S: [f64; 3] = [0.02, 0.1, 0.3];

/// The figure.
pub(super) fn figure(profile: &Profile) -> Figure {
    Figure {
        name: "Fig. 10",
        title: "Fig. 10: bonds intact over the angle of impact",
        part: Part::Drop,
        paper: "Horizontal impacts distribute the load over many bonds; vertical ones break more of them. The colours of the plot \
                show only shares above 95 %.",
        runs: runs(profile),
        evaluate,
    }
}

fn angle_name(multiple: &str, orientation: (&str, f64, f64)) -> String {
    format!("{multiple}, {}", orientation.0)
}

fn runs(profile: &Profile) -> Vec<Run> {
    let base = base(profile);
    let mut runs = Vec::new();
    for (multiple, factor) in [MULTIPLES[1], MULTIPLES[2]] {
        let scaled = with(&base, stiffness(factor * TABLE_2.0, factor * TABLE_2.1));
        runs.extend(ORIENTATIONS.into_iter().flat_map(|orientation| {
            let at = with(&scaled, impact(orientation, FAST_M_S));
            replicates(profile, &angle_name(multiple, orientation), &at)
        }));
    }
    let enhanced = with(&base, json!({"bonds": {"formulation": "finite_extension"}}));
    runs.extend([FLAT, ON_END].into_iter().flat_map(|orientation| {
        let at = with(&enhanced, impact(orientation, FAST_M_S));
        replicates(profile, &angle_name(ENHANCED, orientation), &at)
    }));
    let falling = with(&pictured(&base), impact(ON_END, FAST_M_S));
    let pictured =
        Run::new("pictured", falling).shot(Shot::side(Moment::First)).shot(Shot::side(Moment::Last));
    runs.push(FALLING_S.into_iter().fold(pictured, |run, t| run.shot(Shot::side(Moment::At(t)))));
    runs
}

fn evaluate(profile: &Profile, results: &Results<'_>) -> Evaluation {
    const NAME: &str = "Fig. 10";
    let table_2 = |orientation| intact(results, &angle_name(MULTIPLES[1].0, orientation));
    let (mut rows, mut findings) = (Vec::new(), Vec::new());
    for orientation in ORIENTATIONS {
        let name = angle_name(MULTIPLES[1].0, orientation);
        let row = Row::new(NAME, format!("share of bonds intact at 4 m/s, {}, Table 2", orientation.0), "");
        let row = row.replicates(&intact(results, &name)).note(fillets_note(profile, results, &name));
        rows.push(match orientation {
            FLAT => row.demand(Demand::AtLeast(0.99)),
            ON_END => row.demand(Demand::AtLeast(0.85)),
            _ => row,
        });
    }
    for other in [ON_END, ORIENTATIONS[1], ORIENTATIONS[4]] {
        let (flat, slanted) = (table_2(FLAT), table_2(other));
        let difference = flat.sample().zip(slanted.sample()).and_then(|(flat, other)| welch(&flat, &other));
        let quantity = format!("share of bonds intact at 4 m/s, flat minus {}, Table 2", other.0);
        let n = flat.values.len() + slanted.values.len();
        rows.push(
            Row::new(NAME, quantity, "")
                .paper("> 0: a flat impact spreads the load over many bonds")
                .difference_of(difference, n),
        );
        findings.extend(flat.mean().zip(slanted.mean()).filter(|_| difference.is_some_and(|d| d.is_fall())).map(
            |(flat, slanted)| {
                format!(
                    "At 4 m/s with the parameters of Table 2, {} % of the bonds stay intact after a flat impact, and {} % after an impact \
                     of fillets {}. In Roost, the flat impact therefore does not spread the load better.",
                    rounded(100.0 * flat, 1),
                    rounded(100.0 * slanted, 1),
                    other.0
                )
            },
        ));
    }
    let enhanced = |orientation| intact(results, &angle_name(ENHANCED, orientation));
    rows.push(
        Row::new(NAME, "share of bonds intact at 4 m/s, on end, tail first, with finite extension", "")
            .paper("suggested for future work")
            .replicates(&enhanced(ON_END))
            .demand(Demand::AtLeast(0.99))
            .note("such bonds become stiffer before they break"),
    );
    let curve_of = |label: &str, multiple: &str, style, is_pitch: bool| {
        let shown = ORIENTATIONS.into_iter().filter(move |(_, pitch, roll)| {
            if is_pitch { *roll == 0.0 && *pitch >= 0.0 } else { *pitch == 0.0 }
        });
        let points = shown.map(|orientation| {
            (orientation.1 + orientation.2, intact(results, &angle_name(multiple, orientation)).sample())
        });
        mean_curve(label, style, points)
    };
    let [_, (table_2, _), (stiff, _)] = MULTIPLES;
    let style = |colour, dash| Style { colour, dash };
    let finite =
        [FLAT, ON_END].into_iter().map(|orientation| (orientation.1, enhanced(orientation).sample()));
    let curves = vec![
        curve_of("Table 2, pitch", table_2, style(0, 0), true),
        curve_of("Table 2, roll", table_2, style(0, 1), false),
        curve_of("ten times, pitch", stiff, style(1, 0), true),
        curve_of("ten times, roll", stiff, style(1, 1), false),
        Curve { markers: Markers::Only, ..mean_curve("finite extension", style(2, 0), finite) },
    ];
    let svg =
        plot_svg("angle of impact (°)", "share of bonds intact at 4 m/s", Scale::Linear, Some(0.8), curves);
    let mut illustrations: Vec<Illustration> = svg
        .map(|svg| {
            Illustration::new(
                svg,
                "Share of bonds intact over the angle; 0° is flat, a pitch of 90° is on the tail.",
            )
        })
        .into_iter()
        .collect();
    let whens = [Moment::First].into_iter().chain(FALLING_S.map(Moment::At)).chain([Moment::Last]);
    for when in whens {
        let Some(picture) =
            results.first_record("pictured").and_then(|record| record.picture(View::Side, when))
        else {
            continue;
        };
        let caption = format!("{} s", significant((picture.simulated_s * 100.0).round() / 100.0));
        illustrations
            .push(Illustration::new(picture.svg("a fillet that hits the plate on end", 170.0), caption));
    }
    Evaluation { rows, illustrations, findings }
}

#[cfg(test)]
mod tests {
    use super::super::super::fixtures;
    use super::*;
    use crate::profile::PROFILES;

    /// The evaluation of runs with these shares of intact bonds, which vary by a thousandth with the seed.
    fn evaluate_with(share: impl Fn(&str) -> f64) -> Evaluation {
        fixtures::evaluate(PROFILES[0], figure(PROFILES[0]), |run| {
            let seed = run.scenario["seed"].as_f64().unwrap_or(1.0);
            let share = share(&run.name) + 1e-3 * (seed - 2.0);
            Some(fixtures::record(
                &run.scenario,
                json!({"bonds_intact_fraction": share, "escaped_kg": 0.004}),
            ))
        })
    }

    #[test]
    fn finding_reports_flat_impacts_that_break_more_bonds() {
        let as_in_the_paper = evaluate_with(|name| if name.ends_with("flat") { 0.995 } else { 0.9 });
        assert!(as_in_the_paper.findings.is_empty(), "{:?}", as_in_the_paper.findings);
        let differences = |evaluation: &Evaluation| {
            let rows = evaluation.rows.iter().filter(|row| row.quantity.contains("flat minus"));
            rows.map(|row| rounded(row.measured.as_f64().unwrap(), 3)).collect::<Vec<_>>()
        };
        assert_eq!(differences(&as_in_the_paper), ["0.095", "0.095", "0.095"]);
        let reversed = evaluate_with(|name| if name.contains("45") { 0.999 } else { 0.991 });
        assert_eq!(differences(&reversed), ["0.000", "−0.008", "−0.008"]);
        assert_eq!(reversed.findings.len(), 2, "{:?}", reversed.findings);
        assert!(reversed.findings[0].contains("pitched by 45°") && reversed.findings[0].contains("99.1 %"));
        assert!(
            reversed.rows[0].note.contains("6 fillets per simulation; on average, 4 g of fragments"),
            "{}",
            reversed.rows[0].note
        );
    }
}
