//! Fig. 8: the angle at which a fillet begins to slide, over friction and surface energy.

use serde_json::{Value, json};

use super::{curve, plotted, rounded, sampled};
use crate::reproduce::plan::{Figure, Illustration, Part, Results, Run, Told, with};
use crate::reproduce::profile::Profile;
use crate::reproduce::record::Record;
use crate::reproduce::row::{Demand, Row};
use crate::reproduce::stats::{Seeds, line};
use crate::ui::format::significant;
use crate::ui::plot::{Curve, Look, Mark, Scale};

/// Friction of Table 2, which the paper chose by this test.
const TABLE_2: f64 = 0.5;
/// Angles up to this friction are held against Coulomb's.
const COULOMB: f64 = 0.5;
/// Surface energies that are compared, Table 2's in the middle, in J/m².
const ENERGIES_J_M2: [f64; 3] = [0.0, 0.055, 0.11];
/// Contact radius over R of a lattice of one type, whose diagonal bonds let nothing turn.
const TRUSS: f64 = 1.5;
const TRUSSED: &str = "truss";
/// The heading of the fillet is drawn by the seed from this much to either side, in degrees: from anywhere.
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
        tell: told,
    }
}

fn name(friction: f64, energy: f64) -> String {
    format!("μ {}, γ {} J/m²", significant(friction), significant(energy))
}

fn runs(profile: &Profile) -> Vec<Run> {
    let base = json!({
        "experiment": "slide",
        "product": {"subparticle_radius_m": profile.radius_m},
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
    let seeds = |name: &str, scenario: &Value| Run::seeds(name, scenario, profile.headings);
    let truss =
        with(&at(TABLE_2, ENERGIES_J_M2[1]), json!({"bonds": {"types": 1, "contact_radius_ratio": TRUSS}}));
    let runs = pairs
        .into_iter()
        .flat_map(|(friction, energy)| seeds(&name(friction, energy), &at(friction, energy)));
    runs.chain(seeds(TRUSSED, &truss)).collect()
}

/// The differences between the largest and the smallest angle over surface energies, each at the same heading.
fn spreads(results: &Results<'_>) -> Seeds {
    let of = |energy: f64| results.any(&name(TABLE_2, energy));
    let (planned, all) = (results.planned(&name(TABLE_2, ENERGIES_J_M2[1])), ENERGIES_J_M2.map(of));
    let spread = |seed: u64| {
        let angle = |records: &Vec<&Record>| {
            let record = records.iter().find(|record| record.result.scenario.seed == seed)?;
            record.response("critical_angle_deg").filter(|_| record.is_sound())
        };
        let angles = all.iter().map(angle).collect::<Option<Vec<_>>>()?;
        let (low, high) = Seeds { values: angles, planned: all.len() }.range()?;
        Some(high - low)
    };
    Seeds { values: (1..=planned as u64).filter_map(spread).collect(), planned }
}

fn told(profile: &Profile, results: &Results<'_>) -> Told {
    const NAME: &str = "Fig. 8";
    let angles = |friction: f64, energy: f64| results.seeds(&name(friction, energy), "critical_angle_deg");
    let papers = |friction: f64| angles(friction, ENERGIES_J_M2[1]);
    let known = |friction: &f64| Some((*friction, papers(*friction).of_all()?.mean));
    let points: Option<Vec<(f64, f64)>> = profile.frictions.iter().map(known).collect();
    let n: usize = profile.frictions.iter().map(|friction| papers(*friction).values.len()).sum();
    let tilted = format!("tilted by {} °/s", significant(profile.tilt_rate_deg_s));
    let mut rows = vec![
        Row::new(NAME, "R² of a straight line through the mean sliding angles over μ", "")
            .paper("strong linear correlation")
            .overall(points.and_then(|points| line(&points)).map(|line| line.r2), n)
            .demand(Demand::AtLeast(0.95))
            .note(tilted),
    ];
    for &friction in profile.frictions {
        let expected = friction.atan().to_degrees();
        let angles = papers(friction);
        let row = Row::new(NAME, format!("sliding angle at μ = {}", significant(friction)), "°")
            .seeds(&angles)
            .note(format!("atan μ is {}", rounded(expected, 2)))
            .note(ranges(&angles));
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
            .seeds(&spreads)
            .demand(Demand::Below(1.0))
            .note("of the same heading at μ = 0.5, mean over headings")
            .note(ranges(&spreads)),
    );
    let trussed = results.seeds(TRUSSED, "critical_angle_deg");
    rows.push(
        Row::new(NAME, "sliding angle at μ = 0.5 with diagonal bonds", "°")
            .seeds(&trussed)
            .note("one type of sub-particles bonded to 1.5 R: a stiff truss")
            .note(ranges(&trussed)),
    );
    let mut findings = vec![
        "Fig. 8b is an experiment with water on real fillets. There is nothing to simulate: in the model water is a change of \
         parameters."
            .to_owned(),
    ];
    findings.extend(before_coulomb(&papers(TABLE_2), &trussed));
    let frictions = profile.frictions.iter();
    let coulomb = frictions.clone().map(|friction| (*friction, Some(friction.atan().to_degrees())));
    let look = |colour, dash| Look { colour, dash };
    let mut curves = vec![
        sampled(
            "γ 0.055 J/m²",
            look(0, 0),
            frictions.map(|friction| (*friction, papers(*friction).sample())),
        ),
        Curve { mark: Mark::None, ..curve("atan μ", look(6, 1), coulomb) },
    ];
    for (colour, energy) in [(1, ENERGIES_J_M2[0]), (2, ENERGIES_J_M2[2])] {
        let point = std::iter::once((TABLE_2, angles(TABLE_2, energy).sample()));
        curves.push(Curve {
            mark: Mark::Alone,
            ..sampled(&format!("γ {} J/m²", significant(energy)), look(colour, 0), point)
        });
    }
    let svg = plotted("coefficient of friction μ", "sliding angle (°)", Scale::Linear, None, curves);
    let caption = format!(
        "Sliding angle over friction, means over {} headings with 95 % intervals, beside Coulomb's.",
        profile.headings
    );
    let illustrations = svg.map(|svg| Illustration::new(svg, caption));
    Told { rows, illustrations: illustrations.into_iter().collect(), findings }
}

/// From where to where values go.
fn ranges(seeds: &Seeds) -> String {
    let range = seeds.range().filter(|_| seeds.values.len() > 1);
    range.map_or_else(String::new, |(low, high)| format!("from {} to {}", rounded(low, 2), rounded(high, 2)))
}

/// What is to be said when fillets begin to slide before Coulomb says.
fn before_coulomb(angles: &Seeds, trussed: &Seeds) -> Option<String> {
    let (mean, coulomb) = (angles.sample()?, TABLE_2.atan().to_degrees());
    if mean.mean + mean.half_width().unwrap_or(0.0) >= coulomb {
        return None;
    }
    let mut text = format!(
        "At μ = 0.5 fillets begin to slide at {}° on average, {} over {} headings, before Coulomb's {}°: the heading matters.",
        rounded(mean.mean, 1),
        ranges(angles),
        mean.n,
        rounded(coulomb, 1)
    );
    let truss = trussed.mean()?;
    if (truss - coulomb).abs() < (mean.mean - coulomb).abs() {
        text.push_str(&format!(
            " Bonds carry no moments, so that single sub-particles may roll on the plate. With diagonal bonds, which hold each of \
             them, it is {}°.",
            rounded(truss, 1)
        ));
    }
    Some(text)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reproduce::figures::made_up;
    use crate::reproduce::profile::PROFILES;

    /// What is told when the angle of a run is this.
    fn told_of(angle: impl Fn(&Run, f64, u64) -> Option<f64>) -> Told {
        made_up::told(PROFILES[0], figure(PROFILES[0]), |run| {
            let friction = run.scenario["contact"]["fillet_equipment"]["static_friction"].as_f64().unwrap();
            let angle = angle(run, friction, run.scenario["seed"].as_u64().unwrap());
            Some(made_up::responses(&run.scenario, json!({"critical_angle_deg": angle})))
        })
    }

    fn row<'a>(told: &'a Told, quantity: &str) -> &'a Row {
        told.rows.iter().find(|row| row.quantity.contains(quantity)).unwrap()
    }

    fn coulomb(friction: f64) -> f64 {
        friction.atan().to_degrees()
    }

    #[test]
    fn the_mean_over_headings_is_judged() {
        // One heading in five is 10° early: 2° on average.
        let told = told_of(|_, friction, seed| Some(coulomb(friction) - if seed == 1 { 10.0 } else { 0.0 }));
        let angle = row(&told, "at μ = 0.3");
        assert_eq!((angle.n, angle.holds), (5, Some(true)));
        assert!((angle.measured.as_f64().unwrap() - coulomb(0.3) + 2.0).abs() < 1e-9);
        assert!(angle.note.contains("from 6.70 to 16.70"), "{}", angle.note);
        let early = told_of(|_, friction, _| Some(coulomb(friction) - 3.5));
        assert_eq!(row(&early, "at μ = 0.3").holds, Some(false));
        assert_eq!(row(&early, "at μ = 0.7").holds, None, "held against nothing");
        assert!(early.findings.iter().any(|finding| finding.contains("23.1°")), "{:?}", early.findings);
    }

    #[test]
    fn a_missing_angle_leaves_no_line() {
        let told = told_of(|_, friction, seed| (friction < 0.6 || seed != 2).then_some(50.0 * friction));
        assert_eq!(row(&told, "R²").holds, Some(false));
        assert!(row(&told, "at μ = 0.7").note.contains("4 of 5 runs"));
        assert_eq!(row(&told_of(|_, friction, _| Some(50.0 * friction)), "R²").holds, Some(true));
    }

    #[test]
    fn surface_energies_are_compared_at_the_same_heading() {
        // Headings differ by degrees, energies by a tenth of one.
        let told = |step: f64| {
            told_of(move |run, friction, seed| {
                let energy =
                    run.scenario["contact"]["fillet_equipment"]["surface_energy_j_m2"].as_f64().unwrap();
                Some(coulomb(friction) - 2.0 * seed as f64 + step * energy / 0.055)
            })
        };
        let spread = told(0.05);
        let spread = row(&spread, "spread");
        assert!((spread.measured.as_f64().unwrap() - 0.1).abs() < 1e-9 && spread.holds == Some(true));
        assert_eq!(row(&told(0.6), "spread").holds, Some(false));
    }
}
