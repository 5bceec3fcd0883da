//! Fig. 8: sliding angle of a fillet over friction and surface energy.

use roost_stats::{ReplicateValues, line};
use roost_terminal::format::significant;
use roost_terminal::plot::{Curve, Markers, Scale, Style};
use serde_json::{Value, json};

use super::{PAPER_FILL, curve, mean_curve, plot_svg, rounded};
use crate::plan::{Evaluation, Figure, Illustration, Part, Results, Run, with};
use crate::profile::Profile;
use crate::record::Record;
use crate::row::{Demand, Row};

/// Friction of Table 2, which the paper chose by this test.
const TABLE_2: f64 = 0.5;
/// Sliding angles up to this friction must agree with atan μ.
const COULOMB: f64 = 0.5;
/// The compared surface energies with that of Table 2 in the middle, in J/m².
const ENERGIES_J_M2: [f64; 3] = [0.0, 0.055, 0.11];
/// Contact radius over R of a lattice of one type, whose diagonal bonds make it a truss.
const TRUSS: f64 = 1.5;
const TRUSSED: &str = "truss";
/// The seed draws the heading of the fillet from ± this angle, in degrees.
const SCATTER_DEG: f64 = 180.0;

/// The figure.
pub(super) fn figure(profile: &Profile) -> Figure {
    Figure {
        name: "Fig. 8",
        title: "Fig. 8: sliding angle over friction and surface energy",
        part: Part::Slide,
        paper: "The sliding angle depends nearly linearly on the coefficient of friction; surface energy has a negligible \
                influence, and water did not change the measured angle. 0.5 was chosen for fillets on steel.",
        runs: runs(profile),
        evaluate,
    }
}

fn name(friction: f64, energy: f64) -> String {
    format!("μ {}, γ {} J/m²", significant(friction), significant(energy))
}

fn runs(profile: &Profile) -> Vec<Run> {
    let base = json!({
        "experiment": "slide",
        "product": {"subparticle_radius_m": profile.radius_m, "fill": PAPER_FILL},
        "slide": {"tilt_rate_deg_s": profile.tilt_rate_deg_s, "scatter_deg": SCATTER_DEG},
        "numerics": {"timestep_s": "auto"},
    });
    let at = |friction: f64, energy: f64| -> Value {
        let contact = json!({"static_friction": friction, "surface_energy_j_m2": energy});
        with(&base, json!({"contact": {"fillet_equipment": contact}}))
    };
    let mut pairs: Vec<(f64, f64)> =
        profile.frictions.iter().map(|friction| (*friction, ENERGIES_J_M2[1])).collect();
    pairs.extend(ENERGIES_J_M2.map(|energy| (TABLE_2, energy)));
    pairs.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
    pairs.dedup();
    let seeds = |name: &str, scenario: &Value| Run::replicates(name, scenario, profile.headings);
    let truss =
        with(&at(TABLE_2, ENERGIES_J_M2[1]), json!({"bonds": {"types": 1, "contact_radius_ratio": TRUSS}}));
    let runs = pairs
        .into_iter()
        .flat_map(|(friction, energy)| seeds(&name(friction, energy), &at(friction, energy)));
    runs.chain(seeds(TRUSSED, &truss)).collect()
}

/// Maximum less minimum sliding angle over the surface energies, for each heading.
fn spreads(results: &Results<'_>) -> ReplicateValues {
    let records = |energy: f64| results.records(&name(TABLE_2, energy));
    let (planned, all) = (results.planned(&name(TABLE_2, ENERGIES_J_M2[1])), ENERGIES_J_M2.map(records));
    let spread = |seed: u64| {
        let angle = |records: &Vec<&Record>| {
            let record = records.iter().find(|record| record.result.scenario.seed == seed)?;
            record.response("critical_angle_deg").filter(|_| record.is_sound())
        };
        let angles = all.iter().map(angle).collect::<Option<Vec<_>>>()?;
        let (low, high) = ReplicateValues { values: angles, planned: all.len() }.range()?;
        Some(high - low)
    };
    ReplicateValues { values: (1..=planned as u64).filter_map(spread).collect(), planned }
}

fn evaluate(profile: &Profile, results: &Results<'_>) -> Evaluation {
    const NAME: &str = "Fig. 8";
    let angles = |friction: f64, energy: f64| results.response(&name(friction, energy), "critical_angle_deg");
    let papers = |friction: f64| angles(friction, ENERGIES_J_M2[1]);
    let known = |friction: &f64| Some((*friction, papers(*friction).complete_sample()?.mean));
    let points: Option<Vec<(f64, f64)>> = profile.frictions.iter().map(known).collect();
    let n: usize = profile.frictions.iter().map(|friction| papers(*friction).values.len()).sum();
    let tilted =
        format!("the tilt of the plate grows by {}° per second", significant(profile.tilt_rate_deg_s));
    let mut rows = vec![
        Row::new(NAME, "R² of a straight line through the mean sliding angles over μ", "")
            .paper("strong linear correlation")
            .value(points.and_then(|points| line(&points)).map(|line| line.r2), n)
            .demand(Demand::AtLeast(0.95))
            .note(tilted),
    ];
    for &friction in profile.frictions {
        let expected = friction.atan().to_degrees();
        let angles = papers(friction);
        let row = Row::new(NAME, format!("sliding angle at μ = {}", significant(friction)), "°")
            .replicates(&angles)
            .note(format!("atan μ is {}", rounded(expected, 2)))
            .note(range_text(&angles));
        rows.push(if friction <= COULOMB {
            row.demand(Demand::Near((expected * 100.0).round() / 100.0, 3.0))
        } else {
            row
        });
    }
    let spreads = spreads(results);
    rows.push(
        Row::new(NAME, "spread of the sliding angle over surface energies 0, 0.055 and 0.11 J/m²", "°")
            .paper("negligible")
            .replicates(&spreads)
            .demand(Demand::Below(1.0))
            .note(
                "for each heading, the spread is the maximum minus the minimum of the sliding angles at the three surface energies; \
                 μ is 0.5; the value is the mean of these spreads",
            )
            .note(range_text(&spreads)),
    );
    let trussed = results.response(TRUSSED, "critical_angle_deg");
    rows.push(
        Row::new(NAME, "sliding angle at μ = 0.5 with diagonal bonds", "°")
            .replicates(&trussed)
            .note(format!(
                "with `/bonds/types` 1 and `/bonds/contact_radius_ratio` {TRUSS}, bonds join all sub-particles whose centres are \
                 less than {} R apart, also along the diagonals of the lattice; diagonal bonds make the fillet stiff, as diagonal bars \
                 make a frame stiff",
                2.0 * TRUSS
            ))
            .note(range_text(&trussed)),
    );
    let mut findings = vec![
        "Fig. 8b of the paper is an experiment with water on real fillets. Roost does not simulate this experiment, because the model \
         has no water: a wet condition only means other values of some parameters."
            .to_owned(),
    ];
    findings.extend(early_sliding(&papers(TABLE_2), &trussed));
    let frictions = profile.frictions.iter();
    let coulomb = frictions.clone().map(|friction| (*friction, Some(friction.atan().to_degrees())));
    let style = |colour, dash| Style { colour, dash };
    let mut curves = vec![
        mean_curve(
            "γ 0.055 J/m²",
            style(0, 0),
            frictions.map(|friction| (*friction, papers(*friction).sample())),
        ),
        Curve { markers: Markers::None, ..curve("atan μ", style(6, 1), coulomb) },
    ];
    for (colour, energy) in [(1, ENERGIES_J_M2[0]), (2, ENERGIES_J_M2[2])] {
        let point = std::iter::once((TABLE_2, angles(TABLE_2, energy).sample()));
        curves.push(Curve {
            markers: Markers::Only,
            ..mean_curve(&format!("γ {} J/m²", significant(energy)), style(colour, 0), point)
        });
    }
    let svg = plot_svg("coefficient of friction μ", "sliding angle (°)", Scale::Linear, None, curves);
    let caption = format!(
        "Sliding angle over friction, means over {} headings with 95 % intervals, and atan μ.",
        profile.headings
    );
    let illustrations = svg.map(|svg| Illustration::new(svg, caption));
    Evaluation { rows, illustrations: illustrations.into_iter().collect(), findings }
}

/// Minimum and maximum of the values as a text.
fn range_text(seeds: &ReplicateValues) -> String {
    let range = seeds.range().filter(|_| seeds.values.len() > 1);
    range.map_or_else(String::new, |(low, high)| {
        let n = seeds.values.len();
        format!("the values at the {n} headings are from {} to {}", rounded(low, 2), rounded(high, 2))
    })
}

/// A finding if the mean sliding angle is below atan μ.
fn early_sliding(angles: &ReplicateValues, trussed: &ReplicateValues) -> Option<String> {
    let (mean, coulomb) = (angles.sample()?, TABLE_2.atan().to_degrees());
    if mean.mean + mean.half_width().unwrap_or(0.0) >= coulomb {
        return None;
    }
    let mut text = format!(
        "At μ = 0.5, fillets begin to slide at a mean angle of {}°, below atan μ = {}°.",
        rounded(mean.mean, 1),
        rounded(coulomb, 1)
    );
    if mean.n > 1 {
        text.push_str(&format!(" The angle depends on the heading of the fillet: {}°.", range_text(angles)));
    }
    let truss = trussed.mean()?;
    if (truss - coulomb).abs() < (mean.mean - coulomb).abs() {
        text.push_str(&format!(
            " By default, bonds do not resist bending and twist, so single sub-particles may roll on the plate. Diagonal bonds prevent \
             this rolling. With diagonal bonds, the mean angle is {}°.",
            rounded(truss, 1)
        ));
    }
    Some(text)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::figures::fixtures;
    use crate::profile::PROFILES;

    /// The evaluation of runs with these sliding angles.
    fn evaluate_with(angle: impl Fn(&Run, f64, u64) -> Option<f64>) -> Evaluation {
        fixtures::evaluate(PROFILES[0], figure(PROFILES[0]), |run| {
            let friction = run.scenario["contact"]["fillet_equipment"]["static_friction"].as_f64().unwrap();
            let angle = angle(run, friction, run.scenario["seed"].as_u64().unwrap());
            Some(fixtures::record(&run.scenario, json!({"critical_angle_deg": angle})))
        })
    }

    fn row<'a>(evaluation: &'a Evaluation, quantity: &str) -> &'a Row {
        evaluation.rows.iter().find(|row| row.quantity.contains(quantity)).unwrap()
    }

    fn coulomb(friction: f64) -> f64 {
        friction.atan().to_degrees()
    }

    #[test]
    fn demand_judges_the_mean_over_headings() {
        // One heading in five is 10° early: 2° on average.
        let evaluation =
            evaluate_with(|_, friction, seed| Some(coulomb(friction) - if seed == 1 { 10.0 } else { 0.0 }));
        let angle = row(&evaluation, "at μ = 0.3");
        assert_eq!((angle.n, angle.holds), (5, Some(true)));
        assert!((angle.measured.as_f64().unwrap() - coulomb(0.3) + 2.0).abs() < 1e-9);
        assert!(angle.note.contains("from 6.70 to 16.70"), "{}", angle.note);
        let early = evaluate_with(|_, friction, _| Some(coulomb(friction) - 3.5));
        assert_eq!(row(&early, "at μ = 0.3").holds, Some(false));
        assert_eq!(row(&early, "at μ = 0.7").holds, None, "no demand above 0.5");
        assert!(early.findings.iter().any(|finding| finding.contains("23.1°")), "{:?}", early.findings);
    }

    #[test]
    fn finding_on_a_single_heading_states_no_range() {
        let single = |angle: f64| ReplicateValues { values: vec![angle], planned: 1 };
        let finding = early_sliding(&single(20.0), &single(26.5)).unwrap();
        assert!(finding.contains("20.0°") && !finding.contains("heading"), "{finding}");
    }

    #[test]
    fn missing_angle_leaves_no_line() {
        let evaluation =
            evaluate_with(|_, friction, seed| (friction < 0.6 || seed != 2).then_some(50.0 * friction));
        assert_eq!(row(&evaluation, "R²").holds, Some(false));
        assert!(row(&evaluation, "at μ = 0.7").note.contains("4 of 5 simulations"));
        assert_eq!(row(&evaluate_with(|_, friction, _| Some(50.0 * friction)), "R²").holds, Some(true));
    }

    #[test]
    fn surface_energies_are_compared_at_the_same_heading() {
        // Headings differ by degrees, energies by a tenth of one.
        let evaluation = |step: f64| {
            evaluate_with(move |run, friction, seed| {
                let energy =
                    run.scenario["contact"]["fillet_equipment"]["surface_energy_j_m2"].as_f64().unwrap();
                Some(coulomb(friction) - 2.0 * seed as f64 + step * energy / 0.055)
            })
        };
        let spread = evaluation(0.05);
        let spread = row(&spread, "spread");
        assert!((spread.measured.as_f64().unwrap() - 0.1).abs() < 1e-9 && spread.holds == Some(true));
        assert_eq!(row(&evaluation(0.6), "spread").holds, Some(false));
    }
}
