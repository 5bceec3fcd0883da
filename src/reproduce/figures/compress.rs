//! Fig. 6: stress over strain of a block of tissue between two plates, and its Young's modulus.

use std::f64::consts::PI;

use serde_json::{Value, json};

use super::{TABLE_2, curve, plotted};
use crate::reproduce::plan::{Figure, Illustration, Part, Results, Run, Told, with};
use crate::reproduce::profile::Profile;
use crate::reproduce::record::Record;
use crate::reproduce::row::{Demand, Row};
use crate::reproduce::stats::line;
use crate::ui::format::significant;
use crate::ui::plot::{Look, Scale};

/// Radii of the two blocks, in metres: that of 35 × 35 × 10.5 mm, and that of the fillets.
const SMALL_M: f64 = 0.00175;
const USUAL_M: f64 = 0.004;
/// What the paper measured, in pascal, and its deviation.
const PAPERS_PA: f64 = 48_600.0;
const PAPERS_OFF_PA: f64 = 1_640.0;
/// Where the paper's curves end, in pascal.
const PAPERS_END_PA: f64 = 4_000.0;
/// Strain at which ours end.
const END: f64 = 0.2;
/// The modulus is fitted up to this strain, as in the paper.
const LINEAR: f64 = 0.03;

/// The blocks: name, radius, whether bonded neighbours press on each other, and the plates.
const BLOCKS: [(&str, f64, bool, &str); 5] = [
    ("bonds alone, R = 1.75 mm", SMALL_M, false, "frictionless"),
    ("bonds alone, R = 4 mm", USUAL_M, false, "frictionless"),
    ("with contact, R = 1.75 mm", SMALL_M, true, "frictionless"),
    ("with contact, R = 4 mm", USUAL_M, true, "frictionless"),
    ("with contact, R = 4 mm, rough plates", USUAL_M, true, "rough"),
];
const WHOLE: &str = BLOCKS[3].0;

/// The figure.
pub(super) fn figure(profile: &Profile) -> Figure {
    Figure {
        name: "Fig. 6",
        title: "Fig. 6: compression of a block",
        part: Part::Compress,
        paper: "Three samples of 35 × 35 × 10 mm, compressed by 1 mm/min, stiffen as they are compressed and end at around 4 kPa. \
                Young's modulus, from strains under 3 %, is 48.6 ± 1.64 kPa, and became that of the sub-particles.",
        runs: BLOCKS.into_iter().map(|block| Run::new(block.0, scenario(profile, block))).collect(),
        tell: told,
    }
}

fn scenario(profile: &Profile, (_, radius_m, contact, plates): (&str, f64, bool, &str)) -> Value {
    let base = json!({
        "experiment": "compress",
        "product": {"subparticle_radius_m": radius_m},
        "bonds": {"contact_between_bonded": contact},
        "compress": {"plates": plates, "strain_rate_1_s": profile.strain_rate_1_s},
        "numerics": {"timestep_s": "auto"},
    });
    with(&base, json!({"compress": {"max_strain": END, "modulus_to_strain": LINEAR}}))
}

/// Stress over strain.
fn stress(record: &Record) -> Vec<(f64, f64)> {
    let curve = record.result.curves.iter().find(|curve| curve.name == "stress" && curve.over == "strain");
    curve.map_or_else(Vec::new, |curve| curve.x.iter().copied().zip(curve.values.iter().copied()).collect())
}

/// Slope at the end of a curve over that at its start: above 1 it stiffens.
fn stiffening(points: &[(f64, f64)]) -> Option<f64> {
    let slope = |from: f64, to: f64| {
        let part: Vec<_> =
            points.iter().copied().filter(|(strain, _)| (from..=to).contains(strain)).collect();
        line(&part).map(|line| line.slope)
    };
    Some(slope(END - LINEAR, END + 1e-9)? / slope(0.0, LINEAR)?)
}

fn told(profile: &Profile, results: &Results<'_>) -> Told {
    const NAME: &str = "Fig. 6";
    let lattice_pa = |name: &str| results.value(name, "modulus_lattice_pa");
    let plates_pa = |name: &str| results.value(name, "modulus_pa");
    let rate = format!("rate of strain {} 1/s; the paper's is 0.0017", significant(profile.strain_rate_1_s));
    let kilo = |pascal: Option<f64>| pascal.map(|pascal| pascal / 1e3);
    let mut rows = Vec::new();
    for (name, radius_m, _, _) in &BLOCKS[..2] {
        let expected = TABLE_2.0 * PI * radius_m / 2.0;
        rows.push(
            Row::new(NAME, format!("modulus of the lattice over S_n π R/2, {name}"), "")
                .one(lattice_pa(name).map(|modulus| modulus / expected))
                .demand(Demand::Near(1.0, 0.02))
                .note(format!("the closed form gives {} kPa", significant(expected / 1e3))),
        );
    }
    rows.push(
        Row::new(NAME, format!("modulus of the lattice, {WHOLE}"), "kPa")
            .one(kilo(lattice_pa(WHOLE)))
            .demand(Demand::Between(8.0, 10.0))
            .note(&rate),
    );
    for (name, ..) in &BLOCKS[2..] {
        let row = Row::new(NAME, format!("Young's modulus as the paper takes it, {name}"), "kPa")
            .paper(PAPERS_PA / 1e3);
        let row =
            row.one(kilo(plates_pa(name))).note("stress on the plates over their approach, strain up to 3 %");
        let reaches = plates_pa(name).is_none_or(|modulus| modulus > PAPERS_PA - PAPERS_OFF_PA);
        rows.push(if *name == WHOLE {
            row.demand_in_words("falls short of the paper's", !reaches)
        } else {
            row
        });
    }
    let end_pa = results.value(WHOLE, "stress_at_end_pa");
    rows.push(
        Row::new(NAME, format!("stress at a strain of {END}, {WHOLE}"), "kPa")
            .paper(PAPERS_END_PA / 1e3)
            .one(kilo(end_pa))
            .demand_in_words("falls short of the paper's", end_pa.is_some_and(|end| end < PAPERS_END_PA))
            .note("the strain at which the paper's curves end is not in its text"),
    );
    let stiffens = results.first(WHOLE).and_then(|record| stiffening(&stress(record)));
    rows.push(
        Row::new(NAME, "slope of the last over that of the first 3 % of strain", "")
            .paper("stiffens")
            .one(stiffens),
    );
    let share = plates_pa(WHOLE).map(|modulus| modulus / PAPERS_PA);
    let findings = share.map(|share| {
        format!(
            "48.6 kPa does not reproduce: a block with the parameters of Table 2 has {} % of that. The paper gave the measured \
             modulus of the tissue to its sub-particles, but what makes a block stiff is its bonds, S_n π R/2 = 6.28 kPa at \
             4 mm, and for about a third the contacts between bonded neighbours. It stiffens, as the paper's samples do, but \
             not to their 4 kPa.",
            significant((share * 100.0).round())
        )
    });
    let curves = BLOCKS.iter().enumerate().map(|(colour, (name, ..))| {
        let points = results.first(name).map(stress).unwrap_or_default();
        let points = points.into_iter().map(|(strain, pascal)| (strain, Some(pascal / 1e3)));
        let mut curve = curve(name, Look { colour, dash: 0 }, points);
        curve.mark = crate::ui::plot::Mark::None;
        curve
    });
    let svg = plotted("strain", "stress (kPa)", Scale::Linear, None, curves.collect());
    let illustrations =
        svg.map(|svg| Illustration::new(svg, "Stress over strain of blocks of 10 × 10 × 3 sub-particles. A block whose stress falls has buckled."));
    Told {
        rows,
        illustrations: illustrations.into_iter().collect(),
        findings: findings.into_iter().collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_curve_that_steepens_stiffens() {
        let steps = || (0..=200).map(|i| f64::from(i) / 1000.0);
        let straight: Vec<_> = steps().map(|x| (x, 9.0 * x)).collect();
        assert!((stiffening(&straight).unwrap() - 1.0).abs() < 1e-9);
        // y = x²: the slope is 2x, 0.37 at the end and 0.03 at the start on average.
        let bent: Vec<_> = steps().map(|x| (x, x * x)).collect();
        assert!((stiffening(&bent).unwrap() - 0.37 / 0.03).abs() < 1e-6);
        assert_eq!(stiffening(&[]), None);
    }
}
