//! Fig. 6: stress over strain of a block of tissue between two plates, and its Young's modulus.

use std::f64::consts::PI;

use roost_stats::line;
use roost_terminal::format::significant;
use roost_terminal::plot::{Curve, Markers, Scale, Style};
use serde_json::{Value, json};

use super::{TABLE_2, curve, plot_svg, rounded};
use crate::picture::{Moment, Shot, View};
use crate::plan::{Evaluation, Figure, Illustration, Part, Results, Run, with};
use crate::profile::Profile;
use crate::record::Record;
use crate::row::{Demand, Row};

/// Sub-particle radius of the block of 35 × 35 × 10.5 mm, in metres.
const SMALL_M: f64 = 0.00175;
/// Sub-particle radius of the fillets, in metres.
const USUAL_M: f64 = 0.004;
/// The paper's modulus, in pascal.
const PAPERS_PA: f64 = 48_600.0;
/// Stress at the end of the paper's curves, in pascal.
const PAPERS_END_PA: f64 = 4_000.0;
/// A curve with a slope of 48.6 kPa or more reaches 4 kPa at or before this strain.
const PAPERS_END: f64 = PAPERS_END_PA / PAPERS_PA;
/// Strain at the end of the simulated curves.
const END: f64 = 0.2;
/// Maximum strain of the fit of the modulus, as in the paper.
const LINEAR: f64 = 0.03;

/// The blocks: name, radius, whether bonded neighbours have contact, and the plates.
const BLOCKS: [(&str, f64, bool, &str); 5] = [
    ("bonds alone, R = 1.75 mm", SMALL_M, false, "frictionless"),
    ("bonds alone, R = 4 mm", USUAL_M, false, "frictionless"),
    ("with contact, R = 1.75 mm", SMALL_M, true, "frictionless"),
    ("with contact, R = 4 mm", USUAL_M, true, "frictionless"),
    ("with contact, R = 4 mm, rough plates", USUAL_M, true, "rough"),
];
const PAPERS_SIZE: &str = BLOCKS[2].0;
const WHOLE: &str = BLOCKS[3].0;
const ROUGH: &str = BLOCKS[4].0;

/// The figure.
pub(super) fn figure(profile: &Profile) -> Figure {
    Figure {
        name: "Fig. 6",
        title: "Fig. 6: compression of a block",
        part: Part::Compress,
        paper: "Three samples of 35 × 35 × 10 mm, compressed by 1 mm/min, stiffen as they are compressed and end at around 4 kPa. \
                Young's modulus, from strains under 3 %, is 48.6 ± 1.64 kPa, and became that of the sub-particles.",
        runs: BLOCKS.into_iter().map(|block| run(profile, block)).collect(),
        evaluate,
    }
}

fn run(profile: &Profile, block: (&str, f64, bool, &str)) -> Run {
    let run = Run::new(block.0, scenario(profile, block));
    // The picture shows whether it has buckled.
    if block.0 == PAPERS_SIZE { run.shot(Shot::side(Moment::Last)) } else { run }
}

fn scenario(profile: &Profile, (_, radius_m, contact, plates): (&str, f64, bool, &str)) -> Value {
    let base = json!({
        "experiment": "compress",
        "product": {"subparticle_radius_m": radius_m},
        // The paper keeps the stiffness per area at every radius.
        "bonds": {"contact_between_bonded": contact, "reference_radius_m": null},
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

/// Stress at a strain, linear between samples; none outside the curve.
fn stress_at(points: &[(f64, f64)], strain: f64) -> Option<f64> {
    let pair = points.windows(2).find(|pair| (pair[0].0..=pair[1].0).contains(&strain))?;
    let [(x0, y0), (x1, y1)] = [pair[0], pair[1]];
    Some(if x1 > x0 { y0 + (y1 - y0) * (strain - x0) / (x1 - x0) } else { y0 })
}

/// The point of maximum stress.
fn maximum(points: &[(f64, f64)]) -> Option<(f64, f64)> {
    points.iter().copied().max_by(|a, b| a.1.total_cmp(&b.1))
}

/// Maximum difference between the stresses of two curves at the same strain, over the maximum stress.
fn relative_difference(a: &[(f64, f64)], b: &[(f64, f64)]) -> Option<f64> {
    let differences = a.iter().filter_map(|(strain, stress)| Some((stress - stress_at(b, *strain)?).abs()));
    Some(differences.reduce(f64::max)? / maximum(a)?.1)
}

/// Slope at the end of a curve over the slope at its start; above 1 it stiffens.
fn stiffening(points: &[(f64, f64)]) -> Option<f64> {
    let slope = |from: f64, to: f64| {
        let part: Vec<_> =
            points.iter().copied().filter(|(strain, _)| (from..=to).contains(strain)).collect();
        line(&part).map(|line| line.slope)
    };
    Some(slope(END - LINEAR, END + 1e-9)? / slope(0.0, LINEAR)?)
}

fn evaluate(profile: &Profile, results: &Results<'_>) -> Evaluation {
    const NAME: &str = "Fig. 6";
    let lattice_pa = |name: &str| results.first_response(name, "modulus_lattice_pa");
    let plates_pa = |name: &str| results.first_response(name, "modulus_pa");
    let rate = format!(
        "strain rate {} 1/s; the strain rate of the paper is 0.0017 1/s",
        significant(profile.strain_rate_1_s)
    );
    let to_kpa = |pascal: Option<f64>| pascal.map(|pascal| pascal / 1e3);
    let mut rows = Vec::new();
    for (name, radius_m, _, _) in &BLOCKS[..2] {
        let expected = TABLE_2.0 * PI * radius_m / 2.0;
        rows.push(
            Row::new(NAME, format!("modulus of the lattice divided by S_n π R/2, {name}"), "")
                .single(lattice_pa(name).map(|modulus| modulus / expected))
                .demand(Demand::Near(1.0, 0.02))
                .note(format!("the closed form S_n π R/2 gives {} kPa", significant(expected / 1e3))),
        );
    }
    rows.push(
        Row::new(NAME, format!("modulus of the lattice, {WHOLE}"), "kPa")
            .single(to_kpa(lattice_pa(WHOLE)))
            .demand(Demand::Between(8.0, 10.0))
            .note(&rate),
    );
    for (name, ..) in &BLOCKS[2..] {
        let row = Row::new(NAME, format!("Young's modulus by the method of the paper, {name}"), "kPa")
            .paper(PAPERS_PA / 1e3);
        rows.push(
            row.single(to_kpa(plates_pa(name)))
                .note("slope of the stress over the strain between the plates, up to a strain of 3 %"),
        );
    }
    let points = |name: &str| results.first_record(name).map(stress).unwrap_or_default();
    let (whole, small) = (points(WHOLE), points(PAPERS_SIZE));
    let early = stress_at(&whole, PAPERS_END);
    rows.push(
        Row::new(NAME, format!("stress at a strain of {}, {WHOLE}", rounded(PAPERS_END, 3)), "kPa")
            .paper(PAPERS_END_PA / 1e3)
            .single(to_kpa(early))
            .note(format!(
                "at small strains, the paper's samples have a modulus of 48.6 kPa; the modulus then grows with the strain, so the \
                 stress of these samples reaches 4 kPa at a strain of {} or less",
                rounded(PAPERS_END, 3)
            )),
    );
    let stiffens = stiffening(&whole);
    rows.push(
        Row::new(
            NAME,
            format!(
                "slope of the stress in the last 3 % of strain before the end at a strain of {END}, divided by the slope in the first 3 %"
            ),
            "",
        )
        .paper("stiffens")
        .single(stiffens)
        .note(WHOLE),
    );
    let (top, after) = (maximum(&small), small.last().copied());
    rows.push(
        Row::new(NAME, format!("maximum stress, {PAPERS_SIZE}"), "kPa")
            .paper(PAPERS_END_PA / 1e3)
            .single(to_kpa(top.map(|top| top.1)))
            .note(top.map_or_else(String::new, |top| format!("at a strain of {}", rounded(top.0, 3)))),
    );
    rows.push(
        Row::new(
            NAME,
            format!("stress at a strain of {END} divided by the maximum stress, {PAPERS_SIZE}"),
            "",
        )
        .single(after.zip(top).map(|(after, top)| after.1 / top.1)),
    );
    let alone_pa = lattice_pa(BLOCKS[1].0);
    let mut findings = Vec::new();
    findings.extend(plates_pa(WHOLE).map(|modulus| {
        format!(
            "Roost does not reproduce the modulus of 48.6 kPa. A block with R = 4 mm and the parameters of Table 2 has {} % of this \
             modulus. The paper used the measured modulus of the tissue (the meat) as the modulus of a sub-particle. The stiffness of \
             a block, however, comes mostly from its bonds.",
            rounded(100.0 * modulus / PAPERS_PA, 0)
        )
    }));
    findings.extend(lattice_pa(WHOLE).zip(alone_pa).map(|(whole, alone)| {
        format!(
            "At R = 4 mm, the modulus of the lattice is {} kPa. Bonds contribute {} kPa, the value of S_n π R/2. Contact between \
             bonded neighbours contributes the difference between these two values.",
            rounded(whole / 1e3, 2),
            rounded(alone / 1e3, 2)
        )
    }));
    findings.extend(early.zip(stiffens).map(|(early, stiffens)| {
        format!(
            "The block with R = 4 mm {}. The slope of the stress over the strain in the last 3 % of strain is {} times the slope in \
             the first 3 %. At a strain of {}, the paper's samples have reached a stress of 4 kPa. At this strain, the stress of the \
             block is {} kPa.",
            if stiffens > 1.0 { "stiffens, as the paper's samples do" } else { "does not stiffen" },
            rounded(stiffens, 1),
            rounded(PAPERS_END, 3),
            rounded(early / 1e3, 2)
        )
    }));
    findings.extend(top.zip(after).filter(|(top, after)| after.1 < 0.9 * top.1).map(|(top, after)| {
        format!(
            "The block with R = 1.75 mm has the size of the paper's samples. This block buckles. Its stress rises to {} kPa at a \
             strain of {}, and then falls to {} kPa at a strain of {}.",
            rounded(top.1 / 1e3, 2),
            rounded(top.0, 3),
            rounded(after.1 / 1e3, 2),
            rounded(after.0, 2)
        )
    }));
    let curves = BLOCKS.iter().enumerate().map(|(colour, (name, ..))| {
        let points = points(name).into_iter().map(|(strain, pascal)| (strain, Some(pascal / 1e3)));
        // Dashed, so that a curve below stays visible.
        let style = Style { colour, dash: usize::from(*name == ROUGH) };
        Curve { markers: Markers::None, ..curve(name, style, points) }
    });
    let svg = plot_svg("strain", "stress (kPa)", Scale::Linear, None, curves.collect());
    let mut caption = "Stress over strain of blocks of 10 × 10 × 3 sub-particles.".to_owned();
    if let Some(difference) = relative_difference(&whole, &points(ROUGH)) {
        caption.push_str(&format!(
            " Rough and frictionless plates differ by at most {} of the maximum stress.",
            if difference < 1e-3 {
                "less than 0.1 %".to_owned()
            } else {
                format!("{} %", rounded(100.0 * difference, 1))
            }
        ));
    }
    let picture =
        results.first_record(PAPERS_SIZE).and_then(|record| record.picture(View::Side, Moment::Last));
    let picture = picture.map(|picture| {
        let svg = picture.svg("a block between plates", 420.0);
        Illustration::new(svg, format!("{PAPERS_SIZE}, from the side, at a strain of {END}."))
    });
    let illustrations = svg.map(|svg| Illustration::new(svg, caption)).into_iter().chain(picture);
    Evaluation { rows, illustrations: illustrations.collect(), findings }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stresses_are_interpolated_and_compared_at_the_same_strain() {
        let points = [(0.0, 0.0), (0.25, 10.0), (0.5, 4.0)];
        let stresses = [0.0, 0.125, 0.375, 0.5, 0.6].map(|strain| stress_at(&points, strain));
        assert_eq!(stresses, [Some(0.0), Some(5.0), Some(7.0), Some(4.0), None]);
        assert_eq!(maximum(&points), Some((0.25, 10.0)));
        assert_eq!(relative_difference(&points, &[(0.0, 0.0), (0.5, 20.0)]), Some(1.6));
        assert_eq!(relative_difference(&points, &points), Some(0.0));
    }

    #[test]
    fn steepening_curve_stiffens() {
        let steps = || (0..=200).map(|i| f64::from(i) / 1000.0);
        let straight: Vec<_> = steps().map(|x| (x, 9.0 * x)).collect();
        assert!((stiffening(&straight).unwrap() - 1.0).abs() < 1e-9);
        // y = x²: the slope is 2x, 0.37 at the end and 0.03 at the start on average.
        let bent: Vec<_> = steps().map(|x| (x, x * x)).collect();
        assert!((stiffening(&bent).unwrap() - 0.37 / 0.03).abs() < 1e-6);
        assert_eq!(stiffening(&[]), None);
    }
}
