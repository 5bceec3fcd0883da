//! Fig. 11: bonds intact over the speed of impact.

use super::super::{TABLE_2, curve, plotted, stiffness};
use super::{FAST_M_S, FLAT, MULTIPLES, ON_END, base, impact, intact};
use crate::reproduce::plan::{Figure, Illustration, Part, Results, Run, Told, with};
use crate::reproduce::profile::Profile;
use crate::reproduce::row::{Demand, Row};
use crate::ui::format::significant;
use crate::ui::plot::{Look, Scale};

/// The figure.
pub(super) fn figure(profile: &Profile) -> Figure {
    Figure {
        name: "Fig. 11",
        title: "Fig. 11: bonds intact over the speed of impact",
        part: Part::Drop,
        paper: "Slower impacts consistently leave more bonds intact; stiffer bonds break less, up to 100 % intact, but make \
                unrealistically rigid fillets.",
        runs: runs_of_speeds(profile),
        tell: told_speeds,
    }
}

fn speed_name(multiple: &str, orientation: (&str, f64, f64), speed_m_s: f64) -> String {
    format!("{multiple}, {}, {} m/s", orientation.0, significant(speed_m_s))
}

fn runs_of_speeds(profile: &Profile) -> Vec<Run> {
    let base = base(profile);
    let mut runs = Vec::new();
    for (multiple, factor) in MULTIPLES {
        let scaled = with(&base, stiffness(factor * TABLE_2.0, factor * TABLE_2.1));
        for orientation in [FLAT, ON_END] {
            runs.extend(profile.speeds_m_s.iter().map(|speed| {
                Run::new(
                    speed_name(multiple, orientation, *speed),
                    with(&scaled, impact(orientation, *speed)),
                )
            }));
        }
    }
    runs
}

fn told_speeds(profile: &Profile, results: &Results<'_>) -> Told {
    const NAME: &str = "Fig. 11";
    let shares = |multiple: &str, orientation| {
        let at = |speed: &f64| (*speed, intact(results, &speed_name(multiple, orientation, *speed)));
        profile.speeds_m_s.iter().map(at).collect::<Vec<_>>()
    };
    let table_2 = MULTIPLES[1].0;
    let slow = shares(table_2, FLAT).into_iter().filter(|(speed, _)| *speed <= FAST_M_S);
    let slow: Vec<Option<f64>> = slow.map(|(_, share)| share).collect();
    let lowest =
        slow.iter().copied().collect::<Option<Vec<_>>>().and_then(|all| all.into_iter().reduce(f64::min));
    let mut rows = vec![
        Row::new(NAME, "lowest share of bonds intact, flat, up to 4 m/s, Table 2", "")
            .from_all(lowest, slow.len())
            .demand(Demand::AtLeast(0.99)),
    ];
    for (speed, share) in shares(table_2, ON_END) {
        let quantity = format!("share of bonds intact on end at {} m/s, Table 2", significant(speed));
        rows.push(Row::new(NAME, quantity, "").one(share));
    }
    let fast = |multiple: &str| intact(results, &speed_name(multiple, ON_END, FAST_M_S));
    rows.push(
        Row::new(NAME, "the same on end at 4 m/s, ten times Table 2", "")
            .paper("more than softer")
            .one(fast(MULTIPLES[2].0)),
    );
    rows.push(
        Row::new(NAME, "the same on end at 4 m/s, a tenth of Table 2", "")
            .paper("less than stiffer")
            .one(fast(MULTIPLES[0].0)),
    );
    let curves = MULTIPLES.into_iter().enumerate().flat_map(|(colour, (multiple, _))| {
        [FLAT, ON_END].into_iter().enumerate().map(move |(dash, orientation)| {
            let label = format!("{multiple}, {}", if dash == 0 { "flat" } else { "on end" });
            (label, Look { colour, dash }, multiple, orientation)
        })
    });
    let curves = curves.map(|(label, look, multiple, orientation)| {
        curve(&label, look, shares(multiple, orientation).into_iter())
    });
    let svg =
        plotted("speed of impact (m/s)", "share of bonds intact", Scale::Linear, Some(0.9), curves.collect());
    let illustrations =
        svg.map(|svg| Illustration::new(svg, "Share of bonds intact over the speed of impact."));
    Told { rows, illustrations: illustrations.into_iter().collect(), findings: Vec::new() }
}
