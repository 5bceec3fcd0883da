//! Fig. 14: discharged mass at a gate opening of 6 cm.

use roost_stats::line;
use roost_terminal::plot::{Curve, Markers, Style};

use super::super::rounded;
use super::{WIDE, bed_text, cells, discharge_plot, discharged_kg, scale_to_hopper, with_plot};
use crate::plan::{Evaluation, Figure, Part, Results};
use crate::profile::Profile;
use crate::record::Record;
use crate::row::{Demand, Row};

const NAME: &str = "Fig. 14";
/// Mass that the paper's experiment discharged in 4 s, in kilograms.
const PAPERS_DISCHARGED_KG: f64 = 33.2;
/// Mass that the paper's experiment loaded, in kilograms.
const PAPERS_LOADED_KG: f64 = 38.21;
/// Belt time of the comparison, in seconds.
const COMPARED_S: f64 = 4.0;
/// Inner volume of the paper's hopper, in m³.
const PAPERS_VOLUME_M3: f64 = 0.0407;

/// The figure.
pub(super) fn figure(profile: &Profile) -> Figure {
    Figure {
        name: NAME,
        title: "Fig. 14: mass discharged at 6 cm",
        part: Part::Hopper,
        paper: "Of 38.21 kg of loaded fillets, around 33.2 kg were fully discharged through 6 cm within 4 s. The simulated mass \
                rises linearly and agrees within 7 %. The hopper's inner volume is 0.0407 m³, and fillets were generated for \
                4 s before the belt started. A simulation of 10 s took about 9 minutes on a GPU. The effective throughput was \
                7.6 kg/s.",
        runs: cells(profile).filter(|run| run.name == WIDE).collect(),
        evaluate,
    }
}

/// R² of a straight line through the curve from 0 to 4 s.
fn linearity(record: &Record) -> Option<f64> {
    let series = record.result.series("discharged_mass")?;
    let points = series.t_s.iter().copied().zip(series.values.iter().copied());
    line(&points.filter(|(t, _)| *t <= COMPARED_S + record.result.solver.timestep_s).collect::<Vec<_>>())
        .map(|line| line.r2)
}

fn evaluate(profile: &Profile, results: &Results<'_>) -> Evaluation {
    let bed = &profile.bed;
    let (factor, records) = (scale_to_hopper(bed), results.sound_records(WIDE));
    let seeds = |name: &str| results.response(WIDE, name);
    let scaled = |name: &str| seeds(name).scaled(factor);
    let at_4_s = results.values(WIDE, |record| discharged_kg(record, COMPARED_S)).scaled(factor);
    let linear = results.values(WIDE, linearity);
    let minimum = linear.range().map(|(minimum, _)| minimum).filter(|_| linear.complete_sample().is_some());
    let spread = at_4_s.sample().and_then(|sample| Some(100.0 * sample.deviation? / sample.mean));
    let share = results
        .values(WIDE, |record| Some(discharged_kg(record, COMPARED_S)? / record.response("loaded_kg")?));
    let minutes = results.values(WIDE, |record| {
        let (cost, solver) = (&record.result.performance, &record.result.solver);
        Some(cost.wall_s / 60.0 * 10.0 / (cost.steps as f64 * solver.timestep_s))
    });
    let bed_text = bed_text(bed);
    let rows = vec![
        Row::new(NAME, "minimum R² of a straight line through the discharged mass from 0 to 4 s", "")
            .paper("linear")
            .value(minimum, linear.values.len())
            .demand(Demand::AtLeast(0.99)),
        Row::new(NAME, "R² of a straight line through the discharged mass, until 80 % is discharged", "").paper("linear").replicates(&seeds("linearity_r2")),
        Row::new(NAME, "discharged mass at 4 s", "kg")
            .paper(PAPERS_DISCHARGED_KG)
            .replicates(&at_4_s)
            .demand(Demand::Near(PAPERS_DISCHARGED_KG, 0.07 * PAPERS_DISCHARGED_KG))
            .note(format!(
                "the width of the simulated hopper was derived from the paper's {PAPERS_DISCHARGED_KG} kg, so this row only checks \
                 consistency and does not validate the model; {bed_text}"
            )),
        Row::new(NAME, "loaded mass", "kg")
            .paper(PAPERS_LOADED_KG)
            .replicates(&scaled("loaded_kg"))
            .note(format!(
                "mass of all fillets that drop into the hopper before the belt starts; {bed_text}; the volume of the fillets was \
                 chosen so that 191 fillets have about the mass in the paper"
            )),
        Row::new(NAME, "share of the loaded mass discharged at 4 s", "")
            .paper(PAPERS_DISCHARGED_KG / PAPERS_LOADED_KG)
            .replicates(&share)
            .note(
                "the width of the simulated hopper was derived from the paper's mass at 4 s, so this row does not validate the model; \
                 the paper calls the hopper fully discharged after a discharge of 33.2 kg of the loaded 38.21 kg",
            ),
        Row::new(NAME, "time until 95 % of the filled mass is discharged", "s").replicates(&seeds("time_to_95_percent_s")),
        Row::new(NAME, "bulk density of the bed at rest", "kg/m³")
            .paper((PAPERS_LOADED_KG / PAPERS_VOLUME_M3).round())
            .replicates(&seeds("bulk_density_kg_m3"))
            .note(
                "paper: 38.21 kg divided by 0.0407 m³, the inner volume of the hopper; Roost: filled mass divided by the volume of the \
                 bed; this volume is the area of the hopper times the bed height; on 95 % of this area, the bed is not higher than the \
                 bed height",
            ),
        Row::new(NAME, "simulated time until the filled hopper is at rest", "s")
            .paper(4.0)
            .replicates(&seeds("fill_duration_s"))
            .note("in the paper, 4 s is the time during which fillets were added to the hopper"),
        Row::new(NAME, "scatter of the mass at 4 s between seeds", "%")
            .value(spread, at_4_s.values.len())
            .note("standard deviation divided by the mean"),
        Row::new(NAME, "effective throughput", "kg/s")
            .paper(7.6)
            .replicates(&scaled("effective_throughput_kg_s"))
            .note(
                "95 % of the filled mass, divided by the time until this mass is discharged; the paper does not define its throughput; \
                 the throughput depends on the width of the hopper, which was derived from the paper's mass at 4 s",
            ),
        Row::new(NAME, "mean rate from 0.5 s until 80 % is discharged", "kg/s").replicates(&scaled("mean_rate_kg_s")),
        Row::new(NAME, "wall time of 10 simulated seconds", "min").paper(9.0).replicates(&minutes).note(
            records.first().map_or_else(String::new, |record| {
                format!(
                    "wall time is the time that passes while the computer simulates; paper: 41,000 sub-particles on a GPU; here: {} \
                     sub-particles on {} thread(s) of {}",
                    with_commas(record.result.performance.subparticles),
                    record.result.solver.threads,
                    record.computed_by()
                )
            }),
        ),
    ];
    let mut findings = vec![
        "The comparison with the paper's 33.2 kg in 4 s does not validate the model. The paper's text does not give the hopper's \
         dimensions, so the width of the simulated hopper was derived from this mass. The derivation assumes that the belt moves a \
         layer of 6 cm height and 940 kg/m³ density at 0.25 m/s. This layer carries 14.1 kg/s per metre of width. A discharge of \
         33.2 kg in 4 s therefore needs a width of 0.59 m."
            .to_owned(),
    ];
    let until = seeds("time_to_95_percent_s");
    findings.extend(until.range().filter(|(minimum, _)| *minimum > COMPARED_S).map(|(minimum, maximum)| {
        format!(
            "The paper says that 33.2 kg were fully discharged within 4 s, and that 38.21 kg were loaded. Here 95 % of the filled \
             mass is discharged after {} to {} s, in {} of {} simulations.",
            rounded(minimum, 1),
            rounded(maximum, 1),
            until.values.len(),
            until.planned
        )
    }));
    let papers = Curve {
        label: "paper: 33.2 kg in 4 s".to_owned(),
        style: Style { colour: 1, dash: 0 },
        markers: Markers::Only,
        points: vec![(COMPARED_S, PAPERS_DISCHARGED_KG)],
        error_bars: vec![0.07 * PAPERS_DISCHARGED_KG],
    };
    let svg = discharge_plot(results, factor, &[WIDE], vec![papers]);
    let caption = format!(
        "Discharged mass over belt time, a curve for each seed: {bed_text}. The paper's point with its 7 %."
    );
    with_plot(rows, findings, svg, caption)
}

/// A count with a comma before each group of three digits, such as 39,182.
fn with_commas(count: u64) -> String {
    let digits = count.to_string();
    let mut text = String::new();
    for (number, digit) in digits.chars().enumerate() {
        if number > 0 && (digits.len() - number).is_multiple_of(3) {
            text.push(',');
        }
        text.push(digit);
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::figures::fixtures;

    #[test]
    fn counts_have_a_comma_before_each_group_of_three_digits() {
        assert_eq!(
            [7, 999, 1000, 39_182, 1_234_567].map(with_commas),
            ["7", "999", "1,000", "39,182", "1,234,567"]
        );
    }

    #[test]
    fn linearity_covers_the_first_4_s() {
        let straight: Vec<_> = (0..=60).map(|i| f64::from(i) * 0.1).map(|t| (t, t.min(4.0))).collect();
        assert!(
            (linearity(&fixtures::discharge_record(&straight, 9.0)).unwrap() - 1.0).abs() < 1e-12,
            "constant after 4 s"
        );
        let bent: Vec<_> = (0..=40).map(|i| f64::from(i) * 0.1).map(|t| (t, t.min(2.0))).collect();
        assert!(linearity(&fixtures::discharge_record(&bent, 9.0)).unwrap() < 0.9);
    }
}
