//! Fig. 14: the mass discharged at 6 cm.

use super::super::rounded;
use super::{WIDE, cells, curves, of_what, out_kg, to_whole, under_curves};
use crate::reproduce::plan::{Figure, Part, Results, Told};
use crate::reproduce::profile::Profile;
use crate::reproduce::record::Record;
use crate::reproduce::row::{Demand, Row};
use crate::reproduce::stats::line;
use crate::ui::plot::{Curve, Look, Mark};

const NAME: &str = "Fig. 14";
/// The mass that the paper's experiment discharged in 4 s, and that it loaded, in kilograms.
const PAPERS_OUT_KG: f64 = 33.2;
const PAPERS_LOAD_KG: f64 = 38.21;
/// When they are compared, in seconds of belt time.
const JUDGED_S: f64 = 4.0;
/// The paper's inner volume of the hopper, in m³.
const PAPERS_BED_M3: f64 = 0.0407;

/// The figure.
pub(super) fn figure(profile: &Profile) -> Figure {
    Figure {
        name: NAME,
        title: "Fig. 14: mass discharged at 6 cm",
        part: Part::Hopper,
        paper: "Around 33.2 kg of fillets were fully discharged through 6 cm within 4 s, of 38.21 kg that were loaded. \
                The simulated mass rises linearly and agrees within 7 %. The hopper's inner volume is 0.0407 m³, and fillets \
                were generated for 4 s before the belt ran. 10 s of it took about 9 minutes on a GPU, at an effective \
                throughput of 7.6 kg/s.",
        runs: cells(profile).filter(|run| run.name == WIDE).collect(),
        tell: told,
    }
}

/// R² of a straight line through the curve over 0 to 4 s.
fn linearity(record: &Record) -> Option<f64> {
    let series = record.result.series("discharged_mass")?;
    let points = series.t_s.iter().copied().zip(series.values.iter().copied());
    line(&points.filter(|(t, _)| *t <= JUDGED_S + record.result.solver.timestep_s).collect::<Vec<_>>())
        .map(|line| line.r2)
}

fn told(profile: &Profile, results: &Results<'_>) -> Told {
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
    let papers = Curve {
        label: "paper: 33.2 kg in 4 s".to_owned(),
        look: Look { colour: 1, dash: 0 },
        mark: Mark::Alone,
        points: vec![(JUDGED_S, PAPERS_OUT_KG)],
        bars: vec![0.07 * PAPERS_OUT_KG],
    };
    let svg = curves(results, factor, &[WIDE], vec![papers]);
    let caption =
        format!("Mass out over belt time, a curve for each seed: {what}. The paper's point with its 7 %.");
    under_curves(rows, findings, svg, caption)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reproduce::figures::made_up;

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
}
