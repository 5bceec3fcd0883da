//! Fig. 10: bonds intact over the angle of impact.

use serde_json::json;

use super::super::{TABLE_2, curve, plotted, stiffness};
use super::{FAST_M_S, FLAT, MULTIPLES, ON_END, ORIENTATIONS, alone, base, impact, intact};
use crate::reproduce::picture::{Shot, View, When};
use crate::reproduce::plan::{Figure, Illustration, Part, Results, Run, Told, with};
use crate::reproduce::profile::Profile;
use crate::reproduce::row::{Demand, Row};
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
        paper: "Horizontal impacts distribute the load over many bonds; vertical ones break more of them.",
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
        runs.extend(ORIENTATIONS.into_iter().map(|orientation| {
            Run::new(angle_name(multiple, orientation), with(&scaled, impact(orientation, FAST_M_S)))
        }));
    }
    let enhanced = with(&base, json!({"bonds": {"formulation": "finite_extension"}}));
    runs.extend([FLAT, ON_END].into_iter().map(|orientation| {
        Run::new(angle_name(ENHANCED, orientation), with(&enhanced, impact(orientation, FAST_M_S)))
    }));
    let pictured = with(&alone(&base), impact(ON_END, FAST_M_S));
    let pictured = Run::new("pictured", pictured).shot(Shot::side(When::First)).shot(Shot::side(When::Last));
    runs.push(FALLING_S.into_iter().fold(pictured, |run, t| run.shot(Shot::side(When::At(t)))));
    runs
}

fn told_angles(profile: &Profile, results: &Results<'_>) -> Told {
    const NAME: &str = "Fig. 10";
    let count = 6 * profile.of_each_shape;
    let mut rows = Vec::new();
    for orientation in ORIENTATIONS {
        let name = angle_name(MULTIPLES[1].0, orientation);
        let row = Row::new(NAME, format!("share of bonds intact at 4 m/s, {}, Table 2", orientation.0), "");
        let row = row.one(intact(results, &name)).note(format!("{count} fillets"));
        rows.push(match orientation {
            FLAT => row.demand(Demand::AtLeast(0.99)),
            ON_END => row.demand(Demand::AtLeast(0.85)),
            _ => row,
        });
    }
    let enhanced = |orientation| intact(results, &angle_name(ENHANCED, orientation));
    rows.push(
        Row::new(NAME, "the same on end, tail first, with finite extension", "")
            .paper("its outlook")
            .one(enhanced(ON_END))
            .demand(Demand::AtLeast(0.99))
            .note("a bond that stiffens towards the length at which it breaks, as the paper's outlook wishes for"),
    );
    let curve_of = |label: &str, multiple: &str, look, is_pitch: bool| {
        let shown = ORIENTATIONS.into_iter().filter(move |(_, pitch, roll)| {
            if is_pitch { *roll == 0.0 && *pitch >= 0.0 } else { *pitch == 0.0 }
        });
        let points = shown.map(|orientation| {
            (orientation.1 + orientation.2, intact(results, &angle_name(multiple, orientation)))
        });
        curve(label, look, points)
    };
    let [_, (table_2, _), (stiff, _)] = MULTIPLES;
    let look = |colour, dash| Look { colour, dash };
    let finite = [FLAT, ON_END].into_iter().map(|orientation| (orientation.1, enhanced(orientation)));
    let curves = vec![
        curve_of("Table 2, pitch", table_2, look(0, 0), true),
        curve_of("Table 2, roll", table_2, look(0, 1), false),
        curve_of("ten times, pitch", stiff, look(1, 0), true),
        curve_of("ten times, roll", stiff, look(1, 1), false),
        Curve { mark: Mark::Alone, ..curve("finite extension", look(2, 0), finite) },
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
    Told { rows, illustrations, findings: Vec::new() }
}
