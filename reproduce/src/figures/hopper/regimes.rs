//! Table 3: regimes of flow, and the effects of belt friction and adhesion.

use roost_solver::scenario;
use roost_stats::{ReplicateValues, ratio, welch};
use roost_terminal::format::significant;
use serde_json::json;

use super::super::rounded;
use super::{CELLS, NARROW, WIDE, bed_text, cells, discharge_plot, scale_to_hopper, with_plot};
use crate::plan::{Evaluation, Figure, Part, Results, Run, with};
use crate::profile::Profile;
use crate::row::Row;

const NAME: &str = "Table 3";
/// Belt frictions at 6 cm with all other parameters dry, descending.
const BELT_FRICTIONS: [f64; 3] = [0.3, 0.2, 0.1];
/// Surface energy of all contacts at 6 cm with dry friction, in J/m²; about nine times that of Table 2.
const STICKY_J_M2: f64 = 0.5;
const STICKY: &str = "6 cm, γ 0.5 J/m²";

fn friction_name(friction: f64) -> String {
    format!("6 cm, belt friction {}", significant(friction))
}

/// The table.
pub(super) fn figure(profile: &Profile) -> Figure {
    let dry = super::scenario(&profile.bed, 0.06, "dry");
    let frictions = BELT_FRICTIONS.map(|friction| {
        let belt = json!({"contact": {"fillet_belt": {"static_friction": friction}}});
        (friction_name(friction), with(&dry, belt))
    });
    let energy = json!({"surface_energy_j_m2": STICKY_J_M2});
    let sticky =
        json!({"contact": {"fillet_fillet": energy, "fillet_equipment": energy, "fillet_belt": energy}});
    let causes = frictions.into_iter().chain([(STICKY.to_owned(), with(&dry, sticky))]);
    let causes =
        causes.flat_map(|(name, scenario)| Run::replicates(&name, &scenario, profile.traction_seeds));
    Figure {
        name: NAME,
        title: "Table 3: regimes of flow",
        part: Part::Hopper,
        paper: "At 4.5 cm normal fillets flow inconsistently, and wet ones do not flow. At 6 cm normal ones flow constantly, and \
                wet ones inconsistently. The openings are 4 and 6.5 cm in its section on the experiment, and 4.5 and 6 cm in \
                its results; the latter are used here.",
        runs: cells(profile).chain(causes).collect(),
        evaluate,
    }
}

/// Regimes of the runs of a name, such as `constant in 4, inconsistent in 1 of 5`, and whether all planned runs have the expected
/// one.
fn regimes(results: &Results<'_>, name: &str, expected: &str) -> (String, bool) {
    let (records, planned) = (results.sound_records(name), results.planned(name));
    let all = ["constant", "inconsistent", "no_flow", "outrun", "too_short"];
    let count = |regime: &str| {
        records.iter().filter(|record| record.result.responses.get("regime") == Some(&regime.into())).count()
    };
    let counted: Vec<String> = all
        .into_iter()
        .filter(|regime| count(regime) > 0)
        .map(|regime| format!("{} in {}", regime.replace('_', " "), count(regime)))
        .collect();
    let is_expected = planned > 0 && count(&expected.replace(' ', "_")) == planned;
    match counted.join(", ") {
        text if text.is_empty() => ("unknown".to_owned(), is_expected),
        text => (format!("{text} of {planned}"), is_expected),
    }
}

/// A note on the regimes of the runs of a name.
fn regime_note(words: &str) -> String {
    format!("regime of the simulations: {words}")
}

/// A finding on the effects of belt friction and adhesion on the rate.
fn cause_finding(
    dry: &ReplicateValues,
    frictions: &[(f64, ReplicateValues)],
    sticky: &ReplicateValues,
) -> Option<String> {
    let (dry_kg_s, sticky_kg_s) = (dry.mean()?, sticky.mean()?);
    let reduced: Vec<String> = frictions
        .iter()
        .map(|(friction, seeds)| {
            Some(format!("{} kg/s at a friction of {}", rounded(seeds.mean()?, 2), significant(*friction)))
        })
        .collect::<Option<_>>()?;
    let minimum = frictions.iter().filter_map(|(_, rates)| rates.mean()).reduce(f64::min)?;
    let (last, others) = reduced.split_last()?;
    let mut text = format!(
        "At 6 cm, dry, the mean rate is {} kg/s with a belt friction of 0.5. With a lower belt friction, the mean rate is {}, and \
         {last}. A surface energy of {STICKY_J_M2} J/m² in all contacts, in place of 0.055 J/m², changes the mean rate to {} kg/s.",
        rounded(dry_kg_s, 2),
        others.join(", "),
        rounded(sticky_kg_s, 2)
    );
    if minimum < sticky_kg_s && minimum < dry_kg_s {
        text.push_str(
            " In the model, a lower belt friction therefore slows the flow more than a larger surface energy does. The paper names two \
             causes of slower flow: lower traction (grip of the belt on the fillets), and adhesion. The paper measured the friction on \
             a steel plate, not on the belt of its hopper, which is a modular belt (a belt of linked modules).",
        );
    }
    Some(text)
}

/// A finding on the parameters of the wet condition.
fn wet_finding(profile: &Profile) -> String {
    let parameters = |condition| {
        let scenario = scenario::from_value(&super::scenario(&profile.bed, 0.06, condition));
        let belt = scenario.expect("a valid scenario").contact.fillet_belt;
        (belt.static_friction, belt.surface_energy_j_m2)
    };
    let ((dry, usual), (wet, energy)) = (parameters("dry"), parameters("wet"));
    format!(
        "The wet condition has a belt friction of {} in place of {}, and a surface energy of {} J/m² in place of {} J/m². These values \
         are assumptions, because the paper only says that water was added.",
        significant(wet),
        significant(dry),
        significant(energy),
        significant(usual)
    )
}

fn evaluate(profile: &Profile, results: &Results<'_>) -> Evaluation {
    let mut rows = Vec::new();
    let mut findings = Vec::new();
    for (name, _, _, papers) in CELLS {
        let (words, is_papers) = regimes(results, name, papers);
        let n = results.sound_records(name).len();
        let row = Row::new(NAME, format!("regime at {name}"), "").paper(papers).text(&words, n);
        rows.push(match name {
            WIDE => row.demand_text("constant with every seed", is_papers),
            _ => row.note("reported without a demand"),
        });
        if !is_papers && n > 0 {
            findings.push(format!(
                "At {name}, the regime in the paper is {papers}. In Roost, the regime is {words} simulations."
            ));
        }
        let row =
            Row::new(NAME, format!("minimum rate over 1 s, divided by the belt capacity, at {name}"), "");
        let row = row.replicates(&results.response(name, "lowest_rate_ratio"));
        rows.push(row.note(
            "the regime is “no flow” if this value is below 0.15, and “inconsistent” if this value is from 0.15 to 0.55",
        ));
    }
    let factor = scale_to_hopper(&profile.bed);
    let rates = |name: &str| results.response(name, "mean_rate_kg_s").scaled(factor);
    let (narrow, wide) = (rates(NARROW), rates(WIDE));
    let both = narrow.complete_sample().zip(wide.complete_sample());
    let less = both.and_then(|(narrow, wide)| welch(&narrow, &wide)).is_some_and(|less| less.is_fall());
    let over = both.and_then(|(narrow, wide)| ratio(&narrow, &wide));
    rows.push(
        Row::new(NAME, "mean rate at 6 cm, dry", "kg/s").replicates(&wide).note(bed_text(&profile.bed)),
    );
    rows.push(
        Row::new(NAME, "mean rate at 4.5 cm, dry", "kg/s")
            .replicates(&narrow)
            .demand_text("less than at 6 cm (Welch)", less)
            .note(bed_text(&profile.bed)),
    );
    rows.push(
        Row::new(NAME, "mean rate at 4.5 cm divided by the mean rate at 6 cm, dry", "")
            .difference_of(over, narrow.values.len() + wide.values.len())
            .demand_text(
                "the 95 % interval contains 0.75 and is at most ± 0.1",
                over.is_some_and(|over| over.contains(0.75) && over.half_width <= 0.1),
            )
            .note("0.75 is 4.5 cm divided by 6 cm, the ratio of the gate openings"),
    );
    let frictions = BELT_FRICTIONS.map(|friction| (friction, rates(&friction_name(friction))));
    for (friction, seeds) in &frictions {
        let quantity = format!("mean rate at 6 cm, dry with a belt friction of {}", significant(*friction));
        let (words, _) = regimes(results, &friction_name(*friction), "constant");
        rows.push(Row::new(NAME, quantity, "kg/s").replicates(seeds).note(regime_note(&words)));
    }
    let sticky = rates(STICKY);
    let quantity = format!("mean rate at 6 cm, dry with a surface energy of {STICKY_J_M2} J/m²");
    let (words, _) = regimes(results, STICKY, "constant");
    rows.push(Row::new(NAME, quantity, "kg/s").replicates(&sticky).note(regime_note(&words)));
    findings.push(wet_finding(profile));
    findings.extend(cause_finding(&wide, &frictions, &sticky));
    let svg = discharge_plot(results, factor, &CELLS.map(|cell| cell.0), Vec::new());
    let caption =
        format!("Discharged mass over belt time, a curve for each seed: {}.", bed_text(&profile.bed));
    with_plot(rows, findings, svg, caption)
}

#[cfg(test)]
mod tests {
    use roost_solver::result::EndReason;

    use super::*;
    use crate::figures::fixtures;
    use crate::profile::PROFILES;
    use crate::record::Record;

    #[test]
    fn expected_regime_needs_every_seed() {
        let of = |regime: &str| {
            let mut record = fixtures::discharge_record(&[], 1.0);
            record.result.responses.insert("regime".to_owned(), regime.into());
            Some(record)
        };
        let regimes_of = |records: &[Option<Record>], expected: &str| {
            let runs = records.iter().map(|record| ("a", record.as_ref())).collect();
            regimes(&Results { runs }, "a", expected)
        };
        let (constant, stalls) = (of("constant"), of("no_flow"));
        let expected = |words: &str, is_expected| (words.to_owned(), is_expected);
        assert_eq!(
            regimes_of(&[constant.clone(), constant.clone()], "constant"),
            expected("constant in 2 of 2", true)
        );
        assert_eq!(regimes_of(&[constant.clone(), None], "constant"), expected("constant in 1 of 2", false));
        let mixed = [constant.clone(), stalls.clone()];
        assert_eq!(regimes_of(&mixed, "constant"), expected("constant in 1, no flow in 1 of 2", false));
        assert_eq!(regimes_of(&[stalls.clone(), stalls], "no flow"), expected("no flow in 2 of 2", true));
        let diverged = constant.clone().map(|record| fixtures::with_end_reason(record, EndReason::Unstable));
        assert_eq!(regimes_of(&[constant, diverged], "constant"), expected("constant in 1 of 2", false));
        assert_eq!(regimes_of(&[None], "constant"), expected("unknown", false));
        assert_eq!(regimes_of(&[], "constant"), expected("unknown", false));
    }

    #[test]
    fn cause_finding_follows_from_the_rates() {
        let seeds = |mean: f64| ReplicateValues { values: vec![mean - 0.1, mean + 0.1], planned: 2 };
        let frictions = |least: f64| [(0.3, seeds(6.0)), (0.1, seeds(least))];
        let text = cause_finding(&seeds(8.0), &frictions(1.0), &seeds(7.5)).unwrap();
        assert!(
            text.contains(
                "8.00 kg/s with a belt friction of 0.5. With a lower belt friction, the mean rate is 6.00 kg/s at a friction of 0.3, \
                 and 1.00 kg/s at a friction of 0.1."
            ),
            "{text}"
        );
        assert!(text.contains("changes the mean rate to 7.50 kg/s") && text.contains("traction"), "{text}");
        assert!(!cause_finding(&seeds(8.0), &frictions(5.0), &seeds(2.0)).unwrap().contains("traction"));
        assert_eq!(cause_finding(&seeds(8.0), &frictions(1.0), &ReplicateValues::default()), None);
        assert!(wet_finding(PROFILES[0]).contains("a belt friction of 0.2 in place of 0.5"));
        assert!(wet_finding(PROFILES[0]).contains("0.0728 J/m²"));
    }

    #[test]
    fn narrow_gate_is_compared_by_its_rate() {
        let evaluation = |narrow_kg_s: f64| {
            fixtures::evaluate(PROFILES[0], figure(PROFILES[0]), |run| {
                let rate = if run.name == NARROW { narrow_kg_s } else { 8.0 };
                let rate = rate + 0.2 * run.scenario["seed"].as_f64().unwrap();
                let of = json!({"mean_rate_kg_s": rate, "regime": "constant"});
                Some(fixtures::record(&run.scenario, of))
            })
        };
        let verdicts = |evaluation: &Evaluation| {
            let of = |quantity: &str| {
                evaluation.rows.iter().find(|row| row.quantity.starts_with(quantity)).unwrap().holds.unwrap()
            };
            (of("mean rate at 4.5 cm, dry"), of("mean rate at 4.5 cm divided"))
        };
        assert_eq!(verdicts(&evaluation(5.9)), (true, true));
        assert_eq!(verdicts(&evaluation(7.0)), (true, false));
        assert_eq!(verdicts(&evaluation(7.9)), (false, false));
    }
}
