//! Table 3, Fig. 13 and 14: the bulk discharge, at two openings, dry and wet.

use roost_solver::result::EndReason;
use roost_solver::scenario;
use serde_json::{Value, json};

use super::rounded;
use crate::reproduce::picture::{Shot, View, When};
use crate::reproduce::plan::{Figure, Illustration, Part, Results, Run, Told, with};
use crate::reproduce::profile::{Bed, Profile, WHOLE_WIDTH_M};
use crate::reproduce::record::Record;
use crate::reproduce::row::{Demand, Row};
use crate::reproduce::stats::{Seeds, line, ratio, welch};
use crate::ui::format::significant;
use crate::ui::plot::{self, Curve, Look, Mark, Panel};

/// The mass that the paper's experiment discharged in 4 s, and that it loaded, in kilograms.
const PAPERS_OUT_KG: f64 = 33.2;
const PAPERS_LOAD_KG: f64 = 38.21;
/// When they are compared, in seconds of belt time.
const JUDGED_S: f64 = 4.0;
/// Belt times of the pictures, in seconds.
const PICTURED_S: [f64; 2] = [0.5, 2.0];

/// The cells of Table 3: name of the runs, opening in metres, condition, and the paper's word.
const CELLS: [(&str, f64, &str, &str); 4] = [
    ("4.5 cm, dry", 0.045, "dry", "inconsistent"),
    ("4.5 cm, wet", 0.045, "wet", "no flow"),
    ("6 cm, dry", 0.06, "dry", "constant"),
    ("6 cm, wet", 0.06, "wet", "inconsistent"),
];
const NARROW: &str = CELLS[0].0;
const WIDE: &str = CELLS[2].0;

/// Frictions of the belt at 6 cm, everything else dry, falling.
const TRACTIONS: [f64; 3] = [0.3, 0.2, 0.1];
/// Surface energy of everything at 6 cm, friction as dry, in J/m²: some nine times Table 2's.
const STICKY_J_M2: f64 = 0.5;
const STICKY: &str = "6 cm, γ 0.5 J/m²";
/// The paper's inner volume of the hopper, in m³.
const PAPERS_BED_M3: f64 = 0.0407;
/// What stands for so long, in seconds, has jammed for a while.
const STANDSTILL_S: f64 = 1.0;

fn traction_name(friction: f64) -> String {
    format!("6 cm, belt friction {}", significant(friction))
}

/// All three.
pub(super) fn figures(profile: &Profile) -> Vec<Figure> {
    let cells = || {
        CELLS.into_iter().flat_map(|(name, opening, condition, _)| {
            let seeds = if condition == "dry" { profile.dry_seeds } else { profile.wet_seeds };
            Run::seeds(name, &scenario(&profile.bed, opening, condition), seeds)
        })
    };
    let pictured = cells()
        .filter(|run| run.name.ends_with("dry") && run.scenario["seed"] == 1)
        .map(|run| PICTURED_S.into_iter().fold(run, |run, t| run.shot(Shot::side(When::At(t)))));
    let dry = scenario(&profile.bed, 0.06, "dry");
    let tractions = TRACTIONS.map(|friction| {
        let belt = json!({"contact": {"fillet_belt": {"static_friction": friction}}});
        (traction_name(friction), with(&dry, belt))
    });
    let energy = json!({"surface_energy_j_m2": STICKY_J_M2});
    let sticky =
        json!({"contact": {"fillet_fillet": energy, "fillet_equipment": energy, "fillet_belt": energy}});
    let causes = tractions.into_iter().chain([(STICKY.to_owned(), with(&dry, sticky))]);
    let causes = causes.flat_map(|(name, scenario)| Run::seeds(&name, &scenario, profile.traction_seeds));
    vec![
        Figure {
            name: "Table 3",
            title: "Table 3: regimes of flow",
            part: Part::Hopper,
            paper: "At 4.5 cm normal fillets flow inconsistently, wet ones not at all; at 6 cm normal ones flow constantly, wet \
                    ones inconsistently. Its section on the experiment has the openings as 4 and 6.5 cm, its results as 4.5 and \
                    6 cm: the latter are taken here.",
            runs: cells().chain(causes).collect(),
            tell: told_regimes,
        },
        Figure {
            name: "Fig. 13",
            title: "Fig. 13: fillets pouring under the gate",
            part: Part::Hopper,
            paper: "Continuous discharge at 6 cm, a jammed state at 4.5 cm, in experiment and simulation alike; leaving \
                    fillets curl and drape. (Openings as in its results; its section on the experiment says 4 and 6.5 cm.)",
            runs: pictured.collect(),
            tell: told_pouring,
        },
        Figure {
            name: "Fig. 14",
            title: "Fig. 14: mass discharged at 6 cm",
            part: Part::Hopper,
            paper: "Around 33.2 kg of fillets were fully discharged through 6 cm within 4 s, of 38.21 kg that were loaded. \
                    The simulated mass rises linearly and agrees within 7 %. The hopper's inner volume is 0.0407 m³, and fillets \
                    were generated for 4 s before the belt ran. 10 s of it took about 9 minutes on a GPU, at an effective \
                    throughput of 7.6 kg/s.",
            runs: cells().filter(|run| run.name == WIDE).collect(),
            tell: told_discharge,
        },
    ]
}

/// The bulk experiment in a hopper or a slice of it.
pub(super) fn scenario(bed: &Bed, opening_m: f64, condition: &str) -> Value {
    let is_slice = bed.width_m < WHOLE_WIDTH_M;
    json!({
        "experiment": "hopper",
        "product": {"count": bed.count, "subparticle_radius_m": bed.radius_m},
        "equipment": {
            "gate_opening_m": opening_m,
            "hopper_width_m": bed.width_m,
            "side_walls": if is_slice { "frictionless" } else { "rough" },
        },
        "contact": {"condition": condition},
        "numerics": {"timestep_s": "auto", "duration_s": bed.duration_s, "stop": {"when_jammed_s": 2.5}},
    })
}

/// What masses of a bed are multiplied by to stand for the whole hopper.
fn to_whole(bed: &Bed) -> f64 {
    WHOLE_WIDTH_M / bed.width_m
}

/// Of what the masses are, in words.
fn of_what(bed: &Bed) -> String {
    let radius_mm = significant(bed.radius_m * 1e3);
    if bed.width_m < WHOLE_WIDTH_M {
        let width_cm = significant(bed.width_m * 100.0);
        format!("a slice {width_cm} cm wide of the hopper, R = {radius_mm} mm; masses scaled to 59 cm")
    } else {
        format!("the whole hopper, R = {radius_mm} mm")
    }
}

/// Mass out at a belt time, in kilograms, read as straight between samples. What is empty or jammed keeps its last value; of a run
/// that ended sooner for another reason, nothing is known.
pub(super) fn out_kg(record: &Record, t_s: f64) -> Option<f64> {
    let series = record.result.series("discharged_mass")?;
    let after = series.t_s.partition_point(|t| *t < t_s);
    match after {
        0 => series.values.first().copied(),
        after if after == series.t_s.len() => {
            let is_over = matches!(record.result.end_reason, EndReason::Empty | EndReason::Jammed);
            let is_there = series.t_s.last().is_some_and(|end| *end >= t_s - 1e-6);
            series.values.last().copied().filter(|_| is_over || is_there)
        }
        after => {
            let (t, m) = (&series.t_s[after - 1..=after], &series.values[after - 1..=after]);
            Some(m[0] + (m[1] - m[0]) * (t_s - t[0]) / (t[1] - t[0]))
        }
    }
}

/// The regimes of the runs of a name in words, such as `constant in 4, inconsistent in 1 of 5`, and whether all that there were to
/// be are of this one.
fn regimes(results: &Results<'_>, name: &str, expected: &str) -> (String, bool) {
    let (records, planned) = (results.of(name), results.planned(name));
    let all = ["constant", "inconsistent", "no_flow", "too_short"];
    let count = |regime: &str| {
        records.iter().filter(|record| record.result.responses.get("regime") == Some(&regime.into())).count()
    };
    let told: Vec<String> = all
        .into_iter()
        .filter(|regime| count(regime) > 0)
        .map(|regime| format!("{} in {}", regime.replace('_', " "), count(regime)))
        .collect();
    let is_expected = planned > 0 && count(&expected.replace(' ', "_")) == planned;
    match told.join(", ") {
        told if told.is_empty() => ("not told".to_owned(), is_expected),
        told => (format!("{told} of {planned}"), is_expected),
    }
}

/// What slows flow in the model, as far as runs with less traction and with more adhesion tell.
fn cause(dry: &Seeds, tractions: &[(f64, Seeds)], sticky: &Seeds) -> Option<String> {
    let (dry_kg_s, sticky_kg_s) = (dry.mean()?, sticky.mean()?);
    let less: Vec<String> = tractions
        .iter()
        .map(|(friction, seeds)| {
            Some(format!("{} kg/s with {}", rounded(seeds.mean()?, 2), significant(*friction)))
        })
        .collect::<Option<_>>()?;
    let least = tractions.iter().filter_map(|(_, seeds)| seeds.mean()).reduce(f64::min)?;
    let mut text = format!(
        "At 6 cm and everything else dry, friction of the belt alone changes the mean rate from {} kg/s with 0.5 to {}; a surface \
         energy of {STICKY_J_M2} J/m² everywhere, in place of 0.055, alone changes it to {} kg/s.",
        rounded(dry_kg_s, 2),
        less.join(", "),
        rounded(sticky_kg_s, 2)
    );
    if least < sticky_kg_s && least < dry_kg_s {
        text.push_str(
            " So it is less adhesion that slows flow in the model than the loss of the belt's traction. The paper names both, and \
             measured friction on a steel plate and not on its modular belt.",
        );
    }
    Some(text)
}

/// What wet is in the model.
fn wet(profile: &Profile) -> String {
    let of = |condition| {
        let scenario = scenario::from_value(&self::scenario(&profile.bed, 0.06, condition));
        let belt = scenario.expect("a scenario of ours").contact.fillet_belt;
        (belt.static_friction, belt.surface_energy_j_m2)
    };
    let ((dry, usual), (wet, energy)) = (of("dry"), of("wet"));
    format!(
        "Wet is an assumption: a friction of {} on the belt in place of {}, and a surface energy of {} J/m² everywhere in place of \
         {}. The paper says of water only that it was added.",
        significant(wet),
        significant(dry),
        significant(energy),
        significant(usual)
    )
}

fn told_regimes(profile: &Profile, results: &Results<'_>) -> Told {
    const NAME: &str = "Table 3";
    let mut rows = Vec::new();
    let mut findings = Vec::new();
    for (name, _, _, papers) in CELLS {
        let (words, is_papers) = regimes(results, name, papers);
        let n = results.of(name).len();
        let row = Row::new(NAME, format!("regime at {name}"), "").paper(papers).words(&words, n);
        rows.push(match name {
            WIDE => row.demand_in_words("constant with every seed", is_papers),
            _ => row.note("reported as it comes out"),
        });
        if !is_papers && n > 0 {
            findings.push(format!("At {name} the paper has {papers} flow, ours is {words}."));
        }
        let row = Row::new(NAME, format!("lowest 1 s rate over the belt's capacity at {name}"), "");
        let row = row.seeds(&results.seeds(name, "lowest_rate_ratio"));
        rows.push(row.note("q: no flow under 0.15, inconsistent under 0.55"));
    }
    let factor = to_whole(&profile.bed);
    let rates = |name: &str| results.seeds(name, "mean_rate_kg_s").times(factor);
    let (narrow, wide) = (rates(NARROW), rates(WIDE));
    let both = narrow.of_all().zip(wide.of_all());
    let less = both.and_then(|(narrow, wide)| welch(&narrow, &wide)).is_some_and(|less| less.is_fall());
    let over = both.and_then(|(narrow, wide)| ratio(&narrow, &wide));
    rows.push(Row::new(NAME, "mean rate at 6 cm, dry", "kg/s").seeds(&wide).note(of_what(&profile.bed)));
    rows.push(
        Row::new(NAME, "mean rate at 4.5 cm, dry", "kg/s")
            .seeds(&narrow)
            .demand_in_words("less than at 6 cm (Welch)", less)
            .note(of_what(&profile.bed)),
    );
    rows.push(
        Row::new(NAME, "mean rate at 4.5 cm over that at 6 cm, dry", "")
            .difference_of(over, narrow.values.len() + wide.values.len())
            .demand_in_words("0.75 within its 95 % interval", over.is_some_and(|over| over.holds(0.75)))
            .note("0.75 is 4.5 over 6: a full opening on the same belt"),
    );
    let tractions = TRACTIONS.map(|friction| (friction, rates(&traction_name(friction))));
    for (friction, seeds) in &tractions {
        let quantity =
            format!("mean rate at 6 cm, dry but for a belt friction of {}", significant(*friction));
        let (words, _) = regimes(results, &traction_name(*friction), "constant");
        rows.push(Row::new(NAME, quantity, "kg/s").seeds(seeds).note(format!("regime: {words}")));
    }
    let sticky = rates(STICKY);
    let quantity = format!("mean rate at 6 cm, dry but for a surface energy of {STICKY_J_M2} J/m²");
    let (words, _) = regimes(results, STICKY, "constant");
    rows.push(Row::new(NAME, quantity, "kg/s").seeds(&sticky).note(format!("regime: {words}")));
    findings.push(wet(profile));
    findings.extend(cause(&wide, &tractions, &sticky));
    let svg = curves(results, factor, &CELLS.map(|cell| cell.0), false);
    let caption = format!("Mass out over belt time, a curve for each seed: {}.", of_what(&profile.bed));
    Told {
        rows,
        findings,
        illustrations: svg.map(|svg| Illustration::new(svg, caption)).into_iter().collect(),
    }
}

/// Discharge curves, each name in its colour; with the paper's point.
fn curves(results: &Results<'_>, factor: f64, names: &[&str], with_paper: bool) -> Option<String> {
    let mut curves = Vec::new();
    for (colour, name) in names.iter().enumerate() {
        for (number, record) in results.of(name).into_iter().enumerate() {
            let series = record.result.series("discharged_mass")?;
            let points = series.t_s.iter().zip(&series.values).map(|(t, mass)| (*t, factor * mass));
            let label = if number == 0 { (*name).to_owned() } else { String::new() };
            let look = Look { colour, dash: usize::from(name.ends_with("wet")) };
            curves.push(Curve { label, look, points: points.collect(), ..Curve::default() });
        }
    }
    if with_paper {
        let look = Look { colour: 1, dash: 0 };
        let points = vec![(4.0, PAPERS_OUT_KG)];
        let label = "paper: 33.2 kg in 4 s".to_owned();
        curves.push(Curve { label, look, mark: Mark::Alone, points, bars: vec![0.07 * PAPERS_OUT_KG] });
    }
    let panel = Panel {
        x_label: "time from belt start (s)".to_owned(),
        y_label: "mass out (kg)".to_owned(),
        curves,
        ..Panel::default()
    };
    plot::svg("", &[panel]).ok()
}

fn told_pouring(profile: &Profile, results: &Results<'_>) -> Told {
    const NAME: &str = "Fig. 13";
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

/// R² of a straight line through the curve over 0 to 4 s.
fn linearity(record: &Record) -> Option<f64> {
    let series = record.result.series("discharged_mass")?;
    let points = series.t_s.iter().copied().zip(series.values.iter().copied());
    line(&points.filter(|(t, _)| *t <= JUDGED_S + 1e-6).collect::<Vec<_>>()).map(|line| line.r2)
}

fn told_discharge(profile: &Profile, results: &Results<'_>) -> Told {
    const NAME: &str = "Fig. 14";
    let bed = &profile.bed;
    let (factor, records) = (to_whole(bed), results.of(WIDE));
    let seeds = |name: &str| results.seeds(WIDE, name);
    let scaled = |name: &str| seeds(name).times(factor);
    let at_4_s = results.seeds_of(WIDE, |record| out_kg(record, JUDGED_S)).times(factor);
    let linear = results.seeds_of(WIDE, linearity);
    let lowest = linear.range().map(|(lowest, _)| lowest).filter(|_| linear.of_all().is_some());
    let spread = at_4_s.sample().and_then(|sample| Some(100.0 * sample.deviation? / sample.mean));
    let share =
        results.seeds_of(WIDE, |record| Some(out_kg(record, JUDGED_S)? / record.response("loaded_kg")?));
    let minutes = results.seeds_of(WIDE, |record| {
        let (cost, solver) = (&record.result.performance, &record.result.solver);
        Some(cost.wall_s / 60.0 * 10.0 / (cost.steps as f64 * solver.timestep_s))
    });
    let what = of_what(bed);
    let rows = vec![
        Row::new(NAME, "lowest R² of a straight line through 0 to 4 s", "")
            .paper("linear")
            .overall(lowest, linear.values.len())
            .demand(Demand::AtLeast(0.99)),
        Row::new(NAME, "R² of a straight line until 80 % is out", "").paper("linear").seeds(&seeds("linearity_r2")),
        Row::new(NAME, "mass out at 4 s", "kg")
            .paper(PAPERS_OUT_KG)
            .seeds(&at_4_s)
            .demand(Demand::Near(PAPERS_OUT_KG, 0.07 * PAPERS_OUT_KG))
            .note(format!(
                "circular: the hopper's width was inferred from this number, so this is a consistency check and no validation. {what}"
            )),
        Row::new(NAME, "loaded", "kg")
            .paper(PAPERS_LOAD_KG)
            .seeds(&scaled("loaded_kg"))
            .note(format!("{what}; the fillets' volume was chosen so that 191 weigh this")),
        Row::new(NAME, "share of the load out at 4 s", "")
            .paper(PAPERS_OUT_KG / PAPERS_LOAD_KG)
            .seeds(&share)
            .note("circular as the mass at 4 s is; the paper calls 33.2 of 38.21 kg fully discharged"),
        Row::new(NAME, "95 % of what was filled out after", "s").seeds(&seeds("time_to_95_percent_s")),
        Row::new(NAME, "bulk density of the bed at rest", "kg/m³")
            .paper((PAPERS_LOAD_KG / PAPERS_BED_M3).round())
            .seeds(&seeds("bulk_density_kg_m3"))
            .note(
                "the paper's: 38.21 kg in 0.0407 m³. Ours: filled mass over hopper area times the height that 95 % of the floor \
                 stays below",
            ),
        Row::new(NAME, "simulated time until the filled hopper is at rest", "s")
            .paper(4.0)
            .seeds(&seeds("fill_duration_s"))
            .note("the paper's is the time of generating fillets"),
        Row::new(NAME, "spread between seeds of the mass at 4 s", "%")
            .overall(spread, at_4_s.values.len())
            .note("standard deviation over mean"),
        Row::new(NAME, "effective throughput", "kg/s")
            .paper(7.6)
            .seeds(&scaled("effective_throughput_kg_s"))
            .note(
                "ours: 95 % of what was filled over the time until it was out; the paper does not say what its number means. It \
                 follows from the width as the mass at 4 s does",
            ),
        Row::new(NAME, "mean rate from 0.5 s until 80 % is out", "kg/s").seeds(&scaled("mean_rate_kg_s")),
        Row::new(NAME, "wall time of 10 simulated seconds", "min").paper(9.0).seeds(&minutes).note(
            records.first().map_or_else(String::new, |record| {
                format!(
                    "the paper's on a GPU, with 41,000 sub-particles; ours with {} on {} thread(s) of {}",
                    record.result.performance.subparticles,
                    record.result.solver.threads,
                    record.computed_by()
                )
            }),
        ),
    ];
    let mut findings = vec![
        "33.2 kg in 4 s is no validation. The dimensions of Fig. 5 are lost, and the hopper's width was worked out from this \
         very figure: a layer of 6 cm at 940 kg/m³ and 0.25 m/s carries 14.1 kg/s for each metre of width."
            .to_owned(),
    ];
    let until = seeds("time_to_95_percent_s");
    findings.extend(until.range().filter(|(least, _)| *least > JUDGED_S).map(|(least, most)| {
        format!(
            "The paper says both that 33.2 kg were fully discharged within 4 s and that 38.21 kg were loaded. Of ours 95 % of what \
             was filled is out after {} to {} s, in {} of {} runs.",
            rounded(least, 1),
            rounded(most, 1),
            until.values.len(),
            until.planned
        )
    }));
    let svg = curves(results, factor, &[WIDE], true);
    let caption =
        format!("Mass out over belt time, a curve for each seed: {what}. The paper's point with its 7 %.");
    Told {
        rows,
        findings,
        illustrations: svg.map(|svg| Illustration::new(svg, caption)).into_iter().collect(),
    }
}

/// The same run at another time step.
pub(super) fn at_timestep(scenario: &Value, timestep_s: f64) -> Value {
    with(scenario, json!({"numerics": {"timestep_s": timestep_s}}))
}

#[cfg(test)]
mod tests {
    use super::super::made_up;
    use super::*;
    use crate::reproduce::profile::{Name, PROFILES};

    #[test]
    fn masses_are_read_between_samples_and_kept_after_a_jam() {
        let record = made_up::discharge(&[(0.0, 0.0), (1.0, 4.0), (2.0, 6.0)], 10.0);
        let read = |record: &Record| [0.0, 0.5, 1.5, 2.0, 3.0].map(|t| out_kg(record, t));
        let known = [Some(0.0), Some(2.0), Some(5.0), Some(6.0)];
        assert_eq!(read(&record)[..4], known);
        assert_eq!(read(&record)[4], None, "it was not run that far");
        for reason in [EndReason::Jammed, EndReason::Empty] {
            assert_eq!(read(&made_up::ended(record.clone(), reason))[4], Some(6.0));
        }
    }

    #[test]
    fn a_line_is_straight_as_far_as_it_is_judged() {
        let straight: Vec<_> = (0..=60).map(|i| f64::from(i) * 0.1).map(|t| (t, t.min(4.0))).collect();
        assert!(
            (linearity(&made_up::discharge(&straight, 9.0)).unwrap() - 1.0).abs() < 1e-12,
            "bent after 4 s"
        );
        let bent: Vec<_> = (0..=40).map(|i| f64::from(i) * 0.1).map(|t| (t, t.min(2.0))).collect();
        assert!(linearity(&made_up::discharge(&bent, 9.0)).unwrap() < 0.9);
    }

    #[test]
    fn a_regime_with_every_seed_needs_every_seed() {
        let of = |regime: &str| {
            let mut record = made_up::discharge(&[], 1.0);
            record.result.responses.insert("regime".to_owned(), regime.into());
            Some(record)
        };
        let told = |records: &[Option<Record>], expected: &str| {
            let runs = records.iter().map(|record| ("a", record.as_ref())).collect();
            regimes(&Results { runs }, "a", expected)
        };
        let (constant, stalls) = (of("constant"), of("no_flow"));
        let told_of = |words: &str, is_expected| (words.to_owned(), is_expected);
        assert_eq!(
            told(&[constant.clone(), constant.clone()], "constant"),
            told_of("constant in 2 of 2", true)
        );
        assert_eq!(told(&[constant.clone(), None], "constant"), told_of("constant in 1 of 2", false));
        let mixed = [constant.clone(), stalls.clone()];
        assert_eq!(told(&mixed, "constant"), told_of("constant in 1, no flow in 1 of 2", false));
        assert_eq!(told(&[stalls.clone(), stalls], "no flow"), told_of("no flow in 2 of 2", true));
        let diverged = constant.clone().map(|record| made_up::ended(record, EndReason::Unstable));
        assert_eq!(told(&[constant, diverged], "constant"), told_of("constant in 1 of 2", false));
        assert_eq!(told(&[None], "constant"), told_of("not told", false));
        assert_eq!(told(&[], "constant"), told_of("not told", false));
    }

    #[test]
    fn causes_follow_from_the_runs() {
        let seeds = |mean: f64| Seeds { values: vec![mean - 0.1, mean + 0.1], planned: 2 };
        let tractions = |least: f64| [(0.3, seeds(6.0)), (0.1, seeds(least))];
        let told = cause(&seeds(8.0), &tractions(1.0), &seeds(7.5)).unwrap();
        assert!(told.contains("8.00 kg/s with 0.5 to 6.00 kg/s with 0.3, 1.00 kg/s with 0.1"), "{told}");
        assert!(told.contains("alone changes it to 7.50 kg/s") && told.contains("traction"), "{told}");
        assert!(!cause(&seeds(8.0), &tractions(5.0), &seeds(2.0)).unwrap().contains("traction"));
        assert_eq!(cause(&seeds(8.0), &tractions(1.0), &Seeds::default()), None);
        assert!(wet(PROFILES[0]).contains("a friction of 0.2 on the belt in place of 0.5"));
        assert!(wet(PROFILES[0]).contains("0.0728 J/m²"));
    }

    #[test]
    fn a_jam_that_was_not_looked_for_is_not_missed() {
        let with = |stoppage_s: Option<f64>| {
            let profile = Name::Tiny.profile();
            let figure = figures(profile).swap_remove(1);
            made_up::told(profile, figure, |run| {
                Some(made_up::responses(&run.scenario, json!({"longest_stoppage_s": stoppage_s})))
            })
        };
        assert!(with(None).findings.is_empty() && with(Some(2.0)).findings.is_empty());
        assert!(with(Some(0.3)).findings[0].contains("0.3 s"));
    }

    #[test]
    fn the_narrow_gate_is_compared_by_its_rate() {
        let told = |narrow_kg_s: f64| {
            made_up::told(PROFILES[0], figures(PROFILES[0]).swap_remove(0), |run| {
                let rate = if run.name == NARROW { narrow_kg_s } else { 8.0 };
                let rate = rate + 0.2 * run.scenario["seed"].as_f64().unwrap();
                let of = json!({"mean_rate_kg_s": rate, "regime": "constant"});
                Some(made_up::responses(&run.scenario, of))
            })
        };
        let verdicts = |told: &Told| {
            let of = |quantity: &str| {
                told.rows.iter().find(|row| row.quantity.starts_with(quantity)).unwrap().holds.unwrap()
            };
            (of("mean rate at 4.5 cm, dry"), of("mean rate at 4.5 cm over"))
        };
        assert_eq!(verdicts(&told(5.9)), (true, true));
        assert_eq!(verdicts(&told(7.0)), (true, false));
        assert_eq!(verdicts(&told(7.9)), (false, false));
    }
}
