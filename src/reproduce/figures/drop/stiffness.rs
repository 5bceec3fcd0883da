//! Fig. 9: settle time over normal and shear stiffness, and what becomes of bonds where the two are far apart.

use roost_solver::result::EndReason;
use serde_json::{Value, json};

use super::super::{TABLE_2, plotted, rounded, sampled, stiffness, stiffness_name};
use super::{alone, base, intact, of_fillets, pictured, seeds, settle_s};
use crate::reproduce::picture::{Shot, View, When};
use crate::reproduce::plan::{Figure, Illustration, Part, Results, Run, Told, with};
use crate::reproduce::profile::Profile;
use crate::reproduce::row::{Demand, Row};
use crate::reproduce::stats::{Difference, Sample, ratio, welch};
use crate::ui::format::significant;
use crate::ui::plot::{Curve, Look, Mark, Scale};

/// Stiffnesses per area between which S_n and S_t are far apart, in N/m³.
const SOFT: f64 = 1e5;
const STIFF: f64 = 1e7;
/// A pair of stiffnesses keeps its fillets whole when more than this share of the bonds hold.
const WHOLE: f64 = 0.99;
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
    let published = json!({"bonds": {"formulation": "as_published"}});
    let small = json!({"numerics": {"timestep_s": SMALL_STEP_S}});
    let mut named: Vec<(String, Value)> =
        pairs.into_iter().map(|(n, s)| (stiffness_name(n, s), at(n, s))).collect();
    named.extend([
        (PUBLISHED.to_owned(), with(&at(STIFF, SOFT), published.clone())),
        (PUBLISHED_SMALL_STEP.to_owned(), with(&with(&alone(&at(STIFF, SOFT)), published.clone()), small)),
        (PUBLISHED_REVERSED.to_owned(), with(&at(SOFT, STIFF), published)),
    ]);
    let runs = named.iter().flat_map(|(name, scenario)| seeds(profile, name, scenario));
    let fragments = Run::new("fragments", pictured(&at(SOFT, STIFF))).shot(Shot::side(When::At(0.1)));
    runs.chain([fragments]).collect()
}

/// A pair of stiffnesses of which every fillet of every seed has settled and hardly a bond has broken: its settle time.
fn sound_s(results: &Results<'_>, (normal, shear): (f64, f64)) -> Option<Sample> {
    let name = stiffness_name(normal, shear);
    let holds = intact(results, &name).of_all().is_some_and(|share| share.mean > WHOLE);
    settle_s(results, &name).of_all().filter(|_| holds)
}

/// On the line of one S_n: the settle time at S_t = S_n over the shortest at any other S_t, and that S_t.
fn balanced_over_fastest(
    grid: &[f64],
    normal: f64,
    of: impl Fn((f64, f64)) -> Option<Sample>,
) -> Option<(Difference, f64)> {
    let others = grid.iter().filter(|shear| **shear != normal);
    let others = others.filter_map(|shear| Some((of((normal, *shear))?, *shear)));
    let (fastest, shear) = others.min_by(|a, b| a.0.mean.total_cmp(&b.0.mean))?;
    Some((ratio(&of((normal, normal))?, &fastest)?, shear))
}

fn told_stiffness(profile: &Profile, results: &Results<'_>) -> Told {
    const NAME: &str = "Fig. 9";
    let grid = profile.stiffnesses_n_m3;
    let at = |normal, shear| stiffness_name(normal, shear);
    let table_2 = at(TABLE_2.0, TABLE_2.1);
    let pairs = || grid.iter().flat_map(|n| grid.iter().map(move |s| (*n, *s)));
    let mut rows = vec![
        Row::new(NAME, "settle time, flat at 2 m/s, Table 2", "s")
            .seeds(&settle_s(results, &table_2))
            .demand(Demand::Between(0.1, 0.35))
            .note(format!("mean of a run's fillets, {}", of_fillets(profile, results, &table_2))),
        Row::new(NAME, "longest settle time of a fillet, same", "s")
            .seeds(&results.seeds(&table_2, "longest_settle_time_s")),
    ];
    let mut findings = Vec::new();
    let mut largest: Option<Difference> = None;
    for &normal in grid {
        let found = balanced_over_fastest(grid, normal, |pair| sound_s(results, pair));
        let runs = found.map_or(0, |(_, shear)| {
            [normal, shear].map(|shear| settle_s(results, &at(normal, shear)).values.len()).iter().sum()
        });
        rows.push(
            Row::new(
                NAME,
                format!("settle time at S_t = S_n over the shortest of other S_t, S_n {normal:e} N/m³"),
                "",
            )
            .paper("up to 5")
            .difference_of(found.map(|(ratio, _)| ratio), runs)
            .note(
                found.map_or("a pair is missing".to_owned(), |(_, shear)| {
                    format!("shortest at S_t {shear:e}")
                }),
            ),
        );
        let ratio = found.map(|(ratio, _)| ratio);
        largest = largest.into_iter().chain(ratio).max_by(|a, b| a.mean.total_cmp(&b.mean));
    }
    let shortest = pairs().filter_map(|pair| Some((pair, sound_s(results, pair)?)));
    let shortest = shortest.min_by(|a, b| a.1.mean.total_cmp(&b.1.mean));
    let words = shortest.map_or("none".to_owned(), |((normal, shear), time)| {
        format!("{}: {} s", at(normal, shear), significant(time.mean))
    });
    rows.push(
        Row::new(NAME, "where the settle time is shortest", "")
            .paper("at low, unbalanced stiffnesses")
            .words(words, shortest.map_or(0, |(_, time)| time.n))
            .note("of pairs that all settle and keep 99 % of their bonds"),
    );
    let (torn, whole) = (intact(results, &at(SOFT, STIFF)), intact(results, &table_2));
    let breaks = torn.mean().zip(whole.mean()).is_some_and(|(torn, whole)| torn < whole - 0.01);
    rows.push(
        Row::new(NAME, "share of bonds intact, S_t far over S_n (1e5, 1e7 N/m³)", "")
            .paper("bonds break")
            .seeds(&torn)
            .demand_in_words("at least 1 % less than at Table 2", breaks)
            .note(of_fillets(profile, results, &at(SOFT, STIFF))),
    );
    let reversed = intact(results, PUBLISHED_REVERSED);
    let fewer = reversed.of_all().zip(whole.of_all()).and_then(|(reversed, whole)| welch(&reversed, &whole));
    rows.extend([
        unstable(results, "bond as published, S_n far over S_t (1e7, 1e5 N/m³)", PUBLISHED).paper("unstable"),
        unstable(results, "the same with steps of 1e-5 s", PUBLISHED_SMALL_STEP)
            .paper("unstable at any step, down to 1e-10 s")
            .note("one fillet"),
        sound(results, "bond as published, S_t far over S_n (1e5, 1e7 N/m³)", PUBLISHED_REVERSED)
            .paper("only breaks bonds"),
        Row::new(NAME, "share of bonds intact, the same", "")
            .paper("bonds break")
            .seeds(&reversed)
            .demand_in_words("less than at Table 2 (Welch)", fewer.is_some_and(|fewer| fewer.is_fall())),
        sound(results, "bond that turns with the pair, S_n far over S_t", &at(STIFF, SOFT))
            .note("the default formulation; not in the paper"),
    ]);
    findings.extend(largest.filter(|ratio| ratio.mean + ratio.half_width < 5.0).map(|ratio| {
        format!(
            "“Balanced takes up to five times longer” does not reproduce: along lines of equal S_n the largest ratio is {} ± {}.",
            rounded(ratio.mean, 2),
            rounded(ratio.half_width, 2)
        )
    }));
    findings.extend(
        shortest.filter(|((normal, shear), _)| normal.max(*shear) > TABLE_2.0 || normal == shear).map(
            |(pair, _)| {
                format!(
                    "The shortest settle time is not at low, unbalanced stiffnesses but at {}.",
                    at(pair.0, pair.1)
                )
            },
        ),
    );
    let named = |is_meant: &dyn Fn(&str) -> bool| {
        let names = pairs().map(|(normal, shear)| at(normal, shear)).filter(|name| is_meant(name));
        names.collect::<Vec<_>>().join("; ")
    };
    let unsettled = named(&|name| results.planned(name) > 0 && settle_s(results, name).of_all().is_none());
    if !unsettled.is_empty() {
        findings
            .push(format!("With some seed not every fillet settles at {unsettled}: they are in no ratio."));
    }
    let broken = named(&|name| intact(results, name).mean().is_some_and(|share| share <= WHOLE));
    if !broken.is_empty() {
        findings.push(format!("More than 1 % of the bonds break at {broken}: they are in no ratio."));
    }
    let lines = |of: &dyn Fn(&str) -> Option<Sample>| {
        let each = grid.iter().enumerate().map(|(colour, shear)| {
            let points = grid.iter().map(|normal| (*normal, of(&at(*normal, *shear))));
            sampled(&format!("S_t {shear:e} N/m³"), Look { colour, dash: 0 }, points)
        });
        let look = Look { colour: 6, dash: 0 };
        let point = (TABLE_2.0, of(&table_2));
        let alone = Curve { mark: Mark::Alone, ..sampled("Table 2", look, std::iter::once(point)) };
        each.chain([alone]).collect::<Vec<_>>()
    };
    let over = "normal stiffness S_n (N/m³)";
    let svg =
        plotted(over, "settle time (s)", Scale::Log, None, lines(&|name| settle_s(results, name).of_all()));
    let settling =
        "Settle time, means with 95 % intervals; a pair of which some fillets have not settled has no point.";
    let svg_intact = plotted(
        over,
        "share of bonds intact",
        Scale::Log,
        Some(0.9),
        lines(&|name| intact(results, name).sample()),
    );
    let picture = results.first("fragments").and_then(|record| record.picture(View::Side, When::At(0.1)));
    let illustrations = [
        svg.map(|svg| Illustration::new(svg, settling)),
        svg_intact.map(|svg| Illustration::new(svg, "Share of bonds intact after the impact.")),
        picture.map(|picture| {
            let svg = picture.svg("a fillet whose bonds have broken", 420.0);
            Illustration::new(svg, "S_t far over S_n: a fillet of size 3, 0.1 s after it fell flat at 2 m/s.")
        }),
    ];
    Told { rows, findings, illustrations: illustrations.into_iter().flatten().collect() }
}

/// How many runs of a name were unstable, how many sound, and how many there were to be.
fn ends(results: &Results<'_>, name: &str) -> (usize, usize, usize) {
    let any = results.any(name);
    let unstable = any.iter().filter(|record| record.result.end_reason == EndReason::Unstable).count();
    (unstable, results.of(name).len(), results.planned(name))
}

/// A row of runs that are to diverge, with every seed.
fn unstable(results: &Results<'_>, quantity: &str, name: &str) -> Row {
    let (unstable, _, planned) = ends(results, name);
    let seen = results.any(name).into_iter().find_map(|record| record.result.instability.as_ref());
    let row = Row::new("Fig. 9", quantity, "").words(format!("unstable in {unstable} of {planned}"), planned);
    row.demand_in_words("unstable with every seed", planned > 0 && unstable == planned)
        .note(seen.map_or("", |seen| seen.reason.as_str()))
}

/// A row of runs that are to end soundly, with every seed.
fn sound(results: &Results<'_>, quantity: &str, name: &str) -> Row {
    let (_, sound, planned) = ends(results, name);
    let row = Row::new("Fig. 9", quantity, "").words(format!("sound in {sound} of {planned}"), planned);
    row.demand_in_words("sound with every seed", planned > 0 && sound == planned)
}

#[cfg(test)]
mod tests {
    use super::super::super::made_up;
    use super::*;
    use crate::reproduce::profile::PROFILES;
    use crate::reproduce::record::Record;

    fn drop(run: &Run, settle_s: Option<f64>, share: f64) -> Record {
        let off = 1e-3 * run.scenario["seed"].as_f64().unwrap_or(1.0);
        let settle_s = settle_s.map(|time| time + off);
        let of = json!({"settle_time_s": settle_s, "bonds_intact_fraction": share - 1e-2 * off});
        made_up::responses(&run.scenario, of)
    }

    fn told_of(of: impl Fn(&Run) -> Option<Record>) -> Told {
        made_up::told(PROFILES[0], figure(PROFILES[0]), of)
    }

    fn row<'a>(told: &'a Told, quantity: &str) -> &'a Row {
        told.rows.iter().find(|row| row.quantity.contains(quantity)).unwrap()
    }

    fn pair(run: &Run) -> (f64, f64) {
        let of = |name: &str| run.scenario["bonds"][name].as_f64().unwrap();
        (of("normal_stiffness_n_m3"), of("shear_stiffness_n_m3"))
    }

    #[test]
    fn balance_is_judged_along_lines_of_equal_s_n() {
        // Twice as long where both are equal, whatever S_n; the stiffer the longer.
        let of = |run: &Run| {
            let (normal, shear) = pair(run);
            let time = 0.1 * normal.log10() * if normal == shear { 2.0 } else { 1.0 } + 0.01 * shear.log10();
            Some(drop(run, Some(time), 1.0))
        };
        let told = told_of(of);
        let ratio = row(&told, "S_n 1e6").measured.as_f64().unwrap();
        assert!((ratio - 1.262 / 0.652).abs() < 1e-9, "{ratio}");
        assert!(row(&told, "S_n 1e6").note.contains("shortest at S_t 1e5"));
        let shortest = row(&told, "is shortest").measured.as_str().unwrap().to_owned();
        assert!(shortest.starts_with("S_n 1e5, S_t 1e6"), "{shortest}");
        assert!(told.findings.iter().any(|finding| finding.contains("five times")), "{:?}", told.findings);
        // With 2 s at S_t = S_n = 1e5 and nothing settled at (1e6, 1e5).
        let told = told_of(|run| match pair(run) {
            (1e5, 1e5) => Some(drop(run, Some(5.0), 1.0)),
            (1e6, 1e5) => Some(drop(run, None, 1.0)),
            (1e7, 1e6) => Some(drop(run, Some(0.01), 0.9)),
            _ => of(run),
        });
        assert!(row(&told, "S_n 1e6").note.contains("shortest at S_t 1e7"));
        assert!(row(&told, "S_n 1e7").note.contains("shortest at S_t 1e5"), "what breaks is no rival");
        assert!(!told.findings.iter().any(|finding| finding.contains("five times")), "{:?}", told.findings);
        let named = |what: &str| told.findings.iter().find(|finding| finding.contains(what)).unwrap();
        assert!(named("not every fillet settles").contains("S_n 1e6, S_t 1e5 N/m³:"));
        assert!(named("bonds break").contains("S_n 1e7, S_t 1e6 N/m³:"));
    }

    #[test]
    fn what_diverges_once_too_often_or_too_seldom_is_told() {
        let of = |is_reversed_sound: bool, is_lost: bool| {
            told_of(|run| {
                let (is_first, is_reversed) = (run.scenario["seed"] == 1, run.name == PUBLISHED_REVERSED);
                let record = drop(run, Some(0.2), if is_reversed { 0.9 } else { 1.0 });
                let diverges =
                    run.name.starts_with(PUBLISHED) || is_reversed && is_first && !is_reversed_sound;
                let record = if diverges { made_up::ended(record, EndReason::Unstable) } else { record };
                (!is_lost || !is_first).then_some(record)
            })
        };
        let verdicts = |told: &Told| {
            let rows = told.rows.iter().filter(|row| row.measured.is_string() && row.holds.is_some());
            rows.map(|row| (row.measured.as_str().unwrap().to_owned(), row.holds.unwrap()))
                .collect::<Vec<_>>()
        };
        let good = of(true, false);
        assert!(verdicts(&good).iter().all(|(_, holds)| *holds), "{:?}", verdicts(&good));
        assert_eq!(verdicts(&good)[2].0, "sound in 3 of 3");
        assert_eq!(row(&good, "share of bonds intact, the same").holds, Some(true));
        let bad = of(false, false);
        assert_eq!(verdicts(&bad)[2], ("sound in 2 of 3".to_owned(), false));
        assert_eq!(row(&bad, "share of bonds intact, the same").n, 2, "what diverged enters no mean");
        assert_eq!(
            verdicts(&of(true, true))[0],
            ("unstable in 2 of 3".to_owned(), false),
            "a run that failed"
        );
    }
}
