//! Table 3: the regimes of flow, and what slows it.

use roost_solver::scenario;
use serde_json::json;

use super::super::rounded;
use super::{CELLS, NARROW, WIDE, cells, curves, of_what, to_whole, under_curves};
use crate::reproduce::plan::{Figure, Part, Results, Run, Told, with};
use crate::reproduce::profile::Profile;
use crate::reproduce::row::Row;
use crate::reproduce::stats::{Seeds, ratio, welch};
use crate::ui::format::significant;

const NAME: &str = "Table 3";
/// Frictions of the belt at 6 cm, everything else dry, falling.
const TRACTIONS: [f64; 3] = [0.3, 0.2, 0.1];
/// Surface energy of everything at 6 cm, friction as dry, in J/m²: some nine times Table 2's.
const STICKY_J_M2: f64 = 0.5;
const STICKY: &str = "6 cm, γ 0.5 J/m²";

fn traction_name(friction: f64) -> String {
    format!("6 cm, belt friction {}", significant(friction))
}

/// The table.
pub(super) fn figure(profile: &Profile) -> Figure {
    let dry = super::scenario(&profile.bed, 0.06, "dry");
    let tractions = TRACTIONS.map(|friction| {
        let belt = json!({"contact": {"fillet_belt": {"static_friction": friction}}});
        (traction_name(friction), with(&dry, belt))
    });
    let energy = json!({"surface_energy_j_m2": STICKY_J_M2});
    let sticky =
        json!({"contact": {"fillet_fillet": energy, "fillet_equipment": energy, "fillet_belt": energy}});
    let causes = tractions.into_iter().chain([(STICKY.to_owned(), with(&dry, sticky))]);
    let causes = causes.flat_map(|(name, scenario)| Run::seeds(&name, &scenario, profile.traction_seeds));
    Figure {
        name: NAME,
        title: "Table 3: regimes of flow",
        part: Part::Hopper,
        paper: "At 4.5 cm normal fillets flow inconsistently, wet ones not at all; at 6 cm normal ones flow constantly, wet \
                ones inconsistently. Its section on the experiment has the openings as 4 and 6.5 cm, its results as 4.5 and \
                6 cm: the latter are taken here.",
        runs: cells(profile).chain(causes).collect(),
        tell: told,
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
        let scenario = scenario::from_value(&super::scenario(&profile.bed, 0.06, condition));
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

fn told(profile: &Profile, results: &Results<'_>) -> Told {
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
            .demand_in_words(
                "0.75 within its 95 % interval, which is no wider than ± 0.1",
                over.is_some_and(|over| over.holds(0.75) && over.half_width <= 0.1),
            )
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
    let svg = curves(results, factor, &CELLS.map(|cell| cell.0), Vec::new());
    let caption = format!("Mass out over belt time, a curve for each seed: {}.", of_what(&profile.bed));
    under_curves(rows, findings, svg, caption)
}

#[cfg(test)]
mod tests {
    use roost_solver::result::EndReason;

    use super::*;
    use crate::reproduce::figures::made_up;
    use crate::reproduce::profile::PROFILES;
    use crate::reproduce::record::Record;

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
    fn the_narrow_gate_is_compared_by_its_rate() {
        let told = |narrow_kg_s: f64| {
            made_up::told(PROFILES[0], figure(PROFILES[0]), |run| {
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
