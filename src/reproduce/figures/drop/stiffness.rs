//! Fig. 9: settle time over normal and shear stiffness, and what becomes of bonds where the two are far apart.

use roost_solver::result::EndReason;
use serde_json::json;

use super::super::{TABLE_2, curve, plotted, stiffness, stiffness_name};
use super::{alone, base, intact, settle_s};
use crate::reproduce::picture::{Shot, View, When};
use crate::reproduce::plan::{Figure, Illustration, Part, Results, Run, Told, with};
use crate::reproduce::profile::Profile;
use crate::reproduce::record::Record;
use crate::reproduce::row::{Demand, Row};
use crate::ui::format::significant;
use crate::ui::plot::{Curve, Look, Mark, Scale};

/// Stiffnesses per area between which S_n and S_t are far apart, in N/m³.
const SOFT: f64 = 1e5;
const STIFF: f64 = 1e7;
/// A time step far under any limit, in seconds.
const SMALL_STEP_S: f64 = 1e-5;

/// Runs with bonds as published, and what they are called.
const PUBLISHED: &str = "as published, S_n far over S_t";
const PUBLISHED_SMALL_STEP: &str = "as published, S_n far over S_t, small step";
const PUBLISHED_REVERSED: &str = "as published, S_t far over S_n";

/// The figure.
pub(super) fn figure(profile: &Profile) -> Figure {
    Figure {
        name: "Fig. 9",
        title: "Fig. 9: settle time over stiffness",
        part: Part::Drop,
        paper: "The time until 99 % of the kinetic energy are lost makes a valley over S_n and S_t: low, unbalanced \
                stiffnesses settle fastest, balanced ones take up to five times longer. (With Fig. 7:) S_n far over S_t is \
                unstable at any time step, S_t far over S_n only breaks bonds.",
        runs: runs_of_stiffness(profile),
        tell: told_stiffness,
    }
}

fn runs_of_stiffness(profile: &Profile) -> Vec<Run> {
    let base = base(profile);
    let at = |normal: f64, shear: f64| with(&base, stiffness(normal, shear));
    let grid = profile.stiffnesses_n_m3;
    let mut pairs = vec![TABLE_2, (SOFT, STIFF), (STIFF, SOFT)];
    for pair in grid.iter().flat_map(|normal| grid.iter().map(|shear| (*normal, *shear))) {
        if !pairs.contains(&pair) {
            pairs.push(pair);
        }
    }
    let mut runs: Vec<Run> =
        pairs.into_iter().map(|(n, s)| Run::new(stiffness_name(n, s), at(n, s))).collect();
    let published = json!({"bonds": {"formulation": "as_published"}});
    let small = json!({"numerics": {"timestep_s": SMALL_STEP_S}});
    runs.extend([
        Run::new(PUBLISHED, with(&at(STIFF, SOFT), published.clone())),
        Run::new(PUBLISHED_SMALL_STEP, with(&with(&alone(&at(STIFF, SOFT)), published.clone()), small)),
        Run::new(PUBLISHED_REVERSED, with(&at(SOFT, STIFF), published)),
        Run::new("fragments", alone(&at(SOFT, STIFF))).shot(Shot::side(When::At(0.1))),
    ]);
    runs
}

fn told_stiffness(profile: &Profile, results: &Results<'_>) -> Told {
    const NAME: &str = "Fig. 9";
    let grid = profile.stiffnesses_n_m3;
    let at = |normal, shear| stiffness_name(normal, shear);
    let table_2 = at(TABLE_2.0, TABLE_2.1);
    let of_pairs = |is_balanced: bool| {
        let pairs = grid.iter().flat_map(|n| grid.iter().map(move |s| (*n, *s)));
        let times = pairs.filter(move |(n, s)| (n == s) == is_balanced).filter_map(|(n, s)| {
            let name = at(n, s);
            settle_s(results, &name).filter(|_| intact(results, &name).is_some_and(|share| share > 0.99))
        });
        times.collect::<Vec<_>>()
    };
    let (balanced, unbalanced) = (of_pairs(true), of_pairs(false));
    let n = balanced.len() + unbalanced.len();
    let slowest = balanced.into_iter().reduce(f64::max);
    let ratio = slowest.zip(unbalanced.into_iter().reduce(f64::min)).map(|(slow, fast)| slow / fast);
    let (torn, whole) = (intact(results, &at(SOFT, STIFF)), intact(results, &table_2));
    let breaks = torn.zip(whole).is_some_and(|(torn, whole)| torn < whole - 0.01);
    let count = 6 * profile.of_each_shape;
    let ends = |quantity: &str, name: &str, papers: &str, expected: &str| {
        let record = results.first(name);
        let words = end(record);
        let is_met = words == expected;
        let row = Row::new(NAME, quantity, "").paper(papers).words(words, record.iter().count());
        let seen = record.and_then(|record| record.result.instability.as_ref());
        row.demand_in_words(expected, is_met).note(seen.map_or_else(String::new, |seen| seen.reason.clone()))
    };
    let rows = vec![
        Row::new(NAME, "settle time, flat at 2 m/s, Table 2", "s")
            .one(settle_s(results, &table_2))
            .demand(Demand::Between(0.1, 0.35))
            .note(format!("mean of {count} fillets")),
        Row::new(NAME, "longest settle time of a fillet, same", "s")
            .one(results.value(&table_2, "longest_settle_time_s")),
        Row::new(NAME, "slowest balanced over fastest unbalanced settle time", "")
            .paper(5.0)
            .from_all(ratio, n)
            .note(
                "“up to five times longer”; of those that keep 99 % of their bonds. Reported as it comes out",
            ),
        Row::new(NAME, "share of bonds intact, S_t far over S_n (1e5, 1e7 N/m³)", "")
            .paper("bonds break")
            .one(torn)
            .demand_in_words("at least 1 % less than at Table 2", breaks),
        ends("bond as published, S_n far over S_t (1e7, 1e5 N/m³)", PUBLISHED, "unstable", "unstable"),
        ends("the same with steps of 1e-5 s", PUBLISHED_SMALL_STEP, "unstable at any step", "unstable"),
        ends(
            "bond as published, S_t far over S_n (1e5, 1e7 N/m³)",
            PUBLISHED_REVERSED,
            "only breaks bonds",
            "sound",
        ),
        ends("bond that turns with the pair, S_n far over S_t", &at(STIFF, SOFT), "", "sound")
            .note("the default formulation; not in the paper"),
    ];
    let findings = ratio.filter(|ratio| *ratio < 4.0).map(|ratio| {
        format!(
            "“Balanced is five times slower” does not reproduce: the slowest balanced pair takes {} times as long as the \
             fastest unbalanced one. In this model it is damping that dissipates, not unbalanced stiffness: without dashpots \
             and friction, energy only spreads.",
            significant((ratio * 100.0).round() / 100.0)
        )
    });
    let lines = |of: &dyn Fn(&str) -> Option<f64>| {
        let each = grid.iter().enumerate().map(|(colour, shear)| {
            let points = grid.iter().map(|normal| (*normal, of(&at(*normal, *shear))));
            curve(&format!("S_t {shear:e} N/m³"), Look { colour, dash: 0 }, points)
        });
        let look = Look { colour: 6, dash: 0 };
        let point = (TABLE_2.0, of(&table_2));
        let alone = Curve { mark: Mark::Alone, ..curve("Table 2", look, std::iter::once(point)) };
        each.chain([alone]).collect::<Vec<_>>()
    };
    let over = "normal stiffness S_n (N/m³)";
    let svg = plotted(over, "settle time (s)", Scale::Log, None, lines(&|name| settle_s(results, name)));
    let settling = "Settle time; a pair of which some fillets have not settled in 2 s has no point.";
    let svg_intact =
        plotted(over, "share of bonds intact", Scale::Log, Some(0.9), lines(&|name| intact(results, name)));
    let picture = results.first("fragments").and_then(|record| record.picture(View::Side, When::At(0.1)));
    let illustrations = [
        svg.map(|svg| Illustration::new(svg, settling)),
        svg_intact.map(|svg| Illustration::new(svg, "Share of bonds intact after the impact.")),
        picture.map(|picture| {
            let svg = picture.svg("a fillet whose bonds have broken", 420.0);
            Illustration::new(svg, "S_t far over S_n: a fillet of size 3, 0.1 s after it fell flat at 2 m/s.")
        }),
    ];
    Told {
        rows,
        findings: findings.into_iter().collect(),
        illustrations: illustrations.into_iter().flatten().collect(),
    }
}

/// Whether a run ended soundly, or how it diverged.
fn end(record: Option<&Record>) -> String {
    match record {
        None => "not run".to_owned(),
        Some(record) if record.result.end_reason == EndReason::Unstable => "unstable".to_owned(),
        Some(_) => "sound".to_owned(),
    }
}
