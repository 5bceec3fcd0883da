//! Fig. 9: settle time over normal and shear stiffness, and intact bonds if the two differ much.

use roost_solver::result::EndReason;
use roost_stats::{Difference, Sample, ratio, welch};
use roost_terminal::format::significant;
use roost_terminal::plot::{Curve, Markers, Scale, Style};
use serde_json::{Value, json};

use super::super::{TABLE_2, mean_curve, plot_svg, rounded, stiffness, stiffness_name};
use super::{alone, base, fillets_note, intact, pictured, replicates, settle_s};
use crate::picture::{Moment, Shot, View};
use crate::plan::{Evaluation, Figure, Illustration, Part, Results, Run, with};
use crate::profile::Profile;
use crate::row::{Demand, Row};

/// Low and high stiffness per area of very different S_n and S_t, in N/m³.
const SOFT: f64 = 1e5;
const STIFF: f64 = 1e7;
/// Minimum share of intact bonds of a fillet that counts as whole.
const WHOLE: f64 = 0.99;
/// A time step far below every limit, in seconds.
const SMALL_STEP_S: f64 = 1e-5;

/// Names of the runs with bonds as published.
const PUBLISHED: &str = "as published, S_n far above S_t";
const PUBLISHED_SMALL_STEP: &str = "as published, S_n far above S_t, small step";
const PUBLISHED_REVERSED: &str = "as published, S_t far above S_n";

/// The figure.
pub(super) fn figure(profile: &Profile) -> Figure {
    Figure {
        name: "Fig. 9",
        title: "Fig. 9: settle time over stiffness",
        part: Part::Drop,
        paper: "The time until 99 % of the kinetic energy is lost has a valley over S_n and S_t: low, unbalanced stiffnesses settle \
                fastest, balanced ones take up to five times as long. With Fig. 7: S_n far above S_t is unstable at every time \
                step, S_t far above S_n only breaks bonds.",
        runs: runs(profile),
        evaluate,
    }
}

fn runs(profile: &Profile) -> Vec<Run> {
    let base = base(profile);
    let at = |normal: f64, shear: f64| with(&base, stiffness(normal, shear));
    let grid = profile.stiffnesses_n_m3;
    let mut pairs = vec![TABLE_2, (SOFT, STIFF), (STIFF, SOFT)];
    for pair in grid.iter().flat_map(|normal| grid.iter().map(|shear| (*normal, *shear))) {
        if !pairs.contains(&pair) {
            pairs.push(pair);
        }
    }
    let published = json!({"bonds": {"formulation": "as_published"}});
    let small = json!({"numerics": {"timestep_s": SMALL_STEP_S}});
    let mut named: Vec<(String, Value)> =
        pairs.into_iter().map(|(n, s)| (stiffness_name(n, s), at(n, s))).collect();
    named.extend([
        (PUBLISHED.to_owned(), with(&at(STIFF, SOFT), published.clone())),
        (PUBLISHED_SMALL_STEP.to_owned(), with(&with(&alone(&at(STIFF, SOFT)), published.clone()), small)),
        (PUBLISHED_REVERSED.to_owned(), with(&at(SOFT, STIFF), published)),
    ]);
    let runs = named.iter().flat_map(|(name, scenario)| replicates(profile, name, scenario));
    let fragments = Run::new("fragments", pictured(&at(SOFT, STIFF))).shot(Shot::side(Moment::At(0.1)));
    runs.chain([fragments]).collect()
}

/// The settle time of a pair of stiffnesses, if all fillets of all replicates have settled and stayed whole.
fn whole_settle_s(results: &Results<'_>, (normal, shear): (f64, f64)) -> Option<Sample> {
    let name = stiffness_name(normal, shear);
    let is_whole = intact(results, &name).complete_sample().is_some_and(|share| share.mean > WHOLE);
    settle_s(results, &name).complete_sample().filter(|_| is_whole)
}

/// For one S_n: the settle time at S_t = S_n over the minimum at all other S_t, and the S_t of the minimum.
fn balanced_over_fastest(
    grid: &[f64],
    normal: f64,
    settle_s: impl Fn((f64, f64)) -> Option<Sample>,
) -> Option<(Difference, f64)> {
    let others = grid.iter().filter(|shear| **shear != normal);
    let others = others.filter_map(|shear| Some((settle_s((normal, *shear))?, *shear)));
    let (fastest, shear) = others.min_by(|a, b| a.0.mean.total_cmp(&b.0.mean))?;
    Some((ratio(&settle_s((normal, normal))?, &fastest)?, shear))
}

fn evaluate(profile: &Profile, results: &Results<'_>) -> Evaluation {
    const NAME: &str = "Fig. 9";
    let grid = profile.stiffnesses_n_m3;
    let at = |normal, shear| stiffness_name(normal, shear);
    let table_2 = at(TABLE_2.0, TABLE_2.1);
    let pairs = || grid.iter().flat_map(|n| grid.iter().map(move |s| (*n, *s)));
    let mut rows = vec![
        Row::new(NAME, "settle time after a flat impact at 2 m/s, Table 2", "s")
            .replicates(&settle_s(results, &table_2))
            .demand(Demand::Between(0.1, 0.35))
            .note(format!(
                "each simulation gives the mean over its fillets; {}",
                fillets_note(profile, results, &table_2)
            )),
        Row::new(NAME, "maximum settle time of a fillet after a flat impact at 2 m/s, Table 2", "s")
            .replicates(&results.response(&table_2, "longest_settle_time_s")),
    ];
    let mut findings = Vec::new();
    let mut maximum: Option<Difference> = None;
    for &normal in grid {
        let found = balanced_over_fastest(grid, normal, |pair| whole_settle_s(results, pair));
        let runs = found.map_or(0, |(_, shear)| {
            [normal, shear].map(|shear| settle_s(results, &at(normal, shear)).values.len()).iter().sum()
        });
        rows.push(
            Row::new(
                NAME,
                format!("settle time at S_t = S_n divided by the minimum at other S_t, S_n {normal:e} N/m³"),
                "",
            )
            .paper("up to 5")
            .difference_of(found.map(|(ratio, _)| ratio), runs)
            .note(
                found.map_or(
                    "no ratio: at S_t = S_n, or at all other S_t, fillets do not settle or bonds break"
                        .to_owned(),
                    |(_, shear)| format!("the minimum at other S_t is at S_t {shear:e} N/m³"),
                ),
            ),
        );
        let ratio = found.map(|(ratio, _)| ratio);
        maximum = maximum.into_iter().chain(ratio).max_by(|a, b| a.mean.total_cmp(&b.mean));
    }
    let shortest = pairs().filter_map(|pair| Some((pair, whole_settle_s(results, pair)?)));
    let shortest = shortest.min_by(|a, b| a.1.mean.total_cmp(&b.1.mean));
    let words = shortest.map_or("none".to_owned(), |((normal, shear), time)| {
        format!("{}: {} s", at(normal, shear), significant(time.mean))
    });
    rows.push(
        Row::new(NAME, "stiffnesses with the minimum settle time", "")
            .paper("at low, unbalanced stiffnesses")
            .text(words, shortest.map_or(0, |(_, time)| time.n))
            .note(
                "the minimum is over the pairs of stiffnesses at which all fillets settle with every seed, and at which more than 99 % \
                 of the bonds stay intact",
            ),
    );
    let (torn, whole) = (intact(results, &at(SOFT, STIFF)), intact(results, &table_2));
    let breaks = torn.mean().zip(whole.mean()).is_some_and(|(torn, whole)| torn < whole - 0.01);
    rows.push(
        Row::new(NAME, "share of bonds intact, S_t far above S_n (1e5, 1e7 N/m³)", "")
            .paper("bonds break")
            .replicates(&torn)
            .demand_text("at least 1 % less than with Table 2", breaks)
            .note(fillets_note(profile, results, &at(SOFT, STIFF))),
    );
    let reversed = intact(results, PUBLISHED_REVERSED);
    let fewer = reversed
        .complete_sample()
        .zip(whole.complete_sample())
        .and_then(|(reversed, whole)| welch(&reversed, &whole));
    rows.extend([
        unstable(results, "bonds as published, S_n far above S_t (1e7, 1e5 N/m³)", PUBLISHED)
            .paper("unstable"),
        unstable(results, "bonds as published, S_n far above S_t, time step 1e-5 s", PUBLISHED_SMALL_STEP)
            .paper("unstable at every step down to 1e-10 s")
            .note("one fillet per simulation"),
        sound(results, "bonds as published, S_t far above S_n (1e5, 1e7 N/m³)", PUBLISHED_REVERSED)
            .paper("only breaks bonds"),
        Row::new(NAME, "share of bonds intact, as published, S_t far above S_n", "")
            .paper("bonds break")
            .replicates(&reversed)
            .demand_text("less than with Table 2 (Welch)", fewer.is_some_and(|fewer| fewer.is_fall())),
        sound(results, "bonds that turn with the two spheres, S_n far above S_t", &at(STIFF, SOFT))
            .note("this formulation is the default of Roost; the paper does not have it"),
    ]);
    findings.extend(maximum.filter(|ratio| ratio.mean + ratio.half_width < 5.0).map(|ratio| {
        format!(
            "In the paper, fillets with balanced stiffnesses (S_t = S_n) take up to five times as long to settle as fillets with \
             other S_t at the same S_n. Roost does not reproduce this factor of five: in Roost, the maximum ratio of the two settle \
             times is {} ± {}.",
            rounded(ratio.mean, 2),
            rounded(ratio.half_width, 2)
        )
    }));
    findings.extend(
        shortest.filter(|((normal, shear), _)| normal.max(*shear) > TABLE_2.0 || normal == shear).map(
            |(pair, _)| {
                format!(
                    "In Roost, the minimum settle time is at {}. In the paper, the minimum is at low, unbalanced stiffnesses (S_t differs \
                     from S_n).",
                    at(pair.0, pair.1)
                )
            },
        ),
    );
    let count = |is_included: &dyn Fn(&str) -> bool| {
        pairs().map(|(normal, shear)| at(normal, shear)).filter(|name| is_included(name)).count()
    };
    let total = pairs().count();
    let unsettled =
        count(&|name| results.planned(name) > 0 && settle_s(results, name).complete_sample().is_none());
    if unsettled > 0 {
        findings.push(format!("Some fillets do not settle at {unsettled} of {total} pairs of stiffnesses. The ratios of settle times \
                               do not use these pairs."));
    }
    let broken = count(&|name| intact(results, name).mean().is_some_and(|share| share <= WHOLE));
    if broken > 0 {
        findings.push(format!("At least 1 % of the bonds break at {broken} of {total} pairs of stiffnesses. The ratios of settle \
                               times do not use these pairs."));
    }
    let lines = |sample: &dyn Fn(&str) -> Option<Sample>| {
        let each = grid.iter().enumerate().map(|(colour, shear)| {
            let points = grid.iter().map(|normal| (*normal, sample(&at(*normal, *shear))));
            mean_curve(&format!("S_t {shear:e} N/m³"), Style { colour, dash: 0 }, points)
        });
        let style = Style { colour: 6, dash: 0 };
        let point = (TABLE_2.0, sample(&table_2));
        let alone = Curve { markers: Markers::Only, ..mean_curve("Table 2", style, std::iter::once(point)) };
        each.chain([alone]).collect::<Vec<_>>()
    };
    let over = "normal stiffness S_n (N/m³)";
    let svg = plot_svg(
        over,
        "settle time (s)",
        Scale::Log,
        None,
        lines(&|name| settle_s(results, name).complete_sample()),
    );
    let settling = "Settle time, means with 95 % intervals; pairs with unsettled fillets have no point.";
    let svg_intact = plot_svg(
        over,
        "share of bonds intact",
        Scale::Log,
        Some(0.9),
        lines(&|name| intact(results, name).sample()),
    );
    let picture =
        results.first_record("fragments").and_then(|record| record.picture(View::Side, Moment::At(0.1)));
    let illustrations = [
        svg.map(|svg| Illustration::new(svg, settling)),
        svg_intact.map(|svg| Illustration::new(svg, "Share of bonds intact after the impact.")),
        picture.map(|picture| {
            let svg = picture.svg("a fillet with broken bonds", 420.0);
            Illustration::new(
                svg,
                "S_t far above S_n: a fillet of size 3, 0.1 s after a flat impact at 2 m/s.",
            )
        }),
    ];
    Evaluation { rows, findings, illustrations: illustrations.into_iter().flatten().collect() }
}

/// Numbers of unstable, sound and planned runs of a name.
fn counts(results: &Results<'_>, name: &str) -> (usize, usize, usize) {
    let any = results.records(name);
    let unstable = any.iter().filter(|record| record.result.end_reason == EndReason::Unstable).count();
    (unstable, results.sound_records(name).len(), results.planned(name))
}

/// A row for runs that must diverge with every seed.
fn unstable(results: &Results<'_>, quantity: &str, name: &str) -> Row {
    let (unstable, _, planned) = counts(results, name);
    let instability = results.records(name).into_iter().find_map(|record| record.result.instability.as_ref());
    let row = Row::new("Fig. 9", quantity, "").text(format!("unstable in {unstable} of {planned}"), planned);
    row.demand_text("unstable with every seed", planned > 0 && unstable == planned)
        .note(instability.map_or_else(String::new, |instability| plain(&instability.reason)))
}

/// The reason of an instability with plain numbers such as 1.12 for 1.12e0, and with an explanation of the limit.
fn plain(reason: &str) -> String {
    let word = |word: &str| {
        let number = word.parse::<f64>().ok().filter(|_| word.contains('e'));
        number.map_or_else(|| word.to_owned(), significant)
    };
    let words: Vec<String> = reason.split(' ').map(word).collect();
    words.join(" ").replace(
        ", twice the energy that it can have",
        ", twice the energy that the impact speed, gravity and adhesion can give to this fillet",
    )
}

/// A row for runs that must not diverge with any seed.
fn sound(results: &Results<'_>, quantity: &str, name: &str) -> Row {
    let (_, sound, planned) = counts(results, name);
    let row = Row::new("Fig. 9", quantity, "").text(format!("sound in {sound} of {planned}"), planned);
    row.demand_text("sound with every seed", planned > 0 && sound == planned)
}

#[cfg(test)]
mod tests {
    use super::super::super::fixtures;
    use super::*;
    use crate::profile::PROFILES;
    use crate::record::Record;

    fn drop(run: &Run, settle_s: Option<f64>, share: f64) -> Record {
        let off = 1e-3 * run.scenario["seed"].as_f64().unwrap_or(1.0);
        let settle_s = settle_s.map(|time| time + off);
        let of = json!({"settle_time_s": settle_s, "bonds_intact_fraction": share - 1e-2 * off});
        fixtures::record(&run.scenario, of)
    }

    fn evaluate_with(of: impl Fn(&Run) -> Option<Record>) -> Evaluation {
        fixtures::evaluate(PROFILES[0], figure(PROFILES[0]), of)
    }

    fn row<'a>(evaluation: &'a Evaluation, quantity: &str) -> &'a Row {
        evaluation.rows.iter().find(|row| row.quantity.contains(quantity)).unwrap()
    }

    fn pair(run: &Run) -> (f64, f64) {
        let of = |name: &str| run.scenario["bonds"][name].as_f64().unwrap();
        (of("normal_stiffness_n_m3"), of("shear_stiffness_n_m3"))
    }

    #[test]
    fn ratio_compares_settle_times_at_equal_s_n() {
        // Twice as long where both are equal, whatever S_n; the stiffer the longer.
        let of = |run: &Run| {
            let (normal, shear) = pair(run);
            let time = 0.1 * normal.log10() * if normal == shear { 2.0 } else { 1.0 } + 0.01 * shear.log10();
            Some(drop(run, Some(time), 1.0))
        };
        let evaluation = evaluate_with(of);
        let ratio = row(&evaluation, "S_n 1e6").measured.as_f64().unwrap();
        assert!((ratio - 1.262 / 0.652).abs() < 1e-9, "{ratio}");
        assert!(row(&evaluation, "S_n 1e6").note.contains("is at S_t 1e5 N/m³"));
        let minimum = row(&evaluation, "minimum settle time").measured.as_str().unwrap().to_owned();
        assert!(minimum.starts_with("S_n 1e5, S_t 1e6"), "{minimum}");
        assert!(
            evaluation.findings.iter().any(|finding| finding.contains("five times")),
            "{:?}",
            evaluation.findings
        );
        // With 2 s at S_t = S_n = 1e5 and nothing settled at (1e6, 1e5).
        let evaluation = evaluate_with(|run| match pair(run) {
            (1e5, 1e5) => Some(drop(run, Some(5.0), 1.0)),
            (1e6, 1e5) => Some(drop(run, None, 1.0)),
            (1e7, 1e6) => Some(drop(run, Some(0.01), 0.9)),
            _ => of(run),
        });
        assert!(row(&evaluation, "S_n 1e6").note.contains("is at S_t 1e7 N/m³"));
        assert!(
            row(&evaluation, "S_n 1e7").note.contains("is at S_t 1e5 N/m³"),
            "pairs that break bonds are not compared"
        );
        assert!(
            !evaluation.findings.iter().any(|finding| finding.contains("five times")),
            "{:?}",
            evaluation.findings
        );
        let finding = |text: &str| evaluation.findings.iter().find(|finding| finding.contains(text)).unwrap();
        assert!(finding("do not settle").contains("at 1 of 9 pairs"));
        assert!(finding("bonds break").contains("at 1 of 9 pairs"));
    }

    #[test]
    fn reasons_have_plain_numbers() {
        let reason = "fillet 5 has 1.12e0 J of kinetic energy; the limit is 1.06e0 J, twice the energy that it can have";
        let text = plain(reason);
        assert!(text.starts_with(
            "fillet 5 has 1.12 J of kinetic energy; the limit is 1.06 J, twice the energy that the impact"
        ));
        assert_eq!(plain("a sub-particle is too fast"), "a sub-particle is too fast");
    }

    #[test]
    fn stability_is_judged_over_all_seeds() {
        let of = |is_reversed_sound: bool, is_lost: bool| {
            evaluate_with(|run| {
                let (is_first, is_reversed) = (run.scenario["seed"] == 1, run.name == PUBLISHED_REVERSED);
                let record = drop(run, Some(0.2), if is_reversed { 0.9 } else { 1.0 });
                let diverges =
                    run.name.starts_with(PUBLISHED) || is_reversed && is_first && !is_reversed_sound;
                let record =
                    if diverges { fixtures::with_end_reason(record, EndReason::Unstable) } else { record };
                (!is_lost || !is_first).then_some(record)
            })
        };
        let verdicts = |evaluation: &Evaluation| {
            let rows = evaluation.rows.iter().filter(|row| row.measured.is_string() && row.holds.is_some());
            rows.map(|row| (row.measured.as_str().unwrap().to_owned(), row.holds.unwrap()))
                .collect::<Vec<_>>()
        };
        let good = of(true, false);
        assert!(verdicts(&good).iter().all(|(_, holds)| *holds), "{:?}", verdicts(&good));
        assert_eq!(verdicts(&good)[2].0, "sound in 3 of 3");
        assert_eq!(row(&good, "share of bonds intact, as published, S_t far above S_n").holds, Some(true));
        let bad = of(false, false);
        assert_eq!(verdicts(&bad)[2], ("sound in 2 of 3".to_owned(), false));
        assert_eq!(
            row(&bad, "share of bonds intact, as published, S_t far above S_n").n,
            2,
            "diverged runs enter no mean"
        );
        assert_eq!(verdicts(&of(true, true))[0], ("unstable in 2 of 3".to_owned(), false), "a failed run");
    }
}
