//! Test of the time step: the mean discharge curves of the paper's step and of `auto` agree.

use roost_stats::{Difference, ReplicateValues, welch};
use roost_terminal::format::significant;
use roost_terminal::plot::{self, Panel, Style};
use serde_json::json;

use super::hopper::{discharged_kg, scenario};
use super::{mean_curve, rounded};
use crate::plan::{Evaluation, Figure, Illustration, Part, Results, Run, with};
use crate::profile::Profile;
use crate::row::Row;

const NAME: &str = "Time step";
const PAPERS: &str = "5.75e-5 s";
const AUTO: &str = "auto";
/// The paper's time step, in seconds.
const PAPERS_STEP_S: f64 = 5.75e-5;
/// Differences below this share of the filled mass are negligible, in per cent.
const NEGLIGIBLE: f64 = 3.0;

/// The comparison.
pub(super) fn figure(profile: &Profile) -> Figure {
    let base = scenario(&profile.timestep_bed, 0.06, "dry");
    let at_papers = with(&base, json!({"numerics": {"timestep_s": PAPERS_STEP_S}}));
    let auto = Run::replicates(AUTO, &base, profile.timestep_seeds);
    let papers = Run::replicates(PAPERS, &at_papers, profile.timestep_seeds);
    Figure {
        name: NAME,
        title: "The time step",
        part: Part::Hopper,
        paper: "The paper uses a time step of 5.75e-5 s and does not say why. This report uses the solver's larger step `auto`; \
                this section shows the effect.",
        runs: auto.into_iter().chain(papers).collect(),
        evaluate,
    }
}

/// Discharged mass at a time as a share of the filled mass, for each seed.
fn shares(results: &Results<'_>, name: &str, t_s: f64) -> ReplicateValues {
    results.values(name, |record| Some(discharged_kg(record, t_s)? / record.response("filled_kg")?))
}

/// Whether a difference, in per cent of the filled mass, is negligible or not significant.
fn agrees(difference: Difference) -> bool {
    difference.mean.abs() < NEGLIGIBLE || difference.contains(0.0)
}

fn evaluate(profile: &Profile, results: &Results<'_>) -> Evaluation {
    let halves = (profile.timestep_bed.duration_s * 2.0) as u32;
    let times: Vec<f64> = (1..=halves).map(|half| f64::from(half) / 2.0).collect();
    let mut rows = Vec::new();
    for &t in &times {
        let (auto, papers) =
            (shares(results, AUTO, t).scaled(100.0), shares(results, PAPERS, t).scaled(100.0));
        let difference = auto
            .complete_sample()
            .zip(papers.complete_sample())
            .and_then(|(auto, papers)| welch(&auto, &papers));
        let holds = difference.is_some_and(agrees);
        let quantity =
            format!("difference of the mean discharged mass at {} s, auto minus 5.75e-5 s", significant(t));
        let row = Row::new(NAME, quantity, "% of the filled mass");
        let row = row.difference_of(difference, auto.values.len() + papers.values.len());
        let row = row.demand_text("less than 3 %, or its 95 % interval (Welch) contains 0", holds);
        let is_wide = difference.is_some_and(|difference| difference.half_width > NEGLIGIBLE);
        rows.push(if is_wide { row.note("the interval is too wide for a conclusion") } else { row });
    }
    let step = |name| results.first_record(name).map(|record| record.result.solver.timestep_s);
    rows.push(Row::new(NAME, "time step of `auto`", "s").paper(PAPERS_STEP_S).single(step(AUTO)));
    let curve = |name: &str, colour| {
        let samples = times.iter().map(|t| (*t, shares(results, name, *t).scaled(100.0).sample()));
        mean_curve(name, Style { colour, dash: 0 }, samples)
    };
    let panel = Panel {
        x_label: "time from belt start (s)".to_owned(),
        y_label: "mean discharged mass (% of filled)".to_owned(),
        curves: vec![curve(AUTO, 0), curve(PAPERS, 1)],
        ..Panel::default()
    };
    let caption = format!(
        "Mean over {} seeds each, with 95 % intervals: {} fillets in a hopper {} cm wide, R = {} mm.",
        profile.timestep_seeds,
        profile.timestep_bed.count,
        significant(profile.timestep_bed.width_m * 100.0),
        significant(profile.timestep_bed.radius_m * 1e3),
    );
    let svg = plot::svg("", &[panel]).ok();
    let illustrations = svg.map(|svg| Illustration::new(svg, caption)).into_iter().collect();
    let spread = |name: &str| {
        let sample = shares(results, name, *times.last()?).scaled(100.0).sample()?;
        Some(rounded(sample.deviation?, 1))
    };
    let findings = spread(AUTO).zip(spread(PAPERS)).map(|(auto, papers)| {
        format!(
            "The discharged masses differ between seeds. At {} s, the standard deviation of the discharged mass is {auto} % of the \
             filled mass with the time step {AUTO}, and {papers} % with the time step {PAPERS}. Therefore the table compares means \
             over seeds, not single simulations.",
            significant(profile.timestep_bed.duration_s)
        )
    });
    Evaluation { rows, illustrations, findings: findings.into_iter().collect() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::figures::fixtures;

    #[test]
    fn difference_agrees_if_negligible_or_not_significant() {
        let agrees = |mean, half_width| super::agrees(Difference { mean, half_width });
        assert!(agrees(-2.9, 0.1) && agrees(5.0, 6.0), "negligible, or within its interval");
        assert!(!agrees(5.0, 4.0) && !agrees(-5.0, 4.0));
    }

    /// Rows of differences, with mean rates of `auto_kg_s` and 2 kg/s of 10 kg in the hopper.
    fn rows(auto_kg_s: f64, is_lost: bool) -> Vec<Row> {
        let profile = crate::profile::PROFILES[0];
        let evaluation = fixtures::evaluate(profile, figure(profile), |run| {
            let rate = if run.name == AUTO { auto_kg_s } else { 2.0 };
            let rate = rate + 0.01 * run.scenario["seed"].as_f64().unwrap();
            let record = fixtures::discharge_record(&[(0.0, 0.0), (4.0, 4.0 * rate)], 10.0);
            (!is_lost || run.name != AUTO || run.scenario["seed"] != 1).then_some(record)
        });
        evaluation.rows.into_iter().filter(|row| row.quantity.contains("difference")).collect()
    }

    #[test]
    fn means_over_all_seeds_are_compared() {
        let same = rows(2.1, false);
        assert_eq!(same[0].holds, Some(true));
        assert!((same[0].measured.as_f64().unwrap() - 0.5).abs() < 1e-6, "0.05 kg of 10: {same:?}");
        assert_eq!(rows(3.0, false)[0].holds, Some(false), "5 %");
        assert_eq!(rows(2.1, true)[0].holds, Some(false), "a seed that is missing");
    }
}
